"""Calibration of a stereo camera from pictures of a board: each camera, then both; with a report on each pair."""

from __future__ import annotations

import itertools
import math
from collections.abc import Collection, Iterable, Sequence
from dataclasses import dataclass, replace
from enum import StrEnum
from typing import NamedTuple

import cv2
import numpy as np
import numpy.typing as npt
import scipy  # scipy.optimize is loaded only on first use: the quick judgement of a pair does not need it

from stereolag.core.arrays import DoubleMap, Vector
from stereolag.core.jobs import Progress
from stereolag.geometry.boards import Board, BoardViews, Corners, Grey8, Pairs, find_boards
from stereolag.geometry.calibration import Calibration, StereoRig, check_positive
from stereolag.geometry.rectification import rectification, rectified_calibration

UNTIL = (cv2.TERM_CRITERIA_COUNT | cv2.TERM_CRITERIA_EPS, 50, 1e-9)
"""Criteria to stop inverting the distortion; after OpenCV's five rounds a wide lens is off by a fifth of a px."""

COVERAGE_CELLS = 100
"""Cells each way in which the coverage by boards is counted."""


class LeftOut(StrEnum):
    """Why a pair is left out."""

    NOT_FOUND_LEFT = "not_found_left"
    NOT_FOUND_RIGHT = "not_found_right"
    NOT_FOUND = "not_found"
    OTHER_SIZE = "other_size"
    FEW_IN_COMMON = "few_in_common"
    SAME_VIEW = "same_view"
    NOT_FLAT = "not_flat"
    CONTRADICTS = "contradicts"
    BY_HAND = "by_hand"


@dataclass(frozen=True, eq=False)
class PairReport:
    """The outcome for one pair of pictures.

    Attributes
    ----------
    left, right
        Corners found, those of the right picture in the order of the left one; None if there are none.
    left_out
        Why the pair is left out; None if it counts.
    turned
        Whether the corners in the right picture had been counted from another end of the board, and were reordered.
    left_rms, right_rms
        Distance of the corners from where the calibration puts them, px RMS; NaN if unknown.
    row_error
        Row difference of matching corners after rectification, px, on average; NaN if unknown.
    """

    left: Corners | None
    right: Corners | None
    left_out: LeftOut | None
    turned: bool = False
    left_rms: float = np.nan
    right_rms: float = np.nan
    row_error: float = np.nan


@dataclass(frozen=True, eq=False)
class StereoCalibration:
    """A calibrated stereo camera.

    Attributes
    ----------
    calibration
        Calibration with its rig and its ``rms``.
    board
        The board in the pictures.
    square_m
        Side of a square, metres.
    pairs
        The outcome for each pair.
    rms
        Distance of the corners from where the calibration puts them, px RMS over both cameras and all pairs that count,
        as returned by ``cv2.stereoCalibrate``.
    row_error
        Row difference of matching corners after rectification, px, on average over these pairs.
    left_coverage, right_coverage
        Share of each picture that has been covered by a board, 0..1.
    focal_error
        Standard error of the focal lengths, as a share of them; the larger one of the two cameras.
    """

    calibration: Calibration
    board: Board
    square_m: float
    pairs: tuple[PairReport, ...]
    rms: float
    row_error: float
    left_coverage: float
    right_coverage: float
    focal_error: float

    @property
    def used(self) -> tuple[int, ...]:
        """Return the numbers of the pairs that count."""
        return tuple(number for number, pair in enumerate(self.pairs) if pair.left_out is None)


def covered_cells(corners: Sequence[Corners], size: tuple[int, int]) -> Grey8:
    """Return which cells of a picture, 1 or 0, the board covered in at least one of the pictures."""
    cells = np.zeros((COVERAGE_CELLS, COVERAGE_CELLS), np.uint8)
    for one in corners:
        places = np.floor(one.points * COVERAGE_CELLS / size).astype(np.int32)
        cv2.fillConvexPoly(cells, cv2.convexHull(places), 1)
    return cells


FEWEST_IN_COMMON = 6
"""Fewest corners of a ChArUco board that both pictures of a pair must show."""

SAME_PX = 0.02
"""Corners closer together than this on average, px, belong to one and the same picture."""

MOST_FOCAL_ERROR = 0.1
"""Largest standard error of a focal length, as a share of it; above it the calibration is refused."""

_FINDING_SHARE = 0.95
"""Share of the time for finding the corners; the rest is for the calibration."""


def calibrate(
    pairs: Pairs | Iterable[tuple[npt.ArrayLike, npt.ArrayLike]],
    board: Board | tuple[int, int] | None = None,
    square_m: float = 1.0,
    *,
    progress: Progress | None = None,
) -> Calibration:
    """Calibrate a stereo camera from pairs of pictures of a chessboard or ChArUco board.

    Each camera is calibrated on its own, then both together with their pose (Zhang, PAMI 2000; Bouguet's stereo
    calibration, by OpenCV). Pairs that contradict the others, because they were not taken at the same moment or show
    the board turned round in one picture, are left out: :func:`calibrate_boards` reports which.

    Parameters
    ----------
    pairs
        Left and right pictures, 8 to 40 for a good calibration: (rows, cols) grey or (rows, cols, 3 | 4) RGB(A);
        uint8, uint16 or float; all of one size.
    board
        Columns and rows of the board's inner corners, where four squares meet; None: guessed from the pictures. The
        kind of board is guessed in either case.
    square_m
        Side of a square, metres: it sets the unit of all lengths. With 1, lengths are in squares.
    progress
        Called with the fraction done.

    Returns
    -------
    calibration
        Calibration with its ``rig``, for :func:`stereolag.rectify`, and ``rms``, the reprojection error in px.

    Raises
    ------
    ValueError
        Fewer than 3 pairs in which both pictures show the board, pairs that contradict each other, boards held too much
        alike, left and right exchanged or not the same way up, cameras that stand aslant of each other, or anything
        :func:`find_boards` refuses.

    Examples
    --------
    Two cameras 0.1 m apart, drawn with a board with squares of 30 mm:

    >>> import numpy as np
    >>> import stereolag as sl
    >>> from stereolag.geometry.boards import Board
    >>> from stereolag.geometry.drawn_boards import drawn_pairs
    >>> from stereolag.geometry.calibration import StereoRig
    >>> camera = [[220, 0, 119.5], [0, 220, 89.5], [0, 0, 1]]  # px
    >>> rig = StereoRig(camera, [], camera, [], np.eye(3), [-0.1, 0, 0], width=240, height=180)
    >>> pairs = drawn_pairs(rig, Board(4, 3), 3, square_m=0.03)
    >>> calibration = sl.calibrate(pairs, board=(4, 3), square_m=0.03)
    >>> round(calibration.baseline_m, 3)  # metres
    0.1
    >>> calibration.rms < 0.1  # px
    True
    """
    check_positive(square_m, "square_m")
    report = None if progress is None else lambda fraction: progress(_FINDING_SHARE * fraction)
    result = calibrate_boards(find_boards(pairs, board, progress=report), square_m)
    if progress is not None:
        progress(1.0)
    return result.calibration


def calibrate_boards(views: BoardViews, square_m: float = 1.0, *, leave_out: Collection[int] = ()) -> StereoCalibration:
    """Calibrate a stereo camera from the corners of a board, and report on each pair; errors as for :func:`calibrate`.

    `leave_out` are the numbers of pairs to leave out.
    """
    check_positive(square_m, "square_m")
    reasons = _unusable(views, leave_out)
    usable = _usable(reasons, views)
    points, both = views.board.points(), views.both
    sights = [
        [Sight(points[one.numbers], one.points) for one in (both[number][side] for number in usable)] for side in (0, 1)
    ]
    flags = suitable_lens(sights, views.size)
    (left, right), focal_errors, outliers = zip(
        *(calibrated_camera(one, views.size, flags) for one in sights), strict=True
    )
    for place in set.union(*outliers):
        reasons[usable[place]] = LeftOut.NOT_FLAT
    seen = {number: _seen_pair(*both[number], views.board) for number in _usable(reasons, views)}
    fit = agreeing_fit(seen, left, right, views.size, flags)
    for number in set(seen) - set(fit.used):
        reasons[number] = LeftOut.CONTRADICTS
    return _report(views, square_m, seen, fit, reasons, max(focal_errors))


def _unusable(views: BoardViews, leave_out: Collection[int]) -> list[LeftOut | None]:
    """Return why each pair cannot be used; None if it can."""
    reasons: list[LeftOut | None] = []
    kept: list[tuple[Corners, Corners]] = []
    for number, (left, right) in enumerate(zip(views.left, views.right, strict=True)):
        reason = LeftOut.BY_HAND if number in leave_out else None
        if set(views.sizes[number]) != {views.size}:
            reason = LeftOut.OTHER_SIZE
        elif left is None or right is None:
            both = left is None and right is None
            reason = LeftOut.NOT_FOUND if both else LeftOut.NOT_FOUND_LEFT if left is None else LeftOut.NOT_FOUND_RIGHT
        elif len(common := np.intersect1d(left.numbers, right.numbers)) < FEWEST_IN_COMMON or views.board.in_a_row(
            common
        ):
            reason = LeftOut.FEW_IN_COMMON
        elif any(_same(left, others[0]) and _same(right, others[1]) for others in kept):
            reason = LeftOut.SAME_VIEW
        else:
            kept.append((left, right))
        reasons.append(reason)
    return reasons


def _same(corners: Corners, others: Corners) -> bool:
    same = np.array_equal(corners.numbers, others.numbers)
    return same and float(np.abs(corners.points - others.points).mean()) < SAME_PX


def _usable(reasons: Sequence[LeftOut | None], views: BoardViews) -> list[int]:
    """Return the numbers of the pairs that can be used, of which there must be enough."""
    usable = [number for number, reason in enumerate(reasons) if reason is None]
    if len(usable) < FEWEST_PAIRS:
        if LeftOut.OTHER_SIZE in reasons:
            sizes = " and ".join(f"{width} × {height}" for width, height in sorted({*itertools.chain(*views.sizes)}))
            raise ValueError(
                f"The pictures are of {sizes} pixels: {len(usable)} of {len(views)} pairs are of the size of most, and "
                f"at least {FEWEST_PAIRS} are needed. Give left and right pictures of one size, as they were taken."
            )
        board = f"{views.board.columns} × {views.board.rows} inner corners"
        raise ValueError(
            f"{len(usable)} of {len(views)} pairs can be used, and at least {FEWEST_PAIRS} are needed, 8 or more for a "
            f"good calibration. A board of {board} was found in both pictures of {len(views.both)}: is that its size?"
        )
    return usable


def _seen_pair(left: Corners, right: Corners, board: Board) -> SeenPair:
    common = np.intersect1d(left.numbers, right.numbers)
    places = right.of(common)
    rights = tuple(places[order] for order in board.orders(len(common)))
    return SeenPair(board.points()[common], left.of(common), rights)


def _report(
    views: BoardViews,
    square_m: float,
    seen: dict[int, SeenPair],
    fit: JointFit,
    reasons: Sequence[LeftOut | None],
    focal_error: float,
) -> StereoCalibration:
    """Return the calibration in metres, with the outcome for each pair."""
    if focal_error > MOST_FOCAL_ERROR:
        raise ValueError(
            f"The focal length is uncertain by {100 * focal_error:.0f} %; at most {100 * MOST_FOCAL_ERROR:.0f} % is "
            f"allowed. The board was held too similarly in {len(fit.used)} pairs: tilt it by 30° or more, up and down "
            "and to both sides, and show it in every part of the picture."
        )
    rig = rig_of(fit, views.size, square_m)
    pairs = []
    for number, reason in enumerate(reasons):
        left, right, turned, row_error = views.left[number], views.right[number], False, np.nan
        if number in seen:
            order = fit.orders[number]
            places = seen[number].right[order]
            turned = order > 0 and reason is None
            right = Corners(views.both[number][1].numbers, places) if turned else right
            rows = _rows(rig, views.size, seen[number].left, places)
            row_error = float(np.abs(rows[0] - rows[1]).mean())
        errors = fit.errors.get(number, (np.nan, np.nan))
        pairs.append(PairReport(left, right, reason, turned, *errors, row_error))
    covered = [
        float(covered_cells([views.both[number][side] for number in fit.used], views.size).mean()) for side in (0, 1)
    ]
    return StereoCalibration(
        replace(rectified_calibration(rig, views.size), rig=rig, rms=fit.rms),
        views.board,
        square_m,
        tuple(pairs),
        fit.rms,
        float(
            np.average(
                [pairs[number].row_error for number in fit.used],
                weights=[len(seen[number].points) for number in fit.used],
            )
        ),
        covered[0],
        covered[1],
        focal_error,
    )


def _rows(rig: StereoRig, size: tuple[int, int], left: DoubleMap, right: DoubleMap) -> DoubleMap:
    """Return the rows of matching corners after rectification, px, (2, n)."""
    (width, height), turn = size, rig.turn
    if turn:
        rig, size = rig.turned(turn, size), (height, width)
    how = rectification(rig, size)
    cameras = (
        (left, rig.left_matrix, rig.left_distortion, how.left_rotation, how.left_projection),
        (right, rig.right_matrix, rig.right_distortion, how.right_rotation, how.right_projection),
    )
    rows = []
    for places, matrix, lens, rotation, projection in cameras:
        x, y = places.T
        turned = {0: (x, y), 1: (y, width - 1 - x), -1: (height - 1 - y, x)}
        seen = np.column_stack(turned[turn])
        straight = cv2.undistortPoints(seen[:, None], matrix, lens, R=rotation, P=projection, criteria=UNTIL)
        rows.append(straight[:, 0, 1])
    return np.asarray(rows)


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
        found, turn, place = cv2.solvePnP(points, places, self.matrix, self.distortion, flags=cv2.SOLVEPNP_IPPE)
        if found:
            turn, place = cv2.solvePnPRefineLM(points, places, self.matrix, self.distortion, turn, place)
        else:
            _, turn, place = cv2.solvePnP(points, places, self.matrix, self.distortion)
        return Pose(np.asarray(cv2.Rodrigues(turn)[0], dtype=np.float64), np.asarray(place, dtype=np.float64).ravel())

    def projected(self, points: DoubleMap, pose: Pose) -> DoubleMap:
        """Return where the camera sees the points of a board at this pose, (n, 2) px."""
        turn = cv2.Rodrigues(pose.rotation)[0]
        return np.asarray(cv2.projectPoints(points, turn, pose.translation, self.matrix, self.distortion)[0][:, 0])


def calibrated_camera(sights: Sequence[Sight], size: tuple[int, int], flags: int) -> tuple[Camera, float, set[int]]:
    """Return the camera that took these pictures of a board, and which of them do not show a flat board.

    Between the two stands the standard error of the focal length, as a share of it.

    Raises
    ------
    ValueError
        Corners that do not determine a camera, for which three pictures are the least.
    """
    camera, focal_error, errors = _fitted_camera(sights, size, flags)
    limit = max(LEAST_OUTLIER_PX, FARTHEST_OUTLIER * float(np.median(errors)))
    outliers = set(np.flatnonzero(errors > limit).tolist())
    if outliers and len(sights) - len(outliers) >= 3:
        kept = [sight for number, sight in enumerate(sights) if number not in outliers]
        camera, focal_error, _ = _fitted_camera(kept, size, flags)
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
                camera, _, _ = _fitted_camera(given, size, flags)
            except ValueError:
                return np.inf
            for points, places in sights[fold::folds]:
                errors.append(_rms(camera.projected(points, camera.pose(points, places)) - places))
    return float(np.median(errors))


def _rms(differences: DoubleMap) -> float:
    return float(np.sqrt(np.square(differences).sum(axis=1).mean()))


def _fitted_camera(sights: Sequence[Sight], size: tuple[int, int], flags: int) -> tuple[Camera, float, Vector]:
    """Return the camera, the error of its focal length as a share of it, and that of each picture, px RMS."""
    points = [sight.points.astype(np.float32) for sight in sights]
    places = [sight.places.astype(np.float32) for sight in sights]
    undetermined = ValueError(
        f"{len(sights)} pictures of the board do not determine the camera: show it at more places and tilted more."
    )
    try:
        _, matrix, distortion, _, _, deviations, _, errors = cv2.calibrateCameraExtended(
            points, places, size, np.eye(3), np.zeros(14), flags=flags
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


def agreeing_fit(seen: dict[int, SeenPair], left: Camera, right: Camera, size: tuple[int, int], flags: int) -> JointFit:
    """Return both cameras, each calibrated on its own before, fitted together to the pairs that agree.

    Raises
    ------
    ValueError
        No majority of pairs that agree on the pose of the right camera.
    """
    used, orders = _agreement(seen, left, right, size[0])
    _check_majority(used, seen)

    def fitted(used: Sequence[int], flags: int) -> JointFit:
        return _fit(seen, tuple(used), orders, left, right, size, flags)

    # The cameras were calibrated separately, which no contradiction between left and right can spoil: they stay fixed
    # until the agreeing pairs are known. The best of these are fitted first, or a fit would bend to one that does not.
    fixed = flags | cv2.CALIB_FIX_INTRINSIC
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
    return fitted(fit.used, flags)


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
