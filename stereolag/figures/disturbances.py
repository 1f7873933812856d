"""The sound and the noises that two recordings are mixed of in the browser, to see what a correlation stands."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

SAMPLES = 8192
LAG = 640
ECHO_DELAY = 300
MAX_LAG = 2000
"""Within which the lag is searched, samples."""

LONGEST_PERIOD = 800
MOST_DRIFT = 20
"""Samples from the first to the last."""

SOFTNESS = 0.7
"""Share of each sample of the sound that is left in the next: white noise would be sharper than sounds are."""

SETTLING = 128
"""Samples until nothing is left of the silence before: 0.7 ** 128 is 1e-20."""

BEFORE = LAG + ECHO_DELAY + MOST_DRIFT + 64
"""Samples of the sound that sensor 2 still hears when the recordings begin."""

UNIT = 28
"""What is 1 standard deviation, for integers of 8 bits."""


@dataclass(frozen=True, eq=False)
class Ingredients:
    """What is mixed; int8, ``UNIT`` a standard deviation, white and independent of each other.

    Attributes
    ----------
    fresh
        (SETTLING + BEFORE + SAMPLES,): the part of the sound that never repeats.
    pattern
        (LONGEST_PERIOD,): its beginning is heard again and again.
    noise_1, noise_2
        (SAMPLES,): of each sensor.
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
