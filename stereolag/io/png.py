"""The chunks of a PNG, from untrusted bytes (https://www.w3.org/TR/png-3/)."""

from __future__ import annotations

import struct
from collections.abc import Iterator

from stereolag.io.bare import BarePicture, damaged, too_many
from stereolag.io.tiff import exif_orientation

MAGIC = b"\x89PNG\r\n\x1a\n"
MAX_CHUNKS = 200_000
"""256 MB in chunks of 8 KiB, as libpng writes them, are 32,768."""

_NEEDED = (b"IHDR", b"PLTE", b"tRNS", b"IDAT", b"IEND")


def bare_png(data: bytes) -> BarePicture:
    """Return a PNG reduced to the chunks that its pixels need, each checked to be within the file.

    Raises
    ------
    ValueError
        A chunk that claims more bytes than the file has, no header, or more chunks than any program writes.
    """
    width, height, exif, spans = -1, -1, b"", [(0, len(MAGIC))]
    for kind, start, end in _chunks(data):
        if kind == b"IHDR" and width < 0:
            if end - start < 8 + 12:
                raise damaged("PNG")
            width, height = struct.unpack_from(">II", data, start + 8)
        if kind == b"eXIf" and not exif:
            exif = data[start + 8 : end - 4]
        if kind in _NEEDED:
            if spans[-1][1] == start:
                spans[-1] = (spans[-1][0], end)
            else:
                spans.append((start, end))
    if width < 0:
        raise damaged("PNG")
    if spans != [(0, len(data))]:
        view = memoryview(data)
        data = b"".join(view[start:end] for start, end in spans)
    return BarePicture(data, width, height, exif_orientation(exif))


def _chunks(data: bytes) -> Iterator[tuple[bytes, int, int]]:
    """Yield the kind, beginning and end of every chunk."""
    start = len(MAGIC)
    for _ in range(MAX_CHUNKS):
        if start + 12 > len(data):
            raise damaged("PNG")
        length, kind = struct.unpack_from(">I4s", data, start)
        end = start + 12 + length
        if end > len(data):
            raise damaged("PNG")
        yield kind, start, end
        if kind == b"IEND":
            return
        start = end
    raise too_many("PNG", "chunks", MAX_CHUNKS)
