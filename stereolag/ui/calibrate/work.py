"""The two computations of the page: where the corners are, and the calibration from those that count."""

from __future__ import annotations

from dataclasses import dataclass

from stereolag.estimates import Estimate
from stereolag.geometry.board_views import BoardViews, find_boards
from stereolag.geometry.boards import Board
from stereolag.geometry.calibrating import calibrate_boards
from stereolag.geometry.calibration_report import StereoCalibration
from stereolag.ui.calibrate.pictures import BoardPictures
from stereolag.ui.results import computed_in_turn
from stereolag.ui.states import show_refused

MEMORY, PAIR_S = 64 * 2**20, 0.08
"""Of a calibration: bytes, and seconds for each pair."""


@dataclass(frozen=True, eq=False)
class Refused:
    """Why there is no calibration."""

    sentence: str


def found_boards(pictures: BoardPictures, board: Board) -> BoardViews | None:
    """Return the corners in all pictures; None while they are looked for, or why they cannot be is said."""
    try:
        return computed_in_turn(
            "corners",
            lambda progress: find_boards(pictures.pairs, board, progress=progress),
            pictures.estimate(len(pictures.names)),
            inputs=pictures.digest,
            settings=repr(board),
            shared=pictures.shared,
            label="Looking for corners …",
        )
    except ValueError as error:
        show_refused(error)
        return None


def calibrated(
    pictures: BoardPictures, views: BoardViews, square_m: float, leave_out: frozenset[int]
) -> StereoCalibration | None:
    """Return the calibration from the pairs that count; None while it is computed, or where there is none, and why."""

    def calibrate(_: object) -> StereoCalibration | Refused:
        try:
            return calibrate_boards(views, square_m, leave_out=leave_out)
        except ValueError as error:
            return Refused(str(error))

    result = computed_in_turn(
        "calibration",
        calibrate,
        Estimate(MEMORY, PAIR_S * len(views)),
        inputs=pictures.digest,
        settings=f"{views.board!r} {square_m} {sorted(leave_out)}",
        shared=pictures.shared,
        label="Calibrating …",
    )
    if isinstance(result, Refused):
        show_refused(result.sentence)
        return None
    return result
