"""From windows to pixels: the sub-pixel fit of all peaks, and a disparity or a reason for every pixel."""

from __future__ import annotations

import math
from typing import Any, Literal, NamedTuple

import cv2
import numpy as np

from stereolag.core.arrays import Array, DoubleMap, FloatMap, ReasonMap
from stereolag.loops.bands import over_bands
from stereolag.loops.compilation import compiled
from stereolag.loops.memory import copy, fill
from stereolag.stereo.matcher import PixelMatches, Reason
from stereolag.stereo.windows.search import LagMap, LagRange, WindowMatches, WindowQuery

ZERO, HALF, ONE, TWO, THREE, FOUR, EIGHT = (np.float32(number) for number in (0, 0.5, 1, 2, 3, 4, 8))
THIRD, FIFTH, SEVENTH, NINTH = (np.float32(1 / number) for number in (3, 5, 7, 9))


@compiled(counted=False)
def _log_ratio(numerator: Any, denominator: Any) -> Any:
    """Return the logarithm of the ratio of two positive numbers: 8 artanh((a - b) / (a + b)) of their fourth roots."""
    a, b = math.sqrt(math.sqrt(numerator)), math.sqrt(math.sqrt(denominator))
    z = (a - b) / (a + b)
    square = z * z
    return EIGHT * z * (ONE + square * (THIRD + square * (FIFTH + square * (SEVENTH + square * NINTH))))


@compiled(counted=False)
def _fit_three(before: Any, peak: Any, after: Any, gaussian: Any) -> Any:
    """Return the offset of the peak of three scores: from a Gaussian, or a parabola if one is not positive."""
    positive = False if gaussian is None else min(before, after) > ZERO
    fall_before = _log_ratio(peak, before) if positive else peak - before
    fall_after = _log_ratio(peak, after) if positive else peak - after
    bend = fall_before + fall_after
    offset = min(HALF, max(-HALF, HALF * (fall_before - fall_after) / bend))
    # A missing neighbour makes the bend NaN, and this comparison false.
    return offset if bend > ZERO else ZERO


@compiled(counted=False)
def _fit_along_rows(around: FloatMap, offset_dx: FloatMap, first: int, end: int) -> None:
    """Fit rows `first` to `end` of the grid of windows after a search along one row of lags."""
    for row in range(first, end):
        before, peak, after, offset = around[0, 0, row], around[0, 1, row], around[0, 2, row], offset_dx[row]
        for col in range(peak.size):
            offset[col] = _fit_three(before[col], peak[col], after[col], True)


@compiled(counted=False)
def fit_in_two_dimensions(
    around: FloatMap, offset_dy: FloatMap, offset_dx: FloatMap, first: int, end: int, gaussian: Any
) -> None:
    """Fit rows `first` to `end` of the grid of windows: nine scores named by compass, the peak in the middle.

    If `gaussian` is None, fit a parabola, which takes a fifth of the time.
    """
    for row in range(first, end):
        nw, n, ne = around[0, 0, row], around[0, 1, row], around[0, 2, row]
        w, peak, e = around[1, 0, row], around[1, 1, row], around[1, 2, row]
        sw, s, se = around[2, 0, row], around[2, 1, row], around[2, 2, row]
        dy, dx = offset_dy[row], offset_dx[row]
        for col in range(peak.size):
            top = peak[col]
            lowest = min(
                min(min(nw[col], n[col]), min(ne[col], w[col])), min(min(e[col], sw[col]), min(s[col], se[col]))
            )
            positive = False if gaussian is None else lowest > ZERO
            # All values are relative to the peak, which is therefore 0.
            a = _log_ratio(nw[col], top) if positive else nw[col] - top
            b = _log_ratio(n[col], top) if positive else n[col] - top
            c = _log_ratio(ne[col], top) if positive else ne[col] - top
            d = _log_ratio(w[col], top) if positive else w[col] - top
            f = _log_ratio(e[col], top) if positive else e[col] - top
            g = _log_ratio(sw[col], top) if positive else sw[col] - top
            h = _log_ratio(s[col], top) if positive else s[col] - top
            i = _log_ratio(se[col], top) if positive else se[col] - top
            slope_y = (g + h + i - a - b - c) / (TWO * THREE)
            slope_x = (c + f + i - a - d - g) / (TWO * THREE)
            bend_y = (a + b + c + g + h + i - TWO * (d + f)) / (TWO * THREE)
            bend_x = (a + d + g + c + f + i - TWO * (b + h)) / (TWO * THREE)
            twist = (i - g - c + a) / FOUR
            determinant = FOUR * bend_x * bend_y - twist * twist
            joint_y = (twist * slope_x - TWO * bend_x * slope_y) / determinant
            joint_x = (twist * slope_y - TWO * bend_y * slope_x) / determinant
            joint = (
                (determinant > ZERO) & (bend_x < ZERO) & (bend_y < ZERO) & (abs(joint_y) <= ONE) & (abs(joint_x) <= ONE)
            )
            separate_y = _fit_three(n[col], top, s[col], gaussian)
            separate_x = _fit_three(w[col], top, e[col], gaussian)
            dy[col] = joint_y if joint else separate_y
            dx[col] = joint_x if joint else separate_x


def fit_peaks(around: FloatMap, gaussian: Literal[True] | None = True) -> tuple[FloatMap, FloatMap]:
    """Return the sub-pixel (dy, dx) offsets of every window's peak: the one peak fit of the package.

    Along one row it is a Gaussian through three scores (Willert & Gharib 1991, the usual choice in PIV), or a parabola
    where a score is not positive and has no logarithm. Of the fits compared on shifted textures and photographs
    (parabola, equiangular lines, cosine, lines through the root of the distance), the Gaussian had the smallest bias:
    at most 0.04 px on windows of 20 px, against 0.07 px for the parabola.

    In two dimensions a Gaussian is fitted to the nine scores at once by regression (Nobach & Honkanen, "Two-dimensional
    Gaussian regression for sub-pixel displacement estimation in particle image velocimetry", 2005). Two separate fits
    are biased wherever the peak is oblique: by up to 0.14 px on shifted textures, against 0.03 px for the joint fit.
    Where a score is missing or the nine do not bend down in all directions, the separate fits are used instead.

    Parameters
    ----------
    around
        (3, 3, n_rows, n_cols) float32 scores at dy - 1..dy + 1 and dx - 1..dx + 1, the largest in the middle, or
        (1, 3, ...) after a search along one row of lags; NaN = no such lag. For a single window: (3, 3, 1, 1).
    gaussian
        None for a parabola in two dimensions, for displacements that will be refined.

    Returns
    -------
    tuple of ndarray
        (n_rows, n_cols) float32, px: -0.5..0.5 along a row, within ±1 in two dimensions; 0 where nothing can be fitted.
    """
    offset_dy, offset_dx = np.zeros(around.shape[2:], np.float32), np.empty(around.shape[2:], np.float32)

    def fit(first: int, end: int) -> None:
        if around.shape[0] == 1:
            _fit_along_rows(around, offset_dx, first, end)
        else:
            fit_in_two_dimensions(around, offset_dy, offset_dx, first, end, gaussian)

    over_bands(fit, around.shape[2])
    return offset_dy, offset_dx


def fit_peaks_reference(around: FloatMap) -> tuple[FloatMap, FloatMap]:
    """Return the expected result of :func:`fit_peaks`, within 0.003 px, computed with exact logarithms."""
    if around.shape[0] == 1:
        return np.zeros(around.shape[2:], np.float32), _fit_three_reference(*around[0])
    separate_y, separate_x = _fit_three_reference(*around[:, 1]), _fit_three_reference(*around[1])
    values = _logarithms(around.reshape(9, *around.shape[2:])).reshape(around.shape)
    by_row, by_col = values.sum(axis=1), values.sum(axis=0)
    slope_y, slope_x = (by_row[2] - by_row[0]) / 6, (by_col[2] - by_col[0]) / 6
    bend_y, bend_x = (by_row[0] - 2 * by_row[1] + by_row[2]) / 6, (by_col[0] - 2 * by_col[1] + by_col[2]) / 6
    twist = (values[2, 2] - values[2, 0] - values[0, 2] + values[0, 0]) / 4
    determinant = 4 * bend_x * bend_y - twist**2
    joint = np.isfinite(determinant) & (determinant > 0) & (bend_x < 0) & (bend_y < 0)
    scale = np.divide(1, determinant, where=joint, out=np.zeros_like(determinant))
    joint_y, joint_x = (
        (twist * slope_x - 2 * bend_x * slope_y) * scale,
        (twist * slope_y - 2 * bend_y * slope_x) * scale,
    )
    joint &= np.maximum(np.abs(joint_y), np.abs(joint_x)) <= 1
    return (
        np.where(joint, joint_y, separate_y).astype(np.float32),
        np.where(joint, joint_x, separate_x).astype(np.float32),
    )


def _fit_three_reference(before: FloatMap, peak: FloatMap, after: FloatMap) -> FloatMap:
    low, top, high = _logarithms(np.stack([before, peak, after]))
    curvature = low - 2 * top + high
    offset = np.divide(low - high, 2 * curvature, where=curvature < 0, out=np.zeros_like(curvature))
    return np.asarray(np.clip(offset, -0.5, 0.5), dtype=np.float32)


def _logarithms(scores: FloatMap) -> DoubleMap:
    """Return the logarithms along axis 0 where all scores are positive, the scores themselves elsewhere."""
    values = scores.astype(np.float64)
    return np.log(values, out=values, where=(values > 0).all(axis=0))


NAN = np.float32(np.nan)
MEASURED, OUT_OF_FRAME, LOW_TEXTURE, AT_SEARCH_EDGE = (
    np.uint8(reason) for reason in (Reason.MEASURED, Reason.OUT_OF_FRAME, Reason.LOW_TEXTURE, Reason.AT_SEARCH_EDGE)
)


class _Matched(NamedTuple):
    """Matches to spread, each (n_rows, n_cols); `refused` and `dy` may be empty."""

    refused: ReasonMap
    texture: FloatMap
    score: FloatMap
    dy: LagMap
    dx: LagMap
    offset_dy: FloatMap
    offset_dx: FloatMap


def spread_over_pixels(
    matches: WindowMatches, query: WindowQuery, *, asked: LagRange, flat: float, refused: ReasonMap | None
) -> PixelMatches:
    """Return the matches of all pixels, each taken from the window in whose cell it is.

    The sign changes here: windows have a displacement, right minus left, and pixels have a disparity, ``-dx``.

    Parameters
    ----------
    matches
        Matches of the windows.
    query
        Their query.
    asked
        Displacements of the settings; a peak outside them is at the edge of the search.
    flat
        Texture up to which a window is too flat, grey levels.
    refused
        (n_rows, n_cols) reasons already known, which any other overrides; None if there are none.
    """
    shape, grid = (query.left.shape[0], query.left.shape[1]), matches.score.shape
    vertical, offset = asked.rows > 1, (query.window_size - query.step) // 2
    whole = query.step == 1  # a window's cell is its pixel
    written_shape, at = (shape, offset) if whole else (grid, 0)
    dtypes = (np.float32, np.uint8, np.float32, np.float32)[: 3 + vertical]
    arrays = [np.empty(written_shape, dtype) for dtype in dtypes]
    maps = PixelMatches._make([*arrays, np.empty((0, 0), np.float32)][:4])
    found = _Matched(
        np.empty((0, 0), np.uint8) if refused is None else np.ascontiguousarray(refused),
        np.ascontiguousarray(matches.texture),
        np.ascontiguousarray(matches.score),
        np.ascontiguousarray(matches.dy) if vertical else np.empty((0, 0), np.int16),
        np.ascontiguousarray(matches.dx),
        *fit_peaks(matches.around),
    )
    ends = (asked.dy_first, asked.dy_last, asked.dx_first, asked.dx_last)
    last = (shape[0] - query.window_size, shape[1] - query.window_size)
    given = at, query.step, last, ends, query.circular, flat, found
    over_bands(lambda first, end: _write_matches(first, end, *given, maps), grid[0])

    def spread(values: Array, blank: Any) -> Array:
        rows, cols = (query.step * side for side in grid)
        cells = values
        if not whole:
            cells = np.empty(shape, values.dtype)
            large = cv2.resize(values, (cols, rows), interpolation=cv2.INTER_NEAREST_EXACT)
            cells[offset : offset + rows, offset : offset + cols] = large
        cells[:offset] = cells[offset + rows :] = blank
        cells[:, :offset] = cells[:, offset + cols :] = blank
        return cells

    return PixelMatches(*map(spread, arrays, (NAN, OUT_OF_FRAME, NAN, NAN)))


@compiled(counted=False)
def _write_matches(
    first: int,
    end: int,
    at: int,
    step: int,
    last: tuple[int, int],
    ends: tuple[int, int, int, int],
    circular: bool,
    flat: float,
    found: _Matched,
    maps: Any,
) -> None:
    """Write the matches of rows `first` to `end` of the grid, `at` px further down and right in the maps.

    `last` is the place of the last window that fits into the image. `maps` is a `PixelMatches`, with an empty `dy`
    after a search along one row.
    """
    refused, texture, best, lag_dy, lag_dx, offset_dy, offset_dx = found
    dy_first, dy_last, dx_first, dx_last = ends
    cols, vertical, level = lag_dx.shape[1], lag_dy.size > 0, np.float32(flat)
    for row in range(first, end):
        reason, disparity = maps.reason[at + row, at : at + cols], maps.disparity[at + row, at : at + cols]
        if refused.size:
            copy(refused[row], reason)
        else:
            fill(reason, MEASURED)
        if not circular:
            _mark_edges(lag_dx[row], 0, step, last[1], dx_first, dx_last, reason)
            if vertical:
                _mark_edges(lag_dy[row], step * row, 0, last[0], dy_first, dy_last, reason)
        # Values are loaded before the choice between them, few arrays at a time: otherwise loops do not vectorise.
        for col in range(cols):
            score, spread, known = best[row, col], texture[row, col], reason[col]
            known = known if score == score else OUT_OF_FRAME
            reason[col] = LOW_TEXTURE if spread <= level else known
        for col in range(cols):
            known = reason[col]
            # 0 - dx, as a negated zero would print as -0.
            negated = np.float32(0) - (offset_dx[row, col] + np.float32(np.int32(lag_dx[row, col])))
            disparity[col] = negated if known == MEASURED else NAN
        copy(best[row], maps.score[at + row, at : at + cols])
        if vertical:
            dy = maps.dy[at + row, at : at + cols]
            for col in range(cols):
                moved = offset_dy[row, col] + np.float32(lag_dy[row, col])
                dy[col] = moved if reason[col] == MEASURED else NAN


@compiled(counted=False)
def _mark_edges(lags: Array, start: int, step: int, last: int, low: int, high: int, reason: Array) -> None:
    """Mark the windows of a row whose lag is not between `low` and `high`, or leads to the first or last position.

    Their own positions begin at `start` and are `step` px apart.
    """
    for col in range(reason.size):
        lag, known = np.int32(lags[col]), reason[col]
        place = np.int32(start) + np.int32(step) * np.int32(col) + lag
        inside = (lag >= np.int32(low)) & (lag <= np.int32(high))
        cut = (place == np.int32(0)) | (place == np.int32(last)) | (known == OUT_OF_FRAME)
        known = known if inside else AT_SEARCH_EDGE
        reason[col] = OUT_OF_FRAME if cut else known


def spread_over_pixels_reference(
    matches: WindowMatches, query: WindowQuery, *, asked: LagRange, flat: float, refused: ReasonMap | None
) -> PixelMatches:
    """Return the expected result of :func:`spread_over_pixels`, computed with plain NumPy."""
    height, width = query.left.shape
    size, step = query.window_size, query.step
    offset_dy, offset_dx = fit_peaks(matches.around)
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
    measured = reason == np.uint8(Reason.MEASURED)
    row, col = ((np.arange(side) - (size - step) // 2) // step for side in (height, width))
    here = np.ix_(row.clip(0, len(reason) - 1), col.clip(0, reason.shape[1] - 1))
    known = ((row >= 0) & (row < len(reason)))[:, None] & ((col >= 0) & (col < reason.shape[1]))

    def spread(values: FloatMap) -> FloatMap:
        return np.where(known, values[here], NAN).astype(np.float32)

    return PixelMatches(
        spread(np.where(measured, -(matches.dx + offset_dx), NAN)),
        np.where(known, reason[here], OUT_OF_FRAME).astype(np.uint8),
        spread(matches.score),
        spread(np.where(measured, matches.dy + offset_dy, NAN)) if asked.rows > 1 else None,
    )
