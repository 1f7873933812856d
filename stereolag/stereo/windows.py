"""Matching window by window: from the scores of an engine to a displacement, or a reason, for every pixel."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from stereolag.inputs import Image, grey_level
from stereolag.kernels.answers import Causes, Cells, answer
from stereolag.kernels.lag_range import LagRange
from stereolag.kernels.matches import WindowMatches
from stereolag.kernels.peak_fits import fit_peaks
from stereolag.progress import Progress
from stereolag.stereo.checks import FLAT_TEXTURE, Checks, left_right_disagree
from stereolag.stereo.engines import Engine, Score, find_matches
from stereolag.stereo.matcher import Displacements
from stereolag.stereo.result import Reason, ReasonMap

CAUSES = Causes(Reason.MEASURED, Reason.OUT_OF_FRAME, Reason.LOW_TEXTURE, Reason.AT_SEARCH_EDGE)


@dataclass(frozen=True)
class WindowGrid:
    """Where the windows lie: side and step in px, and the (rows, cols) of the image."""

    window_size: int
    step: int
    shape: tuple[int, int]

    @property
    def cells(self) -> Cells:
        """Return where the windows' cells lie, and the last place in the picture where a window fits."""
        height, width = self.shape
        first = (self.window_size - self.step) // 2
        return Cells(first, self.step, height - self.window_size, width - self.window_size)


def match_by_windows(
    left: Image,
    right: Image,
    *,
    grid: WindowGrid,
    lags: LagRange,
    circular: bool,
    score: Score,
    engine: Engine,
    checks: Checks,
    progress: Progress,
) -> Displacements:
    """Match two grey images window by window and check what was found.

    Parameters
    ----------
    left, right
        (H, W) grey images of one type.
    grid
        The windows.
    lags
        The displacements asked for, right minus left, px.
    circular
        Whether the correlation wraps around at the window (the report's unpadded case).
    score, engine
        What is computed, and how.
    checks
        Of these the left-right check needs step 1 and a search along the row.
    progress
        Called with the fraction done.
    """
    matches = find_matches(
        left,
        right,
        engine=engine,
        score=score,
        window_size=grid.window_size,
        step=grid.step,
        lags=lags if circular else guarded(lags),
        circular=circular,
        runner_up=checks.ambiguity is not None,
        right_matches=checks.left_right is not None,
        progress=progress,
    )
    flat = (checks.texture.least if checks.texture else FLAT_TEXTURE) * grey_level(left, right)
    beside = fit_peaks(matches.around)
    found = answer(
        matches,
        beside,
        shape=grid.shape,
        cells=grid.cells,
        lags=lags,
        circular=circular,
        flat=flat,
        causes=CAUSES,
        before=_refused(matches, checks),
    )
    return Displacements(dy=found.dy, dx=found.dx, score=found.score, reason=found.cause)


def guarded(lags: LagRange) -> LagRange:
    """Return the range with one guard lag at each end of every direction that is searched at all.

    A peak on the border of the search has no sub-pixel neighbour and may be the flank of a higher one outside. With
    the guard every lag asked for has both neighbours, and only a peak *on* the guard is in doubt.
    """
    vertical = int(lags.rows > 1)
    return LagRange(lags.dy_first - vertical, lags.dy_last + vertical, lags.dx_first - 1, lags.dx_last + 1)


def _refused(matches: WindowMatches, checks: Checks) -> ReasonMap | None:
    """Return which windows the left-right check or the test for ambiguity refuses; None where neither is asked for."""
    reason: ReasonMap | None = None
    measured = np.full(matches.score.shape, Reason.MEASURED, dtype=np.uint8)
    # np.where runs through noise at the speed of memory; an assignment under a mask guesses every pixel's branch.
    if checks.left_right is not None and matches.right_dx is not None:
        disagree = left_right_disagree(matches.dx, matches.right_dx, checks.left_right.tolerance)
        reason = np.where(disagree, np.uint8(Reason.LEFT_RIGHT), measured)
    if checks.ambiguity is not None and matches.runner_up is not None:
        level = matches.score - matches.runner_up < checks.ambiguity.lead
        reason = np.where(level, np.uint8(Reason.AMBIGUOUS), measured if reason is None else reason)
    return reason
