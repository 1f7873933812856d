"""The loops of window correlation: running sums of products, scores at all lags, and the best lag.

A *column sum* is the sum of the products of one image column over the window's height, for every lag. Moving down one
row adds the products that enter and subtracts those that leave, both in one instruction if the pixels are integers
(:func:`changing_rows`). A *window sum* slides right by adding one column sum and subtracting another, so that the cost
of a window does not depend on its size. The lag is the innermost axis, in strips of sixteen
(:class:`stereolag.stereo.windows.search.LagTable`).

``at`` is an index into the flattened image, and ``back`` the distance from an entering pixel to the leaving one above
it; `offsets` lead from the right pixel of the first lag to those of each strip. Sums of uint8 products are int32, and
exact; other images have float64 sums in the same code.

A score s of -1..1 is stored as the integer ``(s + SCORE_OFFSET) * SCORE_SCALE``: positive, below 2**31, and as precise
as float32; 0 means no candidate. With the code of the lag in its low bits, one comparison finds the better of two
scores and breaks ties, and nothing is divided before the best is known.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt
from numpy.lib.stride_tricks import sliding_window_view

from stereolag.core.arrays import Array
from stereolag.loops.compilation import compiled, compiled_as
from stereolag.loops.memory import fill
from stereolag.loops.vector_lanes import (
    LANES,
    cast,
    is_integer,
    item,
    larger,
    larger_float,
    largest,
    load,
    nearest,
    paired_products,
    put,
    splat,
    store,
)
from stereolag.stereo.windows.norms import Windows
from stereolag.stereo.windows.search import LagRange, LagTable, Score, WindowQuery

UNCHANGED, ENTERING, BOTH = 0, 1, 2
"""Change of the column sums by a row: none, by the row that enters, or also by the row that leaves."""


def changing_rows(image: Array, window: int, sign: int = 1) -> Array:
    """Return the rows of an image as :func:`change` expects them.

    Parameters
    ----------
    image
        (H, W) uint8 or float64.
    window
        Height of the window: a pixel leaves when the one this many rows below it enters.
    sign
        -1 for the left one of two images whose rows are multiplied, so that leaving products are subtracted.

    Returns
    -------
    ndarray
        (H, W) int32 for uint8 images: the entering pixel in the low 16 bits, the leaving one in the high 16 bits, 0
        above the image. Other images are returned unchanged.
    """
    if image.dtype != np.uint8:
        return image
    rows = image.astype(np.int32)
    rows[window:] += rows[:-window] * np.int32(sign << 16)
    return rows


def left_change(left: Array, at: int, back: int, which: int, rows: Array) -> Any:
    """Return an entering left pixel and the leaving one, `back` before it, in all lanes; for compiled code only."""


@compiled_as(left_change)
def _left_change_of_type(left: Any, at: Any, back: Any, which: Any, rows: Any) -> Any:
    def packed(left: Array, at: int, back: int, which: int, rows: Array) -> Any:
        enters = np.int32(item(left, at)) if which != UNCHANGED else np.int32(0)
        leaves = np.int32(item(left, at - back)) if which == BOTH else np.int32(0)
        return splat(enters - leaves * 65536, np.int32)

    def apart(left: Array, at: int, back: int, which: int, rows: Array) -> Any:
        enters = item(left, at) if which != UNCHANGED else 0.0
        leaves = item(left, at - back) if which == BOTH else 0.0
        return splat(enters, rows.dtype), splat(leaves, rows.dtype)

    return packed if is_integer(rows.dtype) else apart


def row_change(rows: Array, at: int, back: int) -> Any:
    """Return sixteen entering left pixels and the leaving ones, in the format of the rows; for compiled code only."""


@compiled_as(row_change)
def _row_change_of_type(rows: Any, at: Any, back: Any) -> Any:
    def packed(rows: Array, at: int, back: int) -> Any:
        return load(rows, at)

    def apart(rows: Array, at: int, back: int) -> Any:
        return load(rows, at), load(rows, at - back)

    return packed if is_integer(rows.dtype) else apart


def change(left: Any, rows: Array, at: int, back: int) -> Any:
    """Return the change in the products of a left pixel and sixteen right ones; for compiled code only."""


@compiled_as(change)
def _change_of_type(left: Any, rows: Any, at: Any, back: Any) -> Any:
    def packed(left: Any, rows: Array, at: int, back: int) -> Any:
        return paired_products(load(rows, at), left)

    def apart(left: Any, rows: Array, at: int, back: int) -> Any:
        return left[0] * load(rows, at) - left[1] * load(rows, at - back)

    return packed if is_integer(rows.dtype) else apart


@compiled(counted=False)
def change_row(
    columns: Array,
    width: int,
    left: Array,
    left_at: int,
    left_back: int,
    right_rows: Array,
    right_at: int,
    right_back: int,
    offsets: Array,
    which: int,
) -> None:
    """Change the column sums by a row: ``columns[x, lag] += left[x] * right[x + lag]``, minus the leaving products."""
    at = 0
    for x in range(width):
        pixel = left_change(left, left_at + x, left_back, which, right_rows)
        for strip in range(offsets.size):
            there = right_at + x + item(offsets, strip)
            store(columns, at, load(columns, at) + change(pixel, right_rows, there, right_back))
            at += LANES


@compiled(counted=False)
def slide(window_sums: Array, columns: Array, entering: int, leaving: int) -> None:
    """Move the window sums right: column `entering` enters; `leaving` leaves, unless it is negative."""
    lags = columns.shape[1]
    keep = splat(1 if leaving >= 0 else 0, columns.dtype)
    gone = max(leaving, 0) * lags
    for lag in range(0, lags, LANES):
        total = load(window_sums, lag) + load(columns, entering * lags + lag)
        store(window_sums, lag, total - keep * load(columns, gone + lag))


SCORE_SCALE = 2.0**29
"""Integer steps of stored scores per unit."""

SCORE_OFFSET = 1.5
"""Added to scores before they are stored, to make them positive."""

FRACTIONS = 256
"""Fractions of a grey level whose product with a sum of pixels is exact in float32."""


class LeftTerms(NamedTuple):
    """Terms of the scores of some left windows that are the same at every lag, each (windows)."""

    whole: Array
    """The mean, or 0 for a score that keeps the mean, rounded; not rounded for float64 sums."""
    coarse: npt.NDArray[np.float32]
    """The remainder of the mean, rounded to 256ths."""
    fine: npt.NDArray[np.float32]
    """The remainder of the mean after `whole` and `coarse`."""
    scale: npt.NDArray[np.float32]
    """SCORE_SCALE / norm; NaN for an excluded window."""


class WindowResults(NamedTuple):
    """Results for all windows of the grid, (rows, cols); fields that were not requested are empty."""

    dy: npt.NDArray[np.int16]
    dx: npt.NDArray[np.int16]
    around: npt.NDArray[np.int32]
    """(9 | 3, rows, cols): the scores at and around the peak, in the order of :attr:`LagTable.around`."""
    runner_up: npt.NDArray[np.int32]
    right_key: npt.NDArray[np.int32]
    """(rows, columns of the framed right image): score and code of the best left window for each right window."""


class Workspace(NamedTuple):
    """Buffers of a thread, small enough to stay in its core's cache."""

    columns: Array
    """(image columns of the tile, lags): column sums."""
    window: Array
    """(lags): the sliding window sum, without its newest column."""
    left: LeftTerms
    """(group): terms of a few left windows."""
    scores: npt.NDArray[np.int32]
    """(group, lags + 16): the scores of a few left windows; zeros after the lags."""
    best: npt.NDArray[np.int32]
    """(group, 16): score and code of the best lag of each lane."""
    codes: npt.NDArray[np.int32]
    """(group): code of the best lag."""


class GroupPlace(NamedTuple):
    """Place of a few neighbouring windows of a row of the grid, as indices into the flattened arrays of a tile."""

    number: int
    """Number of windows."""
    step: int
    window: int
    column: int
    """Column of the tile at which the first window ends."""
    column_end: int
    """Width of the tile."""
    which: int
    """How the newest row changes the column sums."""
    left_row: int
    left_back: int
    """Pixel of the newest left row at `column`, and distance to the leaving one."""
    right_row: int
    right_back: int
    """The same in the right rows, at the first lag."""
    left_at: int
    """The first window among the left ones."""
    right_at: int
    """The right window that it is compared with at the first lag."""
    share: float
    """``1 / window**2``, or 0 for a score that keeps the mean."""


@compiled(counted=False)
def _set_left_terms(count: int, at: int, windows: Windows, share: float, terms: LeftTerms) -> None:
    """Set the terms of `count` windows from window `at` on, before the scores, which would wait for them."""
    (total, inverse), (whole, coarse, fine, scale) = windows, terms
    for member in range(count):
        mean = item(total, at + member) * share
        rounded_mean = nearest(mean, whole.dtype)
        rest = mean - rounded_mean
        put(whole, member, rounded_mean)
        put(coarse, member, np.rint(rest * FRACTIONS) / FRACTIONS)
        put(fine, member, rest - np.rint(rest * FRACTIONS) / FRACTIONS)
        put(scale, member, item(inverse, at + member) * np.float32(SCORE_SCALE))


@compiled(counted=False)
def to_stored_score(
    products: Any, whole: Any, coarse: Any, fine: Any, scale: Any, right_total: Any, right_inverse: Any
) -> Any:
    """Return the scores of one left window at sixteen lags as stored integers; 0 where `right_inverse` is NaN.

    The covariance of a left window, whose mean is ``share * total`` (0 for a score that keeps the mean), with a right
    window r is ``sum(l * r) - mean * sum(r)``. The mean is split into an integer, a fraction of 8 bits and the rest:
    the large parts are subtracted in integers, or in float32 without rounding, and only the small rest is rounded.
    (Float64 sums do not need this: the first part is the mean, and the others are 0.)
    """
    total = cast(right_total, np.float32)
    covariance = cast(products - whole * right_total, np.float32) - coarse * total - fine * total
    kept = covariance * scale * right_inverse + splat(SCORE_OFFSET * SCORE_SCALE, np.float32)
    # Values below 1 become 0; a comparison with 0 itself would take two instructions.
    return cast(larger_float(kept, splat(0.5, np.float32)), np.int32)


@compiled(counted=False)
def score_group(
    place: GroupPlace,
    left: Array,
    right_rows: Array,
    left_windows: Windows,
    right_windows: Windows,
    table: LagTable,
    work: Workspace,
    right_key: Array,
) -> None:
    """Score some left windows of a row at every lag.

    One pass over the lags moves the column sums down a row (as in ``change_row``), slides the window sums right,
    converts the sums into scores (:func:`to_stored_score`), and keeps the best of each lane and, unless `right_key` is
    empty, of each right window.
    """
    count, step, window, column, column_end, which = place[:6]
    left_row, left_back, right_row, right_back, left_at, right_at, share = place[6:]
    right_total, right_inverse = right_windows
    codes, code_mask, offsets = table.codes, table.code_mask, table.right_offset
    columns, window_sums, scores, best_lanes = work.columns, work.window, work.scores, work.best
    wholes, coarses, fines, scales = work.left
    lags = columns.shape[1]
    matches_right = right_key.size > 0
    score_bits = splat(~code_mask, np.int32)
    _set_left_terms(count, left_at, left_windows, share, work.left)
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
            score = to_stored_score(products, whole, coarse, fine, scale, right[0], right[1])
            store(scores, first + lag, score)
            key = (score & score_bits) | load(codes, lag)
            best = larger(best, key)
            if matches_right:
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
    left_windows: Windows,
    right_at: Array,
    right_windows: Windows,
    table: LagTable,
    scores: Array,
    best_lanes: Array,
) -> None:
    """Score windows `first` to `end` from their known `products`, (windows, lags), as :func:`score_group` does.

    Window 0 is left window `left_at`; at the first lag, each window is compared with the right window in `right_at`.
    """
    right_total, right_inverse = right_windows
    codes, code_mask, offsets = table.codes, table.code_mask, table.right_offset
    lags, score_bits = codes.size, splat(~code_mask, np.int32)
    coarses, fines, scales = np.empty(1, np.float32), np.empty(1, np.float32), np.empty(1, np.float32)
    terms = LeftTerms(np.empty(1, products.dtype), coarses, fines, scales)
    for member in range(first, end):
        _set_left_terms(1, left_at + member, left_windows, share, terms)
        whole, scale = splat(item(terms.whole, 0), products.dtype), splat(item(scales, 0), np.float32)
        coarse, fine = splat(item(coarses, 0), np.float32), splat(item(fines, 0), np.float32)
        best = splat(0, np.int32)
        for strip in range(offsets.size):
            lag, there = strip * LANES, item(right_at, member) + item(offsets, strip)
            product = load(products, member * lags + lag)
            right = load(right_total, there), load(right_inverse, there)
            score = to_stored_score(product, whole, coarse, fine, scale, right[0], right[1])
            store(scores, member * scores.shape[1] + lag, score)
            best = larger(best, (score & score_bits) | load(codes, lag))
        store(best_lanes, member * LANES, best)


@compiled
def as_scores(stored: Array, score: Array, left_inverse: Array, right_norm: float) -> None:
    """Convert stored integers into scores, NaN where there is no candidate; `score` may share memory with `stored`.

    Normalised scores are clipped to -1..1, since rounding may exceed it. If `right_norm` is above 0, the normalisation
    is undone.
    """
    # A copy of each row, since a loop over arrays that may overlap does not vectorise.
    copied = np.empty(stored.shape[1], np.int32)
    for row in range(stored.shape[0]):
        for col in range(copied.size):
            copied[col] = stored[row, col]
        for col in range(copied.size):
            value = np.float32(copied[col]) * np.float32(1 / SCORE_SCALE) - np.float32(SCORE_OFFSET)
            value = min(max(value, np.float32(-1)), np.float32(1))
            score[row, col] = value if copied[col] > 0 else np.float32(np.nan)
        if right_norm > 0:
            for col in range(copied.size):
                score[row, col] *= np.float32(right_norm) / left_inverse[row, col]


def score_volume_reference(query: WindowQuery) -> npt.NDArray[np.float64]:
    """Return the (dy, dx, rows, cols) scores of every window at every lag, NaN where the lag is not a candidate."""
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
    """Return the score of each left window with the right window of the same index; NaN where there is none.

    Parameters
    ----------
    left_windows, right_windows
        (rows, cols, window, window).
    score
        ``"zncc"`` is Pearson's correlation, ``"ncc"`` equation 1.3 of the source report, ``"cross"`` the numerator of
        ``"zncc"``.
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


@compiled(counted=False)
def record_group(
    count: int,
    at: int,
    left_at: int,
    left_inverse: Array,
    table: LagTable,
    best_lanes: Array,
    scores: Array,
    found_codes: Array,
    found: WindowResults,
) -> None:
    """Record the best lags of a group of windows and the scores around them, from window `at` of the grid on.

    In a group, the processor works on one window's best lag while it waits for another's.
    """
    code_mask, around_code, dy_of, dx_of = table.code_mask, table.around, table.dy, table.dx
    dy, dx, around = found.dy, found.dx, found.around
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


@compiled(counted=False)
def record_runners_up(
    count: int, at: int, table: LagTable, scores: Array, found_codes: Array, runner_up: Array
) -> None:
    """Record the best score more than one pixel from the peak, and clear the peak's neighbourhood in `scores`."""
    codes, code_mask, around_code = table.codes, table.code_mask, table.around
    planes = around_code.shape[1]
    for member in range(count):
        for plane in range(planes):
            lag = item(around_code, item(found_codes, member) * planes + plane)
            put(scores, member * scores.shape[1] + lag, 0)
    score_bits = splat(~code_mask, np.int32)
    for member in range(count):
        best = splat(0, np.int32)
        for lag in range(0, codes.size, LANES):
            # The codes set the sign bit of lanes outside the range.
            key = load(scores, member * scores.shape[1] + lag) | load(codes, lag)
            best = larger(best, key & score_bits)
        put(runner_up, at + member, largest(best) if item(found_codes, member) > 0 else 0)


class TilePlace(NamedTuple):
    """Place of a tile of the window grid."""

    row_first: int
    """Row of the grid at which the tile's left windows start."""
    col_first: int
    cols: int
    right_row: int
    right_col: int
    """Pixel of the right rows that left pixel (0, 0) is compared with at the first lag."""
    window: int
    step: int
    share: float


@compiled(counted=False)
def match_tile(
    place: TilePlace,
    left: Array,
    right_rows: Array,
    left_windows: Windows,
    right_windows: Windows,
    table: LagTable,
    work: Workspace,
    found: WindowResults,
) -> None:
    """Match a tile of the window grid: all rows of `left_windows`, and the columns of `place`.

    Parameters
    ----------
    left
        The left image.
    right_rows
        Rows of the right image, in a frame wide enough for every lag, from ``changing_rows``.
    """
    row_first, col_first, cols, right_row, right_col, window, step, share = place
    offsets, columns, window_sums = table.right_offset, work.columns, work.window
    grid_cols = found.dx.shape[1]
    width = (cols - 1) * step + window
    x_first = col_first * step
    group = work.best.shape[0]
    left_stride, right_stride = left.shape[1], right_rows.shape[1]
    for row in range(left_windows.inverse.shape[0]):
        top = (row_first + row) * step
        renewed = row == 0 or 2 * step > window
        if renewed:
            for x in range(width):
                fill(columns[x], 0)
        which = ENTERING if renewed else BOTH
        left_back, right_back = window * left_stride, 0 if renewed else window * right_stride
        left_row = right_row_at = 0
        for y in range(top if renewed else top + window - step, top + window):
            left_row = y * left_stride + x_first
            right_row_at = (y + right_row) * right_stride + right_col + x_first
            # If a window ends in every column, scoring updates the column sums for the last row to enter.
            changed = width if step > 1 or y < top + window - 1 else window - 1
            change_row(
                columns, changed, left, left_row, left_back, right_rows, right_row_at, right_back, offsets, which
            )
        fill(window_sums, 0)
        for column in range(window - 1):
            slide(window_sums, columns, column, -1)
        at = row * grid_cols + col_first
        for col in range(0, cols, group):
            count = min(group, cols - col)
            column = col * step + window - 1
            here = GroupPlace(
                count,
                step,
                window,
                column,
                width,
                which if step == 1 else UNCHANGED,
                left_row + column,
                left_back,
                right_row_at + column,
                right_back,
                at + col,
                row * step * right_stride + right_col + x_first + col * step,
                share,
            )
            score_group(here, left, right_rows, left_windows, right_windows, table, work, found.right_key)
            out = at + col + row_first * grid_cols
            record_group(count, out, at + col, left_windows.inverse, table, work.best, work.scores, work.codes, found)
            if found.runner_up.size > 0:
                record_runners_up(count, out, table, work.scores, work.codes, found.runner_up)


@compiled(counted=False)
def as_right_dx(right_key: Array, dx_of: Array, code_mask: int, no_match: int, right_dx: Array) -> None:
    """Convert the keys of the right windows into displacements; `no_match` where there is no left window."""
    mask, none = np.int32(code_mask), np.int16(no_match)
    for row in range(right_dx.shape[0]):
        keys, found = right_key[row], right_dx[row]
        for x in range(found.size):
            dx = item(dx_of, keys[x] & mask)
            found[x] = dx if keys[x] > mask else none


def right_view_reference(volume: Array, lags: LagRange, no_match: int) -> npt.NDArray[np.int16]:
    """Return the displacement of the best left window of every right window; `no_match` where there is none.

    Parameters
    ----------
    volume
        (1, lags, rows, cols) scores of windows one pixel apart, NaN where there is none, from
        :func:`score_volume_reference`.
    """
    rows, cols = volume.shape[2:]
    best, right_dx = np.full((rows, cols), -np.inf), np.full((rows, cols), no_match, np.int16)
    for dx in lags.ranked()[1]:  # the shortest comes first, so that it wins ties
        scores = np.full((rows, cols), -np.inf)
        left, right = slice(max(0, -dx), min(cols, cols - dx)), slice(max(0, dx), min(cols, cols + dx))
        if left.start < left.stop:
            scores[:, right] = np.nan_to_num(volume[0, dx - lags.dx_first, :, left], nan=-np.inf)
        right_dx[scores > best] = dx
        best = np.maximum(best, scores)
    return right_dx
