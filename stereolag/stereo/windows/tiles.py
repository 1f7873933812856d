"""Compiled core of window sums: a tile of left windows against every lag."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from stereolag.core.arrays import Array
from stereolag.loops.compilation import compiled
from stereolag.stereo.windows.prepared_pair import Found, Windows
from stereolag.stereo.windows.recording import record_group, record_runners_up
from stereolag.stereo.windows.running_sums import BOTH, ENTERING, NEITHER, change_row, slide
from stereolag.stereo.windows.scores import LeftTerms, score_group
from stereolag.stereo.windows.search import LagRange, LagTable


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


@compiled
def match_tile(
    left: Array,
    right_rows: Array,
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
    work: Workspace,
    found: Found,
) -> None:
    """Match a tile of the window grid: all rows of `left_windows`, columns `col_first` to ``col_first + cols``.

    Parameters
    ----------
    left
        The left image.
    right_rows
        Rows of the right image, in a frame wide enough for every lag, from ``changing_rows``.
    right_row, right_col
        The pixel of `right_rows` that the first lag of left pixel (0, 0) meets.
    row_first
        Row of the window grid at which `left_windows` starts.
    """
    left_total, left_inverse = left_windows
    right_total, right_inverse = right_windows
    codes, code_mask, offsets, around_code, dy_of, dx_of = table
    columns, window_sums, terms, scores, best, found_codes = work
    found_dy, found_dx, around, runner_up, right_key = found
    grid_cols = found_dx.shape[1]
    width = (cols - 1) * step + window
    x_first = col_first * step
    group = best.shape[0]
    left_stride, right_stride = left.shape[1], right_rows.shape[1]
    for row in range(left_inverse.shape[0]):
        top = (row_first + row) * step
        renewed = row == 0 or 2 * step > window
        if renewed:
            columns[:width] = 0
        which = ENTERING if renewed else BOTH
        left_back, right_back = window * left_stride, 0 if renewed else window * right_stride
        left_row = right_row_at = 0
        for y in range(top if renewed else top + window - step, top + window):
            left_row = y * left_stride + x_first
            right_row_at = (y + right_row) * right_stride + right_col + x_first
            # The last row to enter: if every column ends a window, its sums are updated during scoring instead.
            changed = width if step > 1 or y < top + window - 1 else window - 1
            change_row(
                columns, changed, left, left_row, left_back, right_rows, right_row_at, right_back, offsets, which
            )
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
                terms,
                left,
                left_row + column,
                left_back,
                right_rows,
                right_row_at + column,
                right_back,
                which if step == 1 else NEITHER,
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
                right_key,
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
            if runner_up.size > 0:
                out = at + col + row_first * grid_cols
                record_runners_up(count, out, scores, found_codes, around_code, codes, code_mask, runner_up)


@compiled
def as_right_dx(right_key: Array, dx_of: Array, code_mask: int, nowhere: int, right_dx: Array) -> None:
    """Convert the keys of the right windows into displacements; `nowhere` where no left window met one."""
    for row in range(right_dx.shape[0]):
        for x in range(right_dx.shape[1]):
            key = right_key[row, x]
            right_dx[row, x] = dx_of[key & code_mask] if key > code_mask else nowhere


def right_view_reference(volume: Array, lags: LagRange, nowhere: int) -> npt.NDArray[np.int16]:
    """Return the displacement of the best left window of every right window; `nowhere` where none meets it.

    Parameters
    ----------
    volume
        (1, lags, rows, cols) scores of windows one pixel apart, NaN where there is none, from
        :func:`stereolag.stereo.windows.scores.score_volume_reference`.
    """
    rows, cols = volume.shape[2:]
    best, right_dx = np.full((rows, cols), -np.inf), np.full((rows, cols), nowhere, np.int16)
    for dx in lags.ranked()[1]:  # the shortest first, so that it wins ties
        scores = np.full((rows, cols), -np.inf)
        left, right = slice(max(0, -dx), min(cols, cols - dx)), slice(max(0, dx), min(cols, cols + dx))
        if left.start < left.stop:
            scores[:, right] = np.nan_to_num(volume[0, dx - lags.dx_first, :, left], nan=-np.inf)
        right_dx[scores > best] = dx
        best = np.maximum(best, scores)
    return right_dx
