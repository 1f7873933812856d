"""The relative orientation of two views: the matches that agree on it, their row errors, and a rectification."""

from __future__ import annotations

from contextlib import suppress
from dataclasses import dataclass, replace
from itertools import pairwise

import cv2
import numpy as np

from stereolag.assess.features import (
    EXACT_TREE,
    FLOW_WINDOW_PX,
    MAX_SIDE_PX,
    MIN_MATCHES,
    SAME_POINT_PX,
    Correspondences,
    FeatureMatches,
    Points,
    at_full_size,
    match_features,
    tracked,
)
from stereolag.assess.uncalibrated import (
    NOISE_PX,
    UncalibratedRectification,
    centre_of,
    cost_of_errors,
    fit_rectification,
    held_out_errors,
)
from stereolag.core.arrays import Array, DoubleMap, EightBit, Indices, Mask, median, percentiles
from stereolag.core.inputs import Image, as_grey, transparent, with_border_transparent

MIN_NOISE_PX = 0.1
"""Noise assumed for matches at least, px."""

NOISE_CELLS = 100
"""Cells across the image, each of which contributes one match to the estimate of the noise."""

NOISE_NEIGHBOURS = 3
"""Number of neighbours with which each of these matches is compared."""

BEND_GRID = 16
"""Grid cells across and down in which row bend is evaluated."""

BEND_NEIGHBOURS = 5
"""Number of nearest matches whose median is the disparity of a grid cell."""

MIN_EVIDENCE = 20.0
"""Decrease in the summed logarithms of the errors that justifies more parameters."""

MIN_LENS_SIGMAS = 5.0
"""Standard deviations from 0 from which a lens coefficient is significant."""

MIN_BEND_RATIO = 1.5
"""Spread of the bend of a significant lens, over the noise of the matches."""

MAX_LENS = 1.0
"""Largest coefficient of a lens. Views that differ in sharpness or brightness displace all matches a little, which
strong lenses fit as well as anything."""

MAX_HEALTHY_LENS = 0.18
"""Lens coefficient above which rows are bent although the matches' spread is small: over near ground, where features
are rare, a drive's map loses 5 to 10 % of its pixels at 0.3."""

MAX_RECTIFIED_RATIO = 0.6
"""A rectification is worthwhile if held-out row errors are below this share of the residuals without it."""


def robust_fit(terms: DoubleMap, values: DoubleMap) -> DoubleMap:
    """Return the (k,) coefficients of ``values = terms @ coefficients``, px, by Cauchy-reweighted least squares."""
    weights = np.ones(len(values))
    for _ in range(10):
        root = np.sqrt(weights)
        coefficients, *_ = np.linalg.lstsq(terms * root[:, None], values * root, rcond=None)
        residuals = values - terms @ coefficients
        noise = max(MIN_NOISE_PX, 1.4826 * median(np.abs(residuals)))
        weights = 1 / (1 + (residuals / (2 * noise)) ** 2)
    return np.asarray(coefficients)


def vertical_plane(points: Correspondences) -> tuple[DoubleMap, DoubleMap]:
    """Return (a, b, c) of ``dy = a + b * (x - cx) + c * (y - cy)`` at (x, y) in the right image, fitted robustly.

    a is the row offset at the centre, px. Positions are in the right image, the one assumed to be rotated and scaled:
    as a function of positions in the left image, dy also depends on disparity, so that even an exact rotation would
    leave residuals. Also return the (n,) residuals: dy minus the best-fitting offset, rotation and scale, px.
    """
    from_centre, dy = points.right - centre_of(points.shape), points.dy.astype(np.float64)
    plane = robust_fit(np.column_stack([np.ones(len(points)), from_centre]), dy)
    return plane, np.asarray(dy - (plane[0] + from_centre @ plane[1:]))


def row_spread(residuals: DoubleMap) -> float:
    """Return a standard deviation that bent corners raise but a few wrong matches do not, px.

    The median reflects the middle of the image, where a lens does not bend rows; the 90th percentile, the corners.
    """
    middle, outer = percentiles(np.abs(residuals), 50, 90)
    return max(1.4826 * float(middle), float(outer) / 1.645)


def row_terms(points: Correspondences) -> DoubleMap:
    """Return the (n, 7) effects on dy of two slightly rotated cameras and a distorting lens.

    To first order: offset, rotation and scale of the right view; the yaws of the left and right cameras, their pitch;
    and radial distortion, which moves a point in proportion to the cube of its distance from the centre.
    """
    width, centre = points.shape[1], centre_of(points.shape)
    left, right = ((positions - centre) / width for positions in (points.left, points.right))
    x, y = left.T
    lens = right[:, 1] * (right**2).sum(axis=1) - y * (left**2).sum(axis=1)
    return np.column_stack([np.ones(len(points)), right, x * y, right[:, 0] * y, y * y, lens])


def bend_of(points: Correspondences) -> tuple[DoubleMap, float]:
    """Return the bend of the rows in each cell of a grid over the image, px, and the lens coefficient that bends them.

    The bend is the dy due to rotations and lens, minus the best offset, rotation and scale, and 0 everywhere if it is
    only noise; on a grid, because matches follow texture and are rare in the corners, where rows bend most. The lens
    coefficient is OpenCV's k1 for a focal length of one width; 0 if it is not significant, or rows hardly bend.
    """
    dy, terms = points.dy.astype(np.float64), row_terms(points)
    with_bend, without_bend = robust_fit(terms, dy), robust_fit(terms[:, :3], dy)
    residuals = dy - terms @ with_bend
    noise = max(MIN_NOISE_PX, row_spread(residuals))
    gain = np.log1p(((dy - terms[:, :3] @ without_bend) / noise) ** 2) - np.log1p((residuals / noise) ** 2)
    rows, cols = points.shape
    x, y = ((np.arange(BEND_GRID) + 0.5) * side / BEND_GRID for side in (cols, rows))
    left = np.column_stack([axis.ravel() for axis in np.meshgrid(x, y)])
    if gain.sum() < MIN_EVIDENCE:
        return np.zeros(len(left)), 0.0
    near = nearest_neighbours(points.left, left, BEND_NEIGHBOURS)
    right = left + np.column_stack([np.median(points.dx[near], axis=1), np.zeros(len(left))])
    grid_terms = row_terms(Correspondences(left.astype(np.float32), right.astype(np.float32), points.shape))
    bend = grid_terms @ with_bend
    plane, *_ = np.linalg.lstsq(grid_terms[:, :3], bend, rcond=None)
    bend = np.asarray(bend - grid_terms[:, :3] @ plane)
    weights = 1 / (1 + (residuals / (2 * noise)) ** 2)
    deviation = noise * np.sqrt(np.linalg.pinv((terms.T * weights) @ terms)[-1, -1])
    lens = float(with_bend[-1]) / cols
    significant = MIN_LENS_SIGMAS * deviation / cols < abs(lens) < MAX_LENS and np.std(bend) > MIN_BEND_RATIO * noise
    return bend, lens if significant else 0.0


def nearest_neighbours(places: Points, points: Array, count: int) -> Indices:
    """Return the (n, k) indices of the `count` places nearest to each point, or of all if there are fewer, in order."""
    tree = cv2.flann.Index(np.ascontiguousarray(places, dtype=np.float32), EXACT_TREE)
    found, _ = tree.knnSearch(np.ascontiguousarray(points, dtype=np.float32), min(count, len(places)), params={})
    return found.astype(np.intp)


def match_noise(points: Correspondences, residuals: DoubleMap) -> float:
    """Return the robust standard deviation of residuals between neighbours, px: no lens or rotation explains it."""
    # Features on the same corner have correlated errors, so each small cell contributes only one match.
    cells = (points.left * (NOISE_CELLS / points.shape[1])).astype(np.intp)
    _, chosen = np.unique(cells[:, 1] * 2 * NOISE_CELLS + cells[:, 0], return_index=True)
    if len(chosen) <= NOISE_NEIGHBOURS:
        return 0.0
    places, errors = points.left[chosen], residuals[chosen]
    near = nearest_neighbours(places, places, NOISE_NEIGHBOURS + 1)
    return row_spread((errors[near[:, 1:]] - errors[:, None]).ravel() / np.sqrt(2))


def best_rectification(points: Correspondences) -> UncalibratedRectification | None:
    """Return the rectification fitted to matches that does best on held-out matches; None if none helps much.

    It includes a lens coefficient if that helps, or if the rows show a large one: where features crowd far away, as on
    a drive, few of them are where it helps.
    """
    turned = fit_rectification(points, lens=False)
    with_lens = fit_rectification(points, lens=True, start=turned)
    turned_errors = held_out_errors(points, lens=False, start=turned)
    lens_errors = held_out_errors(points, lens=True, start=with_lens)
    _, residuals = vertical_plane(points)
    noise = max(MIN_NOISE_PX, row_spread(lens_errors))
    plane_misfit, turned_misfit, lens_misfit = (
        np.log1p((errors / noise) ** 2).sum() for errors in (residuals, turned_errors, lens_errors)
    )
    large_lens = abs(bend_of(points)[1]) > MAX_HEALTHY_LENS and plane_misfit - lens_misfit > MIN_EVIDENCE
    helps = large_lens or turned_misfit - lens_misfit > MIN_EVIDENCE
    model, errors = (with_lens, lens_errors) if helps else (turned, turned_errors)
    spread = row_spread(errors)
    # Things that moved are explained by lenses that nobody makes; strong ones have barrel distortion, as fisheyes do.
    worthwhile = model.lens < MAX_LENS and (large_lens or spread < MAX_RECTIFIED_RATIO * row_spread(residuals))
    return replace(model, spread_px=spread) if worthwhile else None


MAX_EPIPOLAR_PX = 1.0
"""Largest distance of a match from its epipolar line, px at the size at which it was matched."""

MAX_EPIPOLAR_TRIALS = 5000
"""Largest number of samples of matches drawn to find the epipolar lines."""

MIN_EASY_MATCHES = 100
"""Number of agreeing matches from which a pair is easy."""

MIN_EASY_SHARE = 0.4
"""Share of the matches of an easy pair that agree."""

MAX_EASY_SPREAD_PX = 0.4
"""Largest spread of the row residuals of an easy pair, px at the size at which it was matched."""

MAX_EASY_BEND_PX = 0.3
"""Row bend of an easy pair above which its matches are selected again with a lens model, px."""

MAX_AGREEING_SIGMAS = 2.5
"""A match whose dy is off by more standard deviations does not agree."""

CORNER_CELLS = 8
"""Cells across and down in which corners are tracked."""

CORNER_PYRAMID_LEVELS = 3
"""Halvings of the images in which a corner is tracked."""

MIN_CORNER_EIGENVALUE = 5e-3
"""Smallest eigenvalue of a tracked corner as OpenCV scales it; the blocks of a JPEG do not reach it in flat places."""

MAX_RETURN_PX = 0.3
"""Largest distance of a corner, tracked forwards and back, from its start, px."""

MIN_FITTED_MATCHES = 8
"""Number of matches from which a model of the views is fitted."""

MIN_AGREEING_SHARE = 0.15
"""Agreeing matches are no evidence below this share of the distinctive ones: some agree by chance."""

PLANE_TRIALS = 2000
"""Number of planes of dy tried."""

MAX_PLANE_DISTANCE = 0.012
"""Largest distance of a match from its plane, as a share of the rows."""

MAX_PLANE_SLOPE = 0.2
"""Largest slope of a plane, px of dy per px."""

MIN_OFF_ROWS_PX = 3.0
"""Smallest row error of a match on a thing that moved, px at the size at which features were matched."""

MOVED_NEIGHBOURS = 6
"""Number of nearest matches most of which are displaced alike if a thing moved; wrong matches are not."""

TOLERANCES_PX = (7.0, 4.0, 2.0, 1.5, 1.5)
"""Largest row error of the matches kept in each round of refitting the model of the views, px."""


def find_correspondences(left: Image, right: Image) -> Correspondences:
    """Match features and keep the matches that agree on the relative orientation of the views.

    On a nearly rectified pair the matches are corners spread evenly over the image, tracked from the displacement of
    the nearest mutual ORB match. The dy of corners and ORB matches must fit small rotations and a lens distortion,
    fitted first to the matches on the epipolar lines of one fundamental matrix (MAGSAC++, Barath et al. 2020). If there
    are few of them, SIFT matches are added, and those consistent with two rotated cameras and one lens coefficient are
    kept.

    Their ``dy`` are the row differences: about 0 on a rectified pair. There are no matches if those found may agree by
    chance.
    """
    shape = left.shape[0], left.shape[1]
    scale = min(1.0, MAX_SIDE_PX / max(shape))
    views = _stretched(left, scale), _stretched(right, scale)
    quick = match_features(views, shape, scale, binary=True)
    easy = _nearly_rectified(quick.points, fundamental_matrix(quick.points)[1])
    if len(easy) >= MIN_EASY_MATCHES:
        every = _tracked_evenly(views, easy)
        even = _nearly_rectified(every, np.ones(len(every), np.bool_))
        if len(even) < MIN_EASY_MATCHES:
            every, even = quick.points, easy
        chosen = _consistent(every, even) if np.std(bend_of(even)[0]) * scale > MAX_EASY_BEND_PX else even
        return replace(chosen, of_any_rows=every, moved=_moved(quick, easy))
    thorough = match_features(views, shape, scale, binary=False)
    distinctive = quick.distinctive().joined(thorough.distinctive())
    every = replace(quick.points.joined(thorough.points), candidates=distinctive)
    quarters, models = 0, []
    if len(distinctive) >= MIN_FITTED_MATCHES:
        # One picture may be on its side, or upside down.
        quarters = max(range(4), key=lambda turn: np.count_nonzero(_on_a_plane(_right_turned(distinctive, turn))))
        every, distinctive = _right_turned(every, quarters), _right_turned(distinctive, quarters)
        seeds = fundamental_matrix(distinctive)[1], _on_a_plane(distinctive)
        models = list(filter(None, (_refitted(distinctive, seed) for seed in seeds)))
    best = min(models, key=lambda model: _misfit(model, distinctive), default=None)
    if best is None or best.agrees(distinctive, TOLERANCES_PX[-1]).sum() < MIN_AGREEING_SHARE * len(distinctive):
        return every.chosen(np.arange(0))
    return _right_turned(_consistent(every, every.chosen(best.agrees(every, TOLERANCES_PX[-1]))), -quarters)


def _misfit(model: UncalibratedRectification, points: Correspondences) -> float:
    """Return the cost of a model, with row errors limited to 4 px: some matches are wrong."""
    errors = np.clip(model.row_errors(points) * points.scale, -4, 4)
    return cost_of_errors(errors, 2 * NOISE_PX, model.parameters)


def _moved(quick: FeatureMatches, rectified: Correspondences) -> int:
    """Return the number of distinctive matches that are off the rows of a rectified pair as most near them are."""
    rows = robust_fit(row_terms(rectified), rectified.dy.astype(np.float64))

    def count(points: Correspondences) -> int:
        displacements = np.column_stack([points.dx, points.dy])
        off = np.abs(points.dy - row_terms(points) @ rows) * points.scale > MIN_OFF_ROWS_PX
        near = nearest_neighbours(points.left, points.left, MOVED_NEIGHBOURS + 1)[:, 1:]
        differences = np.abs(displacements[near] - displacements[:, None]).max(axis=-1) * points.scale
        alike = (differences < TOLERANCES_PX[-1]).sum(axis=1) > MOVED_NEIGHBOURS / 2
        return int(np.count_nonzero(off & alike))

    # Where a pattern repeats, neighbours may all be matched one repetition off; to find that takes longer.
    found = count(quick.points)
    return found if found < MIN_MATCHES else count(quick.distinctive())


def _right_turned(points: Correspondences, quarters: int) -> Correspondences:
    """Return the matches with the right picture turned about its centre by quarters of a turn."""
    centre, turn = centre_of(points.shape), np.linalg.matrix_power(np.array([[0, 1], [-1, 0]]), quarters % 4)
    return replace(points, right=((points.right - centre) @ turn + centre).astype(np.float32))


def fundamental_matrix(
    points: Correspondences, pixels: float = MAX_EPIPOLAR_PX, trials: int = MAX_EPIPOLAR_TRIALS
) -> tuple[DoubleMap | None, Mask]:
    """Return the (3, 3) fundamental matrix that most matches agree with, and their mask; None and no match without one.

    A match agrees if it is at most `pixels` from its epipolar line, at the size at which features were matched. At most
    `trials` samples of matches are drawn (MAGSAC++, Barath et al. 2020).
    """
    tolerance = pixels / points.scale
    with suppress(cv2.error):  # raised without a model, for example for points on one line
        matrix, found = cv2.findFundamentalMat(points.left, points.right, cv2.USAC_MAGSAC, tolerance, 0.999, trials)
        if matrix is not None and found is not None:
            return np.asarray(matrix, dtype=np.float64), np.asarray(found.ravel() == 1)
    return None, np.zeros(len(points), np.bool_)


def _nearly_rectified(points: Correspondences, agreeing: Mask) -> Correspondences:
    """Return the matches of an easy pair whose dy fits small rotations and a lens; none for any other pair.

    The model is fitted first to the matches of the mask `agreeing`.
    """
    none, terms = points.chosen(np.arange(0)), row_terms(points)
    for _ in range(3):
        if agreeing.sum() < MIN_EASY_MATCHES:
            return none
        residuals = points.dy - terms @ robust_fit(terms[agreeing], points.dy[agreeing].astype(np.float64))
        spread = row_spread(residuals[agreeing]) * points.scale
        agreeing = np.abs(residuals) * points.scale < MAX_AGREEING_SIGMAS * max(spread, NOISE_PX)
    return points.chosen(agreeing) if spread < MAX_EASY_SPREAD_PX and agreeing.mean() > MIN_EASY_SHARE else none


def _tracked_evenly(views: tuple[EightBit, EightBit], seeds: Correspondences) -> Correspondences:
    """Return matches of corners spread evenly over the image, tracked from the displacement of the nearest seed.

    Features crowd where texture is fine, mostly far away, while the rows of near things bend most.
    """
    rows, cols = (np.linspace(0, side, CORNER_CELLS + 1).astype(int) for side in views[0].shape)
    corners = [np.empty((0, 2), np.float32)]
    for top, bottom in pairwise(rows):
        for left, right in pairwise(cols):
            cell = views[0][top:bottom, left:right]
            # The least quality is a share of that of the best corner in the cell.
            found = (
                cv2.goodFeaturesToTrack(cell, maxCorners=40, qualityLevel=0.05, minDistance=SAME_POINT_PX)
                if cell.size
                else None
            )
            if found is not None:
                corners.append(found.reshape(-1, 2).astype(np.float32) + np.array([left, top], np.float32))
    start = np.concatenate(corners)
    if not len(start):
        return seeds.chosen(np.arange(0))
    nearest = nearest_neighbours(seeds.left, (start + 0.5) / seeds.scale - 0.5, 1)[:, 0]
    guess = (seeds.right - seeds.left)[nearest] * np.float32(seeds.scale)
    end, ok = tracked(views, start, start + guess, CORNER_PYRAMID_LEVELS, MIN_CORNER_EIGENVALUE)
    back, ok_back = tracked((views[1], views[0]), end, end - guess, CORNER_PYRAMID_LEVELS, MIN_CORNER_EIGENVALUE)
    inside = np.minimum(end, np.array(views[0].shape[::-1]) - end).min(axis=1) > FLOW_WINDOW_PX / 2
    good = ok & ok_back & inside & (np.abs(back - start).max(axis=1) < MAX_RETURN_PX)
    return at_full_size(start[good], end[good], seeds.shape, seeds.scale)


def _on_a_plane(points: Correspondences) -> Mask:
    """Return the mask of matches near the best plane of dy over the image (RANSAC), for cameras nearly side by side.

    On a repeating pattern, more matches may agree on an epipolar geometry that such cameras cannot have.
    """
    terms = np.column_stack([np.ones(len(points)), (points.left - centre_of(points.shape)) / points.shape[1]])
    sample = np.random.default_rng(0).integers(0, len(points), (PLANE_TRIALS, 3))
    corners, heights = terms[sample], points.dy[sample].astype(np.float64)
    wide = np.abs(np.linalg.det(corners)) > 0.01
    planes = np.linalg.solve(corners[wide], heights[wide][..., None])[..., 0]
    slopes = np.abs(planes[:, 1:]).max(axis=1, initial=0) / points.shape[1]
    near = np.abs(points.dy - planes[slopes < MAX_PLANE_SLOPE] @ terms.T) < MAX_PLANE_DISTANCE * points.shape[0]
    return np.asarray(max(near, key=np.count_nonzero, default=np.zeros(len(points), np.bool_)))


def _refitted(points: Correspondences, agreeing: Mask) -> UncalibratedRectification | None:
    """Return the model of the views refitted to the matches that agree with it; None if they become too few.

    It is fitted first to the matches of the mask `agreeing`.
    """
    model = None
    for tolerance in TOLERANCES_PX:
        if agreeing.sum() < MIN_FITTED_MATCHES:
            return None
        model = fit_rectification(points.chosen(agreeing), lens=model is not None, start=model)
        agreeing = model.agrees(points, tolerance)
    return model


def _consistent(every: Correspondences, agreeing: Correspondences) -> Correspondences:
    """Return all matches that fit the rotations and lens of a subset: in the corners a lens moves matches far."""
    for _ in range(2):
        model = fit_rectification(agreeing, lens=True)
        errors = np.abs(model.row_errors(agreeing)) * every.scale
        # Wrong matches are on the right rows only by chance, so a tight tolerance keeps fewer of them.
        tolerance = max(2 * NOISE_PX, MAX_AGREEING_SIGMAS * 1.4826 * median(errors))
        agreeing = every.chosen(model.agrees(every, tolerance))
    return agreeing


def _stretched(image: Image, scale: float) -> EightBit:
    """Return the scaled image in 8-bit grey, stretched over its own range so that exposure does not affect matching."""
    size = max(1, round(image.shape[1] * scale)), max(1, round(image.shape[0] * scale))
    grey = np.asarray(cv2.resize(as_grey(image), size, interpolation=cv2.INTER_AREA), np.float32)
    # A black border would make one image darker than the other.
    outside = transparent(with_border_transparent(image))
    levels = grey[::4, ::4] if outside is None else as_grey(image)[~outside][::4]
    low, high = percentiles(levels, 1, 99)
    return np.asarray(np.clip((grey - low) * (255 / max(high - low, 1e-6)), 0, 255), dtype=np.uint8)


MIN_ROW_GAIN_PX = 0.1
"""Medians that differ by no more than this are inconclusive, px."""

MAX_RECTIFIED_PX = 1.0
"""Row difference, px, up to which a pair may count as rectified; half the difference after rectification if larger."""


@dataclass(frozen=True)
class RowEvidence:
    """Row differences of matched features in pictures as given and after rectification.

    Attributes
    ----------
    given_px, rectified_px
        Median absolute row difference, px; NaN if too few features were matched.
    given_matches, rectified_matches
        Number of matched features.
    """

    given_px: float
    rectified_px: float
    given_matches: int
    rectified_matches: int

    @property
    def already_rectified(self) -> bool:
        """Return whether the rows match better as given; inconclusive rows count as unrectified."""
        if np.isnan(self.rectified_px):
            return self.given_px <= MAX_RECTIFIED_PX
        close = self.given_px <= max(MAX_RECTIFIED_PX, self.rectified_px / 2)
        return close and self.given_px + MIN_ROW_GAIN_PX < self.rectified_px


def row_evidence(given: tuple[Image, Image], rectified: tuple[Image, Image]) -> RowEvidence:
    """Compare the rows of a pair as given, left and right image, with those after rectification."""
    differences = [np.abs(find_correspondences(*pair).dy) for pair in (given, rectified)]
    before, after = (median(one) if len(one) >= MIN_MATCHES else np.nan for one in differences)
    return RowEvidence(before, after, len(differences[0]), len(differences[1]))
