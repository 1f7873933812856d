"""Depth maps and point clouds as files, in metres: as in ROS (REP 118, https://ros.org/reps/rep-0118.html), and PLY.

A TIFF holds floats in metres, a PNG of 16 bits millimetres.
"""

from __future__ import annotations

import os

import numpy as np
import numpy.typing as npt

from stereolag.io.disparities import as_map, counts_png, write_map
from stereolag.io.images import MAX_UINT16, image_tiff, read_image
from stereolag.io.sources import Source

DEPTH_MAP = "depth map"
"""Name of the map in messages."""

MM_PER_M = 1000.0

MAX_PNG_DEPTH_M = MAX_UINT16 / MM_PER_M
"""Maximum depth that a PNG holds, metres."""


def read_depth(source: Source) -> npt.NDArray[np.float32]:
    """Read a depth map: floats in metres, as a TIFF or PFM, or 16 bits in millimetres, as a PNG.

    Parameters
    ----------
    source
        A path, the bytes of the file, or a binary file object.

    Returns
    -------
    depth
        (rows, cols) float32, metres; NaN where the file has none: 0 or less, infinite or NaN.

    Raises
    ------
    ValueError
        A file that is not such an image, or has colours or 8 bits per pixel.
    OSError
        A path that cannot be opened.

    Examples
    --------
    >>> import numpy as np
    >>> import stereolag as sl
    >>> sl.write_depth("depth.png", [[1.25, np.nan]])  # metres; NaN = none
    >>> sl.read_depth("depth.png")
    array([[1.25,  nan]], dtype=float32)
    """
    stored = read_image(source)
    if stored.ndim != 2 or stored.dtype == np.uint8:
        raise ValueError(
            f"The {DEPTH_MAP} has shape {stored.shape} and holds {stored.dtype}; allowed is (rows, cols) of floats, "
            "metres, or of uint16, millimetres."
        )
    return _valid_depth(stored / MM_PER_M if stored.dtype == np.uint16 else stored)


def write_depth(path: str | os.PathLike[str], depth: npt.ArrayLike) -> None:
    """Write a depth map; :func:`stereolag.read_depth` reads it back.

    Parameters
    ----------
    path
        Its suffix selects the format: ``.tif`` or ``.tiff`` stores metres as float32, NaN where there is no depth;
        ``.png`` stores whole millimetres up to 65.535 m in 16 bits, 0 where there is no depth and beyond that. An
        existing file is replaced.
    depth
        (rows, cols), metres, as :meth:`stereolag.Calibration.depth` returns it; NaN for pixels without one.

    Raises
    ------
    ValueError
        Another suffix, or an array that is not (rows, cols); nothing is written then.
    OSError
        The folder does not exist, the disk is full, and so on; an existing file is left unchanged.

    Examples
    --------
    >>> import stereolag as sl
    >>> camera = sl.Calibration(focal_px=1000.0, baseline_m=0.1)
    >>> sl.write_depth("depth.tif", camera.depth([[50.0, 8.0]]))  # px to metres
    >>> sl.read_depth("depth.tif")
    array([[ 2. , 12.5]], dtype=float32)
    """
    write_map(path, depth, DEPTH_MAP, DEPTH_FORMATS)


def depth_tiff(depth: npt.ArrayLike) -> bytes:
    """Return a depth map as a TIFF of 32-bit floats: metres, NaN where there is no depth."""
    return image_tiff(_valid_depth(depth))


def depth_png(depth: npt.ArrayLike) -> bytes:
    """Return a depth map as a 16-bit grey PNG: millimetres, at least 1, and 0 where there is no depth.

    Pixels beyond 65.535 m are also 0; :func:`too_far` counts them.
    """
    millimetres = _millimetres(depth)
    return counts_png(np.where(millimetres <= MAX_UINT16, millimetres, np.nan))


def too_far(depth: npt.ArrayLike) -> int:
    """Return the number of pixels of a depth map that are farther than a PNG can hold, 65.535 m."""
    return int((_millimetres(depth) > MAX_UINT16).sum())


def _valid_depth(depth: npt.ArrayLike) -> npt.NDArray[np.float32]:
    """Return a depth map in metres as float32, with NaN where there is no depth."""
    with np.errstate(over="ignore"):
        metres = as_map(depth, "depth").astype(np.float32)
    return np.where((metres > 0) & np.isfinite(metres), metres, np.float32(np.nan))


def _millimetres(depth: npt.ArrayLike) -> npt.NDArray[np.float64]:
    return np.rint(_valid_depth(depth).astype(np.float64) * MM_PER_M)


DEPTH_FORMATS = {".tif": depth_tiff, ".tiff": depth_tiff, ".png": depth_png}
"""The writers by suffix."""


# Points.

VERTEX = np.dtype([("position", "<f4", 3), ("colour", "u1", 3)])

_PLY_HEADER = """\
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
    positions, rgb = np.asarray(points, dtype=np.float32), np.asarray(colours)
    if positions.ndim != 2 or positions.shape[1] != 3 or positions.shape != rgb.shape:
        raise ValueError(f"points has shape {positions.shape} and colours {rgb.shape}; both must be (n, 3).")
    if rgb.dtype != np.uint8:
        raise ValueError(f"colours holds {rgb.dtype}; allowed is uint8.")
    bad = len(positions) - int(np.isfinite(positions).all(axis=1).sum())
    if bad:
        raise ValueError(f"points holds {bad} points that are NaN or infinite; every coordinate must be finite.")
    vertices = np.empty(len(positions), dtype=VERTEX)
    vertices["position"], vertices["colour"] = positions, rgb
    return _PLY_HEADER.format(count=len(vertices)).encode() + vertices.tobytes()
