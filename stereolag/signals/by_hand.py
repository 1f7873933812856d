"""Recordings small enough to slide by hand, with every product visible, and a sound with adjustable disturbances."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from pydantic import Field
from scipy import ndimage

from stereolag.core.arrays import Vector
from stereolag.core.settings import Settings
from stereolag.signals.correlation import overlap_slices

CUT_SAMPLES = 40
SLID_OVER = 240
HOME = 90
"""Samples of recording 2 before the true place of the cut."""

STEPS = (1, 2, 3, 4, 6, 8, 12, 16, 24, 32)
"""Samples of a recording that are averaged to one of an excerpt."""

STRETCHES = 48
"""Stretches tried for an excerpt, evenly spaced over the overlap of both recordings."""


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

    @property
    def scores(self) -> Vector:
        """Pearson's correlation of the cut with the samples under it, at each place; 0 where these are flat."""
        under = np.lib.stride_tricks.sliding_window_view(self.recording, self.cut.size)
        under = under - under.mean(axis=1, keepdims=True)
        cut = self.cut - self.cut.mean()
        lengths = np.sqrt((under**2).sum(axis=1) * (cut @ cut))
        return np.asarray(np.divide(under @ cut, lengths, out=np.zeros(len(under)), where=lengths > 0))

    @property
    def rival(self) -> float:
        """The highest correlation more than four places from the peak."""
        scores = self.scores
        away = np.abs(np.arange(scores.size) - int(np.argmax(scores))) > 4
        return float(scores[away].max())


def seven_numbers() -> Slide:
    """Return seven whole numbers hidden among others."""
    cut = np.array([2, -1, 4, 3, -5, 1, -4], dtype=np.float64)
    return Slide("seven", cut, np.concatenate(([1, 2, -1, 3, 1, -2, -3, 0], cut, [0, 2, -2, 1, -1])))


def excerpt(signal_1: Vector, signal_2: Vector, lag: int) -> Slide | None:
    """Return the stretch of two recordings in which the place at `lag` stands out most.

    Each sample is the mean of `step` samples of the recordings.

    Parameters
    ----------
    signal_1, signal_2
        (N1,) and (N2,), the whole recordings.
    lag
        The lag at which they agree best, samples.

    Returns
    -------
    Slide or None
        None if the recordings overlap too little at this lag, or are flat there.
    """
    return max(_excerpts(signal_1, signal_2, lag), key=lambda slide: slide.scores.max() - slide.rival, default=None)


def _excerpts(signal_1: Vector, signal_2: Vector, lag: int) -> Iterator[Slide]:
    """Yield stretches of the overlap, with every step for which the recordings are long enough."""
    shared, _ = overlap_slices(signal_1.size, signal_2.size, lag)
    for step in STEPS:
        cut, slid_over = CUT_SAMPLES * step, SLID_OVER * step
        if shared.stop - shared.start < cut or signal_2.size < slid_over:
            return
        for start in np.unique(np.linspace(shared.start, shared.stop - cut, STRETCHES).astype(int)).tolist():
            # A whole number of steps before the true place, and within recording 2.
            place = start + lag
            before = max(min(HOME, place // step), -((signal_2.size - slid_over - place) // step))
            begin = place - before * step
            if begin < 0:
                continue
            short, long = (
                part.reshape(-1, step).mean(1)
                for part in (signal_1[start : start + cut], signal_2[begin : begin + slid_over])
            )
            if np.ptp(short) > 0 and np.ptp(long) > 0:
                short, long = (part / np.abs(part).max() for part in (short, long))  # 1e-300 has no square
                yield Slide("excerpt", short / short.std(), long / short.std(), begin - start, step)


def tone() -> Slide:
    """Return a pure tone, which fits again after every period of 20 samples."""
    recording = np.sqrt(2) * np.sin(2 * np.pi * np.arange(SLID_OVER) / 20)
    return Slide("tone", recording[HOME : HOME + CUT_SAMPLES], recording, -HOME)


def noise() -> Slide:
    """Return two unrelated noises."""
    random = np.random.default_rng(4)
    return Slide("noise", random.normal(size=CUT_SAMPLES), random.normal(size=SLID_OVER))


def loud_stretch() -> Slide:
    """Return a recording that is four times louder elsewhere than at the true place of the cut."""
    recording = np.random.default_rng(2).normal(size=SLID_OVER)
    cut = recording[HOME : HOME + CUT_SAMPLES].copy()
    recording[150:220] *= 4
    return Slide("loud", cut, recording)


SAMPLES = 8192
LAG = 640
ECHO_DELAY = 300
MAX_LAG = 2000
"""Largest lag searched in disturbed recordings, samples."""

_MAX_PERIOD = 800
_MAX_DRIFT = 20

_RESPONSE = 0.7 ** np.arange(128)
"""Impulse response that makes white noise as soft as real sounds."""

_BEFORE = LAG + ECHO_DELAY + _MAX_DRIFT + 64
"""Samples of the sound before the recordings begin, which reach sensor 2 later."""


class Disturbances(Settings):
    """Disturbances of two recordings of one sound; `draw` is the number of the noise."""

    noise: int = Field(
        default=-10,
        title="Noise",
        description="At each sensor: 0 dB is as loud as the sound",
        ge=-30,
        le=30,
        json_schema_extra={"unit": "dB"},
    )
    repetition: int = Field(
        default=0,
        title="Repetition",
        description="The share of the sound’s energy that repeats",
        ge=0,
        le=100,
        multiple_of=10,
        json_schema_extra={"unit": "%"},
    )
    period: int = Field(
        default=400,
        title="Period",
        description="Samples until it repeats",
        ge=20,
        le=_MAX_PERIOD,
        multiple_of=20,
        json_schema_extra={"unit": "samples"},
    )
    echo: int = Field(
        default=0,
        title="Echo",
        description="Loudness of the late copy at sensor 2, relative to the direct sound",
        ge=0,
        le=150,
        multiple_of=5,
        json_schema_extra={"unit": "%"},
    )
    drift: int = Field(
        default=0,
        title="Drift",
        description="Growth of the lag from the first sample to the last",
        ge=0,
        le=_MAX_DRIFT,
        json_schema_extra={"unit": "samples"},
    )
    draw: int = Field(default=0, ge=0)


def disturbed(settings: Disturbances) -> tuple[Vector, Vector]:
    """Return two recordings of one sound, which reaches sensor 2 ``LAG`` samples later; the same in every call.

    Parameters
    ----------
    settings
        The noise of each sensor; the share of the sound that repeats, and its period; the loudness of the echo, which
        arrives ``ECHO_DELAY`` samples later; and the growth of the lag over the ``SAMPLES`` samples.
    """
    random = np.random.default_rng(5)
    fresh = random.normal(size=_RESPONSE.size - 1 + _BEFORE + SAMPLES)
    repeated = np.resize(random.normal(size=_MAX_PERIOD)[: settings.period], fresh.size)
    share = settings.repetition / 100
    sound = np.convolve(np.sqrt(1 - share) * fresh + np.sqrt(share) * repeated, _RESPONSE, mode="valid")
    sound = (sound - sound.mean()) / sound.std()
    time = np.arange(-ECHO_DELAY, SAMPLES)
    late = ndimage.map_coordinates(sound, [_BEFORE + time - LAG - settings.drift * (time / SAMPLES - 0.5)], order=5)
    noises = 10 ** (settings.noise / 20) * np.random.default_rng((6, settings.draw)).normal(size=(2, SAMPLES))
    echo = settings.echo / 100 * late[:-ECHO_DELAY]
    return sound[_BEFORE:] + noises[0], late[ECHO_DELAY:] + echo + noises[1]
