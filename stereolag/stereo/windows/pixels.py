"""Conversion from windows to pixels: a disparity or a reason for every pixel, in one pass over memory."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from stereolag.core.arrays import FloatMap, ReasonMap
from stereolag.loops.bands import over_bands
from stereolag.loops.compilation import compiled
from stereolag.stereo.matcher import PixelMatches
from stereolag.stereo.reasons import Reason
from stereolag.stereo.windows.matches import LagMap, WindowMatches, WindowQuery
from stereolag.stereo.windows.peak_fits import fit_peaks
from stereolag.stereo.windows.search import LagRange

NOTHING = np.float32(np.nan)
NO_ROWS = np.empty((0, 0), np.float32)
NO_LAGS = np.empty((0, 0), np.int16)

MEASURED, OUT_OF_FRAME, LOW_TEXTURE, AT_SEARCH_EDGE = (
    np.uint8(reason) for reason in (Reason.MEASURED, Reason.OUT_OF_FRAME, Reason.LOW_TEXTURE, Reason.AT_SEARCH_EDGE)
)


class Cells(NamedTuple):
    """Layout of the windows' cells: margin before the first cell, side of a cell, and last possible window place, px.

    The cell of a window is the step × step px nearest to its centre.
    """

    offset: int
    step: int
    last_row: int
    last_col: int


class _Maps(NamedTuple):
    """Maps to write, each (H, W); `dy` is empty after a search along one row."""

    disparity: FloatMap
    dy: FloatMap
    score: FloatMap
    reason: ReasonMap


def spread_over_pixels(
    matches: WindowMatches, query: WindowQuery, *, asked: LagRange, flat: float, refused: ReasonMap | None
) -> PixelMatches:
    """Return the matches of all pixels, each taken from the window whose cell it is in.

    The sign changes here: windows have a displacement, right minus left, and pixels a disparity, ``-dx``.

    Parameters
    ----------
    matches
        Matches of the windows.
    query
        Query that they answer.
    asked
        Displacements that the settings request; a peak beyond them is at the edge of the search.
    flat
        Texture up to which a window is too flat, grey levels.
    refused
        (n_rows, n_cols) reasons already found, which any other overrides; None if there are none.
    """
    shape = (query.left.shape[0], query.left.shape[1])
    last_row, last_col = (side - query.window_size for side in shape)
    cells = Cells((query.window_size - query.step) // 2, query.step, last_row, last_col)
    vertical = asked.rows > 1
    maps = _Maps(
        np.empty(shape, np.float32),
        np.empty(shape, np.float32) if vertical else NO_ROWS,
        np.empty(shape, np.float32),
        np.empty(shape, np.uint8),
    )
    found = (
        np.empty((0, 0), np.uint8) if refused is None else np.ascontiguousarray(refused),
        np.ascontiguousarray(matches.texture),
        np.ascontiguousarray(matches.score),
        np.ascontiguousarray(matches.dy) if vertical else NO_LAGS,
        np.ascontiguousarray(matches.dx),
        *fit_peaks(matches.around),
    )
    ends = (asked.dy_first, asked.dy_last, asked.dx_first, asked.dx_last)

    def write(first: int, end: int) -> None:
        _write_cells(first, end, cells, ends, query.circular, flat, *found, maps)

    over_bands(write, matches.score.shape[0])
    return PixelMatches(maps.disparity, maps.reason, maps.score, maps.dy if vertical else None)


@compiled
def _write_cells(
    first: int,
    end: int,
    cells: Cells,
    ends: tuple[int, int, int, int],
    circular: bool,
    flat: float,
    refused: ReasonMap,
    texture: FloatMap,
    best: FloatMap,
    lag_dy: LagMap,
    lag_dx: LagMap,
    beside_dy: FloatMap,
    beside_dx: FloatMap,
    maps: _Maps,
) -> None:
    """Write the cells of rows `first` to `end` of the grid; its first and last row also write the border beyond."""
    offset, step, last_row, last_col = cells
    dy_first, dy_last, dx_first, dx_last = ends
    rows, cols = best.shape
    height, width = maps.reason.shape
    vertical = lag_dy.size > 0
    reason = np.full(cols, MEASURED, np.uint8)
    dy, disparity = np.empty(cols, np.float32), np.empty(cols, np.float32)
    for row in range(first, end):
        if refused.size:
            reason[:] = refused[row]
        else:
            reason[:] = MEASURED
        if not circular:
            for col in range(cols):
                lag = lag_dx[row, col]
                place = col * step + lag
                inside = (lag >= dx_first) & (lag <= dx_last)
                cut = (place == 0) | (place == last_col)
                reason[col] = OUT_OF_FRAME if cut else (reason[col] if inside else AT_SEARCH_EDGE)
            if vertical:
                for col in range(cols):
                    lag = lag_dy[row, col]
                    place = row * step + lag
                    inside = (lag >= dy_first) & (lag <= dy_last)
                    cut = (place == 0) | (place == last_row) | (reason[col] == OUT_OF_FRAME)
                    reason[col] = OUT_OF_FRAME if cut else (reason[col] if inside else AT_SEARCH_EDGE)
        for col in range(cols):
            score = best[row, col]
            known = reason[col] if score == score else OUT_OF_FRAME
            known = LOW_TEXTURE if texture[row, col] <= flat else known
            reason[col] = known
            # 0 - dx, as a negated zero would print as -0.
            turned = np.float32(0) - (beside_dx[row, col] + np.float32(lag_dx[row, col]))
            disparity[col] = turned if known == MEASURED else NOTHING
        if vertical:
            for col in range(cols):
                moved = beside_dy[row, col] + np.float32(lag_dy[row, col])
                dy[col] = moved if reason[col] == MEASURED else NOTHING
        top = offset + row * step
        for y in range(top, top + step):
            _blank(maps, y, 0, offset)
            _blank(maps, y, offset + cols * step, width)
            if step == 1:
                maps.disparity[y, offset : offset + cols] = disparity
                maps.score[y, offset : offset + cols] = best[row]
                maps.reason[y, offset : offset + cols] = reason
                if vertical:
                    maps.dy[y, offset : offset + cols] = dy
                continue
            for x in range(cols * step):
                col = x // step
                maps.disparity[y, offset + x] = disparity[col]
                maps.score[y, offset + x] = best[row, col]
                maps.reason[y, offset + x] = reason[col]
            if vertical:
                for x in range(cols * step):
                    maps.dy[y, offset + x] = dy[x // step]
    if first == 0:
        for y in range(offset):
            _blank(maps, y, 0, width)
    if end == rows:
        for y in range(offset + rows * step, height):
            _blank(maps, y, 0, width)


@compiled
def _blank(maps: _Maps, y: int, left: int, right: int) -> None:
    for x in range(left, right):
        maps.disparity[y, x] = NOTHING
        maps.score[y, x] = NOTHING
        maps.reason[y, x] = OUT_OF_FRAME
    if maps.dy.size:
        for x in range(left, right):
            maps.dy[y, x] = NOTHING


def spread_over_pixels_reference(
    matches: WindowMatches, query: WindowQuery, *, asked: LagRange, flat: float, refused: ReasonMap | None
) -> PixelMatches:
    """Return the expected result of :func:`spread_over_pixels`, computed with plain NumPy."""
    height, width = query.left.shape
    size, step = query.window_size, query.step
    beside_dy, beside_dx = fit_peaks(matches.around)
    place = np.indices(matches.dx.shape) * step + np.stack([matches.dy, matches.dx])
    last = np.array([height - size, width - size])[:, None, None]
    beyond = [
        (matches.dy < asked.dy_first) | (matches.dy > asked.dy_last),
        (matches.dx < asked.dx_first) | (matches.dx > asked.dx_last),
    ]
    cut = (place == 0) | (place == last)
    searched = [asked.rows > 1, True] if not query.circular else [False, False]
    reason = np.zeros(matches.dx.shape, np.uint8) if refused is None else refused.copy()
    for condition, why in ((beyond, Reason.AT_SEARCH_EDGE), (cut, Reason.OUT_OF_FRAME)):
        for axis in (0, 1):
            reason[condition[axis] & searched[axis]] = why
    reason[np.isnan(matches.score)] = Reason.OUT_OF_FRAME
    reason[matches.texture <= np.float32(flat)] = Reason.LOW_TEXTURE
    measured = reason == Reason.MEASURED
    row, col = ((np.arange(side) - (size - step) // 2) // step for side in (height, width))
    here = np.ix_(row.clip(0, len(reason) - 1), col.clip(0, reason.shape[1] - 1))
    known = ((row >= 0) & (row < len(reason)))[:, None] & ((col >= 0) & (col < reason.shape[1]))

    def spread(values: FloatMap) -> FloatMap:
        return np.where(known, values[here], NOTHING).astype(np.float32)

    return PixelMatches(
        spread(np.where(measured, -(matches.dx + beside_dx), NOTHING)),
        np.where(known, reason[here], OUT_OF_FRAME).astype(np.uint8),
        spread(matches.score),
        spread(np.where(measured, matches.dy + beside_dy, NOTHING)) if asked.rows > 1 else None,
    )
