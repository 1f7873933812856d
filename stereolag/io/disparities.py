"""Disparity maps, as ground truth or results of other programs, from untrusted bytes."""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from stereolag.io.images import read_image
from stereolag.io.netpbm import parse_pfm, parse_pgm
from stereolag.io.npy import MAGIC as NPY_MAGIC
from stereolag.io.npy import parse_npy
from stereolag.io.sources import Source, check_pixels, read_bytes

WHAT = "disparity map"
ACCEPTED = "PFM, PNG or PGM of 16 bits (÷ 256) or 8 bits (with a divisor), and NPY"
DIVISOR_OF_16_BITS = 256.0

_BAND_PIXELS = 2**20


def read_disparity(source: Source, *, divisor: float | None = None) -> npt.NDArray[np.float32]:
    """Read a disparity map: PFM, PNG or PGM of 16 or 8 bits, or NPY.

    Parameters
    ----------
    source
        A path, the bytes of the file, or a binary file object.
    divisor
        Divides the stored values to give px. The default is 256 for 16-bit integers (as in KITTI and in this project's
        examples) and 1 for floats. It is required for 8-bit integers: the data sets that use them differ (Middlebury
        2003: 4 for quarter size; Tsukuba: 16).

    Returns
    -------
    disparity
        (rows, cols) float32, px, positive in front of infinity; NaN where the file marks a pixel as unknown:
        0 in an image of integers, infinite or NaN in floats.

    Raises
    ------
    ValueError
        An empty, damaged or unknown file, a colour image, more megapixels than the limit in force, no pixel with a
        disparity, 8-bit integers without a divisor, or a divisor that is not above 0.

    Examples
    --------
    >>> import stereolag as sl
    >>> from stereolag import samples
    >>> disparity = sl.read_disparity(samples.stereo_pairs()["cube"].disparity)
    >>> disparity.shape, disparity.dtype
    ((480, 640), dtype('float32'))
    >>> round(float(disparity[240, 320]), 2)  # px
    45.57
    """
    found = read_stored_disparity(source)
    divisor = found.divisor if divisor is None else divisor
    if divisor is None:
        raise ValueError(f"The {WHAT} has 8 bits per pixel: its divisor must be given, often 1, 2, 4 or 16.")
    return found.divided(divisor)


class StoredDisparity(NamedTuple):
    """A disparity map as stored in a file.

    Attributes
    ----------
    stored
        (rows, cols) numbers of any type.
    divisor
        Divides them to give px, as in :func:`read_disparity`; None for 8 bits, whose divisor is unknown.
    zero_is_unknown
        Whether it is an image of integers, in which 0 means unknown.
    """

    stored: npt.NDArray[Any]
    divisor: float | None
    zero_is_unknown: bool

    def divided(self, divisor: float) -> npt.NDArray[np.float32]:
        """Return the disparities for a divisor, px, as :func:`read_disparity` does.

        Raises
        ------
        ValueError
            A divisor that is not above 0, or no disparity at all.
        """
        if not (divisor > 0 and math.isfinite(divisor)):
            raise ValueError(f"The divisor is {divisor}; allowed are numbers above 0.")
        disparity = _divided(self.stored, divisor, zero_is_unknown=self.zero_is_unknown)
        if np.isnan(disparity).all():
            raise ValueError(f"The {WHAT} holds no disparity at all: every pixel is marked as unknown.")
        return disparity


def read_stored_disparity(source: Source) -> StoredDisparity:
    """Read a disparity map whose divisor may not be known yet; errors as in :func:`read_disparity`."""
    stored, is_image = _stored_values(read_bytes(source, WHAT))
    if stored.ndim != 2:
        raise ValueError(f"The {WHAT} has shape {stored.shape}; allowed is one channel, (rows, cols).")
    divisor = 1.0 if not is_image else None if stored.dtype == np.uint8 else DIVISOR_OF_16_BITS
    return StoredDisparity(stored, divisor, is_image)


def _divided(stored: npt.NDArray[Any], divisor: float, *, zero_is_unknown: bool) -> npt.NDArray[np.float32]:
    """Return the disparities, NaN where unknown, made in bands of rows: whole float64 copies take a lot of memory."""
    disparity = np.empty(stored.shape, np.float32)
    step = max(1, _BAND_PIXELS // max(1, stored.shape[1]))
    for first in range(0, len(stored), step):
        band = stored[first : first + step]
        with np.errstate(all="ignore"):  # overflow is infinite, and infinite is unknown
            part = (band.astype(np.float64) / divisor).astype(np.float32)
        part[~np.isfinite(part)] = np.nan
        if zero_is_unknown:
            part[band == 0] = np.nan
        disparity[first : first + step] = part
    return disparity


def _stored_values(data: bytes) -> tuple[npt.NDArray[Any], bool]:
    """Return the numbers as stored in the file, and whether they are an image of integers, in which 0 is unknown."""
    if data.startswith((b"Pf", b"PF")):
        return parse_pfm(data, WHAT), False
    if data.startswith((b"P2", b"P5")):
        return parse_pgm(data, WHAT), True
    if data.startswith(NPY_MAGIC):
        stored = parse_npy(data, WHAT)
        if stored.ndim == 2:
            check_pixels(stored.shape[1], stored.shape[0], WHAT)
        return stored, False
    try:
        image = read_image(data)
    except ValueError as error:
        raise ValueError(f"The {WHAT} cannot be read; accepted are {ACCEPTED}. {error}") from error
    return image, image.dtype.kind == "u"
