"""Drift and steps: the lag over time of two recordings whose clocks run apart or in which samples are missing.

Short blocks of recording 1 are correlated with recording 2 around a lag. The lag over time is a ridge in the plane of
blocks and lags: it moves from block to block as the clocks drift, and jumps where samples are missing. The ridge is
found by dynamic programming (R. Bellman, "Dynamic Programming" (1957)) with a small penalty for each move and a fixed
one for each jump. Between two jumps, a straight line is fitted to the blocks with a clear peak (P. K. Sen, "Estimates
of the regression coefficient based on Kendall's tau", J. Am. Stat. Assoc. 63 (1968), then least squares).
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

_MAX_DRIFT_PPM = 12_000
"""Largest drift that is searched for, samples per million."""

_COARSE_BLOCKS = 48
"""Blocks that the overlap is divided into for the plane, about."""

_FINE_BLOCKS = 16
"""Blocks that a line is divided into where it is measured anew."""

_MIN_BLOCK_LENGTH = 128
"""Samples; shortest block."""

_MAX_BLOCK_LENGTH = 4096
"""Samples; longest block of the plane. Where a line is measured anew, blocks are up to four times as long."""

_MIN_BLOCKS_ON_LINE = 4
_MAX_BLOCKS = 192
_MIN_REACH = 48
"""Samples either way; smallest half width of the plane."""

_MAX_REACH = 2**14
"""Samples either way; largest half width of the plane."""

_MAX_PLANE_POINTS = 2**23
"""Points of the whole plane: 30 MB."""

_MAX_TRANSFORMED_POINTS = 2**20
"""Points of the blocks that are transformed together: 30 MB."""

_MIN_CLEAR_HEIGHT = 4.5
"""Standard deviations of a block's curve above which its peak is clear."""

_MAX_COUNTED_HEIGHT = 9.0
"""Standard deviations; a higher peak counts no more than this."""

_JUMP_PENALTY = 6.0
"""Penalty of a jump, on top of the logarithm of the number of lags it can lead to."""

_MOVE_PENALTY = 2.0
"""Penalty of a move by the largest drift."""

_RESIDUAL_LIMITS = (2.0, 8.0)
"""Samples; bounds of the residual up to which a block is on a line."""

_MAX_GAP_IN_LINE = 1.5
"""Samples; two lines with a smaller gap where they meet are one."""

_ORDINARY_PPM = 300
"""Largest drift of ordinary clocks, samples per million."""

_MIN_SHARE_ON_LINE = 0.9
"""Share of the blocks on a line from which on no path is searched, and a drift unlike the others is believed."""

_MIN_SHARE_ON_PATH = 0.6
"""Share of the blocks on the lines of a path from which on no path through shorter blocks is searched."""

_MAX_SLOPE_DIFFERENCE = 5.0
"""Standard errors; two lines whose slopes differ by more do not belong to one clock."""

_MAX_HEIGHT_ELSEWHERE = 0.25
"""A lag belongs to its stretch alone if its mean height elsewhere is below this share of that in the stretch."""

_MAX_PARTS = 8
"""Parts of a gap between lines that are searched for a lag."""

_MAX_PART_LENGTH = 2**16
"""Samples; longest of these parts."""

_MAX_STEP = 2**17
"""Samples; largest distance of a lag in a gap from that of the line beside it."""

_MAX_CHANGE_IN_BLOCK = 0.1
"""Samples by which the lag may change within a block without blurring its peak."""

_FINE_REACH = 64
"""Samples either way in which a line is measured anew."""


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


def follow_lag(recording_1: Recording, recording_2: Recording, lag: int, reach: int = 0) -> LagOverTime | None:
    """Return the lag over time near a lag; None if too few blocks agree.

    Parameters
    ----------
    recording_1, recording_2
        Recordings of N1 and N2 samples.
    lag
        A lag that occurs at some time, samples.
    reach
        Distance from `lag` that is searched at least, samples; it is always searched as far as drift can lead.
    """
    size = min(recording_1.size, recording_2.size - lag) - max(0, -lag)
    longest = int(np.clip(2 ** round(math.log2(max(size, 1) / _COARSE_BLOCKS)), _MIN_BLOCK_LENGTH, _MAX_BLOCK_LENGTH))
    # With a larger reach there may be other lags, so the lag may jump.
    best = _straight_line(recording_1, recording_2, lag) if reach <= _MIN_REACH else (0.0, None)
    # A path through the longest blocks, then through blocks so short that no drift blurs them.
    for length, enough in ((longest, _MIN_SHARE_ON_LINE), (longest // 8, _MIN_SHARE_ON_PATH)):
        if best[0] < enough and length >= _MIN_BLOCK_LENGTH:
            strip = max(reach, int(_MAX_DRIFT_PPM * 1e-6 * size))
            best = max(best, _lag_by_blocks(recording_1, recording_2, lag, strip, length), key=lambda found: found[0])
    if best[1] is None:
        return None
    filled = _fill_gaps(recording_1, recording_2, best[1], max(longest, size // _COARSE_BLOCKS))
    return _with_steps_located(recording_1, recording_2, filled)


def _straight_line(recording_1: Recording, recording_2: Recording, lag: int) -> tuple[float, LagOverTime | None]:
    """Return the share of blocks on one straight line with the drift of ordinary clocks, and that line."""
    begin, end = max(0, -lag), min(recording_1.size, recording_2.size - lag)
    line, share = Stretch(begin, end, lag, 0.0), 0.0
    reach = max(_FINE_REACH, min(_MAX_REACH, int(_ORDINARY_PPM * 1e-6 * (end - begin))))
    for _ in range(2):  # the second time in blocks that follow the drift found first
        starts, length = _fine_starts(line)
        found = _refine(recording_1, recording_2, line, reach) if starts.size > _MIN_BLOCKS_ON_LINE else None
        if found is None or not found.places:
            break
        line, share, reach = found, len(found.places) / starts.size, _FINE_REACH
        if abs(line.slope) * length < _MAX_CHANGE_IN_BLOCK:
            break
    return share, LagOverTime((line,)) if share else None


def _lag_by_blocks(
    recording_1: Recording, recording_2: Recording, lag: int, reach: int, length: int
) -> tuple[float, LagOverTime | None]:
    """Return the share of blocks on a line, and the lag over time, measured in blocks of `length` samples."""
    begin, end = max(0, -lag), min(recording_1.size, recording_2.size - lag)
    starts = np.arange(begin, end - length // 2, length)
    if starts.size <= _MIN_BLOCKS_ON_LINE:
        return 0.0, None
    reach = int(np.clip(reach, _MIN_REACH, _MAX_REACH))
    most = min(_MAX_BLOCKS, max(16, _MAX_PLANE_POINTS // (2 * length + 2 * reach)))
    if starts.size > most:
        starts = starts[np.linspace(0, starts.size - 1, most).astype(int)]
    heights = _plane(recording_1, recording_2, starts, Stretch(begin, end, lag, 0.0), length, reach)
    if (heights.max(axis=1) > _MIN_CLEAR_HEIGHT).sum() < _MIN_BLOCKS_ON_LINE:  # so no path has enough clear blocks
        return 0.0, None
    step = max(1, math.ceil(_MAX_DRIFT_PPM * 1e-6 * float(np.diff(starts).max())))
    path, clear = _ridge(heights, step)
    places = starts + length / 2
    lags = lag - reach + np.array([_peak_position(row, top) for row, top in zip(heights, path.tolist(), strict=True)])
    cuts = np.flatnonzero(np.abs(np.diff(path)) > step) + 1
    lines = [
        line
        for part in np.split(np.arange(starts.size), cuts)
        if (line := _fit_line(places[part[clear[part]]], lags[part[clear[part]]])) is not None
    ]
    lines = _without_echoes(_lines_of_one_clock(_merge(lines), places), heights, places, lag - reach)
    if not lines:
        return 0.0, None
    share = sum(len(line.places) for line in lines) / starts.size
    finer = [_refine(recording_1, recording_2, line) for line in _with_borders(lines, begin, end)]
    confirmed = _merge([line for line in finer if line is not None]) or lines
    return share, LagOverTime(tuple(_with_borders(confirmed, begin, end)))


def _fill_gaps(recording_1: Recording, recording_2: Recording, over_time: LagOverTime, block: int) -> LagOverTime:
    """Return the lag over time with lines added in gaps, whatever their lag.

    A step may lead beyond the lags that the plane covers, and two steps may have too few blocks of the plane between
    them, `block` samples long: any gap of more than one block between two lines is searched.
    """
    begin, end = over_time.stretches[0].begin, over_time.stretches[-1].end
    known = lines = [line for line in over_time.stretches if line.places]
    gaps = [*pairwise([begin, *map(round, over_time.places), end])] if lines else []
    outer = [(0, begin), (end, recording_1.size)]  # where the recordings may overlap at another lag
    while gaps:
        low, high = gaps.pop()
        between = lines[0].places[-1] <= low and high <= lines[-1].places[0]
        min_gap = (1.5 if between else _MIN_BLOCKS_ON_LINE) * block
        found = _line_in_gap(recording_1, recording_2, lines, low, high) if high - low >= min_gap else None
        if found is not None:
            lines = sorted([*lines, found], key=lambda line: line.places[0])
            gaps += pairwise([low, *map(round, found.places), high])
        if not gaps and len(lines) > 1:
            gaps, outer = outer, []
    if lines is known:
        return over_time
    lines = _merge(lines, 1.0)
    begin, end = max(0, -round(lines[0].start)), min(recording_1.size, recording_2.size - round(lines[-1].start))
    return LagOverTime(
        tuple(_refine(recording_1, recording_2, line) or line for line in _with_borders(lines, begin, end))
    )


def _line_in_gap(
    recording_1: Recording, recording_2: Recording, lines: list[Stretch], low: int, high: int
) -> Stretch | None:
    """Return the line in the gap from `low` to `high` between neighbouring blocks of other lines, or None.

    None also if one line has blocks on both sides, or if the recordings agree at the new lag at other times too.
    """
    if any(line.places[0] <= low and high <= line.places[-1] for line in lines):
        return None
    begin, end = min(low, *(line.begin for line in lines)), max(high, *(line.end for line in lines))
    length = min(high - low, _MAX_PART_LENGTH)
    starts = np.linspace(low, high - length, min(_MAX_PARTS, math.ceil((high - low) / length))).astype(int)
    slope = max(lines, key=lambda line: len(line.places)).slope
    beside = min(lines, key=lambda line: min(abs(line.places[0] - high), abs(line.places[-1] - low)))
    reach = min((end - begin) // 2, _MAX_STEP)
    line = Stretch(low, high, beside.lag_at((low + high) / 2) - slope * (low + high) / 2, slope)
    heights = _plane(recording_1, recording_2, starts, line, length, reach)
    top = int(heights.argmax()) % heights.shape[1]
    found = _refine(recording_1, recording_2, replace(line, start=line.start + top - reach))
    if found is None or not found.places:
        return None
    starts, length = _fine_starts(replace(found, begin=begin, end=end))
    along = _plane(recording_1, recording_2, starts, found, length, _FINE_REACH)[:, _FINE_REACH]
    inside = (starts + length > found.places[0]) & (starts < found.places[-1])
    limit = _MAX_HEIGHT_ELSEWHERE * float(along[inside].mean())
    return found if float(along[~inside].sum()) < limit * (~inside).sum() else None


def _lines_of_one_clock(lines: list[Stretch], places: npt.NDArray[np.floating]) -> list[Stretch]:
    """Return the lines without those that a few blocks form by chance.

    Missing samples do not change the drift, so a line with another drift needs almost all blocks of its time.
    """
    if len(lines) < 2:
        return lines
    best = max(lines, key=lambda line: len(line.places))

    def is_reliable(line: Stretch) -> bool:
        block_count = int(((places >= line.places[0]) & (places <= line.places[-1])).sum())
        error = math.hypot(line.slope_error, best.slope_error)
        return (
            len(line.places) >= _MIN_SHARE_ON_LINE * block_count
            or abs(line.slope - best.slope) <= _MAX_SLOPE_DIFFERENCE * error
        )

    return _merge([line for line in lines if is_reliable(line)])


def _without_echoes(
    lines: list[Stretch], heights: Samples, places: npt.NDArray[np.floating], lowest: int
) -> list[Stretch]:
    """Return the lines without echoes and shared noise, whose lag the recordings show outside its stretch as well."""
    while len(lines) > 1:
        columns = [np.round(line.start + line.slope * places).astype(int) - lowest for line in lines]
        along = [heights[np.arange(places.size), np.clip(at, 0, heights.shape[1] - 1)] for at in columns]
        gains = [np.minimum(row, _MAX_COUNTED_HEIGHT) for row in along]
        # The border between two lines is where the sum of both heights is largest.
        borders = [0, *(int(np.argmax(np.cumsum(one - two))) + 1 for one, two in pairwise(gains)), places.size]
        shares = []
        for row, (begin, end) in zip(along, pairwise(borders), strict=True):
            elsewhere = np.delete(row, np.s_[begin:end])
            inside = float(row[begin:end].mean()) if begin < end else 0.0
            shares.append(float(elsewhere.mean()) / max(inside, 1e-30) if elsewhere.size else math.inf)
        if max(shares) < _MAX_HEIGHT_ELSEWHERE:
            break
        shortest = min(lines, key=lambda line: len(line.places))
        lines = _merge([line for line in lines if line is not shortest])
    return lines


def _with_steps_located(recording_1: Recording, recording_2: Recording, over_time: LagOverTime) -> LagOverTime:
    """Return the lag over time with each step moved to the sample where the recordings show it.

    Without lines that then end before their blocks, or begin after them: the recordings do not show these.
    """
    lines = [*over_time.stretches]
    for number in range(1, len(lines)):
        before, after = lines[number - 1 : number + 1]
        place = _step_position(recording_1, recording_2, before, after)
        lines[number - 1 : number + 1] = replace(before, end=place), replace(after, begin=place)
    shown = [line for line in lines if not line.places or line.begin <= np.median(line.places) <= line.end]
    if not shown or len(shown) == len(lines):
        return LagOverTime(tuple(lines))
    fewer = _with_borders(_merge(shown), lines[0].begin, lines[-1].end)
    return _with_steps_located(recording_1, recording_2, LagOverTime(tuple(fewer)))


def _step_position(recording_1: Recording, recording_2: Recording, before: Stretch, after: Stretch) -> int:
    """Return the sample of recording 1 up to which the first line fits best and after which the second one does.

    Samples missing in recording 2 belong to neither.
    """
    missing = max(0, round(before.lag_at(before.end) - after.lag_at(before.end)))
    apart = after.places[0] - before.places[-1] if before.places and after.places else 0
    reach = max(_MAX_BLOCK_LENGTH, math.ceil(apart)) + missing
    first, last = max(before.begin, before.end - reach), min(after.end, before.end + reach)
    part = recording_1.part(first, last)
    running_products = []
    for line in (before, after):
        begin = math.floor(first + line.lag_at(first)) - TAPS
        part_2 = recording_2.part(begin, math.ceil(last + line.lag_at(last)) + TAPS)
        products = part * on_first_clock(part_2, line.for_part(begin), first, last - first)
        running_products.append(np.concatenate(([0.0], np.cumsum(products))))
    sums_before, sums_after = running_products
    gains = sums_before[: max(0, sums_before.size - missing)] - sums_after[missing:]
    return first + int(np.argmax(gains)) if gains.size else before.end


def _with_borders(lines: Sequence[Stretch], begin: int, end: int) -> list[Stretch]:
    """Return the lines with their borders halfway between their blocks."""
    edges = [begin, *(round((one.places[-1] + two.places[0]) / 2) for one, two in pairwise(lines)), end]
    return [replace(line, begin=low, end=high) for line, (low, high) in zip(lines, pairwise(edges), strict=True)]


def _merge(lines: Sequence[Stretch], min_share: float = 0.8) -> list[Stretch]:
    """Return the lines, neighbours joined if one continues the other or `min_share` of their blocks fit one line."""
    merged: list[Stretch] = []
    for line in lines:
        if merged:
            both = _fit_line(np.array(merged[-1].places + line.places), np.array(merged[-1].lags + line.lags))
            border = (merged[-1].places[-1] + line.places[0]) / 2
            gap = abs(merged[-1].lag_at(border) - line.lag_at(border))
            fits = both is not None and len(both.places) >= min_share * (len(merged[-1].places) + len(line.places))
            if both is not None and (fits or gap <= _MAX_GAP_IN_LINE):
                merged[-1] = both
                continue
        merged.append(line)
    return merged


def _fine_starts(line: Stretch) -> tuple[Indices, int]:
    """Return the first samples of the blocks in which a line is measured, and their length."""
    size = line.end - line.begin
    length = int(np.clip(size // _FINE_BLOCKS, _MIN_BLOCK_LENGTH, 4 * _MAX_BLOCK_LENGTH))
    return np.arange(line.begin, line.end - length // 2, max(length, size // _MAX_BLOCKS)), length


def _refine(recording_1: Recording, recording_2: Recording, line: Stretch, reach: int = _FINE_REACH) -> Stretch | None:
    """Return a line measured anew in blocks that follow it; None if fewer than half of the clear blocks are on it.

    The line as it was if fewer than ``_MIN_BLOCKS_ON_LINE`` blocks are clear.
    """
    starts, length = _fine_starts(line)
    places = starts + length / 2
    heights = _plane(recording_1, recording_2, starts, line, length, reach)
    tops = heights.argmax(axis=1)
    clear = (heights.max(axis=1) > _MIN_CLEAR_HEIGHT) & (np.abs(tops - reach) < reach)
    offsets = [_peak_position(row, int(top)) - reach for row, top in zip(heights, tops, strict=True)]
    lags = line.start + line.slope * places + np.array(offsets)
    found = _fit_line(places[clear], lags[clear])
    if found is None or 2 * len(found.places) < int(clear.sum()):
        return None if int(clear.sum()) >= _MIN_BLOCKS_ON_LINE else line
    return replace(found, begin=line.begin, end=line.end)


def _fit_line(places: npt.NDArray[np.floating], lags: npt.NDArray[np.floating]) -> Stretch | None:
    """Return the line through most of the blocks; None if fewer than ``_MIN_BLOCKS_ON_LINE`` are on it."""
    if places.size < _MIN_BLOCKS_ON_LINE:
        return None
    slope, start = median_line(places, lags)
    residuals = np.abs(lags - start - slope * places)
    near = residuals <= np.clip(2.5 * float(np.median(residuals)), *_RESIDUAL_LIMITS)
    if near.sum() < _MIN_BLOCKS_ON_LINE:
        return None
    middle = float(places[near].mean())
    slope, height = np.polyfit(places[near] - middle, lags[near], 1)
    residuals = lags[near] - height - slope * (places[near] - middle)
    freedom = max(1, int(near.sum()) - 2)
    error = math.sqrt(float(residuals @ residuals) / freedom / float(np.sum((places[near] - middle) ** 2)))
    return Stretch(
        0,
        0,
        float(height - slope * middle),
        float(slope),
        error,
        tuple(places[near].tolist()),
        tuple(lags[near].tolist()),
    )


def _peak_position(row: Samples, top: int) -> float:
    """Return the position of a peak, interpolated between the lags."""
    return top + interpolate_peak(row, top, 16)[0]


def _plane(
    recording_1: Recording, recording_2: Recording, starts: Indices, line: Stretch, length: int, reach: int
) -> Samples:
    """Return (blocks, 2 * reach + 1) the correlation of each block around a line, in standard deviations of its curve.

    The higher of two curves at each lag: one whitened, one by phase alone.
    """
    points = transform_length(length + length // 4 + 2 * reach, real=True)
    together = max(1, _MAX_TRANSFORMED_POINTS // points)
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
    """Return the most probable path through the plane, as an index of each block, and which blocks are clear on it."""
    gains = np.clip(heights, 0, _MAX_COUNTED_HEIGHT)
    gains *= gains
    gains /= 2
    gains -= 0.5
    jump = math.log(heights.shape[1]) + _JUMP_PENALTY
    penalties = np.arange(heights.shape[1], dtype=np.float32) * np.float32(_MOVE_PENALTY / step)
    best = np.empty_like(gains)
    best[0] = gains[0]
    for before, here, gain in zip(best, best[1:], gains[1:], strict=False):
        forth = np.maximum.accumulate(before + penalties) - penalties
        back = np.maximum.accumulate((before - penalties)[::-1])[::-1] + penalties
        np.maximum(np.maximum(forth, back), before.max() - jump, out=here)
        here += gain
    path = [int(np.argmax(best[-1]))]
    for before in best[-2::-1]:
        beside = int(np.argmax(before - np.abs(penalties - penalties[path[-1]])))
        stays = before[beside] - abs(penalties[beside] - penalties[path[-1]]) >= before.max() - jump
        path.append(beside if stays else int(np.argmax(before)))
    indices = np.array(path[::-1])
    return indices, heights[np.arange(len(gains)), indices] > _MIN_CLEAR_HEIGHT
