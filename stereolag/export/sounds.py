"""Recordings as sound files."""

from __future__ import annotations

import io

import numpy as np
import numpy.typing as npt
import soundfile


def wav(signal: npt.ArrayLike, sampling_rate: float) -> bytes:
    """Return a recording as a WAV file of 16 bits, as loud as it can be without clipping.

    Parameters
    ----------
    signal
        (samples,) finite numbers.
    sampling_rate
        Samples per second; rounded to a whole number, which is all that a WAV file holds.
    """
    samples = np.asarray(signal, dtype=np.float64)
    loudest = float(np.abs(samples).max(initial=0.0)) or 1.0
    stream = io.BytesIO()
    soundfile.write(stream, (samples / loudest * 32767).astype(np.int16), round(sampling_rate), format="WAV")
    return stream.getvalue()
