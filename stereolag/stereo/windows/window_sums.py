"""Dense windowed correlation by running sums: every window of the left image at every lag, tile by tile."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from stereolag.core.arrays import Array
from stereolag.core.jobs import Progress, silent
from stereolag.loops.bands import over_bands
from stereolag.loops.compilation import compiled
from stereolag.loops.vector_lanes import LANES
from stereolag.stereo.windows.prepared_pair import NO_RIGHT_MATCH, PreparedPair
from stereolag.stereo.windows.scores import (
    BOTH,
    ENTERING,
    NEITHER,
    GroupPlace,
    LeftTerms,
    WindowResults,
    Windows,
    Workspace,
    change_row,
    changing_rows,
    record_group,
    record_runners_up,
    score_group,
    slide,
)
from stereolag.stereo.windows.search import MOST_LAGS, LagRange, LagTable, WindowMatches, WindowQuery


class TilePlace(NamedTuple):
    """Place of a tile of the window grid."""

    row_first: int
    """Row of the grid at which the tile's left windows start."""
    col_first: int
    cols: int
    right_row: int
    right_col: int
    """The pixel of the right rows that the first lag of left pixel (0, 0) meets."""
    window: int
    step: int
    share: float


@compiled
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
            here = GroupPlace(
                count,
                step,
                window,
                column,
                width,
                which if step == 1 else NEITHER,
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
                record_runners_up(
                    count, out, work.scores, work.codes, table.around, table.codes, table.code_mask, found.runner_up
                )


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


CACHE_BYTES = 512 * 1024
"""Size of the column sums of a tile, which stay in a core's L2 cache."""
GROUP_BYTES = 24 * 1024
"""Size of the scores of a few windows, which stay in a core's L1 cache."""
BAND_WORK = 60e6
"""Pixels times lags of a band: about 50 ms."""


def match_windows(query: WindowQuery, progress: Progress = silent) -> WindowMatches:
    """Find the lag at which each window of the left image correlates best with the right image.

    A lag is a candidate only if its right window is wholly inside the right image, and neither flat (``zncc``) nor
    without energy (``ncc``). Lags whose scores differ by less than float32 and the number of lags can resolve (2e-6 for
    441 of them) are equal, and the shortest displacement among them wins; see :meth:`LagRange.ranked`. The time does
    not depend on the window's size.

    Parameters
    ----------
    query
        uint8 images have exact integer sums, others float64 ones. `right_matches` needs step 1 and a search without
        vertical reach.
    progress
        Called with the fraction done.

    Raises
    ------
    ValueError
        Images that are not grey or differ in size or dtype, a window larger than they are, a step below 1, more than
        65535 lags, a score or a circular correlation that needs a spectrum, or unsupported `right_matches`.
    """
    _check(query)
    matcher = _Matcher(query)
    if matcher.pair.lags is not None and matcher.pair.lags.count > MOST_LAGS:
        raise ValueError(
            f"The search has {matcher.pair.lags.count} lags; window sums allow at most {MOST_LAGS}, "
            "engine 'fft' any number."
        )
    over_bands(matcher.match_band, matcher.pair.rows, most_rows=matcher.most_rows, progress=progress)
    return matcher.pair.matches()


def _check(query: WindowQuery) -> None:
    lags = query.lags
    if query.score not in ("zncc", "ncc", "cross") or query.circular:
        raise ValueError(
            f"The score is {query.score!r}{', circular' if query.circular else ''}; "
            "allowed are 'zncc', 'ncc' and 'cross', none of them circular."
        )
    if query.right_matches and (query.step > 1 or lags.dy_first != 0 or lags.dy_last != 0):
        raise ValueError(
            f"Matches of the right windows need step 1 and no vertical search; the step is {query.step} and "
            f"dy goes from {lags.dy_first} to {lags.dy_last}."
        )


class _Matcher:
    """Prepared pair that the threads share while each matches its own band of rows."""

    def __init__(self, query: WindowQuery) -> None:
        self.pair = PreparedPair(query)

    @property
    def most_rows(self) -> int:
        """Largest number of rows in a band, so that progress comes often enough."""
        pair = self.pair
        work_of_row = pair.width * (pair.lags.count if pair.lags else 1) * min(pair.window, 2 * pair.step) / 2
        return max(1, int(BAND_WORK / work_of_row))

    def match_band(self, first: int, end: int) -> None:
        """Match rows `first` to `end` of the window grid."""
        pair = self.pair
        left = pair.left_windows(first, end)
        if pair.lags is not None:
            right = pair.right_windows(first, end)
            top, bottom = first * pair.step, (end - 1) * pair.step + pair.window + pair.lags.rows - 1
            right_rows = changing_rows(pair.right[top + pair.right_row : bottom + pair.right_row], pair.window)
            found = pair.found._replace(right_key=pair.found.right_key[first:end])
            columns = max(CACHE_BYTES // (pair.table.codes.size * np.dtype(pair.sums_dtype).itemsize), 4 * pair.window)
            tile = max(1, (columns - pair.window) // pair.step + 1)
            work = self._workspace(min((tile - 1) * pair.step + pair.window, pair.width))
            for col in range(0, pair.cols, tile):
                cols = min(tile, pair.cols - col)
                place = TilePlace(first, col, cols, -top, pair.right_col, pair.window, pair.step, pair.share)
                match_tile(place, pair.left, right_rows, left, right, pair.table, work, found)
        pair.rescale(first, end, left.inverse)
        if pair.lags is not None and pair.right_dx.size:
            margin = max(0, -pair.lags.dx_first)
            keys, right_dx = pair.found.right_key[first:end, margin:], pair.right_dx[first:end]
            as_right_dx(keys, pair.table.dx, pair.table.code_mask, NO_RIGHT_MATCH, right_dx)

    def _workspace(self, columns: int) -> Workspace:
        lags = self.pair.table.codes.size
        group = max(1, GROUP_BYTES // (4 * lags))
        return Workspace(
            columns=_aligned((columns, lags), self.pair.sums_dtype),
            window=_aligned((lags,), self.pair.sums_dtype),
            left=LeftTerms(
                np.zeros(group, self.pair.sums_dtype),
                *(np.zeros(group, np.float32) for _ in ("coarse", "fine", "scale")),
            ),
            scores=_aligned((group, lags + LANES), np.int32),
            best=_aligned((group, LANES), np.int32),
            codes=_aligned((group,), np.int32),
        )


def _aligned(shape: tuple[int, ...], dtype: npt.DTypeLike) -> Array:
    """Return zeros that start at a cache line, so that no strip straddles two."""
    size = int(np.prod(shape)) * np.dtype(dtype).itemsize
    memory = np.zeros(size + 64, np.uint8)
    start = -memory.ctypes.data % 64
    return memory[start : start + size].view(dtype).reshape(shape)
