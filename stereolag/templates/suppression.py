"""Non-maximum suppression: of many overlapping placements, the best of each place."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

Indices = npt.NDArray[np.intp]
Scores = npt.NDArray[np.floating[Any]]


ROWS_AT_ONCE = 256
"""Rows of a score map whose peaks are looked for together: where every score counts, indices take ten times a map."""


def peaks(score_map: Scores, min_score: float) -> tuple[Indices, Indices]:
    """Return rows and columns of the local maxima of at least `min_score`: no neighbour scores higher.

    The slopes of a peak are left out, so that they do not return as matches just outside its suppressed half.
    NaN is never a peak.
    """
    found = [
        _peaks_of_rows(score_map, first, first + ROWS_AT_ONCE, min_score)
        for first in range(0, len(score_map), ROWS_AT_ONCE)
    ]
    return np.concatenate([rows for rows, _ in found]), np.concatenate([cols for _, cols in found])


def _peaks_of_rows(score_map: Scores, first: int, end: int, min_score: float) -> tuple[Indices, Indices]:
    """Return the peaks of the rows from `first` to `end`; those next to them are looked at too."""
    rows, cols = np.divmod(np.flatnonzero(score_map[first:end] >= min_score), score_map.shape[1])
    rows += first
    own = score_map[rows, cols]
    last_row, last_col = score_map.shape[0] - 1, score_map.shape[1] - 1
    highest = np.ones(len(rows), dtype=np.bool_)
    for down in (-1, 0, 1):
        for right in (-1, 0, 1):
            neighbour = score_map[np.clip(rows + down, 0, last_row), np.clip(cols + right, 0, last_col)]
            highest &= ~(neighbour > own)
    return rows[highest], cols[highest]


def suppress(rows: Indices, cols: Indices, scores: Scores, shape: tuple[int, int], max_matches: int) -> list[int]:
    """Return the indices of the placements kept, best first: each removes all that it overlaps by more than half.

    Placements are rectangles of `shape` (height, width) with their top-left pixel at (row, col); of equal scores
    the first listed wins.
    """
    height, width = shape
    left = np.argsort(-scores, kind="stable")
    kept: list[int] = []
    while left.size and len(kept) < max_matches:
        best = left[0]
        kept.append(int(best))
        shared_rows = np.maximum(height - np.abs(rows[left] - rows[best]), 0)
        shared_cols = np.maximum(width - np.abs(cols[left] - cols[best]), 0)
        left = left[2 * shared_rows * shared_cols <= height * width]
    return kept
