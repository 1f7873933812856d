"""The two computations of the page: finding the corners, and calibrating from the pairs that count."""

from __future__ import annotations

from dataclasses import dataclass

from stereolag.core.estimates import Estimate
from stereolag.geometry.boards import Board, BoardViews, find_boards
from stereolag.geometry.calibrating import StereoCalibration, calibrate_boards
from stereolag.ui.calibrate.pictures import BoardPictures
from stereolag.ui.results import computed_in_turn
from stereolag.ui.states import show_refused

MEMORY, PAIR_S = 64 * 2**20, 0.08
"""Cost of a calibration: memory, bytes, and time per pair, s."""


@dataclass(frozen=True, eq=False)
class Refused:
    """The reason why there is no calibration."""

    sentence: str


def found_boards(pictures: BoardPictures, board: Board) -> BoardViews | None:
    """Return the corners in all pictures; None during the search, or if it is refused, with the reason shown."""
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
    """Return the calibration; None while it is being computed, or if it is refused, with the reason shown."""

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
