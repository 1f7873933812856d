"""The best left window of every right window, in the same pass: for a left-right check without a second one.

Left window x meets the right windows x + dx. While x moves right, the scores of the right windows that it meets stand
in ``right_best``, one lane for each dx; one step on, all move one lane down, and the lowest has met its last.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

from stereolag.kernels.compilation import compiled
from stereolag.kernels.lanes import LANES, larger, load, lowest_lane, shifted, splat, store

Array = npt.NDArray[Any]


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
