"""Depth by windowed correlation: the settings, and the order of the stages from the windows to the finished map."""

from __future__ import annotations

from typing import Literal, Self

import numpy as np
import numpy.typing as npt
from pydantic import Field, model_validator

from stereolag.estimates import Estimate
from stereolag.inputs import Image, as_grey, of_ordinary_size
from stereolag.progress import Progress
from stereolag.stereo.checks import AmbiguityTest, Checks, LeftRightCheck, TextureTest
from stereolag.stereo.costs import MatchingCost, eight_bit
from stereolag.stereo.engines import Engine, Score, cheaper_engine
from stereolag.stereo.estimates import estimate_volume, estimate_windows
from stereolag.stereo.filling import filled_from_behind
from stereolag.stereo.filtering import MedianFilter, SpeckleFilter, edge_respecting_median, without_speckles
from stereolag.stereo.matcher import Displacements, StereoMatcher
from stereolag.stereo.optimisation import SemiGlobal
from stereolag.stereo.result import Reason
from stereolag.stereo.search import AnySearch, CentredSearch, RectifiedSearch, SearchArea
from stereolag.stereo.volume import match_by_volume
from stereolag.stereo.windows import WindowGrid, guarded, match_by_windows

Preset = Literal["report", "dense", "accurate"]


class CorrelationMatcher(StereoMatcher):
    """Slide every window of the left image over its search area in the right one and keep the best score.

    The later stages are off unless they are given; :meth:`preset` gives them.
    """

    window_size: int = Field(
        default=20,
        title="Window",
        description="Side of the square window that is compared, px. Large windows are sure and blurred, small ones "
        "sharp and easily fooled.",
        ge=3,
        le=255,
    )
    overlap: float = Field(
        default=0.95,
        title="Overlap",
        description="Fraction of a window that it shares with the next one: 0.95 of 20 px moves on by 1 px.",
        ge=0,
        lt=1,
        json_schema_extra={"step": 0.05},
    )
    search: AnySearch = Field(
        default=CentredSearch(),
        title="Search area",
        description="The part of the right image in which a window is looked for.",
    )
    score: Score = Field(
        default="zncc",
        title="Score",
        description="zncc: Pearson correlation; ncc: no mean removed (the report's eq. 1.3); cross: not normalised; "
        "phase: whitened.",
    )
    engine: Literal["auto", "window_sums", "fft"] = Field(
        default="auto",
        title="Engine",
        description="Running window sums or batched FFT; both give the same answer, auto takes the faster one.",
    )
    optimisation: SemiGlobal | None = Field(
        default=None,
        title="Semi-global optimisation",
        description="Weigh every match against its neighbours' along eight paths, instead of taking the best alone.",
    )
    cost: MatchingCost = Field(
        default=MatchingCost(),
        title="Matching cost",
        description="What the optimisation weighs: the correlation, joined by census and gradient.",
    )
    texture: TextureTest | None = Field(
        default=None, title="Texture test", description="Give no answer where a window holds too little to match."
    )
    ambiguity: AmbiguityTest | None = Field(
        default=None, title="Ambiguity test", description="Give no answer where another place fits nearly as well."
    )
    left_right: LeftRightCheck | None = Field(
        default=None, title="Left-right check", description="Give no answer where the right image's match disagrees."
    )
    speckle: SpeckleFilter | None = Field(
        default=None, title="Speckle filter", description="Drop small islands of disparity unlike all around them."
    )
    filling: bool = Field(
        default=False, title="Fill gaps", description="Continue the surface behind over what could not be measured."
    )
    median: MedianFilter | None = Field(
        default=None,
        title="Edge-respecting median",
        description="Smooth the map where the picture is smooth, and only there.",
    )

    @classmethod
    def preset(cls, name: Preset, num_disparities: int = 64, *, min_disparity: int = 0) -> CorrelationMatcher:
        """Return settings that serve a purpose.

        Parameters
        ----------
        name
            "report": the source report's depth map, window 20, overlap 0.95, search area 40 centred (it reaches
            ±10 px, whatever `num_disparities`). "dense": every pixel by the best ZNCC of its window, checked, filled
            and smoothed, in a few hundredths of a second. "accurate": correlation joined with census and gradient,
            semi-global optimisation, checked, filled and smoothed.
        num_disparities, min_disparity
            The range searched, px.

        Raises
        ------
        ValueError
            Another name.
        """
        if name == "report":
            return cls(window_size=20, overlap=0.95, search=SearchArea.centred(40))
        search = SearchArea.rectified(num_disparities, min_disparity)
        finish = {"left_right": LeftRightCheck(), "speckle": SpeckleFilter(), "filling": True, "median": MedianFilter()}
        if name == "dense":
            return cls(window_size=11, overlap=0.95, search=search, texture=TextureTest(), **finish)
        if name == "accurate":
            return cls(window_size=9, overlap=0.95, search=search, optimisation=SemiGlobal(), **finish)
        raise ValueError(f"preset is {name!r}; allowed are 'report', 'dense' and 'accurate'.")

    @model_validator(mode="after")
    def _fits_together(self) -> CorrelationMatcher:
        along_the_row = self.search.lags(self.window_size).rows == 1
        if self.engine == "window_sums" and self._needs_spectrum:
            raise ValueError(
                "engine is 'window_sums'; phase correlation and an unpadded (circular) search need 'fft' or 'auto'."
            )
        if self.optimisation is not None and not isinstance(self.search, RectifiedSearch):
            raise ValueError("optimisation needs SearchArea.rectified(...); the search area is a square.")
        for stage in ("optimisation", "left_right", "median"):
            if getattr(self, stage) is not None and not along_the_row:
                raise ValueError(f"{stage} needs a search along the row: search.vertical must be 0.")
        if self.filling and not along_the_row:
            raise ValueError("filling needs a search along the row: search.vertical must be 0.")
        by_sums = self.engine != "fft" and not self._needs_spectrum
        if self.left_right is not None and self.optimisation is None and (self.step > 1 or not by_sums):
            raise ValueError(
                f"left_right needs a window at every pixel, scored by window sums: overlap is {self.overlap} (step "
                f"{self.step} px), score {self.score!r} and engine {self.engine!r}."
            )
        return self

    @property
    def step(self) -> int:
        """Return the distance between neighbouring windows, px."""
        return max(1, round(self.window_size * (1 - self.overlap)))

    @property
    def _needs_spectrum(self) -> bool:
        return self.score == "phase" or self.search.circular(self.window_size)

    def estimate(self, shape: tuple[int, ...], dtype: npt.DTypeLike = np.uint8) -> Estimate:
        """Return what :meth:`compute` will take for two images of a shape, with channels or without, and a dtype."""
        if self.optimisation is not None and isinstance(self.search, RectifiedSearch):
            return estimate_volume(shape, dtype, num_disparities=self.search.num_disparities)
        grid = WindowGrid(self.window_size, self.step, (shape[0], shape[1]))
        lags = self.search.lags(self.window_size)
        return estimate_windows(
            shape,
            dtype,
            window_size=self.window_size,
            step=self.step,
            lags=lags if self.search.circular(self.window_size) else guarded(lags),
            engine=self._engine_for(grid),
            score=self.score,
            circular=self.search.circular(self.window_size),
            both_views=self.left_right is not None,
            finished=self.speckle is not None or self.filling or self.median is not None,
        )

    def with_disparities(self, num_disparities: int) -> Self | None:
        """Return the matcher with another number of disparities; None where its search area is a square."""
        if not isinstance(self.search, RectifiedSearch):
            return None
        search = self.search.model_copy(update={"num_disparities": num_disparities})
        return self.model_copy(update={"search": search})

    def match(self, left: Image, right: Image, progress: Progress) -> Displacements:
        """Match the images as grey, then check, filter and fill."""
        if self.window_size > min(left.shape[:2]):
            raise ValueError(
                f"window_size is {self.window_size} px and the images are {left.shape[1]} × {left.shape[0]}; "
                "the window must fit into them."
            )
        measure = self._by_windows if self.optimisation is None else self._by_volume
        return self._finished(measure(*of_ordinary_size(as_grey(left), as_grey(right)), progress), left, right)

    def _by_windows(self, left: Image, right: Image, progress: Progress) -> Displacements:
        """Take the best score of every window alone."""
        grid = WindowGrid(self.window_size, self.step, (left.shape[0], left.shape[1]))
        return match_by_windows(
            left,
            right,
            grid=grid,
            lags=self.search.lags(self.window_size),
            circular=self.search.circular(self.window_size),
            score=self.score,
            engine=self._engine_for(grid),
            checks=Checks(self.texture, self.ambiguity, self.left_right),
            progress=progress,
        )

    def _by_volume(self, left: Image, right: Image, progress: Progress) -> Displacements:
        """Take the disparity of the cheapest paths through the volume of all matching costs."""
        assert isinstance(self.search, RectifiedSearch)
        assert self.optimisation is not None
        return match_by_volume(
            left,
            right,
            window_size=self.window_size,
            search=self.search,
            cost=self.cost,
            optimisation=self.optimisation,
            checks=Checks(self.texture, self.ambiguity, self.left_right),
            progress=progress,
        )

    def _finished(self, found: Displacements, left: Image, right: Image) -> Displacements:
        """Filter and fill the map, as far as the settings ask for it."""
        if self.speckle is None and not self.filling and self.median is None:
            return found
        disparity, reason = -found.dx, found.reason
        if self.speckle is not None:
            disparity, reason = without_speckles(disparity, reason, self.speckle)
        if self.filling:
            disparity, reason = filled_from_behind(disparity, reason)
        if self.median is not None:
            disparity = edge_respecting_median(disparity, eight_bit(left, right)[0], self.median)
        nothing = np.float32(np.nan)
        # Only a search along the row is ever filled: there nothing moves up or down.
        dy = np.where(reason == Reason.FILLED, np.float32(0), found.dy)
        dy = np.where(np.isnan(disparity), nothing, dy)
        return Displacements(dy=dy, dx=-disparity, score=found.score, reason=reason)

    def _engine_for(self, grid: WindowGrid) -> Engine:
        if self._needs_spectrum:
            return "fft"
        if self.left_right is not None:
            return "window_sums"
        if self.engine == "auto":
            lags = guarded(self.search.lags(self.window_size))
            return cheaper_engine(grid.shape, self.window_size, self.step, lags)
        return self.engine
