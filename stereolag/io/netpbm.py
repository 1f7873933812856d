"""The Netpbm family: PBM, PGM and PPM (bits, grey and colour integers) and PFM (grey floats).

These are our own small readers, because Pillow reads most of them in a Python loop, cuts colour to 8 bits and stretches
a PGM to the full range of its type, and OpenCV 5 multiplies some PFMs by 256.
Formats: https://netpbm.sourceforge.net/doc/pgm.html and https://www.pauldebevec.com/Research/HDR/PFM/
"""

from __future__ import annotations

import re
from typing import Any

import numpy as np
import numpy.typing as npt

from stereolag.io.bare import damaged
from stereolag.io.sources import HEADER_BYTES, check_pixels

MAX_PLAIN_BYTES = 16 * 2**20
"""Limited because numbers written as text are slow to read."""
MAX_COMMENTS = 10_000

_TOKEN = re.compile(rb"#[^\r\n]*|[^\s#]+")
_COMMENT = re.compile(rb"#[^\r\n]*")
_FIELD_NAMES = {b"P1": ("width", "height"), b"P4": ("width", "height")}
_PLAIN = {b"P1": b"P4", b"P2": b"P5", b"P3": b"P6"}


def parse_netpbm(data: bytes, what: str) -> npt.NDArray[Any]:
    """Return a P1 to P6 or Pf image, integers stretched to the full range of their type.

    Returns
    -------
    pixels
        (rows, cols) or, for P3 and P6, (rows, cols, 3); uint8, or uint16 if the largest value is above 255; float32
        for a PFM.

    Raises
    ------
    ValueError
        A broken header, too many or too few pixels, or too long a text.
    """
    if data.startswith(b"Pf"):
        return np.ascontiguousarray(parse_pfm(data, what), dtype=np.float32)
    magic = data[:2]
    header = _header(data, magic, 2 if magic in _FIELD_NAMES else 3)
    if header is None:
        raise ValueError(f"The {what} begins like a PPM, PGM or PBM, but no size and largest value follow.")
    fields, offset = header
    width, height, *rest = (int(field) if field.isdigit() and len(field) < 10 else 0 for field in fields)
    check_pixels(width, height, what)
    largest = rest[0] if rest else 1
    _check_largest(largest, what)
    channels = 3 if magic in (b"P3", b"P6") else 1
    if magic in _PLAIN:
        pixels = _from_text(data, offset, magic, width * height * channels, what)
    elif magic == b"P4":
        packed = _from_binary(data, offset, np.dtype(np.uint8), (width + 7) // 8, height, what)
        pixels = 1 - np.unpackbits(packed, axis=1, count=width)
    else:
        pixels = _from_binary(data, offset, np.dtype(">u2" if largest > 255 else "u1"), width * channels, height, what)
    shape = (height, width, 3) if channels == 3 else (height, width)
    return _stretched(pixels.reshape(height, width * channels), largest).reshape(shape)


def parse_pfm(data: bytes, what: str) -> npt.NDArray[np.floating[Any]]:
    """Return the (rows, cols) floats of a grey PFM, top row first: a view of the file in its byte order.

    The sign of the scale gives the byte order; its magnitude, which writers use for all sorts of things, is ignored.

    Raises
    ------
    ValueError
        Colour, a broken header, too many pixels or too few bytes.
    """
    header = _header(data, b"Pf", 3)
    if header is None:
        raise ValueError(f"The {what} is not a grey PFM: it must begin with Pf, width, height and scale.")
    (columns, rows, written), offset = header
    if not (columns.isdigit() and rows.isdigit() and len(columns) < 10 and len(rows) < 10):
        raise ValueError(f"The {what} is not a grey PFM: it must begin with Pf, width, height and scale.")
    width, height = int(columns), int(rows)
    check_pixels(width, height, what)
    scale = float(written) if re.fullmatch(rb"[-+]?(\d+\.?\d*|\.\d+)([eE][-+]?\d+)?", written[:40]) else 0.0
    if scale == 0 or not np.isfinite(scale):
        shown = re.sub(r"[^-+.\w]", "?", written[:40].decode("latin-1"))
        raise ValueError(f"The {what} (PFM) has the scale {shown}; allowed are numbers other than 0.")
    return _from_binary(data, offset, np.dtype("<f4" if scale < 0 else ">f4"), width, height, what)[::-1]


def parse_pgm(data: bytes, what: str) -> npt.NDArray[np.unsignedinteger[Any]]:
    """Return the (rows, cols) integers of a binary PGM as stored, uint16 if its largest is above 255, else uint8.

    Raises
    ------
    ValueError
        A broken header, too many pixels, too few bytes, or numbers above the announced largest value.
    """
    header = _header(data, b"P5", 3)
    if header is None or not all(field.isdigit() and len(field) < 10 for field in header[0]):
        raise ValueError(f"The {what} is not a binary PGM: it must begin with P5, width, height and largest value.")
    width, height, largest = (int(field) for field in header[0])
    check_pixels(width, height, what)
    _check_largest(largest, what)
    native: np.dtype[np.unsignedinteger[Any]] = np.dtype(np.uint8 if largest < 256 else np.uint16)
    pixels = _from_binary(data, header[1], native.newbyteorder(">"), width, height, what)
    if pixels.max() > largest:
        raise ValueError(f"The {what} (PGM) holds {pixels.max()}, above the {largest} it announces.")
    return pixels.astype(native)


def _header(data: bytes, magic: bytes, count: int) -> tuple[list[bytes], int] | None:
    """Return the fields after the magic number and the offset of the pixels, which follow one space or line end."""
    beginning = data[:HEADER_BYTES]
    if not beginning.startswith(magic) or beginning[2:3] not in (b" ", b"\t", b"\r", b"\n", b"#"):
        return None
    fields: list[bytes] = []
    for found in _TOKEN.finditer(beginning, 2):
        if found[0].startswith(b"#"):
            continue
        fields.append(found[0])
        if len(fields) == count:
            end = found.end()
            if not beginning[end : end + 1].isspace():
                return None
            return fields, end + (2 if beginning[end : end + 2] == b"\r\n" and magic == b"Pf" else 1)
    return None


def _check_largest(largest: int, what: str) -> None:
    if not 1 <= largest <= 65535:
        raise ValueError(f"The {what} (PGM) has {largest} for its largest value; allowed are 1 to 65535.")


def _from_binary(
    data: bytes, offset: int, dtype: np.dtype[Any], width: int, height: int, what: str
) -> npt.NDArray[Any]:
    needed, found = width * height * dtype.itemsize, len(data) - offset
    if found < needed:
        raise ValueError(f"The {what} is cut short: {width} × {height} pixels need {needed} bytes, it has {found}.")
    return np.frombuffer(data, dtype, width * height, offset).reshape(height, width)


def _from_text(data: bytes, offset: int, magic: bytes, count: int, what: str) -> npt.NDArray[Any]:
    if len(data) > MAX_PLAIN_BYTES:
        raise ValueError(
            f"The {what} holds its pixels as {len(data) / 1e6:.0f} MB of text; at most {MAX_PLAIN_BYTES / 1e6:.0f} MB "
            f"are accepted: save it as binary ({_PLAIN[magic].decode()}) or PNG."
        )
    if data.count(b"#") > MAX_COMMENTS:
        raise ValueError(f"The {what} holds more than {MAX_COMMENTS:,} comments among its pixels; save it as PNG.")
    text = _COMMENT.sub(b" ", data[offset:])
    if magic == b"P1":
        bits = text.translate(None, b" \t\r\n\v\f")[:count]
        pixels = 1 - (np.frombuffer(bits, np.uint8) - np.uint8(ord("0")))
        allowed = bool((pixels <= 1).all())
    else:
        words = np.array(text.split(maxsplit=count)[:count], dtype="S6")
        allowed = bool(np.char.isdigit(words).all()) if words.size else True
        pixels = words.astype(np.int32) if allowed else words
    if not allowed:
        raise ValueError(f"The {what} ({magic.decode()}) holds something other than whole numbers from 0.")
    if pixels.size < count:
        raise damaged("PPM")
    return pixels


def _stretched(pixels: npt.NDArray[Any], largest: int) -> npt.NDArray[Any]:
    """Return the rows scaled so that `largest` becomes the largest number of their type."""
    dtype = np.dtype(np.uint8 if largest < 256 else np.uint16)
    full = 255 if largest < 256 else 65535
    if largest == full and pixels.dtype.kind == "u":
        return pixels.astype(dtype)
    stretched = np.empty(pixels.shape, dtype)
    step = max(1, 2**20 // pixels.shape[1])
    for first in range(0, len(pixels), step):
        band = pixels[first : first + step].astype(np.float64)
        stretched[first : first + step] = np.rint(np.minimum(band * full / largest, full))
    return stretched
