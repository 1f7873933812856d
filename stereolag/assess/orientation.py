"""The relative orientation of two views: which matches agree on it, their rows, and the rectification they ask for."""

from __future__ import annotations

from contextlib import suppress
from dataclasses import dataclass, replace
from itertools import pairwise

import cv2
import numpy as np
import numpy.typing as npt

from stereolag.assess.features import (
    APART_PX,
    EXACT_TREE,
    FEWEST_MATCHES,
    LARGEST_SIDE,
    PATCH,
    Correspondences,
    Eight,
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
from stereolag.core.arrays import DoubleMap, Mask, median, percentiles
from stereolag.core.inputs import Image, as_grey, transparent, with_border_transparent

LEAST_NOISE_PX = 0.1
CELLS, NEIGHBOURS = 100, 3
"""Cells across the image that contribute one match each, and neighbours each match is compared with."""

GRID, GRID_NEIGHBOURS = 16, 5
"""Grid cells across and down in which row bend is evaluated, and nearest matches that give each cell's disparity."""

EVIDENCE = 20.0
"""Decrease in the summed logarithms of the row errors that justifies more parameters."""

SURE_LENS, LEAST_BEND, STRONGEST_LENS = 5.0, 1.5, 1.0
"""Standard deviations from 0 at which matches tell a lens coefficient, the least spread of its bend over the noise of
the matches, and the strongest coefficient of a lens: views that are not equally sharp or bright move all matches a
little, which lenses explain as well as anything."""

LENS_LEFT = 0.18
"""Lens coefficient above which rows are bent although the matches' spread is small: over near ground, where features
are rare, a drive's map loses 5 to 10 % of its pixels at 0.3."""

RECTIFIED_GAIN = 0.6
"""Share of the original row residuals below which a rectification must bring held-out row errors to be worthwhile."""


def robust_fit(terms: DoubleMap, values: DoubleMap) -> DoubleMap:
    """Return the (k,) coefficients of ``values = terms @ coefficients``, px, by Cauchy-reweighted least squares."""
    weights = np.ones(len(values))
    for _ in range(10):
        root = np.sqrt(weights)
        coefficients, *_ = np.linalg.lstsq(terms * root[:, None], values * root, rcond=None)
        left = values - terms @ coefficients
        noise = max(LEAST_NOISE_PX, 1.4826 * median(np.abs(left)))
        weights = 1 / (1 + (left / (2 * noise)) ** 2)
    return np.asarray(coefficients)


def vertical_plane(points: Correspondences) -> tuple[DoubleMap, DoubleMap]:
    """Return (a, b, c) of ``dy = a + b * (x - cx) + c * (y - cy)`` at (x, y) in the right image, fitted robustly.

    a is the row offset at the centre, px. In the right image, because that is the one taken for rotated and scaled: in
    the left one, where points of one place in it lie apart by their disparities, even an exact rotation leaves a rest.
    Also return the (n,) residuals: dy minus the best-fitting offset, rotation and scale, px.
    """
    away, dy = points.right - centre_of(points.shape), points.dy.astype(np.float64)
    plane = robust_fit(np.column_stack([np.ones(len(points)), away]), dy)
    return plane, np.asarray(dy - (plane[0] + away @ plane[1:]))


def row_spread(residuals: DoubleMap) -> float:
    """Return a standard deviation that bent corners raise but a few wrong matches do not, px.

    The median reflects the middle of the image, where a lens bends nothing; the 90th percentile reflects its corners.
    """
    middle, outer = percentiles(np.abs(residuals), 50, 90)
    return max(1.4826 * float(middle), float(outer) / 1.645)


def row_terms(points: Correspondences) -> DoubleMap:
    """Return the (n, 7) effects on dy of two slightly rotated cameras and a distorting lens.

    To first order: offset, rotation and scale of the right one; the yaws of the left and right cameras and their pitch;
    and radial distortion, which moves a point in proportion to the cube of its distance from the centre.
    """
    width, centre = points.shape[1], centre_of(points.shape)
    left, right = ((places - centre) / width for places in (points.left, points.right))
    x, y = left.T
    lens = right[:, 1] * (right**2).sum(axis=1) - y * (left**2).sum(axis=1)
    return np.column_stack([np.ones(len(points)), right, x * y, right[:, 0] * y, y * y, lens])


def bend_of(points: Correspondences) -> tuple[DoubleMap, float]:
    """Return the bend of the rows in each cell of a grid over the image, px, and the lens coefficient that bends them.

    The bend is the dy due to rotations and lens, minus the best offset, rotation and scale, and 0 everywhere if it is
    only noise; on a grid, because matches follow texture and are rare in the corners, where rows bend most. The lens
    coefficient is OpenCV's k1 for a focal length of one width; 0 if the matches do not surely tell it, or rows hardly
    bend.
    """
    dy, terms = points.dy.astype(np.float64), row_terms(points)
    bent, straight = robust_fit(terms, dy), robust_fit(terms[:, :3], dy)
    left_over = dy - terms @ bent
    noise = max(LEAST_NOISE_PX, row_spread(left_over))
    gain = np.log1p(((dy - terms[:, :3] @ straight) / noise) ** 2) - np.log1p((left_over / noise) ** 2)
    rows, cols = points.shape
    x, y = np.meshgrid((np.arange(GRID) + 0.5) * cols / GRID, (np.arange(GRID) + 0.5) * rows / GRID)
    left = np.column_stack([x.ravel(), y.ravel()])
    if gain.sum() < EVIDENCE:
        return np.zeros(len(left)), 0.0
    near = nearest_neighbours(points.left, left, GRID_NEIGHBOURS)
    right = left + np.column_stack([np.median(points.dx[near], axis=1), np.zeros(len(left))])
    there = row_terms(Correspondences(left.astype(np.float32), right.astype(np.float32), points.shape))
    bend = there @ bent
    plane, *_ = np.linalg.lstsq(there[:, :3], bend, rcond=None)
    bend = np.asarray(bend - there[:, :3] @ plane)
    weights = 1 / (1 + (left_over / (2 * noise)) ** 2)
    deviation = noise * np.sqrt(np.linalg.pinv((terms.T * weights) @ terms)[-1, -1])
    lens = float(bent[-1]) / cols
    told = SURE_LENS * deviation / cols < abs(lens) < STRONGEST_LENS and np.std(bend) > LEAST_BEND * noise
    return bend, lens if told else 0.0


def nearest_neighbours(places: Points, points: npt.NDArray[np.floating], most: int) -> npt.NDArray[np.intp]:
    """Return the indices of the places nearest to each of some points, at most `most` of them, the nearest first."""
    tree = cv2.flann.Index(np.ascontiguousarray(places, dtype=np.float32), EXACT_TREE)
    found, _ = tree.knnSearch(np.ascontiguousarray(points, dtype=np.float32), min(most, len(places)), params={})
    return found.astype(np.intp)


def _first_of_each(cells: npt.NDArray[np.intp]) -> npt.NDArray[np.intp]:
    """Return the index of the first of all equal rows, for every row."""
    order = np.lexsort(cells.T)
    new = np.ones(len(cells), np.bool_)
    new[1:] = (cells[order[1:]] != cells[order[:-1]]).any(axis=1)
    return order[new]


def match_noise(points: Correspondences, residuals: DoubleMap) -> float:
    """Return the robust standard deviation of row residuals between neighbours, px: no lens or rotation explains it."""
    # Features on the same corner have correlated errors, so each small cell contributes only one match.
    cells = _first_of_each((points.left * (CELLS / points.shape[1])).astype(np.intp))
    if len(cells) <= NEIGHBOURS:
        return 0.0
    places, left = points.left[cells], residuals[cells]
    near = nearest_neighbours(places, places, NEIGHBOURS + 1)
    return row_spread((left[near[:, 1:]] - left[:, None]).ravel() / np.sqrt(2))


def best_rectification(points: Correspondences) -> UncalibratedRectification | None:
    """Return the rectification fitted to matches that does best on held-out matches; None if none helps much.

    It includes a lens coefficient if that helps, or if the rows tell one: where features crowd far away, as on a drive,
    few of them are where it helps.
    """
    turned = fit_rectification(points, lens=False)
    freed = fit_rectification(points, lens=True, start=turned)
    turned_errors = held_out_errors(points, lens=False, start=turned)
    freed_errors = held_out_errors(points, lens=True, start=freed)
    _, residuals = vertical_plane(points)
    noise = max(LEAST_NOISE_PX, row_spread(freed_errors))
    misfit, with_turns, with_lens = (
        np.log1p((errors / noise) ** 2).sum() for errors in (residuals, turned_errors, freed_errors)
    )
    told = abs(bend_of(points)[1]) > LENS_LEFT and misfit - with_lens > EVIDENCE
    model, errors = (freed, freed_errors) if told or with_turns - with_lens > EVIDENCE else (turned, turned_errors)
    spread = row_spread(errors)
    return replace(model, spread_px=spread) if told or spread < RECTIFIED_GAIN * row_spread(residuals) else None


EPIPOLAR_PX = 1.0
"""Largest distance of a match from its epipolar line, px at the size at which it was matched."""

MOST_TRIALS = 5000
"""Samples of matches drawn at most to find the epipolar lines."""

ENOUGH, EASY_SHARE, EVEN_PX = 100, 0.4, 0.4
"""Thresholds for an easy pair: number of agreeing matches, their share of all matches, scatter of their rows (px)."""

UNBENT_PX = 0.3
"""Row bend of an easy pair above which its matches are selected again with a lens model, px."""

AGREEMENT = 2.5
"""On an easy pair, a match whose dy is off by more than this many standard deviations is dropped."""

CORNER_CELLS, CORNERS, CORNER_QUALITY = 8, 40, 0.05
"""Cells across and down in which corners are tracked, their largest number in each, and the least quality of a corner,
as a share of the best one in its cell."""

PYRAMID_LEVELS, WEAKEST_CORNER, RETURNED_PX = 3, 5e-3, 0.3
"""Halvings of the images in which a corner is tracked, its least eigenvalue as OpenCV scales it, which the blocks of a
JPEG do not reach in flat places, and how far from its start it may return, px."""

FEWEST_FITTED = 8
"""Fewest matches to which a model of the views is fitted."""

CHANCE_SHARE = 0.15
"""Agreeing matches are no evidence below this share of the distinct ones: some agree by chance."""

PLANES, PLANE_SHARE, STEEPEST = 2000, 0.012, 0.2
"""Planes of dy tried, largest distance of a match from its plane as a share of the rows, and steepest slope allowed."""

TOLERANCES_PX = (7.0, 4.0, 2.0, 1.5, 1.5)
"""Largest row error of the matches kept in each round of refitting the model of the views."""


def find_correspondences(left: Image, right: Image) -> Correspondences:
    """Match features and keep the matches that agree on the relative orientation of the views.

    On a nearly rectified pair these are corners spread evenly over the image, tracked from the displacement of the next
    mutual ORB match; of both, the dy fits small rotations and a lens distortion, starting from the matches on the
    epipolar lines of one fundamental matrix (MAGSAC++, Barath et al. 2020). If there are few of them, SIFT matches are
    added, and those consistent with two rotated cameras and one lens coefficient are kept.

    Their ``dy`` are the row differences: about 0 on a rectified pair. There may be none of them: matches that could
    have arisen by chance are no evidence.
    """
    shape = left.shape[0], left.shape[1]
    scale = min(1.0, LARGEST_SIDE / max(shape))
    views = _stretched(left, scale), _stretched(right, scale)
    quick = match_features(views, shape, scale, binary=True)
    easy = _nearly_rectified(quick.points, fundamental_matrix(quick.points, EPIPOLAR_PX, MOST_TRIALS)[1])
    if len(easy) >= ENOUGH:
        every = _tracked_evenly(views, easy)
        even = _nearly_rectified(every, np.ones(len(every), np.bool_))
        if len(even) < ENOUGH:
            every, even = quick.points, easy
        chosen = _followed(every, even) if np.std(bend_of(even)[0]) * scale > UNBENT_PX else even
        return replace(chosen, of_any_rows=every)
    thorough = match_features(views, shape, scale, binary=False)
    distinct = quick.distinctive().joined(thorough.distinctive())
    every = replace(quick.points.joined(thorough.points), candidates=distinct)
    quarters = 0
    if len(distinct) >= FEWEST_FITTED:  # a picture on its side, or on its head
        quarters = max(range(4), key=lambda number: np.count_nonzero(_on_a_plane(_turned_right(distinct, number))))
        every, distinct = _turned_right(every, quarters), _turned_right(distinct, quarters)
    models = []
    if len(distinct) >= FEWEST_FITTED:
        seeds = fundamental_matrix(distinct, EPIPOLAR_PX, MOST_TRIALS)[1], _on_a_plane(distinct)
        models = [model for seed in seeds if (model := _settled(distinct, seed)) is not None]
    errors = [np.clip(model.row_errors(distinct) * scale, -4, 4) for model in models]  # some of them of wrong matches
    costs = [cost_of_errors(one, 2 * NOISE_PX, model.parameters) for one, model in zip(errors, models, strict=True)]
    best = models[int(np.argmin(costs))] if models else None
    if best is None or best.agrees(distinct, TOLERANCES_PX[-1]).sum() < CHANCE_SHARE * len(distinct):
        return every.chosen(np.arange(0))
    return _turned_right(_followed(every, every.chosen(best.agrees(every, TOLERANCES_PX[-1]))), -quarters)


def _turned_right(points: Correspondences, quarters: int) -> Correspondences:
    """Return the matches with the right picture turned by quarters about its centre."""
    centre, turn = centre_of(points.shape), np.linalg.matrix_power(np.array([[0, 1], [-1, 0]]), quarters % 4)
    return replace(points, right=((points.right - centre) @ turn + centre).astype(np.float32))


def fundamental_matrix(points: Correspondences, pixels: float, trials: int) -> tuple[DoubleMap | None, Mask]:
    """Return the (3, 3) fundamental matrix on whose lines most matches are, and which; None, and none, without one.

    A match is on a line up to `pixels` from it, at the size at which features were matched. At most `trials` samples of
    matches are drawn (MAGSAC++, Barath et al. 2020).
    """
    tolerance = pixels / points.scale
    with suppress(cv2.error):  # of points on one line, for one, it finds no model and fails
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
        if agreeing.sum() < ENOUGH:
            return none
        residuals = points.dy - terms @ robust_fit(terms[agreeing], points.dy[agreeing].astype(np.float64))
        spread = row_spread(residuals[agreeing]) * points.scale
        agreeing = np.abs(residuals) * points.scale < AGREEMENT * max(spread, NOISE_PX)
    return points.chosen(agreeing) if spread < EVEN_PX and agreeing.mean() > EASY_SHARE else none


def _tracked_evenly(views: tuple[Eight, Eight], seeds: Correspondences) -> Correspondences:
    """Return matches of corners spread evenly over the image, tracked from the displacement of the nearest seed.

    Features crowd where texture is fine, mostly far away, while the rows of near things bend most.
    """
    rows, cols = (np.linspace(0, side, CORNER_CELLS + 1).astype(int) for side in views[0].shape)
    places = [np.empty((0, 2), np.float32)]
    for top, bottom in pairwise(rows):
        for left, right in pairwise(cols):
            cell = views[0][top:bottom, left:right]
            found = cv2.goodFeaturesToTrack(cell, CORNERS, CORNER_QUALITY, APART_PX) if cell.size else None
            if found is not None:
                places.append(found.reshape(-1, 2).astype(np.float32) + np.array([left, top], np.float32))
    start = np.concatenate(places)
    if not len(start):
        return seeds.chosen(np.arange(0))
    nearest = nearest_neighbours(seeds.left, (start + 0.5) / seeds.scale - 0.5, 1)[:, 0]
    guess = (seeds.right - seeds.left)[nearest] * np.float32(seeds.scale)
    end, ok = tracked(views, start, start + guess, PYRAMID_LEVELS, WEAKEST_CORNER)
    back, same = tracked((views[1], views[0]), end, end - guess, PYRAMID_LEVELS, WEAKEST_CORNER)
    inside = np.minimum(end, np.array(views[0].shape[::-1]) - end).min(axis=1) > PATCH / 2
    good = ok & same & inside & (np.abs(back - start).max(axis=1) < RETURNED_PX)
    return at_full_size(start[good], end[good], seeds.shape, seeds.scale)


def _on_a_plane(points: Correspondences) -> Mask:
    """Return the mask of matches near the best plane of dy over the image (RANSAC), for cameras nearly side by side.

    On a repeating pattern, more matches may agree on an epipolar geometry that such cameras cannot have.
    """
    places = np.column_stack([np.ones(len(points)), (points.left - centre_of(points.shape)) / points.shape[1]])
    sample = np.random.default_rng(0).integers(0, len(points), (PLANES, 3))
    corners, heights = places[sample], points.dy[sample].astype(np.float64)
    wide = np.abs(np.linalg.det(corners)) > 0.01
    planes = np.linalg.solve(corners[wide], heights[wide][..., None])[..., 0]
    slopes = np.abs(planes[:, 1:]).max(axis=1, initial=0) / points.shape[1]
    near = np.abs(points.dy - planes[slopes < STEEPEST] @ places.T) < PLANE_SHARE * points.shape[0]
    return np.asarray(max(near, key=np.count_nonzero, default=np.zeros(len(points), np.bool_)))


def _settled(points: Correspondences, agreeing: Mask) -> UncalibratedRectification | None:
    """Return the model of the views that most matches agree on, starting from a subset; None with too few."""
    model = None
    for tolerance in TOLERANCES_PX:
        if agreeing.sum() < FEWEST_FITTED:
            return None
        model = fit_rectification(points.chosen(agreeing), lens=model is not None, start=model)
        agreeing = model.agrees(points, tolerance)
    return model


def _followed(every: Correspondences, agreeing: Correspondences) -> Correspondences:
    """Return all matches that fit the rotations and lens of a subset: in the corners a lens moves matches far."""
    for _ in range(2):
        model = fit_rectification(agreeing, lens=True)
        errors = np.abs(model.row_errors(agreeing)) * every.scale
        # Wrong matches are on the right rows only by chance, so a tight tolerance keeps fewer of them.
        tolerance = max(2 * NOISE_PX, AGREEMENT * 1.4826 * median(errors))
        agreeing = every.chosen(model.agrees(every, tolerance))
    return agreeing


def _stretched(image: Image, scale: float) -> Eight:
    """Return the image scaled, in 8-bit grey stretched over its own range so that exposure does not affect matching."""
    size = max(1, round(image.shape[1] * scale)), max(1, round(image.shape[0] * scale))
    grey = np.asarray(cv2.resize(as_grey(image), size, interpolation=cv2.INTER_AREA), np.float32)
    # A border that no camera took is black, and would make one image darker than the other.
    outside = transparent(with_border_transparent(image))
    seen = grey[::4, ::4] if outside is None else as_grey(image)[~outside][::4]
    low, high = percentiles(seen, 1, 99)
    return np.asarray(np.clip((grey - low) * (255 / max(high - low, 1e-6)), 0, 255), dtype=np.uint8)


INCONCLUSIVE_PX = 0.1
"""Medians that differ by no more than this are inconclusive."""

STRAIGHT_PX = 1.0
"""Row difference up to which a pair may count as rectified; above it, half the difference after rectification."""


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
            return self.given_px <= STRAIGHT_PX
        near = self.given_px <= max(STRAIGHT_PX, self.rectified_px / 2)
        return near and self.given_px + INCONCLUSIVE_PX < self.rectified_px


def row_evidence(given: tuple[Image, Image], rectified: tuple[Image, Image]) -> RowEvidence:
    """Compare the rows of a pair as given, left and right image, with those after rectification."""
    differences = [np.abs(find_correspondences(*pair).dy) for pair in (given, rectified)]
    before, after = (median(one) if len(one) >= FEWEST_MATCHES else np.nan for one in differences)
    return RowEvidence(before, after, len(differences[0]), len(differences[1]))
