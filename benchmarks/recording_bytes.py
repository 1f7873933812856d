"""Recordings and arrays assembled byte by byte, so that any part of them can be wrong."""

from __future__ import annotations

import io
import struct
from collections.abc import Sequence
from fractions import Fraction
from typing import Any

import av
import numpy as np
import scipy.io
import soundfile

from benchmarks.picture_bytes import riff_chunk


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


def filmed(
    kind: str,
    codec: str,
    *tracks: np.ndarray,
    rate: int = 16_000,
    languages: Sequence[str] = (),
    late: int = 0,
    gap: tuple[int, int] = (0, 0),
    picture: bool = False,
) -> bytes:
    """Return a file written by FFmpeg: a mono track per array, delayed by `late` samples, without those in `gap`."""
    stream = io.BytesIO()
    with av.open(stream, "w", format=kind) as container:
        film = container.add_stream("mpeg4", rate=10, width=16, height=16) if picture else None
        streams = [container.add_stream(codec, rate=rate, layout="mono", bit_rate=64_000) for _ in tracks]
        for track, language in zip(streams, languages, strict=False):
            track.metadata["language"] = language
        for number in range(10) if film else ():
            frame = av.VideoFrame.from_ndarray(np.full((16, 16, 3), 20 * number, np.uint8))
            frame.pts, frame.time_base = number, Fraction(1, 10)
            container.mux(film.encode(frame))
        if film:
            container.mux(film.encode(None))
        for track, samples in zip(streams, tracks, strict=True):
            for first in range(0, samples.size, 1024):
                if not gap[0] <= first < gap[1]:
                    part = samples[np.newaxis, first : first + 1024].astype(np.float32)
                    frame = av.AudioFrame.from_ndarray(part, format="fltp", layout="mono")
                    frame.sample_rate, frame.pts, frame.time_base = rate, first + late, Fraction(1, rate)
                    container.mux(track.encode(frame))
            container.mux(track.encode(None))
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


def zipped(array: np.ndarray) -> bytes:
    stream = io.BytesIO()
    np.savez_compressed(stream, a=array)
    return stream.getvalue()


def matlab(**arrays: Any) -> bytes:
    stream = io.BytesIO()
    scipy.io.savemat(stream, arrays, do_compression=True)
    return stream.getvalue()
