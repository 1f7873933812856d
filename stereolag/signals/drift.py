"""Drift and steps: the lag over time, found in two recordings whose clocks run apart or that lack samples.

Short blocks of recording 1 are correlated with recording 2 around a lag. The lag over time is a ridge of this plane of
block and lag: it moves by the drift of the clocks from block to block, and jumps where samples are missing. It is found
by dynamic programming (R. Bellman, "Dynamic Programming" (1957)), in which a move has a small price and a jump a fixed
one, and every stretch between two jumps is a straight line through the blocks that agree clearly (P. K. Sen, "Estimates
of the regression coefficient based on Kendall's tau", J. Am. Stat. Assoc. 63 (1968), and least squares).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from itertools import pairwise

import numpy as np
import numpy.typing as npt
from scipy import fft, ndimage

from stereolag.core.arrays import FloatMap, Indices
from stereolag.signals.correlation import transform_length
from stereolag.signals.evidence import Samples
from stereolag.signals.over_time import TAPS, LagOverTime, Stretch, interpolation, on_first_clock, resample
from stereolag.signals.peaks import interpolate_peak
from stereolag.signals.recordings import Recording

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

_MOST_PARTS, _LONGEST_PART = 8, 2**16
"""Most parts of a time without a line in which a lag is searched, and their greatest length, samples."""

_FARTHEST_STEP = 2**17
"""Farthest that such a lag is searched from the one beside it, samples."""

_BLUR = 0.1
"""Change of the lag within a block that blurs no peak, samples."""

_FINE_REACH = 64


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
    return best[1] and _completed(recording_1, recording_2, best[1], _FEWEST * max(longest, size // _BLOCKS))


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


def _completed(recording_1: Recording, recording_2: Recording, over_time: LagOverTime, least: int) -> LagOverTime:
    """Return the lag over time with the lines of times that no block covers for so many samples, whatever their lag.

    A step may lead beyond the lags at which all blocks are searched.
    """
    begin, end = over_time.stretches[0].begin, over_time.stretches[-1].end
    known = lines = [line for line in over_time.stretches if line.places]
    gaps = [*pairwise([begin, *map(round, over_time.places), end])] if lines else []
    outer = [(0, begin), (end, recording_1.size)]  # where another lag may overlap
    while gaps:
        low, high = gaps.pop()
        found = _elsewhere(recording_1, recording_2, lines, low, high) if high - low >= least else None
        if found is not None:
            lines = sorted([*lines, found], key=lambda line: line.places[0])
            gaps += pairwise([low, *map(round, found.places), high])
        if not gaps and len(lines) > 1:
            gaps, outer = outer, []
    if lines is known:
        return over_time
    lines = _merged(lines, 1.0)
    begin, end = max(0, -round(lines[0].start)), min(recording_1.size, recording_2.size - round(lines[-1].start))
    return LagOverTime(tuple(_refined(recording_1, recording_2, one) or one for one in _between(lines, begin, end)))


def _elsewhere(
    recording_1: Recording, recording_2: Recording, lines: list[Stretch], low: int, high: int
) -> Stretch | None:
    """Return the line of the time between two neighbouring blocks of other lines, or None.

    None as well if blocks of one line are on both sides, or if the lag is also there at other times.
    """
    if any(line.places[0] <= low and high <= line.places[-1] for line in lines):
        return None
    begin, end = min(low, *(line.begin for line in lines)), max(high, *(line.end for line in lines))
    length = min(high - low, _LONGEST_PART)
    starts = np.linspace(low, high - length, min(_MOST_PARTS, math.ceil((high - low) / length))).astype(int)
    slope = max(lines, key=lambda line: len(line.places)).slope
    beside = min(lines, key=lambda line: min(abs(line.places[0] - high), abs(line.places[-1] - low)))
    reach = min((end - begin) // 4, _FARTHEST_STEP)
    line = Stretch(low, high, beside.lag_at((low + high) / 2) - slope * (low + high) / 2, slope)
    heights = _plane(recording_1, recording_2, starts, line, length, reach)
    top = int(heights.argmax()) % heights.shape[1]
    found = _refined(recording_1, recording_2, replace(line, start=line.start + top - reach))
    if found is None or not found.places:
        return None
    starts, length = _fine_starts(replace(found, begin=begin, end=end))
    along = _plane(recording_1, recording_2, starts, found, length, _FINE_REACH)[:, _FINE_REACH]
    inside = (starts + length > found.places[0]) & (starts < found.places[-1])
    return found if float(along[~inside].sum()) < _ECHO_SHARE * float(along[inside].mean()) * (~inside).sum() else None


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
        begin = math.floor(first + line.lag_at(first)) - TAPS
        part_2 = recording_2.part(begin, math.ceil(last + line.lag_at(last)) + TAPS)
        here = replace(line, start=line.start - begin, end=last)
        products = part * on_first_clock(part_2, LagOverTime((here,)), first, last - first)
        agreed.append(np.concatenate(([0.0], np.cumsum(products))))
    until, since = agreed
    gains = until[: max(0, until.size - missing)] - since[missing:]
    return first + int(np.argmax(gains)) if gains.size else before.end


def _between(lines: Sequence[Stretch], begin: int, end: int) -> list[Stretch]:
    """Return the lines with their borders halfway between their blocks."""
    borders = [round((one.places[-1] + two.places[0]) / 2) for one, two in pairwise(lines)]
    edges = [begin, *borders, end]
    return [replace(one, begin=low, end=high) for one, low, high in zip(lines, edges, edges[1:], strict=False)]


def _merged(lines: Sequence[Stretch], least: float = 0.8) -> list[Stretch]:
    """Return the lines with those joined that continue each other, or of whose blocks a share is on one line."""
    merged: list[Stretch] = []
    for line in lines:
        if merged:
            both = _line(np.array(merged[-1].places + line.places), np.array(merged[-1].lags + line.lags))
            border = (merged[-1].places[-1] + line.places[0]) / 2
            gap = abs(merged[-1].lag_at(border) - line.lag_at(border))
            kept = both is not None and len(both.places) >= least * (len(merged[-1].places) + len(line.places))
            if both is not None and (kept or gap <= _SAME_LINE):
                merged[-1] = both
                continue
        merged.append(line)
    return merged


def _fine_starts(line: Stretch) -> tuple[Indices, int]:
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
    return top + interpolate_peak(row, top, 16)[0]


def _plane(
    recording_1: Recording, recording_2: Recording, starts: Indices, line: Stretch, length: int, reach: int
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
        margin = TAPS if line.slope or not first.is_integer() else 0
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


def _ridge(heights: FloatMap, step: int) -> tuple[Indices, npt.NDArray[np.bool_]]:
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
