"""The corners of a chessboard in a picture, to a few hundredths of a pixel, and the number of them on the board."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Sequence

import cv2
import numpy as np
import numpy.typing as npt

from stereolag.core.arrays import DoubleMap
from stereolag.geometry.boards import Board, Corners, Grey8

LARGEST_SIDE = 1200
"""Largest side of the picture first searched for corners, px: larger ones are reduced, then refined at full size."""

WINDOW_SHARE = 0.3
"""Half the window for refining a corner, as a share of the distance to the next: beyond, others interfere."""

LEAST_WINDOW, LARGEST_WINDOW = 2, 20
"""Limits of that half, px: within a larger window a distorted lens bends the edges."""

FARTHEST_MOVE = 0.5
"""Largest move of a corner by refining, as a share of the distance to the next one."""

ENOUGH_VOTES = 5
"""Number of pictures with the same size of the board that settles it."""

SMALLEST_GUESS = (3, 3)

_QUICK = cv2.CALIB_CB_NORMALIZE_IMAGE
_THOROUGH = cv2.CALIB_CB_NORMALIZE_IMAGE | cv2.CALIB_CB_ACCURACY
_QUADS = cv2.CALIB_CB_ADAPTIVE_THRESH | cv2.CALIB_CB_NORMALIZE_IMAGE | cv2.CALIB_CB_FAST_CHECK


def find_chessboard(grey: Grey8, board: Board) -> Corners | None:
    """Return all corners of a chessboard in a picture, None if it is not seen as a whole.

    Corners are found by OpenCV's detectors in a picture of moderate size (Duda and Frese, BMVC 2018, and the older one
    by the squares' outlines), then refined in the full picture by ``cv2.cornerSubPix``, each in a window that fits
    between its neighbours: on drawn boards that is two to three times as accurate as the detectors.

    Parameters
    ----------
    grey
        (rows, cols) uint8.
    board
        The board, for its number of corners.
    """
    picture, factor = reduced(grey, LARGEST_SIDE)
    found = _detected(picture, (board.columns, board.rows))
    if found is None:
        return None
    points = refined(grey, (found + 0.5) / factor - 0.5, board)
    return None if points is None else Corners(np.arange(board.corners), points)


def reduced(grey: Grey8, largest: int) -> tuple[Grey8, float]:
    """Return a picture of at most `largest` px a side, and its size as a share of the original."""
    factor = min(1.0, largest / max(grey.shape))
    if factor == 1:
        return grey, factor
    size = round(grey.shape[1] * factor), round(grey.shape[0] * factor)
    return np.asarray(cv2.resize(grey, size, interpolation=cv2.INTER_AREA), dtype=np.uint8), size[0] / grey.shape[1]


def refined(grey: Grey8, points: DoubleMap, board: Board) -> DoubleMap | None:
    """Return the corners of a whole board refined in a picture; None if they move too far.

    Parameters
    ----------
    grey
        (rows, cols) uint8.
    points
        (n, 2) px, row by row of the board.
    board
        The board, for its number of corners.
    """
    spacing = _spacing(points.reshape(board.rows, board.columns, 2)).ravel()
    moved = refined_in_windows(grey, points, WINDOW_SHARE * spacing)
    if (np.linalg.norm(moved - points, axis=1) > FARTHEST_MOVE * spacing).any():
        return None
    return moved


def refined_in_windows(grey: Grey8, points: DoubleMap, halves: npt.NDArray[np.float64]) -> DoubleMap:
    """Return (n, 2) corners, each refined in a window of its own with half sides `halves`, px."""
    windows = np.clip(halves, LEAST_WINDOW, LARGEST_WINDOW).astype(int)
    criteria = (cv2.TERM_CRITERIA_COUNT | cv2.TERM_CRITERIA_EPS, 100, 1e-4)
    result = points.astype(np.float64)
    for half in np.unique(windows):
        here = windows == half
        some = np.array(points[here].reshape(-1, 1, 2), dtype=np.float32, order="C")
        result[here] = cv2.cornerSubPix(grey, some, (int(half), int(half)), (-1, -1), criteria).reshape(-1, 2)
    return result


def guess_chessboard(pictures: Iterable[Grey8]) -> Board | None:
    """Return the chessboard that most of the pictures show; None if none shows one.

    In each, the largest full grid is detected. A grid with a row too many, formed by something beside the board, or
    too few, where the board is cut off, occurs by chance, but the right one again and again.

    Parameters
    ----------
    pictures
        (rows, cols) uint8 each; no more are read than needed.
    """
    votes: Counter[tuple[int, int]] = Counter()
    seen: list[Grey8] = []
    for grey in pictures:
        picture, _ = reduced(grey, LARGEST_SIDE)
        seen.append(picture)
        votes.update(_grid(picture, _QUICK))
        if votes and max(votes.values()) >= ENOUGH_VOTES:
            break
    if not votes:
        for picture in seen:
            votes.update(_grid(picture, _THOROUGH))
    if not votes:
        return None
    size = max(votes, key=lambda one: (votes[one], one[0] * one[1]))
    return Board(*size)


def _grid(picture: Grey8, flags: int) -> Sequence[tuple[int, int]]:
    """Return the size of the largest grid in a picture, the longer side first; empty if there is none."""
    found, _, grid = cv2.findChessboardCornersSBWithMeta(picture, SMALLEST_GUESS, flags | cv2.CALIB_CB_LARGER)
    if not found or min(grid.shape) < min(SMALLEST_GUESS):
        return ()
    return ((max(grid.shape), min(grid.shape)),)


def _detected(picture: Grey8, size: tuple[int, int]) -> DoubleMap | None:
    """Return (n, 2) corners from the first detector that finds them, the quick ones tried first."""
    found, points = cv2.findChessboardCornersSB(picture, size, flags=_QUICK)
    if not found:
        found, points = cv2.findChessboardCorners(picture, size, flags=_QUADS)
    if not found:
        found, points = cv2.findChessboardCornersSB(picture, size, flags=_THOROUGH)
    return np.asarray(points, dtype=np.float64).reshape(-1, 2) if found else None


def _spacing(grid: npt.NDArray[np.float64]) -> DoubleMap:
    """Return the distance of each of (rows, columns, 2) corners to the nearest of its neighbours, px."""
    nearest = np.full(grid.shape[:2], np.inf)
    for axis in (0, 1):
        steps = np.linalg.norm(np.diff(grid, axis=axis), axis=2)
        before, after = (slice(1, None), slice(None, -1)) if axis == 0 else (np.s_[:, 1:], np.s_[:, :-1])
        nearest[before] = np.minimum(nearest[before], steps)
        nearest[after] = np.minimum(nearest[after], steps)
    return nearest
