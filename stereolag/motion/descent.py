"""Coarse-to-fine estimation: at each level match both ways, weight, propagate and refine, then double the size."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from stereolag.core.arrays import FloatMap
from stereolag.core.jobs import Progress
from stereolag.motion.candidates import Candidates, best_of_neighbours, match_level
from stereolag.motion.checks import return_error
from stereolag.motion.pyramid import Flow, Frame, doubled
from stereolag.motion.refinement import VariationalRefinement, refined
from stereolag.motion.smoothing import edge_aware_mean
from stereolag.stereo.finishing.filters import MedianFilter
from stereolag.stereo.finishing.weighted_median import weighted_median

RESIDUAL = 2
"""Reach around the flow of the coarser level, px: 1 px in every direction, plus a margin for the sub-pixel fit."""

TRUSTED_TEXTURE = 0.7
"""Standard deviation from which a window has full weight among its neighbours, grey levels of 255."""

TRUSTED_RETURN = 1.5
"""Return error that halves the weight, px of the level."""

ROUNDS = (1, 1, 2, 3, 2)
"""Matching rounds per level, finest first: coarse levels have few pixels and can afford more."""


class View(NamedTuple):
    """The flow of one level, and the data by which its pixels are judged."""

    flow: Flow
    candidates: Candidates
    """The window matches, before propagation."""
    error: FloatMap
    """(H, W) return error of the flow there and back, px."""


@dataclass(frozen=True, eq=False)
class Descent:
    """Solver for the levels of two pyramids, one after the other.

    Attributes
    ----------
    window, search
        Side of the window, and reach at full size, px.
    median, refinement
        Smoothing of the flow between levels; None disables it.
    grey_level
        One grey level of 255 in the units of the frames.
    """

    window: int
    search: int
    median: MedianFilter | None
    refinement: VariationalRefinement | None
    grey_level: float

    def descend(self, firsts: list[Frame], seconds: list[Frame], progress: Progress) -> View:
        """Return the solution at the finest level.

        Parameters
        ----------
        firsts, seconds
            The pyramids of both frames, finest first.
        progress
            Called with the fraction done.
        """
        flows: tuple[Flow | None, Flow | None] = (None, None)
        for level in range(len(firsts) - 1, -1, -1):
            first, second = firsts[level], seconds[level]
            there, back = (None if flow is None else doubled(flow, first.shape) for flow in flows)
            view, back = self._solve(level, first, second, there, back)
            flows = view.flow, back
            progress(1 / 4**level)
        return view

    def _solve(
        self, level: int, first: Frame, second: Frame, there: Flow | None, back: Flow | None
    ) -> tuple[View, Flow]:
        """Match one level both ways; the finest only forwards, if a coarser level provides the way back."""
        both_ways = level > 0 or back is None
        for _ in range(ROUNDS[min(level, len(ROUNDS) - 1)]):
            candidates = self._match(level, first, second, there)
            returning = self._match(level, second, first, back) if both_ways else None
            returned = back if returning is None else returning.flow
            assert returned is not None
            error = return_error(candidates.flow, returned)
            there = self._carried_over(level, first, candidates, error)
            back = returned
            if returning is not None:
                back = self._carried_over(level, second, returning, return_error(returned, candidates.flow))
        assert there is not None and back is not None
        if self.refinement is not None:
            there = refined(there, first.guide, second.guide, self.refinement)
            if level > 0:
                back = refined(back, second.guide, first.guide, self.refinement)
        return View(there, candidates, return_error(there, back)), back

    def _match(self, level: int, first: Frame, second: Frame, flow: Flow | None) -> Candidates:
        reach = RESIDUAL
        if flow is None:
            # One lag more than requested: a peak on the border lacks a neighbour for the sub-pixel fit.
            reach = min(-(-self.search // 2**level) + 1, max(first.shape) - 1)
        found = match_level(first.grey, second.grey, flow, self.window, reach)
        return best_of_neighbours(found, max(1, self.window // 5))

    def _carried_over(self, level: int, frame: Frame, candidates: Candidates, error: FloatMap) -> Flow:
        """Return the flow propagated from certain to uncertain pixels along the surfaces of the frame."""
        sure = np.maximum(candidates.score, 0)
        trusted = np.float32(TRUSTED_TEXTURE * self.grey_level)
        weight = sure * sure * np.minimum(1, np.square(candidates.texture / trusted))
        weight /= 1 + np.square(np.square(error / np.float32(TRUSTED_RETURN)))
        flow = edge_aware_mean(candidates.flow, weight, frame.guide)
        # At full size the refinement does as well, and the median takes as long as the matching.
        if self.median is not None and (level > 0 or self.refinement is None):
            guide, radius = frame.guide[:, :, None], self.median.radius
            for part in flow:
                # Nine neighbours: twenty-five are no better here and take three times as long.
                part[...] = weighted_median(part, guide, radius, radius, self.median.contrast)
        return flow
