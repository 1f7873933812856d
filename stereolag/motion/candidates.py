"""Matching at one level of optical flow: the window around every pixel, then the best window around the pixel."""

from __future__ import annotations

from collections.abc import Iterator
from functools import partial
from typing import NamedTuple, TypeAlias

import cv2
import numpy as np

from stereolag.core.arrays import Array, FloatMap, Mask
from stereolag.core.inputs import Image
from stereolag.loops.bands import over_image
from stereolag.loops.compilation import compiled
from stereolag.loops.memory import fill
from stereolag.loops.vector_lanes import LANES, cast, item, load, splat, store
from stereolag.stereo.windows.engines import comparable, match_windows
from stereolag.stereo.windows.norms import WindowNorms, Windows, describe_windows
from stereolag.stereo.windows.pixels import fit_in_two_dimensions, fit_peaks
from stereolag.stereo.windows.scores import change, changing_rows, row_change
from stereolag.stereo.windows.search import MAX_LAGS, LagMap, LagRange, WindowMatches, WindowQuery

Flow: TypeAlias = FloatMap
"""(2, H, W) float32: dy and dx, px of the level."""

NO_SCORE = np.float32(-2)
"""Lower than any correlation: no match, or a match outside the frame."""

SCORE_TOLERANCE = np.float32(2e-6)
"""Difference up to which scores are equal, as for the windows of a stereo pair: the shorter lag is taken."""

HALF = np.float32(0.5)
"""In single precision, for compiled loops."""


class Candidates(NamedTuple):
    """The best match of every pixel's window."""

    flow: Flow
    score: FloatMap
    """Pearson correlation; :data:`NO_SCORE` without a match."""
    texture: FloatMap
    """Standard deviation of the pixel's window in the first frame, grey levels."""


def end_points(flow: Flow, step: int = 1) -> tuple[FloatMap, FloatMap]:
    """Return the rows and columns, each (H, W), to which a flow leads from pixels `step` px apart."""
    rows, cols = (np.arange(0, step * side, step, dtype=np.float32) for side in flow.shape[1:])
    return flow[0] + rows[:, None], flow[1] + cols


def warped(image: Image, flow: Flow, step: int = 1) -> Image:
    """Return the image warped back along a flow from pixels `step` px apart: bilinear, with replicated borders."""
    row, col = end_points(flow, step)
    return np.asarray(cv2.remap(image, col, row, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE))


def leaves_frame(flow: Flow, shape: tuple[int, ...], step: int = 1) -> Mask:
    """Return the mask of pixels, `step` px apart, whose flow leads out of a frame, beyond its half-pixel border."""
    (row, col), (rows, cols) = end_points(flow, step), shape
    return np.asarray((row < -0.5) | (row > rows - 0.5) | (col < -0.5) | (col > cols - 0.5))


def match_level(first: Image, second: Image, flow: Flow | None, window: int, reach: int) -> Candidates:
    """Match the window around every pixel of the first frame.

    Parameters
    ----------
    first, second
        (H, W) grey images of one type, at least as large as the window.
    flow
        The flow so far: the second frame is warped along it and the residual is searched. None at the coarsest level.
    window
        Side of the window, px; odd.
    reach
        Reach of the search in every direction, px.

    Returns
    -------
    Candidates
        The flow so far plus the residual, with sub-pixel precision.
    """
    # Mirrored at the border, so that every pixel has a window.
    border = (window // 2, window // 2, window // 2, window // 2)
    aligned = second if flow is None else warped(second, flow)
    padded = [np.asarray(cv2.copyMakeBorder(image, *border, cv2.BORDER_REFLECT_101)) for image in (first, aligned)]
    if flow is not None:
        return _match_near(padded[0], padded[1], flow, window, reach)
    best: _Best | None = None
    for first_dy, last_dy in _strips(reach):
        matches = match_windows(
            WindowQuery(padded[0], padded[1], window, 1, LagRange(first_dy, last_dy, -reach, reach))
        )
        best = _Best.of(matches) if best is None else best.or_better(_Best.of(matches), first_dy)
    assert best is not None
    found = best.found
    found[:, best.score == NO_SCORE] = 0
    return Candidates(found, np.where(leaves_frame(found, first.shape), NO_SCORE, best.score), matches.texture)


class _Best(NamedTuple):
    """The best lag of every window among those tried so far."""

    score: FloatMap
    dy: LagMap
    dx: LagMap
    found: Flow
    """The same lags with sub-pixel precision."""

    @classmethod
    def of(cls, matches: WindowMatches) -> _Best:
        offset_dy, offset_dx = fit_peaks(matches.around, None)
        found = np.stack([matches.dy + offset_dy, matches.dx + offset_dx])
        return cls(np.where(np.isnan(matches.score), NO_SCORE, matches.score), matches.dy, matches.dx, found)

    def or_better(self, other: _Best, first_dy: int) -> _Best:
        """Return the better lags of this and the next strip, which begins at `first_dy`; of equal ones, the shorter.

        Strips overlap by two rows of lags. A lag in both is taken from the strip in which its row is not at the border,
        so that a sub-pixel peak can be fitted.
        """
        lengths = [np.square(one.dy, dtype=np.int32) + np.square(one.dx, dtype=np.int32) for one in (self, other)]
        same_inside = (lengths[0] == lengths[1]) & (self.dy == other.dy) & (other.dy > first_dy)
        better = (other.score > self.score) | (other.score == self.score) & ((lengths[1] < lengths[0]) | same_inside)
        return _Best(
            np.where(better, other.score, self.score),
            np.where(better, other.dy, self.dy),
            np.where(better, other.dx, self.dx),
            np.where(better, other.found, self.found),
        )


def _strips(reach: int) -> Iterator[tuple[int, int]]:
    """Yield the first and last dy of strips no larger than one matching pass allows; strips share two rows of lags."""
    rows, first = min(MAX_LAGS // (2 * reach + 1), 2 * reach + 1), -reach
    while first + rows - 1 < reach:
        yield first, first + rows - 1
        first += rows - 2
    yield first, reach


class _Windows(NamedTuple):
    """Windows of one image, a pixel apart, and the image in the form in which its products are summed."""

    rows: Array
    """(rows, cols) of :func:`~stereolag.stereo.windows.scores.changing_rows`, below `window` rows of zeros."""
    total: Array
    """(rows, cols) of windows: sum of the pixels."""
    inverse: FloatMap
    """(rows, cols) of windows: 1 / norm; NaN for a flat window, or one out of the image."""


MAX_INTEGER_WINDOW_PX = 13
"""Side of the largest window of uint8 whose covariance, times its number of pixels, fits 32 bits."""


def _match_near(first: Image, second: Image, flow: Flow, window: int, reach: int) -> Candidates:
    """Return the best matches within a few pixels of the flow.

    The result is that of :func:`~stereolag.stereo.windows.engines.match_windows`, but vectors run along a row of pixels
    instead of the lags, which are too few for sixteen lanes, and each row is fitted as soon as it is scored.
    """
    first, second, _, floor = comparable(first, second, window, "zncc")
    if window > MAX_INTEGER_WINDOW_PX:
        first, second = first.astype(np.float64), second.astype(np.float64)
    found = Candidates(*(np.empty(shape, np.float32) for shape in (flow.shape, flow.shape[1:], flow.shape[1:])))
    lags = np.mgrid[: 2 * reach + 1, : 2 * reach + 1].reshape(2, -1)
    # From the middle outwards: the shorter of two equal lags is first.
    order = lags[:, np.argsort(np.square(lags - reach).sum(axis=0), kind="stable")].T.copy()

    def match(start: int, end: int) -> None:
        left = _described(first, window, floor, start, end, 0, found.texture[start:end])
        right = _described(second, window, floor, start, end, reach, np.empty((0, 0), np.float32))
        _match_rows(left, right, window, order, start, flow, found)

    over_image(match, flow.shape[1:])
    return found


def _described(
    image: Array, window: int, floor: float, start: int, end: int, reach: int, texture: FloatMap
) -> _Windows:
    """Return the windows of rows `start` to `end` and those within reach of them; set the texture of rows `start` on.

    The image is padded with zeros, whose windows have no norm, and rows end with space for one vector more.
    """
    dtype = np.int32 if image.dtype == np.uint8 else np.float64
    height, width = (side - window + 1 for side in image.shape)
    top, bottom = max(0, start - reach), min(height, end + reach)
    above = top - (start - reach)
    below = above + bottom - top
    shape = end - start + 2 * reach, width + 2 * reach + LANES
    windows = Windows(np.zeros(shape, dtype), np.full(shape, np.nan, np.float32))
    norms = WindowNorms(window, step=1, share=1 / window**2, norm=0.0, floor=floor)
    describe_windows(image, norms, top, windows, (above, below, reach), texture)
    pixels = np.zeros((shape[0] + 2 * window - 1, shape[1] + window - 1), image.dtype)
    pixels[window + above : 2 * window + below - 1, reach : reach + image.shape[1]] = image[top : bottom + window - 1]
    return _Windows(changing_rows(pixels, window, 1 if reach else -1), *windows)


@compiled
def _match_rows(
    left: _Windows, right: _Windows, window: int, order: Array, start: int, flow: Flow, found: Candidates
) -> None:
    """Set the matches of the given rows of windows, the first of which is `start`; lags are tried in `order`.

    There is a plane of scores for each lag, numbered row by row, and one for each lag beside them, without scores, so
    that every lag has eight neighbours.
    """
    rows, total, inverse = left
    right_rows, right_total, right_inverse = right
    found_flow, found_score, _ = found
    height, width = found_score.shape
    reach = (right_total.shape[0] - total.shape[0]) // 2
    side = 2 * reach + 3
    planes_per_row, per_side, middle = np.float32(side), np.float32(1 / side), np.float32(reach + 1)
    length = width + window - 1 + 2 * LANES
    column_sums = np.zeros((len(order), length), total.dtype)
    span, sums = np.zeros(length, total.dtype), np.zeros(length, total.dtype)
    scores = np.full((side * side, total.shape[1]), np.nan, np.float32)
    around = np.empty((3, 3, 1, width), np.float32)
    best_plane = np.empty(width, np.int32)
    dy, dx = np.empty((1, width), np.float32), np.empty((1, width), np.float32)
    for row in range(total.shape[0]):
        best = found_score[start + row]
        fill(best, NO_SCORE)
        fill(best_plane, side * side // 2)
        for number in range(len(order)):
            down, across = order[number]
            plane = (down + 1) * side + across + 1
            for y in range(row + 2 * window - 1 if row else window, row + 2 * window):
                _update_columns(rows, y, right_rows, y + down, across, window, column_sums[number])
            _sum_columns(column_sums[number], width, window, span, sums)
            _correlate(
                sums,
                total[row],
                inverse[row],
                right_total[row + down, across:],
                right_inverse[row + down, across:],
                window**2,
                scores[plane],
            )
            _keep_better(scores[plane], plane, best, best_plane)
        for row_around in range(3):
            for col_around in range(3):
                offset = (row_around - 1) * side + col_around - 1
                _gather(scores, best_plane, offset, around[row_around, col_around, 0])
        fit_in_two_dimensions(around, dy, dx, 0, 1, None)
        for col in range(width):
            down = np.floor((np.float32(best_plane[col]) + HALF) * per_side)
            across = np.float32(best_plane[col]) - down * planes_per_row
            y = flow[0, start + row, col] + (dy[0, col] + (down - middle))
            x = flow[1, start + row, col] + (dx[0, col] + (across - middle))
            found_flow[0, start + row, col] = y
            found_flow[1, start + row, col] = x
            y += np.float32(start + row)
            x += np.float32(col)
            inside = (y >= -HALF) & (y <= height - HALF) & (x >= -HALF) & (x <= width - HALF)
            best[col] = best[col] if inside else NO_SCORE


@compiled
def _update_columns(
    left: Array, left_y: int, right: Array, right_y: int, across: int, window: int, column_sums: Array
) -> None:
    """Add the products of the row of pixels that enters the windows to the column sums, less those of one that leaves.

    The row `left_y` enters at the left, and row `right_y`, from column `across`, at the right.
    """
    left_start, right_start = left_y * left.shape[1], right_y * right.shape[1] + across
    left_back, right_back = window * left.shape[1], window * right.shape[1]
    for x in range(0, column_sums.size - 2 * LANES, LANES):
        pixels = row_change(left, left_start + x, left_back)
        store(column_sums, x, load(column_sums, x) + change(pixels, right, right_start + x, right_back))


@compiled(counted=False)
def _sum_columns(column_sums: Array, count: int, window: int, span: Array, sums: Array) -> None:
    """Set ``sums[x] = column_sums[x : x + window].sum()`` for `count` windows.

    All three arrays have space for one vector more. `span` is set to the sums of 2, 4, 8, ... neighbours in turn, and
    those that make up the window are added, so that no sum waits for the one beside it.
    """
    done, width, odd = window & 1, 2, splat(window & 1, sums.dtype)
    for x in range(0, count + window - 1, LANES):
        column = load(column_sums, x)
        store(span, x, column + load(column_sums, x + 1))
        store(sums, x, odd * column)
    while width <= window:
        if window & width:
            for x in range(0, count, LANES):
                store(sums, x, load(sums, x) + load(span, x + done))
            done += width
        if 2 * width <= window:
            for x in range(0, count + window - 2 * width, LANES):
                store(span, x, load(span, x) + load(span, x + width))
        width *= 2


@compiled
def _correlate(
    sums: Array, total: Array, inverse: Array, right_total: Array, right_inverse: Array, count: int, scores: Array
) -> None:
    """Set the scores of a row of windows, of `count` pixels each, at one lag."""
    pixels, share = splat(count, sums.dtype), splat(1 / count, np.float32)
    for x in range(0, scores.size - LANES + 1, LANES):
        covariance = pixels * load(sums, x) - load(total, x) * load(right_total, x)
        scale = share * load(inverse, x) * load(right_inverse, x)
        store(scores, x, cast(covariance, np.float32) * scale)


@compiled
def _keep_better(scores: Array, plane: int, best: Array, best_plane: Array) -> None:
    """Keep the scores of a plane, and its number, where they are better than the best so far; NaN is never better."""
    number = np.int32(plane)
    for x in range(best.size):
        better = scores[x] > best[x] + SCORE_TOLERANCE
        best[x] = scores[x] if better else best[x]
        best_plane[x] = number if better else best_plane[x]


@compiled
def _gather(planes: Array, best_plane: Array, offset: int, row: Array) -> None:
    """Set ``row[x] = planes[best_plane[x] + offset, x]``."""
    width = planes.shape[1]
    for x in range(row.size):
        row[x] = item(planes, (np.int64(best_plane[x]) + offset) * width + x)


def best_of_neighbours(candidates: Candidates, spacing: int) -> Candidates:
    """Give every pixel the match of the best of nine windows: its own and those `spacing` px around it.

    A window across a motion edge contains two motions and fits neither; the pixels on either side are matched better by
    a window entirely on their side (shiftable windows, Bobick & Intille 1999).

    Parameters
    ----------
    candidates
        One for every pixel.
    spacing
        Distance to the neighbouring windows, px; at least 1.
    """
    border = (spacing, spacing, spacing, spacing)
    score = np.asarray(cv2.copyMakeBorder(candidates.score, *border, cv2.BORDER_CONSTANT, value=float(NO_SCORE)))
    flow, best = np.empty_like(candidates.flow), np.empty_like(candidates.score)
    over_image(partial(_take_best, candidates.flow, score, spacing, flow, best), best.shape)
    return Candidates(flow, best, candidates.texture)


@compiled
def _take_best(flow: Flow, score: Array, spacing: int, best_flow: Flow, best: Array, first: int, end: int) -> None:
    """Set rows `first` to `end` from scores padded by `spacing` px; a pixel's own window wins ties."""
    height, width = best.shape
    best_offset = np.empty(width, np.int32)  # from the pixel itself, in the order of the memory
    for row in range(first, end):
        best_row = best[row]
        for col in range(width):
            best_row[col] = score[row + spacing, col + spacing]
        fill(best_offset, 0)
        for down in range(-spacing, spacing + 1, spacing):
            for across in range(-spacing, spacing + 1, spacing):
                neighbour, offset = score[row + spacing + down, spacing + across :], np.int32(down * width + across)
                for col in range(width):
                    better = neighbour[col] > best_row[col]
                    best_row[col] = neighbour[col] if better else best_row[col]
                    best_offset[col] = offset if better else best_offset[col]
        for part in range(2):
            begin = (part * height + row) * width
            for col in range(width):
                best_flow[part, row, col] = item(flow, begin + col + np.int64(best_offset[col]))


def best_of_neighbours_reference(candidates: Candidates, spacing: int) -> Candidates:
    """Return the result of :func:`best_of_neighbours`, computed pixel by pixel as a reference."""
    rows, cols = candidates.score.shape
    flow, best = candidates.flow.copy(), candidates.score.copy()
    for row, col in np.ndindex(rows, cols):
        for y in (row - spacing, row, row + spacing):
            for x in (col - spacing, col, col + spacing):
                if 0 <= y < rows and 0 <= x < cols and candidates.score[y, x] > best[row, col]:
                    best[row, col] = candidates.score[y, x]
                    flow[:, row, col] = candidates.flow[:, y, x]
    return Candidates(flow, best, candidates.texture)
