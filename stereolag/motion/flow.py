"""Optical flow between two frames: its settings, the matching from coarse to fine levels, and the result."""

from __future__ import annotations

import time
from dataclasses import dataclass
from functools import partial
from typing import Annotated, Any, NamedTuple

import cv2
import numpy as np
import numpy.typing as npt
from pydantic import Field, field_validator

from stereolag.core.arrays import FloatMap, Mask, ReasonMap
from stereolag.core.inputs import (
    Image,
    as_eight_bit,
    as_grey,
    as_image_pair,
    check_window,
    grey_level,
    rescale_extreme_floats,
)
from stereolag.core.jobs import COSTS, Estimate, Progress, check_memory, silent
from stereolag.core.settings import FitsImage, OfThePair, Pixels, Settings, SliderRange, odd
from stereolag.loops.bands import over_image
from stereolag.loops.compilation import compiled
from stereolag.loops.memory import keep_freed_memory
from stereolag.motion.candidates import NO_SCORE, Candidates, Flow, best_of_neighbours, leaves_frame, match_level
from stereolag.motion.levels import (
    ForwardBackwardCheck,
    Frame,
    MedianTest,
    count_levels,
    doubled,
    edge_aware_mean,
    median_residual,
    return_error,
)
from stereolag.motion.verdict import (
    VERDICT_LEVELS,
    FlowVerdict,
    FrameRelation,
    moves_everywhere,
    related_frames,
    unchanged,
    without_minimum,
)
from stereolag.stereo.finishing.stages import MedianFilter, TextureTest, least_texture, weighted_median
from stereolag.stereo.matcher import Reason


class VariationalRefinement(Settings):
    """Adjusts the flow so that grey levels and gradients of both frames agree best while it stays smooth.

    OpenCV's ``VariationalRefinement``, after T. Brox, A. Bruhn, N. Papenberg & J. Weickert, "High accuracy optical flow
    estimation based on a theory for warping", ECCV 2004.
    """

    smoothness: float = Field(
        default=20.0,
        title="Smoothness",
        description="Weight of smoothness against agreement (OpenCV's alpha).",
        gt=0,
        le=1000,
        json_schema_extra={"step": 5},
    )
    iterations: int = Field(
        default=3,
        title="Iterations",
        description="Of the outer loop at the coarse levels (OpenCV's fixedPointIterations); at half size one fewer, "
        "at full size two.",
        ge=1,
        le=100,
    )


def refined(
    flow: Flow, first: npt.NDArray[np.uint8], second: npt.NDArray[np.uint8], settings: VariationalRefinement, level: int
) -> Flow:
    """Refine the flow in place, and return it.

    At full size one iteration is as good as three at the coarse levels, and at half size two: the flow is almost right,
    and the solver is more strongly over-relaxed.

    Parameters
    ----------
    flow
        (2, H, W) px, finite and contiguous.
    first, second
        (H, W) uint8 frames.
    settings
        The settings of the refinement.
    level
        The level of the pyramid, 0 at full size.
    """
    refinement = cv2.VariationalRefinement.create()
    refinement.setAlpha(settings.smoothness * (1 if level else 2))
    refinement.setFixedPointIterations(max(1, settings.iterations - max(0, 2 - level)))
    if level < 2:
        refinement.setSorIterations(6)
        refinement.setOmega(1.9)  # the factor of successive over-relaxation
    refinement.calcUV(first, second, flow[1], flow[0])
    return flow


@dataclass(frozen=True, eq=False, repr=False)
class FlowMap:
    """Displacements of the pixels of the first frame to the second one.

    Attributes
    ----------
    dy, dx
        (H, W) float32 displacement, second minus first, px; NaN = none. The pixel at (row, col) of the first frame is
        at (row + dy, col + dx) of the second one.
    score
        (H, W) float32 Pearson correlation of the matching window, -1..1; NaN = none.
    reason
        (H, W) uint8, a :class:`~stereolag.stereo.matcher.Reason` for every pixel. LEFT_RIGHT: the way back from the
        second frame leads elsewhere, mostly because the pixel is hidden there. SPECKLE: an outlier among its
        neighbours by the universal median test. AMBIGUOUS: the pixel's surroundings do not confirm the match, or
        another motion fits as well, as along stripes, on smooth slopes with noise, and in patterns that repeat within
        reach.
    verdict
        "related"; or, with no flow at all, "unrelated": the frames have nothing in common; "blank": one of them shows
        nothing, or only noise; "static background": objects move everywhere in front of a static background, so that
        both motions fit (subtract the background, with `subtract_minimum`). "identical": the flow is exactly 0.
    elapsed_s
        Computation time, s.
    settings
        The :class:`FlowMatcher` that made it.

    Examples
    --------
    >>> import numpy as np
    >>> import stereolag as sl
    >>> first = np.random.default_rng(0).integers(0, 256, (60, 100), dtype=np.uint8)
    >>> flow = sl.optical_flow(first, np.roll(first, -5, axis=1), search=16)
    >>> flow
    <FlowMap 100 × 60, related, ...% valid, in ... s>
    >>> flow.dx[30, 2], sl.Reason(flow.reason[30, 2]).name  # px; the pixel has left the frame
    (np.float32(nan), 'OUT_OF_FRAME')
    """

    dy: FloatMap
    dx: FloatMap
    score: FloatMap
    reason: ReasonMap
    verdict: FlowVerdict
    elapsed_s: float
    settings: Settings

    def __post_init__(self) -> None:
        for array in (self.dy, self.dx, self.score, self.reason):
            array.flags.writeable = False

    def __repr__(self) -> str:
        rows, cols = self.dx.shape
        return (
            f"<FlowMap {cols} × {rows}, {self.verdict}, {100 * self.coverage:.1f} % valid, in {self.elapsed_s:.3g} s>"
        )

    @property
    def valid(self) -> Mask:
        """Return the mask of pixels with a displacement, measured or filled."""
        return np.isfinite(self.dx)

    @property
    def filled(self) -> Mask:
        """Return the mask of pixels whose displacement was filled in from the surroundings instead of measured."""
        return np.asarray(self.reason == np.uint8(Reason.FILLED))

    @property
    def coverage(self) -> float:
        """Return the share of pixels that have a displacement, 0..1."""
        return float(np.count_nonzero(self.valid) / self.valid.size)


RESIDUAL_REACH_PX = (1, 2, 2, 3)
"""Reach of the search around the flow of the coarser level, px of the level, finest first."""

FULL_WEIGHT_TEXTURE = 0.7
"""Standard deviation from which a window has full weight among its neighbours, grey levels of 255."""

HALF_WEIGHT_ERROR_PX = 1.5
"""Return error that halves the weight, px of the level."""

ROUNDS = (1, 1, 2, 2, 1)
"""Matching rounds per level, finest first: coarse levels have few pixels and can afford more."""


@compiled
def _set_weights(
    score: FloatMap,
    texture: FloatMap,
    error: FloatMap,
    per_texture: Any,
    per_error: Any,
    weight: FloatMap,
    first: int,
    end: int,
) -> None:
    """Set the weights of rows `first` to `end`.

    `per_texture` and `per_error` are the inverses of the texture of full weight and of the return error of half weight.
    """
    for row in range(first, end):
        for col in range(weight.shape[1]):
            confidence = max(score[row, col], np.float32(0)) * min(np.float32(1), texture[row, col] * per_texture)
            relative = error[row, col] * per_error
            weight[row, col] = confidence * confidence / (np.float32(1) + relative * relative * relative * relative)


class LevelFlow(NamedTuple):
    """The flow of one level, and the data by which its pixels are tested."""

    flow: Flow
    candidates: Candidates
    """The matches of the windows, before they are smoothed."""
    error: FloatMap
    """(H, W) return error of the flow there and back, px."""


DEFAULT_WINDOW_PX = 7
"""Default side of the window, px."""

DEFAULT_SEARCH_PX = 128
"""Default reach of the search, px."""


class FlowMatcher(Settings):
    """Matcher that finds the window around every pixel of one frame in the next one, coarse to fine.

    At the coarsest level of a pyramid every lag within reach is tried; at each finer level the second frame is warped
    along the flow so far and a residual of a few px is searched, with sub-pixel precision. Between levels the flow is
    averaged over surfaces bounded by image edges, giving more weight to matches that lead back to their start.
    """

    window_size: Annotated[int, Pixels(), FitsImage()] = Field(
        default=DEFAULT_WINDOW_PX,
        title="Window",
        description="Side of the square window that is compared at every level, px; odd, so that a pixel is its "
        "middle. Large windows are reliable but blur edges, small ones are sharp but easily fooled.",
        ge=3,
        le=255,
        json_schema_extra={"step": 2},
    )
    search: Annotated[int, Pixels(rounded_up=True), OfThePair(), SliderRange(high=256)] = Field(
        default=DEFAULT_SEARCH_PX,
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
    subtract_minimum: bool = Field(
        default=False,
        title="Subtract the minimum",
        description="Subtract from each pixel the smaller of its two values: for bright particles before a background "
        "that stands still.",
    )

    _odd = field_validator("window_size")(odd)

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
        check_window(self.window_size, images[0].shape)
        check_memory(self.estimate(images[0].shape, images[0].dtype))
        keep_freed_memory()
        start = time.perf_counter()
        grey = rescale_extreme_floats(*map(as_grey, images))
        if self.subtract_minimum:
            grey = without_minimum(*grey)
        matched, relation = self._match(*grey, progress or silent)
        if relation.may_hide_a_motion and self._has_static_background(relation, *grey):
            relation = FrameRelation("static background", np.zeros_like(relation.supported))
        flow, score, reason = self._test(matched, relation, *grey)
        return FlowMap(
            flow[0], flow[1], score, reason, relation.verdict, elapsed_s=time.perf_counter() - start, settings=self
        )

    def estimate(self, shape: tuple[int, ...], dtype: npt.DTypeLike = np.uint8) -> Estimate:
        """Return the memory and time of :meth:`compute` for frames of a shape, with or without channels, and dtype."""
        pixels = shape[0] * shape[1]
        return COSTS["flow"].estimate(pixels=pixels, doubles=pixels * (np.dtype(dtype) != np.uint8))

    def _match(self, first: Image, second: Image, progress: Progress) -> tuple[LevelFlow, FrameRelation]:
        """Return the flow between two grey frames, not yet tested, and the relation of the frames."""
        if np.array_equal(first, second):
            candidates = match_level(first, second, None, self.window_size, 1)
            zero = np.zeros_like(candidates.flow)
            flat = candidates.texture <= least_texture(self.texture, first, second)
            verdict: FlowVerdict = "blank" if flat.all() else "identical"
            return LevelFlow(zero, candidates._replace(flow=zero), zero[0]), FrameRelation(verdict, ~flat)
        count = count_levels(first.shape, self.window_size, self.search, self.levels)
        firsts, seconds = (
            Frame(one, guide, grey_level(first, second)).pyramid(max(count, VERDICT_LEVELS))
            for one, guide in zip((first, second), as_eight_bit(first, second), strict=True)
        )
        flows: tuple[Flow | None, Flow | None] = (None, None)
        for level in range(count - 1, -1, -1):
            there, back = (None if flow is None else doubled(flow, firsts[level].shape) for flow in flows)
            matched, back = self._match_level(level, firsts[level], seconds[level], there, back)
            flows = matched.flow, back
            progress(1 / 4**level)
        return matched, related_frames(firsts, seconds, matched.flow, self.search)

    def _has_static_background(self, relation: FrameRelation, first: Image, second: Image) -> bool:
        """Return whether the frames agree better, and move everywhere, once their minimum is subtracted."""
        matched, without = self._match(*without_minimum(first, second), silent)
        return without.agreement > relation.agreement and moves_everywhere(matched.flow, without)

    def _match_level(
        self, level: int, first: Frame, second: Frame, there: Flow | None, back: Flow | None
    ) -> tuple[LevelFlow, Flow]:
        """Match one level both ways; the finest only forwards, if a coarser level provides the flow back."""
        for _ in range(ROUNDS[min(level, len(ROUNDS) - 1)]):
            candidates, returned = self._candidates(level, first, second, there), back
            if level > 0 or returned is None:
                returning = self._candidates(level, second, first, back)
                returned = returning.flow
                back = self._smoothed(level, second, returning, return_error(returned, candidates.flow))
            there = self._smoothed(level, first, candidates, return_error(candidates.flow, returned))
        assert there is not None and back is not None
        if self.refinement is not None:
            there = refined(there, first.guide, second.guide, self.refinement, level)
            if level > 0:
                back = refined(back, second.guide, first.guide, self.refinement, level)
        return LevelFlow(there, candidates, return_error(there, back)), back

    def _candidates(self, level: int, first: Frame, second: Frame, flow: Flow | None) -> Candidates:
        """Return the best match near every pixel, searched around a flow, if one is known."""
        reach = RESIDUAL_REACH_PX[min(level, len(RESIDUAL_REACH_PX) - 1)]
        if flow is None:
            # One lag more than requested: a peak on the border lacks a neighbour for the sub-pixel fit.
            reach = min(-(-self.search // 2**level) + 1, max(first.shape) - 1)
        candidates = match_level(first.grey, second.grey, flow, self.window_size, reach)
        return best_of_neighbours(candidates, max(1, self.window_size // 5))

    def _smoothed(self, level: int, frame: Frame, candidates: Candidates, error: FloatMap) -> Flow:
        """Return the flow, propagated from reliable to unreliable pixels along the surfaces of the frame."""
        weight = np.empty_like(error)
        inverses = np.float32(1 / (FULL_WEIGHT_TEXTURE * frame.grey_level)), np.float32(1 / HALF_WEIGHT_ERROR_PX)
        over_image(partial(_set_weights, candidates.score, candidates.texture, error, *inverses, weight), weight.shape)
        flow = edge_aware_mean(candidates.flow, weight, frame.guide)
        # At full size the refinement is as good, and the median takes as long as the matching.
        if self.median is not None and (level > 0 or self.refinement is None):
            radius = self.median.radius
            for part in flow:
                # Nine neighbours: twenty-five are no better here and take three times as long.
                part[...] = weighted_median(part, frame.guide, radius, radius, self.median.contrast)
        return flow

    def _test(
        self, matched: LevelFlow, relation: FrameRelation, first: Image, second: Image
    ) -> tuple[Flow, FloatMap, ReasonMap]:
        """Return the flow without unreliable displacements, its scores, and the reasons."""
        flow, score = matched.flow, matched.candidates.score
        flat = matched.candidates.texture <= least_texture(self.texture, first, second)
        same = unchanged(first, second, self.window_size) & ~flat
        moves = same & (np.abs(flow) >= 1).any(axis=0) if same.any() else same
        np.copyto(flow, 0, where=same & ~moves)
        reason = np.full(score.shape, Reason.MEASURED, np.uint8)
        if self.median_test is not None:
            spacing = max(1, self.window_size // 2)
            residual = median_residual(matched.candidates.flow, spacing, self.median_test.noise)
            np.copyto(reason, np.uint8(Reason.SPECKLE), where=residual > self.median_test.threshold)
        if self.forward_backward is not None:
            np.copyto(reason, np.uint8(Reason.LEFT_RIGHT), where=matched.error > self.forward_backward.tolerance)
        for where, why in (
            # Standing still fits to the last bit, and so does the motion found, as along an edge.
            (moves, Reason.AMBIGUOUS),
            (~relation.supported, Reason.LOW_TEXTURE if relation.verdict == "blank" else Reason.AMBIGUOUS),
            # A score is missing where the window of the second frame is flat, or outside.
            (score == NO_SCORE, Reason.LOW_TEXTURE),
            (leaves_frame(flow, score.shape), Reason.OUT_OF_FRAME),
            (flat, Reason.LOW_TEXTURE),
        ):
            np.copyto(reason, np.uint8(why), where=where)
        missing = reason != np.uint8(Reason.MEASURED)
        score = np.where(missing, np.float32(np.nan), score)
        if self.filling and not missing.all():
            reason[missing] = Reason.FILLED
        else:
            np.copyto(flow, np.nan, where=missing)
        return flow, score, reason


def optical_flow(
    first: npt.ArrayLike,
    second: npt.ArrayLike,
    *,
    window_size: int = DEFAULT_WINDOW_PX,
    search: int = DEFAULT_SEARCH_PX,
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
        Other settings of :class:`FlowMatcher`.

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
