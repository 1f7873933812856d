"""The cameras from the corners of a board: each on its own, then both with their pose, from the pairs that agree."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np
import numpy.typing as npt
import scipy  # scipy.optimize is loaded only on first use: the quick judgement of a pair does not need it

from stereolag.core.arrays import DoubleMap, Vector
from stereolag.geometry.boards import Corners
from stereolag.geometry.calibration import StereoRig

COARSE_SHARE = 0.02
"""Largest distance of another pair's corners from where one pair's pose puts them, as a share of the picture's width.
One pair determines the tilt of its board, and so of the right camera, only to a fraction of a degree."""


@dataclass(frozen=True, eq=False)
class Camera:
    """A camera matrix (3, 3) and its distortion coefficients."""

    matrix: DoubleMap
    distortion: Vector


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
class Agreement:
    """The pairs that agree on the pose of the right camera.

    Attributes
    ----------
    agreeing
        (n,) bool.
    orders
        (n,) index of the order of each pair's right corners that fits best.
    """

    agreeing: npt.NDArray[np.bool_]
    orders: npt.NDArray[np.intp]


def agreement(pairs: Sequence[SeenPair], left: Camera, right: Camera, width: int) -> Agreement:
    """Return the largest set of pairs that agree on the pose of the right camera.

    The pose from each pair is tried on all others: with the right camera there, the board seen by the left camera must
    appear in the right picture where it does. Pictures not taken at the same moment, of another board or turned round
    agree with no others.

    Parameters
    ----------
    pairs
        Pairs of one rig.
    left, right
        The cameras, each calibrated on its own.
    width
        Width of the pictures, px.
    """
    boards = [_pose(pair.points, pair.left, left) for pair in pairs]
    best: Agreement | None = None
    rank: tuple[float, ...] = ()
    for (rotation, translation), pair in zip(boards, pairs, strict=True):
        for points in pair.right:
            turn, place = _pose(pair.points, points, right)
            between = turn @ rotation.T
            errors = [
                _errors(other, between @ turned, between @ moved + place - between @ translation, right)
                for other, (turned, moved) in zip(pairs, boards, strict=True)
            ]
            least = np.array([min(one) for one in errors])
            agreeing = least <= COARSE_SHARE * width
            # If a board looks the same from two ends, all pairs turned round would agree too; the camera is not.
            upright = float(np.trace(between)) > 1  # rotated by less than a right angle
            typical = float(np.median(least[agreeing])) if agreeing.any() else np.inf
            now = (float(agreeing.sum()), float(upright), -typical)
            if best is None or now > rank:
                best, rank = Agreement(agreeing, np.array([int(np.argmin(one)) for one in errors])), now
    assert best is not None
    return best


def pair_errors(
    pair: SeenPair, order: int, left: Camera, right: Camera, rotation: DoubleMap, translation: Vector
) -> tuple[float, float]:
    """Return how far the corners are from where a rig puts them, left and right, px RMS, at the board's best pose."""
    seen = pair.left, pair.right[order]
    start = _pose(pair.points, pair.left, left)

    def residuals(pose: Vector) -> Vector:
        turn, place = np.asarray(cv2.Rodrigues(pose[:3])[0], dtype=np.float64), pose[3:]
        beside = rotation @ turn, rotation @ place + translation
        placed = (
            _projected(pair.points, turn, place, left) - seen[0],
            _projected(pair.points, *beside, right) - seen[1],
        )
        return np.concatenate(placed).ravel()

    begin = np.concatenate((cv2.Rodrigues(start[0])[0].ravel(), start[1]))
    fitted = scipy.optimize.least_squares(residuals, begin, method="lm", max_nfev=400)
    ends = np.square(residuals(fitted.x)).reshape(2, -1)
    first, second = np.sqrt(2 * ends.mean(axis=1))
    return float(first), float(second)


def _pose(points: DoubleMap, seen: DoubleMap, camera: Camera) -> tuple[DoubleMap, Vector]:
    """Return the rotation (3, 3) and the translation (3,) of a board in a camera's frame."""
    found, turn, place = cv2.solvePnP(points, seen, camera.matrix, camera.distortion, flags=cv2.SOLVEPNP_IPPE)
    if found:
        turn, place = cv2.solvePnPRefineLM(points, seen, camera.matrix, camera.distortion, turn, place)
    else:
        _, turn, place = cv2.solvePnP(points, seen, camera.matrix, camera.distortion)
    return np.asarray(cv2.Rodrigues(turn)[0], dtype=np.float64), np.asarray(place, dtype=np.float64).ravel()


def _errors(pair: SeenPair, rotation: DoubleMap, translation: Vector, right: Camera) -> list[float]:
    """Return how far the right corners are from a prediction, px RMS, for each order."""
    placed = _projected(pair.points, rotation, translation, right)
    return [float(np.sqrt(np.square(placed - seen).sum(axis=1).mean())) for seen in pair.right]


def _projected(points: DoubleMap, rotation: DoubleMap, translation: Vector, camera: Camera) -> DoubleMap:
    turn = cv2.Rodrigues(rotation)[0]
    return np.asarray(cv2.projectPoints(points, turn, translation, camera.matrix, camera.distortion)[0][:, 0])


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


@dataclass(frozen=True, eq=False)
class Lens:
    """A camera determined from its own pictures.

    Attributes
    ----------
    camera
        Matrix and distortion.
    focal_error
        Standard error of the focal length, as a share of it.
    outliers
        Numbers of the pictures whose corners do not fit a flat board.
    """

    camera: Camera
    focal_error: float
    outliers: frozenset[int]


@dataclass(frozen=True, eq=False)
class Sight:
    """The corners of a board in one picture: (n, 3) on the board, in squares, and (n, 2) in the picture, px."""

    points: DoubleMap
    places: DoubleMap

    @classmethod
    def of(cls, corners: Corners, board_points: DoubleMap) -> Sight:
        """Return the corners found in a picture with their positions on the board."""
        return cls(board_points[corners.numbers], corners.points)


def calibrated_lens(sights: Sequence[Sight], size: tuple[int, int], flags: int) -> Lens:
    """Return the camera that took these pictures of a board.

    Parameters
    ----------
    sights
        At least three.
    size
        Width and height of the pictures, px.
    flags
        One of :data:`LENSES`.

    Raises
    ------
    ValueError
        Corners that do not determine a camera.
    """
    camera, focal_error, errors = _fitted(sights, size, flags)
    limit = max(LEAST_OUTLIER_PX, FARTHEST_OUTLIER * float(np.median(errors)))
    outliers = frozenset(np.flatnonzero(errors > limit).tolist())
    if outliers and len(sights) - len(outliers) >= 3:
        kept = [sight for number, sight in enumerate(sights) if number not in outliers]
        camera, focal_error, _ = _fitted(kept, size, flags)
    return Lens(camera, focal_error, outliers)


def suitable_lens(cameras: Sequence[Sequence[Sight]], size: tuple[int, int]) -> int:
    """Return the flags of the simplest model of :data:`LENSES` that predicts pictures it was not fitted to as well.

    In turn, every third picture is left out and predicted from the others, if there are enough.

    Parameters
    ----------
    cameras
        The pictures of each camera.
    size
        Width and height of the pictures, px.
    """
    enough = min(len(sights) for sights in cameras) >= ENOUGH_TO_LEAVE_OUT
    best, *richer = LENSES.values()
    least = _foretelling(cameras, size, best, FOLDS if enough else 1)
    for flags in richer:
        error = _foretelling(cameras, size, flags, FOLDS if enough else 1)
        if error < (WORTHWHILE if enough else WORTHWHILE_ON_ITS_OWN) * least:
            best, least = flags, error
    return best


def _foretelling(cameras: Sequence[Sequence[Sight]], size: tuple[int, int], flags: int, folds: int) -> float:
    """Return the median error on pictures left out, px; with a single fold none is left out."""
    errors = []
    for sights in cameras:
        for fold in range(folds):
            given = [sight for number, sight in enumerate(sights) if folds == 1 or number % folds != fold]
            try:
                camera, _, _ = _fitted(given, size, flags)
            except ValueError:
                return np.inf
            errors += [_error(sight, camera) for number, sight in enumerate(sights) if number % folds == fold]
    return float(np.median(errors))


def _error(sight: Sight, camera: Camera) -> float:
    """Return how far the corners are from where the camera would see them, px RMS, with the board at its best pose."""
    found, turn, place = cv2.solvePnP(sight.points, sight.places, camera.matrix, camera.distortion)
    if not found:
        return np.inf
    placed = cv2.projectPoints(sight.points, turn, place, camera.matrix, camera.distortion)[0][:, 0]
    return float(np.sqrt(np.square(placed - sight.places).sum(axis=1).mean()))


def _fitted(sights: Sequence[Sight], size: tuple[int, int], flags: int) -> tuple[Camera, float, DoubleMap]:
    """Return the camera, the standard error of its focal length as a share of it, and each picture's error, px RMS."""
    points = [sight.points.astype(np.float32) for sight in sights]
    places = [sight.places.astype(np.float32) for sight in sights]
    try:
        _, matrix, distortion, _, _, deviations, _, errors = cv2.calibrateCameraExtended(
            points, places, size, np.eye(3), np.zeros(14), flags=flags
        )
    except cv2.error as error:
        raise ValueError(
            f"{len(sights)} pictures of the board do not determine the camera: show it at more places and tilted more."
        ) from error
    numbers = (matrix, distortion, deviations)
    if not all(np.isfinite(one).all() for one in numbers) or matrix[0, 0] <= 0 or matrix[1, 1] <= 0:
        raise ValueError(
            f"{len(sights)} pictures of the board do not determine the camera: show it at more places and tilted more."
        )
    camera = Camera(np.asarray(matrix, dtype=np.float64), np.asarray(distortion, dtype=np.float64).ravel())
    focal_error = float(deviations[0, 0] / matrix[0, 0])
    return camera, focal_error, np.asarray(errors, dtype=np.float64).ravel()


def without_zeros(distortion: Vector) -> Vector:
    """Return distortion coefficients without the trailing zeros of richer models: 5, 8, 12 or 14."""
    last = int(np.flatnonzero(distortion).max(initial=0)) + 1
    return distortion[: next(count for count in (5, 8, 12, 14) if count >= last)]


FEWEST_PAIRS = 3

MOST_TIMES_USUAL = 4.0
LEAST_ERROR_PX = 0.75
"""A pair contradicts the others if its error exceeds this multiple of the median and this many px per 1000 of width."""

MOST_ROUNDS = 5

BEST_SHARE = 0.6
"""Share of the pairs, those that agree best, from which the errors of the others are judged."""


@dataclass(frozen=True, eq=False)
class JointFit:
    """Both cameras, the pose of the right one with lengths in squares, and the pairs that were used."""

    left: Camera
    right: Camera
    rotation: DoubleMap
    translation: Vector
    rms: float
    used: tuple[int, ...]
    orders: dict[int, int]
    errors: dict[int, tuple[float, float]]


def agreeing_fit(seen: dict[int, SeenPair], left: Camera, right: Camera, size: tuple[int, int], flags: int) -> JointFit:
    """Return both cameras fitted together to the pairs that agree."""
    numbers = list(seen)
    found = agreement(list(seen.values()), left, right, size[0])
    orders = dict(zip(numbers, found.orders.tolist(), strict=True))
    used = tuple(number for number, agrees in zip(numbers, found.agreeing, strict=True) if agrees)
    _check_majority(used, numbers)
    # The cameras were calibrated separately, which no contradiction between left and right can spoil: they stay fixed
    # until the agreeing pairs are known. The best of these are fitted first, or a fit would bend to one that does not.
    fixed = flags | cv2.CALIB_FIX_INTRINSIC
    fit = _fit(seen, used, orders, left, right, size, fixed)
    best = sorted(used, key=lambda number: max(fit.errors[number]))[: max(FEWEST_PAIRS, round(BEST_SHARE * len(used)))]
    fit = _fit(seen, tuple(sorted(best)), orders, left, right, size, fixed)
    for _ in range(MOST_ROUNDS):
        usual = float(np.median([max(fit.errors[number]) for number in fit.used]))
        limit = max(LEAST_ERROR_PX * size[0] / 1000, MOST_TIMES_USUAL * usual)
        used = tuple(number for number in numbers if max(fit.errors[number]) <= limit)
        _check_majority(used, numbers)
        if used == fit.used:
            break
        fit = _fit(seen, used, orders, left, right, size, fixed)
    return _fit(seen, fit.used, orders, left, right, size, flags)


def _check_majority(used: Sequence[int], numbers: Sequence[int]) -> None:
    if len(used) < FEWEST_PAIRS or 2 * len(used) <= len(numbers):
        raise ValueError(
            f"The pairs contradict each other: no more than {len(used)} of {len(numbers)} agree on where the right "
            "camera stands. Both pictures of a pair must be taken at the same moment, and neither camera may be moved "
            "or refocused in between."
        )


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
    turn, place = numbers[4], numbers[5].ravel()
    found = {number: (float(one[0]), float(one[1])) for number, one in zip(used, errors, strict=True)}
    for number in set(seen) - set(used):
        found[number] = pair_errors(seen[number], orders[number], *both, turn, place)
    return JointFit(*both, turn, place, float(rms), used, orders, found)


def rig_of(fit: JointFit, size: tuple[int, int], square_m: float) -> StereoRig:
    """Return the cameras with lengths in metres, if they are side by side and in order."""
    across, up, _ = fit.translation
    if across > abs(up):
        raise ValueError(
            "Left and right are exchanged: the camera of the pictures given as right stands to the left of the other "
            f"by {across * square_m:.3g} m. Swap them."
        )
    if -across <= abs(up):
        raise ValueError(
            f"The right camera stands {abs(up) * square_m:.3g} m above or below the left one and "
            f"{-across * square_m:.3g} m beside it; allowed are cameras side by side: turn the pictures of cameras one "
            "above the other by 90°."
        )
    return StereoRig(
        fit.left.matrix,
        without_zeros(fit.left.distortion),
        fit.right.matrix,
        without_zeros(fit.right.distortion),
        fit.rotation,
        fit.translation * square_m,
        *size,
    )
