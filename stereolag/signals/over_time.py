"""The lag over time: two clocks that run apart, buffers that were dropped, and a recording on the other one's clock.

Short blocks of recording 1 are correlated with recording 2 around a lag. The lag over time is a ridge of this plane of
block and lag: it moves by the drift of the clocks from block to block, and jumps where samples are missing. It is found
by dynamic programming (R. Bellman, "Dynamic Programming" (1957)), in which a move has a small price and a jump a fixed
one, and every stretch between two jumps is a straight line through the blocks that agree clearly (P. K. Sen, "Estimates
of the regression coefficient based on Kendall's tau", J. Am. Stat. Assoc. 63 (1968), and least squares).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property, lru_cache
from itertools import pairwise

import numpy as np
import numpy.typing as npt
from scipy import fft, ndimage

from stereolag.core.arrays import FloatMap, Vector
from stereolag.loops.compilation import compiled
from stereolag.signals.correlation import Lags, Recording, around_peak, interpolate_peak, transform_length
from stereolag.signals.evidence import Samples

FARTHEST_PPM = 12_000
"""Largest drift that is looked for."""

_BLOCKS, _FINE_BLOCKS = 48, 16
_SHORTEST, _LONGEST = 128, 4096
_FEWEST = 4
"""Least number of blocks on a line."""

_MOST_BLOCKS = 192
_LEAST_REACH, _MOST_REACH = 48, 2**14
_PLANE_POINTS, _POINTS_AT_ONCE = 2**23, 2**20
"""Most points of a plane, and of the blocks transformed at once: 30 MB each."""

_CLEAR = 4.5
_CLEAREST = 9.0
"""Heights of a block's peak, in deviations: from which on it is clear, and above which more does not count."""

_JUMP, _MOVE = 6.0, 2.0
"""Price of a jump beyond that of the number of lags to choose from, and of a move by the largest drift."""

_STRAY, _FARTHEST_STRAY, _SAME_LINE = 2.0, 8.0, 1.5
_USUAL_PPM = 300
_ALL, _MOST = 0.9, 0.6
"""Shares of the blocks on a line from which on nothing else is tried."""

_OTHER_DRIFT = 5.0
"""Standard errors by which two lines differ that are not of one clock."""

_ECHO_SHARE = 0.25
"""A lag belongs to its stretch alone if its mean height elsewhere is below this share."""

_BLUR = 0.1
"""Change of the lag within a block that blurs no peak, samples."""

_FINE_REACH = 64
_TAPS, _PHASES = 32, 512


def median_line(places: npt.NDArray[np.floating], values: npt.NDArray[np.floating]) -> tuple[float, float]:
    """Return slope and intercept of the median line of Theil (1950) and Sen (1968).

    Agrees with :func:`scipy.stats.theilslopes`, whose package takes a second to import.

    Parameters
    ----------
    places, values
        (points,) abscissae, not all equal, and ordinates.
    """
    apart = places[:, np.newaxis] - places
    later = apart > 0
    slope = float(np.median((values[:, np.newaxis] - values)[later] / apart[later]))
    return slope, float(np.median(values) - slope * np.median(places))


@dataclass(frozen=True)
class Stretch:
    """A part of recording 1 in which the lag is a straight line over time.

    Attributes
    ----------
    begin, end
        Its first sample, and the one after its last.
    start
        Lag at sample 0 of recording 1, if the line went on to it, samples.
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

    @property
    def spread(self) -> float:
        """Standard deviation of the blocks' lags about the line, samples."""
        away = np.array(self.lags) - self.start - self.slope * np.array(self.places)
        return float(np.sqrt(away @ away / max(1, away.size - 2)))


@dataclass(frozen=True)
class Step:
    """A place at which the lag jumps, because samples are missing in one of the recordings.

    Attributes
    ----------
    place
        Position in recording 1 up to which the lag is the one before, samples.
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
        return max(self.stretches, key=lambda one: one.end - one.begin)

    def lag_at(self, place: float) -> float:
        """Return the lag at a position in recording 1, samples; before and after the recordings, of the line there."""
        return next((one for one in self.stretches if place < one.end), self.stretches[-1]).lag_at(place)

    @property
    def middle(self) -> float:
        """Lag in the middle of the part of the longest stretch in which it was measured, samples."""
        one = self.longest
        first, last = (one.places[0], one.places[-1]) if one.places else (one.begin, one.end)
        return one.lag_at((first + last) / 2)

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
        return min(one.lag_at(place) for one in self.stretches for place in (one.begin, one.end))

    @property
    def highest(self) -> float:
        """Highest lag at any time, samples."""
        return max(one.lag_at(place) for one in self.stretches for place in (one.begin, one.end))

    @property
    def span(self) -> float:
        """Change of the lag by drift from the first to the last common sample, samples, signed."""
        return sum(one.slope * (one.end - one.begin) for one in self.stretches)

    @property
    def ppm(self) -> float:
        """Growth of the lag, samples per million; positive if the clock of recording 2 runs faster."""
        return 1e6 * self.longest.slope

    @property
    def error_ppm(self) -> float:
        """Standard error of `ppm`."""
        return 1e6 * self.longest.slope_error

    @property
    def spread(self) -> float:
        """Standard deviation of the blocks' lags about their line, samples."""
        return self.longest.spread

    @property
    def places(self) -> tuple[float, ...]:
        """Centre of each block on a line, as a position in recording 1."""
        return tuple(place for one in self.stretches for place in one.places)

    @property
    def lags(self) -> tuple[float, ...]:
        """Lag of each block on a line, samples."""
        return tuple(lag for one in self.stretches for lag in one.lags)

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
    def shows(self) -> bool:
        """Whether the lag changes by more than its uncertainty, and by enough to smear a peak."""
        return self.drifts or len(self.stretches) > 1

    @property
    def drifts(self) -> bool:
        """Whether the clocks run apart by more than the uncertainty, and by enough to smear a peak."""
        return abs(self.span) >= 1.0 and abs(self.ppm) > 4 * self.error_ppm

    def seen_from(self, start: int, begin: int) -> LagOverTime:
        """Return the line at a position in recording 1, for a part of recording 2 that starts at its sample `begin`."""
        stretch = next((one for one in self.stretches if start < one.end), self.stretches[-1])
        return LagOverTime((replace(stretch, start=stretch.start - begin),))

    def moved(self, lags: float) -> LagOverTime:
        """Return this with all lags larger by a number of samples."""
        return LagOverTime(
            tuple(
                replace(one, start=one.start + lags, lags=tuple(lag + lags for lag in one.lags))
                for one in self.stretches
            )
        )


def follow_lag(
    recording_1: Recording, recording_2: Recording, lag: int, reach: int = 0, ppm: float = FARTHEST_PPM
) -> LagOverTime | None:
    """Return the lag over time near a lag; None if too few blocks agree.

    Parameters
    ----------
    recording_1, recording_2
        Recordings of N1 and N2 samples.
    lag
        A lag that occurs at some time, samples.
    reach
        Least distance from `lag` up to which others are looked for, samples.
    ppm
        Largest drift, samples per million; the lag is searched as far from `lag` as it can lead.
    """
    size = min(recording_1.size, recording_2.size - lag) - max(0, -lag)
    longest = int(np.clip(2 ** round(math.log2(max(size, 1) / _BLOCKS)), _SHORTEST, _LONGEST))
    # Where another lag is to be reached, the line may jump.
    best = _straight(recording_1, recording_2, lag) if reach <= _LEAST_REACH else (0.0, None)
    # Ordinary clocks first, in a narrow strip; then blocks that are so short that the drift does not blur them.
    for length, least in ((longest, _ALL), (longest // 8, _MOST)):
        if best[0] < least and length >= _SHORTEST:
            strip = max(reach, int(ppm * 1e-6 * size))
            best = max(best, _followed(recording_1, recording_2, lag, strip, ppm, length), key=lambda one: one[0])
    return best[1]


def _straight(recording_1: Recording, recording_2: Recording, lag: int) -> tuple[float, LagOverTime | None]:
    """Return the share of the blocks that are on one line of ordinary clocks, and that line."""
    begin, end = max(0, -lag), min(recording_1.size, recording_2.size - lag)
    line, share = Stretch(begin, end, lag, 0.0), 0.0
    reach = max(_FINE_REACH, min(_MOST_REACH, int(_USUAL_PPM * 1e-6 * (end - begin))))
    for _ in range(2):  # the second time along the drift found first
        starts, length = _fine_starts(line)
        found = _refined(recording_1, recording_2, line, reach) if starts.size > _FEWEST else None
        if found is None or not found.places:
            break
        line, share, reach = found, len(found.places) / starts.size, _FINE_REACH
        if abs(line.slope) * length < _BLUR:
            break
    return share, LagOverTime((line,)) if share else None


def _followed(
    recording_1: Recording, recording_2: Recording, lag: int, reach: int, ppm: float, length: int
) -> tuple[float, LagOverTime | None]:
    """Return the share of the blocks that are on a line, and the lag over time by blocks of a length."""
    begin, end = max(0, -lag), min(recording_1.size, recording_2.size - lag)
    starts = np.arange(begin, end - length // 2, length)
    if starts.size <= _FEWEST:
        return 0.0, None
    reach = int(np.clip(reach, _LEAST_REACH, _MOST_REACH))
    most = min(_MOST_BLOCKS, max(16, _PLANE_POINTS // (2 * length + 2 * reach)))
    if starts.size > most:
        starts = starts[np.linspace(0, starts.size - 1, most).astype(int)]
    heights = _plane(recording_1, recording_2, starts, Stretch(begin, end, lag, 0.0), length, reach)
    if (heights.max(axis=1) > _CLEAR).sum() < _FEWEST:  # nor would more of them be clear on any path
        return 0.0, None
    step = max(1, math.ceil(ppm * 1e-6 * float(np.diff(starts).max())))
    path, clear = _ridge(heights, step)
    places = starts + length / 2
    lags = lag - reach + np.array([_top(row, top) for row, top in zip(heights, path.tolist(), strict=True)])
    cuts = np.flatnonzero(np.abs(np.diff(path)) > step) + 1
    lines = [
        line
        for part in np.split(np.arange(starts.size), cuts)
        if (line := _line(places[part[clear[part]]], lags[part[clear[part]]])) is not None
    ]
    lines = _steps_alone(_of_one_clock(_merged(lines), places), heights, places, lag - reach)
    if not lines:
        return 0.0, None
    share = sum(len(line.places) for line in lines) / starts.size
    finer = [_refined(recording_1, recording_2, line) for line in _between(lines, begin, end)]
    confirmed = _merged([one for one in finer if one is not None]) or lines
    return share, LagOverTime(tuple(_between(confirmed, begin, end)))


def _of_one_clock(lines: list[Stretch], places: npt.NDArray[np.floating]) -> list[Stretch]:
    """Return the lines, without those that a few blocks make by chance.

    Missing samples do not change the drift, so a line of another drift needs almost all blocks of its time.
    """
    if len(lines) < 2:
        return lines
    best = max(lines, key=lambda line: len(line.places))

    def holds(line: Stretch) -> bool:
        there = int(((places >= line.places[0]) & (places <= line.places[-1])).sum())
        error = math.hypot(line.slope_error, best.slope_error)
        return len(line.places) >= _ALL * there or abs(line.slope - best.slope) <= _OTHER_DRIFT * error

    return _merged([line for line in lines if holds(line)])


def _steps_alone(
    lines: list[Stretch], heights: Samples, places: npt.NDArray[np.floating], lowest: int
) -> list[Stretch]:
    """Return the lines, without those that are there before or after their time as well: an echo or a shared noise."""
    while len(lines) > 1:
        along = []
        for line in lines:
            columns = np.round(line.start + line.slope * places).astype(int) - lowest
            along.append(heights[np.arange(places.size), np.clip(columns, 0, heights.shape[1] - 1)])
        gains = [np.minimum(one, _CLEAREST) for one in along]
        # Between two lines, the border at which both together have the most.
        borders = [0, *(int(np.argmax(np.cumsum(one - two))) + 1 for one, two in pairwise(gains)), places.size]
        shares = []
        for one, begin, end in zip(along, borders, borders[1:], strict=False):
            elsewhere = np.delete(one, np.s_[begin:end])
            inside = float(one[begin:end].mean()) if begin < end else 0.0
            shares.append(float(elsewhere.mean()) / max(inside, 1e-30) if elsewhere.size else math.inf)
        if max(shares) < _ECHO_SHARE:
            break
        fewest = min(range(len(lines)), key=lambda at: len(lines[at].places))
        del lines[fewest]
        lines = _merged(lines)
    return lines


def with_steps_placed(recording_1: Recording, recording_2: Recording, over_time: LagOverTime) -> LagOverTime:
    """Return the lag over time with each step at the sample where the recordings put it."""
    lines = [*over_time.stretches]
    for number in range(1, len(lines)):
        before, after = lines[number - 1 : number + 1]
        place = _step_place(recording_1, recording_2, before, after)
        lines[number - 1 : number + 1] = replace(before, end=place), replace(after, begin=place)
    return LagOverTime(tuple(lines))


def _step_place(recording_1: Recording, recording_2: Recording, before: Stretch, after: Stretch) -> int:
    """Return the sample of recording 1 up to which one line fits best, and after what recording 2 lacks, the other."""
    missing = max(0, round(before.lag_at(before.end) - after.lag_at(before.end)))
    apart = after.places[0] - before.places[-1] if before.places and after.places else 0
    reach = max(_LONGEST, math.ceil(apart)) + missing
    first, last = max(before.begin, before.end - reach), min(after.end, before.end + reach)
    part = recording_1.part(first, last)
    agreed = []
    for line in (before, after):
        begin = math.floor(first + line.lag_at(first)) - _TAPS
        part_2 = recording_2.part(begin, math.ceil(last + line.lag_at(last)) + _TAPS)
        here = replace(line, start=line.start - begin, end=last)
        products = part * on_first_clock(part_2, LagOverTime((here,)), first, last - first)
        agreed.append(np.concatenate(([0.0], np.cumsum(products))))
    until, since = agreed
    gains = until[: until.size - missing] - since[missing:]
    return first + int(np.argmax(gains)) if gains.size else before.end


def _between(lines: Sequence[Stretch], begin: int, end: int) -> list[Stretch]:
    """Return the lines with their borders halfway between their blocks."""
    borders = [round((one.places[-1] + two.places[0]) / 2) for one, two in pairwise(lines)]
    edges = [begin, *borders, end]
    return [replace(one, begin=low, end=high) for one, low, high in zip(lines, edges, edges[1:], strict=False)]


def _merged(lines: Sequence[Stretch]) -> list[Stretch]:
    """Return the lines with those joined that continue each other."""
    merged: list[Stretch] = []
    for line in lines:
        if merged:
            both = _line(np.array(merged[-1].places + line.places), np.array(merged[-1].lags + line.lags))
            border = (merged[-1].places[-1] + line.places[0]) / 2
            gap = abs(merged[-1].lag_at(border) - line.lag_at(border))
            kept = both is not None and len(both.places) >= 0.8 * (len(merged[-1].places) + len(line.places))
            if both is not None and (kept or gap <= _SAME_LINE):
                merged[-1] = both
                continue
        merged.append(line)
    return merged


def _fine_starts(line: Stretch) -> tuple[Lags, int]:
    """Return the first samples of the blocks in which a line is measured, and their length."""
    size = line.end - line.begin
    length = int(np.clip(size // _FINE_BLOCKS, _SHORTEST, 4 * _LONGEST))
    return np.arange(line.begin, line.end - length // 2, max(length, size // _MOST_BLOCKS)), length


def _refined(recording_1: Recording, recording_2: Recording, line: Stretch, reach: int = _FINE_REACH) -> Stretch | None:
    """Return a line measured anew in blocks that follow it; None if fewer than half of its blocks confirm it."""
    starts, length = _fine_starts(line)
    places = starts + length / 2
    heights = _plane(recording_1, recording_2, starts, line, length, reach)
    tops = heights.argmax(axis=1)
    clear = (heights.max(axis=1) > _CLEAR) & (np.abs(tops - reach) < reach)
    away = [_top(row, int(top)) - reach for row, top in zip(heights, tops, strict=True)]
    fine = line.start + line.slope * places + np.array(away)
    found = _line(places[clear], fine[clear])
    if found is None or 2 * len(found.places) < int(clear.sum()):
        return None if int(clear.sum()) >= _FEWEST else line
    return replace(found, begin=line.begin, end=line.end)


def _line(places: npt.NDArray[np.floating], lags: npt.NDArray[np.floating]) -> Stretch | None:
    """Return the line through most of some blocks; None if there are fewer than ``_FEWEST`` on it."""
    if places.size < _FEWEST:
        return None
    slope, start = median_line(places, lags)
    away = np.abs(lags - start - slope * places)
    near = away <= np.clip(2.5 * float(np.median(away)), _STRAY, _FARTHEST_STRAY)
    if near.sum() < _FEWEST:
        return None
    middle = float(places[near].mean())
    slope, height = np.polyfit(places[near] - middle, lags[near], 1)
    rest = lags[near] - height - slope * (places[near] - middle)
    freedom = max(1, int(near.sum()) - 2)
    error = math.sqrt(float(rest @ rest) / freedom / float(np.sum((places[near] - middle) ** 2)))
    return Stretch(
        0,
        0,
        float(height - slope * middle),
        float(slope),
        error,
        tuple(places[near].tolist()),
        tuple(lags[near].tolist()),
    )


def _top(row: Samples, top: int) -> float:
    """Return the position of a peak between the lags."""
    return top + interpolate_peak(row[around_peak(top, row.size, 16)].astype(np.float64))[0]


def _plane(
    recording_1: Recording, recording_2: Recording, starts: Lags, line: Stretch, length: int, reach: int
) -> Samples:
    """Return (blocks, 2 * reach + 1) heights of each block's curve around a line, in its standard deviations.

    Two curves are taken, whitened and by phase, of each the higher value.
    """
    points = transform_length(length + length // 4 + 2 * reach, real=True)
    together = max(1, _POINTS_AT_ONCE // points)
    if starts.size > together:
        groups = (starts[begin : begin + together] for begin in range(0, starts.size, together))
        return np.concatenate([_plane(recording_1, recording_2, group, line, length, reach) for group in groups])
    rows = np.zeros((2, starts.size, points), dtype=np.float32)
    for start, row_1, row_2 in zip(starts.tolist(), rows[0], rows[1], strict=True):
        row_1[:length] = recording_1.part(start, start + length)
        first = float(start + line.lag_at(start) - reach * (1 + line.slope))
        margin = _TAPS if line.slope or not first.is_integer() else 0
        begin = math.floor(first) - margin
        count = math.ceil((length + 2 * reach) * (1 + abs(line.slope))) + 2 * margin
        part = recording_2.part(begin, begin + count)
        if margin:
            resample(part, first - begin, 1 + line.slope, interpolation(), row_2[: length + 2 * reach])
        else:
            row_2[: length + 2 * reach] = part[: length + 2 * reach]
    spectra = fft.rfft(rows, axis=-1, workers=2)
    del rows
    powers = np.mean(spectra.real**2 + spectra.imag**2, axis=1)
    power = ndimage.uniform_filter1d(np.sqrt(powers[0] * powers[1]), max(3, points // 128), mode="reflect")
    cross = spectra[0].conj() * spectra[1]
    del spectra
    magnitude = np.abs(cross)
    floors = (
        np.float32(1e-2 * float(np.quantile(power, 0.98)) + 1e-30),
        np.float32(1e-2) * magnitude.mean(axis=1, keepdims=True),
    )
    heights = np.full((starts.size, 2 * reach + 1), -np.inf, dtype=np.float32)
    for scale in (power + floors[0], magnitude + floors[1] + np.float32(1e-30)):
        curves = fft.irfft(cross / scale, points, axis=-1, workers=2)[:, : 2 * reach + 1]
        deviation = np.sqrt(np.mean(curves * curves, axis=1, keepdims=True)) + np.float32(1e-30)
        np.maximum(heights, curves / deviation, out=heights)
    return heights


def _ridge(heights: FloatMap, step: int) -> tuple[Lags, npt.NDArray[np.bool_]]:
    """Return the most probable path through the plane, an index for each block, and which of them are clear."""
    gains = np.clip(heights, 0, _CLEAREST)
    gains *= gains
    gains /= 2
    gains -= 0.5
    jump = math.log(heights.shape[1]) + _JUMP
    prices = np.arange(heights.shape[1], dtype=np.float32) * np.float32(_MOVE / step)
    best = np.empty_like(gains)
    best[0] = gains[0]
    for before, here, gain in zip(best, best[1:], gains[1:], strict=False):
        forth = np.maximum.accumulate(before + prices) - prices
        back = np.maximum.accumulate((before - prices)[::-1])[::-1] + prices
        np.maximum(np.maximum(forth, back), before.max() - jump, out=here)
        here += gain
    path = [int(np.argmax(best[-1]))]
    for before in best[-2::-1]:
        beside = int(np.argmax(before - np.abs(prices - prices[path[-1]])))
        stays = before[beside] - abs(prices[beside] - prices[path[-1]]) >= before.max() - jump
        path.append(beside if stays else int(np.argmax(before)))
    indices = np.array(path[::-1])
    return indices, heights[np.arange(len(gains)), indices] > _CLEAR


@lru_cache(maxsize=1)
def interpolation() -> FloatMap:
    """Return (phases + 1, taps) weights that interpolate between two samples, by a Kaiser-windowed sinc."""
    half = _TAPS // 2
    away = (np.arange(_PHASES + 1) / _PHASES)[:, np.newaxis] - np.arange(1 - half, half + 1)
    weights = np.sinc(away) * np.i0(7 * np.sqrt(np.maximum(0, 1 - (away / half) ** 2)))
    return np.asarray(weights / weights.sum(axis=1, keepdims=True), dtype=np.float32)


def on_first_clock(signal_2: npt.NDArray[np.floating], over_time: LagOverTime, first: int, size: int) -> Samples:
    """Return the samples of recording 2 that belong to the samples of recording 1 from `first` on, (size,) float32.

    Between its samples, recording 2 is interpolated by a windowed sinc of 32 samples; 0 where it has none.
    """
    out = np.zeros(size, dtype=np.float32)
    ends = [one.end for one in over_time.stretches[:-1]]
    edges = np.clip([first, *ends, first + size], first, first + size) - first
    for stretch, low, high in zip(over_time.stretches, edges, edges[1:], strict=False):
        place = first + int(low)
        resample(signal_2, place + stretch.lag_at(place), 1 + stretch.slope, interpolation(), out[low:high])
    return out


_ROUNDING = 1e-9
"""Samples by which rounding may put a position beyond the first or last sample that it is meant to be at."""


@compiled(fastmath={"reassoc", "contract"})
def resample(
    samples: npt.NDArray[np.floating], first: float, step: float, filters: FloatMap, out: npt.NDArray[np.float32]
) -> None:
    """Fill `out` with the values at `first`, `first` + `step`, … of `samples`; 0 outside of them but for rounding.

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
