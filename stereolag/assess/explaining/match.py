"""Explanation of one match: all scores of the window around a pixel, and the match that the map takes from them."""

from __future__ import annotations

from dataclasses import dataclass, replace
from enum import StrEnum

import numpy as np
import numpy.typing as npt

from stereolag.assess.explaining.lobes import beyond_lobe
from stereolag.assess.explaining.one_window import (
    Lag,
    Surface,
    best_match,
    fitted_curve,
    highest,
    score_at,
    window_start,
)
from stereolag.core.arrays import FloatMap
from stereolag.core.inputs import as_grey, as_stereo_pair, of_ordinary_size
from stereolag.stereo.windows.matcher import CorrelationMatcher
from stereolag.stereo.windows.matches import Score
from stereolag.stereo.windows.peak_fits import fit_peaks
from stereolag.stereo.windows.search import LagRange
from stereolag.stereo.windows.window_fft import score_surface


class MatchKind(StrEnum):
    """The kinds of match."""

    CLEAR = "clear"
    """One peak, well above every other score."""
    REPEATS = "repeats"
    """Two separate peaks of nearly the same height, with a valley between them: a repeating pattern."""
    SMOOTH = "smooth"
    """One broad peak: its own neighbours score nearly the same."""
    BARE = "bare"
    """A low score in a window with little contrast."""
    UNLIKE = "unlike"
    """A low score in a window with contrast: nothing in the search area looks like it."""
    AT_EDGE = "at_edge"
    """The best score is at the edge of the search area or of the image: there may be a better one beyond."""
    NOTHING = "nothing"
    """No lag could be scored."""


@dataclass(frozen=True)
class Box:
    """A rectangle in an image: top-left pixel and size, px."""

    row: int
    col: int
    height: int
    width: int


@dataclass(frozen=True, eq=False)
class MatchExplanation:
    """The scores and the match of one window, before any check or filter of the finished map.

    Attributes
    ----------
    window
        The window in the left image.
    search
        The part of the right image that was searched, clipped to the frame.
    found
        The matching window in the right image; None if no lag could be scored.
    surface
        (n_dy, n_dx) float64 scores over the search area; NaN = no candidate.
    dy, dx
        The displacements of its rows and columns, right minus left, px.
    peak, runner_up
        (dy, dx) of the best score, and of the best score outside the peak's lobe
        (:func:`stereolag.assess.explaining.lobes.lobe`); None if there is none.
    peak_score, runner_up_score
        Their scores; NaN if there is none.
    valley
        The lowest score on the best path from the peak to the runner-up; NaN without a runner-up.
    flank_score
        The best score in the peak's lobe more than 1 px from it; NaN if there is none.
    as_good
        Scores that differ by less count as equal, and a shallower valley does not count as one.
    at_edge
        Whether the map rejects the peak: a lag one pixel outside the search area scores higher, or the matching window
        touches the border of the right image.
    around
        (3, 3) float32 scores around the peak, or (1, 3) for a search along the row, as the matcher fits them. One extra
        lag is scored at each end of the search, so that every searched lag has neighbours; NaN = no candidate.
    offset
        (dy, dx) from the peak to the sub-pixel peak, px, from :func:`~stereolag.stereo.windows.peak_fits.fit_peaks`; 0
        at the edge.
    contrast
        Standard deviation of the grey levels in the window, as a share of the whole image's.
    score
        The score by which windows were compared.
    """

    window: Box
    search: Box
    found: Box | None
    surface: Surface
    dy: npt.NDArray[np.intp]
    dx: npt.NDArray[np.intp]
    peak: Lag | None
    runner_up: Lag | None
    peak_score: float
    runner_up_score: float
    valley: float
    flank_score: float
    as_good: float
    at_edge: bool
    around: FloatMap
    offset: tuple[float, float]
    contrast: float
    score: Score

    @property
    def row(self) -> Surface:
        """Return the (n_dx,) scores along the peak's row, or along the row of the dy nearest 0 without a peak."""
        dy = self.peak[0] if self.peak else int(self.dy[np.argmin(np.abs(self.dy))])
        scores: Surface = self.surface[dy - int(self.dy[0])]
        return scores

    def score_at(self, lag: Lag) -> float:
        """Return the score at a (dy, dx); NaN if it was not searched or is not a candidate."""
        row, col = lag[0] - int(self.dy[0]), lag[1] - int(self.dx[0])
        inside = 0 <= row < self.dy.size and 0 <= col < self.dx.size
        return float(self.surface[row, col]) if inside else float("nan")

    @property
    def disparity(self) -> float:
        """Return the disparity that the map takes from this window, px; NaN if it takes none."""
        return float("nan") if self.peak is None or self.at_edge else -(self.peak[1] + self.offset[1])

    def fit(self, offsets: npt.ArrayLike) -> Surface:
        """Return the fitted curve along dx whose maximum is the sub-pixel peak.

        For a search along the row it is the Gaussian through the peak and its two neighbours; for a square search, the
        section of the two-dimensional Gaussian fitted to the nine scores, at the dy of its maximum. If a score is not
        positive, a parabola or paraboloid is fitted instead.

        Parameters
        ----------
        offsets
            (n,) dx from the peak, px.

        Returns
        -------
        ndarray
            (n,) float64 scores; NaN if a neighbour is missing.
        """
        at = np.asarray(offsets, dtype=np.float64)
        return np.full(at.shape, np.nan) if self.at_edge else fitted_curve(self.around, self.offset, at)

    @property
    def valley_depth(self) -> float:
        """Return the depth of the valley before the runner-up, 1 if it reaches the lowest score; NaN without one."""
        drop = self.peak_score - self.valley
        return float("nan") if np.isnan(drop) else drop / max(self.peak_score - float(np.nanmin(self.surface)), 1e-30)

    @property
    def kind(self) -> MatchKind:
        """Return the kind of match that the scores show."""
        if self.peak is None:
            return MatchKind.NOTHING
        if self.at_edge:
            return MatchKind.AT_EDGE
        if self.score == "zncc" and self.peak_score < POOR_SCORE:
            return MatchKind.BARE if self.contrast < BARE_CONTRAST else MatchKind.UNLIKE
        if self.peak_score - self.runner_up_score < max(self.as_good, RIVAL_SHARE * (self.peak_score - self.valley)):
            return MatchKind.REPEATS
        return MatchKind.SMOOTH if self.peak_score - self.flank_score < self.as_good else MatchKind.CLEAR


AMBIGUOUS_MARGIN = 0.03
"""Scores that differ by a smaller share count as equal; for "ncc", a share of the part not due to the mean."""

RIVAL_SHARE = 0.1
"""A second peak counts as equal to the first if it is lower by less than this share of the valley's depth."""

BARE_CONTRAST = 0.1
"""A window with less than this share of the image's contrast counts as bare."""

POOR_SCORE = 0.6
"""A lower ZNCC peak is hardly better than chance for a window of a hundred pixels or so."""


def explain_match(
    matcher: CorrelationMatcher, left: npt.ArrayLike, right: npt.ArrayLike, row: int, col: int
) -> MatchExplanation:
    """Score the window around one pixel of the left image at every lag of the search.

    Parameters
    ----------
    matcher
        Provides window, search area, score and engine.
    left, right
        (H, W), (H, W, 3) or (H, W, 4) images of one size and type.
    row, col
        The pixel; its window is the one that the matcher takes its disparity from.

    Raises
    ------
    ValueError
        If the images are not a pair or are smaller than the window, or the pixel is outside them.
    """
    images = as_stereo_pair(left, right)
    height, width = images[0].shape[:2]
    if not (0 <= row < height and 0 <= col < width):
        raise ValueError(
            f"pixel ({row}, {col}) is outside the image; rows run to {height - 1}, columns to {width - 1}."
        )
    size = matcher.window_size
    if size > min(height, width):
        raise ValueError(f"window_size is {size} px and the images are {width} × {height}; it must fit into them.")
    top, start = (window_start(at, end, size, matcher.step) for at, end in ((row, height), (col, width)))
    grey = of_ordinary_size(as_grey(images[0]), as_grey(images[1]))
    query = replace(matcher.query(*grey), runner_up=False, right_matches=False)
    every_score = score_surface(query, top, start)
    best, around = best_match(every_score, query)
    tried, asked = query.lags, matcher.search.lags(size)
    surface = every_score[
        asked.dy_first - tried.dy_first : asked.dy_last - tried.dy_first + 1,
        asked.dx_first - tried.dx_first : asked.dx_last - tried.dx_first + 1,
    ]
    inside = (
        best is not None and asked.dy_first <= best[0] <= asked.dy_last and asked.dx_first <= best[1] <= asked.dx_last
    )
    peak = best if inside else highest(surface, asked)
    dy, dx = np.arange(asked.dy_first, asked.dy_last + 1), np.arange(asked.dx_first, asked.dx_last + 1)
    window = grey[0][top : top + size, start : start + size].astype(np.float64)
    as_good = AMBIGUOUS_MARGIN * abs(score_at(surface, asked, peak))
    if matcher.score == "ncc":
        as_good *= float(window.var() / (np.mean(window**2) or 1.0))
    second, valley, flank = beyond_lobe(surface, asked, peak, as_good, wrapped=query.circular)
    found = Box(top + peak[0], start + peak[1], size, size) if peak else None
    at_edge = not inside or (found is not None and not query.circular and _touches_frame(found, (height, width), asked))
    offset_dy, offset_dx = (0.0, 0.0) if at_edge else (float(one[0, 0]) for one in fit_peaks(around[:, :, None, None]))
    return MatchExplanation(
        window=Box(top, start, size, size),
        search=_reached(top, start, size, asked, (height, width)),
        found=found,
        surface=surface,
        dy=dy,
        dx=dx,
        peak=peak,
        runner_up=second,
        peak_score=float(around[len(around) // 2, 1]) if inside else score_at(surface, asked, peak),
        runner_up_score=score_at(surface, asked, second),
        valley=valley,
        flank_score=flank,
        as_good=as_good,
        at_edge=at_edge,
        around=around,
        offset=(offset_dy, offset_dx),
        contrast=float(window.std() / (grey[0].std() or 1.0)),
        score=matcher.score,
    )


def with_rows_around(matcher: CorrelationMatcher, rows: int) -> CorrelationMatcher:
    """Return the matcher with a vertical reach of at least `rows` px, to show the scores around a one-row search."""
    lags = matcher.search.lags(matcher.window_size)
    if matcher.search.circular(matcher.window_size) or lags.dy_last >= rows:
        return matcher
    return matcher.model_copy(update={"search": matcher.search.model_copy(update={"vertical": rows})})


def _touches_frame(found: Box, shape: tuple[int, int], lags: LagRange) -> bool:
    """Return whether the matching window has a neighbour outside the right image in a searched direction."""
    across = found.col in (0, shape[1] - found.width)
    return across or (lags.rows > 1 and found.row in (0, shape[0] - found.height))


def _reached(top: int, start: int, size: int, lags: LagRange, shape: tuple[int, int]) -> Box:
    """Return the part of the right image that a window is searched in."""
    first_row, end_row = max(0, top + lags.dy_first), min(shape[0], top + size + lags.dy_last)
    first_col, end_col = max(0, start + lags.dx_first), min(shape[1], start + size + lags.dx_last)
    return Box(first_row, first_col, end_row - first_row, max(0, end_col - first_col))
