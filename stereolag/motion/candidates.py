"""The matches of the windows at one level of optical flow, of which a pixel takes the best around it."""

from __future__ import annotations

from collections.abc import Iterator
from functools import partial
from typing import NamedTuple, TypeAlias

import cv2
import numpy as np
import numpy.typing as npt

from stereolag.core.arrays import Array, FloatMap
from stereolag.core.inputs import Image
from stereolag.loops.bands import over_image
from stereolag.loops.compilation import compiled
from stereolag.loops.memory import fill
from stereolag.loops.vector_lanes import LANES, item
from stereolag.stereo.windows.engines import comparable, match_windows
from stereolag.stereo.windows.pixels import fit_in_two_dimensions, fit_peaks
from stereolag.stereo.windows.scores import Windows, describe_windows, sum_columns
from stereolag.stereo.windows.search import MOST_LAGS, LagMap, LagRange, WindowMatches, WindowQuery

Flow: TypeAlias = npt.NDArray[np.float32]
"""(2, H, W) float32: dy and dx, px of the level."""

NO_SCORE = np.float32(-2)
"""Lower than any correlation: no match, or a match outside the frame."""

SAME = np.float32(2e-6)
"""Difference up to which scores are equal, as for the windows of a stereo pair: the shorter lag is taken."""

NOTHING, HALF = np.float32(np.nan), np.float32(0.5)


class Candidates(NamedTuple):
    """The best match of every pixel's window."""

    flow: Flow
    score: FloatMap
    """Pearson correlation; :data:`NO_SCORE` without a match."""
    texture: FloatMap
    """Standard deviation of the pixel's window in the first frame, grey levels."""


def places(flow: Flow, step: int = 1) -> tuple[FloatMap, FloatMap]:
    """Return the end points of pixels, `step` px apart, as (rows, cols), each (H, W)."""
    rows, cols = (np.arange(0, step * side, step, dtype=np.float32) for side in flow.shape[1:])
    return flow[0] + rows[:, None], flow[1] + cols


def fetched(image: Image, flow: Flow) -> Image:
    """Return the image warped back along a flow, with bilinear interpolation and replicated borders."""
    row, col = places(flow)
    return np.asarray(cv2.remap(image, col, row, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE))


def leaves_frame(flow: Flow) -> npt.NDArray[np.bool_]:
    """Return the (H, W) mask of pixels whose flow leads out of the frame, beyond its half-pixel border."""
    row, col = places(flow)
    rows, cols = row.shape
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
    aligned = second if flow is None else fetched(second, flow)
    framed = [np.asarray(cv2.copyMakeBorder(image, *border, cv2.BORDER_REFLECT_101)) for image in (first, aligned)]
    if flow is not None:
        return _match_near(framed[0], framed[1], flow, window, reach)
    best: _Best | None = None
    for first_dy, last_dy in _strips(reach):
        matches = match_windows(
            WindowQuery(framed[0], framed[1], window, 1, LagRange(first_dy, last_dy, -reach, reach))
        )
        best = _Best.of(matches) if best is None else best.or_better(_Best.of(matches), first_dy)
    assert best is not None
    found = best.found
    found[:, best.score == NO_SCORE] = 0
    return Candidates(found, np.where(leaves_frame(found), NO_SCORE, best.score), matches.texture)


class _Best(NamedTuple):
    """The best lag of every window among those tried so far."""

    score: FloatMap
    dy: LagMap
    dx: LagMap
    found: Flow
    """The same lags with sub-pixel precision."""

    @classmethod
    def of(cls, matches: WindowMatches) -> _Best:
        offset_dy, offset_dx = fit_peaks(matches.around)
        found = np.stack([matches.dy + offset_dy, matches.dx + offset_dx])
        score = np.where(np.isnan(matches.score), NO_SCORE, matches.score)
        return cls(score, matches.dy, matches.dx, found)

    def or_better(self, other: _Best, first_dy: int) -> _Best:
        """Return the better of this and the next strip, which begins at `first_dy`; the shorter lag if equal.

        Strips overlap by two rows of lags; each can fit a sub-pixel peak only in the row that is not its border.
        """
        lengths = [np.square(one.dy, dtype=np.int32) + np.square(one.dx, dtype=np.int32) for one in (self, other)]
        inside = (lengths[0] == lengths[1]) & (self.dy == other.dy) & (other.dy > first_dy)
        better = (other.score > self.score) | (other.score == self.score) & ((lengths[1] < lengths[0]) | inside)
        return _Best(
            np.where(better, other.score, self.score),
            np.where(better, other.dy, self.dy),
            np.where(better, other.dx, self.dx),
            np.where(better, other.found, self.found),
        )


def _strips(reach: int) -> Iterator[tuple[int, int]]:
    """Yield the first and last dy of strips no larger than one matching pass allows; strips share two rows of lags."""
    rows, first = min(MOST_LAGS // (2 * reach + 1), 2 * reach + 1), -reach
    while first + rows - 1 < reach:
        yield first, first + rows - 1
        first += rows - 2
    yield first, reach


class _Windows(NamedTuple):
    """Windows of one image, a pixel apart, and the image in the type of their sums."""

    pixels: Array
    """(rows, cols)."""
    total: Array
    """(rows, cols) of windows: sum of the pixels."""
    inverse: FloatMap
    """(rows, cols) of windows: 1 / norm; NaN for a flat window, or one out of the image."""


def _match_near(first: Image, second: Image, flow: Flow, window: int, reach: int) -> Candidates:
    """Return the best matches within a pixel or two, too few lags for strips of sixteen.

    Finds what :func:`~stereolag.stereo.windows.engines.match_windows` finds, but the innermost axis is the pixel, not
    the lag, and what is kept for a second look is used at once, a row at a time.
    """
    first, second, _, floor = comparable(first, second, window, "zncc")
    found = Candidates(*(np.empty(shape, np.float32) for shape in (flow.shape, flow.shape[1:], flow.shape[1:])))

    def match(start: int, end: int) -> None:
        left = _described(first, window, floor, start, end, 0, found.texture[start:end])
        right = _described(second, window, floor, start, end, reach, np.empty((0, 0), np.float32))
        _match_rows(left, right, window, reach, start, flow, found)

    over_image(match, flow.shape[1:])
    return found


def _described(
    image: Array, window: int, floor: float, start: int, end: int, reach: int, texture: FloatMap
) -> _Windows:
    """Return the windows of rows `start` to `end`, and those within reach around them; set the texture of the former.

    Beyond the image are zeros, and windows without a norm.
    """
    kind = np.int32 if image.dtype == np.uint8 else np.float64
    height, width = (side - window + 1 for side in image.shape)
    top, bottom = max(0, start - reach), min(height, end + reach)
    above = top - (start - reach)
    below = above + bottom - top
    shape = end - start + 2 * reach, width + 2 * reach
    windows = Windows(np.zeros(shape, kind), np.full(shape, NOTHING, np.float32))
    describe_windows(image, window, 1, top, 1 / window**2, 0.0, floor, windows, (above, below, reach), texture)
    pixels = np.zeros((shape[0] + window - 1, shape[1] + window - 1), kind)
    pixels[above : below + window - 1, reach : reach + image.shape[1]] = image[top : bottom + window - 1]
    return _Windows(pixels, *windows)


@compiled
def _match_rows(
    left: _Windows, right: _Windows, window: int, reach: int, start: int, flow: Flow, found: Candidates
) -> None:
    """Set the matches of the described rows, which begin at `start`."""
    pixels, total, inverse = left
    there, there_total, there_inverse = right
    found_flow, found_score, _ = found
    height, width = found_score.shape
    wide, side = pixels.shape[1], 2 * reach + 1
    columns = np.zeros((side * side, wide + 2 * LANES), total.dtype)
    span, sums = np.zeros(wide + 2 * LANES, total.dtype), np.zeros(wide + 2 * LANES, total.dtype)
    # A border of missing scores gives every lag its neighbours.
    scores = np.full((side + 2, side + 2, width), NOTHING, np.float32)
    around = np.empty((3, 3, 1, width), np.float32)
    place, dy, dx = np.empty(width, np.int32), np.empty((1, width), np.float32), np.empty((1, width), np.float32)
    for row in range(total.shape[0]):
        best, bottom = found_score[start + row], row + window - 1
        for down in range(side):
            for aside in range(side):
                sums_there = columns[down * side + aside]
                if row == 0:
                    for y in range(bottom):
                        _add(pixels[y], there[y + down, aside:], sums_there)
                    _add(pixels[bottom], there[bottom + down, aside:], sums_there)
                else:
                    _move(pixels, there[:, aside:], row - 1, bottom, down, sums_there)
                sum_columns(sums_there, width, window, span, sums)
                _correlate(
                    sums,
                    total[row],
                    inverse[row],
                    there_total[row + down, aside:],
                    there_inverse[row + down, aside:],
                    1 / window**2,
                    scores[down + 1, aside + 1],
                )
        fill(best, NO_SCORE)
        fill(place, 0)
        for length in range(2 * reach * reach + 1):  # from the middle outwards: the shorter of two equal ones is first
            for down in range(side):
                for aside in range(side):
                    if (down - reach) ** 2 + (aside - reach) ** 2 == length:
                        _keep_better(scores[down + 1, aside + 1], down * (side + 2) + aside, best, place)
        for one in range(3):
            for other in range(3):
                _take_from(scores, place, one * (side + 2) + other, around[one, other, 0])
        fit_in_two_dimensions(around, dy, dx, 0, 1)
        for col in range(width):
            known = best[col] > NO_SCORE
            down, aside = place[col] // (side + 2) - reach, place[col] % (side + 2) - reach
            y = flow[0, start + row, col] + (dy[0, col] + np.float32(down) if known else np.float32(0))
            x = flow[1, start + row, col] + (dx[0, col] + np.float32(aside) if known else np.float32(0))
            found_flow[0, start + row, col] = y
            found_flow[1, start + row, col] = x
            y += np.float32(start + row)
            x += np.float32(col)
            inside = (y >= -HALF) & (y <= height - HALF) & (x >= -HALF) & (x <= width - HALF)
            best[col] = best[col] if inside else NO_SCORE


@compiled
def _add(near: Array, there: Array, columns: Array) -> None:
    """Add a row of products to the sums of the columns."""
    for x in range(near.size):
        columns[x] += near[x] * there[x]


@compiled
def _move(pixels: Array, there: Array, leaving: int, entering: int, down: int, columns: Array) -> None:
    """Add a row of products to the sums of the columns, and take another one away."""
    enters, leaves, enters_there, leaves_there = (
        pixels[entering],
        pixels[leaving],
        there[entering + down],
        there[leaving + down],
    )
    for x in range(enters.size):
        columns[x] += enters[x] * enters_there[x] - leaves[x] * leaves_there[x]


@compiled
def _correlate(
    sums: Array, total: Array, inverse: Array, there_total: Array, there_inverse: Array, share: float, scores: Array
) -> None:
    """Set the scores of a row of windows at one lag."""
    for x in range(scores.size):
        covariance = np.float64(sums[x]) - np.float64(total[x]) * share * np.float64(there_total[x])
        scores[x] = np.float32(covariance) * inverse[x] * there_inverse[x]


@compiled
def _keep_better(scores: Array, number: int, best: Array, place: Array) -> None:
    """Keep the scores of a lag where they are better, and its number; NaN is not."""
    here = np.int32(number)
    for x in range(best.size):
        better = scores[x] > best[x] + SAME
        best[x] = scores[x] if better else best[x]
        place[x] = here if better else place[x]


@compiled
def _take_from(planes: Array, place: Array, offset: int, row: Array) -> None:
    """Set every number of a row from the plane whose number is in `place`, plus `offset`."""
    for x in range(row.size):
        row[x] = item(planes, (np.int64(place[x]) + offset) * row.size + x)


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
    place = np.empty(width, np.int32)
    for row in range(first, end):
        own = best[row]
        for col in range(width):
            own[col] = score[row + spacing, col + spacing]
        fill(place, 0)
        for down in range(-spacing, spacing + 1, spacing):
            for aside in range(-spacing, spacing + 1, spacing):
                there, number = score[row + spacing + down, spacing + aside :], np.int32(down * width + aside)
                for col in range(width):
                    better = there[col] > own[col]
                    own[col] = there[col] if better else own[col]
                    place[col] = number if better else place[col]
        for part in range(2):
            begin = (part * height + row) * width
            for col in range(width):
                best_flow[part, row, col] = item(flow, begin + col + np.int64(place[col]))


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
