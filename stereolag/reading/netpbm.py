"""Maps in the Netpbm family: PGM (grey integers) and PFM (grey floats), values as stored.

Our own small readers, because Pillow stretches a PGM to the full range of its type and OpenCV 5 multiplies some PFMs
by 256. Formats: https://netpbm.sourceforge.net/doc/pgm.html and https://www.pauldebevec.com/Research/HDR/PFM/
"""

from __future__ import annotations

import re
from typing import Any

import numpy as np
import numpy.typing as npt

from stereolag.reading.sources import check_pixels

_GAP = rb"(?:\s|#[^\n\r]*[\n\r])+"
_PGM_HEADER = re.compile(rb"P5" + _GAP + rb"(\d{1,9})" + _GAP + rb"(\d{1,9})" + _GAP + rb"(\d{1,9})\s")
_PFM_HEADER = re.compile(rb"Pf\s+(\d{1,9})\s+(\d{1,9})\s+([-+0-9.eE]{1,40})(?:\r\n|\s)")


def parse_pfm(data: bytes, what: str) -> npt.NDArray[np.float32]:
    """Return the (rows, cols) floats of a grey PFM, top row first.

    The sign of the scale tells the byte order; its size, which writers use for all sorts of things, is ignored.

    Raises
    ------
    ValueError
        Colour, a broken header, too many pixels or too few bytes.
    """
    header = _PFM_HEADER.match(data)
    if header is None:
        raise ValueError(f"The {what} is not a grey PFM: it must begin with Pf, width, height and scale.")
    width, height = int(header[1]), int(header[2])
    check_pixels(width, height, what)
    try:
        scale = float(header[3])
    except ValueError:
        scale = 0.0
    if scale == 0 or not np.isfinite(scale):
        raise ValueError(f"The {what} (PFM) has the scale {header[3].decode()}; allowed are numbers other than 0.")
    dtype = np.dtype("<f4" if scale < 0 else ">f4")
    rows = _from_binary(data, header.end(), dtype, width, height, what)
    return rows[::-1].astype(np.float32)


def parse_pgm(data: bytes, what: str) -> npt.NDArray[np.unsignedinteger[Any]]:
    """Return the (rows, cols) integers of a binary PGM, uint16 where its largest value is above 255, else uint8.

    Raises
    ------
    ValueError
        A broken header, too many pixels, too few bytes, or numbers beyond the largest announced.
    """
    header = _PGM_HEADER.match(data)
    if header is None:
        raise ValueError(f"The {what} is not a binary PGM: it must begin with P5, width, height and largest value.")
    width, height, largest = int(header[1]), int(header[2]), int(header[3])
    check_pixels(width, height, what)
    if not 1 <= largest <= 65535:
        raise ValueError(f"The {what} (PGM) has {largest} for its largest value; allowed are 1 to 65535.")
    native: np.dtype[np.unsignedinteger[Any]] = np.dtype(np.uint8 if largest < 256 else np.uint16)
    pixels = _from_binary(data, header.end(), native.newbyteorder(">"), width, height, what)
    if pixels.max() > largest:
        raise ValueError(f"The {what} (PGM) holds {pixels.max()}, above the {largest} it announces.")
    return pixels.astype(native)


def _from_binary(
    data: bytes, offset: int, dtype: np.dtype[Any], width: int, height: int, what: str
) -> npt.NDArray[Any]:
    needed, found = width * height * dtype.itemsize, len(data) - offset
    if found < needed:
        raise ValueError(f"The {what} is cut short: {width} × {height} pixels need {needed} bytes, it has {found}.")
    return np.frombuffer(data, dtype, width * height, offset).reshape(height, width)
