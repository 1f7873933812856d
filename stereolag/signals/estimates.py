"""Memory and time needed to find a lag."""

from __future__ import annotations

import math
from typing import Literal, TypeAlias

from stereolag.core.jobs import COSTS, Estimate
from stereolag.core.searches import SignalMethod
from stereolag.signals.blocks import SHORTEST_BLOCK, block_length, suits_blocks
from stereolag.signals.curves import transform_length
from stereolag.signals.long_search import AROUND, cell_size

Algorithm: TypeAlias = Literal["whole", "blocks", "bands"]

LONGEST_WHOLE = 2**23
"""Longest recording that is always transformed as a whole, samples: three minutes at 44.1 kHz, 1.2 GB."""


def estimate_lag(size_1: int, size_2: int, *, method: SignalMethod = "fft", max_lag: int | None = None) -> Estimate:
    """Return the memory and time that :func:`stereolag.signals.signal_lag` needs.

    "fft" with a `max_lag` that is small against the recordings takes one block of each at a time, and a few bands of
    both for every lag of recordings above ``LONGEST_WHOLE`` samples; otherwise both recordings are kept as float64,
    with what the method's row of :data:`stereolag.core.jobs.COSTS` lists.

    Parameters
    ----------
    size_1, size_2
        Samples of the recordings, 2 or more.
    method, max_lag
        As for :func:`~stereolag.signals.signal_lag`.
    """
    total, longest, shortest = size_1 + size_2, max(size_1, size_2), min(size_1, size_2)
    reach = longest - 1 if max_lag is None else max_lag
    lags = _lag_count(size_1, size_2, reach)
    chosen = algorithm(size_1, size_2, method, reach)
    if chosen == "blocks":
        return _estimate_blocks(size_1, size_2, lags)
    if chosen == "bands":
        step = cell_size(size_1, size_2)
        points, around = total // step, _estimate_blocks(SHORTEST_BLOCK, SHORTEST_BLOCK, 16 * AROUND)
        return COSTS["lag by bands"].estimate(
            samples=total,
            longest=longest,
            points=points,
            turns=step // 2 * points * math.log2(points),
            cells=lags // step + 2,
            blocks=around.memory,
        )
    points = transform_length(longest)
    sorted_or_transformed = longest if method == "sampled" else points
    row = {"sampled": "lag by votes", "direct": "lag by products"}.get(method, "lag by fft")
    return COSTS[row].estimate(
        samples=total,
        longest=longest,
        shortest=shortest,
        lags=lags,
        ties=min(lags, longest),
        points=points,
        turns=sorted_or_transformed * math.log2(sorted_or_transformed),
        products=product_count(size_1, size_2, reach),
    )


def algorithm(size_1: int, size_2: int, method: SignalMethod, reach: int) -> Algorithm:
    """Return how recordings of these sizes are searched, for lags up to `reach` both ways."""
    longest = max(size_1, size_2)
    if method != "fft":
        return "whole"
    if suits_blocks(longest, _lag_count(size_1, size_2, reach)):
        return "blocks"
    return "whole" if longest <= LONGEST_WHOLE else "bands"


def _lag_count(size_1: int, size_2: int, reach: int) -> int:
    return min(reach, size_1 - 1) + min(reach, size_2 - 1) + 1


def _estimate_blocks(size_1: int, size_2: int, lags: int) -> Estimate:
    points = block_length(lags)
    blocks = -(-min(size_1, size_2) // (points - lags + 1))
    return COSTS["lag by blocks"].estimate(
        samples=size_1 + size_2,
        longest=max(size_1, size_2),
        points=points,
        turns=blocks * points * math.log2(points),
    )


def product_count(size_1: int, size_2: int, reach: int) -> int:
    """Return the number of sample pairs that overlap, over all lags up to `reach` both ways."""

    def of_one_sign(first: int, second: int) -> int:
        """Sum ``min(first, second - lag)`` over the lags from 0 on."""
        count = min(reach, second - 1) + 1
        whole = min(count, max(0, second - first + 1))
        rest = count - whole
        return whole * first + rest * second - (whole + count - 1) * rest // 2

    return of_one_sign(size_1, size_2) + of_one_sign(size_2, size_1) - min(size_1, size_2)
