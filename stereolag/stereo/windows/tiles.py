"""The compiled heart: a tile of left windows against every lag."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from stereolag.arrays import Array
from stereolag.loops.compilation import compiled
from stereolag.loops.vector_lanes import LANES, larger, load, lowest_lane, shifted, splat, store
from stereolag.stereo.windows.prepared_pair import Found, Windows
from stereolag.stereo.windows.recording import record_group, record_runners_up
from stereolag.stereo.windows.running_sums import add_row, replace_row, slide
from stereolag.stereo.windows.scores import score_group
from stereolag.stereo.windows.search import LagRange, LagTable


class Workspace(NamedTuple):
    """What a thread needs besides; small enough to stay in its core's cache."""

    columns: Array
    """(image columns of the tile, lags): column sums."""
    window: Array
    """(lags): the sliding window sum, without the column that entered last."""
    scores: npt.NDArray[np.int32]
    """(group, lags + 16): the scores of a few left windows; zeros behind the lags."""
    best: npt.NDArray[np.int32]
    """(group, 16): score and code of the best lag of each lane."""
    codes: npt.NDArray[np.int32]
    """(group): code of the best lag."""
    right_best: npt.NDArray[np.int32]
    """(lags): best so far for the right windows that the current left window meets; empty if not asked for."""


@compiled
def renew_columns(
    columns: Array, width: int, left: Array, left_at: int, right: Array, right_at: int, window: int, offsets: Array
) -> None:
    """Set the column sums of the rows of a window, but for its last row."""
    columns[:width] = 0
    for dy in range(window - 1):
        add_row(columns, width, left, left_at + dy * left.shape[1], right, right_at + dy * right.shape[1], offsets)


@compiled
def advance_columns(
    columns: Array,
    width: int,
    left: Array,
    left_at: int,
    right: Array,
    right_at: int,
    window: int,
    step: int,
    offsets: Array,
) -> None:
    """Move the column sums down to the row of windows that begins at `left_at`, but for the last row to enter."""
    for dy in range(-step, -1):
        left_above, above = left_at + dy * left.shape[1], right_at + dy * right.shape[1]
        left_below, below = left_above + window * left.shape[1], above + window * right.shape[1]
        replace_row(columns, width, left, left_below, left_above, right, below, above, offsets)


@compiled
def match_tile(
    left: Array,
    right: Array,
    left_windows: Windows,
    right_windows: Windows,
    right_row: int,
    right_col: int,
    table: LagTable,
    window: int,
    step: int,
    share: float,
    row_first: int,
    col_first: int,
    cols: int,
    dx_first: int,
    work: Workspace,
    found: Found,
) -> None:
    """Match a tile of the window grid: all rows of `left_windows`, columns `col_first` to ``col_first + cols``.

    Parameters
    ----------
    left, right
        The left image with a row of zeros below it, and the right one in a frame wide enough for every lag.
    right_row, right_col
        The pixel of the framed image that the first lag of left pixel (0, 0) meets.
    row_first
        Row of the window grid at which `left_windows` begins.
    """
    left_total, left_inverse = left_windows
    right_total, right_inverse = right_windows
    codes, code_mask, offsets, around_code, dy_of, dx_of = table
    columns, window_sums, scores, best, found_codes, right_best = work
    found_dy, found_dx, around, runner_up, right_key = found
    grid_cols = found_dx.shape[1]
    width = (cols - 1) * step + window
    x_first = col_first * step
    group = best.shape[0]
    left_stride, right_stride = left.shape[1], right.shape[1]
    nothing = left.size - left_stride + x_first
    for row in range(left_inverse.shape[0]):
        y = (row_first + row) * step
        left_above, above = y * left_stride + x_first, (y + right_row) * right_stride + right_col + x_first
        left_below, below = left_above + (window - 1) * left_stride, above + (window - 1) * right_stride
        if row == 0 or 2 * step > window:
            renew_columns(columns, width, left, left_above, right, above, window, offsets)
            left_above = nothing
        else:
            advance_columns(columns, width, left, left_above, right, above, window, step, offsets)
            left_above, above = left_above - left_stride, above - right_stride
        # The last row to enter: where every column ends a window its sums move down together with the scoring.
        replace_row(
            columns, width if step > 1 else window - 1, left, left_below, left_above, right, below, above, offsets
        )
        if step > 1:
            left_below = left_above = nothing
        window_sums[:] = 0
        for column in range(window - 1):
            slide(window_sums, columns, column, -1)
        at = row * grid_cols + col_first
        for col in range(0, cols, group):
            count = min(group, cols - col)
            column = col * step + window - 1
            score_group(
                count,
                step,
                window,
                column,
                width,
                columns,
                window_sums,
                left,
                left_below + column,
                left_above + column,
                right,
                below + column,
                above + column,
                offsets,
                share,
                at + col,
                left_total,
                left_inverse,
                row * step * right_stride + right_col + x_first + col * step,
                right_total,
                right_inverse,
                codes,
                code_mask,
                scores,
                best,
            )
            record_group(
                count,
                at + col + row_first * grid_cols,
                at + col,
                left_inverse,
                best,
                scores,
                found_codes,
                code_mask,
                around_code,
                dy_of,
                dx_of,
                found_dy,
                found_dx,
                around,
            )
            if right_best.size > 0:
                for member in range(count):
                    score_bits = ~code_mask if found_codes[member] > 0 else 0
                    kept = meet_right(right_best, scores, member * scores.shape[1], codes, score_bits)
                    keep_right(right_key, row_first + row, x_first + col + member + dx_first, kept)
            if runner_up.size > 0:
                out = at + col + row_first * grid_cols
                record_runners_up(count, out, scores, found_codes, around_code, codes, code_mask, runner_up)
        if right_best.size > 0:
            for lag in range(codes.size - 1):
                keep_right(right_key, row_first + row, x_first + cols + dx_first + lag, right_best[lag])
            right_best[:] = 0


@compiled
def meet_right(right_best: Array, scores: Array, first: int, codes: Array, score_bits: int) -> int:
    """Let the right windows that one left window meets keep its score, ``scores[first:]``, where it beats theirs.

    Then move on to the next left window, and return what the leftmost right window kept, which has met its last.
    `score_bits` are those of a key that hold a score; 0 for a left window that has no match: its bare codes are less
    than any score.
    """
    bits = splat(score_bits, np.int32)
    best = larger(load(right_best, 0), (load(scores, first) & bits) | load(codes, 0))
    kept: int = lowest_lane(best)
    for lag in range(LANES, codes.size, LANES):
        following = larger(load(right_best, lag), (load(scores, first + lag) & bits) | load(codes, lag))
        store(right_best, lag - LANES, shifted(best, following))
        best = following
    store(right_best, codes.size - LANES, shifted(best, splat(0, np.int32)))
    return kept


@compiled
def keep_right(right_key: Array, row: int, x: int, key: int) -> None:
    """Write down the best left window of the right window at column `x`, if there is such a window."""
    if 0 <= x < right_key.shape[1] and key > right_key[row, x]:
        right_key[row, x] = key


@compiled
def as_right_dx(right_key: Array, dx_of: Array, code_mask: int, nowhere: int, right_dx: Array) -> None:
    """Turn what the right windows kept into displacements; `nowhere` where no left window met one."""
    for row in range(right_key.shape[0]):
        for x in range(right_key.shape[1]):
            key = right_key[row, x]
            right_dx[row, x] = dx_of[key & code_mask] if key > code_mask else nowhere


def right_view_reference(volume: Array, lags: LagRange, nowhere: int) -> npt.NDArray[np.int16]:
    """Return the displacement of the best left window of every right one, `nowhere` where none meets it.

    Parameters
    ----------
    volume
        (1, lags, rows, cols) scores of windows one pixel apart, NaN where there is none: those of
        :func:`stereolag.stereo.windows.scores.score_volume_reference`.
    """
    rows, cols = volume.shape[2:]
    best, right_dx = np.full((rows, cols), -np.inf), np.full((rows, cols), nowhere, np.int16)
    for dx in lags.ranked()[1]:  # the shortest first: it keeps what is as good
        scores = np.full((rows, cols), -np.inf)
        left, right = slice(max(0, -dx), min(cols, cols - dx)), slice(max(0, dx), min(cols, cols + dx))
        if left.start < left.stop:
            scores[:, right] = np.nan_to_num(volume[0, dx - lags.dx_first, :, left], nan=-np.inf)
        right_dx[scores > best] = dx
        best = np.maximum(best, scores)
    return right_dx
