"""Recordings and arrays assembled byte by byte, so that any part of them can be wrong."""

from __future__ import annotations

import io
import struct
from typing import Any

import numpy as np
import soundfile
from picture_bytes import riff_chunk


def wav(
    layout: tuple[int, int, int, int, int, int], data: bytes, *, before: bytes = b"", claimed: int | None = None
) -> bytes:
    length = len(data) if claimed is None else claimed
    body = b"WAVE" + riff_chunk(b"fmt ", struct.pack("<HHIIHH", *layout)) + before
    body += b"data" + struct.pack("<I", length) + data
    return b"RIFF" + struct.pack("<I", min(len(body), 2**32 - 1)) + body


def plain_wav(channels: int = 1, rate: int = 8000, data: bytes = bytes(800), **options: Any) -> bytes:
    width = 2 * channels % 65_536
    return wav((1, channels, rate, rate * width % 2**32, width, 16), data, **options)


def sound(kind: str, subtype: str | None = None, *, samples: np.ndarray | None = None, rate: int = 8000) -> bytes:
    stream = io.BytesIO()
    tone = 0.4 * np.sin(np.arange(16_000) * 0.05) if samples is None else samples
    channels = 1 if tone.ndim == 1 else tone.shape[1]
    with soundfile.SoundFile(stream, "w", rate, channels, subtype, format=kind) as file:
        for first in range(0, len(tone), 100_000):  # libsndfile's Vorbis encoder does not survive a long write
            file.write(tone[first : first + 100_000])
    return stream.getvalue()


def lying_flac(samples: int) -> bytes:
    data = bytearray(sound("FLAC", samples=np.zeros(100)))
    data[21] = (data[21] & 0xF0) | samples >> 32
    data[22:26] = struct.pack(">I", samples & 0xFFFFFFFF)
    return bytes(data)


def id3(size: int) -> bytes:
    sides = bytes(size >> shift & 0x7F for shift in (21, 14, 7, 0))
    return b"ID3\x04\0\0" + sides + bytes(size) + sound("MP3")


def npy(header: str, data: bytes = bytes(64), version: int = 1) -> bytes:
    packed = header.encode("latin-1") + b"\n"
    return b"\x93NUMPY" + bytes([version, 0]) + struct.pack("<H" if version == 1 else "<I", len(packed)) + packed + data


def npy_of(shape: str, descr: str = "'<f8'", order: str = "False") -> bytes:
    return npy(f"{{'descr': {descr}, 'fortran_order': {order}, 'shape': {shape}, }}")


def saved(array: np.ndarray) -> bytes:
    stream = io.BytesIO()
    np.save(stream, array)
    return stream.getvalue()
