"""The corners of one calibration board in many pairs of pictures."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from typing import TypeAlias

import numpy as np
import numpy.typing as npt

from stereolag.core.inputs import as_eight_bit, as_grey, as_image
from stereolag.core.progress import Progress, silent
from stereolag.geometry.boards import Board, Corners, Grey8
from stereolag.geometry.charuco import find_charuco, guess_charuco
from stereolag.geometry.chessboards import find_chessboard, guess_chessboard

Pairs: TypeAlias = Sequence[tuple[npt.ArrayLike, npt.ArrayLike]]
"""Left and right pictures; each is requested when needed, and not kept."""

GUESSED_FROM = 8
"""Number of pairs from which the board is guessed, spread over all."""

MOST_PAIRS = 100


@dataclass(frozen=True, eq=False)
class BoardViews:
    """Positions of a board's corners in pairs of pictures.

    Attributes
    ----------
    board
        The board.
    size
        Width and height of most pictures, px.
    left, right
        Corners in each pair; None where the board was not found.
    sizes
        Width and height of the pictures of each pair, left and right, px.
    """

    board: Board
    size: tuple[int, int]
    left: tuple[Corners | None, ...]
    right: tuple[Corners | None, ...]
    sizes: tuple[tuple[tuple[int, int], tuple[int, int]], ...]

    def __len__(self) -> int:
        return len(self.left)


def find_boards(
    pairs: Pairs | Iterable[tuple[npt.ArrayLike, npt.ArrayLike]],
    board: Board | tuple[int, int] | None = None,
    *,
    progress: Progress | None = None,
) -> BoardViews:
    """Find a chessboard or ChArUco board in pairs of pictures.

    Parameters
    ----------
    pairs
        Left and right, (rows, cols) grey or (rows, cols, 3 | 4) RGB(A) each; uint8, uint16 or float.
    board
        The board, or its columns and rows of inner corners; None: guessed from the pictures.
    progress
        Called with the fraction done.

    Returns
    -------
    BoardViews

    Raises
    ------
    ValueError
        No pairs or more than 100, a picture that is not an image, or a board of unknown size that no picture shows.
    """
    pairs = pairs if isinstance(pairs, Sequence) else list(pairs)
    if not 1 <= len(pairs) <= MOST_PAIRS:
        raise ValueError(f"pairs holds {len(pairs)}; allowed are 1 to {MOST_PAIRS} pairs of pictures.")
    report = progress or silent
    if not isinstance(board, Board):
        board = guess_board(pairs, board)
    left, right, sizes = [], [], []
    for number in range(len(pairs)):
        report(number / len(pairs))
        pictures = grey_pair(*pairs[number])
        first, second = (_corners(picture, board) for picture in pictures)
        left.append(first)
        right.append(second)
        sizes.append((_size(pictures[0]), _size(pictures[1])))
    report(1.0)
    size = Counter(size for both in sizes for size in both).most_common(1)[0][0]
    return BoardViews(board, size, tuple(left), tuple(right), tuple(sizes))


def guess_board(pairs: Pairs, size: tuple[int, int] | None = None) -> Board:
    """Return the board that the pictures show.

    Parameters
    ----------
    pairs
        As for :func:`find_boards`; only a few are examined.
    size
        Columns and rows of inner corners, if known: then only the kind of board is guessed.

    Raises
    ------
    ValueError
        A size out of bounds, or no board in the pictures.
    """
    if size is not None:
        size = Board(*size).columns, Board(*size).rows
    chosen = np.unique(np.linspace(0, len(pairs) - 1, min(len(pairs), GUESSED_FROM)).astype(int))
    pictures = [picture for picture in _pictures(pairs, chosen)]
    charuco = guess_charuco(pictures, size)
    if charuco is not None:
        return charuco
    if size is not None:
        return Board(*size)
    chessboard = guess_chessboard(pictures)
    if chessboard is None:
        raise ValueError(
            f"No chessboard or ChArUco board is seen in {len(pictures)} pictures; give board as (columns, rows) of "
            "inner corners, or pictures that show the whole board with a white border."
        )
    return chessboard


def grey_pair(left: npt.ArrayLike, right: npt.ArrayLike) -> tuple[Grey8, Grey8]:
    """Return both pictures as (rows, cols) uint8."""
    first, second = (as_grey(as_image(value, name)) for value, name in ((left, "left"), (right, "right")))
    return as_eight_bit(first, first)[0], as_eight_bit(second, second)[0]


def _pictures(pairs: Pairs, numbers: npt.NDArray[np.intp]) -> Iterator[Grey8]:
    for number in numbers:
        yield from grey_pair(*pairs[int(number)])


def _corners(picture: Grey8, board: Board) -> Corners | None:
    return find_chessboard(picture, board) if board.markers is None else find_charuco(picture, board)


def _size(picture: Grey8) -> tuple[int, int]:
    return picture.shape[1], picture.shape[0]
