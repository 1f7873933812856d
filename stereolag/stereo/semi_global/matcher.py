"""Semi-global matching: the settings, and the stages from the cost volume to the finished map."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Annotated

import cv2
import numpy as np
import numpy.typing as npt
from pydantic import Field, field_validator

from stereolag.core.arrays import EightBit, Mask, ReasonMap
from stereolag.core.inputs import Image, as_eight_bit, as_grey, check_window, local_deviation, rescale_extreme_floats
from stereolag.core.jobs import COSTS, Estimate, Progress
from stereolag.core.settings import FitsImage, Pixels, odd
from stereolag.loops.bands import over_bands
from stereolag.loops.vector_lanes import lanes_for
from stereolag.stereo.finishing.stages import (
    Ambiguity,
    Filling,
    LeftRight,
    Median,
    Speckle,
    Surfaces,
    Texture,
    finished,
    least_texture,
    left_right_disagree,
)
from stereolag.stereo.matcher import MinDisparity, NumDisparities, PixelMatches, Reason, StereoMatcher, grey_bytes
from stereolag.stereo.semi_global.cost import MatchingCost, matching_cost
from stereolag.stereo.semi_global.ends import peaks_at_end
from stereolag.stereo.semi_global.optimisation import (
    PATHS,
    CheapestLags,
    SemiGlobal,
    cell_size,
    cheapest_lags,
    optimise,
    place_valleys,
)

BYTES_PER_CELL = 3
"""Bytes per pixel and lag: one for the cost and two for the path costs."""

MAX_VOLUME_BYTES = 460 * 2**20
"""Size above which a volume is processed in strips of rows."""

COST_SHARE, PATHS_SHARE = 0.3, 0.5
"""Shares of a strip's time spent on costs and on paths."""

OVERLAP = 24
"""Rows that a strip reads beyond its own at either end, so that paths have settled where its own rows begin."""


def strips(height: int, row_bytes: int) -> Iterator[tuple[int, int]]:
    """Yield (first, end) of strips of rows, each small enough for its volume to fit in MAX_VOLUME_BYTES."""
    whole = height * row_bytes <= MAX_VOLUME_BYTES
    rows = height if whole else max(1, MAX_VOLUME_BYTES // row_bytes - 2 * OVERLAP)
    for first in range(0, height, rows):
        yield first, min(height, first + rows)


FEATURE_BYTES_PER_PX = 66
"""Bytes per pixel while the features of both images are computed."""


class SemiGlobalMatcher(StereoMatcher):
    """Matcher that weighs each match against its neighbours' along eight paths, instead of taking each pixel's best.

    H. Hirschmüller, "Stereo processing by semiglobal matching and mutual information", 2008, with a cost that combines
    window correlation, census and gradient. The later stages are off by default; :func:`stereolag.preset` turns them
    on.

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
    is_compiled = True
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
    texture: Texture = None
    ambiguity: Ambiguity = None
    left_right: LeftRight = None
    speckle: Speckle = None
    filling: Filling = False
    surfaces: Surfaces = None
    median: Median = None

    _odd = field_validator("window_size")(odd)

    def estimate(self, shape: tuple[int, ...], dtype: npt.DTypeLike = np.uint8) -> Estimate:
        """Return the memory and time of :meth:`compute` for images of a shape (rows, cols[, channels]) and dtype."""
        (height, width), pixels = shape[:2], shape[0] * shape[1]
        lags = width * lanes_for(self.num_disparities)
        _, own = next(strips(height, lags * BYTES_PER_CELL))
        strip = min(height, own + 2 * OVERLAP)
        features = FEATURE_BYTES_PER_PX * (width + self.num_disparities) + lags
        return COSTS["semi-global"].estimate(
            grey=grey_bytes(shape, dtype),
            pixels=pixels,
            # The matches of a strip, with the rows shared with its neighbours, are kept until all strips are joined.
            matches=pixels * strip / own,
            fronts=(width + strip + 2) * cell_size(self.num_disparities),
            strip=strip * max(BYTES_PER_CELL * lags, features),
            cells=lags * height * strip / own,
        )

    def match(self, left: Image, right: Image, progress: Progress) -> PixelMatches:
        """Match the images as 8-bit grey, then check, filter and fill.

        The score is 1 minus the summed cost of the eight paths, as a share of eight times the highest matching cost; 0
        where penalties push the sum beyond that.
        """
        check_window(self.window_size, left.shape)
        grey = rescale_extreme_floats(as_grey(left), as_grey(right))
        levels = as_eight_bit(*grey)
        found = self.cheapest_lags(*levels, progress)
        highest, ends = PATHS * self.cost.highest, (0, self.num_disparities - 1)
        reason, offset = self._reasons(found, highest), np.zeros(found.lag.shape, np.float32)
        disparity, score = np.empty_like(offset), np.empty_like(offset)
        for end in set(ends):
            # Disparity 0 is infinity: a physical limit, not an edge of the search.
            is_edge = end > 0 or self.min_disparity != 0
            fits = reason != np.uint8(Reason.OUT_OF_FRAME) if is_edge else reason == np.uint8(Reason.MEASURED)
            at_end = (found.lag == end) & fits
            inside, end_offset = peaks_at_end(*levels, self.window_size, self.min_disparity + end, at_end)
            offset += end_offset
            if is_edge:
                np.copyto(reason, np.uint8(Reason.AT_SEARCH_EDGE), where=at_end & ~inside)
        np.copyto(reason, np.uint8(Reason.LOW_TEXTURE), where=self._flat(grey))
        over_bands(
            lambda first, end: place_valleys(
                found, reason, ends, self.min_disparity, highest, first, end, offset, disparity, score
            ),
            len(reason),
        )
        return finished(PixelMatches(disparity, reason, score), left, right, self)

    def cheapest_lags(self, left: EightBit, right: EightBit, progress: Progress) -> CheapestLags:
        """Return the cheapest lags of every pixel of the left image; lag k is the disparity ``min_disparity + k``.

        The volumes take 3 bytes per pixel and lag, at most 460 MB: larger images are matched in overlapping strips.
        """
        height, width = left.shape
        parts = []
        for first, end in strips(height, width * lanes_for(self.num_disparities) * BYTES_PER_CELL):
            top = max(0, first - OVERLAP)
            rows = slice(top, end + OVERLAP)

            def within(done: float, first: int = first, end: int = end) -> None:
                progress((first + done * (end - first)) / height)

            found = self._of_strip(left[rows], right[rows], within)
            parts.append([values[..., first - top : end - top, :] for values in found])
        joined = parts[0] if len(parts) == 1 else [np.concatenate(maps, axis=-2) for maps in zip(*parts, strict=True)]
        return CheapestLags(*joined)

    def _of_strip(self, left: EightBit, right: EightBit, progress: Progress) -> CheapestLags:
        costs = matching_cost(
            left,
            right,
            window_size=self.window_size,
            min_disparity=self.min_disparity,
            num_disparities=self.num_disparities,
            settings=self.cost,
        )
        progress(COST_SHARE)
        sums = optimise(costs, left, self.optimisation, lambda done: progress(COST_SHARE + PATHS_SHARE * done))
        found = cheapest_lags(sums, self.min_disparity, self.num_disparities, runner_up=self.ambiguity is not None)
        progress(1.0)
        return found

    def _flat(self, grey: tuple[Image, Image]) -> Mask:
        """Return the mask of pixels whose window in the left image has too little texture to match."""
        if self.texture is not None or grey[0].dtype != np.uint8:
            return local_deviation(grey[0], self.window_size) <= least_texture(self.texture, *grey)
        # Without a test only windows of one level are flat; in uint8 images they are found much faster.
        element, border = np.ones((self.window_size, self.window_size), np.uint8), cv2.BORDER_REFLECT_101
        lowest = cv2.erode(grey[0], element, borderType=border)
        return np.asarray(lowest == cv2.dilate(grey[0], element, borderType=border))

    def _reasons(self, found: CheapestLags, highest: int) -> ReasonMap:
        """Return the reason of every pixel: MEASURED, or why its match is rejected."""
        first, lag = np.int16(self.min_disparity), found.lag
        reason: ReasonMap = np.zeros(lag.shape, np.uint8)
        dx = -first - lag
        if self.left_right is not None:
            disagree = left_right_disagree(dx, -first - found.right_lag, self.left_right.tolerance)
            reason = disagree.view(np.uint8) * np.uint8(Reason.LEFT_RIGHT)  # MEASURED is 0
        if self.ambiguity is not None:
            lead = found.runner_up - found.around[1]
            ambiguous = (found.runner_up >= 0) & (lead < round(self.ambiguity.lead * highest))
            reason = np.where(ambiguous, np.uint8(Reason.AMBIGUOUS), reason)
        place = np.arange(lag.shape[1], dtype=np.int16) + dx
        outside = place.view(np.uint16) >= lag.shape[1]  # negative numbers become large
        np.copyto(reason, np.uint8(Reason.OUT_OF_FRAME), where=outside)
        return reason
