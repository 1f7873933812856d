"""Scores of windows at every lag, and which lag is best.

A score s of -1..1 is kept as the integer ``(s + OFFSET) * SCALE``: positive, below 2**31, and as fine as float32; 0
means no candidate. With its low bits given to the code of the lag
(:class:`stereolag.stereo.windows.search.LagTable`), one comparison finds the better of two scores and settles ties, and
nothing is divided before the best is known.

Inner loops take arrays one by one: Numba counts references on every field taken out of a tuple.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
from numpy.lib.stride_tricks import sliding_window_view

from stereolag.arrays import Array
from stereolag.loops.compilation import compiled
from stereolag.loops.vector_lanes import (
    LANES,
    cast,
    item,
    larger,
    largest,
    load,
    nearest,
    put,
    splat,
    store,
    where_positive,
)
from stereolag.stereo.windows.running_sums import slide
from stereolag.stereo.windows.search import LagRange

SCALE = 2.0**29
OFFSET = 1.5


@compiled
def score_group(
    count: int,
    step: int,
    window: int,
    column: int,
    column_end: int,
    columns: Array,
    window_sums: Array,
    left: Array,
    left_below: int,
    left_above: int,
    right: Array,
    right_below: int,
    right_above: int,
    offsets: Array,
    share: float,
    left_at: int,
    left_total: Array,
    left_inverse: Array,
    right_at: int,
    right_total: Array,
    right_inverse: Array,
    codes: Array,
    code_mask: int,
    scores: Array,
    best_lanes: Array,
) -> None:
    """Score `count` left windows of a row at every lag; the first ends at `column` of the tile, the others follow.

    One pass over the lags does it all: the column sums move down a row (as in ``replace_row``), the window sums slide
    right, the sums become scores, and each lane keeps the best. ``mean = share * total`` is the mean of a left window
    l, or 0 for a score that keeps the mean. Split into a whole number m and a fraction f, the covariance with a right
    window r of n pixels is ::

        sum((l - mean) * r) = sum((l - m) * (r - m)) - f * sum(r - m)
        sum((l - m) * (r - m)) = sum(l * r) - m * sum(l) - m * (sum(r) - n * m)

    The second line is exact in integers, and so small that float32 is enough for the first. (Float64 sums need no such
    care: there m is the mean, and f is 0.)
    """
    lags = columns.shape[1]
    zero = splat(OFFSET * SCALE, np.float32)
    score_bits = splat(~code_mask, np.int32)
    for member in range(count):
        x = member * step
        enters = splat(item(left, left_below + x), columns.dtype)
        leaves = splat(item(left, left_above + x), columns.dtype)
        total_of_left = item(left_total, left_at + member)
        mean = total_of_left * share
        whole = nearest(mean, columns.dtype)
        left_whole = splat(whole, columns.dtype)
        left_fraction = splat(mean - whole, np.float32)
        left_correction = splat(whole * total_of_left, columns.dtype)
        right_correction = splat(window * window * whole, columns.dtype)
        left_scale = splat(item(left_inverse, left_at + member) * np.float32(SCALE), np.float32)
        best = splat(0, np.int32)
        at = (column + x) * lags
        gone = at - (window - 1) * lags
        below, above, there = right_below + x, right_above + x, right_at + x
        first = member * scores.shape[1]
        for strip in range(offsets.size):
            offset = item(offsets, strip)
            lag = strip * LANES
            gain = enters * cast(load(right, below + offset), columns.dtype)
            loss = leaves * cast(load(right, above + offset), columns.dtype)
            column_sum = load(columns, at + lag) + gain - loss
            store(columns, at + lag, column_sum)
            products = load(window_sums, lag) + column_sum
            store(window_sums, lag, products - load(columns, gone + lag))
            right_excess = load(right_total, there + offset) - right_correction
            covariance = cast(products - left_correction - left_whole * right_excess, np.float32)
            covariance = covariance - left_fraction * cast(right_excess, np.float32)
            right_scale = load(right_inverse, there + offset)
            score = where_positive(right_scale, cast(covariance * left_scale * right_scale + zero, np.int32))
            store(scores, first + lag, score)
            best = larger(best, (score & score_bits) | load(codes, lag))
        store(best_lanes, member * LANES, best)
        for off_grid in range(column + x + 1, min(column + x + step, column_end)):
            slide(window_sums, columns, off_grid, off_grid - window + 1)


@compiled
def record_group(
    count: int,
    at: int,
    left_at: int,
    left_inverse: Array,
    best_lanes: Array,
    scores: Array,
    found_codes: Array,
    code_mask: int,
    around_code: Array,
    dy_of: Array,
    dx_of: Array,
    dy: Array,
    dx: Array,
    around: Array,
) -> None:
    """Write down the best lags of a group of windows and the scores around them, from window `at` of the grid on.

    A group at a time: the processor then works on one window's best while it waits for another's.
    """
    planes = around_code.shape[1]
    for member in range(count):
        key = largest(load(best_lanes, member * LANES))
        code = key & code_mask if key > code_mask and item(left_inverse, left_at + member) > 0 else 0
        put(found_codes, member, code)
        put(dx, at + member, item(dx_of, code))
        if dy.size > 0:
            put(dy, at + member, item(dy_of, code))
    for plane in range(planes):
        for member in range(count):
            lag = item(around_code, item(found_codes, member) * planes + plane)
            put(around, plane * dx.size + at + member, item(scores, member * scores.shape[1] + lag))


@compiled
def record_runners_up(
    count: int,
    at: int,
    scores: Array,
    found_codes: Array,
    around_code: Array,
    codes: Array,
    code_mask: int,
    runner_up: Array,
) -> None:
    """Write down the best score farther than one pixel from the peak, whose neighbourhood is struck out of `scores`."""
    planes = around_code.shape[1]
    for member in range(count):
        for plane in range(planes):
            lag = item(around_code, item(found_codes, member) * planes + plane)
            put(scores, member * scores.shape[1] + lag, 0)
    score_bits = splat(~code_mask, np.int32)
    for member in range(count):
        best = splat(0, np.int32)
        for lag in range(0, codes.size, LANES):
            # The codes bring the sign bit to the lanes beyond the range.
            key = load(scores, member * scores.shape[1] + lag) | load(codes, lag)
            best = larger(best, key & score_bits)
        put(runner_up, at + member, largest(best) if item(found_codes, member) > 0 else 0)


@compiled
def as_scores(kept: Array, score: Array, left_inverse: Array, right_norm: float) -> None:
    """Turn kept integers into scores, NaN where there is no candidate; `score` may lie over `kept`.

    Normalised scores are clipped to -1..1: rounding may have carried them beyond. If `right_norm` is above 0 the norms
    that went into them are taken out again.
    """
    for row in range(kept.shape[0]):
        for col in range(kept.shape[1]):
            value = np.float32(kept[row, col]) * np.float32(1 / SCALE) - np.float32(OFFSET)
            value = min(max(value, np.float32(-1)), np.float32(1))
            if right_norm > 0:
                value *= np.float32(right_norm) / left_inverse[row, col]
            score[row, col] = value if kept[row, col] > 0 else np.float32(np.nan)


def score_lag(left_windows: Array, right_windows: Array, score: str) -> npt.NDArray[np.float64]:
    """Return the score of each left window with the right window at the same place; NaN where there is none.

    Parameters
    ----------
    left_windows, right_windows
        (rows, cols, window, window).
    score
        ``"zncc"`` is Pearson's correlation, ``"ncc"`` equation 1.3 of the report, ``"cross"`` the numerator of the
        first.
    """
    left, right = left_windows.astype(np.float64), right_windows.astype(np.float64)
    flat = np.ptp(left, axis=(2, 3)) == 0
    if score != "ncc":
        left = left - left.mean((2, 3), keepdims=True)
        right = right - right.mean((2, 3), keepdims=True)
    products = (left * right).sum((2, 3))
    if score == "cross":
        return np.where(flat, np.nan, products)
    flat |= (np.ptp(right_windows, axis=(2, 3)) == 0) if score == "zncc" else ~right.any((2, 3))
    norms = np.sqrt((left**2).sum((2, 3)) * (right**2).sum((2, 3)))
    return np.where(flat, np.nan, products / np.where(flat, 1, norms))


def score_volume(
    left: Array, right: Array, *, window_size: int, step: int, search: LagRange, score: str
) -> npt.NDArray[np.float64]:
    """Return (dy, dx, rows, cols): the score of every window at every lag, NaN where that is no candidate."""
    left_windows = sliding_window_view(left, (window_size, window_size))[::step, ::step]
    right_windows = sliding_window_view(right, (window_size, window_size))
    volume = np.full((search.rows, search.cols, *left_windows.shape[:2]), np.nan)
    y, x = step * np.arange(left_windows.shape[0]), step * np.arange(left_windows.shape[1])
    for row, dy in enumerate(range(search.dy_first, search.dy_last + 1)):
        for col, dx in enumerate(range(search.dx_first, search.dx_last + 1)):
            i = np.flatnonzero((y + dy >= 0) & (y + dy < right_windows.shape[0]))
            j = np.flatnonzero((x + dx >= 0) & (x + dx < right_windows.shape[1]))
            here, there = np.ix_(i, j), np.ix_(y[i] + dy, x[j] + dx)
            volume[row, col][here] = score_lag(left_windows[here], right_windows[there], score)
    return volume
