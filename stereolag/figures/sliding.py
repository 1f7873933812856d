"""A short cut of one recording and the recording it is slid over, small enough to see every product."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from stereolag.arrays import Vector

CUT_SAMPLES = 40
SAMPLES = 240
HOME = 90
"""Samples of recording 2 before the place that the cut belongs to."""

SEVEN_NUMBERS = (2, -1, 4, 3, -5, 1, -4)
AROUND_THEM = ((1, 2, -1, 3, 1, -2, -3, 0), (0, 2, -2, 1, -1))

TONE_PERIOD = 20
LOUD_FACTOR = 4.0


@dataclass(frozen=True, eq=False)
class Slide:
    """What is slid over what.

    Attributes
    ----------
    name
        Of the example.
    cut
        (n,) samples of recording 1.
    recording
        (N,) samples of recording 2, N > n.
    lag
        Of the first place, samples: the cut over ``recording[:n]``.
    step
        By how many samples of the recordings the lag grows from place to place.
    """

    name: str
    cut: Vector
    recording: Vector
    lag: int = 0
    step: int = 1


def seven_numbers() -> Slide:
    """Return seven whole numbers, found again among others."""
    before, after = AROUND_THEM
    cut = np.array(SEVEN_NUMBERS, dtype=np.float64)
    return Slide("seven", cut, np.concatenate((before, cut, after)))


def excerpt(signal_1: Vector, signal_2: Vector, lag: int, *, start: int, step: int) -> Slide:
    """Return a cut of two real recordings, each the mean of `step` samples.

    Parameters
    ----------
    signal_1, signal_2
        (N1,) and (N2,), the whole recordings.
    lag
        The true one, samples; a multiple of `step`.
    start
        Where the cut begins in `signal_1`, in steps.
    step
        Samples that become one.

    Raises
    ------
    ValueError
        `lag` is no multiple of `step`, or the excerpt reaches past the end of a recording.
    """
    if lag % step:
        raise ValueError(f"lag is {lag}; allowed are multiples of the step, {step}.")
    first, second = (signal[: signal.size // step * step].reshape(-1, step).mean(1) for signal in (signal_1, signal_2))
    begin = start + lag // step - HOME
    if not (0 <= start <= first.size - CUT_SAMPLES and 0 <= begin <= second.size - SAMPLES):
        raise ValueError(f"start is {start}; the cut or what it is slid over reaches past the end of its recording.")
    cut = first[start : start + CUT_SAMPLES]
    recording = second[begin : begin + SAMPLES]
    return Slide("coast", cut / cut.std(), recording / cut.std(), lag - HOME * step, step)


def tone() -> Slide:
    """Return a pure tone, which fits again after every period."""
    recording = np.sqrt(2) * np.sin(2 * np.pi * np.arange(SAMPLES) / TONE_PERIOD)
    return Slide("tone", recording[HOME : HOME + CUT_SAMPLES], recording, -HOME)


def noise() -> Slide:
    """Return two noises that have nothing to do with each other."""
    random = np.random.default_rng(4)
    return Slide("noise", random.normal(size=CUT_SAMPLES), random.normal(size=SAMPLES))


def loud_stretch() -> Slide:
    """Return a recording that is louder elsewhere than where the cut belongs."""
    recording = np.random.default_rng(2).normal(size=SAMPLES)
    cut = recording[HOME : HOME + CUT_SAMPLES].copy()
    recording[150:220] *= LOUD_FACTOR
    return Slide("loud", cut, recording)
