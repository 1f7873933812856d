"""Good and bad files as visitors upload them."""

import io
import struct
from typing import Any

import numpy as np
import soundfile
from PIL import Image

from stereolag.core.arrays import Array, DoubleMap, EightBit


def png(picture: Array, **options: Any) -> bytes:
    file = io.BytesIO()
    Image.fromarray(picture).save(file, "PNG", **options)
    return file.getvalue()


def pngs(**pictures: Array) -> dict[str, tuple[str, bytes]]:
    """Return a file for each box, named after it."""
    return {box: (f"{box}.png", png(picture)) for box, picture in pictures.items()}


def wav(samples: DoubleMap, sampling_rate: int = 8_000) -> bytes:
    file = io.BytesIO()
    soundfile.write(file, samples, sampling_rate, format="WAV")
    return file.getvalue()


def wav_without_channels() -> bytes:
    whole = bytearray(wav(np.zeros(8)))
    whole[22:24] = struct.pack("<H", 0)
    return bytes(whole)


def noise(count: int, seed: int = 0) -> DoubleMap:
    return np.random.default_rng(seed).uniform(-0.5, 0.5, count)


def texture(rows: int, cols: int, seed: int = 0) -> EightBit:
    return np.random.default_rng(seed).integers(0, 256, (rows, cols, 3), dtype=np.uint8)


def csv(samples: DoubleMap) -> bytes:
    return "\n".join(f"{sample:.6f}" for sample in samples).encode()
