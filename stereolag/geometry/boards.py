"""Calibration boards, chessboards or ChArUco boards: their corners, found in pictures to hundredths of a pixel."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace
from typing import Any, NamedTuple, Protocol

import cv2
import numpy as np
import numpy.typing as npt

from stereolag.core.arrays import DoubleMap, Rgb
from stereolag.core.inputs import as_eight_bit, as_grey, as_image
from stereolag.core.jobs import Progress, silent
from stereolag.geometry.rectification import scaled_image

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

    def in_a_row(self, numbers: npt.NDArray[np.intp]) -> bool:
        """Return whether corners are all in one row or one column."""
        rows, cols = np.divmod(numbers, self.columns)
        return bool(np.ptp(rows) == 0 or np.ptp(cols) == 0)

    def orders(self, seen: int) -> tuple[npt.NDArray[np.intp], ...]:
        """Return the orders in which a detector may list so many corners of the same board, the plain one first.

        A chessboard looks the same upside down, and a square one when rotated by a right angle; markers settle it, and
        so do corners that are not seen.
        """
        if self.markers is not None or seen < self.corners:
            return (np.arange(seen),)
        plain = np.arange(self.corners).reshape(self.rows, self.columns)
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
    """Return the board as printed, squares of so many px, with a white margin of one square around it.

    The first inner corner is between the pixels at ``2 * square_px``.
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


LARGEST_SIDE = 1200
"""Largest side of the picture first searched for corners, px: larger ones are reduced, then refined at full size."""

WINDOW_SHARE = 0.3
"""Half the window for refining a corner, as a share of the distance to the next: beyond, others interfere."""

LEAST_WINDOW, LARGEST_WINDOW = 2, 20
"""Limits of that half, px: within a larger window a distorted lens bends the edges."""

FARTHEST_MOVE = 0.5
"""Largest move of a corner by refining, as a share of the distance to the next one."""

MOST_UNEVEN = 1.6
"""Largest ratio of a distance between corners to the next one's: a row left out makes it about 2."""

ENOUGH_VOTES = 5
"""Number of pictures with the same size of the board that settles it."""

SMALLEST_GUESS = (3, 3)

_QUICK = cv2.CALIB_CB_NORMALIZE_IMAGE
_THOROUGH = cv2.CALIB_CB_NORMALIZE_IMAGE | cv2.CALIB_CB_ACCURACY
_QUADS = cv2.CALIB_CB_ADAPTIVE_THRESH | cv2.CALIB_CB_NORMALIZE_IMAGE | cv2.CALIB_CB_FAST_CHECK

Detector = tuple[Callable[..., Any], int]
"""One of OpenCV's, with its flags."""

BY_CORNERS: Detector = cv2.findChessboardCornersSB, _QUICK
BY_SQUARES: Detector = cv2.findChessboardCorners, _QUADS
AT_LEISURE: Detector = cv2.findChessboardCornersSB, _THOROUGH


def find_chessboard(grey: Grey8, board: Board) -> Corners | None:
    """Return all corners of a chessboard in a picture, None if it is not seen as a whole.

    Corners are found by OpenCV's detectors in a picture of moderate size (Duda and Frese, BMVC 2018, and the older one
    by the squares' outlines), then refined in the full picture by ``cv2.cornerSubPix``, each in a window that fits
    between its neighbours: on drawn boards that is two to three times as accurate as the detectors.
    """
    picture, factor = reduced(grey, LARGEST_SIDE)
    found = _detected(picture, (board.columns, board.rows), (BY_CORNERS, BY_SQUARES, AT_LEISURE))
    if found is None:
        return None
    points = (found + 0.5) / factor - 0.5
    spacing = _spacing(points.reshape(board.rows, board.columns, 2)).ravel()
    moved = refined_in_windows(grey, points, WINDOW_SHARE * spacing)
    too_far = (np.linalg.norm(moved - points, axis=1) > FARTHEST_MOVE * spacing).any()
    return None if too_far else Corners(np.arange(board.corners), moved)


RUNNING_SIDE = 480
"""Largest side of a running picture that is searched for a chessboard, px."""


def find_in_running_picture(grey: Grey8, board: Board) -> Corners | None:
    """Return the corners of a board to a fraction of a pixel, None if it is not found at once.

    It takes a tenth of the time of :func:`find_chessboard`, and less for a picture without a board.
    """
    if board.markers is not None:
        return find_charuco(grey, board)
    picture, factor = reduced(grey, RUNNING_SIDE)
    found = _detected(picture, (board.columns, board.rows), (BY_SQUARES,))
    return None if found is None else Corners(np.arange(board.corners), (found + 0.5) / factor - 0.5)


def reduced(grey: Grey8, largest: int) -> tuple[Grey8, float]:
    """Return a picture of at most `largest` px a side, and its size as a share of the original."""
    factor = min(1.0, largest / max(grey.shape))
    small = np.asarray(scaled_image(grey, factor), dtype=np.uint8)
    return small, small.shape[1] / grey.shape[1]


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


def guess_chessboard(pictures: Iterable[Grey8], *, at_leisure: bool = True) -> Board | None:
    """Return the chessboard that most of the pictures show; None if none shows one. No more are read than needed.

    In each, the largest full grid is detected. A grid with a row too many, formed by something beside the board, or
    too few, where the board is cut off, occurs by chance, but the right one again and again.
    """
    votes: Counter[tuple[int, int]] = Counter()
    seen: list[Grey8] = []
    for grey in pictures:
        seen.append(reduced(grey, LARGEST_SIDE)[0])
        votes.update(_grid(seen[-1], _QUICK))
        if votes and max(votes.values()) >= ENOUGH_VOTES:
            break
    if not votes and at_leisure:
        votes.update(size for picture in seen for size in _grid(picture, _THOROUGH))
    if not votes:
        return None
    return Board(*max(votes, key=lambda one: (votes[one], one[0] * one[1])))


def _grid(picture: Grey8, flags: int) -> Sequence[tuple[int, int]]:
    """Return the size of the largest grid in a picture, the longer side first; empty if there is none."""
    found, _, grid = cv2.findChessboardCornersSBWithMeta(picture, SMALLEST_GUESS, flags | cv2.CALIB_CB_LARGER)
    if not found or min(grid.shape) < min(SMALLEST_GUESS):
        return ()
    return ((max(grid.shape), min(grid.shape)),)


def _detected(picture: Grey8, size: tuple[int, int], detectors: Sequence[Detector]) -> DoubleMap | None:
    """Return (n, 2) corners from the first detector that finds them all.

    If the ends of the board differ in colour, the first corner is at the white end, whichever detector found it.
    """
    for detector in detectors:
        detect, flags = detector
        found, points = detect(picture, size, flags=flags)
        # Of small boards they may leave out a row within, and end on the board's edge instead.
        if found and _is_even(np.reshape(points, (size[1], size[0], 2))):
            corners = np.asarray(points, dtype=np.float64).reshape(-1, 2)
            return corners[::-1] if detector is BY_SQUARES and sum(size) % 2 else corners
    return None


def _is_even(grid: npt.NDArray[np.floating[Any]]) -> bool:
    """Return whether no distance between neighbours in (rows, columns, 2) corners is far from the next one's."""
    gaps = [np.linalg.norm(np.diff(grid, axis=axis), axis=2) for axis in (0, 1)]
    steps = [np.diff(np.log(np.maximum(one, 1e-9)), axis=axis) for axis, one in enumerate(gaps)]
    return all(np.abs(one).max(initial=0.0) < math.log(MOST_UNEVEN) for one in steps)


def _spacing(grid: npt.NDArray[np.float64]) -> DoubleMap:
    """Return the distance of each of (rows, columns, 2) corners to the nearest of its neighbours, px."""
    down, across = (np.linalg.norm(np.diff(grid, axis=axis), axis=2) for axis in (0, 1))
    down = np.pad(down, ((1, 1), (0, 0)), constant_values=np.inf)
    across = np.pad(across, ((0, 0), (1, 1)), constant_values=np.inf)
    return np.asarray(np.minimum.reduce([down[:-1], down[1:], across[:, :-1], across[:, 1:]]))


LARGEST_MARKERS_SIDE = 2400
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
    "DICT_ARUCO_MIP_36h12",
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


class SeenMarkers(NamedTuple):
    """Markers of one dictionary: (n,) numbers and (n, 4, 2) corners, px in a picture or squares of the board."""

    numbers: npt.NDArray[np.intp]
    corners: DoubleMap


def find_charuco(grey: Grey8, board: Board) -> Corners | None:
    """Return the corners of a ChArUco board in a picture, None if it shows fewer than six or a single row."""
    assert board.markers is not None
    picture, factor = reduced(grey, LARGEST_MARKERS_SIDE)
    points, numbers, _, _ = _detector(board).detectBoard(picture)
    if numbers is None or len(numbers) < FEWEST_FOUND:
        return None
    order = np.argsort(numbers.ravel())
    found = numbers.ravel()[order].astype(np.intp)
    if board.in_a_row(found):
        return None
    places = (points.reshape(-1, 2)[order].astype(np.float64) + 0.5) / factor - 0.5
    if factor < 1:
        # The markers are this far from the corners; a window must not reach them.
        gap = (1 - board.markers.share) / 2 * _square_px(board, found, places)
        places = refined_in_windows(grey, places, np.full(len(places), gap))
    return Corners(found, places)


def guess_charuco(pictures: Iterable[Grey8], size: tuple[int, int] | None = None) -> Board | None:
    """Return the ChArUco board that the pictures show; None if they show none.

    Its columns and rows of inner corners, in either order, help if they are known.
    """
    small = [reduced(grey, GUESSED_SIDE)[0] for grey in pictures]
    dictionary = _likeliest(small[:FIRST_PICTURES])
    if dictionary is None:
        return None
    seen = [markers for markers in _seen(dictionary, small, MOST_MARKERS) if len(markers.numbers) >= FEWEST_MARKERS]
    seen = sorted(seen, key=lambda markers: -len(markers.numbers))[:MOST_FITTED]
    highest = max(int(markers.numbers.max()) for markers in seen)
    widths = range(3, min(MOST_CORNERS + 1, 2 * highest + 3) + 1) if size is None else {side + 1 for side in size}
    fits = {
        (width, shift): [_agreeing(markers, width, shift) for markers in seen] for width in widths for shift in (1, 0)
    }
    (width, shift), agreeing = max(fits.items(), key=lambda fit: sum(one.numbers.size for one in fit[1]))
    numbers = np.concatenate([markers.numbers for markers in agreeing])
    if numbers.size < AGREEMENT * sum(markers.numbers.size for markers in seen):
        return None
    if size is not None:
        height = size[0] + size[1] + 2 - width
    else:
        height = int(_square_of(numbers.max(keepdims=True), width, shift)[0, 1]) + 1
        # A legacy board that starts with a white square has an even number of rows.
        height = max(3, height + (height % 2 if shift == 0 else 0))
    sides = _sides(np.concatenate([markers.corners for markers in agreeing]))
    share = round(float(np.clip(np.median(sides), 0.2, 0.95)), 2)
    return Board(width - 1, height - 1, Markers(dictionary, share, legacy=shift == 0))


def _sides(corners: DoubleMap) -> DoubleMap:
    """Return the lengths of the sides of markers with (n, 4, 2) corners."""
    return np.asarray(np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2))


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
        corners, found, _ = detector.detectMarkers(picture)
        numbers, first = np.unique([] if found is None else found, return_index=True)
        places = np.array([corners[one] for one in first], np.float64).reshape(-1, 4, 2)
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


def _agreeing(markers: SeenMarkers, width: int, shift: int) -> SeenMarkers:
    """Return the markers that are where a plane board of `width` squares across has them, with corners in squares."""
    limit = 0.5 * float(np.median(_sides(markers.corners)))
    squares, centres = _square_of(markers.numbers, width, shift) + 0.5, markers.corners.mean(axis=1)
    found, _ = cv2.findHomography(squares, centres, cv2.RANSAC, limit, maxIters=MOST_DRAWS)
    if found is None:
        return SeenMarkers(markers.numbers[:0], markers.corners[:0])
    placed = cv2.perspectiveTransform(squares[:, None], found)[:, 0]
    agreeing = np.linalg.norm(placed - centres, axis=1) < limit
    flat = cv2.perspectiveTransform(markers.corners.reshape(-1, 1, 2), cv2.invert(found)[1]).reshape(-1, 4, 2)
    return SeenMarkers(markers.numbers[agreeing], np.asarray(flat[agreeing], dtype=np.float64))


class Pairs(Protocol):
    """Left and right pictures; each is requested when needed, and not kept."""

    def __len__(self) -> int:
        """Return the number of pairs."""

    def __getitem__(self, number: int, /) -> tuple[npt.ArrayLike, npt.ArrayLike]:
        """Return one pair."""


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

    @property
    def both(self) -> dict[int, tuple[Corners, Corners]]:
        """Return the corners of the pairs in which both pictures show the board, by number."""
        found = enumerate(zip(self.left, self.right, strict=True))
        return {number: (left, right) for number, (left, right) in found if left is not None and right is not None}


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

    Raises
    ------
    ValueError
        No pairs or more than 100, a picture that is not an image, or a board of unknown size that no picture shows.
    """
    pairs = list(pairs) if isinstance(pairs, Iterable) else pairs
    if not 1 <= len(pairs) <= MOST_PAIRS:
        raise ValueError(f"pairs holds {len(pairs)}; allowed are 1 to {MOST_PAIRS} pairs of pictures.")
    report = progress or silent
    if not isinstance(board, Board):
        board = guess_board(pairs, board)
    find = find_chessboard if board.markers is None else find_charuco
    corners, sizes = [], []
    for number in range(len(pairs)):
        report(number / len(pairs))
        first, second = grey_pair(*pairs[number])
        corners.append((find(first, board), find(second, board)))
        sizes.append((first.shape[::-1], second.shape[::-1]))
    report(1.0)
    size = Counter(size for both in sizes for size in both).most_common(1)[0][0]
    left, right = zip(*corners, strict=True)
    return BoardViews(board, size, left, right, tuple(sizes))


def guess_board(pairs: Pairs, size: tuple[int, int] | None = None) -> Board:
    """Return the board that the pictures show, of which only a few are examined.

    If its columns and rows of inner corners are known, only the kind of board is guessed.

    Raises
    ------
    ValueError
        A size out of bounds, or no board in the pictures.
    """
    if size is not None:
        size = Board(*size).columns, Board(*size).rows
    chosen = np.unique(np.linspace(0, len(pairs) - 1, min(len(pairs), GUESSED_FROM)).astype(int))
    pictures = [picture for number in chosen for picture in grey_pair(*pairs[int(number)])]
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
