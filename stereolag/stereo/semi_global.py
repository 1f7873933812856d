"""Matching by cost volume and semi-global optimisation, strip by strip."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from stereolag.kernels.cheapest_lag import NO_RIGHT_MATCH, CheapestLags, cheapest_lags
from stereolag.progress import Progress
from stereolag.stereo.costs import MatchingCost, matching_cost
from stereolag.stereo.optimisation import SemiGlobal, optimise
from stereolag.stereo.selection import valley_offset

BYTES_OF_A_CELL = 5
"""One of cost and twice two of path costs, for every pixel and lag."""

MOST_BYTES = 768 * 2**20
"""A larger volume is worked on in strips of rows."""

COST_SHARE, PATHS_SHARE = 0.3, 0.5
"""Shares of a strip's time that its costs and its paths take."""

OVERLAP = 24
"""Rows that a strip sees beyond its own, so that paths have settled where its answer begins."""


@dataclass(frozen=True)
class VolumeMatches:
    """The best match of every pixel of the left image, each (H, W).

    Attributes
    ----------
    dx
        int16 displacement, right minus left, px.
    disparity
        float32 disparity with its sub-pixel part, px.
    lowest, runner_up
        int32 summed path cost of the match, and the least among lags farther than one from it; -1 where there is none.
    right_dx
        int16 displacement of the best left partner of the right image's pixel from there; -32768 where it has none.
    """

    dx: npt.NDArray[np.int16]
    disparity: npt.NDArray[np.float32]
    lowest: npt.NDArray[np.int32]
    runner_up: npt.NDArray[np.int32]
    right_dx: npt.NDArray[np.int16]


class Strip(NamedTuple):
    """Rows `first` to `end` of the answer, computed from rows `top` to `bottom` of the images."""

    top: int
    first: int
    end: int
    bottom: int


def strips(height: int, bytes_of_a_row: int) -> Iterator[Strip]:
    """Yield strips of rows that cover the picture, each small enough for its volume to fit MOST_BYTES."""
    rows = max(1, MOST_BYTES // bytes_of_a_row - 2 * OVERLAP)
    if height * bytes_of_a_row <= MOST_BYTES:
        rows = height
    for first in range(0, height, rows):
        end = min(height, first + rows)
        yield Strip(max(0, first - OVERLAP), first, end, min(height, end + OVERLAP))


def match_semi_global(
    left: npt.NDArray[np.uint8],
    right: npt.NDArray[np.uint8],
    *,
    window_size: int,
    min_disparity: int,
    num_disparities: int,
    cost: MatchingCost,
    optimisation: SemiGlobal,
    progress: Progress,
) -> VolumeMatches:
    """Match every pixel: matching cost, semi-global optimisation, selection, sub-pixel offset.

    Parameters
    ----------
    left, right
        (H, W) uint8.
    window_size
        Side of the correlation's window, px.
    min_disparity, num_disparities
        The disparities tried, px.
    cost, optimisation
        The settings of the stages.
    progress
        Called with the fraction done.

    Notes
    -----
    The volumes take 5 bytes a pixel and lag, of at most 768 MB: larger pictures are matched in overlapping strips.
    """
    height, width = left.shape
    parts: list[CheapestLags] = []
    for strip in strips(height, width * num_disparities * BYTES_OF_A_CELL):

        def within(done: float, strip: Strip = strip) -> None:
            progress((strip.first + done * (strip.end - strip.first)) / height)

        rows = slice(strip.top, strip.bottom)
        found = _match_strip(
            left[rows], right[rows], window_size, min_disparity, num_disparities, cost, optimisation, within
        )
        parts.append(_rows_of(found, slice(strip.first - strip.top, strip.end - strip.top)))
    return _joined(parts, min_disparity)


def _match_strip(
    left: npt.NDArray[np.uint8],
    right: npt.NDArray[np.uint8],
    window_size: int,
    min_disparity: int,
    num_disparities: int,
    cost: MatchingCost,
    optimisation: SemiGlobal,
    progress: Progress,
) -> CheapestLags:
    costs = matching_cost(
        left,
        right,
        window_size=window_size,
        min_disparity=min_disparity,
        num_disparities=num_disparities,
        settings=cost,
    )
    progress(COST_SHARE)
    sums = optimise(costs, left, optimisation, lambda done: progress(COST_SHARE + PATHS_SHARE * done))
    found = cheapest_lags(*sums, min_disparity)
    progress(1.0)
    return found


def _rows_of(found: CheapestLags, rows: slice) -> CheapestLags:
    return CheapestLags(found.lag[rows], found.around[:, rows], found.runner_up[rows], found.right_lag[rows])


def _joined(parts: list[CheapestLags], min_disparity: int) -> VolumeMatches:
    lag, runner_up, right_lag = (
        np.concatenate([getattr(part, name) for part in parts]) for name in ("lag", "runner_up", "right_lag")
    )
    before, lowest, after = np.concatenate([part.around for part in parts], axis=1)
    seen = right_lag != NO_RIGHT_MATCH
    return VolumeMatches(
        dx=(-min_disparity - lag).astype(np.int16),
        disparity=lag + valley_offset(before, lowest, after) + np.float32(min_disparity),
        lowest=lowest,
        runner_up=runner_up,
        right_dx=np.where(seen, -min_disparity - right_lag, NO_RIGHT_MATCH).astype(np.int16),
    )
