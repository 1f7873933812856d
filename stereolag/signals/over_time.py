"""The lag over time, with clocks that run apart or dropped buffers, and resampling to the clock of recording 1."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from functools import cached_property, lru_cache
from itertools import pairwise

import numpy as np
import numpy.typing as npt

from stereolag.core.arrays import FloatMap, Vector
from stereolag.loops.compilation import compiled
from stereolag.signals.evidence import Samples

_MIN_SLOPE_ERROR = 1e-9
"""Least standard error of a slope, samples per sample: that of a few blocks may be 0 by chance."""

TAPS = 32
"""Samples from which a value between them is interpolated."""

_PHASES = 512
"""Positions between two samples for which the weights are tabulated."""


@dataclass(frozen=True)
class Stretch:
    """A part of recording 1 in which the lag is a straight line over time.

    Attributes
    ----------
    begin, end
        Its first sample, and the one after its last.
    start
        Lag at sample 0 of recording 1, to which the line is extended, samples.
    slope
        Growth of the lag, samples per sample.
    slope_error
        Standard error of `slope`.
    places, lags
        (blocks,) centre of each block on the line, as a position in recording 1, and its lag, samples.
    """

    begin: int
    end: int
    start: float
    slope: float
    slope_error: float = math.inf
    places: tuple[float, ...] = ()
    lags: tuple[float, ...] = ()

    def lag_at(self, place: float) -> float:
        """Return the lag at a position in recording 1, samples."""
        return self.start + self.slope * place

    def for_part(self, begin: int) -> LagOverTime:
        """Return the line alone, for a part of recording 2 that starts at its sample `begin`."""
        return LagOverTime((replace(self, start=self.start - begin),))

    @property
    def spread(self) -> float:
        """Standard deviation of the blocks' lags about the line, samples."""
        residuals = np.array(self.lags) - self.start - self.slope * np.array(self.places)
        return float(np.sqrt(residuals @ residuals / max(1, residuals.size - 2)))


@dataclass(frozen=True)
class Step:
    """A place at which the lag jumps, because samples are missing in one of the recordings.

    Attributes
    ----------
    place
        Position in recording 1 up to which the lag is `before`, samples.
    before, after
        The lag on either side, samples.
    """

    place: float
    before: float
    after: float

    @property
    def missing(self) -> float:
        """Number of samples missing in recording 2; negative if they are missing in recording 1."""
        return self.before - self.after


@dataclass(frozen=True)
class LagOverTime:
    """The lag as a function of time: straight lines with jumps between them.

    Attributes
    ----------
    stretches
        One or more, in order of time; together they cover the samples that both recordings have.
    """

    stretches: tuple[Stretch, ...]

    @cached_property
    def longest(self) -> Stretch:
        """The longest stretch."""
        return max(self.stretches, key=lambda stretch: stretch.end - stretch.begin)

    def stretch_at(self, place: float) -> Stretch:
        """Return the stretch that contains a position in recording 1; the first or last one outside of them all."""
        return next((stretch for stretch in self.stretches if place < stretch.end), self.stretches[-1])

    def lag_at(self, place: float) -> float:
        """Return the lag at a position in recording 1, samples; outside the stretches, that of the nearest line."""
        return self.stretch_at(place).lag_at(place)

    @property
    def middle(self) -> float:
        """Lag in the middle of the part of the longest stretch in which it was measured, samples."""
        longest = self.longest
        first, last = (longest.places[0], longest.places[-1]) if longest.places else (longest.begin, longest.end)
        return longest.lag_at((first + last) / 2)

    @property
    def start(self) -> float:
        """Lag at the first sample that both recordings have, samples."""
        return self.stretches[0].lag_at(self.stretches[0].begin)

    @property
    def end(self) -> float:
        """Lag at the last sample that both recordings have, samples."""
        return self.stretches[-1].lag_at(self.stretches[-1].end)

    @property
    def lowest(self) -> float:
        """Lowest lag at any time, samples."""
        return min(stretch.lag_at(place) for stretch in self.stretches for place in (stretch.begin, stretch.end))

    @property
    def highest(self) -> float:
        """Highest lag at any time, samples."""
        return max(stretch.lag_at(place) for stretch in self.stretches for place in (stretch.begin, stretch.end))

    @property
    def span(self) -> float:
        """Change of the lag by drift from the first to the last common sample, samples, signed."""
        return sum(stretch.slope * (stretch.end - stretch.begin) for stretch in self.stretches)

    @property
    def ppm(self) -> float:
        """Growth of the lag, samples per million; positive if the clock of recording 2 runs faster."""
        return 1e6 * self._drift[0]

    @property
    def error_ppm(self) -> float:
        """Standard error of `ppm`."""
        return 1e6 * self._drift[1]

    @cached_property
    def _drift(self) -> tuple[float, float]:
        """Slope common to all stretches, and its standard error, samples per sample."""
        measured = [stretch for stretch in self.stretches if stretch.places]
        if not measured:
            return self.longest.slope, self.longest.slope_error
        slopes, errors = np.array([(line.slope, max(line.slope_error, _MIN_SLOPE_ERROR)) for line in measured]).T
        weights = (errors.min() / errors) ** 2
        return float(np.average(slopes, weights=weights)), float(errors.min() / math.sqrt(weights.sum()))

    @property
    def spread(self) -> float:
        """Standard deviation of the blocks' lags about their line, samples."""
        return self.longest.spread

    @property
    def places(self) -> tuple[float, ...]:
        """Centre of each block on a line, as a position in recording 1."""
        return tuple(place for stretch in self.stretches for place in stretch.places)

    @property
    def lags(self) -> tuple[float, ...]:
        """Lag of each block on a line, samples."""
        return tuple(lag for stretch in self.stretches for lag in stretch.lags)

    @property
    def blocks(self) -> int:
        """Number of blocks on the lines."""
        return len(self.places)

    @property
    def steps(self) -> tuple[Step, ...]:
        """The jumps of the lag, in order of time."""
        borders = [(one.end, one.lag_at(one.end), two.lag_at(one.end)) for one, two in pairwise(self.stretches)]
        return tuple(Step(float(place), before, after) for place, before, after in borders)

    @property
    def changes(self) -> bool:
        """Whether the lag changes by more than its uncertainty, and by enough to smear a peak."""
        return self.drifts or len(self.stretches) > 1

    @property
    def drifts(self) -> bool:
        """Whether the clocks run apart by more than the uncertainty, and by enough to smear a peak."""
        return self.drifts_by(1.0)

    def drifts_by(self, least: float) -> bool:
        """Return whether the clocks run apart by more than the uncertainty, and by at least so many samples."""
        return abs(self.span) >= least and abs(self.ppm) > 4 * self.error_ppm

    def shifted(self, offset: float) -> LagOverTime:
        """Return the lag over time with `offset` samples added."""
        return LagOverTime(
            tuple(
                replace(stretch, start=stretch.start + offset, lags=tuple(lag + offset for lag in stretch.lags))
                for stretch in self.stretches
            )
        )


@lru_cache(maxsize=1)
def interpolation() -> FloatMap:
    """Return (phases + 1, taps) weights that interpolate between two samples, by a Kaiser-windowed sinc."""
    half = TAPS // 2
    distance = (np.arange(_PHASES + 1) / _PHASES)[:, np.newaxis] - np.arange(1 - half, half + 1)
    weights = np.sinc(distance) * np.i0(7 * np.sqrt(np.maximum(0, 1 - (distance / half) ** 2)))
    return np.asarray(weights / weights.sum(axis=1, keepdims=True), dtype=np.float32)


def on_first_clock(signal_2: npt.NDArray[np.floating], over_time: LagOverTime, first: int, size: int) -> Samples:
    """Return recording 2 resampled to the samples of recording 1 from `first` on, (size,) float32.

    By a windowed sinc of 32 samples; 0 where recording 2 has no samples.
    """
    out = np.zeros(size, dtype=np.float32)
    ends = [first, *(stretch.end for stretch in over_time.stretches[:-1]), first + size]
    edges = np.clip(ends, first, first + size) - first
    for stretch, (low, high) in zip(over_time.stretches, pairwise(edges), strict=True):
        place = first + int(low)
        resample(signal_2, place + stretch.lag_at(place), 1 + stretch.slope, interpolation(), out[low:high])
    return out


_ROUNDING = 1e-9
"""Samples by which rounding may move a position beyond the first or last sample."""


@compiled(fastmath={"reassoc", "contract"})
def resample(
    samples: npt.NDArray[np.floating], first: float, step: float, filters: FloatMap, out: npt.NDArray[np.float32]
) -> None:
    """Fill `out` with `samples` interpolated at `first`, `first` + `step`, …; 0 outside of them, except for rounding.

    Parameters
    ----------
    samples
        (N,).
    first, step
        Position of the first value and distance between two, samples.
    filters
        (phases + 1, taps) weights of the samples around a position, for positions from one sample to the next.
    out
        (values,).
    """
    phases, taps = filters.shape[0] - 1, filters.shape[1]
    for i in range(out.size):
        at = first + i * step
        out[i] = 0.0
        if at < -_ROUNDING or at > samples.size - 1 + _ROUNDING:
            continue
        whole = int(at)
        place = (at - whole) * phases
        phase = min(int(place), phases - 1)
        part = place - phase
        begin = whole - taps // 2 + 1
        total = 0.0
        for tap in range(max(0, -begin), min(taps, samples.size - begin)):
            weight = filters[phase, tap]
            total += samples[begin + tap] * (weight + part * (filters[phase + 1, tap] - weight))
        out[i] = total


def resample_reference(samples: Vector, first: float, step: float, filters: FloatMap, values: int) -> Vector:
    """Return the expected result of :func:`resample`."""
    at = first + step * np.arange(values)
    whole = np.floor(at).astype(int)
    half, phases = filters.shape[1] // 2, filters.shape[0] - 1
    padded = np.pad(samples.astype(np.float64), half)
    places = np.arange(phases + 1) / phases
    found = np.zeros(values)
    for i, (position, begin) in enumerate(zip(at, whole, strict=True)):
        if -_ROUNDING <= position <= samples.size - 1 + _ROUNDING:
            weights = [np.interp(position - begin, places, column) for column in filters.T]
            found[i] = np.dot(weights, np.pad(padded, (0, 2))[begin + 1 : begin + 1 + 2 * half])
    return found
