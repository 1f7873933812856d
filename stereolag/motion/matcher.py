"""Optical flow by windowed correlation: the settings, and the computation from pyramid to finished flow."""

from __future__ import annotations

import time
from typing import Annotated

import numpy as np
import numpy.typing as npt
from pydantic import Field, field_validator

from stereolag.core.arrays import FloatMap, Mask, ReasonMap
from stereolag.core.inputs import Image, as_eight_bit, as_grey, as_image_pair, grey_level, of_ordinary_size
from stereolag.core.jobs import COSTS, Estimate, Progress, check_memory, silent
from stereolag.core.settings import FitsImage, OfThePair, Pixels, Settings, Usual
from stereolag.motion.candidates import NO_SCORE
from stereolag.motion.checks import ForwardBackwardCheck, MedianTest, median_residual
from stereolag.motion.descent import Descent, View
from stereolag.motion.pyramid import Flow, Frame, count_levels, leaves_frame, pyramid
from stereolag.motion.refinement import VariationalRefinement
from stereolag.motion.result import FlowMap
from stereolag.stereo.finishing.checks import TextureTest, least_texture
from stereolag.stereo.finishing.filters import MedianFilter
from stereolag.stereo.reasons import Reason

WINDOW, SEARCH = 7, 128
"""Defaults, px."""


class FlowMatcher(Settings):
    """Matcher that finds the window around every pixel of one frame in the next one, coarse to fine.

    At the coarsest level of a pyramid every lag within reach is tried; at each finer level the second frame is warped
    along the flow so far and a residual of a few px is searched, with sub-pixel precision. Between levels the flow is
    averaged over surfaces bounded by image edges, giving more weight to matches that lead back to their start.
    """

    window_size: Annotated[int, Pixels(), FitsImage()] = Field(
        default=WINDOW,
        title="Window",
        description="Side of the square window that is compared at every level, px; odd, so that a pixel is its "
        "middle. Large windows are reliable but blur edges, small ones are sharp but easily fooled.",
        ge=3,
        le=255,
        json_schema_extra={"step": 2},
    )
    search: Annotated[int, Pixels(rounded_up=True), OfThePair(), Usual(high=256)] = Field(
        default=SEARCH,
        title="Search",
        description="How far a pixel may have moved in any direction, px.",
        ge=1,
        le=1024,
    )
    levels: int = Field(
        default=5,
        title="Levels",
        description="Most levels of the pyramid, each half the size of the one before: 1 searches everything at full "
        "size. Fewer are used where the frames or the search are too small for them.",
        ge=1,
        le=8,
    )
    texture: TextureTest | None = Field(
        default=None, title="Texture test", description="Give no motion where a window has too little texture."
    )
    forward_backward: ForwardBackwardCheck | None = Field(
        default=ForwardBackwardCheck(),
        title="Forward-backward check",
        description="Give no motion where matching back from the second frame ends elsewhere.",
    )
    median_test: MedianTest | None = Field(
        default=MedianTest(), title="Median test", description="Give no motion where it differs from its surroundings."
    )
    median: MedianFilter | None = Field(
        default=MedianFilter(),
        title="Edge-respecting median",
        description="Smooth the flow between the levels where the image is smooth, and only there.",
    )
    refinement: VariationalRefinement | None = Field(
        default=VariationalRefinement(),
        title="Variational refinement",
        description="Refine the motion to fractions of a pixel using grey levels and gradients.",
    )
    filling: bool = Field(
        default=False,
        title="Fill gaps",
        description="Fill pixels that could not be measured with the motion of the same surface.",
    )

    @field_validator("window_size")
    @classmethod
    def _odd(cls, value: int) -> int:
        if value % 2 == 0:
            raise ValueError(f"window_size is {value}; it must be odd.")
        return value

    def compute(self, first: npt.ArrayLike, second: npt.ArrayLike, *, progress: Progress | None = None) -> FlowMap:
        """Find every pixel of the first frame in the second one.

        Parameters
        ----------
        first, second
            (H, W), (H, W, 3) or (H, W, 4) images of one size and type: uint8, uint16 or float.
        progress
            Called with the fraction done, 0..1.

        Raises
        ------
        ValueError
            If the images differ in size or type, contain NaN, are smaller than the window, or need more memory than one
            job may take.
        """
        images = as_image_pair(first, second, ("first", "second"))
        rows, cols = images[0].shape[:2]
        if self.window_size > min(rows, cols):
            raise ValueError(
                f"window_size is {self.window_size} px and the frames are {cols} × {rows}; "
                "the window must fit into them."
            )
        check_memory(self.estimate(images[0].shape, images[0].dtype))
        start = time.perf_counter()
        flow, score, reason = self._match(*images, progress or silent)
        return FlowMap(flow[0], flow[1], score, reason, elapsed_s=time.perf_counter() - start, settings=self)

    def estimate(self, shape: tuple[int, ...], dtype: npt.DTypeLike = np.uint8) -> Estimate:
        """Return the memory and time of :meth:`compute` for frames of a shape, with or without channels, and dtype."""
        pixels = shape[0] * shape[1]
        return COSTS["flow"].estimate(pixels=pixels, doubles=pixels * (np.dtype(dtype) != np.uint8))

    def _match(self, first: Image, second: Image, progress: Progress) -> tuple[Flow, FloatMap, ReasonMap]:
        grey = of_ordinary_size(as_grey(first), as_grey(second))
        guides = as_eight_bit(*grey)
        shape = grey[0].shape[0], grey[0].shape[1]
        levels = count_levels(shape, self.window_size, self.search, self.levels)
        frames = [pyramid(Frame(*one), levels) for one in zip(grey, guides, strict=True)]
        descent = Descent(self.window_size, self.search, self.median, self.refinement, grey_level(*grey))
        view = descent.descend(frames[0], frames[1], progress)
        return self._judged(view, least_texture(self.texture, *grey))

    def _judged(self, view: View, flat: float) -> tuple[Flow, FloatMap, ReasonMap]:
        """Return the flow without unreliable displacements, its scores, and the reasons."""
        score = view.candidates.score
        reason = np.full(score.shape, Reason.MEASURED, np.uint8)
        tests: list[tuple[Mask, Reason]] = []
        if self.median_test is not None:
            spacing = max(1, self.window_size // 2)
            residual = median_residual(view.candidates.flow, spacing, self.median_test.noise)
            tests.append((residual > self.median_test.threshold, Reason.SPECKLE))
        if self.forward_backward is not None:
            tests.append((view.error > self.forward_backward.tolerance, Reason.LEFT_RIGHT))
        tests.append((leaves_frame(view.flow), Reason.OUT_OF_FRAME))
        tests.append((view.candidates.texture <= flat, Reason.LOW_TEXTURE))
        for where, why in tests:
            reason[where] = why
        missing = reason != Reason.MEASURED
        score = np.where(missing | (score == NO_SCORE), np.float32(np.nan), score)
        if self.filling:
            reason[missing] = Reason.FILLED
        else:
            view.flow[:, missing] = np.nan
        return view.flow, score, reason


def optical_flow(
    first: npt.ArrayLike,
    second: npt.ArrayLike,
    *,
    window_size: int = WINDOW,
    search: int = SEARCH,
    filling: bool = False,
    progress: Progress | None = None,
    **settings: object,
) -> FlowMap:
    """Find every pixel of the first frame in the second one, by windowed correlation.

    Parameters
    ----------
    first, second
        (H, W), (H, W, 3) or (H, W, 4) images of one size and type: uint8, uint16 or float.
    window_size
        Side of the compared window, px; odd.
    search
        Largest displacement in every direction, px.
    filling
        Whether to extend the motion of the same surface over pixels that could not be measured.
    progress
        Called with the fraction done, 0..1.
    **settings
        Other settings of :class:`~stereolag.motion.matcher.FlowMatcher`.

    Returns
    -------
    FlowMap
        Displacement (dy, dx), second minus first, px; NaN where it is missing, with a reason for every pixel.

    Raises
    ------
    ValueError
        If a setting is not allowed, or :meth:`FlowMatcher.compute` rejects the frames.

    Examples
    --------
    >>> import numpy as np
    >>> import stereolag as sl
    >>> first = np.random.default_rng(0).integers(0, 256, (60, 100), dtype=np.uint8)
    >>> second = np.roll(first, (2, -5), axis=(0, 1))  # 2 px down, 5 px to the left
    >>> flow = sl.optical_flow(first, second, search=16)
    >>> round(float(np.nanmedian(flow.dy)), 1), round(float(np.nanmedian(flow.dx)), 1)  # px
    (2.0, -5.0)
    """
    matcher = FlowMatcher(window_size=window_size, search=search, filling=filling, **settings)
    return matcher.compute(first, second, progress=progress)
