"""Calibration of a stereo camera from pictures of a board: each camera, then both; with a report on each pair."""

from __future__ import annotations

import itertools
from collections.abc import Collection, Iterable, Sequence
from dataclasses import dataclass, replace
from enum import StrEnum

import cv2
import numpy as np
import numpy.typing as npt

from stereolag.core.arrays import DoubleMap
from stereolag.core.jobs import Progress
from stereolag.geometry.board_shapes import BothCorners, measured_shape, seems_bent, sights_of
from stereolag.geometry.boards import Board, BoardViews, Corners, Grey8, Pairs, find_boards
from stereolag.geometry.calibration import Calibration, StereoRig, check_positive
from stereolag.geometry.camera_fits import (
    ENOUGH_TO_LEAVE_OUT,
    FEWEST_PAIRS,
    JointFit,
    SeenPair,
    agreeing_fit,
    rig_of,
    separate_fits,
)
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
    points
        (n, 3) where the corners of the board are, in squares: off their grid if the pictures show that it is bent, or
        printed unevenly.
    unmeasured
        Whether the board seems to be bent or printed unevenly, and too few pictures show all of it to measure that.
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
        """Return how far the corner of the board that is farthest off its place is from it, metres."""
        return self.square_m * float(np.linalg.norm(self.points - self.board.points(), axis=1).max())

    @property
    def doubts(self) -> tuple[str, ...]:
        """Return what speaks against the calibration, in sentences that say how to mend it."""
        used, least = len(self.used), min(self.left_coverage, self.right_coverage)
        squares = self.points.reshape(self.board.rows, self.board.columns, 3)
        width, height = (np.linalg.norm(np.diff(squares, axis=axis), axis=2).mean() for axis in (1, 0))
        judged = (
            (used < ENOUGH_PAIRS, f"{used} pairs count: use {ENOUGH_PAIRS} to 40 for a reliable result."),
            (
                least < ENOUGH_COVERAGE,
                f"The board has covered {100 * least:.0f} % of the picture: hold it in the corners too, where the lens "
                "distorts most.",
            ),
            (
                self.focal_error > SURE_FOCAL,
                f"The focal length is uncertain by {100 * self.focal_error:.1f} %: tilt the board more, to all sides.",
            ),
            (
                self.row_error > GOOD_ROWS_PX,
                f"Rows are {self.row_error:.2f} px apart on average, enough to disturb matching: are the pictures "
                "sharp, and both taken at the same moment?",
            ),
            (
                self.rms > GOOD_RMS_PX,
                f"Corners are {self.rms:.2f} px off their places: is the board stiff, and were all pictures taken with "
                "one focus and zoom, while it was still?",
            ),
            (
                self.unmeasured,
                "The board seems to be bent, or printed unevenly: glue it to something flat, or show all of it to each "
                f"camera in {ENOUGH_TO_LEAVE_OUT} pictures or more, and its shape is measured.",
            ),
            (
                abs(height / width - 1) > SQUARE_ENOUGH,
                f"The squares are {100 * abs(height / width - 1):.1f} % {'higher' if height > width else 'lower'} than "
                "they are wide, so no length is surer than that: measure a square both ways, and give the mean.",
            ),
        )
        return tuple(said for is_doubtful, said in judged if is_doubtful)

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

ENOUGH_PAIRS = 8

ENOUGH_COVERAGE = 0.5
"""Share of each picture that boards should have covered, for its lens to be known everywhere. A board that has been in
all nine parts of the pictures is enough: its own border keeps its corners away from those of the pictures."""

SURE_FOCAL, GOOD_ROWS_PX, GOOD_RMS_PX, SQUARE_ENOUGH = 0.01, 0.5, 1.0, 0.005
"""A calibration with a larger focal, row or reprojection error, or squares that are less square, is doubtful."""

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
        ``notes`` say what speaks against it.

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
    usable, points = _usable(reasons, views), views.board.points()
    both: BothCorners = {number: views.both[number] for number in usable}
    fits = separate_fits(sights_of(both, views.board), views.size)
    bent = seems_bent(views.board, both, fits)
    measured = measured_shape(views.board, both, views.size, fits, bent=bent)
    if measured is not None:
        points, both = measured
        fits = separate_fits(sights_of(both, views.board), views.size)
    for place in set.union(*fits.outliers):
        reasons[usable[place]] = LeftOut.NOT_FLAT
    seen = {number: _seen_pair(*both[number], views.board) for number in _usable(reasons, views)}
    fit = agreeing_fit(seen, fits, views.size)
    for number in set(seen) - set(fit.used):
        reasons[number] = LeftOut.CONTRADICTS
    result = _report(views, square_m, seen, fit, reasons, fits.focal_error, points)
    result = replace(result, unmeasured=bent and measured is None)
    return replace(result, calibration=replace(result.calibration, notes=result.doubts))


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
    points: DoubleMap,
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
            given = _seen_pair(*views.both[number], views.board)
            places = given.right[order]
            turned = order > 0 and reason is None
            right = Corners(views.both[number][1].numbers, places) if turned else right
            rows = _rows(rig, views.size, given.left, places)
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
        points,
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
