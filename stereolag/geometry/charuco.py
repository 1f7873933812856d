"""ChArUco boards, chessboards with markers in their white squares: finding their corners and guessing the board."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Any

import cv2
import numpy as np
import numpy.typing as npt

from stereolag.core.arrays import DoubleMap
from stereolag.geometry.boards import MOST_CORNERS, Board, Corners, Grey8, Markers, charuco_board, first_markers
from stereolag.geometry.chessboards import reduced, refined_in_windows

LARGEST_SIDE = 2400
"""Largest side of the picture searched for markers, px."""

FEWEST_FOUND = 6
"""Fewest corners for a part of a board to count."""

DICTIONARIES = (
    "DICT_4X4_1000",
    "DICT_5X5_1000",
    "DICT_6X6_1000",
    "DICT_7X7_1000",
    "DICT_ARUCO_ORIGINAL",
    "DICT_APRILTAG_36h11",
    "DICT_APRILTAG_25h9",
    "DICT_APRILTAG_16h5",
)
"""The largest dictionary of each kind: the smaller ones are its first part."""

FIRST_LOOK = 60
MOST_MARKERS = 250
"""Number of a dictionary's markers searched for: to identify the dictionary, and then to locate each marker."""

FIRST_PICTURES = 4

ENOUGH_MARKERS = 8
"""Average number in each of these pictures at which no other dictionary is tried."""

GUESSED_SIDE = 1200
"""Largest side of the pictures from which the board is guessed, px."""

MOST_FITTED = 3
"""Number of pictures, those with the most markers, used to count the squares of the board."""

MOST_DRAWS = 60
"""Random draws of four markers: on the right board nearly any four will do, and on a wrong one none."""

FEWEST_MARKERS = 4
"""Fewest markers in one picture for it to show a ChArUco board."""

AGREEMENT = 0.7
"""Least share of the markers that must be where the board has them."""


@dataclass(frozen=True, eq=False)
class SeenMarkers:
    """The markers of one dictionary in a picture: (n,) numbers and (n, 4, 2) corners, px."""

    numbers: npt.NDArray[np.intp]
    corners: DoubleMap

    @property
    def centres(self) -> DoubleMap:
        """Return (n, 2), px."""
        return np.asarray(self.corners.mean(axis=1))


def find_charuco(grey: Grey8, board: Board) -> Corners | None:
    """Return the corners of a ChArUco board in a picture, None if it shows fewer than six or a single row.

    Parameters
    ----------
    grey
        (rows, cols) uint8.
    board
        The board, with its markers.
    """
    assert board.markers is not None
    picture, factor = reduced(grey, LARGEST_SIDE)
    points, numbers, _, _ = _detector(board).detectBoard(picture)
    if numbers is None or len(numbers) < FEWEST_FOUND:
        return None
    order = np.argsort(numbers.ravel())
    found = numbers.ravel()[order].astype(np.intp)
    rows, cols = np.divmod(found, board.columns)
    if np.ptp(rows) == 0 or np.ptp(cols) == 0:
        return None
    places = (points.reshape(-1, 2)[order].astype(np.float64) + 0.5) / factor - 0.5
    if factor < 1:
        # The markers are this far from the corners; a window must not reach them.
        gap = (1 - board.markers.share) / 2 * _square_px(board, found, places)
        places = refined_in_windows(grey, places, np.full(len(places), gap))
    return Corners(found, places)


def guess_charuco(pictures: Iterable[Grey8], size: tuple[int, int] | None = None) -> Board | None:
    """Return the ChArUco board that the pictures show; None if they show none.

    Parameters
    ----------
    pictures
        (rows, cols) uint8 each.
    size
        Columns and rows of inner corners, in either order, if known.
    """
    small = [reduced(grey, GUESSED_SIDE)[0] for grey in pictures]
    dictionary = _likeliest(small[:FIRST_PICTURES])
    if dictionary is None:
        return None
    seen = [markers for markers in _seen(dictionary, small, MOST_MARKERS) if len(markers.numbers) >= FEWEST_MARKERS]
    seen = sorted(seen, key=lambda markers: -len(markers.numbers))[:MOST_FITTED]
    highest = max(int(markers.numbers.max()) for markers in seen)
    widths = range(3, min(MOST_CORNERS + 1, 2 * highest + 3) + 1) if size is None else {side + 1 for side in size}
    fits = {(width, shift): _agreeing(seen, width, shift) for width in widths for shift in (1, 0)}
    (width, shift), agreeing = max(fits.items(), key=lambda fit: sum(inside.sum() for inside in fit[1]))
    total = sum(len(markers.numbers) for markers in seen)
    if sum(inside.sum() for inside in agreeing) < AGREEMENT * total:
        return None
    if size is not None:
        height = size[0] + size[1] + 2 - width
    else:
        last = max(int(one.numbers[inside].max()) for one, inside in zip(seen, agreeing, strict=True) if inside.any())
        height = int(_square_of(np.array([last]), width, shift)[0, 1]) + 1
        # A legacy board that starts with a white square has an even number of rows.
        height = max(3, height + (height % 2 if shift == 0 else 0))
    share = _marker_share(seen, agreeing, width, shift)
    return Board(width - 1, height - 1, Markers(dictionary, share, legacy=shift == 0))


def _detector(board: Board) -> Any:
    parameters = cv2.aruco.CharucoParameters()
    parameters.tryRefineMarkers = True
    markers = cv2.aruco.DetectorParameters()
    markers.cornerRefinementMethod = cv2.aruco.CORNER_REFINE_SUBPIX
    return cv2.aruco.CharucoDetector(charuco_board(board), parameters, markers)


def _square_px(board: Board, numbers: npt.NDArray[np.intp], places: DoubleMap) -> float:
    """Return the side of the smallest square between the corners found, px."""
    rows, cols = np.divmod(numbers, board.columns)
    apart = np.abs(rows[:, None] - rows) + np.abs(cols[:, None] - cols) == 1
    lengths = np.linalg.norm(places[:, None] - places, axis=2)[apart]
    return float(lengths.min()) if lengths.size else 0.0


def _likeliest(pictures: Sequence[Grey8]) -> str | None:
    """Return the dictionary whose first markers are seen most often; None if hardly any are."""
    best, most = None, 0
    for name in DICTIONARIES:
        seen = [len(one.numbers) for one in _seen(name, pictures, FIRST_LOOK)]
        count = sum(number for number in seen if number >= FEWEST_MARKERS)
        if count > most:
            best, most = name, count
        if most >= ENOUGH_MARKERS * len(pictures):
            break
    return best


def _seen(dictionary: str, pictures: Sequence[Grey8], count: int) -> list[SeenMarkers]:
    """Return which of the first markers of a dictionary each picture shows."""
    detector = cv2.aruco.ArucoDetector(first_markers(dictionary, count))
    seen = []
    for picture in pictures:
        corners, numbers, _ = detector.detectMarkers(picture)
        if numbers is None or len(numbers) == 0:
            seen.append(SeenMarkers(np.zeros(0, np.intp), np.zeros((0, 4, 2))))
            continue
        numbers, first = np.unique(numbers.ravel(), return_index=True)
        places = np.array([corners[one].reshape(4, 2) for one in first], np.float64)
        seen.append(SeenMarkers(numbers.astype(np.intp), places))
    return seen


def _square_of(numbers: npt.NDArray[np.intp], width: int, shift: int) -> DoubleMap:
    """Return column and row of each marker's square, (n, 2), on a board of `width` squares across.

    Markers count along the rows of white squares; `shift` is the column of the first white square.
    """
    rows = int(numbers.max()) * 2 // (width - 1) + 2
    row, col = np.indices((rows, width))
    white = np.flatnonzero((row + col) % 2 == shift)
    row, col = np.divmod(white[numbers], width)
    return np.stack([col, row], axis=1).astype(np.float64)


def _agreeing(seen: Sequence[SeenMarkers], width: int, shift: int) -> list[npt.NDArray[np.bool_]]:
    """Return for each picture which markers fit a plane board of `width` squares across."""
    agreeing = []
    for markers in seen:
        homography, limit = _homography(markers, width, shift)
        if homography is None:
            agreeing.append(np.zeros(len(markers.numbers), dtype=bool))
            continue
        squares = _square_of(markers.numbers, width, shift) + 0.5
        placed = cv2.perspectiveTransform(squares[:, None], homography)[:, 0]
        agreeing.append(np.linalg.norm(placed - markers.centres, axis=1) < limit)
    return agreeing


def _homography(markers: SeenMarkers, width: int, shift: int) -> tuple[DoubleMap | None, float]:
    """Return the homography from squares of the board to the picture, and the largest error of a marker, px."""
    sides = np.linalg.norm(markers.corners - np.roll(markers.corners, 1, axis=1), axis=2)
    limit = 0.5 * float(np.median(sides))
    squares = _square_of(markers.numbers, width, shift) + 0.5
    homography, _ = cv2.findHomography(squares, markers.centres, cv2.RANSAC, limit, maxIters=MOST_DRAWS)
    return None if homography is None else np.asarray(homography, dtype=np.float64), limit


def _marker_share(
    seen: Sequence[SeenMarkers], agreeing: Sequence[npt.NDArray[np.bool_]], width: int, shift: int
) -> float:
    """Return the side of a marker as a share of the side of a square."""
    sides = []
    for markers, inside in zip(seen, agreeing, strict=True):
        homography, _ = _homography(markers, width, shift)
        if homography is None or not inside.any():
            continue
        flat = cv2.perspectiveTransform(markers.corners[inside].reshape(-1, 1, 2), np.linalg.inv(homography))
        corners = flat.reshape(-1, 4, 2)
        sides.append(np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2).ravel())
    return round(float(np.clip(np.median(np.concatenate(sides)), 0.2, 0.95)), 2)
