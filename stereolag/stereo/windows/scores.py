"""Scores of windows at every lag, and the choice of the best lag.

A score s of -1..1 is stored as the integer ``(s + OFFSET) * SCALE``: positive, below 2**31, and as fine as float32; 0
means no candidate. With the code of the lag (:class:`stereolag.stereo.windows.search.LagTable`) in its low bits, one
comparison finds the better of two scores and breaks ties, and nothing is divided before the best is known.

Inner loops take arrays as separate arguments: Numba counts references on every field taken out of a tuple.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt
from numpy.lib.stride_tricks import sliding_window_view

from stereolag.core.arrays import Array
from stereolag.loops.compilation import compiled
from stereolag.loops.vector_lanes import (
    LANES,
    at_least,
    cast,
    item,
    larger,
    load,
    nearest,
    put,
    splat,
    store,
)
from stereolag.stereo.windows.matches import Score, WindowQuery
from stereolag.stereo.windows.running_sums import change, left_change, slide

SCALE = 2.0**29
OFFSET = 1.5

FRACTIONS = 256
"""Parts of a grey level; the product of such a coarse fraction and a sum of pixels is exact in float32."""


class LeftTerms(NamedTuple):
    """Terms of the scores of some left windows that are the same at every lag, each (windows)."""

    whole: Array
    """The mean, or 0 for a score that keeps it, rounded; not rounded for float64 sums."""
    coarse: npt.NDArray[np.float32]
    """Remainder of the mean, in 256ths."""
    fine: npt.NDArray[np.float32]
    """Remainder of the mean after `whole` and `coarse`."""
    scale: npt.NDArray[np.float32]
    """SCALE / norm; NaN for an excluded window."""


@compiled
def _set_left_terms(
    count: int,
    at: int,
    total: Array,
    inverse: Array,
    share: float,
    whole: Array,
    coarse: Array,
    fine: Array,
    scale: Array,
) -> None:
    """Set the terms of `count` windows from window `at` on, ahead of the scores, which would wait for them."""
    for member in range(count):
        mean = item(total, at + member) * share
        nearest_mean = nearest(mean, whole.dtype)
        rest = mean - nearest_mean
        put(whole, member, nearest_mean)
        put(coarse, member, np.rint(rest * FRACTIONS) / FRACTIONS)
        put(fine, member, rest - np.rint(rest * FRACTIONS) / FRACTIONS)
        put(scale, member, item(inverse, at + member) * np.float32(SCALE))


@compiled
def _as_kept(
    products: Any, whole: Any, coarse: Any, fine: Any, scale: Any, right_total: Any, right_inverse: Any
) -> Any:
    """Return the scores of one left window at sixteen lags as stored integers; 0 where `right_inverse` is NaN.

    The covariance of a left window, whose mean is ``share * total`` (0 for a score that keeps the mean), with a right
    window r is ``sum(l * r) - mean * sum(r)``. The mean is split into a whole number, a fraction of 8 bits and the
    rest: the large parts are subtracted in integers, or in float32 without rounding, and little is left to round.
    (Float64 sums need no such care: the first part is the mean, and the others are 0.)
    """
    total = cast(right_total, np.float32)
    covariance = cast(products - whole * right_total, np.float32) - coarse * total - fine * total
    kept = covariance * scale * right_inverse + splat(OFFSET * SCALE, np.float32)
    # Values below 1 become 0; a comparison with 0 itself would take two instructions.
    return cast(at_least(kept, splat(0.5, np.float32)), np.int32)


@compiled
def score_group(
    count: int,
    step: int,
    window: int,
    column: int,
    column_end: int,
    columns: Array,
    window_sums: Array,
    left_terms: LeftTerms,
    left: Array,
    left_row: int,
    left_back: int,
    right_rows: Array,
    right_row: int,
    right_back: int,
    which: int,
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
    right_key: Array,
) -> None:
    """Score `count` left windows of a row at every lag; the first ends at `column` of the tile, the others follow.

    One pass over the lags does everything: the column sums move down a row (as in ``change_row``), the window sums
    slide right, the sums become scores (:func:`_as_kept`), and each lane keeps the best, as does every right window
    unless `right_key` is empty.
    """
    lags = columns.shape[1]
    seen_from_right = right_key.size > 0
    score_bits = splat(~code_mask, np.int32)
    wholes, coarses, fines, scales = left_terms
    _set_left_terms(count, left_at, left_total, left_inverse, share, wholes, coarses, fines, scales)
    for member in range(count):
        x = member * step
        pixel = left_change(left, left_row + x, left_back, which, right_rows)
        whole, scale = splat(item(wholes, member), wholes.dtype), splat(item(scales, member), np.float32)
        coarse, fine = splat(item(coarses, member), np.float32), splat(item(fines, member), np.float32)
        best = splat(0, np.int32)
        at = (column + x) * lags
        gone = at - (window - 1) * lags
        first = member * scores.shape[1]
        for strip in range(offsets.size):
            offset = item(offsets, strip)
            lag, there = strip * LANES, right_at + x + offset
            column_sum = load(columns, at + lag) + change(pixel, right_rows, right_row + x + offset, right_back)
            store(columns, at + lag, column_sum)
            products = load(window_sums, lag) + column_sum
            store(window_sums, lag, products - load(columns, gone + lag))
            right = load(right_total, there), load(right_inverse, there)
            score = _as_kept(products, whole, coarse, fine, scale, right[0], right[1])
            store(scores, first + lag, score)
            key = (score & score_bits) | load(codes, lag)
            best = larger(best, key)
            if seen_from_right:
                store(right_key, there, larger(load(right_key, there), key))
        store(best_lanes, member * LANES, best)
        for off_grid in range(column + x + 1, min(column + x + step, column_end)):
            slide(window_sums, columns, off_grid, off_grid - window + 1)


@compiled
def score_products(
    first: int,
    end: int,
    products: Array,
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
    """Score windows `first` to `end` from their known `products`, (windows, lags), as :func:`score_group` does.

    Window 0 is left window `left_at`; at the first lag each window meets the right window in `right_at`.
    """
    lags, score_bits = codes.size, splat(~code_mask, np.int32)
    wholes, scales = np.empty(1, products.dtype), np.empty(1, np.float32)
    coarses, fines = np.empty(1, np.float32), np.empty(1, np.float32)
    for member in range(first, end):
        _set_left_terms(1, left_at + member, left_total, left_inverse, share, wholes, coarses, fines, scales)
        whole, scale = splat(item(wholes, 0), wholes.dtype), splat(item(scales, 0), np.float32)
        coarse, fine = splat(item(coarses, 0), np.float32), splat(item(fines, 0), np.float32)
        best = splat(0, np.int32)
        for strip in range(offsets.size):
            lag, there = strip * LANES, item(right_at, member) + item(offsets, strip)
            product = load(products, member * lags + lag)
            right = load(right_total, there), load(right_inverse, there)
            score = _as_kept(product, whole, coarse, fine, scale, right[0], right[1])
            store(scores, member * scores.shape[1] + lag, score)
            best = larger(best, (score & score_bits) | load(codes, lag))
        store(best_lanes, member * LANES, best)


@compiled
def as_scores(kept: Array, score: Array, left_inverse: Array, right_norm: float) -> None:
    """Convert stored integers into scores, NaN where there is no candidate; `score` may share memory with `kept`.

    Normalised scores are clipped to -1..1, as rounding may have carried them beyond. If `right_norm` is above 0, the
    normalisation is undone.
    """
    for row in range(kept.shape[0]):
        for col in range(kept.shape[1]):
            value = np.float32(kept[row, col]) * np.float32(1 / SCALE) - np.float32(OFFSET)
            value = min(max(value, np.float32(-1)), np.float32(1))
            if right_norm > 0:
                value *= np.float32(right_norm) / left_inverse[row, col]
            score[row, col] = value if kept[row, col] > 0 else np.float32(np.nan)


def score_volume_reference(query: WindowQuery) -> npt.NDArray[np.float64]:
    """Return the (dy, dx, rows, cols) scores of every window at every lag, NaN where the lag is no candidate."""
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
        ``"zncc"`` is Pearson's correlation, ``"ncc"`` equation 1.3 of the source report, ``"cross"`` the numerator of
        the first.
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
