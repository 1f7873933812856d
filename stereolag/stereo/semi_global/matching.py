"""Matching with a cost volume, strip by strip: cost, optimisation, selection and sub-pixel fit."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from stereolag.core.arrays import FloatMap
from stereolag.core.jobs import Progress
from stereolag.stereo.semi_global.cost_volume import matching_cost
from stereolag.stereo.semi_global.costs import MatchingCost
from stereolag.stereo.semi_global.paths import SemiGlobal, optimise
from stereolag.stereo.semi_global.selection import cheapest_lags, valley_offset

BYTES_OF_A_CELL = 3
"""Bytes per pixel and lag: one for the cost and two for the path costs."""

MOST_BYTES = 460 * 2**20
"""A larger volume is processed in strips of rows."""

COST_SHARE, PATHS_SHARE = 0.3, 0.5
"""Shares of a strip's time spent on costs and on paths."""

OVERLAP = 24
"""Rows that a strip reads beyond its own, so that paths have settled where its own rows begin."""


@dataclass(frozen=True, eq=False)
class VolumeQuery:
    """Query of semi-global matching: image pair, range of disparities, and settings.

    Attributes
    ----------
    left, right
        (H, W) uint8.
    window_size
        Side of the correlation window, px; odd.
    min_disparity, num_disparities
        The disparities tried, px: lag k is the disparity ``min_disparity + k``.
    cost, optimisation
        The settings of the stages.
    """

    left: npt.NDArray[np.uint8]
    right: npt.NDArray[np.uint8]
    window_size: int
    min_disparity: int
    num_disparities: int
    cost: MatchingCost
    optimisation: SemiGlobal


class VolumeMatches(NamedTuple):
    """Best match of every pixel of the left image; each field is (H, W)."""

    lag: npt.NDArray[np.int16]
    """Index of the cheapest lag."""
    offset: FloatMap
    """float32 offset of the valley from the cheapest lag, -0.5..0.5."""
    lowest: npt.NDArray[np.int32]
    """Summed path cost of the match."""
    runner_up: npt.NDArray[np.int32]
    """Lowest cost among lags more than one away from it; -1 if there is none."""
    right_lag: npt.NDArray[np.int16]
    """Index of the cheapest lag of the right image's pixel; -32768 if it has none."""

    def rows(self, rows: slice) -> VolumeMatches:
        """Return the matches of some rows."""
        lag, offset, lowest, runner_up, right_lag = self
        return VolumeMatches(lag[rows], offset[rows], lowest[rows], runner_up[rows], right_lag[rows])


class Strip(NamedTuple):
    """Rows `first` to `end` of the map, computed from rows `top` to `bottom` of the images."""

    top: int
    first: int
    end: int
    bottom: int


def match_semi_global(query: VolumeQuery, progress: Progress) -> VolumeMatches:
    """Match every pixel of the left image.

    The volumes take 3 bytes per pixel and lag, at most 460 MB: larger images are matched in overlapping strips.
    """
    height, width = query.left.shape
    parts: list[VolumeMatches] = []
    for strip in strips(height, width * query.num_disparities * BYTES_OF_A_CELL):

        def within(done: float, strip: Strip = strip) -> None:
            progress((strip.first + done * (strip.end - strip.first)) / height)

        found = _match_strip(query, slice(strip.top, strip.bottom), within)
        own = slice(strip.first - strip.top, strip.end - strip.top)
        parts.append(found.rows(own))
    return parts[0] if len(parts) == 1 else VolumeMatches(*map(np.concatenate, zip(*parts, strict=True)))


def strips(height: int, bytes_of_a_row: int) -> Iterator[Strip]:
    """Yield strips of rows that cover the image, each small enough for its volume to fit in MOST_BYTES."""
    rows = max(1, MOST_BYTES // bytes_of_a_row - 2 * OVERLAP)
    if height * bytes_of_a_row <= MOST_BYTES:
        rows = height
    for first in range(0, height, rows):
        end = min(height, first + rows)
        yield Strip(max(0, first - OVERLAP), first, end, min(height, end + OVERLAP))


def _match_strip(query: VolumeQuery, rows: slice, progress: Progress) -> VolumeMatches:
    left = query.left[rows]
    costs = matching_cost(
        left,
        query.right[rows],
        window_size=query.window_size,
        min_disparity=query.min_disparity,
        num_disparities=query.num_disparities,
        settings=query.cost,
    )
    progress(COST_SHARE)
    sums = optimise(costs, left, query.optimisation, lambda done: progress(COST_SHARE + PATHS_SHARE * done))
    found = cheapest_lags(sums, query.min_disparity)
    progress(1.0)
    return VolumeMatches(found.lag, valley_offset(*found.around), found.around[1], found.runner_up, found.right_lag)
