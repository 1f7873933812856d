"""The sound and noises from which the browser mixes two recordings, to show how robust a correlation is."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

SAMPLES = 8192
LAG = 640
ECHO_DELAY = 300
MAX_LAG = 2000
"""Largest lag searched, samples."""

LONGEST_PERIOD = 800
MOST_DRIFT = 20
"""Largest change of the lag from the first sample to the last, samples."""

SOFTNESS = 0.7
"""Share of each sample of the sound that remains in the next: real sounds are not as sharp as white noise."""

SETTLING = 128
"""Samples until the initial silence has no effect any more: 0.7 ** 128 is 1e-20."""

BEFORE = LAG + ECHO_DELAY + MOST_DRIFT + 64
"""Samples of the sound before the recordings begin, which reach sensor 2 late."""

UNIT = 28
"""One standard deviation, in 8-bit integers."""


@dataclass(frozen=True, eq=False)
class Ingredients:
    """White, mutually independent signals to mix; int8, with a standard deviation of ``UNIT``.

    Attributes
    ----------
    fresh
        (SETTLING + BEFORE + SAMPLES,): the part of the sound that never repeats.
    pattern
        (LONGEST_PERIOD,): the repeating part; only its beginning is used for shorter periods.
    noise_1, noise_2
        (SAMPLES,): the noise of each sensor.
    """

    fresh: npt.NDArray[np.int8]
    pattern: npt.NDArray[np.int8]
    noise_1: npt.NDArray[np.int8]
    noise_2: npt.NDArray[np.int8]


def ingredients() -> Ingredients:
    """Return the sound and the noises, the same each time."""
    random = np.random.default_rng(5)

    def white(size: int) -> npt.NDArray[np.int8]:
        return np.clip(np.rint(UNIT * random.normal(size=size)), -127, 127).astype(np.int8)

    return Ingredients(
        fresh=white(SETTLING + BEFORE + SAMPLES),
        pattern=white(LONGEST_PERIOD),
        noise_1=white(SAMPLES),
        noise_2=white(SAMPLES),
    )
