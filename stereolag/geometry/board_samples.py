"""Which pictures of a board a calibration still needs, judged by figures of its poses, as ROS's calibrator does.

A picture is worth keeping if the board is held still, so that both eyes show it at one place and without blur, and if
its pose differs from all kept before. What is missing is named, so that a person knows where to hold the board next.
"""

from __future__ import annotations

from enum import StrEnum
from typing import NamedTuple

import cv2
import numpy as np
import numpy.typing as npt

from stereolag.core.arrays import DoubleMap, Vector
from stereolag.geometry.boards import Board, Corners
from stereolag.geometry.calibrating import ENOUGH_COVERAGE, covered_cells

STILL = 0.015
"""Largest speed of the corners of a board held still, as a share of the width a second: 1 px of 640 in 0.1 s, which a
hand manages and which the milliseconds between two webcams do not turn into an error."""

APART_S, LONGEST_S = 0.08, 0.3
"""Time between two frames from which on speed stands out from the noise of corners, and up to which they tell it."""

LEAST_DIFFERENCE = 0.2
"""Least sum of the differences of all figures to those of any other pose that is kept: ROS's value."""

EDGE = 0.25
"""A board is at a border if its figure of place is within so much of it."""

NEAR = 0.4
"""Size of a board that is near: ROS's value."""

TILTED = 0.34
"""Sine of a tilt that counts: 20°. Without tilt, any focal length would fit."""

FEWEST_SAMPLES, MOST_SAMPLES = 10, 40
"""Number of poses below which there are never enough, and from which there always are."""


class BoardPose(NamedTuple):
    """How a board is held before a stereo camera, without knowing its lenses.

    Attributes
    ----------
    across, down
        Its place, 0..1, within the room that both pictures leave it: at 0 it touches the left or upper border of one
        of them, at 1 the right or lower one.
    size
        Square root of the share of the left picture that its corners enclose, 0..1.
    to_right, to_bottom
        Sine of its tilt, -1..1, along the rows and columns of the left picture: positive if its right side, or its
        bottom, is nearer than the other.
    """

    across: float
    down: float
    size: float
    to_right: float
    to_bottom: float


class Missing(StrEnum):
    """What the kept poses lack."""

    UPPER_LEFT = "upper_left"
    TOP = "top"
    UPPER_RIGHT = "upper_right"
    LEFT = "left"
    MIDDLE = "middle"
    RIGHT = "right"
    LOWER_LEFT = "lower_left"
    BOTTOM = "bottom"
    LOWER_RIGHT = "lower_right"
    NEARER = "nearer"
    LEFT_NEARER = "left_nearer"
    RIGHT_NEARER = "right_nearer"
    TOP_NEARER = "top_nearer"
    BOTTOM_NEARER = "bottom_nearer"
    MORE = "more"


PARTS = tuple(Missing)[:9]
"""The ninths of a picture, row by row."""


def board_pose(left: Corners, right: Corners, board: Board, size: tuple[int, int]) -> BoardPose:
    """Return how a board is held, from its corners in both pictures of `size`: width and height, px."""
    # The rooms left by the two pictures differ by the disparity: a near board cannot be at the left border of the left
    # one, being outside the right one there.
    places = np.concatenate((left.points, right.points))
    before = np.maximum(places.min(axis=0), 0)
    after = np.maximum(np.array(size) - 1 - places.max(axis=0), 0)
    across, down = np.divide(before, before + after, out=np.full(2, 0.5), where=before + after > 0)
    enclosed = cv2.contourArea(cv2.convexHull(left.points.astype(np.float32)))
    to_right, to_bottom = _tilt(board.points()[left.numbers, :2], left.points)
    return BoardPose(float(across), float(down), float(np.sqrt(enclosed / np.prod(size))), to_right, to_bottom)


def _tilt(squares: DoubleMap, places: DoubleMap) -> Vector:
    """Return the sine of the tilt towards the viewer, along the rows and columns of the picture.

    It is foreshortened by the cosine along the direction of the tilt, whatever the focal length, and the side on which
    it is magnified is the nearer one.
    """
    centre = squares.mean(axis=0)
    homography, _ = cv2.findHomography(squares - centre, places)
    if homography is None:
        return np.zeros(2)
    homography = homography / homography[2, 2]
    # How the picture moves with the board, there and in general, and how the inverse of its scale changes on the board.
    moved = homography[:2, :2] - np.outer(homography[:2, 2], homography[2, :2])
    directions, lengths, _ = np.linalg.svd(moved)
    sine = np.sqrt(max(0.0, 1 - (lengths[1] / lengths[0]) ** 2))
    farther = homography[2, :2] @ np.linalg.pinv(moved)
    along = directions[:, 1]
    return np.asarray(-np.copysign(sine, farther @ along) * along)


def is_still(now: Corners, before: Corners, board: Board, width: int, seconds: float) -> bool:
    """Return whether a board has hardly moved from one frame, of `width` px, to another so many seconds later."""
    common = np.intersect1d(now.numbers, before.numbers)
    if not common.size:
        return False
    # A chessboard looks the same from two ends, and its corners may be counted from either.
    here, there = now.of(common), before.of(common)
    moved = min(float(np.linalg.norm(here - there[order], axis=1).max()) for order in board.orders(len(common)))
    return moved <= STILL * width * min(seconds, LONGEST_S)


class Collected:
    """The poses of the boards kept so far, and which parts of both pictures they cover.

    Attributes
    ----------
    poses
        The poses.
    cells
        (2, n, n) shares of the left and the right picture, 1 where a board has been.
    """

    def __init__(self) -> None:
        self.poses: list[BoardPose] = []
        self.cells = np.stack([covered_cells([], (1, 1))] * 2)

    def adds(self, pose: BoardPose) -> bool:
        """Return whether a pose differs from all that are kept."""
        return all(np.abs(np.subtract(pose, kept)).sum() >= LEAST_DIFFERENCE for kept in self.poses)

    def keep(self, pose: BoardPose, left: Corners, right: Corners, size: tuple[int, int]) -> None:
        """Keep a pose, with the corners in both pictures of `size`: width and height, px."""
        self.poses.append(pose)
        self.cells |= np.stack([covered_cells([corners], size) for corners in (left, right)])

    def progress(self) -> dict[str, float]:
        """Return how much there is of what is needed, 0..1: of the `picture`, of `size` and of `tilt`."""
        if not self.poses:
            return dict.fromkeys(("picture", "size", "tilt"), 0.0)
        least, most = np.min(self.poses, axis=0), np.max(self.poses, axis=0)
        tilts = np.clip(np.concatenate((-least[3:], most[3:])) / TILTED, 0, 1)
        return {
            "picture": min(1.0, max(self._covered() / ENOUGH_COVERAGE, 1 - self._empty_parts().size / len(PARTS))),
            "size": min(1.0, float(most[2]) / NEAR),
            "tilt": float(tilts.mean()),
        }

    def missing(self) -> list[Missing]:
        """Return what there is too little of, what to do next first; nothing if there is enough."""
        if len(self.poses) >= MOST_SAMPLES:
            return []
        parts = self._empty_parts()
        lacks = {
            Missing.NEARER: not any(pose.size >= NEAR for pose in self.poses),
            **dict.fromkeys((PARTS[number] for number in parts), self._covered() < ENOUGH_COVERAGE),
            Missing.LEFT_NEARER: not any(pose.to_right <= -TILTED for pose in self.poses),
            Missing.RIGHT_NEARER: not any(pose.to_right >= TILTED for pose in self.poses),
            Missing.TOP_NEARER: not any(pose.to_bottom <= -TILTED for pose in self.poses),
            Missing.BOTTOM_NEARER: not any(pose.to_bottom >= TILTED for pose in self.poses),
            Missing.MORE: len(self.poses) < FEWEST_SAMPLES,
        }
        return [one for one, lacking in lacks.items() if lacking]

    def _covered(self) -> float:
        return float(self.cells.mean(axis=(1, 2)).min())

    def _empty_parts(self) -> npt.NDArray[np.intp]:
        """Return the numbers of the parts in which no board has been held, the least covered one first."""
        places = np.digitize([pose[:2] for pose in self.poses] or np.empty((0, 2)), (EDGE, 1 - EDGE))
        rows = np.array_split(self.cells.mean(axis=0), 3)
        covered = np.array([part.mean() for row in rows for part in np.array_split(row, 3, axis=1)])
        order = np.argsort(covered, kind="stable")
        return order[~np.isin(order, 3 * places[:, 1] + places[:, 0])]
