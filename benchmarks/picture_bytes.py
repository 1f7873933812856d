"""Pictures assembled byte by byte, so that any part of them can be wrong."""

from __future__ import annotations

import io
import struct
import zlib
from collections.abc import Callable, Iterable
from typing import Any, TypeAlias

import cv2
import numpy as np
from PIL import Image
from pillow_heif import register_heif_opener

register_heif_opener()  # so that Pillow also writes HEIF

RNG_SEED = 7
MB = 2**20

Case: TypeAlias = tuple[Callable[[], bytes], str]
"""A function that makes a file, and the expected outcome: `READ`, a pattern of the error, or "" for either."""
READ = "read"

# PNG


def png_chunk(kind: bytes, body: bytes, claimed: int | None = None) -> bytes:
    length = len(body) if claimed is None else claimed
    return struct.pack(">I", length) + kind + body + struct.pack(">I", zlib.crc32(kind + body))


def png(
    width: int = 8, height: int = 8, depth: int = 8, colour: int = 0, before: bytes = b"", pixels: bytes | None = None
) -> bytes:
    channels = {0: 1, 2: 3, 3: 1, 4: 2, 6: 4}[colour]
    if pixels is None:
        pixels = (b"\0" + bytes((width * channels * depth + 7) // 8)) * height
    header = png_chunk(b"IHDR", struct.pack(">IIBBBBB", width, height, depth, colour, 0, 0, 0))
    return (
        b"\x89PNG\r\n\x1a\n" + header + before + png_chunk(b"IDAT", zlib.compress(pixels, 1)) + png_chunk(b"IEND", b"")
    )


def png_claiming(depth: int, colour: int) -> bytes:
    """Return a PNG whose IDAT claims 2 GB, but with all its pixels, so that Pillow reads it."""
    rows = np.zeros((20, 1 + 20 * depth // 8 * {0: 1, 2: 3, 4: 2, 6: 4}[colour]), np.uint8)
    rows[:, 1:] = np.random.default_rng(0).integers(0, 256, rows[:, 1:].shape)
    data = png(20, 20, depth, colour, pixels=rows.tobytes())
    place = data.index(b"IDAT")
    return data[: place - 4] + b"\x7f\xff\xff\xff" + data[place:]


def bomb(size: int) -> bytes:
    return zlib.compress(bytes(size), 9)


# EXIF and TIFF


def directory(entries: Iterable[tuple[int, int, int, int]], following: int = 0) -> bytes:
    packed = [struct.pack("<HHII", *entry) for entry in entries]
    return struct.pack("<H", len(packed)) + b"".join(packed) + struct.pack("<I", following)


def exif(kind: int, count: int, value: int) -> bytes:
    return b"II*\0\x08\0\0\0" + directory([(274, kind, count, value)]) + bytes(64)


def overlapping_exif(size: int, tags: int = 5000) -> bytes:
    """Return EXIF whose tags all refer to the same bytes: gigabytes if each is read."""
    body = b"II*\0\x08\0\0\0" + directory((40_000 + tag, 7, size, 8) for tag in range(tags))
    return body + bytes(max(0, size + 8 - len(body)))


def tiff(changes: dict[int, tuple[int, int, int]] | None = None, *, pixels: bytes = bytes(64), size: int = 8) -> bytes:
    shorts = {256: size, 257: size, 258: 8, 259: 1, 262: 1, 277: 1, 278: size}
    entries = {tag: (3, 1, value) for tag, value in shorts.items()}
    entries |= {273: (4, 1, 8), 279: (4, 1, len(pixels))} | (changes or {})
    start = struct.pack("<4sI", b"II*\0", 8 + len(pixels)) + pixels
    return start + directory((tag, *entries[tag]) for tag in sorted(entries))


def tiff_pages(count: int, loop: bool = False) -> bytes:
    first = tiff()
    data = bytearray(first)
    page = first[72:-4]
    data[-4:] = struct.pack("<I", 72 if loop else len(data))
    for number in range(count):
        last = number == count - 1
        data += page + struct.pack("<I", 0 if last else len(data) + len(page) + 4)
    return bytes(data)


def big_tiff(count: int) -> bytes:
    entry = struct.pack("<HHQQ", 273, 16, count, 16)
    return struct.pack("<2sHHHQ", b"II", 43, 8, 0, 16) + struct.pack("<Q", 1) + entry + bytes(8)


def tiff_overlapping() -> bytes:
    return tiff({40_000 + tag: (7, MB, 8) for tag in range(20_000)}, pixels=bytes(MB))


def tiff_tiled(side: int, width: int = 10) -> bytes:
    shorts, longs = {256: width, 257: width, 258: 16, 259: 8, 262: 2, 277: 3}, {322: side, 323: side, 324: 8, 325: 64}
    changes = {tag: (kind, 1, value) for kind, values in ((3, shorts), (4, longs)) for tag, value in values.items()}
    return tiff(changes, pixels=bomb(64 * MB)[:65_000])


# JPEG


def jpeg(pixels: np.ndarray | None = None, **options: Any) -> bytes:
    return by_pillow("JPEG", np.zeros((16, 16, 3), np.uint8) if pixels is None else pixels, **options)


def segment(marker: int, body: bytes) -> bytes:
    return struct.pack(">BBH", 0xFF, marker, len(body) + 2) + body


def jpeg_with(extra: bytes, **options: Any) -> bytes:
    data = jpeg(**options)
    return data[:2] + extra + data[2:]


def jpeg_scans(count: int, side: int = 1000) -> bytes:
    data = jpeg(np.zeros((side, side), np.uint8), progressive=True)
    start = data.rindex(b"\xff\xda")
    return data[:start] + data[start:-2] * count + data[-2:]


def jpeg_sized(width: int, height: int) -> bytes:
    data = bytearray(jpeg())
    place = data.index(b"\xff\xc0") + 5
    data[place : place + 4] = struct.pack(">HH", height, width)
    return bytes(data)


# GIF, WEBP, BMP


def gif(
    before: bytes = b"", *, screen: tuple[int, int] = (8, 8), frame: tuple[int, int] = (8, 8), count: int = 1
) -> bytes:
    data = by_pillow("GIF", np.eye(8, dtype=np.uint8))
    start = data.index(b",", 13 + (3 << (data[10] & 7) + 1))
    picture = b"," + struct.pack("<HHHH", 0, 0, *frame) + data[start + 9 : -1]
    return data[:6] + struct.pack("<HH", *screen) + data[10:start] + before + picture * count + b";"


def gif_comment(size: int, block: int = 255) -> bytes:
    return b"!\xfe" + (bytes([block]) + b"a" * block) * (size // (block + 1)) + b"\0"


def webp(pixels: np.ndarray | None = None, **options: Any) -> bytes:
    return by_pillow("WEBP", np.zeros((16, 16, 3), np.uint8) if pixels is None else pixels, **options)


def webp_with(chunk: bytes, flags: int = 0, canvas: tuple[int, int] = (16, 16)) -> bytes:
    picture = webp()[12:]
    sides = b"".join((side - 1).to_bytes(3, "little") for side in canvas)
    body = b"WEBP" + riff_chunk(b"VP8X", struct.pack("<B3x", flags) + sides) + chunk + picture
    return b"RIFF" + struct.pack("<I", len(body)) + body


def riff_chunk(kind: bytes, body: bytes) -> bytes:
    return kind + struct.pack("<I", len(body)) + body + bytes(len(body) % 2)


def webp_frames(count: int) -> bytes:
    picture = webp()[12:]
    frame = riff_chunk(b"ANMF", bytes(6) + (15).to_bytes(3, "little") * 2 + bytes(4) + picture)
    body = b"WEBP" + riff_chunk(b"VP8X", struct.pack("<B3x", 2) + (15).to_bytes(3, "little") * 2)
    body += riff_chunk(b"ANIM", bytes(6)) + frame * count
    return b"RIFF" + struct.pack("<I", len(body)) + body


def webp_sized(side: int) -> bytes:
    data = bytearray(webp())
    place = data.index(b"\x9d\x01\x2a") + 3
    data[place : place + 4] = struct.pack("<HH", side, side)
    return bytes(data)


def bmp(width: int, height: int, bits: int, compression: int, pixels: bytes, colours: int = 0) -> bytes:
    palette = bytes(4 * 256) if bits == 8 else b""
    offset = 54 + len(palette)
    header = struct.pack("<IiiHHIIiiII", 40, width, height, 1, bits, compression, len(pixels), 0, 0, colours, 0)
    return b"BM" + struct.pack("<IHHI", offset + len(pixels), 0, 0, offset) + header + palette + pixels


# Pictures of the largest accepted size


def smooth(channels: int, dtype: type = np.uint8, side: int = 7000) -> np.ndarray:
    ramp = np.add.outer(np.arange(side, dtype=np.uint32), np.arange(side, dtype=np.uint32))
    ramp = (ramp * (255 if dtype == np.uint8 else 65_535) // (2 * side)).astype(dtype)
    return ramp if channels == 1 else np.repeat(ramp[:, :, None], channels, axis=2)


def noise(channels: int, side: int = 7000) -> np.ndarray:
    values = np.frombuffer(np.random.default_rng(RNG_SEED).bytes(side * side * channels), np.uint8)
    return values.reshape((side, side) if channels == 1 else (side, side, channels))


def by_opencv(ending: str, pixels: np.ndarray, *options: int) -> bytes:
    return cv2.imencode(ending, pixels, options)[1].tobytes()


def by_pillow(kind: str, pixels: np.ndarray | Image.Image, **options: Any) -> bytes:
    stream = io.BytesIO()
    (Image.fromarray(pixels) if isinstance(pixels, np.ndarray) else pixels).save(stream, kind, **options)
    return stream.getvalue()


def claiming(kind: str, side: int) -> bytes:
    """Return an AVIF or HEIF of 64 × 64 pixels whose header claims `side` × `side`."""
    data = by_pillow(kind, noise(3, 64))
    sizes = data.index(b"ispe") + 8
    return data[:sizes] + 2 * side.to_bytes(4, "big") + data[sizes + 8 :]


FAST_PNG = (cv2.IMWRITE_PNG_COMPRESSION, 1)


def turned(data: bytes) -> bytes:
    """Return the PNG with the EXIF orientation of a camera held upright."""
    return data[:33] + png_chunk(b"eXIf", exif(3, 1, 6)) + data[33:]


def interlaced(pixels: np.ndarray) -> bytes:
    """Return RGB pixels as an interlaced PNG of seven passes."""
    header = struct.pack(">IIBBBBB", pixels.shape[1], pixels.shape[0], 8, 2, 0, 0, 1)
    packer, packed = zlib.compressobj(0), b""
    passes = [(0, 0, 8, 8), (0, 4, 8, 8), (4, 0, 8, 4), (0, 2, 4, 4), (2, 0, 4, 2), (0, 1, 2, 2), (1, 0, 2, 1)]
    for top, left, down, across in passes:
        part = pixels[top::down, left::across]
        rows = np.zeros((part.shape[0], 1 + 3 * part.shape[1]), np.uint8)
        rows[:, 1:] = part.reshape(part.shape[0], -1)
        packed += packer.compress(rows.tobytes())
    body = png_chunk(b"IHDR", header) + png_chunk(b"IDAT", packed + packer.flush()) + png_chunk(b"IEND", b"")
    return b"\x89PNG\r\n\x1a\n" + body
