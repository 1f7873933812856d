"""Local maxima of a score map, and the best of them that do not overlap."""

from __future__ import annotations

from typing import Any

import cv2
import numpy as np
import numpy.typing as npt

Indices = npt.NDArray[np.intp]
Scores = npt.NDArray[np.floating[Any]]

ROWS_AT_ONCE = 256
"""Rows of a score map searched for peaks at a time, to keep the copies small."""

NEIGHBOURS = np.ones((3, 3), dtype=np.uint8)


def peaks(score_map: npt.NDArray[np.float32], min_score: float) -> tuple[Indices, Indices]:
    """Return rows and columns of the local maxima of at least `min_score`: no neighbour scores higher.

    The slopes of a peak are left out, so they do not come back as matches just outside its suppressed half.
    NaN is never a peak.
    """
    found = [
        _peaks_of_rows(score_map, first, min(first + ROWS_AT_ONCE, len(score_map)), min_score)
        for first in range(0, len(score_map), ROWS_AT_ONCE)
    ]
    return np.concatenate([rows for rows, _ in found]), np.concatenate([cols for _, cols in found])


def _peaks_of_rows(
    score_map: npt.NDArray[np.float32], first: int, end: int, min_score: float
) -> tuple[Indices, Indices]:
    """Return the peaks of the rows from `first` to `end`, compared with the adjacent rows too."""
    start = max(0, first - 1)
    part = np.nan_to_num(score_map[start : end + 1], nan=-2.0)
    highest = (part >= cv2.dilate(part, NEIGHBOURS).reshape(part.shape)) & (part >= max(min_score, -1.0))
    rows, cols = np.divmod(np.flatnonzero(highest[first - start : end - start]), score_map.shape[1])
    return rows + first, cols


Shape = tuple[int | Indices, int | Indices]
"""Height and width of the rectangles: one for all positions, or one each."""


def suppress(rows: Indices, cols: Indices, scores: Scores, shape: Shape, max_matches: int) -> list[int]:
    """Return the indices of the positions kept, best first: each removes those it overlaps by more than half.

    Positions are rectangles of `shape` with their top-left pixel at (row, col). Half refers to the smaller of the two;
    of equal scores the first listed wins.
    """
    boxes = _Boxes(rows, cols, shape)
    left = np.arange(len(rows))
    kept: list[int] = []
    while left.size and len(kept) < max_matches:
        best = int(left[np.argmax(scores[left])])
        kept.append(best)
        left = left[2 * boxes.shared(left, best) <= np.minimum(boxes.areas(left), boxes.areas(best))]
    return kept


def next_elsewhere(rows: Indices, cols: Indices, scores: Scores, shape: Shape, kept: list[int]) -> list[float]:
    """Return, for each position kept, the best score elsewhere than it and those before it, -1 if there is none.

    A position on the flank of a peak shares most of its pixels: only one that shares none is another place.
    """
    boxes = _Boxes(rows, cols, shape)
    left = np.arange(len(rows))
    found = []
    for one in kept:
        left = left[boxes.shared(left, one) == 0]
        found.append(float(scores[left].max()) if left.size else -1.0)
    return found


def elsewhere(rows: Indices, cols: Indices, scores: Scores, shape: Shape, kept: list[int], count: int) -> list[int]:
    """Return the indices of the `count` best positions that share no pixel with those kept or with one another."""
    boxes = _Boxes(rows, cols, shape)
    left = np.arange(len(rows))
    for one in kept:
        left = left[boxes.shared(left, one) == 0]
    found: list[int] = []
    while left.size and len(found) < count:
        best = int(left[np.argmax(scores[left])])
        found.append(best)
        left = left[boxes.shared(left, best) == 0]
    return found


class _Boxes:
    """Rectangles at the positions."""

    def __init__(self, rows: Indices, cols: Indices, shape: Shape) -> None:
        self._rows, self._cols = rows, cols
        self._heights, self._widths = (np.broadcast_to(side, rows.shape) for side in shape)

    def shared(self, some: Indices, one: int) -> Indices:
        """Return the number of pixels that each of some rectangles shares with one."""
        down = np.minimum(self._rows[some] + self._heights[some], self._rows[one] + self._heights[one])
        right = np.minimum(self._cols[some] + self._widths[some], self._cols[one] + self._widths[one])
        down -= np.maximum(self._rows[some], self._rows[one])
        right -= np.maximum(self._cols[some], self._cols[one])
        return np.asarray(np.maximum(down, 0) * np.maximum(right, 0))

    def areas(self, some: Indices | int) -> Indices:
        """Return the number of pixels in each rectangle."""
        return np.asarray(self._heights[some] * self._widths[some])
