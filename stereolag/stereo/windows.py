"""Matching window by window: from the scores of an engine to a displacement, or a reason, for every pixel."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TypeVar

import numpy as np
import numpy.typing as npt

from stereolag.inputs import Image, grey_level
from stereolag.kernels.lag_range import LagRange
from stereolag.kernels.matches import WindowMatches
from stereolag.kernels.peak_fits import fit_peaks
from stereolag.progress import Progress
from stereolag.stereo.checks import FLAT_TEXTURE, Checks, left_right_disagree
from stereolag.stereo.engines import Engine, Score, find_matches
from stereolag.stereo.matcher import Displacements
from stereolag.stereo.result import Reason, ReasonMap

Value = TypeVar("Value", bound=np.generic)


@dataclass(frozen=True)
class WindowGrid:
    """Where the windows lie: side and step in px, and the (rows, cols) of the image."""

    window_size: int
    step: int
    shape: tuple[int, int]

    def spread(self, grid: npt.NDArray[Value], outside: np.generic) -> npt.NDArray[Value]:
        """Return the (H, W) picture of a grid of values, `outside` where no window's cell reaches.

        Every pixel takes the value of the window whose centre is nearest: a window fills a cell of step × step px.
        """
        first = (self.window_size - self.step) // 2
        cells = grid if self.step == 1 else grid.repeat(self.step, axis=0).repeat(self.step, axis=1)
        picture = np.full(self.shape, outside, dtype=grid.dtype)
        picture[first : first + cells.shape[0], first : first + cells.shape[1]] = cells
        return picture


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
    reason = _reasons(matches, grid, lags, circular=circular, checks=checks, flat=flat)
    nothing = np.float32(np.nan)
    dy, dx = fit_peaks(matches.around)
    dx += matches.dx
    if lags.rows > 1:
        dy += matches.dy
    best = matches.score
    # The scores around each peak take three times the memory of a map: gone before the maps are copied.
    del matches
    measured = reason == Reason.MEASURED
    return Displacements(
        dy=grid.spread(np.where(measured, dy, nothing), nothing),
        dx=grid.spread(np.where(measured, dx, nothing), nothing),
        score=grid.spread(best, nothing),
        reason=grid.spread(reason, np.uint8(Reason.OUT_OF_FRAME)),
    )


def guarded(lags: LagRange) -> LagRange:
    """Return the range with one guard lag at each end of every direction that is searched at all.

    A peak on the border of the search has no sub-pixel neighbour and may be the flank of a higher one outside. With
    the guard every lag asked for has both neighbours, and only a peak *on* the guard is in doubt.
    """
    vertical = int(lags.rows > 1)
    return LagRange(lags.dy_first - vertical, lags.dy_last + vertical, lags.dx_first - 1, lags.dx_last + 1)


def _reasons(
    matches: WindowMatches, grid: WindowGrid, lags: LagRange, *, circular: bool, checks: Checks, flat: float
) -> ReasonMap:
    """Return why each window has its answer or none; of several reasons the most basic one, which is found last."""
    reason = np.full(matches.score.shape, Reason.MEASURED, dtype=np.uint8)
    # np.where runs through noise at the speed of memory; an assignment under a mask guesses every pixel's branch.
    if checks.left_right is not None and matches.right_dx is not None:
        disagree = left_right_disagree(matches.dx, matches.right_dx, checks.left_right.tolerance)
        reason = np.where(disagree, np.uint8(Reason.LEFT_RIGHT), reason)
    if checks.ambiguity is not None and matches.runner_up is not None:
        level = matches.score - matches.runner_up < checks.ambiguity.lead
        reason = np.where(level, np.uint8(Reason.AMBIGUOUS), reason)
    if not circular:
        reason = np.where(_inside(lags, matches), reason, np.uint8(Reason.AT_SEARCH_EDGE))
        reason = np.where(_cut_off_by_the_frame(matches, grid, lags), np.uint8(Reason.OUT_OF_FRAME), reason)
    reason = np.where(np.isnan(matches.score), np.uint8(Reason.OUT_OF_FRAME), reason)
    return np.where(matches.texture <= flat, np.uint8(Reason.LOW_TEXTURE), reason)


def _inside(lags: LagRange, matches: WindowMatches) -> npt.NDArray[np.bool_]:
    """Return where the peak is one of the lags asked for and not on the guard around them."""
    inside = np.asarray((matches.dx >= lags.dx_first) & (matches.dx <= lags.dx_last))
    if lags.rows > 1:
        inside &= (matches.dy >= lags.dy_first) & (matches.dy <= lags.dy_last)
    return inside


def _cut_off_by_the_frame(matches: WindowMatches, grid: WindowGrid, lags: LagRange) -> npt.NDArray[np.bool_]:
    """Return where the frame of the right image cuts the search short right beside the peak."""
    cols = np.arange(matches.dx.shape[1], dtype=np.int32) * grid.step + matches.dx
    cut = (cols == 0) | (cols == grid.shape[1] - grid.window_size)
    if lags.rows > 1:
        rows = np.arange(matches.dy.shape[0], dtype=np.int32)[:, None] * grid.step + matches.dy
        cut |= (rows == 0) | (rows == grid.shape[0] - grid.window_size)
    return np.asarray(cut)
