"""Recordings small enough to slide and to disturb by hand: every product can be seen, and the browser can mix them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from stereolag.core.arrays import Vector

CUT_SAMPLES = 40
SLID_OVER = 240
HOME = 90
"""Samples of recording 2 before the true place of the cut."""

SEVEN_NUMBERS = (2, -1, 4, 3, -5, 1, -4)
AROUND_THEM = ((1, 2, -1, 3, 1, -2, -3, 0), (0, 2, -2, 1, -1))

TONE_PERIOD = 20
LOUD_FACTOR = 4.0


@dataclass(frozen=True, eq=False)
class Slide:
    """A cut and the recording it slides over.

    Attributes
    ----------
    name
        Name of the example.
    cut
        (n,) samples of recording 1.
    recording
        (N,) samples of recording 2, N > n.
    lag
        Lag of the first place, samples: the cut over ``recording[:n]``.
    step
        Samples of the recordings by which the lag grows from place to place.
    """

    name: str
    cut: Vector
    recording: Vector
    lag: int = 0
    step: int = 1


def seven_numbers() -> Slide:
    """Return seven whole numbers hidden among others."""
    before, after = AROUND_THEM
    cut = np.array(SEVEN_NUMBERS, dtype=np.float64)
    return Slide("seven", cut, np.concatenate((before, cut, after)))


def excerpt(signal_1: Vector, signal_2: Vector, lag: int, *, start: int, step: int) -> Slide:
    """Return an excerpt of two real recordings, with each sample the mean of `step` samples.

    Parameters
    ----------
    signal_1, signal_2
        (N1,) and (N2,), the whole recordings.
    lag
        The true lag, samples; a multiple of `step`.
    start
        Start of the cut in `signal_1`, in steps.
    step
        Samples averaged into one.

    Raises
    ------
    ValueError
        If `lag` is not a multiple of `step`, or the excerpt reaches past the end of a recording.
    """
    if lag % step:
        raise ValueError(f"lag is {lag}; allowed are multiples of the step, {step}.")
    first, second = (signal[: signal.size // step * step].reshape(-1, step).mean(1) for signal in (signal_1, signal_2))
    begin = start + lag // step - HOME
    if not (0 <= start <= first.size - CUT_SAMPLES and 0 <= begin <= second.size - SLID_OVER):
        raise ValueError(f"start is {start}; the cut or the stretch under it reaches past the end of its recording.")
    cut = first[start : start + CUT_SAMPLES]
    recording = second[begin : begin + SLID_OVER]
    return Slide("coast", cut / cut.std(), recording / cut.std(), lag - HOME * step, step)


def tone() -> Slide:
    """Return a pure tone, which fits again after every period."""
    recording = np.sqrt(2) * np.sin(2 * np.pi * np.arange(SLID_OVER) / TONE_PERIOD)
    return Slide("tone", recording[HOME : HOME + CUT_SAMPLES], recording, -HOME)


def noise() -> Slide:
    """Return two unrelated noises."""
    random = np.random.default_rng(4)
    return Slide("noise", random.normal(size=CUT_SAMPLES), random.normal(size=SLID_OVER))


def loud_stretch() -> Slide:
    """Return a recording that is louder elsewhere than at the true place of the cut."""
    recording = np.random.default_rng(2).normal(size=SLID_OVER)
    cut = recording[HOME : HOME + CUT_SAMPLES].copy()
    recording[150:220] *= LOUD_FACTOR
    return Slide("loud", cut, recording)


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
