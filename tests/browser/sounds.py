"""Recordings to upload."""

from __future__ import annotations

import io

import numpy as np
import soundfile
from playwright.sync_api import FilePayload


def wav_file(name: str, samples: np.ndarray, rate: int = 8_000) -> FilePayload:
    """Return a 16-bit WAV file as a visitor would upload it."""
    stream = io.BytesIO()
    soundfile.write(stream, samples, rate, format="WAV", subtype="PCM_16")
    return {"name": name, "mimeType": "audio/wav", "buffer": stream.getvalue()}
