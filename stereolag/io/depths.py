"""Depth maps as files, as ROS has them: TIFF of floats in metres, PNG of 16 bits in millimetres.

Both are those of REP 118 (https://ros.org/reps/rep-0118.html).
"""

from __future__ import annotations

import os
from pathlib import Path

import numpy as np
import numpy.typing as npt

from stereolag.io.disparities import as_map, counts_png
from stereolag.io.images import LARGEST_UINT16, image_tiff, read_image
from stereolag.io.sources import Source, write_file

MAP = "depth map"
MILLIMETRES = 1000.0
FARTHEST_M = LARGEST_UINT16 / MILLIMETRES
"""The farthest depth that a PNG holds, metres."""


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
        A file that is no such image, or has colours or 8 bits a pixel.

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
            f"The {MAP} has shape {stored.shape} and holds {stored.dtype}; allowed is (rows, cols) of floats, metres, "
            "or of uint16, millimetres."
        )
    return _known(stored / MILLIMETRES if stored.dtype == np.uint16 else stored)


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
    target = Path(path)
    written = DEPTH_FORMATS.get(target.suffix.lower())
    if written is None:
        raise ValueError(f"path ends in {target.suffix!r}; a {MAP} is written as {', '.join(DEPTH_FORMATS)}.")
    write_file(target, written(depth))


def depth_tiff(depth: npt.ArrayLike) -> bytes:
    """Return a depth map as a TIFF of 32-bit floats: metres, NaN where there is no depth."""
    return image_tiff(_known(depth))


def depth_png(depth: npt.ArrayLike) -> bytes:
    """Return a depth map as a 16-bit grey PNG: millimetres, at least 1, and 0 where there is no depth.

    Pixels beyond 65.535 m have 0 too; :func:`too_far` counts them.
    """
    millimetres = _millimetres(depth)
    return counts_png(np.where(millimetres <= LARGEST_UINT16, millimetres, np.nan))


def too_far(depth: npt.ArrayLike) -> int:
    """Return the number of pixels of a depth map that are farther than a PNG can hold, 65.535 m."""
    return int((_millimetres(depth) > LARGEST_UINT16).sum())


def _known(depth: npt.ArrayLike) -> npt.NDArray[np.float32]:
    """Return a depth map in metres, with NaN where there is no depth."""
    with np.errstate(over="ignore"):
        metres = as_map(depth, "depth").astype(np.float32)
    return np.where((metres > 0) & np.isfinite(metres), metres, np.float32(np.nan))


def _millimetres(depth: npt.ArrayLike) -> npt.NDArray[np.float64]:
    return np.rint(_known(depth).astype(np.float64) * MILLIMETRES)


DEPTH_FORMATS = {".tif": depth_tiff, ".tiff": depth_tiff, ".png": depth_png}
"""The writers by the suffixes of their files."""
