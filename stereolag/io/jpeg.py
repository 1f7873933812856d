"""The segments of a JPEG, from untrusted bytes (ITU-T T.81)."""

from __future__ import annotations

import re
import struct

from stereolag.io.bare import BarePicture, damaged, too_many
from stereolag.io.tiff import exif_orientation

MAGIC = b"\xff\xd8\xff"
MAX_SEGMENTS = 100_000
MAX_TABLES = 2_000
MAX_SCANS = 100
MAX_SCANNED_MEGAPIXELS = 1_500
"""Scans times megapixels; a progressive image of 50 megapixels usually has 10 scans."""

_NEXT_MARKER = re.compile(rb"\xff+[^\x00\xd0-\xd7\xff]")
_START_OF_FRAME = frozenset(range(0xC0, 0xD0)) - {0xC4, 0xC8, 0xCC}
_ARITHMETIC = frozenset(range(0xC9, 0xD0))
_START_OF_SCAN, _END, _COMMENT, _JFIF, _EXIF, _ADOBE = 0xDA, 0xD9, 0xFE, 0xE0, 0xE1, 0xEE


def bare_jpeg(data: bytes) -> BarePicture:
    """Return a JPEG reduced to its tables and scans.

    Raises
    ------
    ValueError
        Segments that reach beyond the file, no header, arithmetic coding, or far too many segments or scans.
    """
    view, position = memoryview(data), 2
    pieces: list[bytes | memoryview] = [view[:2]]
    width = height = tables = scans = 0
    exif, ended = b"", False
    for _ in range(MAX_SEGMENTS):
        found = _NEXT_MARKER.search(data, position)
        if found is None:
            break
        marker, start = data[found.end() - 1], found.end()
        if marker == _END:
            ended = True
            break
        if marker in (0x01, 0xD8):
            position = start
            continue
        end = start + int.from_bytes(data[start : start + 2], "big")
        if end < start + 2 or end > len(data):
            raise damaged("JPEG")
        position = end
        if marker in _START_OF_FRAME and not width:
            if marker in _ARITHMETIC:
                raise ValueError("The image is a JPEG with arithmetic coding, which is not accepted; save it again.")
            if end - start < 8:
                raise damaged("JPEG")
            height, width = struct.unpack_from(">HH", data, start + 3)
        if marker == _EXIF and not exif and data[start + 2 : start + 8] == b"Exif\0\0":
            exif = data[start + 8 : end]
        if marker == _START_OF_SCAN:
            following = _NEXT_MARKER.search(data, end)
            position = len(data) if following is None else following.start()
            scans += 1
        elif marker == _COMMENT or (0xE0 <= marker <= 0xEF and marker not in (_JFIF, _ADOBE)):
            continue
        else:
            tables += 1
        _check_work(scans, tables, width * height)
        pieces += (b"\xff", view[start - 1 : position])
    else:
        raise too_many("JPEG", "segments", MAX_SEGMENTS)
    if not width or not scans or not ended:
        raise damaged("JPEG")
    pieces.append(b"\xff\xd9")
    return BarePicture(b"".join(pieces), width, height, exif_orientation(exif))


def is_progressive_colour(data: bytes) -> bool:
    """Return whether a bare JPEG is progressive with three channels."""
    frame = data.find(b"\xff\xc2")
    while frame >= 0 and data[frame + 4 : frame + 5] != b"\x08":
        frame = data.find(b"\xff\xc2", frame + 1)
    return frame >= 0 and data[frame + 9 : frame + 10] == b"\x03"


def _check_work(scans: int, tables: int, pixels: int) -> None:
    if scans > min(MAX_SCANS, max(10, MAX_SCANNED_MEGAPIXELS * 1_000_000 // max(pixels, 1))):
        raise too_many("JPEG", "scans for its size", scans - 1)
    if tables > MAX_TABLES:
        raise too_many("JPEG", "tables", MAX_TABLES)
