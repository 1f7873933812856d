"""Calibration of a stereo camera from pictures of a board: each camera, then both; with a report on each pair."""

from __future__ import annotations

import itertools
from collections.abc import Collection, Iterable, Sequence
from dataclasses import dataclass, replace
from enum import StrEnum

import cv2
import numpy as np
import numpy.typing as npt

from stereolag.core.arrays import DoubleMap, EightBit
from stereolag.core.inputs import check_positive
from stereolag.core.jobs import Progress, silent
from stereolag.geometry.board_shapes import BothCorners, measured_shape, observations_of, seems_bent
from stereolag.geometry.boards import Board, BoardViews, Corners, Pairs, find_boards
from stereolag.geometry.calibration import Calibration, StereoRig
from stereolag.geometry.camera_fits import (
    MIN_PAIRS,
    MIN_PICTURES_TO_VALIDATE,
    JointFit,
    ObservedPair,
    agreeing_fit,
    rig_of,
    separate_fits,
)
from stereolag.geometry.rectification import rectification_for, rectified_calibration

UNDISTORTION_CRITERIA = (cv2.TERM_CRITERIA_COUNT | cv2.TERM_CRITERIA_EPS, 50, 1e-9)
"""Criteria to stop inverting the distortion; after OpenCV's five rounds a wide lens is off by a fifth of a px."""

COVERAGE_CELLS = 100
"""Number of cells, across and down, in which the coverage of a picture by boards is counted."""


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
        Why the pair is left out; None if it is used.
    turned
        Whether the corners in the right picture had been counted from another end of the board, and were reordered.
    left_rms, right_rms
        Reprojection error of the corners, px RMS; NaN if unknown.
    row_error
        Mean row difference of matching corners after rectification, px; NaN if unknown.
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
        Reprojection error of the corners, px RMS over both cameras and all used pairs, as returned by
        ``cv2.stereoCalibrate``.
    row_error
        Mean row difference of matching corners after rectification, px, over these pairs.
    left_coverage, right_coverage
        Share of each picture that a board has covered, 0..1.
    focal_error
        Relative standard error of the focal lengths; the larger one of the two cameras.
    points
        (n, 3) positions of the board's corners, in squares: off their grid if the pictures show that it is bent, or
        printed unevenly.
    unmeasured
        Whether the board seems to be bent or printed unevenly, but too few pictures show all of it to measure that.
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
    points: DoubleMap
    unmeasured: bool = False

    @property
    def off_grid_m(self) -> float:
        """Return the largest distance of a corner of the board from its position on the grid, metres."""
        return self.square_m * float(np.linalg.norm(self.points - self.board.points(), axis=1).max())

    @property
    def doubts(self) -> tuple[str, ...]:
        """Return the problems of the calibration as sentences, with their remedies."""
        used, coverage = len(self.used), min(self.left_coverage, self.right_coverage)
        squares = self.points.reshape(self.board.rows, self.board.columns, 3)
        width, height = (np.linalg.norm(np.diff(squares, axis=axis), axis=2).mean() for axis in (1, 0))
        checks = (
            (used < ENOUGH_PAIRS, f"{used} pairs are used: take {ENOUGH_PAIRS} to 40 for a reliable result."),
            (
                coverage < ENOUGH_COVERAGE,
                f"The board has covered {100 * coverage:.0f} % of the picture: hold it in the corners too, where the "
                "lens distorts most.",
            ),
            (
                self.focal_error > DOUBTFUL_FOCAL_ERROR,
                f"The focal length is uncertain by {100 * self.focal_error:.1f} %: tilt the board more, to all sides.",
            ),
            (
                self.row_error > DOUBTFUL_ROW_ERROR_PX,
                f"Rows are {self.row_error:.2f} px apart on average, enough to disturb matching: are the pictures "
                "sharp, and both taken at the same moment?",
            ),
            (
                self.rms > DOUBTFUL_RMS_PX,
                f"Corners are {self.rms:.2f} px off their places: is the board stiff, and were all pictures taken with "
                "one focus and zoom, while it was still?",
            ),
            (
                self.unmeasured,
                "The board seems to be bent, or printed unevenly: glue it to something flat, or show all of it to each "
                f"camera in {MIN_PICTURES_TO_VALIDATE} pictures or more, and its shape is measured.",
            ),
            (
                abs(height / width - 1) > DOUBTFUL_SQUARE_ERROR,
                f"The squares are {100 * abs(height / width - 1):.1f} % {'higher' if height > width else 'lower'} than "
                "they are wide, so no length is surer than that: measure a square both ways, and give the mean.",
            ),
        )
        return tuple(sentence for is_doubtful, sentence in checks if is_doubtful)

    @property
    def used(self) -> tuple[int, ...]:
        """Return the numbers of the pairs that are used."""
        return tuple(number for number, pair in enumerate(self.pairs) if pair.left_out is None)


def covered_cells(corners: Sequence[Corners], size: tuple[int, int]) -> EightBit:
    """Return a grid of cells over a picture: 1 where the board was in at least one of the pictures, 0 elsewhere."""
    cells = np.zeros((COVERAGE_CELLS, COVERAGE_CELLS), np.uint8)
    for one in corners:
        in_cells = np.floor(one.points * COVERAGE_CELLS / size).astype(np.int32)
        cv2.fillConvexPoly(cells, cv2.convexHull(in_cells), 1)
    return cells


MIN_COMMON_CORNERS = 6
"""Minimum number of corners of a ChArUco board that both pictures of a pair must show."""

MAX_SAME_VIEW_PX = 0.02
"""Corners that differ by less than this on average, px, come from the same picture."""

MAX_FOCAL_ERROR = 0.1
"""Maximum relative standard error of a focal length; above it the calibration is refused."""

ENOUGH_PAIRS = 8
"""Number of used pairs below which a calibration is doubtful."""

ENOUGH_COVERAGE = 0.5
"""Share of each picture that boards should have covered, for its lens to be known everywhere. A board that has been in
all nine parts of the pictures is enough: its own border keeps its corners away from those of the pictures."""

DOUBTFUL_FOCAL_ERROR = 0.01
"""Relative standard error of a focal length above which a calibration is doubtful."""

DOUBTFUL_ROW_ERROR_PX = 0.5
"""Mean row difference above which a calibration is doubtful, px."""

DOUBTFUL_RMS_PX = 1.0
"""Reprojection error above which a calibration is doubtful, px."""

DOUBTFUL_SQUARE_ERROR = 0.005
"""Relative difference of the height and width of squares above which a calibration is doubtful."""


def calibrate(
    pairs: Pairs | Iterable[tuple[npt.ArrayLike, npt.ArrayLike]],
    board: Board | tuple[int, int] | None = None,
    square_m: float = 1.0,
    *,
    progress: Progress | None = None,
) -> Calibration:
    """Calibrate a stereo camera from pairs of pictures of a chessboard or ChArUco board.

    Each camera is calibrated on its own, then both together with their pose (Zhang, PAMI 2000; Bouguet's stereo
    calibration, by OpenCV). A board that is bent or unevenly printed is measured along with the cameras, if six
    pictures of each show all of it (:mod:`stereolag.geometry.board_shapes`). Pairs that contradict the others, because
    they were not taken at the same moment or show the board turned round in one picture, are left out:
    :func:`calibrate_boards` reports which.

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
        Calibration with its ``rig``, for :func:`stereolag.rectify`, and ``rms``, the reprojection error in px. Its
        ``notes`` name its problems.

    Raises
    ------
    ValueError
        Fewer than 3 pairs in which both pictures show the board, pairs that contradict each other, boards held too much
        alike, left and right exchanged or not the same way up, cameras diagonal to each other, or anything
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
    report = progress or silent
    # Most of the time goes into finding the corners.
    views = find_boards(pairs, board, progress=lambda fraction: report(0.95 * fraction))
    result = calibrate_boards(views, square_m)
    report(1.0)
    return result.calibration


def calibrate_boards(views: BoardViews, square_m: float = 1.0, *, leave_out: Collection[int] = ()) -> StereoCalibration:
    """Calibrate a stereo camera from the corners of a board, and report on each pair; errors as for :func:`calibrate`.

    `leave_out` are the numbers of pairs to leave out.
    """
    check_positive(square_m, "square_m")
    reasons = _exclusion_reasons(views, leave_out)
    usable, points = _usable_pairs(reasons, views), views.board.points()
    both: BothCorners = {number: views.both[number] for number in usable}
    fits = separate_fits(observations_of(both, views.board), views.size)
    bent = seems_bent(views.board, both, fits)
    measured = measured_shape(views.board, both, views.size, fits, bent=bent)
    if measured is not None:
        points, both = measured
        fits = separate_fits(observations_of(both, views.board), views.size)
    for index in set.union(*fits.outliers):
        reasons[usable[index]] = LeftOut.NOT_FLAT
    pairs = {number: _observed_pair(*both[number], views.board) for number in _usable_pairs(reasons, views)}
    fit = agreeing_fit(pairs, fits, views.size)
    for number in set(pairs) - set(fit.used):
        reasons[number] = LeftOut.CONTRADICTS
    result = _report(views, square_m, pairs, fit, reasons, fits.focal_error, points)
    result = replace(result, unmeasured=bent and measured is None)
    return replace(result, calibration=replace(result.calibration, notes=result.doubts))


def _exclusion_reasons(views: BoardViews, leave_out: Collection[int]) -> list[LeftOut | None]:
    """Return the reason for leaving out each pair; None for the pairs that can be used."""
    reasons: list[LeftOut | None] = []
    kept: list[tuple[Corners, Corners]] = []
    for number, (left, right) in enumerate(zip(views.left, views.right, strict=True)):
        reason = LeftOut.BY_HAND if number in leave_out else None
        if set(views.sizes[number]) != {views.size}:
            reason = LeftOut.OTHER_SIZE
        elif left is None or right is None:
            reason = {
                (True, True): LeftOut.NOT_FOUND,
                (True, False): LeftOut.NOT_FOUND_LEFT,
                (False, True): LeftOut.NOT_FOUND_RIGHT,
            }[left is None, right is None]
        elif not _share_enough(left, right, views.board):
            reason = LeftOut.FEW_IN_COMMON
        elif any(_same_view(left, kept_left) and _same_view(right, kept_right) for kept_left, kept_right in kept):
            reason = LeftOut.SAME_VIEW
        else:
            kept.append((left, right))
        reasons.append(reason)
    return reasons


def _share_enough(left: Corners, right: Corners, board: Board) -> bool:
    """Return whether enough corners are in both pictures, not all of them in one row or column."""
    common = np.intersect1d(left.numbers, right.numbers)
    return len(common) >= MIN_COMMON_CORNERS and not board.in_a_row(common)


def _same_view(corners: Corners, others: Corners) -> bool:
    same = np.array_equal(corners.numbers, others.numbers)
    return same and float(np.abs(corners.points - others.points).mean()) < MAX_SAME_VIEW_PX


def _usable_pairs(reasons: Sequence[LeftOut | None], views: BoardViews) -> list[int]:
    """Return the numbers of the pairs that can be used; ValueError if there are too few."""
    usable = [number for number, reason in enumerate(reasons) if reason is None]
    if len(usable) < MIN_PAIRS:
        if LeftOut.OTHER_SIZE in reasons:
            sizes = " and ".join(f"{width} × {height}" for width, height in sorted({*itertools.chain(*views.sizes)}))
            raise ValueError(
                f"The pictures are of {sizes} pixels: {len(usable)} of {len(views)} pairs have the most common size, "
                f"and at least {MIN_PAIRS} are needed. Give left and right pictures of one size, as they were taken."
            )
        board = f"A board of {views.board.columns} × {views.board.rows} inner corners"
        enough = len(views.both) >= MIN_PAIRS and LeftOut.BY_HAND in reasons
        raise ValueError(
            f"{len(usable)} of {len(views)} pairs can be used, and at least {MIN_PAIRS} are needed, 8 or more for a "
            f"good calibration. {board} was found in both pictures of {len(views.both)}: "
            + ("use some of those left out." if enough else "is that its size?")
        )
    return usable


def _observed_pair(left: Corners, right: Corners, board: Board) -> ObservedPair:
    common = np.intersect1d(left.numbers, right.numbers)
    right_points = right.of(common)
    orders = board.orders(len(common))
    return ObservedPair(board.points()[common], left.of(common), tuple(right_points[order] for order in orders))


def _report(
    views: BoardViews,
    square_m: float,
    observed: dict[int, ObservedPair],
    fit: JointFit,
    reasons: Sequence[LeftOut | None],
    focal_error: float,
    points: DoubleMap,
) -> StereoCalibration:
    """Return the calibration in metres, with the outcome for each pair."""
    if focal_error > MAX_FOCAL_ERROR:
        raise ValueError(
            f"The focal length is uncertain by {100 * focal_error:.0f} %; at most {100 * MAX_FOCAL_ERROR:.0f} % is "
            f"allowed. The board was held too similarly in {len(fit.used)} pairs: tilt it by 30° or more, up and down "
            "and to both sides, and show it in every part of the picture."
        )
    rig = rig_of(fit, views.size, square_m)
    pairs = []
    for number, reason in enumerate(reasons):
        left, right, turned, row_error = views.left[number], views.right[number], False, np.nan
        if number in observed:
            order = fit.orders[number]
            # From the corners as found: `observed` has those of a bent board moved to where a flat one has them.
            found = _observed_pair(*views.both[number], views.board)
            turned = order > 0 and reason is None
            right = Corners(views.both[number][1].numbers, found.right[order]) if turned else right
            rows = _rectified_rows(rig, views.size, found.left, found.right[order])
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
                weights=[len(observed[number].points) for number in fit.used],
            )
        ),
        covered[0],
        covered[1],
        focal_error,
        points,
    )


def _rectified_rows(rig: StereoRig, size: tuple[int, int], left: DoubleMap, right: DoubleMap) -> DoubleMap:
    """Return the rows of matching corners after rectification, px, (2, n)."""
    (width, height), turn = size, rig.turn
    if turn:
        rig, size = rig.turned(turn, size), (height, width)
    rectification = rectification_for(rig, size)
    cameras = (
        (left, rig.left_matrix, rig.left_distortion, rectification.left_rotation, rectification.left_projection),
        (right, rig.right_matrix, rig.right_distortion, rectification.right_rotation, rectification.right_projection),
    )
    rows = []
    for points, matrix, lens, rotation, projection in cameras:
        x, y = points.T
        turned = {0: (x, y), 1: (y, width - 1 - x), -1: (height - 1 - y, x)}
        points = np.column_stack(turned[turn])[:, None]
        rectified = cv2.undistortPoints(points, matrix, lens, R=rotation, P=projection, criteria=UNDISTORTION_CRITERIA)
        rows.append(rectified[:, 0, 1])
    return np.asarray(rows)
