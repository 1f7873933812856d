"""Semi-global matching: the settings, and the sequence of stages from the cost volume to the finished map."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Annotated, NamedTuple

import numpy as np
import numpy.typing as npt
from pydantic import Field, field_validator

from stereolag.core.arrays import FloatMap, ReasonMap
from stereolag.core.inputs import Image, as_eight_bit, as_grey, local_deviation, rescale_extreme_floats
from stereolag.core.jobs import COSTS, Estimate, Progress
from stereolag.core.settings import FitsImage, Pixels
from stereolag.stereo.finishing.checks import (
    AmbiguityTest,
    LeftRightCheck,
    TextureTest,
    ambiguous,
    least_texture,
    left_right_disagree,
)
from stereolag.stereo.finishing.stages import Filling, Median, Speckle, Surfaces, finished
from stereolag.stereo.matcher import MinDisparity, NumDisparities, PixelMatches, Reason, StereoMatcher, grey_bytes
from stereolag.stereo.semi_global.cost_terms import MatchingCost
from stereolag.stereo.semi_global.cost_volume import matching_cost
from stereolag.stereo.semi_global.paths import PATHS, SemiGlobal, optimise
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


FEATURES = 66
"""Bytes per pixel while the features of both images are computed."""


class SemiGlobalMatcher(StereoMatcher):
    """Matcher that weighs each match against its neighbours' along eight paths, instead of taking each pixel's best.

    H. Hirschmüller, "Stereo processing by semiglobal matching and mutual information", 2008, with a cost that combines
    window correlation, census and gradient. The later stages are off by default; :func:`stereolag.preset` returns
    matchers with them on.

    Examples
    --------
    >>> import numpy as np
    >>> import stereolag as sl
    >>> left = np.random.default_rng(0).integers(0, 256, (60, 100), dtype=np.uint8)
    >>> right = np.roll(left, -5, axis=1)  # disparity 5 px
    >>> result = sl.SemiGlobalMatcher(window_size=9, num_disparities=16).compute(left, right)
    >>> round(float(np.nanmedian(result.disparity)), 1)  # px
    5.0
    """

    title = "Semi-global"
    short_name = "sgm"
    first_shown = ("window_size", "num_disparities", "min_disparity", "optimisation")

    window_size: Annotated[int, Pixels(), FitsImage()] = Field(
        default=9,
        title="Window",
        description="Side of the correlation's window, px; odd, so that a pixel is its middle.",
        ge=3,
        le=255,
        json_schema_extra={"step": 2},
    )
    num_disparities: NumDisparities = 64
    min_disparity: MinDisparity = 0
    cost: MatchingCost = Field(
        default=MatchingCost(),
        title="Matching cost",
        description="Cost of a match: the sum of correlation, census and gradient.",
    )
    optimisation: SemiGlobal = Field(
        default=SemiGlobal(),
        title="Semi-global optimisation",
        description="Cost of a change of disparity between neighbours.",
    )
    texture: TextureTest | None = Field(
        default=None, title="Texture test", description="Give no disparity where a window has too little texture."
    )
    ambiguity: AmbiguityTest | None = Field(
        default=None, title="Ambiguity test", description="Give no disparity where another one fits nearly as well."
    )
    left_right: LeftRightCheck | None = Field(
        default=None, title="Left-right check", description="Give no disparity where the right image's match disagrees."
    )
    speckle: Speckle = None
    filling: Filling = False
    surfaces: Surfaces = None
    median: Median = None

    @field_validator("window_size")
    @classmethod
    def _odd(cls, value: int) -> int:
        if value % 2 == 0:
            raise ValueError(f"window_size is {value}; allowed are odd sizes, so that a pixel is the window's middle.")
        return value

    def estimate(self, shape: tuple[int, ...], dtype: npt.DTypeLike = np.uint8) -> Estimate:
        """Return the memory and time of :meth:`compute` for images of a shape (rows, cols[, channels]) and dtype."""
        (height, width), pixels = shape[:2], shape[0] * shape[1]
        first = next(strips(height, width * self.num_disparities * BYTES_OF_A_CELL))
        own, strip = first.end, min(height, first.end + 2 * OVERLAP)
        lags = width * self.num_disparities
        features = FEATURES * (width + self.num_disparities) + lags
        return COSTS["semi-global"].estimate(
            grey=grey_bytes(shape, dtype),
            pixels=pixels,
            # The matches of a strip, with the rows shared with its neighbours, are kept until all strips are joined.
            matches=pixels * strip / own,
            fronts=(width + 2) * (self.num_disparities + 2),
            strip=strip * max(BYTES_OF_A_CELL * lags, features),
            cells=lags * height * strip / own,
        )

    def match(self, left: Image, right: Image, progress: Progress) -> PixelMatches:
        """Match the images as 8-bit grey, then check, filter and fill.

        The score is 1 minus the summed cost of the eight paths, as a share of eight times the highest matching cost; 0
        where penalties push the sum beyond that.
        """
        if self.window_size > min(left.shape[:2]):
            raise ValueError(
                f"window_size is {self.window_size} px and the images are {left.shape[1]} × {left.shape[0]}; "
                "the window must fit into them."
            )
        grey = rescale_extreme_floats(as_grey(left), as_grey(right))
        query = VolumeQuery(
            *as_eight_bit(*grey),
            self.window_size,
            self.min_disparity,
            self.num_disparities,
            self.cost,
            self.optimisation,
        )
        matches = match_semi_global(query, progress)
        highest = PATHS * self.cost.highest
        reason = self._reasons(matches, highest)
        flat = least_texture(self.texture, *grey)
        reason[local_deviation(grey[0], self.window_size) <= flat] = Reason.LOW_TEXTURE
        disparity = np.where(
            reason == Reason.MEASURED,
            matches.lag + matches.offset + np.float32(self.min_disparity),
            np.float32(np.nan),
        )
        score = np.clip(1 - matches.lowest / np.float32(highest), 0, 1).astype(np.float32)
        return finished(PixelMatches(disparity, reason, score), left, right, self)

    def _reasons(self, matches: VolumeMatches, highest: int) -> ReasonMap:
        """Return the reason of every pixel: MEASURED, or why its match is rejected."""
        first, lag = self.min_disparity, matches.lag
        reason = np.full(lag.shape, Reason.MEASURED, dtype=np.uint8)
        dx = np.int32(-first) - lag
        if self.left_right is not None:
            right_dx = np.int32(-first) - matches.right_lag
            reason[left_right_disagree(dx, right_dx, self.left_right.tolerance)] = Reason.LEFT_RIGHT
        if self.ambiguity is not None:
            lead = round(self.ambiguity.lead * highest)
            reason[ambiguous(matches.lowest, matches.runner_up, lead)] = Reason.AMBIGUOUS
        # Disparity 0 is infinity: a physical limit, not an edge of the search.
        reason[(lag == self.num_disparities - 1) | ((lag == 0) & (first != 0))] = Reason.AT_SEARCH_EDGE
        match = np.arange(lag.shape[1], dtype=np.int32) + dx
        reason[(match < 0) | (match >= lag.shape[1])] = Reason.OUT_OF_FRAME
        return reason
