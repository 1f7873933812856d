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

from stereolag.core.arrays import DoubleMap, EightBit, Rgb
from stereolag.core.inputs import as_eight_bit, as_grey, as_image
from stereolag.core.jobs import Progress, silent
from stereolag.geometry.rectification import scaled_image

MIN_CORNERS, MAX_CORNERS = 2, 50
"""Limits of the number of inner corners in a row or a column of a board."""

MARGIN_SQUARES = 1
"""Width of the white border around a drawn board, in squares: without it the outermost squares are not found."""


@dataclass(frozen=True)
class Markers:
    """The markers in the white squares of a ChArUco board.

    Attributes
    ----------
    dictionary
        Name of one of OpenCV's predefined dictionaries, such as ``"DICT_5X5_1000"``; the smaller ones of the same kind
        are its first part.
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
        Number of inner corners, where four squares meet, in a row and in a column: one fewer than the squares.
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
            if not MIN_CORNERS <= count <= MAX_CORNERS:
                raise ValueError(
                    f"{name} of the board is {count}; allowed are {MIN_CORNERS} to {MAX_CORNERS} inner corners."
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

    def orders(self, count: int) -> tuple[npt.NDArray[np.intp], ...]:
        """Return the orders in which a detector may list `count` corners of this board, the plain one first.

        A chessboard looks the same upside down, and a square one when rotated by a right angle. Markers settle it, and
        so do corners that were not found.
        """
        if self.markers is not None or count < self.corners:
            return (np.arange(count),)
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
    """Return a dictionary of OpenCV's, cut to its first markers: searching for all of a large one takes far longer."""
    whole = cv2.aruco.getPredefinedDictionary(getattr(cv2.aruco, dictionary))
    return cv2.aruco.Dictionary(whole.bytesList[:count], whole.markerSize, whole.maxCorrectionBits)


def charuco_board(board: Board) -> Any:
    """Return OpenCV's object for a ChArUco board with squares of side 1."""
    assert board.markers is not None
    size = (board.columns + 1, board.rows + 1)
    dictionary = first_markers(board.markers.dictionary, (size[0] * size[1] + 1) // 2)
    charuco = cv2.aruco.CharucoBoard(size, 1.0, board.markers.share, dictionary)
    charuco.setLegacyPattern(board.markers.legacy)
    return charuco


def board_picture(board: Board, square_px: int) -> Rgb | EightBit:
    """Return the board as printed, with squares of `square_px` px and a white margin of one square around it.

    The first inner corner is between the pixels at ``2 * square_px``.
    """
    squares = board.columns + 1, board.rows + 1
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
    return np.pad(picture, MARGIN_SQUARES * square_px, constant_values=255)


MAX_SEARCH_SIDE_PX = 1200
"""Maximum side of the pictures searched for corners, px: larger ones are reduced, and the corners refined at full
size."""

HALF_WINDOW_SHARE = 0.3
"""Half the side of the window for refining a corner, as a share of the distance to the next corner: in a larger window
other corners interfere."""

HALF_WINDOW_LIMITS_PX = (2, 20)
"""Limits of half that side, px: within a larger window a distorted lens bends the edges."""

MAX_CORNER_SHIFT = 0.5
"""Maximum shift of a corner by refinement, as a share of the distance to the next corner."""

MAX_SPACING_RATIO = 1.6
"""Maximum ratio of neighbouring distances between corners: where a row was skipped it is about 2."""

ENOUGH_VOTES = 5
"""Number of pictures with a board of the same size that settles it."""

MIN_CHESSBOARD_SIZE = (3, 3)
"""Minimum columns and rows of inner corners of a chessboard, below which OpenCV looks for none."""

_QUICK_FLAGS = cv2.CALIB_CB_NORMALIZE_IMAGE
_THOROUGH_FLAGS = cv2.CALIB_CB_NORMALIZE_IMAGE | cv2.CALIB_CB_ACCURACY

Detector = tuple[Callable[..., Any], int]
"""A chessboard detector of OpenCV and its flags."""

SQUARES_DETECTOR: Detector = (
    cv2.findChessboardCorners,
    cv2.CALIB_CB_ADAPTIVE_THRESH | cv2.CALIB_CB_NORMALIZE_IMAGE | cv2.CALIB_CB_FAST_CHECK,
)


def find_chessboard(grey: EightBit, board: Board) -> Corners | None:
    """Return all corners of a chessboard in a picture; None if it is not found as a whole.

    Corners are found by OpenCV's detectors in a picture of moderate size (Duda and Frese, BMVC 2018, and the older one
    by the squares' outlines), then refined in the full picture by ``cv2.cornerSubPix``, each in a window that fits
    between its neighbours: on drawn boards that is two to three times as accurate as the detectors.
    """
    quick, thorough = ((cv2.findChessboardCornersSB, flags) for flags in (_QUICK_FLAGS, _THOROUGH_FLAGS))
    points = _detected(grey, board, MAX_SEARCH_SIDE_PX, (quick, SQUARES_DETECTOR, thorough))
    if points is None:
        return None
    spacing = _spacing(points.reshape(board.rows, board.columns, 2)).ravel()
    refined = refined_in_windows(grey, points, HALF_WINDOW_SHARE * spacing)
    too_far = (np.linalg.norm(refined - points, axis=1) > MAX_CORNER_SHIFT * spacing).any()
    return None if too_far else Corners(np.arange(board.corners), refined)


MAX_LIVE_SIDE_PX = 480
"""Maximum side of the frames of a live camera that are searched for a chessboard, px."""


def find_in_live_frame(grey: EightBit, board: Board) -> Corners | None:
    """Return the corners of a board to a fraction of a pixel; None if the quickest detector does not find them.

    This takes a tenth of the time of :func:`find_chessboard`, and less for a picture without a board.
    """
    if board.markers is not None:
        return find_charuco(grey, board)
    points = _detected(grey, board, MAX_LIVE_SIDE_PX, (SQUARES_DETECTOR,))
    return None if points is None else Corners(np.arange(board.corners), points)


def reduced(grey: EightBit, max_side: int) -> tuple[EightBit, float]:
    """Return a picture with sides of at most `max_side` px, and its scale relative to the original."""
    factor = min(1.0, max_side / max(grey.shape))
    small = np.asarray(scaled_image(grey, factor), dtype=np.uint8)
    return small, small.shape[1] / grey.shape[1]


def refined_in_windows(grey: EightBit, points: DoubleMap, half_sides: npt.NDArray[np.float64]) -> DoubleMap:
    """Return (n, 2) corners, each refined in a window with its own half side, px."""
    half_sides = np.clip(half_sides, *HALF_WINDOW_LIMITS_PX).astype(int)
    criteria = (cv2.TERM_CRITERIA_COUNT | cv2.TERM_CRITERIA_EPS, 100, 1e-4)
    refined = points.astype(np.float64)
    for half in np.unique(half_sides):
        group = half_sides == half
        corners = np.array(points[group].reshape(-1, 1, 2), dtype=np.float32, order="C")
        refined[group] = cv2.cornerSubPix(grey, corners, (int(half), int(half)), (-1, -1), criteria).reshape(-1, 2)
    return refined


def guess_chessboard(pictures: Iterable[EightBit], *, thorough: bool = True) -> Board | None:
    """Return the chessboard that most of the pictures show; None if none shows one. No more are read than needed.

    The largest complete grid is detected in each picture. A grid with an extra row, formed by something beside the
    board, or with one missing, where the board is cut off, occurs by chance, but the right one again and again.
    """
    votes: Counter[tuple[int, int]] = Counter()
    searched: list[EightBit] = []
    for grey in pictures:
        searched.append(reduced(grey, MAX_SEARCH_SIDE_PX)[0])
        votes.update(_largest_grid(searched[-1], _QUICK_FLAGS))
        if votes and max(votes.values()) >= ENOUGH_VOTES:
            break
    if not votes and thorough:
        votes.update(size for picture in searched for size in _largest_grid(picture, _THOROUGH_FLAGS))
    return Board(*max(votes, key=lambda size: (votes[size], size[0] * size[1]))) if votes else None


def _largest_grid(picture: EightBit, flags: int) -> Sequence[tuple[int, int]]:
    """Return the size of the largest grid in a picture, the longer side first, as one item; none if there is none."""
    found, _, grid = cv2.findChessboardCornersSBWithMeta(picture, MIN_CHESSBOARD_SIZE, flags | cv2.CALIB_CB_LARGER)
    if not found or min(grid.shape) < min(MIN_CHESSBOARD_SIZE):
        return ()
    return ((max(grid.shape), min(grid.shape)),)


def _detected(grey: EightBit, board: Board, max_side: int, detectors: Sequence[Detector]) -> DoubleMap | None:
    """Return (n, 2) corners from the first detector that finds them all, in a picture reduced to `max_side` px.

    If the ends of the board differ in colour, the first corner is at the white end, whichever detector found it.
    """
    (picture, factor), size = reduced(grey, max_side), (board.columns, board.rows)
    if min(size) < min(MIN_CHESSBOARD_SIZE):
        raise ValueError(f"The chessboard has {size[0]} × {size[1]} inner corners; at least 3 × 3 are needed.")
    for detector in detectors:
        detect, flags = detector
        found, points = detect(picture, size, flags=flags)
        # On small boards they may skip an inner row and end at the board's edge instead.
        if found and _is_even(np.reshape(points, (size[1], size[0], 2))):
            corners = (np.asarray(points, dtype=np.float64).reshape(-1, 2) + 0.5) / factor - 0.5
            return corners[::-1] if detector is SQUARES_DETECTOR and sum(size) % 2 else corners
    return None


def _is_even(grid: npt.NDArray[np.floating[Any]]) -> bool:
    """Return whether the distances between (rows, columns, 2) corners change little from each to the next."""
    distances = [np.linalg.norm(np.diff(grid, axis=axis), axis=2) for axis in (0, 1)]
    log_ratios = [np.diff(np.log(np.maximum(one, 1e-9)), axis=axis) for axis, one in enumerate(distances)]
    return all(np.abs(one).max(initial=0.0) < math.log(MAX_SPACING_RATIO) for one in log_ratios)


def _spacing(grid: npt.NDArray[np.float64]) -> DoubleMap:
    """Return the distance of each of (rows, columns, 2) corners to its nearest neighbour, px."""
    down, across = (np.linalg.norm(np.diff(grid, axis=axis), axis=2) for axis in (0, 1))
    down = np.pad(down, ((1, 1), (0, 0)), constant_values=np.inf)
    across = np.pad(across, ((0, 0), (1, 1)), constant_values=np.inf)
    return np.asarray(np.minimum.reduce([down[:-1], down[1:], across[:, :-1], across[:, 1:]]))


MAX_MARKER_SEARCH_SIDE_PX = 2400
"""Maximum side of the pictures searched for the markers of a known board, px."""

MIN_CHARUCO_CORNERS = 6
"""Minimum number of corners for a partly visible board to count."""

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

MARKERS_TO_IDENTIFY = 60
"""Number of each dictionary's markers searched for to identify the dictionary."""

MARKERS_TO_LOCATE = 250
"""Number of that dictionary's markers then searched for in all pictures."""

PICTURES_TO_IDENTIFY = 4
"""Number of pictures from which the dictionary is identified."""

ENOUGH_MARKERS = 8
"""Average number of markers in each of these pictures at which no other dictionary is tried."""

MAX_GUESS_SIDE_PX = 1200
"""Maximum side of the pictures from which the board is guessed, px."""

MAX_FITTED_PICTURES = 3
"""Number of pictures, those with the most markers, used to count the squares of the board."""

MIN_MARKERS = 4
"""Minimum number of markers in a picture of a ChArUco board."""

MIN_AGREEING_SHARE = 0.7
"""Minimum share of the markers that must be in their positions on the board."""


class DetectedMarkers(NamedTuple):
    """Markers of one dictionary: (n,) numbers and (n, 4, 2) corners, in px of a picture or squares of the board."""

    numbers: npt.NDArray[np.intp]
    corners: DoubleMap


def find_charuco(grey: EightBit, board: Board) -> Corners | None:
    """Return the corners of a ChArUco board in a picture; None if fewer than six, or only one row, are found."""
    assert board.markers is not None
    picture, factor = reduced(grey, MAX_MARKER_SEARCH_SIDE_PX)
    points, numbers, _, _ = _detector(board).detectBoard(picture)
    if numbers is None or len(numbers) < MIN_CHARUCO_CORNERS:
        return None
    order = np.argsort(numbers.ravel())
    found = numbers.ravel()[order].astype(np.intp)
    if board.in_a_row(found):
        return None
    corners = (points.reshape(-1, 2)[order].astype(np.float64) + 0.5) / factor - 0.5
    if factor < 1:
        # The markers are this far from the corners; a window must not reach them.
        gap = (1 - board.markers.share) / 2 * _smallest_square_px(board, found, corners)
        corners = refined_in_windows(grey, corners, np.full(len(corners), gap))
    return Corners(found, corners)


def guess_charuco(pictures: Iterable[EightBit], size: tuple[int, int] | None = None) -> Board | None:
    """Return the ChArUco board that the pictures show; None if they show none.

    `size` is its columns and rows of inner corners, in either order, if they are known.
    """
    small = [reduced(grey, MAX_GUESS_SIDE_PX)[0] for grey in pictures]
    dictionary = _likeliest_dictionary(small[:PICTURES_TO_IDENTIFY])
    if dictionary is None:
        return None
    enough = [one for one in _detect_markers(dictionary, small, MARKERS_TO_LOCATE) if len(one.numbers) >= MIN_MARKERS]
    fitted = sorted(enough, key=lambda markers: -len(markers.numbers))[:MAX_FITTED_PICTURES]
    highest = max(int(markers.numbers.max()) for markers in fitted)
    widths = range(3, min(MAX_CORNERS + 1, 2 * highest + 3) + 1) if size is None else {side + 1 for side in size}
    fits = {
        (width, shift): [_consistent_markers(markers, width, shift) for markers in fitted]
        for width in widths
        for shift in (1, 0)
    }
    (width, shift), agreeing = max(fits.items(), key=lambda fit: sum(one.numbers.size for one in fit[1]))
    numbers = np.concatenate([markers.numbers for markers in agreeing])
    if numbers.size < MIN_AGREEING_SHARE * sum(markers.numbers.size for markers in fitted):
        return None
    if size is not None:
        height = size[0] + size[1] + 2 - width
    else:
        height = int(_marker_squares(numbers.max(keepdims=True), width, shift)[0, 1]) + 1
        # A legacy board that starts with a white square has an even number of rows.
        height = max(3, height + (height % 2 if shift == 0 else 0))
    sides = _side_lengths(np.concatenate([markers.corners for markers in agreeing]))
    share = round(float(np.clip(np.median(sides), 0.2, 0.95)), 2)
    return Board(width - 1, height - 1, Markers(dictionary, share, legacy=shift == 0))


def _side_lengths(corners: DoubleMap) -> DoubleMap:
    """Return the lengths of the sides of markers with (n, 4, 2) corners."""
    return np.asarray(np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2))


def _detector(board: Board) -> Any:
    parameters = cv2.aruco.CharucoParameters()
    parameters.tryRefineMarkers = True
    markers = cv2.aruco.DetectorParameters()
    markers.cornerRefinementMethod = cv2.aruco.CORNER_REFINE_SUBPIX
    return cv2.aruco.CharucoDetector(charuco_board(board), parameters, markers)


def _smallest_square_px(board: Board, numbers: npt.NDArray[np.intp], corners: DoubleMap) -> float:
    """Return the length of the shortest side of a square between the corners found, px; 0 if there is none."""
    rows, cols = np.divmod(numbers, board.columns)
    are_neighbours = np.abs(rows[:, None] - rows) + np.abs(cols[:, None] - cols) == 1
    lengths = np.linalg.norm(corners[:, None] - corners, axis=2)[are_neighbours]
    return float(lengths.min()) if lengths.size else 0.0


def _likeliest_dictionary(pictures: Sequence[EightBit]) -> str | None:
    """Return the dictionary whose first markers are found most often; None if there are hardly any."""
    best, best_count = None, 0
    for name in DICTIONARIES:
        counts = [len(markers.numbers) for markers in _detect_markers(name, pictures, MARKERS_TO_IDENTIFY)]
        count = sum(one for one in counts if one >= MIN_MARKERS)
        if count > best_count:
            best, best_count = name, count
        if best_count >= ENOUGH_MARKERS * len(pictures):
            break
    return best


def _detect_markers(dictionary: str, pictures: Sequence[EightBit], count: int) -> list[DetectedMarkers]:
    """Return those of the first `count` markers of a dictionary that are found in each picture."""
    detector = cv2.aruco.ArucoDetector(first_markers(dictionary, count))
    detected = []
    for picture in pictures:
        corners, found, _ = detector.detectMarkers(picture)
        numbers, first = np.unique([] if found is None else found, return_index=True)
        unique_corners = np.array([corners[one] for one in first], np.float64).reshape(-1, 4, 2)
        detected.append(DetectedMarkers(numbers.astype(np.intp), unique_corners))
    return detected


def _marker_squares(numbers: npt.NDArray[np.intp], width: int, shift: int) -> DoubleMap:
    """Return the column and row of each marker's square, (n, 2), on a board that is `width` squares wide.

    Markers are numbered row by row along the white squares; `shift` is the column of the first white square.
    """
    rows = int(numbers.max()) * 2 // (width - 1) + 2
    row, col = np.indices((rows, width))
    white = np.flatnonzero((row + col) % 2 == shift)
    row, col = np.divmod(white[numbers], width)
    return np.stack([col, row], axis=1).astype(np.float64)


def _consistent_markers(markers: DetectedMarkers, width: int, shift: int) -> DetectedMarkers:
    """Return the markers consistent with a plane board that is `width` squares wide, with their corners in squares."""
    limit = 0.5 * float(np.median(_side_lengths(markers.corners)))
    squares, centres = _marker_squares(markers.numbers, width, shift) + 0.5, markers.corners.mean(axis=1)
    # Few draws suffice: on the right board nearly any four markers will do, and on a wrong one none.
    homography, _ = cv2.findHomography(squares, centres, cv2.RANSAC, limit, maxIters=60)
    if homography is None:
        return DetectedMarkers(markers.numbers[:0], markers.corners[:0])
    expected = cv2.perspectiveTransform(squares[:, None], homography)[:, 0]
    agreeing = np.linalg.norm(expected - centres, axis=1) < limit
    flat = cv2.perspectiveTransform(markers.corners.reshape(-1, 1, 2), cv2.invert(homography)[1]).reshape(-1, 4, 2)
    return DetectedMarkers(markers.numbers[agreeing], np.asarray(flat[agreeing], dtype=np.float64))


class Pairs(Protocol):
    """Left and right pictures; each pair is requested when needed, and not kept."""

    def __len__(self) -> int:
        """Return the number of pairs."""

    def __getitem__(self, number: int, /) -> tuple[npt.ArrayLike, npt.ArrayLike]:
        """Return one pair."""


MAX_GUESS_PAIRS = 8
"""Maximum number of pairs from which the board is guessed, spread over all."""

MAX_PAIRS = 100
"""Maximum number of pairs in one calibration."""


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
        No pairs or more than 100, a picture that is not an image, a chessboard with fewer than 3 × 3 inner corners, or
        a board of unknown size that no picture shows.
    """
    pairs = list(pairs) if isinstance(pairs, Iterable) else pairs
    if not 1 <= len(pairs) <= MAX_PAIRS:
        raise ValueError(f"pairs holds {len(pairs)}; allowed are 1 to {MAX_PAIRS} pairs of pictures.")
    report = progress or silent
    if not isinstance(board, Board):
        board = guess_board(pairs, board)
    find = find_chessboard if board.markers is None else find_charuco
    corners, sizes = [], []
    for number in range(len(pairs)):
        report(number / len(pairs))
        left, right = grey_pair(*pairs[number])
        corners.append((find(left, board), find(right, board)))
        sizes.append((left.shape[::-1], right.shape[::-1]))
    report(1.0)
    most_common_size = Counter(size for pair in sizes for size in pair).most_common(1)[0][0]
    left_corners, right_corners = zip(*corners, strict=True)
    return BoardViews(board, most_common_size, left_corners, right_corners, tuple(sizes))


def guess_board(pairs: Pairs, size: tuple[int, int] | None = None) -> Board:
    """Return the board in the pictures, of which only a few are examined.

    If `size`, its columns and rows of inner corners, is known, only the kind of board is guessed.

    Raises
    ------
    ValueError
        A size out of bounds, or no board in the pictures.
    """
    known = None if size is None else Board(*size)
    chosen = np.unique(np.linspace(0, len(pairs) - 1, min(len(pairs), MAX_GUESS_PAIRS)).astype(int))
    pictures = [picture for number in chosen for picture in grey_pair(*pairs[int(number)])]
    board = guess_charuco(pictures, size) or known or guess_chessboard(pictures)
    if board is None:
        raise ValueError(
            f"No chessboard or ChArUco board is seen in {len(pictures)} pictures; give its number of inner "
            "corners, columns and rows, or pictures that show the whole board with a white border."
        )
    return board


def grey_pair(left: npt.ArrayLike, right: npt.ArrayLike) -> tuple[EightBit, EightBit]:
    """Return both pictures as (rows, cols) uint8."""
    first, second = (as_grey(as_image(value, name)) for value, name in ((left, "left"), (right, "right")))
    return as_eight_bit(first, first)[0], as_eight_bit(second, second)[0]
