"""Cameras fitted to the corners of a board in several pictures: each alone, then both together, without outliers."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from operator import itemgetter
from typing import Any, NamedTuple

import cv2
import numpy as np
import scipy  # scipy.optimize is loaded only on first use: the quick judgement of a pair does not need it

from stereolag.core.arrays import DoubleMap, Vector
from stereolag.geometry.calibration import StereoRig

LENSES = {
    "k1, k2": cv2.CALIB_FIX_K3,
    "k1, k2, k3": 0,
    "rational": cv2.CALIB_RATIONAL_MODEL,
}
"""Models of lens distortion, each in addition to the tangential p1, p2, with OpenCV's flags, simplest first."""

MAX_ERROR_RATIO = 0.97
"""A richer lens model must lower the error on left-out pictures to this share of it: a model with too many
coefficients is wrong where there were no corners."""

FOLDS = 3
"""Number of folds of the cross-validation of lens models."""

MIN_PICTURES_TO_VALIDATE = 6
"""Minimum number of pictures of each camera of which some can be left out."""

MAX_TRAINING_ERROR_RATIO = 0.7
"""The same as `MAX_ERROR_RATIO` for fewer pictures, where none is left out: on the pictures it is fitted to, a richer
model is always a bit better."""

OUTLIER_MEDIAN_RATIO = 5.0
"""A picture does not show a flat board if its error exceeds this multiple of the median and `MIN_OUTLIER_PX`."""

MIN_OUTLIER_PX = 1.5
"""Error up to which no picture is an outlier, px RMS."""

COARSE_TOLERANCE = 0.02
"""Maximum error of another pair's corners for the right camera's pose from a single pair, as a share of the picture's
width. One pair determines the tilt of its board, and so of the right camera, only to a fraction of a degree."""

MIN_PAIRS = 3
"""Minimum number of pairs that determine a stereo camera."""

CONTRADICTION_MEDIAN_RATIO = 4.0
"""A pair contradicts the others if its error exceeds this multiple of the median and `MIN_CONTRADICTION_PX`."""

MIN_CONTRADICTION_PX = 0.75
"""Error up to which no pair contradicts the others, px per 1000 px of the picture's width."""

FIT_CRITERIA = (cv2.TERM_CRITERIA_COUNT | cv2.TERM_CRITERIA_EPS, 100, 1e-9)
"""Criteria to stop fitting a single camera. Wide lenses take more than OpenCV's 30 iterations; most others take fewer,
but would use all of them by its default, the last bit of a float64."""

MAX_SETTLED_RMS_PX = 1.0
"""Error above which a camera is fitted once more, from another start, px RMS. OpenCV starts from a focal length that
neglects distortion, and from there a wide lens may settle on twice the focal length."""

CENTRED_LENS = (
    cv2.CALIB_FIX_PRINCIPAL_POINT | cv2.CALIB_FIX_ASPECT_RATIO | cv2.CALIB_ZERO_TANGENT_DIST | cv2.CALIB_FIX_K3
)
"""OpenCV's flags for the lens that the other start is from: k1 and k2 about the centre of the picture."""

BEST_PAIRS_SHARE = 0.6
"""Share of the agreeing pairs, those with the smallest errors, that the first fit uses."""


class Observation(NamedTuple):
    """The corners of a board in one picture: (n, 3) on the board, in squares, and (n, 2) in the picture, px."""

    points: DoubleMap
    image_points: DoubleMap


class Pose(NamedTuple):
    """The pose of a board in a camera's frame, or of the right camera: rotation (3, 3), translation (3,) in squares."""

    rotation: DoubleMap
    translation: Vector

    def compose(self, first: Pose) -> Pose:
        """Return the transform that applies `first` and then this one.

        The pose of the right camera, applied to that of a board in the left camera's frame, gives the board's pose in
        the right camera's frame.
        """
        return Pose(self.rotation @ first.rotation, self.rotation @ first.translation + self.translation)


@dataclass(frozen=True, eq=False)
class ObservedPair:
    """A board seen in both pictures of a pair.

    Attributes
    ----------
    points
        (n, 3) corners of the board that both pictures show, in squares.
    left
        (n, 2) their positions in the left picture, px.
    right
        The same in the right picture, once for each possible order of its corners.
    """

    points: DoubleMap
    left: DoubleMap
    right: tuple[DoubleMap, ...]


@dataclass(frozen=True, eq=False)
class Camera:
    """A camera: its (3, 3) matrix and its distortion coefficients."""

    matrix: DoubleMap
    distortion: Vector

    def pose(self, points: DoubleMap, image_points: DoubleMap) -> Pose:
        """Return the pose of a board from its points and their positions in a picture, px."""
        flat = points * (1, 1, 0)  # a bent board is all but flat
        found, vector, translation = cv2.solvePnP(
            flat, image_points, self.matrix, self.distortion, flags=cv2.SOLVEPNP_IPPE
        )
        if found:
            vector, translation = cv2.solvePnPRefineLM(
                points, image_points, self.matrix, self.distortion, vector, translation
            )
        else:
            _, vector, translation = cv2.solvePnP(points, image_points, self.matrix, self.distortion)
        rotation = np.asarray(cv2.Rodrigues(vector)[0], dtype=np.float64)
        return Pose(rotation, np.asarray(translation, dtype=np.float64).ravel())

    def project(self, points: DoubleMap, pose: Pose) -> DoubleMap:
        """Return where the camera sees the points of a board at this pose, (n, 2) px."""
        return np.asarray(self._project_points(points, pose)[0][:, 0])

    def jacobian(self, points: DoubleMap, pose: Pose) -> DoubleMap:
        """Return the derivative of each image point by its point on the board, (n, 2, 3) px per square."""
        by_translation = np.asarray(self._project_points(points, pose)[1])[:, 3:6]
        return np.asarray(by_translation.reshape(-1, 2, 3) @ pose.rotation)

    def _project_points(self, points: DoubleMap, pose: Pose) -> Any:
        vector = cv2.Rodrigues(pose.rotation)[0]
        return cv2.projectPoints(points, vector, pose.translation, self.matrix, self.distortion)


class SeparateFits(NamedTuple):
    """Both cameras, each fitted on its own.

    Attributes
    ----------
    flags
        OpenCV's flags for the model of both lenses.
    left, right
        The cameras.
    focal_error
        Relative standard error of the focal lengths; the larger one of the two cameras.
    outliers
        For each camera, the numbers of the pictures that do not show a flat board.
    """

    flags: int
    left: Camera
    right: Camera
    focal_error: float
    outliers: tuple[set[int], set[int]]


def separate_fits(both: Sequence[Sequence[Observation]], size: tuple[int, int]) -> SeparateFits:
    """Return both cameras, each calibrated on its own from its observations, with the simplest lens that suits both.

    Raises
    ------
    ValueError
        Corners that do not determine a camera, which takes at least three pictures.
    """
    flags = suitable_lens(both, size)
    fits = (camera_without_outliers(observations, size, flags) for observations in both)
    (left, right), focal_errors, outliers = zip(*fits, strict=True)
    return SeparateFits(flags, left, right, max(focal_errors), outliers)


def camera_without_outliers(
    observations: Sequence[Observation], size: tuple[int, int], flags: int
) -> tuple[Camera, float, set[int]]:
    """Return a camera, the relative standard error of its focal length, and the pictures left out.

    Pictures are left out if they do not show a flat board.

    Raises
    ------
    ValueError
        Corners that do not determine a camera, which takes at least three pictures.
    """
    camera, focal_error, errors = fit_camera(observations, size, flags)
    limit = max(MIN_OUTLIER_PX, OUTLIER_MEDIAN_RATIO * float(np.median(errors)))
    outliers = set(np.flatnonzero(errors > limit).tolist())
    if outliers and len(observations) - len(outliers) >= 3:
        kept = [observation for number, observation in enumerate(observations) if number not in outliers]
        camera, focal_error, _ = fit_camera(kept, size, flags)
    return camera, focal_error, outliers


def suitable_lens(both: Sequence[Sequence[Observation]], size: tuple[int, int]) -> int:
    """Return the flags of the simplest model of :data:`LENSES` that predicts pictures it was not fitted to as well.

    If there are enough pictures, the models are cross-validated: every third picture of each camera, in turn, is left
    out and predicted from the others.
    """
    enough = min(map(len, both)) >= MIN_PICTURES_TO_VALIDATE
    folds, max_ratio = (FOLDS, MAX_ERROR_RATIO) if enough else (1, MAX_TRAINING_ERROR_RATIO)
    best, best_error = 0, np.inf
    for number, flags in enumerate(LENSES.values()):
        error = _validation_error(both, size, flags, folds)
        if number == 0 or error < max_ratio * best_error:
            best, best_error = flags, error
    return best


def _validation_error(both: Sequence[Sequence[Observation]], size: tuple[int, int], flags: int, folds: int) -> float:
    """Return the median error on pictures left out, px RMS; with a single fold none is left out."""
    errors: list[float] = []
    for observations in both:
        for fold in range(folds):
            training = [one for number, one in enumerate(observations) if folds == 1 or number % folds != fold]
            try:
                camera, _, _ = fit_camera(training, size, flags)
            except ValueError:
                return np.inf
            errors += [
                _rms(camera.project(points, camera.pose(points, image_points)) - image_points)
                for points, image_points in observations[fold::folds]
            ]
    return float(np.median(errors))


def _rms(differences: DoubleMap) -> float:
    return float(np.sqrt(np.square(differences).sum(axis=1).mean()))


def fit_camera(observations: Sequence[Observation], size: tuple[int, int], flags: int) -> tuple[Camera, float, Vector]:
    """Return a camera, the relative standard error of its focal length, and the error of each picture, px RMS."""
    points = [observation.points.astype(np.float32) for observation in observations]
    image_points = [observation.image_points.astype(np.float32) for observation in observations]
    undetermined = ValueError(
        f"{len(points)} pictures of the board do not determine the camera: show it at more places and tilted more."
    )

    def fitted(matrix: DoubleMap, distortion: Vector, flags: int) -> Any:
        return cv2.calibrateCameraExtended(
            points, image_points, size, matrix, distortion, flags=flags, criteria=FIT_CRITERIA
        )

    try:
        fit = fitted(np.eye(3), np.zeros(14), flags)
        if not fit[0] <= MAX_SETTLED_RMS_PX:
            start = np.array([[size[0], 0, (size[0] - 1) / 2], [0, size[0], (size[1] - 1) / 2], [0, 0, 1]], dtype=float)
            _, matrix, distortion, *_ = fitted(start, np.zeros(14), CENTRED_LENS | cv2.CALIB_USE_INTRINSIC_GUESS)
            distortion = np.pad(distortion.ravel(), (0, 14 - distortion.size))
            fit = min(fit, fitted(matrix, distortion, flags | cv2.CALIB_USE_INTRINSIC_GUESS), key=itemgetter(0))
    except cv2.error as error:
        raise undetermined from error
    _, matrix, distortion, _, _, deviations, _, errors = fit
    finite = all(np.isfinite(one).all() for one in (matrix, distortion, deviations))
    if not finite or matrix[0, 0] <= 0 or matrix[1, 1] <= 0:
        raise undetermined
    camera = Camera(np.asarray(matrix, dtype=np.float64), np.asarray(distortion, dtype=np.float64).ravel())
    return camera, float(deviations[0, 0] / matrix[0, 0]), np.asarray(errors, dtype=np.float64).ravel()


@dataclass(frozen=True, eq=False)
class JointFit:
    """Both cameras, the pose of the right one, and the pairs that were used.

    Attributes
    ----------
    left, right
        The cameras.
    pose
        The pose of the right camera.
    rms
        Reprojection error of the corners, px RMS over both cameras and all used pairs.
    used
        The numbers of the used pairs.
    orders
        The order of each pair's right corners that fits best, by its index in :attr:`ObservedPair.right`.
    errors
        Reprojection error in the left and the right picture of every pair, px RMS.
    """

    left: Camera
    right: Camera
    pose: Pose
    rms: float
    used: tuple[int, ...]
    orders: dict[int, int]
    errors: dict[int, tuple[float, float]]


def agreeing_fit(pairs: dict[int, ObservedPair], fits: SeparateFits, size: tuple[int, int]) -> JointFit:
    """Return both cameras, already calibrated separately, fitted together to the pairs that agree.

    Raises
    ------
    ValueError
        No majority of pairs that agree on the pose of the right camera.
    """
    used, orders = _largest_consensus(pairs, fits.left, fits.right, size[0])
    _check_majority(used, pairs)

    fitted = partial(_joint_fit, pairs, orders, fits, size)
    # The cameras were calibrated separately, which no contradiction between left and right can spoil: they stay fixed
    # until the agreeing pairs are known. The best of these are fitted first, so that no outlier bends the fit.
    fixed = fits.flags | cv2.CALIB_FIX_INTRINSIC
    fit = fitted(used, fixed)
    count = max(MIN_PAIRS, round(BEST_PAIRS_SHARE * len(used)))
    best = sorted(used, key=lambda number: max(fit.errors[number]))[:count]
    fit = fitted(tuple(sorted(best)), fixed)
    for _ in range(5):  # until the pairs that agree with the fit are those it was made from
        median_error = float(np.median([max(fit.errors[number]) for number in fit.used]))
        limit = max(MIN_CONTRADICTION_PX * size[0] / 1000, CONTRADICTION_MEDIAN_RATIO * median_error)
        used = tuple(number for number in pairs if max(fit.errors[number]) <= limit)
        _check_majority(used, pairs)
        if used == fit.used:
            break
        fit = fitted(used, fixed)
    return fitted(fit.used, fits.flags)


def _check_majority(used: Sequence[int], pairs: dict[int, ObservedPair]) -> None:
    if len(used) < MIN_PAIRS or 2 * len(used) <= len(pairs):
        raise ValueError(
            f"The pairs contradict each other: no more than {len(used)} of {len(pairs)} agree on where the right "
            "camera stands. Both pictures of a pair must be taken at the same moment, and neither camera may be moved "
            "or refocused in between."
        )


def _largest_consensus(
    pairs: dict[int, ObservedPair], left: Camera, right: Camera, width: int
) -> tuple[tuple[int, ...], dict[int, int]]:
    """Return the largest set of pairs that agree on the pose of the right camera, and the orders of all right corners.

    The right camera's pose from each pair is tried on all others: it must predict where the board seen by the left
    camera appears in the right picture. Pairs not taken at the same moment, of another board or with one picture turned
    round agree with no others.
    """
    boards = {number: left.pose(pair.points, pair.left) for number, pair in pairs.items()}
    agreeing: tuple[int, ...] = ()
    orders: dict[int, int] = {}
    best_rank: tuple[float, ...] = ()
    for number, pair in pairs.items():
        for image_points in pair.right:
            board = right.pose(pair.points, image_points)
            camera_rotation = board.rotation @ boards[number].rotation.T
            errors: dict[int, list[float]] = {}
            for other, (rotation, translation) in boards.items():
                moved = camera_rotation @ translation + board.translation - camera_rotation @ boards[number].translation
                predicted = right.project(pairs[other].points, Pose(camera_rotation @ rotation, moved))
                errors[other] = [_rms(predicted - found) for found in pairs[other].right]
            near = {other: min(one) for other, one in errors.items() if min(one) <= COARSE_TOLERANCE * width}
            # If a board looks the same from two ends, a camera upside down would agree with all pairs too.
            is_upright = float(np.trace(camera_rotation)) > 1  # rotated by less than a right angle
            median_error = float(np.median([*near.values()])) if near else np.inf
            rank = (float(len(near)), float(is_upright), -median_error)
            if rank > best_rank:
                agreeing, best_rank = tuple(near), rank
                orders = {other: int(np.argmin(one)) for other, one in errors.items()}
    return agreeing, orders


def _joint_fit(
    pairs: dict[int, ObservedPair],
    orders: dict[int, int],
    fits: SeparateFits,
    size: tuple[int, int],
    used: tuple[int, ...],
    flags: int,
) -> JointFit:
    """Return both cameras fitted together to the used pairs, with the errors of all pairs."""
    rms, *cameras, rotation, translation, _, _, _, _, errors = cv2.stereoCalibrateExtended(
        [pairs[number].points.astype(np.float32) for number in used],
        [pairs[number].left.astype(np.float32) for number in used],
        [pairs[number].right[orders[number]].astype(np.float32) for number in used],
        fits.left.matrix.copy(),
        fits.left.distortion.copy(),
        fits.right.matrix.copy(),
        fits.right.distortion.copy(),
        size,
        np.eye(3),
        np.zeros((3, 1)),
        flags=flags | cv2.CALIB_USE_INTRINSIC_GUESS,
        criteria=(cv2.TERM_CRITERIA_COUNT | cv2.TERM_CRITERIA_EPS, 200, 1e-9),
    )
    arrays = [np.asarray(one, dtype=np.float64) for one in (*cameras, rotation, translation)]
    both = Camera(arrays[0], arrays[1].ravel()), Camera(arrays[2], arrays[3].ravel())
    pose = Pose(arrays[4], arrays[5].ravel())
    all_errors = {number: (float(one[0]), float(one[1])) for number, one in zip(used, errors, strict=True)}
    for number in set(pairs) - set(used):
        all_errors[number] = _pair_errors(pairs[number], orders[number], *both, pose)
    return JointFit(*both, pose, float(rms), used, orders, all_errors)


def _pair_errors(pair: ObservedPair, order: int, left: Camera, right: Camera, pose: Pose) -> tuple[float, float]:
    """Return the left and right reprojection error of a pair, px RMS, at the board's best pose."""

    def residuals(parameters: Vector) -> Vector:
        board = Pose(np.asarray(cv2.Rodrigues(parameters[:3])[0], dtype=np.float64), parameters[3:])
        left_residuals = left.project(pair.points, board) - pair.left
        right_residuals = right.project(pair.points, pose.compose(board)) - pair.right[order]
        return np.concatenate((left_residuals, right_residuals)).ravel()

    board = left.pose(pair.points, pair.left)
    start = np.concatenate((cv2.Rodrigues(board.rotation)[0].ravel(), board.translation))
    fitted = scipy.optimize.least_squares(residuals, start, method="lm", max_nfev=400)
    left_rms, right_rms = np.sqrt(2 * np.square(residuals(fitted.x)).reshape(2, -1).mean(axis=1))
    return float(left_rms), float(right_rms)


MAX_ROLL_DEG = 45.0
"""Maximum rotation of one camera against the other about the view axis, degrees: beyond, its pictures are sideways or
upside down."""

MAX_DIAGONAL_RATIO = 0.7
"""Maximum ratio of the shorter to the longer one of the distances across and down between the cameras: within it rows
can be made to match by turning the pictures a little."""


def rig_of(fit: JointFit, size: tuple[int, int], square_m: float) -> StereoRig:
    """Return the cameras, with lengths in metres; ValueError if they are swapped, rotated or diagonal to each other."""
    roll = math.degrees(math.atan2(fit.pose.rotation[1, 0], fit.pose.rotation[0, 0]))
    if abs(roll) > MAX_ROLL_DEG:
        raise ValueError(
            f"The pictures of one camera are turned by {abs(roll):.0f}° against those of the other: give both the "
            "same way up."
        )
    across, up, _ = fit.pose.translation
    if across > abs(up):
        raise ValueError(
            "Left and right are exchanged: the camera of the pictures given as right stands to the left of the other "
            f"by {across * square_m:.3g} m. Swap them."
        )
    if min(abs(across), abs(up)) > MAX_DIAGONAL_RATIO * max(abs(across), abs(up)):
        raise ValueError(
            f"The right camera stands {abs(up) * square_m:.3g} m above or below the left one and "
            f"{abs(across) * square_m:.3g} m beside it; allowed are cameras side by side, or one above the other."
        )
    left, right = ((camera.matrix, _without_zeros(camera.distortion)) for camera in (fit.left, fit.right))
    return StereoRig(*left, *right, fit.pose.rotation, fit.pose.translation * square_m, *size)


def _without_zeros(distortion: Vector) -> Vector:
    """Return the coefficients of a lens without the trailing zeros of richer models."""
    used = int(np.flatnonzero(distortion).max(initial=0)) + 1
    return distortion[: next(count for count in (5, 8, 12, 14) if count >= used)]
