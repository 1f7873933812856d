"""The chunks of a WEBP, from untrusted bytes (RFC 9649)."""

from __future__ import annotations

import struct
from collections.abc import Iterator

from stereolag.io.bare import BarePicture, damaged, too_many
from stereolag.io.tiff import exif_orientation

MAX_CHUNKS = 100_000

_LOSSY, _LOSSLESS, _ALPHA, _FRAME, _EXTENDED, _EXIF = b"VP8 ", b"VP8L", b"ALPH", b"ANMF", b"VP8X", b"EXIF"


def is_webp(data: bytes) -> bool:
    """Return whether the bytes begin like a WEBP."""
    return data.startswith(b"RIFF") and data[8:12] == b"WEBP"


def bare_webp(data: bytes) -> BarePicture:
    """Return a WEBP reduced to its image, or to the first frame of an animation.

    Raises
    ------
    ValueError
        No image, chunks that reach beyond the file, or more of them than any program writes.
    """
    body = alpha = exif = b""
    canvas: tuple[int, int] | None = None
    corner: tuple[int, int] | None = None
    for kind, start, end in _chunks(data, 12, len(data)):
        if kind == _EXTENDED and end - start >= 18 and canvas is None:
            canvas = _three_bytes(data, start + 12) + 1, _three_bytes(data, start + 15) + 1
        elif kind == _EXIF and not exif:
            exif = data[start + 8 : end]
        elif body:
            continue
        elif kind == _FRAME and end - start >= 24:
            corner = 2 * _three_bytes(data, start + 8), 2 * _three_bytes(data, start + 11)
            for part, first, last in _chunks(data, start + 24, end):
                if part == _ALPHA:
                    alpha = data[first:last]
                elif part in (_LOSSY, _LOSSLESS) and not body:
                    body = data[first:last]
        elif kind == _ALPHA:
            alpha = data[start:end]
        elif kind in (_LOSSY, _LOSSLESS):
            body = data[start:end]
    width, height = _size(body)
    chunks = [body]
    if alpha and body.startswith(_LOSSY):
        extended = struct.pack("<B3x", 0x10) + (width - 1).to_bytes(3, "little") + (height - 1).to_bytes(3, "little")
        chunks = [_EXTENDED + struct.pack("<I", 10) + extended, alpha, body]
    length = 4 + sum(len(chunk) for chunk in chunks)
    bare = b"".join((b"RIFF", struct.pack("<I", length), b"WEBP", *chunks))
    placed = (*canvas, *corner) if canvas and corner and (*canvas, 0, 0) != (width, height, *corner) else None
    return BarePicture(bare, width, height, exif_orientation(exif), placed)


def _chunks(data: bytes, start: int, stop: int) -> Iterator[tuple[bytes, int, int]]:
    """Yield the kind, beginning and end of every chunk, including its padding."""
    for _ in range(MAX_CHUNKS):
        if start + 8 > stop:
            return
        kind, length = struct.unpack_from("<4sI", data, start)
        end = start + 8 + length
        if end > stop:
            raise damaged("WEBP")
        end = min(end + length % 2, stop)
        yield kind, start, end
        start = end
    raise too_many("WEBP", "chunks", MAX_CHUNKS)


def _size(body: bytes) -> tuple[int, int]:
    """Return the size stated in the header of a VP8 or VP8L chunk."""
    if body.startswith(_LOSSLESS) and len(body) >= 13 and body[8] == 0x2F:
        bits = int.from_bytes(body[9:13], "little")
        return (bits & 0x3FFF) + 1, (bits >> 14 & 0x3FFF) + 1
    if body.startswith(_LOSSY) and len(body) >= 18 and body[11:14] == b"\x9d\x01\x2a":
        width, height = struct.unpack_from("<HH", body, 14)
        return width & 0x3FFF, height & 0x3FFF
    raise damaged("WEBP")


def _three_bytes(data: bytes, position: int) -> int:
    return int.from_bytes(data[position : position + 3], "little")
