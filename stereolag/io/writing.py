"""Results as files on disk, written whole or not at all."""

from __future__ import annotations

import os
from collections.abc import Callable
from pathlib import Path
from uuid import uuid4

import numpy as np
import numpy.typing as npt

from stereolag.io.disparities import kitti_png, npy, pfm
from stereolag.io.settings import settings_json
from stereolag.stereo.matcher import StereoMatcher


def write_disparity(path: str | os.PathLike[str], disparity: npt.ArrayLike) -> None:
    """Write a disparity map; :func:`stereolag.read_disparity` reads it back.

    Parameters
    ----------
    path
        Its suffix selects the format: ``.pfm`` and ``.npy`` store any disparity as float32, ``.png`` stores 0 to
        255.99 px in steps of 1/256 px (16 bits, as in KITTI: :func:`stereolag.io.kitti_png`). An existing file is
        replaced.
    disparity
        (rows, cols), px; NaN or infinite for pixels without one.

    Raises
    ------
    ValueError
        Another suffix, an array that is not (rows, cols), or a disparity that the format cannot store; nothing is
        written then.
    OSError
        The folder does not exist, the disk is full, and so on; an existing file is left unchanged.

    Examples
    --------
    >>> import numpy as np
    >>> import stereolag as sl
    >>> sl.write_disparity("map.pfm", [[12.5, np.nan]])  # px; NaN = none
    >>> sl.read_disparity("map.pfm")
    array([[12.5,  nan]], dtype=float32)
    """
    target = Path(path)
    encode = DISPARITY_FORMATS.get(target.suffix.lower())
    if encode is None:
        allowed = ", ".join(DISPARITY_FORMATS)
        raise ValueError(f"path ends in {target.suffix!r}; a disparity map is written as {allowed}.")
    write_file(target, encode(disparity))


def write_matcher(path: str | os.PathLike[str], matcher: StereoMatcher) -> None:
    """Write the settings of a matcher as JSON, whatever the suffix; :func:`stereolag.read_matcher` reads them back.

    Raises
    ------
    OSError
        The folder does not exist, the disk is full, and so on; an existing file is left unchanged.

    Examples
    --------
    >>> import stereolag as sl
    >>> matcher = sl.StereoBM(num_disparities=96, block_size=15)  # px
    >>> sl.write_matcher("settings.json", matcher)
    >>> sl.read_matcher("settings.json") == matcher
    True
    """
    write_file(Path(path), settings_json(matcher).encode())


def _npy(disparity: npt.ArrayLike) -> bytes:
    values = np.asarray(disparity, dtype=np.float32)
    if values.ndim != 2 or values.size == 0:
        raise ValueError(f"disparity has shape {values.shape}; allowed is (rows, cols) with at least one pixel.")
    return npy(np.where(np.isfinite(values), values, np.float32(np.nan)))


DISPARITY_FORMATS: dict[str, Callable[[npt.ArrayLike], bytes]] = {".pfm": pfm, ".npy": _npy, ".png": kitti_png}
"""The encoder for each suffix, in lower case."""


def write_file(path: Path, data: bytes, *, synced: bool = True) -> None:
    """Write a temporary file beside `path` and move it there once it is complete.

    Parameters
    ----------
    path
        Path of the file, in an existing folder.
    data
        Content of the file.
    synced
        Wait until the data is on the disk. If not, a power failure may leave half a file, but an interrupted process
        still cannot.

    Raises
    ------
    OSError
        As :func:`write_disparity` does.
    """
    part = path.with_name(f".{uuid4().hex}.part")
    try:
        with part.open("xb") as file:
            file.write(data)
            file.flush()
            if synced:
                os.fsync(file.fileno())
        part.replace(path)
    finally:
        part.unlink(missing_ok=True)
