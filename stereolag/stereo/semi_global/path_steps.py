"""One step of the semi-global paths, from a pixel's neighbours to the pixel, sixteen lags at once."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from stereolag.core.arrays import Array
from stereolag.loops.compilation import compiled
from stereolag.loops.vector_lanes import LANES, cast, load, smaller, smallest, splat, store


class PathStep(NamedTuple):
    """Values that extend one path from a pixel to the next."""

    before: np.uint64
    """Start of the previous pixel's cell."""
    here: np.uint64
    least: np.uint16
    """Lowest cost at the previous pixel."""
    jump: np.uint16
    """`least` plus the large penalty."""


@compiled
def _carry(paths: Array, step: PathStep, lag: Any, cost: Any, small: Any) -> Any:
    """Extend one path at sixteen lags, and return their costs."""
    one, two = np.uint64(1), np.uint64(2)
    beside = smaller(load(paths, step.before + lag), load(paths, step.before + lag + two)) + small
    best = smaller(smaller(load(paths, step.before + lag + one), beside), splat(step.jump, np.uint16))
    carried = best - splat(step.least, np.uint16) + cost
    store(paths, step.here + lag + one, carried)
    return carried


@compiled
def _carry_one(paths: Array, step: PathStep, lag: Any, cost: Any, small: Any) -> Any:
    """Extend one path at one lag, and return its cost; for the lags left over from the strips of sixteen."""
    one, two = np.uint64(1), np.uint64(2)
    beside = np.uint16(min(paths[step.before + lag], paths[step.before + lag + two]) + small)
    best = min(min(paths[step.before + lag + one], beside), step.jump)
    carried = np.uint16(np.uint16(best - step.least) + cost)
    paths[step.here + lag + one] = carried
    return carried


@compiled
def advance(
    paths: Array,
    costs: Array,
    sums: Array,
    adds: bool,
    place: np.uint64,
    lags: np.uint64,
    small: np.uint16,
    along: PathStep,
    first: PathStep,
    second: PathStep,
    third: PathStep,
) -> tuple[np.uint16, np.uint16, np.uint16, np.uint16]:
    """Extend four paths at the lags at `place` of the volume, and return the lowest cost of each path.

    Extending all four at once reads each cost and writes each sum only once. The sums are set, or added to if `adds`.
    """
    strip = np.uint64(LANES)
    full = lags - lags % strip
    small_lanes, most = splat(small, np.uint16), splat(65535, np.uint16)
    least_0, least_1, least_2, least_3 = most, most, most, most
    for lag in range(np.uint64(0), full, strip):
        cost = cast(load(costs, place + lag), np.uint16)
        cost_0 = _carry(paths, along, lag, cost, small_lanes)
        cost_1 = _carry(paths, first, lag, cost, small_lanes)
        cost_2 = _carry(paths, second, lag, cost, small_lanes)
        cost_3 = _carry(paths, third, lag, cost, small_lanes)
        least_0, least_1 = smaller(least_0, cost_0), smaller(least_1, cost_1)
        least_2, least_3 = smaller(least_2, cost_2), smaller(least_3, cost_3)
        four = (cost_0 + cost_1) + (cost_2 + cost_3)
        store(sums, place + lag, four + load(sums, place + lag) if adds else four)
    low_0, low_1, low_2, low_3 = smallest(least_0), smallest(least_1), smallest(least_2), smallest(least_3)
    for lag in range(full, lags):
        one_cost = np.uint16(costs[place + lag])
        one_0 = _carry_one(paths, along, lag, one_cost, small)
        one_1 = _carry_one(paths, first, lag, one_cost, small)
        one_2 = _carry_one(paths, second, lag, one_cost, small)
        one_3 = _carry_one(paths, third, lag, one_cost, small)
        low_0, low_1, low_2, low_3 = min(low_0, one_0), min(low_1, one_1), min(low_2, one_2), min(low_3, one_3)
        one_four = np.uint16(np.uint16(one_0 + one_1) + np.uint16(one_2 + one_3))
        sums[place + lag] = np.uint16(one_four + sums[place + lag]) if adds else one_four
    return low_0, low_1, low_2, low_3
