"""The reason why a pixel was matched as it was or left blank, and example pixels for each kind of match."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from enum import StrEnum
from typing import TypeAlias

import cv2
import numpy as np
import numpy.typing as npt

from stereolag.core.arrays import Box, FloatMap, ReasonMap
from stereolag.core.inputs import as_grey, as_stereo_pair, rescale_extreme_floats
from stereolag.core.jobs import Progress, silent
from stereolag.stereo.matcher import DisparityMap, Reason
from stereolag.stereo.windows.engines import score_surface
from stereolag.stereo.windows.matcher import CorrelationMatcher, cheaper_engine, find_matches
from stereolag.stereo.windows.pixels import fit_peaks
from stereolag.stereo.windows.search import LagRange, Score, WindowMatches, WindowQuery

Surface: TypeAlias = npt.NDArray[np.float64]
"""(n_dy, n_dx) scores; NaN = no candidate."""

Lag: TypeAlias = tuple[int, int]
"""(dy, dx), right minus left, px."""

SAME_PEAK_PX = 0.01
"""Distance up to which two maxima are the same, px: the compiled fit approximates its logarithms."""


def window_start(pixel: int, length: int, size: int, step: int) -> int:
    """Return the start of the window whose cell contains the pixel; near the border, of the nearest whole window."""
    return int(np.clip((pixel - (size - step) // 2) // step, 0, (length - size) // step)) * step


def best_match(surface: Surface, query: WindowQuery) -> tuple[Lag | None, FloatMap]:
    """Return the lag of the highest score, the shortest if several are equal, and the scores around it."""
    lags, vertical = query.lags, int(query.lags.rows > 1)
    nothing = np.full((1 + 2 * vertical, 3), np.nan, np.float32)
    if np.isnan(surface).all():
        return None, nothing
    dy, dx = lags.ranked()
    first = np.argmax(surface[dy - lags.dy_first, dx - lags.dx_first] >= np.nanmax(surface))
    row, col = int(dy[first]) - lags.dy_first, int(dx[first]) - lags.dx_first
    framed = np.pad(surface, 1, mode="wrap") if query.circular else np.pad(surface, 1, constant_values=np.nan)
    around = framed[row + 1 - vertical : row + 2 + vertical, col : col + 3].astype(np.float32)
    return (int(dy[first]), int(dx[first])), around


def highest_lag(surface: Surface, lags: LagRange) -> Lag | None:
    """Return the first lag with the highest score; None without a candidate."""
    if np.isnan(surface).all():
        return None
    row, col = divmod(int(np.nanargmax(surface)), surface.shape[1])
    return row + lags.dy_first, col + lags.dx_first


def score_at(surface: Surface, lags: LagRange, lag: Lag | None) -> float:
    """Return the score of a lag of the search; NaN if the lag is None."""
    return float("nan") if lag is None else float(surface[lag[0] - lags.dy_first, lag[1] - lags.dx_first])


def _section(values: Surface, offset: tuple[float, float]) -> tuple[float, float, float] | None:
    """Return value, slope and bend along dx, at dx 0, of the paraboloid fitted to (3, 3) values, at its maximum's dy.

    None if its maximum differs from `offset`, which was then fitted to the row alone, or if there is only one row.
    """
    if len(values) == 1 or not np.isfinite(values).all():
        return None
    dy, dx = np.mgrid[-1:2, -1:2].reshape(2, -1).astype(np.float64)
    terms = np.column_stack([np.ones(9), dx, dx**2, dy, dy**2, dx * dy])
    value, slope, bend, slope_y, bend_y, twist = np.linalg.lstsq(terms, values.ravel(), rcond=None)[0]
    y, x = offset
    section = value + slope_y * y + bend_y * y**2, slope + twist * y, bend
    return section if abs(section[1] + 2 * bend * x) < 2 * SAME_PEAK_PX * abs(bend) else None


def passes(scores: Surface, peak: tuple[int, int], *, wrapped: bool = False) -> Surface:
    """Return the height of the pass to every lag: the lowest score on the best path from the peak.

    It equals the lag's own score if the path never climbs. Otherwise the lag is on another hill, which rises above the
    pass by the difference. This is the greyscale reconstruction of `scores` from the peak (Vincent 1993), for searches
    along the row as well as in both directions.

    Parameters
    ----------
    scores
        (n_dy, n_dx); NaN = no candidate, which no path crosses.
    peak
        Its indices (row, col).
    wrapped
        Whether the last row and column wrap around to the first, as in a circular correlation.

    Returns
    -------
    ndarray
        (n_dy, n_dx) float64; NaN where there is no candidate, and the lowest score of all where no path leads.
    """
    known = np.isfinite(scores)
    terrain = np.where(known, scores, -np.inf)
    lowest = float(terrain[known].min())
    heights = np.full(scores.shape, -np.inf)
    heights[peak] = terrain[peak]
    while True:
        framed = np.pad(heights, 1, mode="wrap") if wrapped else np.pad(heights, 1, constant_values=-np.inf)
        dilated = cv2.dilate(framed, np.ones((3, 3), np.uint8))[1:-1, 1:-1]
        spread = np.minimum(dilated, terrain)
        if np.array_equal(spread, heights):
            return np.where(known, np.maximum(heights, lowest), np.nan)
        heights = spread


def lobe(scores: Surface, heights_of_passes: Surface, dip: float) -> npt.NDArray[np.bool_]:
    """Return the (n_dy, n_dx) mask of the lags in the lobe of the peak.

    A lag is outside if every path to it drops more than `dip` below its own score; a smaller rise above the pass is
    only a ripple on the slope.
    """
    return np.isfinite(scores) & (scores - heights_of_passes <= dip)


def beyond_lobe(
    surface: Surface, lags: LagRange, peak: Lag | None, dip: float, *, wrapped: bool
) -> tuple[Lag | None, float, float]:
    """Return the runner-up beyond the lobe of a peak and the best score on its flank.

    Parameters
    ----------
    surface, lags
        The scores and the lags they belong to.
    peak
        (dy, dx) of the best score; None if no lag was scored.
    dip, wrapped
        As for :func:`lobe` and :func:`passes`.

    Returns
    -------
    (dy, dx) or None
        The best lag outside the lobe.
    float
        The height of the pass to it; NaN without such a lag.
    float
        The best score in the lobe more than 1 px from the peak; NaN if the lobe is no wider.
    """
    if peak is None:
        return None, float("nan"), float("nan")
    row, col = peak[0] - lags.dy_first, peak[1] - lags.dx_first
    heights = passes(surface, (row, col), wrapped=wrapped)
    flank = lobe(surface, heights, dip)
    runner_up = highest_lag(np.where(flank, np.nan, surface), lags)
    flank[max(0, row - 1) : row + 2, max(0, col - 1) : col + 2] = False
    return runner_up, score_at(heights, lags, runner_up), float(surface[flank].max()) if flank.any() else float("nan")


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
    """A low score in a window with contrast: nothing in the search area resembles it."""
    AT_EDGE = "at_edge"
    """The best score is at the edge of the search area or of the image, beyond which there may be a better one."""
    NOTHING = "nothing"
    """No lag could be scored."""


@dataclass(frozen=True, eq=False)
class MatchExplanation:
    """The scores and the match of one window, before any check or filter of the finished map.

    Attributes
    ----------
    window
        The window in the left image.
    search
        The part of the right image that was searched, clipped to the frame.
    surface
        (n_dy, n_dx) float64 scores over the search area; NaN = no candidate.
    dy, dx
        The displacements of its rows and columns, right minus left, px.
    peak, runner_up
        (dy, dx) of the best score, and of the best score outside the peak's lobe
        (:func:`stereolag.assess.explaining.lobe`); None if there is none.
    peak_score, runner_up_score
        Their scores; NaN if there is none.
    valley
        The lowest score on the best path from the peak to the runner-up; NaN without a runner-up.
    flank_score
        The best score in the peak's lobe more than 1 px from it; NaN if there is none.
    score_tolerance
        Scores that differ by less count as equal; a dip in the scores that is no deeper is not a valley.
    at_edge
        Whether the map rejects the peak: a lag one pixel outside the search area scores higher, or the matching window
        touches the border of the right image.
    around
        (3, 3) float32 scores around the peak, or (1, 3) for a search along the row, as the matcher fits them. One extra
        lag is scored at either end of the search, so that every searched lag has neighbours; NaN = no candidate.
    offset
        (dy, dx) from the peak to the sub-pixel peak, px, from :func:`~stereolag.stereo.windows.pixels.fit_peaks`; 0
        at the edge.
    contrast
        Standard deviation of the grey levels in the window, as a share of the whole image's.
    score
        The score by which windows were compared.
    """

    window: Box
    search: Box
    surface: Surface
    dy: npt.NDArray[np.intp]
    dx: npt.NDArray[np.intp]
    peak: Lag | None
    runner_up: Lag | None
    peak_score: float
    runner_up_score: float
    valley: float
    flank_score: float
    score_tolerance: float
    at_edge: bool
    around: FloatMap
    offset: tuple[float, float]
    contrast: float
    score: Score

    @property
    def row(self) -> Surface:
        """Return the (n_dx,) scores along the peak's row, or along the row of the dy nearest 0 without a peak."""
        dy = self.peak[0] if self.peak else int(self.dy[np.argmin(np.abs(self.dy))])
        return np.asarray(self.surface[dy - int(self.dy[0])])

    def window_at(self, lag: Lag) -> Box:
        """Return the window moved by (dy, dx): its place in the right image."""
        return replace(self.window, row=self.window.row + lag[0], col=self.window.col + lag[1])

    @property
    def found(self) -> Box | None:
        """Return the matching window in the right image; None if no lag could be scored."""
        return None if self.peak is None else self.window_at(self.peak)

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
        """Return the fitted curve along dx whose maximum is the sub-pixel peak, at (n,) offsets from the peak, px.

        For a search along the row it is the Gaussian through the peak and its two neighbours; for a square search, the
        section of the two-dimensional Gaussian fitted to the nine scores, at the dy of its maximum. If a score is not
        positive, a parabola or paraboloid is fitted instead. It is NaN if a neighbour is missing.
        """
        dx, scores = np.asarray(offsets, dtype=np.float64), self.around.astype(np.float64)
        row = scores[len(scores) // 2]
        if self.at_edge or not np.isfinite(row).all():
            return np.full(dx.shape, np.nan)
        gaussian = bool((scores > 0).all())
        section = _section(np.log(scores) if gaussian else scores, self.offset)
        if section is None:
            gaussian = bool((row > 0).all())
            before, peak, after = np.log(row) if gaussian else row
            section = peak, (after - before) / 2, (before - 2 * peak + after) / 2
        value, slope, bend = section
        curve = value + slope * dx + bend * dx**2
        return np.asarray(np.exp(curve) if gaussian else curve)

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
        least_lead = max(self.score_tolerance, RIVAL_SHARE * (self.peak_score - self.valley))
        if self.peak_score - self.runner_up_score < least_lead:
            return MatchKind.REPEATS
        return MatchKind.SMOOTH if self.peak_score - self.flank_score < self.score_tolerance else MatchKind.CLEAR


AMBIGUOUS_MARGIN = 0.03
"""Scores that differ by a smaller share count as equal; for "ncc", a share of the part not due to the mean."""

RIVAL_SHARE = 0.1
"""A second peak counts as equal to the first if it is lower by less than this share of the valley's depth below it."""

BARE_CONTRAST = 0.1
"""A window with less than this share of the image's contrast counts as bare."""

POOR_SCORE = 0.6
"""A ZNCC peak below this is hardly better than chance for a window of a hundred pixels or so."""


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
    top, start = window_start(row, height, size, matcher.step), window_start(col, width, size, matcher.step)
    grey = rescale_extreme_floats(as_grey(images[0]), as_grey(images[1]))
    query = replace(matcher.query(*grey), runner_up=False, right_matches=False)
    guarded_surface = score_surface(query, top, start)
    best, around = best_match(guarded_surface, query)
    guarded, asked = query.lags, matcher.search.lags(size)
    surface = guarded_surface[
        asked.dy_first - guarded.dy_first : asked.dy_last - guarded.dy_first + 1,
        asked.dx_first - guarded.dx_first : asked.dx_last - guarded.dx_first + 1,
    ]
    dy, dx = np.arange(asked.dy_first, asked.dy_last + 1), np.arange(asked.dx_first, asked.dx_last + 1)
    inside = best is not None and best[0] in dy and best[1] in dx
    peak = best if inside else highest_lag(surface, asked)
    window = grey[0][top : top + size, start : start + size].astype(np.float64)
    tolerance = AMBIGUOUS_MARGIN * abs(score_at(surface, asked, peak))
    if matcher.score == "ncc":
        tolerance *= float(window.var() / (np.mean(window**2) or 1.0))
    runner_up, valley, flank_score = beyond_lobe(surface, asked, peak, tolerance, wrapped=query.circular)
    # In a searched direction, the matching window has a neighbour outside the right image.
    at_frame = peak is not None and (
        start + peak[1] in (0, width - size) or (asked.rows > 1 and top + peak[0] in (0, height - size))
    )
    at_edge = not inside or (at_frame and not query.circular)
    offset_dy, offset_dx = (0.0, 0.0) if at_edge else (float(one[0, 0]) for one in fit_peaks(around[:, :, None, None]))
    return MatchExplanation(
        window=Box(top, start, size, size),
        search=_search_area(top, start, size, asked, (height, width)),
        surface=surface,
        dy=dy,
        dx=dx,
        peak=peak,
        runner_up=runner_up,
        peak_score=float(around[len(around) // 2, 1]) if inside else score_at(surface, asked, peak),
        runner_up_score=score_at(surface, asked, runner_up),
        valley=valley,
        flank_score=flank_score,
        score_tolerance=tolerance,
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


def _search_area(top: int, start: int, size: int, lags: LagRange, shape: tuple[int, int]) -> Box:
    """Return the part of the right image in which a window is searched for."""
    first_row, end_row = max(0, top + lags.dy_first), min(shape[0], top + size + lags.dy_last)
    first_col, end_col = max(0, start + lags.dx_first), min(shape[1], start + size + lags.dx_last)
    return Box(first_row, first_col, end_row - first_row, max(0, end_col - first_col))


OPENCV_FILTERS: tuple[tuple[Reason, str, int], ...] = (
    (Reason.SPECKLE, "speckle_window_size", 0),
    # StereoSGBM reads a tolerance of -1 or 0 as 1; only a tolerance that no two disparities exceed disables the check.
    (Reason.LEFT_RIGHT, "disp12_max_diff", 1 << 20),
    (Reason.AMBIGUOUS, "uniqueness_ratio", 0),
    (Reason.LOW_TEXTURE, "texture_threshold", 0),
)
"""OpenCV's filters, last to run first: the reason each gives, its setting, and the value that switches it off."""


def blank_reasons(
    result: DisparityMap, left: npt.ArrayLike, right: npt.ArrayLike, *, progress: Progress = silent
) -> ReasonMap:
    """Return the reason of every pixel of a map, (H, W) uint8, inferring those of blank pixels for OpenCV's matchers.

    This library's own matchers record their reasons. For OpenCV's, the pair is matched again with the filters switched
    off one after another, from the last to the first: a pixel that returns was blanked by the filter just switched off.
    A pixel that no filter blanked is too close to the border for the search. `progress` is called after every run.
    """
    matcher = result.settings
    if matcher.gives_reasons:
        return result.reason
    reason = np.where(result.valid, result.reason, Reason.OUT_OF_FRAME).astype(np.uint8)
    unexplained = ~result.valid
    switches = [one for one in OPENCV_FILTERS if one[1] in type(matcher).model_fields]
    for done, (cause, setting, switched_off) in enumerate(switches, start=1):
        # Not validated: the value that disables the left-right check is outside the setting's range.
        matcher = matcher.model_copy(update={setting: switched_off})
        returned = unexplained & matcher.compute(left, right).valid
        reason[returned] = cause
        unexplained &= ~returned
        progress(done / len(switches))
    return reason


class ExampleKind(StrEnum):
    """The kinds of example: some of :class:`MatchKind`, and a point that a nearer object hides from the right view."""

    CLEAR = "clear"
    REPEATS = "repeats"
    BARE = "bare"
    HIDDEN = "hidden"


MAX_CANDIDATES = 150
"""Largest number of windows examined in each group, the most promising first."""

MAX_CONFUSABLE_LEAD = 0.1
"""Windows whose two best scores differ by less than this share of the best may show a repeating pattern."""

MIN_VALLEY_DEPTH = 0.5
"""Between two repetitions of a pattern, scores fall by at least this share of the way to their lowest."""

MAX_SECOND_PEAK_FALL = 1.5
"""A runner-up is a second peak if it is below the peak by less than this many times the mean fall to the peak's
neighbours: on the flank of a parabola it is at least twice."""

MIN_HIDDEN_PX = 3
"""Width from which a gap is a strip hidden by a near object, px; narrower ones are due to rounding."""


def example_pixel(
    kind: ExampleKind,
    matcher: CorrelationMatcher,
    left: npt.ArrayLike,
    right: npt.ArrayLike,
    *,
    progress: Progress = silent,
) -> tuple[int, int] | None:
    """Return the (row, col) in the left image that best shows a kind of match; None if the pair has no example.

    The matcher provides window, search area and score; the pair is as for :func:`explain_match`.
    """
    images = as_stereo_pair(left, right)
    if kind is ExampleKind.HIDDEN:
        # Mirrored, the right image is a left one; mirrored back, its map is that of the right image's pixels.
        mirrored = (np.ascontiguousarray(image[:, ::-1]) for image in images[::-1])
        strips = _hidden_strips(matcher.compute(*mirrored, progress=progress).disparity[:, ::-1])
        from_edge = cv2.distanceTransform(strips.astype(np.uint8), cv2.DIST_L2, 5)
        middle = divmod(int(np.argmax(from_edge)), from_edge.shape[1])
        return middle if 2 * float(from_edge.max()) >= MIN_HIDDEN_PX else None
    left, right = (as_grey(image) for image in images)
    size, step = matcher.window_size, max(2, matcher.window_size // 4)
    query = replace(matcher.query(left, right), step=step, runner_up=True, right_matches=False)
    needs_spectrum = query.circular or query.score == "phase"
    engine = "fft" if needs_spectrum else cheaper_engine(left.shape, size, step, query.lags)
    matches = find_matches(query, engine, progress)
    merits, wanted = _merits(kind, matches, float(left.std()))
    # Windows whose search along the row stays within the image come first.
    lags, start = matcher.search.lags(size), np.arange(0, left.shape[1] - size + 1, step)
    whole = (start + lags.dx_first >= 0) & (start + size + lags.dx_last <= left.shape[1])
    promising = [window for merit in merits for window in _highest_first(merit)]
    for window in sorted(promising, key=lambda window: not whole[window % whole.size]):
        row, col = (int(index) * step + (size - 1) // 2 for index in np.unravel_index(window, matches.score.shape))
        match = explain_match(matcher, *images, row, col)
        if match.kind in wanted and (kind is not ExampleKind.REPEATS or match.valley_depth > MIN_VALLEY_DEPTH):
            return row, col
    return None


def _merits(kind: ExampleKind, matches: WindowMatches, deviation: float) -> tuple[Sequence[FloatMap], set[MatchKind]]:
    """Return how promising each window is as an example, in groups, the best group first, and the kinds wanted.

    Bare windows without any match come before those of a smooth sky, then others with little texture. A repeating
    pattern has textured windows with two equal peaks; a runner-up on the peak's flank is not a second peak.
    """
    score, around = matches.score, matches.around
    if kind is ExampleKind.BARE:
        bare = matches.texture < BARE_CONTRAST * deviation
        groups = np.where(bare, -np.nan_to_num(score, nan=-1.0), np.nan), np.where(bare, np.nan, -matches.texture)
        return groups, {MatchKind.BARE, MatchKind.SMOOTH, MatchKind.NOTHING}
    assert matches.runner_up is not None
    lead = score - matches.runner_up
    if kind is ExampleKind.CLEAR:
        return [lead], {MatchKind.CLEAR}
    falls = [score - around[len(around) // 2, [0, 2]].mean(axis=0)]
    if len(around) > 1:
        falls.append(score - around[[0, 2], 1].mean(axis=0))
    second_peak = lead < MAX_SECOND_PEAK_FALL * np.minimum.reduce(falls)
    confusable = (lead < MAX_CONFUSABLE_LEAD * np.abs(score)) & second_peak
    merit = (MAX_CONFUSABLE_LEAD * np.abs(score) - lead) * np.sqrt(matches.texture)
    return [np.where(confusable, merit, np.nan)], {MatchKind.REPEATS}


def _highest_first(merit: FloatMap) -> list[int]:
    known = np.flatnonzero(np.isfinite(merit))
    return list(known[np.argsort(merit.ravel()[known])[::-1]][:MAX_CANDIDATES].tolist())


def _hidden_strips(right_disparity: npt.NDArray[np.float32]) -> npt.NDArray[np.bool_]:
    """Return the (H, W) mask of pixels of the left image that the right camera cannot see, from the right image's map.

    No pixel of the right image is matched to them, and the gap is as wide as the rise in disparity across it: a nearer
    object hides a strip of the background of exactly that width. Other gaps are mismatches.
    """
    left_disparity = np.full_like(right_disparity, -np.inf)
    rows, cols = np.nonzero(np.isfinite(right_disparity))
    left_cols = np.rint(cols + right_disparity[rows, cols]).astype(np.intp)
    inside = (left_cols >= 0) & (left_cols < right_disparity.shape[1])
    rows, cols, left_cols = rows[inside], cols[inside], left_cols[inside]
    np.maximum.at(left_disparity, (rows, left_cols), right_disparity[rows, cols])  # the nearer one occludes
    gap = np.isneginf(left_disparity)
    left_disparity[gap] = np.nan
    gap[:, [0, -1]] = False  # a gap at the border has no other side
    change = np.diff(gap.astype(np.int8), axis=1)
    (row, before), (_, last) = np.nonzero(change == 1), np.nonzero(change == -1)
    width = last - before
    rise = left_disparity[row, last + 1] - left_disparity[row, before]
    hidden = (width >= MIN_HIDDEN_PX) & (np.abs(rise - width) <= 1 + width / 4)
    strips = np.zeros(gap.shape, dtype=np.bool_)
    for y, start, end in zip(row[hidden], before[hidden] + 1, last[hidden] + 1, strict=True):
        strips[y, start:end] = True
    return strips
