"""Scores of windows at every lag, and which lag is best.

A score s of -1..1 is kept as the integer ``(s + OFFSET) * SCALE``: positive, below 2**31, and as fine as float32; 0
means no candidate. With its low bits given to the code of the lag
(:class:`stereolag.stereo.windows.search.LagTable`), one comparison finds the better of two scores and settles ties,
and nothing is divided before the best is known.

Inner loops take arrays one by one: Numba counts references on every field taken out of a tuple.
"""

from __future__ import annotations

from typing import Any

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
    load,
    nearest,
    splat,
    store,
    where_positive,
)
from stereolag.stereo.windows.matches import Score, WindowQuery
from stereolag.stereo.windows.running_sums import slide

SCALE = 2.0**29
OFFSET = 1.5


@compiled
def _as_kept(
    products: Any,
    left_correction: Any,
    left_whole: Any,
    left_fraction: Any,
    left_scale: Any,
    right_excess: Any,
    right_scale: Any,
) -> Any:
    """Return the scores of one left window at sixteen lags as they are kept; 0 where `right_scale` is.

    ``mean = share * total`` is the mean of a left window l, or 0 for a score that keeps the mean. Split into a whole
    number m and a fraction f, the covariance with a right window r of n pixels is ::

        sum((l - mean) * r) = sum((l - m) * (r - m)) - f * sum(r - m)
        sum((l - m) * (r - m)) = sum(l * r) - m * sum(l) - m * (sum(r) - n * m)

    The second line is exact in integers, and so small that float32 is enough for the first. (Float64 sums need no such
    care: there m is the mean, and f is 0.)
    """
    covariance = cast(products - left_correction - left_whole * right_excess, np.float32)
    covariance = covariance - left_fraction * cast(right_excess, np.float32)
    zero = splat(OFFSET * SCALE, np.float32)
    return where_positive(right_scale, cast(covariance * left_scale * right_scale + zero, np.int32))


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
    right, the sums become scores (:func:`_as_kept`), and each lane keeps the best.
    """
    lags = columns.shape[1]
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
            right_scale = load(right_inverse, there + offset)
            score = _as_kept(
                products, left_correction, left_whole, left_fraction, left_scale, right_excess, right_scale
            )
            store(scores, first + lag, score)
            best = larger(best, (score & score_bits) | load(codes, lag))
        store(best_lanes, member * LANES, best)
        for off_grid in range(column + x + 1, min(column + x + step, column_end)):
            slide(window_sums, columns, off_grid, off_grid - window + 1)


@compiled
def score_products(
    first: int,
    end: int,
    products: Array,
    window: int,
    share: float,
    left_at: int,
    left_total: Array,
    left_inverse: Array,
    right_at: Array,
    right_total: Array,
    right_inverse: Array,
    offsets: Array,
    codes: Array,
    code_mask: int,
    scores: Array,
    best_lanes: Array,
) -> None:
    """Score windows `first` to `end` of those whose `products`, (windows, lags), are known: as :func:`score_group`.

    The first of all is window `left_at` of the left ones; at the first lag each meets the right window `right_at`.
    """
    lags, score_bits = codes.size, splat(~code_mask, np.int32)
    for member in range(first, end):
        total_of_left = item(left_total, left_at + member)
        mean = total_of_left * share
        whole = nearest(mean, products.dtype)
        left_whole = splat(whole, products.dtype)
        left_fraction = splat(mean - whole, np.float32)
        left_correction = splat(whole * total_of_left, products.dtype)
        right_correction = splat(window * window * whole, products.dtype)
        left_scale = splat(item(left_inverse, left_at + member) * np.float32(SCALE), np.float32)
        best = splat(0, np.int32)
        there = item(right_at, member)
        for strip in range(offsets.size):
            offset, lag = item(offsets, strip), strip * LANES
            right_excess = load(right_total, there + offset) - right_correction
            right_scale = load(right_inverse, there + offset)
            product = load(products, member * lags + lag)
            score = _as_kept(product, left_correction, left_whole, left_fraction, left_scale, right_excess, right_scale)
            store(scores, member * scores.shape[1] + lag, score)
            best = larger(best, (score & score_bits) | load(codes, lag))
        store(best_lanes, member * LANES, best)


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


def score_volume_reference(query: WindowQuery) -> npt.NDArray[np.float64]:
    """Return (dy, dx, rows, cols): the score of every window at every lag, NaN where that is no candidate."""
    size, step, lags = query.window_size, query.step, query.lags
    left_windows = sliding_window_view(query.left, (size, size))[::step, ::step]
    right_windows = sliding_window_view(query.right, (size, size))
    volume = np.full((lags.rows, lags.cols, *query.grid), np.nan)
    y, x = (step * np.arange(count) for count in query.grid)
    for row, dy in enumerate(range(lags.dy_first, lags.dy_last + 1)):
        for col, dx in enumerate(range(lags.dx_first, lags.dx_last + 1)):
            i = np.flatnonzero((y + dy >= 0) & (y + dy < right_windows.shape[0]))
            j = np.flatnonzero((x + dx >= 0) & (x + dx < right_windows.shape[1]))
            here, there = np.ix_(i, j), np.ix_(y[i] + dy, x[j] + dx)
            volume[row, col][here] = _score_reference(left_windows[here], right_windows[there], query.score)
    return volume


def _score_reference(left_windows: Array, right_windows: Array, score: Score) -> npt.NDArray[np.float64]:
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
