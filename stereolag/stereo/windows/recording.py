"""Recording of each window's result once its lags are scored: best lag, scores around it, runner-up.

Scores are the integers of :mod:`stereolag.stereo.windows.scores`, and lags have the codes of
:class:`stereolag.stereo.windows.search.LagTable`: both engines choose the best lag and break ties here.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from stereolag.core.arrays import Array
from stereolag.loops.compilation import compiled
from stereolag.loops.vector_lanes import LANES, item, larger, largest, load, put, splat
from stereolag.stereo.windows.prepared_pair import PreparedPair, Windows
from stereolag.stereo.windows.search import MOST_LAGS, LagTable


@compiled
def record_group(
    count: int,
    at: int,
    left_at: int,
    left_inverse: Array,
    best_lanes: Array,
    scores: Array,
    found_codes: Array,
    code_mask: int,
    around_code: Array,
    dy_of: Array,
    dx_of: Array,
    dy: Array,
    dx: Array,
    around: Array,
) -> None:
    """Record the best lags of a group of windows and the scores around them, from window `at` of the grid on.

    Working in groups lets the processor work on one window's best while it waits for another's.
    """
    planes = around_code.shape[1]
    for member in range(count):
        key = largest(load(best_lanes, member * LANES))
        code = key & code_mask if key > code_mask and item(left_inverse, left_at + member) > 0 else 0
        put(found_codes, member, code)
        put(dx, at + member, item(dx_of, code))
        if dy.size > 0:
            put(dy, at + member, item(dy_of, code))
    for plane in range(planes):
        for member in range(count):
            lag = item(around_code, item(found_codes, member) * planes + plane)
            put(around, plane * dx.size + at + member, item(scores, member * scores.shape[1] + lag))


@compiled
def record_runners_up(
    count: int,
    at: int,
    scores: Array,
    found_codes: Array,
    around_code: Array,
    codes: Array,
    code_mask: int,
    runner_up: Array,
) -> None:
    """Record the best score more than one pixel from the peak, and clear the peak's neighbourhood in `scores`."""
    planes = around_code.shape[1]
    for member in range(count):
        for plane in range(planes):
            lag = item(around_code, item(found_codes, member) * planes + plane)
            put(scores, member * scores.shape[1] + lag, 0)
    score_bits = splat(~code_mask, np.int32)
    for member in range(count):
        best = splat(0, np.int32)
        for lag in range(0, codes.size, LANES):
            # The codes set the sign bit in the lanes beyond the range.
            key = load(scores, member * scores.shape[1] + lag) | load(codes, lag)
            best = larger(best, key & score_bits)
        put(runner_up, at + member, largest(best) if item(found_codes, member) > 0 else 0)


def record_windows(
    pair: PreparedPair,
    first: int,
    some: npt.NDArray[np.intp],
    left: Windows,
    scores: npt.NDArray[np.int32],
    best_lanes: npt.NDArray[np.int32],
) -> None:
    """Record the best lags of some windows, counted from row `first` of the grid on."""
    found, table, left_at = pair.found, pair.table, int(some[0])
    at = first * pair.cols + left_at
    score_mask, score_codes = table.code_mask, table.codes
    if np.count_nonzero(table.codes > 0) > MOST_LAGS:
        # Score and code do not fit in one integer: the best of each window is found separately, with no bits lost.
        best_lanes = _best_of_many(scores, table)
        score_mask, score_codes = 0, np.minimum(table.codes, 0)
    codes = np.empty(some.size, np.int32)
    record_group(
        some.size,
        at,
        left_at,
        left.inverse,
        best_lanes,
        scores,
        codes,
        table.code_mask,
        table.around,
        table.dy,
        table.dx,
        found.dy,
        found.dx,
        found.around,
    )
    if found.runner_up.size:
        record_runners_up(some.size, at, scores, codes, table.around, score_codes, score_mask, found.runner_up)


def _best_of_many(scores: npt.NDArray[np.int32], table: LagTable) -> npt.NDArray[np.int32]:
    """Return lanes with the code of each window's best lag in the first lane, as its only candidate."""
    keys = scores[:, : table.codes.size].astype(np.int64) << 32 | np.maximum(table.codes, 0)
    keys[:, table.codes < 0] = 0
    best = keys.max(axis=1)
    lanes = np.zeros((len(scores), LANES), np.int32)
    lanes[:, 0] = np.where(best >> 32 > 0, (best & table.code_mask) | (table.code_mask + 1), 0)
    return lanes
