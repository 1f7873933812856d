"""Calibration boards: a chessboard, or one with markers in its white squares (ChArUco), and their corners."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import cv2
import numpy as np
import numpy.typing as npt

from stereolag.core.arrays import DoubleMap, Rgb

Grey8 = npt.NDArray[np.uint8]
"""(rows, cols) uint8."""

FEWEST_CORNERS, MOST_CORNERS = 2, 50
"""Allowed number of inner corners in a row or a column of a board."""

MARGIN_SQUARES = 1
"""White border around a drawn board; without it the outermost squares are not found."""


@dataclass(frozen=True)
class Markers:
    """The markers in the white squares of a ChArUco board.

    Attributes
    ----------
    dictionary
        Name of OpenCV's predefined dictionary, ``"DICT_5X5_1000"``; a smaller one of the same kind is its first part.
    share
        Side of a marker as a share of the side of a square.
    legacy
        Whether the first square is white if the number of rows is even, as drawn by OpenCV before 4.6.
    """

    dictionary: str
    share: float = 0.75
    legacy: bool = False


@dataclass(frozen=True)
class Board:
    """A calibration board.

    Attributes
    ----------
    columns, rows
        Number of inner corners, where four squares meet, in a row and in a column: one fewer than squares.
    markers
        Markers of a ChArUco board; None for a plain chessboard.

    Raises
    ------
    ValueError
        A number of corners outside 2 to 50.
    """

    columns: int
    rows: int
    markers: Markers | None = None

    def __post_init__(self) -> None:
        for name in ("columns", "rows"):
            count = getattr(self, name)
            if not FEWEST_CORNERS <= count <= MOST_CORNERS:
                raise ValueError(
                    f"{name} of the board is {count}; allowed are {FEWEST_CORNERS} to {MOST_CORNERS} inner corners."
                )

    @property
    def corners(self) -> int:
        """Return the number of inner corners."""
        return self.columns * self.rows

    def points(self) -> DoubleMap:
        """Return the positions of the corners, (n, 3), row by row, in squares: column, row, 0."""
        rows, cols = np.divmod(np.arange(self.corners), self.columns)
        return np.stack([cols, rows, np.zeros(self.corners)], axis=1).astype(np.float64)

    def orders(self) -> tuple[npt.NDArray[np.intp], ...]:
        """Return the orders in which a detector may list the corners of the same board, the plain one first.

        A chessboard looks the same upside down, and a square one when rotated by a right angle; markers settle it.
        """
        plain = np.arange(self.corners).reshape(self.rows, self.columns)
        if self.markers is not None:
            return (plain.ravel(),)
        turns = (0, 2, 1, 3) if self.rows == self.columns else (0, 2)
        return tuple(np.rot90(plain, turn).ravel() for turn in turns)


@dataclass(frozen=True, eq=False)
class Corners:
    """The corners of a board found in one picture.

    Attributes
    ----------
    numbers
        (n,) numbers of the corners on the board, ascending.
    points
        (n, 2) positions, px: column, row of pixel centres.
    """

    numbers: npt.NDArray[np.intp]
    points: DoubleMap

    def __len__(self) -> int:
        return len(self.numbers)

    def of(self, numbers: npt.NDArray[np.intp]) -> DoubleMap:
        """Return the positions of these corners, all of which must have been found."""
        return np.asarray(self.points[np.searchsorted(self.numbers, numbers)])


def first_markers(dictionary: str, count: int) -> Any:
    """Return the first markers of one of OpenCV's dictionaries: searching for all of a large one takes far longer."""
    whole = cv2.aruco.getPredefinedDictionary(getattr(cv2.aruco, dictionary))
    return cv2.aruco.Dictionary(whole.bytesList[:count], whole.markerSize, whole.maxCorrectionBits)


def charuco_board(board: Board) -> Any:
    """Return OpenCV's own description of a ChArUco board with squares of side 1."""
    assert board.markers is not None
    size = (board.columns + 1, board.rows + 1)
    dictionary = first_markers(board.markers.dictionary, (size[0] * size[1] + 1) // 2)
    charuco = cv2.aruco.CharucoBoard(size, 1.0, board.markers.share, dictionary)
    charuco.setLegacyPattern(board.markers.legacy)
    return charuco


def board_picture(board: Board, square_px: int) -> Rgb | Grey8:
    """Return the board as printed, (rows, cols) uint8, with a white margin of one square around it.

    Parameters
    ----------
    board
        The board.
    square_px
        Side of a square, px. The first inner corner is between the pixels at ``2 * square_px``.
    """
    squares = board.columns + 1, board.rows + 1
    margin = MARGIN_SQUARES * square_px
    if board.markers is None:
        rows, cols = np.indices((squares[1], squares[0]))
        pattern = np.where((rows + cols) % 2, 255, 0).astype(np.uint8)
        picture = np.kron(pattern, np.ones((square_px, square_px), np.uint8))
    else:
        size = squares[0] * square_px, squares[1] * square_px
        # OpenCV draws markers of whole pixels only; others extend over the edge of its picture.
        whole = replace(board.markers, share=round(board.markers.share * square_px) / square_px)
        drawn = charuco_board(replace(board, markers=whole)).generateImage(size, marginSize=0)
        picture = np.asarray(drawn, dtype=np.uint8)
    return np.pad(picture, margin, constant_values=255)
