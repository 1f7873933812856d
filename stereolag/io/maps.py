"""Disparity maps in the file formats of stereo benchmarks and programs."""

from __future__ import annotations

import io
from typing import Any

import cv2
import numpy as np
import numpy.typing as npt
from PIL import Image as PillowImage

from stereolag.core.inputs import as_image
from stereolag.stereo.matcher import DisparityMap

KITTI_SCALE = 256
LARGEST_UINT16 = 65535
BEHIND_INFINITY = -0.5
"""Lowest disparity that the sub-pixel fit may give to a point at infinity, px."""


def pfm(disparity: npt.ArrayLike) -> bytes:
    """Return a disparity map as a grey PFM: float32, little-endian, bottom row first.

    Parameters
    ----------
    disparity
        (rows, cols), px; NaN or infinite for pixels without one, written as +infinity, as in Middlebury's files.

    Raises
    ------
    ValueError
        An array that is not (rows, cols).

    Notes
    -----
    The header's scale is exactly -1.0. Its sign gives the byte order; its magnitude has no agreed meaning, and OpenCV
    divides by it: from a Middlebury file with the scale 0.003922 (1/255) it reads disparities 255 times too large. At
    -1.0 all readers agree. Format: https://www.pauldebevec.com/Research/HDR/PFM/
    """
    values = _as_map(disparity)
    stored = np.where(np.isfinite(values), values, np.inf).astype("<f4")
    return f"Pf\n{values.shape[1]} {values.shape[0]}\n-1.0\n".encode() + stored[::-1].tobytes()


def kitti_png(disparity: npt.ArrayLike) -> bytes:
    """Return a disparity map as KITTI stores it: a 16-bit grey PNG of the disparity × 256, 0 for pixels without one.

    Parameters
    ----------
    disparity
        (rows, cols), px, from -0.5 to 255.99; NaN or infinite for pixels without one. It is rounded to 1/256 px. Values
        that would become 0, and those that the sub-pixel fit put up to half a pixel behind infinity, become
        1/256 px.

    Raises
    ------
    ValueError
        A disparity that the format cannot store, or an array that is not (rows, cols).

    Notes
    -----
    Format: the development kit of Geiger, Lenz & Urtasun, "Are we ready for autonomous driving?", CVPR 2012.
    """
    check_kitti(disparity)
    values = _as_map(disparity)
    known = np.isfinite(values)
    pixels = np.zeros(values.shape, dtype=np.uint16)
    pixels[known] = np.maximum(1, np.rint(values[known] * KITTI_SCALE))
    return image_png(pixels)


def check_kitti(disparity: npt.ArrayLike) -> None:
    """Refuse a disparity map that :func:`kitti_png` cannot store; far quicker than trying.

    Raises
    ------
    ValueError
        As :func:`kitti_png` does.
    """
    values = _as_map(disparity)
    known = values[np.isfinite(values)]
    if known.size == 0:
        return
    low, high = float(known.min()), float(known.max())
    first, last = np.rint(low * KITTI_SCALE), np.rint(high * KITTI_SCALE)
    if first < BEHIND_INFINITY * KITTI_SCALE or last > LARGEST_UINT16:
        raise ValueError(
            f"disparity reaches from {low:.2f} to {high:.2f} px; KITTI's PNG holds 0 to 255.99 px, "
            "PFM and NPY hold any."
        )


def npy(array: npt.ArrayLike) -> bytes:
    """Return an array of numbers as the bytes of an ``.npy`` file, bit for bit."""
    stream = io.BytesIO()
    np.save(stream, np.asarray(array), allow_pickle=False)
    return stream.getvalue()


def _as_map(disparity: npt.ArrayLike) -> npt.NDArray[np.floating[Any]]:
    values = np.asarray(disparity)
    if values.ndim != 2 or values.size == 0:
        raise ValueError(f"disparity has shape {values.shape}; allowed is (rows, cols) with at least one pixel.")
    return values.astype(np.float64 if values.dtype == np.float64 else np.float32, copy=False)


def image_png(image: npt.ArrayLike) -> bytes:
    """Return an image as a lossless PNG.

    Parameters
    ----------
    image
        (rows, cols) grey, (rows, cols, 3) RGB or (rows, cols, 4) RGBA, uint8 or uint16; bool becomes 0 and 255.

    Raises
    ------
    ValueError
        Floats, which a PNG cannot store, or another shape.
    """
    pixels = as_image(image, "image")
    if pixels.dtype not in (np.uint8, np.uint16):
        raise ValueError(f"image holds {pixels.dtype}; a PNG holds uint8 or uint16, floats go into an .npy file.")
    if pixels.ndim == 3:
        order = cv2.COLOR_RGB2BGR if pixels.shape[2] == 3 else cv2.COLOR_RGBA2BGRA
        pixels = np.asarray(cv2.cvtColor(np.ascontiguousarray(pixels), order))
    _, data = cv2.imencode(".png", pixels)
    return data.tobytes()


def image_tiff(image: npt.ArrayLike) -> bytes:
    """Return a grey image of floats as a TIFF with 32 bits per pixel, since a PNG stores integers only.

    Parameters
    ----------
    image
        (rows, cols) float.

    Raises
    ------
    ValueError
        Another shape or type.
    """
    pixels = as_image(image, "image")
    if pixels.ndim != 2 or pixels.dtype.kind != "f":
        raise ValueError(f"image has shape {pixels.shape} and holds {pixels.dtype}; allowed is (rows, cols) of floats.")
    stream = io.BytesIO()
    PillowImage.fromarray(pixels.astype(np.float32)).save(stream, "TIFF")
    return stream.getvalue()


def valid_mask_png(result: DisparityMap) -> bytes:
    """Return an 8-bit grey PNG of a result: 255 where there is a disparity, measured or filled, and 0 elsewhere."""
    return image_png(result.valid)


VERTEX = np.dtype([("position", "<f4", 3), ("colour", "u1", 3)])

_HEADER = """\
ply
format binary_little_endian 1.0
comment metres in the frame of the left camera: x right, y down, z forward
element vertex {count}
property float x
property float y
property float z
property uchar red
property uchar green
property uchar blue
end_header
"""


def ply(points: npt.ArrayLike, colours: npt.ArrayLike) -> bytes:
    """Return a coloured point cloud as a binary little-endian PLY, which MeshLab, CloudCompare and Blender open.

    Parameters
    ----------
    points
        (n, 3), metres, as returned by :meth:`~stereolag.geometry.calibration.Calibration.point_cloud`; stored as
        float32.
    colours
        (n, 3) uint8 RGB.

    Raises
    ------
    ValueError
        Arrays of other shapes or types, or a point that is not finite.

    Notes
    -----
    Format: Greg Turk, "The PLY Polygon File Format", 1994.
    """
    positions, shades = np.asarray(points, dtype=np.float32), np.asarray(colours)
    if positions.ndim != 2 or positions.shape[1] != 3 or positions.shape != shades.shape:
        raise ValueError(f"points has shape {positions.shape} and colours {shades.shape}; both must be (n, 3).")
    if shades.dtype != np.uint8:
        raise ValueError(f"colours holds {shades.dtype}; allowed is uint8.")
    bad = len(positions) - int(np.isfinite(positions).all(axis=1).sum())
    if bad:
        raise ValueError(f"points holds {bad} points that are NaN or infinite; every coordinate must be finite.")
    vertices = np.empty(len(positions), dtype=VERTEX)
    vertices["position"], vertices["colour"] = positions, shades
    return _HEADER.format(count=len(vertices)).encode() + vertices.tobytes()
