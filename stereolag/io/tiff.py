"""The directory of a TIFF, from untrusted bytes, and the orientation in EXIF, which is such a directory too.

Format: https://www.adobe.io/content/dam/udp/en/open/standards/tiff/TIFF6.pdf; BigTIFF has longer counts and offsets.
"""

from __future__ import annotations

import struct
from collections.abc import Iterator
from dataclasses import dataclass

from stereolag.io.bare import BarePicture, damaged, too_many

MAGICS = (b"II*\0", b"MM\0*", b"II+\0", b"MM\0+")
MAX_STRIPS = 100_000
MAX_SAMPLES_A_PIXEL = 6

_ORIENTATION = 274
_WIDTH, _HEIGHT, _COMPRESSION, _STRIPS, _SAMPLES = 256, 257, 259, 273, 277
_TILE_WIDTH, _TILE_HEIGHT, _TILES = 322, 323, 324
_NEEDED = frozenset(
    {*range(256, 260), 262, 266, 273, 277, 278, 279, 284, 292, 293, 317, 320, *range(322, 326), 332, 338, 339, 347}
    | {*range(529, 533)}
)
_MANY = frozenset((273, 279, 324, 325))
_SINGLE = frozenset((256, 257, 259, 262, 266, 277, 278, 284, 292, 293, 317, 322, 323, 332, 531))
_JPEG = 7
_COMPRESSIONS = {1: "none", 2: "CCITT", 3: "CCITT", 4: "CCITT", 5: "LZW", _JPEG: "JPEG", 8: "deflate"} | {
    32773: "PackBits", 32946: "deflate", 50000: "Zstandard",
}  # fmt: skip
_SIZES = {1: 1, 2: 1, 3: 2, 4: 4, 5: 8, 6: 1, 7: 1, 8: 2, 9: 4, 10: 8, 11: 4, 12: 8, 13: 4, 16: 8, 17: 8, 18: 8}
_INTEGERS = {1: "B", 3: "H", 4: "I", 16: "Q"}
_MAX_TABLE = 2**20


@dataclass(frozen=True)
class _Entry:
    tag: int
    kind: int
    count: int
    where: int
    """Offset of the values in the file."""
    raw: bytes
    """The entry as stored in the file."""


def bare_tiff(data: bytes) -> BarePicture:
    """Return a TIFF with a single directory, reduced to the tags that the pixels of the first page need.

    Raises
    ------
    ValueError
        No directory, values beyond the file, a compression that is not accepted, or tiles far larger than the image.
    """
    order, big = _byte_order(data), data[2:4] in (b"+\0", b"\0+")
    kept: dict[int, _Entry] = {}
    orientation = 1
    for entry in _directory(data):
        if entry.tag == _ORIENTATION:
            orientation = _orientation(data, entry, order)
        elif entry.tag in _NEEDED and entry.tag not in kept:
            _check_entry(data, entry)
            kept[entry.tag] = entry
    values = {tag: _integer(data, entry, order) for tag, entry in kept.items()}
    width, height = values.get(_WIDTH, 0), values.get(_HEIGHT, 0)
    if not width or not height:
        raise damaged("TIFF")
    _check_layout(data, values, kept, width * height)
    number, offset = ("Q", "Q") if big else ("H", "I")
    entries = b"".join(_written(kept[tag], values[tag], order, big) for tag in sorted(kept))
    directory = struct.pack(order + number, len(kept)) + entries + struct.pack(order + offset, 0)
    start = 8 if big else 4
    padding = bytes(-len(data) % 16)
    pointer = struct.pack(order + offset, len(data) + len(padding))
    view = memoryview(data)
    bare = b"".join((view[:start], pointer, view[start + len(pointer) :], padding, directory))
    return BarePicture(bare, width, height, orientation)


def exif_orientation(exif: bytes) -> int:
    """Return the orientation stated in an EXIF block, 1 to 8; 1, upright, if it states none or is broken."""
    exif = exif.removeprefix(b"Exif\0\0")
    if not exif.startswith(MAGICS[:2]):
        return 1
    try:
        entry = next((entry for entry in _directory(exif) if entry.tag == _ORIENTATION), None)
    except ValueError:
        return 1
    return 1 if entry is None else _orientation(exif, entry, _byte_order(exif))


def _byte_order(data: bytes) -> str:
    return "<" if data.startswith(b"II") else ">"


def _directory(data: bytes) -> Iterator[_Entry]:
    """Yield the entries of the first directory."""
    order = _byte_order(data)
    big = data[2:4] in (b"+\0", b"\0+")
    try:
        start = struct.unpack_from(order + ("Q" if big else "I"), data, 8 if big else 4)[0]
        count = struct.unpack_from(order + ("Q" if big else "H"), data, start)[0]
    except (struct.error, OverflowError) as error:
        raise damaged("TIFF") from error
    start += 8 if big else 2
    layout, size, inline = (order + "HHQ", 20, 8) if big else (order + "HHI", 12, 4)
    if count > 65535 or start + count * size > len(data):
        raise damaged("TIFF")
    for position in range(start, start + count * size, size):
        tag, kind, values = struct.unpack_from(layout, data, position)
        where = position + size - inline
        if values * _SIZES.get(kind, 1) > inline:
            where = struct.unpack_from(order + ("Q" if big else "I"), data, where)[0]
        yield _Entry(tag, kind, values, where, data[position : position + size])


def _orientation(data: bytes, entry: _Entry, order: str) -> int:
    value = _integer(data, entry, order) if entry.count == 1 else 1
    return value if 1 <= value <= 8 else 1


def _integer(data: bytes, entry: _Entry, order: str) -> int:
    """Return the first value of an entry, 0 if it is not a whole number."""
    code = _INTEGERS.get(entry.kind)
    if code is None or not entry.count or entry.where + _SIZES[entry.kind] > len(data):
        return 0
    return int(struct.unpack_from(order + code, data, entry.where)[0])


def _written(entry: _Entry, value: int, order: str, big: bool) -> bytes:
    """Return the entry unchanged, or cut to one value if the tag has only one."""
    if entry.tag not in _SINGLE or entry.count == 1:
        return entry.raw
    count, inline = ("Q", 8) if big else ("I", 4)
    number = struct.pack(order + _INTEGERS.get(entry.kind, "I"), value)
    kind = entry.kind if entry.kind in _INTEGERS else 4
    return struct.pack(order + "HH" + count, entry.tag, kind, 1) + number[:inline].ljust(inline, b"\0")


def _check_entry(data: bytes, entry: _Entry) -> None:
    size = _SIZES.get(entry.kind)
    if size is None or not entry.count or entry.where + entry.count * size > len(data):
        raise damaged("TIFF")
    if entry.tag in _MANY and entry.count > MAX_STRIPS:
        raise too_many("TIFF", "strips", MAX_STRIPS)
    if entry.tag not in _MANY and entry.count * size > _MAX_TABLE:
        raise damaged("TIFF")


def _check_layout(data: bytes, values: dict[int, int], kept: dict[int, _Entry], pixels: int) -> None:
    compression = values.get(_COMPRESSION, 1)
    if compression not in _COMPRESSIONS:
        names = ", ".join(dict.fromkeys(_COMPRESSIONS.values()))
        raise ValueError(f"The image (TIFF) has compression number {compression}; accepted are {names}.")
    if values.get(_SAMPLES, 1) > MAX_SAMPLES_A_PIXEL:
        raise ValueError(
            f"The image (TIFF) has {values[_SAMPLES]} channels; at most {MAX_SAMPLES_A_PIXEL} are accepted."
        )
    # A decoder allocates a whole tile, and tiles are padded: a small image must not come in a huge one.
    if values.get(_TILE_WIDTH, 0) * values.get(_TILE_HEIGHT, 0) > pixels * 5 // 4 + 2**20:
        raise ValueError("The image (TIFF) is in tiles far larger than itself; save it again.")
    parts = kept.get(_STRIPS, kept.get(_TILES))
    if parts is None:
        raise damaged("TIFF")
    if compression == _JPEG and data.count(b"\xff\xda") > parts.count + 50:
        raise too_many("TIFF", "scans of JPEG", parts.count + 50)
