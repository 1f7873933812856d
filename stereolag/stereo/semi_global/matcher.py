"""Semi-global matching: the settings, and the sequence of stages from the cost volume to the finished map."""

from __future__ import annotations

from typing import Annotated

import numpy as np
import numpy.typing as npt
from pydantic import Field, field_validator

from stereolag.core.arrays import ReasonMap
from stereolag.core.inputs import Image, as_eight_bit, as_grey, local_deviation, of_ordinary_size
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
from stereolag.stereo.matcher import MinDisparity, NumDisparities, PixelMatches, StereoMatcher, grey_bytes
from stereolag.stereo.reasons import Reason
from stereolag.stereo.semi_global.costs import MatchingCost
from stereolag.stereo.semi_global.matching import (
    BYTES_OF_A_CELL,
    OVERLAP,
    VolumeMatches,
    VolumeQuery,
    match_semi_global,
    strips,
)
from stereolag.stereo.semi_global.paths import PATHS, SemiGlobal

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
        grey = of_ordinary_size(as_grey(left), as_grey(right))
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
