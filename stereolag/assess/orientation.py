"""The relative orientation of two views: matched features, which of them agree on it, rows, and rectification."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Any

import cv2
import numpy as np
import numpy.typing as npt

from stereolag.core.arrays import DoubleMap, Mask, median, percentiles
from stereolag.core.inputs import Image, as_grey, transparent, with_border_transparent

Points = npt.NDArray[np.float32]
Eight = npt.NDArray[np.uint8]
Codes = npt.NDArray[np.integer[Any] | np.floating[Any]]

FEWEST_MATCHES = 25
"""Fewest matched features for which the geometry of a pair is judged."""

LARGEST_SIDE = 1000
"""Longer side to which larger images are reduced before features are detected, px."""

FEATURES = 2000

LOWE_RATIO = 0.8
"""A SIFT feature is matched if its best candidate is closer than this share of the next one's distance (Lowe 2004)."""

DISTINCTIVE = 0.85
"""A match is distinctive if it is closer than this share of the distance to any other feature of its own image; on a
repeating pattern, where it may be one repetition off, it is not."""

APART_PX = 5.0
"""Features closer together than this show the same point."""

EXACT_TREE: dict[str, bool | int | float | str] = {"algorithm": 4, "leaf_max_size": 10}
"""FLANN's tree for places of two coordinates, whose search is exact (``KDTREE_SINGLE``, Muja and Lowe 2009)."""

CODES_AT_ONCE = 32
"""Descriptors compared at a time: their distances stay in the cache."""

PATCH, FARTHEST_REFINED_PX = 15, 3
"""Side of the optical-flow window that refines a match, and how far it may move a match, px."""


@dataclass(frozen=True)
class Correspondences:
    """Matched points.

    Attributes
    ----------
    left, right
        (n, 2) float32 (x, y) in the left and in the right image, px.
    shape
        (rows, cols) of the images.
    scale
        Factor by which the images were reduced before features were matched, at most 1; it limits the precision.
    candidates
        The distinctive matches of which these agree; None if nearly all of them do.
    """

    left: Points
    right: Points
    shape: tuple[int, int]
    scale: float = 1.0
    candidates: Correspondences | None = None

    @property
    def dx(self) -> Points:
        """Return the horizontal displacements, right minus left, px."""
        return self.right[:, 0] - self.left[:, 0]

    @property
    def dy(self) -> Points:
        """Return the vertical displacements, right minus left, px."""
        return self.right[:, 1] - self.left[:, 1]

    def __len__(self) -> int:
        return len(self.left)

    def chosen(self, which: Mask | npt.NDArray[np.intp]) -> Correspondences:
        """Return the matches selected by a mask or by indices."""
        return replace(self, left=self.left[which], right=self.right[which])

    def joined(self, other: Correspondences) -> Correspondences:
        """Return these matches together with others of the same pair."""
        left, right = np.concatenate([self.left, other.left]), np.concatenate([self.right, other.right])
        return replace(self, left=left, right=right)


@dataclass(frozen=True, eq=False)
class FeatureMatches:
    """Feature matches of two views, found without assumptions about rows, range or exposure.

    Mostly right on an easy pair, mostly wrong on a hard one.

    Attributes
    ----------
    points
        The matches, refined to sub-pixel precision by Lucas-Kanade flow.
    places, codes
        Positions and descriptors of all features, for the left and for the right view.
    indices
        (2, n) The matched features of the left and of the right view.
    distances
        (n,) The distances of their descriptors.
    norm
        The norm that compares descriptors.
    """

    points: Correspondences
    places: Sequence[Points]
    codes: Sequence[Codes]
    indices: npt.NDArray[np.intp]
    distances: npt.NDArray[np.float64]
    norm: int

    def distinctive(self) -> Correspondences:
        """Return the matches whose features resemble no other feature of their own view."""
        distinctive = np.ones(len(self.points), dtype=np.bool_)
        for places, codes, which in zip(self.places, self.codes, self.indices, strict=True):
            ranked = cv2.BFMatcher(self.norm).knnMatch(codes[which], codes, k=4) if len(which) else ()
            for number, (own, near) in enumerate(zip(which, ranked, strict=True)):
                others = (one.distance for one in near if np.abs(places[own] - places[one.trainIdx]).max() > APART_PX)
                distinctive[number] &= self.distances[number] < DISTINCTIVE * next(others, np.inf)
        return self.points.chosen(distinctive)


def match_features(views: tuple[Eight, Eight], shape: tuple[int, int], scale: float, *, binary: bool) -> FeatureMatches:
    """Match the features of the left and the right view in 8-bit grey, and refine their places by optical flow.

    Parameters
    ----------
    shape, scale
        (rows, cols) of the images, and the factor by which they were reduced.
    binary
        The mutual best matches of ORB features (Rublee et al. 2011), which is fast; one whose flow does not converge is
        dropped. Otherwise SIFT matches that pass the ratio test (Lowe 2004): several times slower, but more robust; one
        whose flow does not converge stays where it was.
    """
    detector: cv2.Feature2D
    if binary:
        detector = cv2.ORB.create(FEATURES, fastThreshold=8)
        smallest, norm = detector.getPatchSize(), cv2.NORM_HAMMING
    else:
        detector, smallest, norm = cv2.SIFT.create(FEATURES, contrastThreshold=0.02), PATCH, cv2.NORM_L2
    places, codes = [], []
    for view in views:
        keys, described = detector.detectAndCompute(view, None) if min(view.shape) >= smallest else ((), None)
        places.append(np.array([key.pt for key in keys], dtype=np.float32).reshape(-1, 2))
        codes.append(np.empty((0, 1), np.uint8) if described is None else described)
    indices, distances = np.empty((2, 0), np.intp), np.empty(0)
    if binary and all(map(len, places)):
        indices, distances = mutual_matches(codes[0], codes[1])
    elif not binary and len(places[0]) and len(places[1]) > 1:
        ranked = cv2.BFMatcher(norm).knnMatch(codes[0], codes[1], k=2)
        found = [best for best, second in ranked if best.distance < LOWE_RATIO * second.distance]
        indices = np.array([(one.queryIdx, one.trainIdx) for one in found], dtype=np.intp).reshape(-1, 2).T
        distances = np.array([one.distance for one in found])
    start, end = places[0][indices[0]], places[1][indices[1]]
    if len(start):
        flow, ok = _flow(views, start, end)
        near = ok & (np.abs(flow - end).max(axis=1) < FARTHEST_REFINED_PX)
        end = np.where(near[:, None], flow, end)
        if binary:
            start, end, indices, distances = start[near], end[near], indices[:, near], distances[near]
    return FeatureMatches(_at_full_size(start, end, shape, scale), places, codes, indices, distances, norm)


def mutual_matches(left: Codes, right: Codes) -> tuple[npt.NDArray[np.intp], npt.NDArray[np.float64]]:
    """Return the binary descriptors of both views that are nearest to each other, and the bits in which they differ.

    The first of equally near ones counts, as in OpenCV's ``BFMatcher`` with a cross-check, which takes twice as long.

    Parameters
    ----------
    left, right
        (n, bytes) and (m, bytes), bytes a multiple of 8, m at most 65,536.

    Returns
    -------
    indices
        (2, matches) of the left and of the right descriptors, in the order of the left ones.
    distances
        (matches,)
    """
    words, others = left.view(np.uint64).T.copy(), right.view(np.uint64)
    nearest_left = np.empty(len(right), np.intp)
    # To each left one: the bits, then the index of the right one.
    nearest = np.full(len(left), np.iinfo(np.uint32).max, np.uint32)
    for first in range(0, len(right), CODES_AT_ONCE):
        some = others[first : first + CODES_AT_ONCE]
        bits = np.zeros((len(some), len(left)), np.uint16)
        for word, values in enumerate(words):
            bits += np.bitwise_count(some[:, word, None] ^ values)
        nearest_left[first : first + len(some)] = bits.argmin(axis=1)
        keys = bits.astype(np.uint32) << 16
        keys |= np.arange(first, first + len(some), dtype=np.uint32)[:, None]
        np.minimum(nearest, keys.min(axis=0), out=nearest)
    nearest_right = (nearest & 0xFFFF).astype(np.intp)
    mutual = np.flatnonzero(nearest_left[nearest_right] == np.arange(len(left)))
    return np.stack([mutual, nearest_right[mutual]]), (nearest[mutual] >> 16).astype(np.float64)


def _flow(
    views: tuple[Eight, Eight], start: Points, end: Points, levels: int = 0, weakest: float = 1e-4
) -> tuple[Points, Mask]:
    """Return where points of the first view are in the second one, searched from `end`, and which were found."""
    flow, ok, _ = cv2.calcOpticalFlowPyrLK(
        *views,
        start,
        end.copy(),
        winSize=(PATCH, PATCH),
        maxLevel=levels,
        flags=cv2.OPTFLOW_USE_INITIAL_FLOW,
        minEigThreshold=weakest,
    )
    return np.asarray(flow, np.float32), np.asarray(ok.ravel() == 1)


def _at_full_size(start: Points, end: Points, shape: tuple[int, int], scale: float) -> Correspondences:
    """Return the matches of reduced images, whose pixels stand for the centres of blocks of the large ones."""
    left, right = (np.asarray((points + 0.5) / scale - 0.5, dtype=np.float32) for points in (start, end))
    return Correspondences(left, right, shape, scale)


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

    def agrees(self, points: Correspondences, tolerance: float) -> Mask:
        """Return which matches are on the same row to `tolerance` px, at the size at which they were matched."""
        return np.asarray(np.abs(self.row_errors(points)) * points.scale < tolerance)

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
        width, centre = self.shape[1], centre_of(self.shape)
        focal, cameras = _cameras(self.parameters)
        # Both are shifted alike, so that together they are centred in the frame.
        middles = _rectified(self.parameters, self.shape, centre[None], centre[None])
        shift = (centre - (middles[0] + middles[1]) / 2)[0]
        rows, cols = (np.arange(0, side + GRID_PX, GRID_PX) for side in self.shape)
        grid = np.stack(np.meshgrid(cols, rows), axis=-1)
        target = grid.reshape(-1, 2)
        rays = np.column_stack([(target - shift - centre) / (width * focal), np.ones(len(target))])
        nodes = np.diag([1.0 / GRID_PX, 1.0 / GRID_PX, 1.0])[:2]
        done = []
        for image, (turn, length) in zip((left, right), cameras, strict=True):
            seen = rays @ turn
            undistorted = seen[:, :2] / np.maximum(seen[:, 2:], 1e-3) * length
            sources = _distorted(undistorted, self.parameters) * width + centre
            known = sources.astype(np.float32).reshape(grid.shape)
            where = cv2.warpAffine(known, nodes, self.shape[::-1], flags=cv2.INTER_LINEAR | cv2.WARP_INVERSE_MAP)
            x, y = cv2.split(where)
            done.append(np.asarray(cv2.remap(image, x, y, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)))
        return done[0], done[1]


def fit_rectification(
    points: Correspondences, *, lens: bool, start: UncalibratedRectification | None = None
) -> UncalibratedRectification:
    """Fit the model to matches robustly, by damped least squares of the row differences with Cauchy weights.

    The matches are mostly right. The lens coefficient is 0 unless `lens` is set. It starts from another model, or from
    cameras side by side.
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
        noise = max(NOISE_PX, 1.4826 * median(np.abs(errors)))
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


def held_out_errors(points: Correspondences, *, lens: bool, start: UncalibratedRectification) -> DoubleMap:
    """Return the row error of every match, px, under a model fitted only to other matches."""
    errors = np.zeros(len(points))
    dealt = np.random.default_rng(0).permutation(len(points)) % PARTS
    for part in range(PARTS):
        fitted = fit_rectification(points.chosen(dealt != part), lens=lens, start=start)
        errors[dealt == part] = fitted.row_errors(points.chosen(dealt == part))
    return errors


def _cost(errors: DoubleMap, noise: float, parameters: DoubleMap) -> float:
    """Return the cost of a model: its misfit to matches, and a penalty for unusual cameras."""
    with np.errstate(all="ignore"):
        total = float(4 * np.log1p((errors / (2 * noise)) ** 2).sum() + ((parameters / USUAL) ** 2).sum())
    return total if np.isfinite(total) else np.inf


def _row_errors(parameters: DoubleMap, points: Correspondences) -> DoubleMap:
    # A step of the fit may try impossible cameras; their cost is infinite.
    with np.errstate(all="ignore"):
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


LEAST_NOISE_PX = 0.1
CELLS, NEIGHBOURS = 100, 3
"""Cells across the image that contribute one match each, and neighbours each match is compared with."""

GRID, GRID_NEIGHBOURS = 16, 5
"""Grid cells across and down in which row bend is evaluated, and nearest matches that give each cell's disparity."""

EVIDENCE = 20.0
"""Decrease in the summed logarithms of the row errors that justifies more parameters."""

SURE_LENS, LEAST_BEND_PX = 5.0, 0.15
"""Standard deviations from 0 at which matches tell a lens coefficient, and the least spread of its bend, px at the size
at which they were matched."""

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
    """Return (a, b, c) of ``right.y = a + b * (x - cx) + (1 + c) * (y - cy) + cy``, fitted robustly to the matches.

    a is the row offset at the centre (px), b the sine of the rotation and c the difference in scale between the views.
    Also return the (n,) residuals: dy minus the best-fitting offset, rotation and scale, px.
    """
    away, dy = points.left - centre_of(points.shape), points.dy.astype(np.float64)
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

    To first order: offset, rotation, scale; the yaws of the left and right cameras and their pitch; and radial
    distortion, which moves a point in proportion to the cube of its distance from the centre.
    """
    width, centre = points.shape[1], centre_of(points.shape)
    left, right = ((places - centre) / width for places in (points.left, points.right))
    x, y = left.T
    lens = right[:, 1] * (right**2).sum(axis=1) - y * (left**2).sum(axis=1)
    return np.column_stack([np.ones(len(points)), x, y, x * y, right[:, 0] * y, y * y, lens])


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
    told = abs(bent[-1]) > SURE_LENS * deviation and np.std(bend) * points.scale > LEAST_BEND_PX
    return bend, float(bent[-1]) / cols if told else 0.0


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
        return _followed(every, even) if np.std(bend_of(even)[0]) * scale > UNBENT_PX else even
    thorough = match_features(views, shape, scale, binary=False)
    distinct = quick.distinctive().joined(thorough.distinctive())
    every = replace(quick.points.joined(thorough.points), candidates=distinct)
    models = []
    if len(distinct) >= FEWEST_FITTED:
        seeds = fundamental_matrix(distinct, EPIPOLAR_PX, MOST_TRIALS)[1], _on_a_plane(distinct)
        models = [model for seed in seeds if (model := _settled(distinct, seed)) is not None]
    errors = [np.clip(model.row_errors(distinct) * scale, -4, 4) for model in models]  # some of them of wrong matches
    costs = [_cost(one, 2 * NOISE_PX, model.parameters) for one, model in zip(errors, models, strict=True)]
    best = models[int(np.argmin(costs))] if models else None
    if best is None or best.agrees(distinct, TOLERANCES_PX[-1]).sum() < CHANCE_SHARE * len(distinct):
        return every.chosen(np.arange(0))
    return _followed(every, every.chosen(best.agrees(every, TOLERANCES_PX[-1])))


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
    end, ok = _flow(views, start, start + guess, PYRAMID_LEVELS, WEAKEST_CORNER)
    back, same = _flow((views[1], views[0]), end, end - guess, PYRAMID_LEVELS, WEAKEST_CORNER)
    inside = np.minimum(end, np.array(views[0].shape[::-1]) - end).min(axis=1) > PATCH / 2
    good = ok & same & inside & (np.abs(back - start).max(axis=1) < RETURNED_PX)
    return _at_full_size(start[good], end[good], seeds.shape, seeds.scale)


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
