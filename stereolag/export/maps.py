"""Disparity maps in the files that stereo benchmarks and programs exchange."""

from __future__ import annotations

import io
from typing import Any

import numpy as np
import numpy.typing as npt

from stereolag.export.rasters import image_png

KITTI_SCALE = 256
LARGEST_UINT16 = 65535
BEHIND_INFINITY = -0.5
"""Px; how far below 0 the sub-pixel fit may put a point at infinity."""


def pfm(disparity: npt.ArrayLike) -> bytes:
    """Return a disparity map as a grey PFM: float32, little-endian, bottom row first.

    Parameters
    ----------
    disparity
        (rows, cols), px; NaN or infinite where there is none, written as +infinity, as Middlebury's files have it.

    Raises
    ------
    ValueError
        An array that is not (rows, cols).

    Notes
    -----
    The header's scale is exactly -1.0. Its sign is the byte order; its size has no agreed meaning, and OpenCV divides
    by it: of a Middlebury file with the scale 0.003922 (1/255) it makes disparities 255 times too large. At -1.0 all
    readers agree. Format: https://www.pauldebevec.com/Research/HDR/PFM/
    """
    values = _as_map(disparity)
    stored = np.where(np.isfinite(values), values, np.inf).astype("<f4")
    return f"Pf\n{values.shape[1]} {values.shape[0]}\n-1.0\n".encode() + stored[::-1].tobytes()


def kitti_png(disparity: npt.ArrayLike) -> bytes:
    """Return a disparity map as KITTI stores it: a 16-bit grey PNG of the disparity × 256, 0 where there is none.

    Parameters
    ----------
    disparity
        (rows, cols), px, from -0.5 to 255.99; NaN or infinite where there is none. It is rounded to 1/256 px. What
        would become 0, and what the sub-pixel fit put less than half a pixel behind infinity, becomes 1/256 px.

    Raises
    ------
    ValueError
        A disparity that the format cannot hold, or an array that is not (rows, cols).

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
    """Refuse a disparity map that :func:`kitti_png` cannot hold; far quicker than trying.

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
    if low <= BEHIND_INFINITY or np.rint(high * KITTI_SCALE) > LARGEST_UINT16:
        raise ValueError(
            f"disparity reaches from {low:.2f} to {high:.2f} px; KITTI's PNG holds 0 to 255.99 px, "
            "PFM and NPY hold any."
        )


def npy(array: npt.ArrayLike) -> bytes:
    """Return an array of numbers as the bytes of an ``.npy`` file, every bit kept."""
    stream = io.BytesIO()
    np.save(stream, np.asarray(array), allow_pickle=False)
    return stream.getvalue()


def _as_map(disparity: npt.ArrayLike) -> npt.NDArray[np.floating[Any]]:
    values = np.asarray(disparity)
    if values.ndim != 2 or values.size == 0:
        raise ValueError(f"disparity has shape {values.shape}; allowed is (rows, cols) with at least one pixel.")
    return values.astype(np.float64 if values.dtype == np.float64 else np.float32, copy=False)
