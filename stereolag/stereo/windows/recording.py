"""What is written down of each window once its lags are scored: the best lag, the scores around it, the runner-up.

The scores are the integers of :mod:`stereolag.stereo.windows.scores`, and lags have the codes of
:class:`stereolag.stereo.windows.search.LagTable`: both engines choose and settle ties here.
"""

from __future__ import annotations

import numpy as np

from stereolag.arrays import Array
from stereolag.loops.compilation import compiled
from stereolag.loops.vector_lanes import LANES, item, larger, largest, load, put, splat


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
    """Write down the best lags of a group of windows and the scores around them, from window `at` of the grid on.

    A group at a time: the processor then works on one window's best while it waits for another's.
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
    """Write down the best score farther than one pixel from the peak, whose neighbourhood is struck out of `scores`."""
    planes = around_code.shape[1]
    for member in range(count):
        for plane in range(planes):
            lag = item(around_code, item(found_codes, member) * planes + plane)
            put(scores, member * scores.shape[1] + lag, 0)
    score_bits = splat(~code_mask, np.int32)
    for member in range(count):
        best = splat(0, np.int32)
        for lag in range(0, codes.size, LANES):
            # The codes bring the sign bit to the lanes beyond the range.
            key = load(scores, member * scores.shape[1] + lag) | load(codes, lag)
            best = larger(best, key & score_bits)
        put(runner_up, at + member, largest(best) if item(found_codes, member) > 0 else 0)
