"""Cameras fitted to corners seen in several pictures: each alone, then both together, without those that contradict."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
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

WORTHWHILE = 0.97
"""A richer model must lower the error on left-out pictures to this share: it is wrong where there were no corners."""

FOLDS = 3
ENOUGH_TO_LEAVE_OUT = 6
WORTHWHILE_ON_ITS_OWN = 0.7
"""With fewer pictures none can be left out; on the pictures it is fitted to, a richer model is always a bit better."""

FARTHEST_OUTLIER = 5.0
LEAST_OUTLIER_PX = 1.5
"""A picture whose error exceeds this multiple of the median, and this many px, does not show a flat board."""

COARSE_SHARE = 0.02
"""Largest distance of another pair's corners from where one pair's pose puts them, as a share of the picture's width.
One pair determines the tilt of its board, and so of the right camera, only to a fraction of a degree."""

FEWEST_PAIRS = 3

MOST_TIMES_USUAL = 4.0
LEAST_ERROR_PX = 0.75
"""A pair contradicts the others if its error exceeds this multiple of the median and this many px per 1000 of width."""

MOST_ROUNDS = 5

CONVERGED = (cv2.TERM_CRITERIA_COUNT | cv2.TERM_CRITERIA_EPS, 30, 1e-9)
"""Where a camera alone is fitted well enough. OpenCV's own choice, the last bit of a float64, takes all 30 steps."""

BEST_SHARE = 0.6
"""Share of the pairs, those that agree best, from which the errors of the others are judged."""


class Sight(NamedTuple):
    """The corners of a board in one picture: (n, 3) on the board, in squares, and (n, 2) in the picture, px."""

    points: DoubleMap
    places: DoubleMap


class Pose(NamedTuple):
    """The pose of a board in a camera's frame, or of the right camera: rotation (3, 3), translation (3,) in squares."""

    rotation: DoubleMap
    translation: Vector

    def beside(self, first: Pose) -> Pose:
        """Return the pose of a board in the right camera's frame, this pose being the camera's, `first` in the left."""
        return Pose(self.rotation @ first.rotation, self.rotation @ first.translation + self.translation)


@dataclass(frozen=True, eq=False)
class SeenPair:
    """A board seen in both pictures of a pair.

    Attributes
    ----------
    points
        (n, 3) corners of the board that both show, in squares.
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
    """A camera matrix (3, 3) and its distortion coefficients."""

    matrix: DoubleMap
    distortion: Vector

    def pose(self, points: DoubleMap, places: DoubleMap) -> Pose:
        """Return the pose of a board whose points are seen at these places, px."""
        flat = points * (1, 1, 0)  # a bent board is all but flat
        found, turn, place = cv2.solvePnP(flat, places, self.matrix, self.distortion, flags=cv2.SOLVEPNP_IPPE)
        if found:
            turn, place = cv2.solvePnPRefineLM(points, places, self.matrix, self.distortion, turn, place)
        else:
            _, turn, place = cv2.solvePnP(points, places, self.matrix, self.distortion)
        return Pose(np.asarray(cv2.Rodrigues(turn)[0], dtype=np.float64), np.asarray(place, dtype=np.float64).ravel())

    def projected(self, points: DoubleMap, pose: Pose) -> DoubleMap:
        """Return where the camera sees the points of a board at this pose, (n, 2) px."""
        return np.asarray(self._seen(points, pose)[0][:, 0])

    def slopes(self, points: DoubleMap, pose: Pose) -> DoubleMap:
        """Return how far each point seen moves with its place on the board, (n, 2, 3) px a square."""
        of_places = np.asarray(self._seen(points, pose)[1])[:, 3:6]
        return np.asarray(of_places.reshape(-1, 2, 3) @ pose.rotation)

    def _seen(self, points: DoubleMap, pose: Pose) -> Any:
        turn = cv2.Rodrigues(pose.rotation)[0]
        return cv2.projectPoints(points, turn, pose.translation, self.matrix, self.distortion)


class SeparateFits(NamedTuple):
    """Both cameras, each fitted on its own.

    Attributes
    ----------
    flags
        The model of both lenses.
    left, right
        The cameras.
    focal_error
        The larger standard error of the focal lengths, as a share of them.
    outliers
        Of each camera, the numbers of the pictures that do not show the board.
    """

    flags: int
    left: Camera
    right: Camera
    focal_error: float
    outliers: tuple[set[int], set[int]]


def separate_fits(cameras: Sequence[Sequence[Sight]], size: tuple[int, int]) -> SeparateFits:
    """Return both cameras, each calibrated on its own, with the simplest lens that suits both.

    Raises
    ------
    ValueError
        Corners that do not determine a camera, for which three pictures are the least.
    """
    flags = suitable_lens(cameras, size)
    (left, right), focal_errors, outliers = zip(*(calibrated_camera(one, size, flags) for one in cameras), strict=True)
    return SeparateFits(flags, left, right, max(focal_errors), outliers)


def calibrated_camera(sights: Sequence[Sight], size: tuple[int, int], flags: int) -> tuple[Camera, float, set[int]]:
    """Return the camera that took these pictures of a board, and which of them do not show a flat board.

    Between the two stands the standard error of the focal length, as a share of it.

    Raises
    ------
    ValueError
        Corners that do not determine a camera, for which three pictures are the least.
    """
    camera, focal_error, errors = fitted_camera(sights, size, flags)
    limit = max(LEAST_OUTLIER_PX, FARTHEST_OUTLIER * float(np.median(errors)))
    outliers = set(np.flatnonzero(errors > limit).tolist())
    if outliers and len(sights) - len(outliers) >= 3:
        kept = [sight for number, sight in enumerate(sights) if number not in outliers]
        camera, focal_error, _ = fitted_camera(kept, size, flags)
    return camera, focal_error, outliers


def suitable_lens(cameras: Sequence[Sequence[Sight]], size: tuple[int, int]) -> int:
    """Return the flags of the simplest model of :data:`LENSES` that predicts pictures it was not fitted to as well.

    In turn, every third picture of each camera is left out and predicted from the others, if there are enough.
    """
    enough = min(len(sights) for sights in cameras) >= ENOUGH_TO_LEAVE_OUT
    folds, worthwhile = (FOLDS, WORTHWHILE) if enough else (1, WORTHWHILE_ON_ITS_OWN)
    best, least = 0, np.inf
    for number, flags in enumerate(LENSES.values()):
        error = _left_out_error(cameras, size, flags, folds)
        if number == 0 or error < worthwhile * least:
            best, least = flags, error
    return best


def _left_out_error(cameras: Sequence[Sequence[Sight]], size: tuple[int, int], flags: int, folds: int) -> float:
    """Return the median error on pictures left out, px RMS; with a single fold none is left out."""
    errors = []
    for sights in cameras:
        for fold in range(folds):
            given = [sight for number, sight in enumerate(sights) if folds == 1 or number % folds != fold]
            try:
                camera, _, _ = fitted_camera(given, size, flags)
            except ValueError:
                return np.inf
            for points, places in sights[fold::folds]:
                errors.append(_rms(camera.projected(points, camera.pose(points, places)) - places))
    return float(np.median(errors))


def _rms(differences: DoubleMap) -> float:
    return float(np.sqrt(np.square(differences).sum(axis=1).mean()))


def fitted_camera(sights: Sequence[Sight], size: tuple[int, int], flags: int) -> tuple[Camera, float, Vector]:
    """Return the camera, the error of its focal length as a share of it, and that of each picture, px RMS."""
    points = [sight.points.astype(np.float32) for sight in sights]
    places = [sight.places.astype(np.float32) for sight in sights]
    undetermined = ValueError(
        f"{len(sights)} pictures of the board do not determine the camera: show it at more places and tilted more."
    )
    try:
        _, matrix, distortion, _, _, deviations, _, errors = cv2.calibrateCameraExtended(
            points, places, size, np.eye(3), np.zeros(14), flags=flags, criteria=CONVERGED
        )
    except cv2.error as error:
        raise undetermined from error
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
    rms
        Distance of the corners from where the fit puts them, px, over both cameras and all pairs used.
    orders
        The order of each pair's right corners that fits best.
    errors
        The same distance in the left and the right picture of every pair.
    """

    left: Camera
    right: Camera
    pose: Pose
    rms: float
    used: tuple[int, ...]
    orders: dict[int, int]
    errors: dict[int, tuple[float, float]]


def agreeing_fit(seen: dict[int, SeenPair], fits: SeparateFits, size: tuple[int, int]) -> JointFit:
    """Return both cameras, each calibrated on its own before, fitted together to the pairs that agree.

    Raises
    ------
    ValueError
        No majority of pairs that agree on the pose of the right camera.
    """
    _, left, right, _, _ = fits
    used, orders = _agreement(seen, left, right, size[0])
    _check_majority(used, seen)

    def fitted(used: Sequence[int], flags: int) -> JointFit:
        return _fit(seen, tuple(used), orders, left, right, size, flags)

    # The cameras were calibrated separately, which no contradiction between left and right can spoil: they stay fixed
    # until the agreeing pairs are known. The best of these are fitted first, or a fit would bend to one that does not.
    fixed = fits.flags | cv2.CALIB_FIX_INTRINSIC
    fit = fitted(used, fixed)
    best = sorted(used, key=lambda number: max(fit.errors[number]))[: max(FEWEST_PAIRS, round(BEST_SHARE * len(used)))]
    fit = fitted(sorted(best), fixed)
    for _ in range(MOST_ROUNDS):
        usual = float(np.median([max(fit.errors[number]) for number in fit.used]))
        limit = max(LEAST_ERROR_PX * size[0] / 1000, MOST_TIMES_USUAL * usual)
        used = tuple(number for number in seen if max(fit.errors[number]) <= limit)
        _check_majority(used, seen)
        if used == fit.used:
            break
        fit = fitted(used, fixed)
    return fitted(fit.used, fits.flags)


def _check_majority(used: Sequence[int], seen: dict[int, SeenPair]) -> None:
    if len(used) < FEWEST_PAIRS or 2 * len(used) <= len(seen):
        raise ValueError(
            f"The pairs contradict each other: no more than {len(used)} of {len(seen)} agree on where the right "
            "camera stands. Both pictures of a pair must be taken at the same moment, and neither camera may be moved "
            "or refocused in between."
        )


def _agreement(
    seen: dict[int, SeenPair], left: Camera, right: Camera, width: int
) -> tuple[tuple[int, ...], dict[int, int]]:
    """Return the largest set of pairs that agree on the pose of the right camera, and the orders of all right corners.

    The pose from each pair is tried on all others: with the right camera there, the board seen by the left camera must
    appear in the right picture where it does. Pictures not taken at the same moment, of another board or turned round
    agree with no others.
    """
    boards = {number: left.pose(pair.points, pair.left) for number, pair in seen.items()}
    agreeing: tuple[int, ...] = ()
    orders: dict[int, int] = {}
    rank: tuple[float, ...] = ()
    for number, pair in seen.items():
        for places in pair.right:
            board = right.pose(pair.points, places)
            turn = board.rotation @ boards[number].rotation.T
            errors: dict[int, list[float]] = {}
            for other, (rotation, translation) in boards.items():
                moved = turn @ translation + board.translation - turn @ boards[number].translation
                placed = right.projected(seen[other].points, Pose(turn @ rotation, moved))
                errors[other] = [_rms(placed - found) for found in seen[other].right]
            near = {other: min(one) for other, one in errors.items() if min(one) <= COARSE_SHARE * width}
            # If a board looks the same from two ends, all pairs turned round would agree too; the camera is not.
            upright = float(np.trace(turn)) > 1  # rotated by less than a right angle
            now = (float(len(near)), float(upright), -float(np.median([*near.values()])) if near else -np.inf)
            if now > rank:
                agreeing, rank = tuple(near), now
                orders = {other: int(np.argmin(one)) for other, one in errors.items()}
    return agreeing, orders


def _fit(
    seen: dict[int, SeenPair],
    used: tuple[int, ...],
    orders: dict[int, int],
    left: Camera,
    right: Camera,
    size: tuple[int, int],
    flags: int,
) -> JointFit:
    """Return both cameras fitted to these pairs, and the errors of all pairs."""
    criteria = (cv2.TERM_CRITERIA_COUNT | cv2.TERM_CRITERIA_EPS, 200, 1e-9)
    rms, *cameras, rotation, translation, _, _, _, _, errors = cv2.stereoCalibrateExtended(
        [seen[number].points.astype(np.float32) for number in used],
        [seen[number].left.astype(np.float32) for number in used],
        [seen[number].right[orders[number]].astype(np.float32) for number in used],
        left.matrix.copy(),
        left.distortion.copy(),
        right.matrix.copy(),
        right.distortion.copy(),
        size,
        np.eye(3),
        np.zeros((3, 1)),
        flags=flags | cv2.CALIB_USE_INTRINSIC_GUESS,
        criteria=criteria,
    )
    numbers = [np.asarray(one, dtype=np.float64) for one in (*cameras, rotation, translation)]
    both = Camera(numbers[0], numbers[1].ravel()), Camera(numbers[2], numbers[3].ravel())
    pose = Pose(numbers[4], numbers[5].ravel())
    found = {number: (float(one[0]), float(one[1])) for number, one in zip(used, errors, strict=True)}
    for number in set(seen) - set(used):
        found[number] = _pair_errors(seen[number], orders[number], *both, pose)
    return JointFit(*both, pose, float(rms), used, orders, found)


def _pair_errors(pair: SeenPair, order: int, left: Camera, right: Camera, pose: Pose) -> tuple[float, float]:
    """Return how far the corners are from where a rig puts them, left and right, px RMS, at the board's best pose."""

    def residuals(numbers: Vector) -> Vector:
        board = Pose(np.asarray(cv2.Rodrigues(numbers[:3])[0], dtype=np.float64), numbers[3:])
        first = left.projected(pair.points, board) - pair.left
        second = right.projected(pair.points, pose.beside(board)) - pair.right[order]
        return np.concatenate((first, second)).ravel()

    start = left.pose(pair.points, pair.left)
    begin = np.concatenate((cv2.Rodrigues(start.rotation)[0].ravel(), start.translation))
    fitted = scipy.optimize.least_squares(residuals, begin, method="lm", max_nfev=400)
    first, second = np.sqrt(2 * np.square(residuals(fitted.x)).reshape(2, -1).mean(axis=1))
    return float(first), float(second)


MOST_TURNED = 45.0
"""Degrees about the view axis up to which one camera may be turned against the other: beyond, it is upside down."""

ASLANT = 0.7
"""Share of the longer one of the distances across and down up to which the shorter one may go: rows can be made to
match by turning the pictures a little."""


def rig_of(fit: JointFit, size: tuple[int, int], square_m: float) -> StereoRig:
    """Return the cameras with lengths in metres, if they are side by side and in order, or one above the other."""
    turned = math.degrees(math.atan2(fit.pose.rotation[1, 0], fit.pose.rotation[0, 0]))
    if abs(turned) > MOST_TURNED:
        raise ValueError(
            f"The pictures of one camera are turned by {abs(turned):.0f}° against those of the other: give both the "
            "same way up."
        )
    across, up, _ = fit.pose.translation
    if across > abs(up):
        raise ValueError(
            "Left and right are exchanged: the camera of the pictures given as right stands to the left of the other "
            f"by {across * square_m:.3g} m. Swap them."
        )
    if min(abs(across), abs(up)) > ASLANT * max(abs(across), abs(up)):
        raise ValueError(
            f"The right camera stands {abs(up) * square_m:.3g} m above or below the left one and "
            f"{abs(across) * square_m:.3g} m beside it; allowed are cameras side by side, or one above the other."
        )
    lenses = []
    for distortion in (fit.left.distortion, fit.right.distortion):
        # Without the trailing zeros of richer models.
        last = int(np.flatnonzero(distortion).max(initial=0)) + 1
        lenses.append(distortion[: next(count for count in (5, 8, 12, 14) if count >= last)])
    translation = fit.pose.translation * square_m
    return StereoRig(fit.left.matrix, lenses[0], fit.right.matrix, lenses[1], fit.pose.rotation, translation, *size)
