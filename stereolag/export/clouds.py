"""Point clouds as PLY."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

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
        (n, 3), metres, as :meth:`~stereolag.calibration.Calibration.point_cloud` gives them; stored as float32.
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
