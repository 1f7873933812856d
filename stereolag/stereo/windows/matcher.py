"""Window correlation: the settings, the choice of the engine, and the stages from the windows to the finished map."""

from __future__ import annotations

import math
from typing import Annotated, Any, Literal, Self, TypeAlias

import numpy as np
import numpy.typing as npt
from pydantic import Field, model_validator

from stereolag.core.arrays import ReasonMap
from stereolag.core.inputs import Image, as_grey, rescale_extreme_floats
from stereolag.core.jobs import COSTS, Estimate, Progress, silent
from stereolag.core.settings import Applies, FitsImage, Pixels, changed
from stereolag.stereo.finishing.stages import (
    Ambiguity,
    Filling,
    LeftRight,
    Median,
    Speckle,
    Surfaces,
    Texture,
    finished,
    is_finished,
    least_texture,
    left_right_disagree,
)
from stereolag.stereo.matcher import (
    MAX_ABS_MIN_DISPARITY,
    MAX_NUM_DISPARITIES,
    PixelMatches,
    Reason,
    StereoMatcher,
    grey_bytes,
)
from stereolag.stereo.windows.engines import BATCH_BYTES, match_windows, match_windows_fft
from stereolag.stereo.windows.pixels import spread_over_pixels
from stereolag.stereo.windows.search import (
    MAX_LAGS,
    AnySearch,
    LagRange,
    RectifiedSearch,
    Score,
    WindowMatches,
    WindowQuery,
)

Engine: TypeAlias = Literal["window_sums", "fft"]


def find_matches(query: WindowQuery, engine: Engine, progress: Progress = silent) -> WindowMatches:
    """Match every window with the given engine; both give the same result, bit for bit if the images are integers.

    Only window sums support `right_matches`, the best left window of every right window.
    """
    return (match_windows_fft if engine == "fft" else match_windows)(query, progress)


def cheaper_engine(shape: tuple[int, int], window_size: int, step: int, lags: LagRange) -> Engine:
    """Return the engine that is expected to be faster.

    Window sums cost pixels × lags, whatever the window; batched FFT costs windows × N log N, where N is the number of
    pixels in a window's search area. FFT is faster where windows hardly overlap and the search is two-dimensional and
    several times their size; in all other cases measured (windows 8 to 40 px, 64 to 14,641 lags) sums are faster,
    mostly by ten times or more. Only FFT can search more than 65535 lags.
    """
    if lags.count > MAX_LAGS:
        return "fft"
    seconds = COSTS["windows"].seconds
    by_sums = seconds["products"] * products(shape, lags)
    by_fft = seconds["turns"] * turns(shape, window_size, step, lags)
    return "window_sums" if by_sums <= by_fft else "fft"


def products(shape: tuple[int, ...], lags: LagRange) -> int:
    """Return the number of products in running sums: every pixel at every lag, whatever the step."""
    return shape[0] * shape[1] * lags.rows * lags.cols


def turns(shape: tuple[int, ...], window_size: int, step: int, lags: LagRange) -> float:
    """Return the work of the batched FFT: N log2 N for every window, with N the points of its padded search area."""
    rows, cols = ((side - window_size) // step + 1 for side in shape[:2])
    area = (window_size + lags.rows - 1) * (window_size + lags.cols - 1)
    return rows * cols * area * math.log2(area)


BYTES_PER_POINT = 32
"""Bytes of the batched FFT per point of a search area."""

UINT8_OVERHEAD, FLOAT64_OVERHEAD, FFT_OVERHEAD, WHITENED_OVERHEAD = 3, 8, 1.5, 5
"""Ratio of the time of a whole match to that of its products: sums of uint8, sums of float64, FFT, whitened FFT."""

MAX_VERTICAL_REACH = 64
"""Largest vertical reach of a strip, rows up and down."""


def _step(settings: Any) -> int:
    return max(1, round(float(settings.window_size * (1 - settings.overlap))))


def _needs_spectrum(settings: Any) -> bool:
    return bool(settings.score == "phase" or settings.search.circular(settings.window_size))


def _along_the_row(settings: Any) -> bool:
    return bool(settings.search.lags(settings.window_size).rows == 1)


def _matches_every_right_window(settings: Any) -> bool:
    by_sums = settings.engine != "fft" and not _needs_spectrum(settings)
    return _along_the_row(settings) and _step(settings) == 1 and by_sums


ALONG_THE_ROW = "needs a search along the row: search.vertical must be 0"


class CorrelationMatcher(StereoMatcher):
    """Matcher that slides every left window over its search area in the right image and keeps the best score.

    The later stages are off by default; :func:`stereolag.preset` turns them on.

    Examples
    --------
    >>> import numpy as np
    >>> import stereolag as sl
    >>> left = np.random.default_rng(0).integers(0, 256, (60, 100), dtype=np.uint8)
    >>> right = np.roll(left, -5, axis=1)  # disparity 5 px
    >>> matcher = sl.CorrelationMatcher(window_size=11, search=sl.SearchArea.rectified(16))
    >>> round(float(np.nanmedian(matcher.compute(left, right).disparity)), 1)  # px
    5.0
    """

    title = "Convolution"
    is_compiled = True
    short_name = "correlation"
    first_shown = ("window_size", "overlap", "search", "score")

    window_size: Annotated[int, Pixels(), FitsImage()] = Field(
        default=20,
        title="Window",
        description="Side of the square window that is compared, px. Large windows are reliable but blur edges, small "
        "ones are sharp but easily fooled.",
        ge=3,
        le=255,
    )
    overlap: float = Field(
        default=0.95,
        title="Overlap",
        description="Fraction of a window shared with the next one: 0.95 of 20 px is a step of 1 px.",
        ge=0,
        lt=1,
        json_schema_extra={"step": 0.05},
    )
    search: AnySearch = Field(
        default=RectifiedSearch(),
        title="Search area",
        description="The part of the right image in which a window is looked for.",
    )
    score: Score = Field(
        default="zncc",
        title="Score",
        description="zncc: Pearson correlation; ncc: no mean removed (the report's eq. 1.3); cross: not normalised; "
        "phase: whitened.",
    )
    engine: Annotated[
        Literal["auto", "window_sums", "fft"],
        Applies(
            lambda settings: not _needs_spectrum(settings),
            "phase correlation and an unpadded (circular) search need 'fft' or 'auto'",
            otherwise=("fft",),
        ),
    ] = Field(
        default="auto",
        title="Engine",
        description="Running window sums or batched FFT; both give the same map, auto takes the faster one.",
    )
    texture: Texture = None
    ambiguity: Ambiguity = None
    left_right: Annotated[
        LeftRight,
        Applies(
            _matches_every_right_window,
            "needs a search along the row (search.vertical 0) and a window at every pixel (step 1), scored by window "
            "sums: neither engine 'fft' nor score 'phase'",
        ),
    ] = None
    speckle: Speckle = None
    filling: Annotated[Filling, Applies(_along_the_row, ALONG_THE_ROW)] = False
    surfaces: Surfaces = None
    median: Annotated[Median, Applies(_along_the_row, ALONG_THE_ROW)] = None

    @model_validator(mode="after")
    def _window_has_room(self) -> Self:
        self.search.lags(self.window_size)
        return self

    @property
    def step(self) -> int:
        """Return the distance between neighbouring windows, px."""
        return _step(self)

    def after_scaling(self, document: dict[str, Any]) -> dict[str, Any]:
        """Return the settings for another size, keeping a window at every pixel if the left-right check is on."""
        window = document["window_size"]
        if self.left_right is not None and window > self.window_size:
            document["overlap"] = max(self.overlap, round(1 - 1 / window, 4))
        return document

    def search_range(self) -> tuple[int, int] | None:
        """Return the first disparity searched and the number of disparities, px; None if the search wraps around."""
        return None if self.search.circular(self.window_size) else self.reach()

    def reach(self) -> tuple[int, int]:
        """Return the first disparity a map can contain and how many, px."""
        lags = self.search.lags(self.window_size)
        return -lags.dx_last, lags.cols

    def with_search_range(self, min_disparity: int, num_disparities: int) -> Self:
        """Return the matcher with a strip of this range, as far as it is allowed.

        A square search area becomes a strip with the same vertical reach, as far as that is allowed.
        """
        search = RectifiedSearch(
            num_disparities=min(num_disparities, MAX_NUM_DISPARITIES),
            min_disparity=min(max(min_disparity, -MAX_ABS_MIN_DISPARITY), MAX_ABS_MIN_DISPARITY),
            vertical=min(self.search.lags(self.window_size).dy_last, MAX_VERTICAL_REACH),
        )
        return changed(self, {"search": search.model_dump()})

    def estimate(self, shape: tuple[int, ...], dtype: npt.DTypeLike = np.uint8) -> Estimate:
        """Return the memory and time of :meth:`compute` for images of a shape (rows, cols[, channels]) and dtype."""
        (height, width), pixels, lags = shape[:2], shape[0] * shape[1], self._lags_tried
        rows, cols = (max(1, (side - self.window_size) // self.step + 1) for side in (height, width))
        windows, both_views = rows * cols, self.left_right is not None
        # Bytes per window: scores at and around the peak, lag, texture, runner-up and sub-pixel offset.
        record = (4 * 9 + 4 if lags.rows > 1 else 4 * 3 + 2) + 4 + 4 + 8 + 2 * both_views
        whole, by_sums = np.dtype(dtype) == np.uint8, self._engine_for((height, width)) == "window_sums"
        margin = (height + lags.rows) * (width + lags.cols + 32)
        # Pixels other than uint8 are compared as float64: a plain copy, a padded one, and a temporary one. Running sums
        # of uint8 pack entering rows with leaving ones; whitening takes another copy.
        prepared = (6 if by_sums else 2) * margin if whole else 8 * (4 * pixels + margin)
        prepared += 8 * (pixels + margin) * (self.score == "phase")
        reach_rows, reach_cols = (0, 0) if self.search.circular(self.window_size) else (lags.rows, lags.cols)
        area = (self.window_size + reach_rows) * (self.window_size + reach_cols)
        transforms = turns(shape, self.window_size, self.step, lags)
        return COSTS["windows"].estimate(
            grey=grey_bytes(shape, dtype),
            pixels=pixels,
            finished=pixels * is_finished(self),
            prepared=prepared,
            records=record * windows,
            windows=windows,
            seen=windows * both_views,
            columns=(lags.rows + self.step) * (width + lags.cols) * by_sums,
            batch=0 if by_sums else min(BATCH_BYTES, BYTES_PER_POINT * area * windows),
            products=by_sums * products(shape, lags) * (UINT8_OVERHEAD if whole else FLOAT64_OVERHEAD),
            turns=(not by_sums) * transforms * (WHITENED_OVERHEAD if self.score == "phase" else FFT_OVERHEAD),
        )

    def match(self, left: Image, right: Image, progress: Progress) -> PixelMatches:
        """Match the images as grey, window by window, then check, filter and fill."""
        grey = rescale_extreme_floats(as_grey(left), as_grey(right))
        query = self.query(*grey)
        matches = find_matches(query, self._engine_for((left.shape[0], left.shape[1])), progress)
        return self.completed(matches, query, left, right)

    def completed(self, matches: WindowMatches, query: WindowQuery, left: Image, right: Image) -> PixelMatches:
        """Return the finished map of the images from the matches of their windows to the query."""
        found = spread_over_pixels(
            matches,
            query,
            asked=self.search.lags(self.window_size),
            flat=least_texture(self.texture, query.left, query.right),
            refused=self._refused(matches),
        )
        return finished(found, left, right, self)

    def query(self, left: Image, right: Image) -> WindowQuery:
        """Return the query for the windows of two grey images of one type."""
        return WindowQuery(
            left,
            right,
            self.window_size,
            self.step,
            self._lags_tried,
            self.score,
            circular=self.search.circular(self.window_size),
            runner_up=self.ambiguity is not None,
            right_matches=self.left_right is not None,
        )

    @property
    def _lags_tried(self) -> LagRange:
        """Return the requested lags plus one guard lag at each end of every direction searched.

        A peak on the border of the search lacks a neighbour for the sub-pixel fit and may be the flank of a higher one
        outside. With the guard, every requested lag has both neighbours, and only a peak *on* the guard is doubtful.
        """
        lags = self.search.lags(self.window_size)
        if self.search.circular(self.window_size):
            return lags
        vertical = int(lags.rows > 1)
        return LagRange(lags.dy_first - vertical, lags.dy_last + vertical, lags.dx_first - 1, lags.dx_last + 1)

    def _engine_for(self, shape: tuple[int, int]) -> Engine:
        if _needs_spectrum(self):
            return "fft"
        if self.left_right is not None:
            return "window_sums"
        if self.engine == "auto":
            return cheaper_engine(shape, self.window_size, self.step, self._lags_tried)
        return self.engine

    def _refused(self, matches: WindowMatches) -> ReasonMap | None:
        """Return the reasons of windows that the left-right check or ambiguity test rejects; None if neither is on."""
        reason: ReasonMap | None = None
        if self.left_right is not None and matches.right_dx is not None:
            disagree = left_right_disagree(matches.dx, matches.right_dx, self.left_right.tolerance)
            reason = disagree.view(np.uint8) * np.uint8(Reason.LEFT_RIGHT)  # MEASURED is 0
        if self.ambiguity is not None and matches.runner_up is not None:
            ambiguous = matches.score - matches.runner_up < self.ambiguity.lead
            before = np.uint8(Reason.MEASURED) if reason is None else reason
            # np.where runs at memory speed even on noise; a masked assignment predicts a branch for every pixel.
            reason = np.where(ambiguous, np.uint8(Reason.AMBIGUOUS), before)
        return reason
