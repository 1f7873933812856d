"""Two live channels: the lag over the last two seconds, measured whenever a piece has been added."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from stereolag.core.arrays import Vector
from stereolag.signals.lag import SignalLag, signal_lag

KEPT_S = 2.0
"""Seconds of sound that are kept and measured."""

SILENT_DB = -70.0
"""Level below which a channel is silent, decibels of full scale: a quiet room through a microphone without gain."""

FULL_SCALE = 32_768.0

_MIN_SAMPLES = 1024
"""Samples below which the lag is not measured yet."""


@dataclass(frozen=True, eq=False)
class Heard:
    """The lag over the last seconds, and the levels of both channels.

    Attributes
    ----------
    levels
        RMS level of both channels without their means, decibels of full scale.
    identical
        Whether both channels have the same samples: those of one microphone.
    seconds
        Duration of the samples kept.
    result
        The lag; None if a channel is silent, if both are identical, or if there are too few samples yet.
    """

    levels: tuple[float, float]
    identical: bool
    seconds: float
    result: SignalLag | None

    @property
    def silent(self) -> tuple[int, ...]:
        """The numbers of the silent channels, from 1."""
        return tuple(number for number, level in enumerate(self.levels, start=1) if level < SILENT_DB)

    @property
    def lag_now(self) -> float:
        """The lag at the last sample, samples; NaN if it is not sure.

        A moving source changes the lag within the seconds kept.
        """
        if self.result is None or self.result.verdict != "sure":
            return float("nan")
        return self.result.lag_at(self.seconds)


class Listening:
    """The last two seconds of two channels of 16 bits.

    Parameters
    ----------
    sampling_rate
        Samples per second of both channels.
    """

    def __init__(self, sampling_rate: float) -> None:
        self.sampling_rate = float(sampling_rate)
        self.max_samples = round(KEPT_S * sampling_rate)
        self.samples: npt.NDArray[np.int16] = np.zeros((2, 0), dtype=np.int16)
        """(2, N) the samples kept, the newest last."""

    def add(self, piece: npt.NDArray[np.int16]) -> None:
        """Add (2, N) samples that follow the last ones; the oldest are forgotten."""
        self.samples = np.concatenate((self.samples, piece), axis=1)[:, -self.max_samples :]

    @property
    def signals(self) -> tuple[Vector, Vector]:
        """The samples kept of both channels, -1..1."""
        first, second = self.samples / FULL_SCALE
        return first, second

    def measured(self, *, speed: float, max_lag: int | None = None) -> Heard:
        """Return the lag of the samples kept; its search and verdict are those of :func:`.signal_lag`.

        Parameters
        ----------
        speed
            Speed of the wave, metres per second.
        max_lag
            Largest lag searched, samples; every lag if None.
        """
        signals = self.signals
        levels = _level(signals[0]), _level(signals[1])
        identical = np.array_equal(*self.samples)
        seconds = self.samples.shape[1] / self.sampling_rate
        if identical or min(levels) < SILENT_DB or self.samples.shape[1] < _MIN_SAMPLES:
            return Heard(levels, identical and max(levels) >= SILENT_DB, seconds, None)
        reach = None if max_lag is None else min(max_lag, self.samples.shape[1] - 1)
        result = signal_lag(*signals, sampling_rate=self.sampling_rate, speed=speed, max_lag=reach)
        return Heard(levels, False, seconds, result)


def _level(signal: Vector) -> float:
    power = float(np.var(signal)) if signal.size else 0.0
    return 10 * math.log10(max(power, 0.01 / FULL_SCALE**2))
