"""Rectification without a calibration: rotations of both views, and a lens, fitted to the rows of matched points."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import cv2
import numpy as np

from stereolag.assess.features import Correspondences
from stereolag.core.arrays import Array, DoubleMap, Mask, median
from stereolag.core.inputs import Image

TYPICAL = np.array([0.2, 0.1, 0.2, 0.1, 0.1, 0.3, 0.02, 0.3, 0.5])
"""Typical magnitudes of the parameters: rotations in radians, logarithms of focal lengths, and the lens coefficient
with its shape.

This prior only resolves ambiguities in the matches: a planar scene, or views too narrow to tell rotation from shift.
"""

FOCAL, LENS, SHAPE = 5, 7, 8
"""Indices of the focal length, the lens coefficient and its shape among the parameters."""

NOISE_PX = 0.3
"""Typical error of a match, px at the size at which it was matched."""

MAX_FITTED_MATCHES = 400
"""Largest number of matches that a model is fitted to; more cost more time than they are worth."""

DERIVATIVE_STEP = 1e-6
"""Step of the parameters for numerical derivatives."""

GRID_PX = 8
"""Spacing of the grid on which a warp is computed, px; between its nodes the warp is linear to a hundredth of a
pixel."""

MIN_DISTORTION_SLOPE = 0.1
"""Slope of the distortion assumed at least in the Newton steps that undo it."""

FOLDS = 4
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

    @property
    def focal(self) -> float:
        """Return the focal length of the left camera, image widths."""
        return math.exp(self.parameters[FOCAL])

    @property
    def turn(self) -> float:
        """Return the angle by which the right camera is turned from the left one, degrees."""
        (left, _), (right, _) = _cameras(self.parameters)[1]
        return math.degrees(float(np.linalg.norm(cv2.Rodrigues(left @ right.T)[0])))

    def row_errors(self, points: Correspondences) -> DoubleMap:
        """Return the remaining row differences of matches, right minus left, px."""
        return self.errors(points)[:, 1]

    def errors(self, points: Correspondences) -> DoubleMap:
        """Return the remaining (n, 2) differences (x, y) of matches, right minus left, px."""
        straight = _straightened(self.parameters, points.shape, points.left, points.right)
        return _differences(self.parameters, points.shape, *straight)

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
        # Both views are shifted equally, so that together they are centred in the frame.
        left_centre, right_centre = _rectified(self.parameters, self.shape, centre[None], centre[None])
        shift = (centre - (left_centre + right_centre) / 2)[0]
        rows, cols = (np.arange(0, side + GRID_PX, GRID_PX) for side in self.shape)
        grid = np.stack(np.meshgrid(cols, rows), axis=-1)
        target = grid.reshape(-1, 2)
        rays = np.column_stack([(target - shift - centre) / (width * focal), np.ones(len(target))])
        nodes = np.diag([1.0 / GRID_PX, 1.0 / GRID_PX, 1.0])[:2]
        rectified = []
        for image, (rotation, length) in zip((left, right), cameras, strict=True):
            camera_rays = rays @ rotation
            undistorted = camera_rays[:, :2] / np.maximum(camera_rays[:, 2:], 1e-3) * length
            sources = _distorted(undistorted, self.parameters) * width + centre
            coarse = sources.astype(np.float32).reshape(grid.shape)
            fine = cv2.warpAffine(coarse, nodes, self.shape[::-1], flags=cv2.INTER_LINEAR | cv2.WARP_INVERSE_MAP)
            x, y = cv2.split(fine)
            rectified.append(np.asarray(cv2.remap(image, x, y, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)))
        return rectified[0], rectified[1]


def fit_rectification(
    points: Correspondences, *, lens: bool, start: UncalibratedRectification | None = None, depth: bool = True
) -> UncalibratedRectification:
    """Fit the model to matches robustly, by damped least squares of the row differences with Cauchy weights.

    Parameters
    ----------
    points
        Matches, most of them right.
    lens
        Whether to fit the lens coefficient; otherwise it is 0.
    start
        The initial model; None for cameras side by side.
    depth
        False for one camera that only turned: the differences of columns are then minimised as well.
    """
    if len(points) > MAX_FITTED_MATCHES:
        points = points.chosen(np.random.default_rng(0).choice(len(points), MAX_FITTED_MATCHES, replace=False))

    undistorted: dict[tuple[float, float], list[DoubleMap]] = {}

    def scaled_errors(parameters: DoubleMap) -> DoubleMap:
        # Most steps, and most derivatives, do not change the lens.
        distortion = _radial(parameters)
        if distortion not in undistorted:
            undistorted[distortion] = _straightened(parameters, points.shape, points.left, points.right)
        return _differences(parameters, points.shape, *undistorted[distortion])[:, depth:].ravel() * points.scale

    free = np.arange(len(TYPICAL) if lens else LENS)
    parameters = np.zeros(len(TYPICAL))
    if start is not None:
        parameters[free] = start.parameters[free]
    damping, prior = 1e-3, np.diag(TYPICAL**-2)
    errors = scaled_errors(parameters)
    for _ in range(30):
        noise = max(NOISE_PX, 1.4826 * median(np.abs(errors)))
        slopes = _slopes(scaled_errors, parameters, errors)
        weights = 1 / (1 + (errors / (2 * noise)) ** 2) / noise**2
        normal = (slopes.T @ (weights[:, None] * slopes) + prior)[np.ix_(free, free)]
        downhill = -(slopes.T @ (weights * errors) + prior @ parameters)[free]
        before = cost_of_errors(errors, noise, parameters)
        tried, after = parameters.copy(), np.inf
        while after >= before and damping < 1e6:
            tried[free] = parameters[free] + np.linalg.solve(normal + damping * np.diag(np.diag(normal)), downhill)
            tried_errors = scaled_errors(tried)
            after = cost_of_errors(tried_errors, noise, tried)
            damping *= 0.1 if after < before else 10
        if after < before:
            parameters, errors = tried, tried_errors
        if after >= before * (1 - 1e-4):
            break
    covariance = np.zeros((len(TYPICAL), len(TYPICAL)))
    covariance[np.ix_(free, free)] = np.linalg.inv(normal)
    return UncalibratedRectification(parameters, covariance, points.shape)


def held_out_errors(points: Correspondences, *, lens: bool, start: UncalibratedRectification) -> DoubleMap:
    """Return the row error of every match, px, under a model fitted only to other matches."""
    errors = np.zeros(len(points))
    folds = np.random.default_rng(0).permutation(len(points)) % FOLDS
    for fold in range(FOLDS):
        fitted = fit_rectification(points.chosen(folds != fold), lens=lens, start=start)
        errors[folds == fold] = fitted.row_errors(points.chosen(folds == fold))
    return errors


def cost_of_errors(errors: DoubleMap, noise: float, parameters: DoubleMap) -> float:
    """Return the cost of a model: its misfit to matches, and a penalty for unusual cameras."""
    with np.errstate(all="ignore"):
        total = float(4 * np.log1p((errors / (2 * noise)) ** 2).sum() + ((parameters / TYPICAL) ** 2).sum())
    return total if np.isfinite(total) else np.inf


def _differences(parameters: DoubleMap, shape: tuple[int, int], *straight: DoubleMap) -> DoubleMap:
    """Return the (n, 2) differences of undistorted points after rotating the cameras, right minus left, px."""
    # A step of the fit may try impossible cameras; their cost is infinite.
    with np.errstate(all="ignore"):
        left, right = _turned(parameters, shape, *straight)
        return np.asarray(right - left)


def _slopes(function: Callable[[DoubleMap], DoubleMap], at: DoubleMap, here: DoubleMap) -> DoubleMap:
    """Return the (n, 9) derivatives of a function by each parameter; `here` is its value at `at`."""
    steps = DERIVATIVE_STEP * np.eye(len(at))
    return np.column_stack([(function(at + step) - here) / DERIVATIVE_STEP for step in steps])


def centre_of(shape: tuple[int, int]) -> DoubleMap:
    """Return the (x, y) of the centre of an image, px."""
    return (np.array(shape[::-1], dtype=np.float64) - 1) / 2


def _cameras(parameters: DoubleMap) -> tuple[float, tuple[tuple[DoubleMap, float], tuple[DoubleMap, float]]]:
    """Return the focal length of the rectified images, and the rotation and focal length of each camera, in widths."""
    left_yaw, left_roll, right_yaw, right_roll, pitch, focal, ratio = parameters[:LENS]
    left_rotation, right_rotation = (
        np.asarray(cv2.Rodrigues(np.array(angles))[0], dtype=np.float64)
        for angles in ((-pitch / 2, left_yaw, left_roll), (pitch / 2, right_yaw, right_roll))
    )
    length = float(np.exp(focal))
    return length, ((left_rotation, length), (right_rotation, float(np.exp(focal + ratio))))


def _rectified(parameters: DoubleMap, shape: tuple[int, int], *views: Array) -> tuple[DoubleMap, DoubleMap]:
    """Return the rectified positions of points of the left and right images, before both are moved into the frame."""
    return _turned(parameters, shape, *_straightened(parameters, shape, *views))


def _straightened(parameters: DoubleMap, shape: tuple[int, int], *views: Array) -> list[DoubleMap]:
    """Return the undistorted positions of the points of each view, in widths from the centre."""
    width, centre = shape[1], centre_of(shape)
    with np.errstate(all="ignore"):  # a step of the fit may try an impossible lens
        return [_undistorted((points - centre) / width, parameters) for points in views]


def _turned(parameters: DoubleMap, shape: tuple[int, int], *straight: DoubleMap) -> tuple[DoubleMap, DoubleMap]:
    """Return the positions of undistorted points of the left and right images in the rotated cameras, px."""
    width, centre = shape[1], centre_of(shape)
    focal, cameras = _cameras(parameters)
    positions = []
    for undistorted, (rotation, length) in zip(straight, cameras, strict=True):
        rays = undistorted @ (rotation[:, :2] / length).T + rotation[:, 2]
        positions.append(np.asarray(rays[:, :2] / np.maximum(rays[:, 2:], 1e-3) * (width * focal) + centre))
    return positions[0], positions[1]


def _radial(parameters: DoubleMap) -> tuple[float, float]:
    """Return the factors of r² and r⁴ in the distortion."""
    lens = float(parameters[LENS])
    return lens, (1 + 2 * float(parameters[SHAPE])) * lens**2


def _distorted(straight: DoubleMap, parameters: DoubleMap) -> DoubleMap:
    """Return the distorted positions of points, in widths from the centre, up to the model's largest radius."""
    second, fourth = _radial(parameters)
    square = (straight**2).sum(axis=1, keepdims=True)
    turning_back = [root.real for root in np.roots([5 * fourth, 3 * second, 1]) if root.real > 0 and root.imag == 0]
    square = np.minimum(square, min(turning_back, default=np.inf))
    return np.asarray(straight * (1 + second * square + fourth * square**2))


def _undistorted(distorted: DoubleMap, parameters: DoubleMap) -> DoubleMap:
    """Return the undistorted positions of points, in widths from the centre, by Newton's method."""
    second, fourth = _radial(parameters)
    target = np.sqrt((distorted**2).sum(axis=1, keepdims=True))
    radius = target
    for _ in range(5):
        square = radius**2
        slope = np.maximum(1 + 3 * second * square + 5 * fourth * square**2, MIN_DISTORTION_SLOPE)
        radius = np.maximum(radius - (radius * (1 + second * square + fourth * square**2) - target) / slope, 0)
    return np.asarray(distorted * np.divide(radius, target, out=np.ones_like(target), where=target > 0))
