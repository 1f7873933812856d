"""Window matches of one level: the residual of the flow so far, by correlation over a small square of lags."""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

import cv2
import numpy as np

from stereolag.core.arrays import Array, FloatMap
from stereolag.core.inputs import Image
from stereolag.loops.bands import over_bands
from stereolag.loops.compilation import compiled
from stereolag.motion.pyramid import Flow, fetched, leaves_frame
from stereolag.stereo.windows.matches import LagMap, WindowMatches, WindowQuery
from stereolag.stereo.windows.peak_fits import fit_peaks
from stereolag.stereo.windows.search import MOST_LAGS, LagRange
from stereolag.stereo.windows.window_sums import match_windows

NO_SCORE = np.float32(-2)
"""Lower than any correlation: no match, or a match outside the frame."""


class Candidates(NamedTuple):
    """The best match of every pixel's window."""

    flow: Flow
    score: FloatMap
    """Pearson correlation; :data:`NO_SCORE` without a match."""
    texture: FloatMap
    """Standard deviation of the pixel's window in the first frame, grey levels."""


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
    aligned = second if flow is None else fetched(second, flow)
    framed = [_framed(image, window // 2) for image in (first, aligned)]
    best: _Best | None = None
    for first_dy, last_dy in _strips(reach):
        matches = match_windows(
            WindowQuery(framed[0], framed[1], window, 1, LagRange(first_dy, last_dy, -reach, reach))
        )
        best = _Best.of(matches) if best is None else best.or_better(_Best.of(matches), first_dy)
    assert best is not None
    matched, found = best.score > NO_SCORE, best.found
    found[:, ~matched] = 0
    if flow is not None:
        found += flow
    score = np.where(matched & ~leaves_frame(found), best.score, NO_SCORE)
    return Candidates(found, score, matches.texture)


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
    score = cv2.copyMakeBorder(candidates.score, *border, cv2.BORDER_CONSTANT, value=float(NO_SCORE))
    parts = [cv2.copyMakeBorder(part, *border, cv2.BORDER_REPLICATE) for part in candidates.flow]
    flow, best = np.empty_like(candidates.flow), np.empty_like(candidates.score)
    over_bands(
        lambda first, end: _take_best(parts[0], parts[1], score, spacing, first, end, flow[0], flow[1], best),
        best.shape[0],
    )
    return Candidates(flow, best, candidates.texture)


@compiled
def _take_best(
    dy: Array,
    dx: Array,
    score: Array,
    spacing: int,
    first: int,
    end: int,
    best_dy: Array,
    best_dx: Array,
    best: Array,
) -> None:
    """Set rows `first` to `end` from maps padded by `spacing` px; a pixel's own window wins ties."""
    for row in range(first, end):
        own = row + spacing
        for col in range(best.shape[1]):
            best[row, col] = score[own, col + spacing]
            best_dy[row, col] = dy[own, col + spacing]
            best_dx[row, col] = dx[own, col + spacing]
        for down in range(3):
            line = row + down * spacing
            for aside in range(3):
                shift = aside * spacing
                for col in range(best.shape[1]):
                    better = score[line, col + shift] > best[row, col]
                    best[row, col] = score[line, col + shift] if better else best[row, col]
                    best_dy[row, col] = dy[line, col + shift] if better else best_dy[row, col]
                    best_dx[row, col] = dx[line, col + shift] if better else best_dx[row, col]


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


def _framed(image: Image, margin: int) -> Image:
    """Return the image padded by mirroring, so that every pixel has a window."""
    return np.asarray(cv2.copyMakeBorder(image, margin, margin, margin, margin, cv2.BORDER_REFLECT_101))
