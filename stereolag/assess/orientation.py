"""The relative orientation of two views from feature matches: which agree on it, rows, and rectification."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property

import cv2
import numpy as np
import numpy.typing as npt
import scipy  # scipy.spatial is loaded on first use

from stereolag.assess.features import (
    FEWEST_MATCHES,
    Chosen,
    Correspondences,
    ReducedPair,
)
from stereolag.core.arrays import DoubleMap
from stereolag.core.inputs import Image

USUAL = np.array([0.2, 0.1, 0.2, 0.1, 0.1, 0.3, 0.02, 0.3, 0.5])
"""Typical magnitudes of the parameters: rotations in radians, logarithms of focal lengths, and the lens coefficient
with its shape.

This prior only resolves ambiguities in the matches: a planar scene, or views too narrow to tell rotation from shift.
"""

LENS, SHAPE = 7, 8
"""Indices of the lens coefficient and its shape among the parameters."""

NOISE_PX = 0.3
"""Typical error of a match, px at the size at which it was matched."""

MOST_STEPS, MOST_POINTS = 30, 400
"""Limits on fitting steps and on matches; more matches cost more time than they are worth."""
DIFFERENCE = 1e-6
"""Step of the parameters for numerical derivatives."""

GRID_PX = 8
"""Spacing of the grid on which a warp is computed; between its nodes the warp is linear to a hundredth of a pixel."""

NEWTON_STEPS, FLATTEST = 5, 0.1
"""Newton steps to undo a distortion, and the least slope of the distortion used in them."""

PARTS = 4
"""Number of parts into which matches are split for cross-validation."""


@dataclass(frozen=True, eq=False)
class UncalibratedRectification:
    """The model that makes the rows of two views match: each is undistorted, and rotated as a camera would be.

    Attributes
    ----------
    parameters
        (9,) Yaw and roll of the left camera and of the right one, and the pitch between them, radians; the logarithms
        of the left focal length over the width, and of the right focal length over the left; the lens coefficient k and
        its shape s in ``distorted = undistorted * (1 + k r² + (1 + 2 s) k² r⁴)``, r in image widths from the centre. k
        is OpenCV's k1 for a focal length of one width, negative for barrel distortion; s is -1/2 if there is no r⁴
        term, and near 1/2 for the division model of Fitzgibbon (2001), which is closer to most lenses.
    covariance
        (9, 9) covariance of the parameters.
    shape
        (rows, cols) of the images.
    spread_px
        Robust standard deviation of the row differences of matches it was not fitted to, px; NaN if not measured.

    Notes
    -----
    Fusiello, Irsara (2008), Quasi-Euclidean uncalibrated rectification: rotations with a guessed focal length distort
    far less than two arbitrary homographies that fit.
    """

    parameters: DoubleMap
    covariance: DoubleMap
    shape: tuple[int, int]
    spread_px: float = np.nan

    @property
    def lens(self) -> float:
        """Return the lens coefficient; 0 if none was fitted."""
        return float(self.parameters[LENS])

    def row_errors(self, points: Correspondences) -> DoubleMap:
        """Return the remaining row differences of matches, right minus left, px."""
        return _row_errors(self.parameters, points)

    def places(self, points: Correspondences) -> tuple[DoubleMap, DoubleMap]:
        """Return the positions of matched points in the rectified images: (n, 2) (x, y) each, px."""
        left, right = _rectified(self.parameters, self.shape, points.left, points.right)
        return left + self._shift, right + self._shift

    def disparities(self, points: Correspondences) -> tuple[DoubleMap, DoubleMap]:
        """Return the disparities after rectification, 0 at infinity, and their standard deviations, px."""

        def disparity(parameters: DoubleMap) -> DoubleMap:
            left, right = _rectified(parameters, self.shape, points.left, points.right)
            return np.asarray(left[:, 0] - right[:, 0])

        here = disparity(self.parameters)
        slopes = _slopes(disparity, self.parameters, here)
        return here, np.sqrt(np.einsum("ij,jk,ik->i", slopes, self.covariance, slopes))

    def applied(self, left: Image, right: Image) -> tuple[Image, Image]:
        """Return both images rectified, of the same size and type; pixels from outside repeat the border."""
        rows, cols = (np.arange(0, side + GRID_PX, GRID_PX) for side in self.shape)
        grid = np.stack(np.meshgrid(cols, rows), axis=-1)
        nodes = np.diag([1.0 / GRID_PX, 1.0 / GRID_PX, 1.0])[:2]
        done = []
        for image, sources in zip((left, right), self._sources(grid.reshape(-1, 2)), strict=True):
            known = sources.astype(np.float32).reshape(grid.shape)
            where = cv2.warpAffine(known, nodes, self.shape[::-1], flags=cv2.INTER_LINEAR | cv2.WARP_INVERSE_MAP)
            x, y = cv2.split(where)
            done.append(np.asarray(cv2.remap(image, x, y, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)))
        return done[0], done[1]

    def _sources(self, target: npt.NDArray[np.intp]) -> list[DoubleMap]:
        """Return the points of the left and right images that map to given points of the rectified ones."""
        width, centre = self.shape[1], centre_of(self.shape)
        focal, cameras = _cameras(self.parameters)
        rays = np.column_stack([(target - self._shift - centre) / (width * focal), np.ones(len(target))])
        found = []
        for turn, length in cameras:
            seen = rays @ turn
            undistorted = seen[:, :2] / np.maximum(seen[:, 2:], 1e-3) * length
            found.append(np.asarray(_distorted(undistorted, self.parameters) * width + centre))
        return found

    @cached_property
    def _shift(self) -> DoubleMap:
        """Return the common (x, y) shift that centres both rectified images in the frame, px."""
        centre = centre_of(self.shape)[None]
        left, right = _rectified(self.parameters, self.shape, centre, centre)
        return np.asarray((centre - (left + right) / 2)[0])


def fit_rectification(
    points: Correspondences, *, lens: bool, start: UncalibratedRectification | None = None
) -> UncalibratedRectification:
    """Fit the model to matches robustly, by damped least squares of the row differences with Cauchy weights.

    Parameters
    ----------
    points
        Matches, mostly right.
    lens
        Whether to fit the lens coefficient too; otherwise it is 0.
    start
        Model to start from; by default, cameras side by side.
    """
    if len(points) > MOST_POINTS:
        points = points.chosen(np.random.default_rng(0).choice(len(points), MOST_POINTS, replace=False))

    def reduced_errors(given: DoubleMap) -> DoubleMap:
        return _row_errors(given, points) * points.scale

    free = np.arange(len(USUAL) if lens else LENS)
    parameters = np.zeros(len(USUAL))
    if start is not None:
        parameters[free] = start.parameters[free]
    damping, usual = 1e-3, np.diag(USUAL**-2)
    errors = reduced_errors(parameters)
    for _ in range(MOST_STEPS):
        noise = max(NOISE_PX, 1.4826 * float(np.median(np.abs(errors))))
        slopes = _slopes(reduced_errors, parameters, errors)
        weights = 1 / (1 + (errors / (2 * noise)) ** 2) / noise**2
        normal = (slopes.T @ (weights[:, None] * slopes) + usual)[np.ix_(free, free)]
        downhill = -(slopes.T @ (weights * errors) + usual @ parameters)[free]
        before = _cost(errors, noise, parameters)
        tried, after = parameters.copy(), np.inf
        while after >= before and damping < 1e6:
            tried[free] = parameters[free] + np.linalg.solve(normal + damping * np.diag(np.diag(normal)), downhill)
            tried_errors = reduced_errors(tried)
            after = _cost(tried_errors, noise, tried)
            damping *= 0.1 if after < before else 10
        if after < before:
            parameters, errors = tried, tried_errors
        if after >= before * (1 - 1e-4):
            break
    covariance = np.zeros((len(USUAL), len(USUAL)))
    covariance[np.ix_(free, free)] = np.linalg.inv(normal)
    return UncalibratedRectification(parameters, covariance, points.shape)


def robust_cost(model: UncalibratedRectification, points: Correspondences) -> float:
    """Return the cost of a model: its misfit to matches, some of them wrong, plus a penalty for unusual cameras."""
    return _cost(np.clip(model.row_errors(points) * points.scale, -4, 4), 2 * NOISE_PX, model.parameters)


def held_out_errors(points: Correspondences, *, lens: bool, start: UncalibratedRectification) -> DoubleMap:
    """Return the row error of every match, px, under a model fitted only to other matches."""
    errors = np.zeros(len(points))
    dealt = np.random.default_rng(0).permutation(len(points)) % PARTS
    for part in range(PARTS):
        fitted = fit_rectification(points.chosen(dealt != part), lens=lens, start=start)
        errors[dealt == part] = fitted.row_errors(points.chosen(dealt == part))
    return errors


def _cost(errors: DoubleMap, noise: float, parameters: DoubleMap) -> float:
    return float(4 * np.log1p((errors / (2 * noise)) ** 2).sum() + ((parameters / USUAL) ** 2).sum())


def _row_errors(parameters: DoubleMap, points: Correspondences) -> DoubleMap:
    left, right = _rectified(parameters, points.shape, points.left, points.right)
    return np.asarray(right[:, 1] - left[:, 1])


def _slopes(function: Callable[[DoubleMap], DoubleMap], at: DoubleMap, here: DoubleMap) -> DoubleMap:
    """Return the (n, 9) derivatives of a function by each parameter; `here` is its value at `at`."""
    steps = DIFFERENCE * np.eye(len(at))
    return np.column_stack([(function(at + step) - here) / DIFFERENCE for step in steps])


def centre_of(shape: tuple[int, int]) -> DoubleMap:
    """Return the (x, y) of the centre of an image, px."""
    return (np.array(shape[::-1], dtype=np.float64) - 1) / 2


def _cameras(parameters: DoubleMap) -> tuple[float, tuple[tuple[DoubleMap, float], tuple[DoubleMap, float]]]:
    """Return the focal length of the rectified images, and the rotation and focal length of each camera, in widths."""
    left_yaw, left_roll, right_yaw, right_roll, pitch, focal, ratio = parameters[:LENS]
    left_turn, right_turn = (
        np.asarray(cv2.Rodrigues(np.array(turn))[0], dtype=np.float64)
        for turn in ((-pitch / 2, left_yaw, left_roll), (pitch / 2, right_yaw, right_roll))
    )
    length = float(np.exp(focal))
    return length, ((left_turn, length), (right_turn, float(np.exp(focal + ratio))))


def _rectified(
    parameters: DoubleMap, shape: tuple[int, int], *views: npt.NDArray[np.floating]
) -> tuple[DoubleMap, DoubleMap]:
    """Return the rectified positions of points of the left and right images, before both are moved into the frame."""
    width, centre = shape[1], centre_of(shape)
    focal, cameras = _cameras(parameters)
    done = []
    for points, (turn, length) in zip(views, cameras, strict=True):
        seen = (points - centre) / width
        undistorted = _undistorted(seen, parameters)
        rays = undistorted @ (turn[:, :2] / length).T + turn[:, 2]
        done.append(np.asarray(rays[:, :2] / np.maximum(rays[:, 2:], 1e-3) * (width * focal) + centre))
    return done[0], done[1]


def _radial(parameters: DoubleMap) -> tuple[float, float]:
    """Return the factors of r² and r⁴ in the distortion."""
    lens = float(parameters[LENS])
    return lens, (1 + 2 * float(parameters[SHAPE])) * lens**2


def _distorted(straight: DoubleMap, parameters: DoubleMap) -> DoubleMap:
    """Return the distorted positions of points, in widths from the centre, at most the model's largest radius."""
    second, fourth = _radial(parameters)
    square = (straight**2).sum(axis=1, keepdims=True)
    turning_back = [root.real for root in np.roots([5 * fourth, 3 * second, 1]) if root.real > 0 and root.imag == 0]
    square = np.minimum(square, min(turning_back, default=np.inf))
    return np.asarray(straight * (1 + second * square + fourth * square**2))


def _undistorted(seen: DoubleMap, parameters: DoubleMap) -> DoubleMap:
    """Return the undistorted positions of points, in widths from the centre, by Newton's method."""
    second, fourth = _radial(parameters)
    far = np.sqrt((seen**2).sum(axis=1, keepdims=True))
    straight = far
    for _ in range(NEWTON_STEPS):
        square = straight**2
        slope = np.maximum(1 + 3 * second * square + 5 * fourth * square**2, FLATTEST)
        straight = np.maximum(straight - (straight * (1 + second * square + fourth * square**2) - far) / slope, 0)
    return np.asarray(seen * np.divide(straight, far, out=np.ones_like(far), where=far > 0))


ROUNDS = 10
LEAST_NOISE_PX = 0.1
CELLS, NEIGHBOURS = 100, 3
"""Cells across the image that contribute one match each, and neighbours each match is compared with."""

GRID, GRID_NEIGHBOURS = 16, 5
"""Grid cells across and down in which row bend is evaluated, and nearest matches that give each cell's disparity."""

EVIDENCE = 20.0
"""Decrease in the summed logarithms of the row errors that justifies more parameters."""

RECTIFIED_GAIN = 0.6
"""Share of the original row residuals below which a rectification must bring held-out row errors to be worthwhile."""


def robust_fit(terms: DoubleMap, values: DoubleMap) -> DoubleMap:
    """Return the (k,) coefficients of ``values = terms @ coefficients`` by Cauchy-reweighted least squares.

    Parameters
    ----------
    terms, values
        (n, k) and (n,), px.
    """
    weights = np.ones(len(values))
    for _ in range(ROUNDS):
        root = np.sqrt(weights)
        coefficients, *_ = np.linalg.lstsq(terms * root[:, None], values * root, rcond=None)
        left = values - terms @ coefficients
        noise = max(LEAST_NOISE_PX, 1.4826 * float(np.median(np.abs(left))))
        weights = 1 / (1 + (left / (2 * noise)) ** 2)
    return np.asarray(coefficients)


def vertical_plane(points: Correspondences) -> tuple[float, float, float]:
    """Return (a, b, c) of ``right.y = a + b * (x - cx) + (1 + c) * (y - cy) + cy``, fitted robustly to the matches.

    a is the row offset at the centre (px), b the sine of the rotation and c the difference in scale between the views.
    """
    terms = np.column_stack([np.ones(len(points)), points.left - centre_of(points.shape)])
    offset, rotation, growth = robust_fit(terms, points.dy.astype(np.float64))
    return float(offset), float(rotation), float(growth)


def row_residuals(points: Correspondences) -> DoubleMap:
    """Return dy minus its best-fitting offset, rotation and scale, px."""
    offset, *slopes = vertical_plane(points)
    return np.asarray(
        points.dy - (offset + (points.left - centre_of(points.shape)) @ np.array(slopes)), dtype=np.float64
    )


def row_spread(residuals: DoubleMap) -> float:
    """Return a standard deviation that bent corners raise but a few wrong matches do not, px.

    The median reflects the middle of the image, where a lens bends nothing; the 90th percentile reflects its corners.
    """
    middle, outer = np.percentile(np.abs(residuals), (50, 90))
    return max(1.4826 * float(middle), float(outer) / 1.645)


def row_terms(points: Correspondences) -> DoubleMap:
    """Return the (n, 7) effects on dy of two slightly rotated cameras and a distorting lens.

    To first order: offset, rotation, scale; the yaws of the left and right cameras and their pitch; and radial
    distortion, which moves a point in proportion to the cube of its distance from the centre.
    """
    width, centre = points.shape[1], centre_of(points.shape)
    left, right = ((places - centre) / width for places in (points.left, points.right))
    x, y = left.T
    lens = right[:, 1] * (right**2).sum(axis=1) - y * (left**2).sum(axis=1)
    return np.column_stack([np.ones(len(points)), x, y, x * y, right[:, 0] * y, y * y, lens])


def bend_of(points: Correspondences) -> DoubleMap:
    """Return the bend of the rows in each cell of a grid over the image, px; 0 everywhere if it is only noise.

    It is the dy due to rotations and lens, minus the best offset, rotation and scale; on a grid, because matches follow
    texture and are rare in the corners, where rows bend most.
    """
    dy, terms = points.dy.astype(np.float64), row_terms(points)
    bent, straight = robust_fit(terms, dy), robust_fit(terms[:, :3], dy)
    noise = max(LEAST_NOISE_PX, row_spread(dy - terms @ bent))
    gain = np.log1p(((dy - terms[:, :3] @ straight) / noise) ** 2) - np.log1p(((dy - terms @ bent) / noise) ** 2)
    rows, cols = points.shape
    x, y = np.meshgrid((np.arange(GRID) + 0.5) * cols / GRID, (np.arange(GRID) + 0.5) * rows / GRID)
    left = np.column_stack([x.ravel(), y.ravel()])
    if gain.sum() < EVIDENCE:
        return np.zeros(len(left))
    _, near = scipy.spatial.cKDTree(points.left).query(left, k=min(GRID_NEIGHBOURS, len(points)))
    right = left + np.column_stack([np.median(points.dx[near], axis=1), np.zeros(len(left))])
    there = row_terms(Correspondences(left.astype(np.float32), right.astype(np.float32), points.shape))
    bend = there @ bent
    plane, *_ = np.linalg.lstsq(there[:, :3], bend, rcond=None)
    return np.asarray(bend - there[:, :3] @ plane)


def match_noise(points: Correspondences, residuals: DoubleMap) -> float:
    """Return the robust standard deviation of row residuals between neighbours, px: no lens or rotation explains it."""
    # Features on the same corner have correlated errors, so each small cell contributes only one match.
    _, cells = np.unique((points.left * (CELLS / points.shape[1])).astype(np.intp), axis=0, return_index=True)
    if len(cells) <= NEIGHBOURS:
        return 0.0
    places, left = points.left[cells], residuals[cells]
    near = np.asarray(scipy.spatial.cKDTree(places).query(places, k=NEIGHBOURS + 1)[1])
    return row_spread((left[near[:, 1:]] - left[:, None]).ravel() / np.sqrt(2))


def best_rectification(points: Correspondences) -> UncalibratedRectification | None:
    """Return the rectification fitted to matches that does best on held-out matches; None if none helps much.

    It includes a lens coefficient only if that helps.
    """
    turned = fit_rectification(points, lens=False)
    freed = fit_rectification(points, lens=True, start=turned)
    turned_errors = held_out_errors(points, lens=False, start=turned)
    freed_errors = held_out_errors(points, lens=True, start=freed)
    noise = max(LEAST_NOISE_PX, row_spread(freed_errors))
    gain = np.log1p((turned_errors / noise) ** 2).sum() - np.log1p((freed_errors / noise) ** 2).sum()
    model, errors = (freed, freed_errors) if gain > EVIDENCE else (turned, turned_errors)
    spread = row_spread(errors)
    helps = spread < RECTIFIED_GAIN * row_spread(row_residuals(points))
    return replace(model, spread_px=spread) if helps else None


EPIPOLAR_PX = 1.0
"""Largest distance of a match from its epipolar line, px at the size at which it was matched."""

ENOUGH, EASY_SHARE, EVEN_PX = 100, 0.4, 0.4
"""Thresholds for an easy pair: number of agreeing matches, their share of all matches, scatter of their rows (px)."""

UNBENT_PX = 0.3
"""Row bend of an easy pair above which its matches are selected again with a lens model, px."""

AGREEMENT = 2.5
"""On an easy pair, a match whose dy is off by more than this many standard deviations is dropped."""

CHANCE_SHARE = 0.15
"""Agreeing matches are no evidence below this share of the distinct ones: some agree by chance."""

PLANES, PLANE_SHARE, STEEPEST = 2000, 0.012, 0.2
"""Planes of dy tried, largest distance of a match from its plane as a share of the rows, and steepest slope allowed."""

TOLERANCES_PX = (7.0, 4.0, 2.0, 1.5, 1.5)
"""Largest row error of the matches kept in each round of refitting the model of the views."""


def find_correspondences(left: Image, right: Image) -> Correspondences:
    """Match features and keep the matches that agree on the relative orientation of the views.

    On a nearly rectified pair these are mutual ORB matches whose dy fits small rotations and a lens distortion,
    starting from those on the epipolar lines of one fundamental matrix (MAGSAC++, Barath et al. 2020). If there are few
    of them, SIFT matches are added, and those consistent with two rotated cameras and one lens coefficient are kept.

    Their ``dy`` are the row differences: about 0 on a rectified pair.

    Parameters
    ----------
    left, right
        (H, W) or (H, W, 3 | 4) images of one size: uint8, uint16 or float.

    Returns
    -------
    Correspondences
        Possibly empty: matches that could have arisen by chance are no evidence.
    """
    pair = ReducedPair.of(left, right)
    quick = pair.binary_matches()
    easy = _nearly_rectified(quick.points)
    if len(easy) >= ENOUGH:
        return _followed(quick.points, easy) if np.std(bend_of(easy)) * pair.scale > UNBENT_PX else easy
    thorough = pair.gradient_matches()
    every, distinct = quick.points.joined(thorough.points), quick.distinctive().joined(thorough.distinctive())
    models = [_settled(distinct, seed) for seed in (_epipolar(distinct), _on_a_plane(distinct))]
    best = min((model for model in models if model), key=lambda model: robust_cost(model, distinct), default=None)
    if best is None or _agreeing(best, distinct).sum() < CHANCE_SHARE * len(distinct):
        return every.chosen(_none(every))
    return _followed(every, every.chosen(_agreeing(best, every)))


def _epipolar(points: Correspondences) -> Chosen:
    """Return the mask of matches on the epipolar lines of the best fundamental matrix."""
    if len(points) < 8:
        return _none(points)
    _, agreeing = cv2.findFundamentalMat(
        points.left, points.right, cv2.USAC_MAGSAC, EPIPOLAR_PX / points.scale, 0.999, 5000
    )
    return _none(points) if agreeing is None else np.asarray(agreeing.ravel() == 1)


def _nearly_rectified(points: Correspondences) -> Correspondences:
    """Return the matches of an easy pair whose dy fits small rotations and a lens; none for any other pair."""
    agreeing = _epipolar(points)
    for _ in range(3):
        if agreeing.sum() < ENOUGH:
            return points.chosen(_none(points))
        terms = row_terms(points)
        residuals = points.dy - terms @ robust_fit(terms[agreeing], points.dy[agreeing].astype(np.float64))
        spread = row_spread(residuals[agreeing]) * points.scale
        agreeing = np.abs(residuals) * points.scale < AGREEMENT * max(spread, NOISE_PX)
    easy = spread < EVEN_PX and agreeing.mean() > EASY_SHARE
    return points.chosen(agreeing if easy else _none(points))


def _on_a_plane(points: Correspondences) -> Chosen:
    """Return the mask of matches near the best plane of dy over the image (RANSAC), for cameras nearly side by side.

    On a repeating pattern, more matches may agree on an epipolar geometry that such cameras cannot have.
    """
    if len(points) < 8:
        return _none(points)
    places = np.column_stack([np.ones(len(points)), (points.left - centre_of(points.shape)) / points.shape[1]])
    sample = np.random.default_rng(0).integers(0, len(points), (PLANES, 3))
    corners, heights = places[sample], points.dy[sample].astype(np.float64)
    wide = np.abs(np.linalg.det(corners)) > 0.01
    planes = np.linalg.solve(corners[wide], heights[wide][..., None])[..., 0]
    slopes = np.abs(planes[:, 1:]).max(axis=1, initial=0) / points.shape[1]
    planes = planes[slopes < STEEPEST]
    if not len(planes):
        return _none(points)
    near = np.abs(points.dy - planes @ places.T) < PLANE_SHARE * points.shape[0]
    return np.asarray(near[near.sum(axis=1).argmax()])


def _settled(points: Correspondences, agreeing: Chosen) -> UncalibratedRectification | None:
    """Return the model of the views that most matches agree on, starting from a subset; None with too few."""
    model = None
    for tolerance in TOLERANCES_PX:
        if agreeing.sum() < 8:
            return None
        model = fit_rectification(points.chosen(agreeing), lens=model is not None, start=model)
        agreeing = np.abs(model.row_errors(points)) * points.scale < tolerance
    return model


def _followed(every: Correspondences, agreeing: Correspondences) -> Correspondences:
    """Return all matches that fit the rotations and lens of a subset: in the corners a lens moves matches far."""
    for _ in range(2):
        model = fit_rectification(agreeing, lens=True)
        errors = np.abs(model.row_errors(agreeing)) * every.scale
        # Wrong matches are on the right rows only by chance, so a tight tolerance keeps fewer of them.
        tolerance = max(2 * NOISE_PX, AGREEMENT * 1.4826 * float(np.median(errors)))
        agreeing = every.chosen(np.abs(model.row_errors(every)) * every.scale < tolerance)
    return agreeing


def _none(points: Correspondences) -> Chosen:
    return np.zeros(len(points), dtype=np.bool_)


def _agreeing(model: UncalibratedRectification, points: Correspondences) -> Chosen:
    return np.asarray(np.abs(model.row_errors(points)) * points.scale < TOLERANCES_PX[-1])


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
    """Compare the rows of a pair as given with those after rectification.

    Parameters
    ----------
    given, rectified
        The left and right images: (H, W) or (H, W, 3 | 4), uint8, uint16 or float.
    """
    (given_px, given_matches), (rectified_px, rectified_matches) = _median(*given), _median(*rectified)
    return RowEvidence(given_px, rectified_px, given_matches, rectified_matches)


def _median(left: Image, right: Image) -> tuple[float, int]:
    """Return the median absolute row difference, px, and the number of matches."""
    differences = np.abs(find_correspondences(left, right).dy)
    count = len(differences)
    return (float(np.median(differences)) if count >= FEWEST_MATCHES else np.nan), count
