"""The blocks of a GIF, from untrusted bytes (https://www.w3.org/Graphics/GIF/spec-gif89a.txt)."""

from __future__ import annotations

import struct

from stereolag.io.bare import BarePicture, damaged, too_many

MAGICS = (b"GIF87a", b"GIF89a")
MAX_BLOCKS = 2_000_000
"""50 megapixels of noise in full blocks of 255 bytes are 300,000."""

_TRANSPARENCY = 0xF9


def bare_gif(data: bytes) -> BarePicture:
    """Return a GIF reduced to its first frame.

    Raises
    ------
    ValueError
        No frame, blocks that reach beyond the file, or more of them than any program writes.
    """
    if len(data) < 13:
        raise damaged("GIF")
    width, height = struct.unpack_from("<HH", data, 6)
    position = 13 + _palette_size(data[10])
    pieces, transparency, blocks = [data[:position]], b"", 0
    while True:
        mark = data[position : position + 1]
        if mark == b"!":
            end, blocks = _after_blocks(data, position + 2, blocks)
            if data[position + 1] == _TRANSPARENCY:
                transparency = data[position:end]
            position = end
        elif mark == b",":
            if position + 11 > len(data):
                raise damaged("GIF")
            left, top, frame_width, frame_height, flags = struct.unpack_from("<HHHHB", data, position + 1)
            end, _ = _after_blocks(data, position + 11 + _palette_size(flags), blocks)
            pieces += [transparency, data[position:end], b";"]
            # A frame may reach beyond the screen: decoders then enlarge the image.
            return BarePicture(b"".join(pieces), max(width, left + frame_width), max(height, top + frame_height))
        else:
            raise damaged("GIF")


def _palette_size(flags: int) -> int:
    return 3 << ((flags & 7) + 1) if flags & 0x80 else 0


def _after_blocks(data: bytes, position: int, blocks: int) -> tuple[int, int]:
    """Return the end of a series of data blocks, and the number of blocks so far."""
    for number in range(blocks, MAX_BLOCKS):
        if position >= len(data):
            raise damaged("GIF")
        length = data[position]
        position += 1 + length
        if not length:
            return position, number
    raise too_many("GIF", "blocks", MAX_BLOCKS)
