"""Pictures of a board that a calibration still needs, judged by the board's poses, as ROS's calibrator does.

A picture is worth keeping if the board is held still, so that both cameras see it in one place and without blur, and if
its pose differs from all those kept before. Missing poses are named, so that a person knows where to hold the board
next.
"""

from __future__ import annotations

from enum import StrEnum
from typing import NamedTuple

import cv2
import numpy as np

from stereolag.core.arrays import DoubleMap, Indices, Vector
from stereolag.geometry.boards import Board, Corners
from stereolag.geometry.calibrating import ENOUGH_COVERAGE, covered_cells

MAX_STILL_SPEED = 0.015
"""Maximum speed of the corners of a board held still, in image widths per second: 1 px of 640 in 0.1 s. A hand can be
that steady, and in the milliseconds between the exposures of two webcams the board hardly moves."""

MIN_FRAME_GAP_S = 0.08
"""Minimum time between two compared frames: over less, the noise of the corners hides their speed."""

MAX_FRAME_GAP_S = 0.3
"""Time over which the allowed movement grows with the time between two frames; it is the same for longer gaps."""

MIN_POSE_DIFFERENCE = 0.2
"""Minimum distance between two kept poses, summed over the fields of :class:`BoardPose`: ROS's value."""

BORDER_ZONE = 0.25
"""Width of the zones at the borders, as a share of the board's range of positions (`BoardPose.across`, `down`)."""

MIN_NEAR_SIZE = 0.4
"""Minimum size of a board that counts as near: ROS's value."""

MIN_TILT_SINE = 0.34
"""Sine of the minimum tilt that counts, 20°. Without tilt, any focal length would fit."""

MIN_SAMPLES = 10
"""Number of poses below which there are never enough."""

MAX_SAMPLES = 40
"""Number of poses from which there are always enough."""


class BoardPose(NamedTuple):
    """The approximate pose of a board in front of a stereo camera whose lenses are not known yet.

    Attributes
    ----------
    across, down
        Its position, 0..1, within the range it can have in both pictures: at 0 it touches the left or upper border of
        one of them, at 1 the right or lower one.
    size
        Square root of the share of the left picture that its corners enclose, 0..1.
    tilt_across, tilt_down
        Sine of its tilt, -1..1, along the rows and columns of the left picture: positive if its right side, or its
        bottom, is nearer than the other.
    """

    across: float
    down: float
    size: float
    tilt_across: float
    tilt_down: float


class Missing(StrEnum):
    """Kinds of poses that have not been kept yet."""

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
"""The nine parts of a picture, row by row."""


def board_pose(left: Corners, right: Corners, board: Board, size: tuple[int, int]) -> BoardPose:
    """Return the pose of a board, from its corners in both pictures of `size`: width and height, px."""
    # The possible positions in the two pictures differ by the disparity: a near board cannot be at the left border of
    # the left picture, because it would be outside the right one.
    points = np.concatenate((left.points, right.points))
    before = np.maximum(points.min(axis=0), 0)
    after = np.maximum(np.array(size) - 1 - points.max(axis=0), 0)
    across, down = np.divide(before, before + after, out=np.full(2, 0.5), where=before + after > 0)
    enclosed = cv2.contourArea(cv2.convexHull(left.points.astype(np.float32)))
    tilt_across, tilt_down = _tilt(board.points()[left.numbers, :2], left.points)
    return BoardPose(float(across), float(down), float(np.sqrt(enclosed / np.prod(size))), tilt_across, tilt_down)


def _tilt(board_points: DoubleMap, image_points: DoubleMap) -> Vector:
    """Return the sine of a board's tilt towards the viewer, along the rows and columns of the picture.

    The board is foreshortened by the cosine along the direction of the tilt, whatever the focal length; the side that
    appears magnified is the nearer one.
    """
    centre = board_points.mean(axis=0)
    homography, _ = cv2.findHomography(board_points - centre, image_points)
    if homography is None:
        return np.zeros(2)
    homography = homography / homography[2, 2]
    # The Jacobian of the image point with respect to the board point at the centre, and the gradient of the inverse
    # scale, which grows with the distance, in the picture.
    jacobian = homography[:2, :2] - np.outer(homography[:2, 2], homography[2, :2])
    directions, stretches, _ = np.linalg.svd(jacobian)
    sine = np.sqrt(max(0.0, 1 - (stretches[1] / stretches[0]) ** 2))
    distance_gradient = homography[2, :2] @ np.linalg.pinv(jacobian)
    direction = directions[:, 1]
    return np.asarray(-np.copysign(sine, distance_gradient @ direction) * direction)


def is_still(now: Corners, before: Corners, board: Board, width: int, seconds: float) -> bool:
    """Return whether a board has hardly moved between two frames, `width` px wide and `seconds` apart."""
    common = np.intersect1d(now.numbers, before.numbers)
    if not common.size:
        return False
    # A chessboard looks the same from two ends, and its corners may be counted from either.
    new_points, old_points = now.of(common), before.of(common)
    shift = min(
        float(np.linalg.norm(new_points - old_points[order], axis=1).max()) for order in board.orders(len(common))
    )
    return shift <= MAX_STILL_SPEED * width * min(seconds, MAX_FRAME_GAP_S)


class Collected:
    """The poses kept so far, and the parts of both pictures that their boards cover.

    Attributes
    ----------
    poses
        The poses.
    cells
        (2, n, n) cells of the left and the right picture, 1 where a board has been.
    """

    def __init__(self) -> None:
        self.poses: list[BoardPose] = []
        self.cells = np.stack([covered_cells([], (1, 1))] * 2)

    def is_new(self, pose: BoardPose) -> bool:
        """Return whether a pose differs enough from all kept ones."""
        return all(np.abs(np.subtract(pose, kept)).sum() >= MIN_POSE_DIFFERENCE for kept in self.poses)

    def keep(self, pose: BoardPose, left: Corners, right: Corners, size: tuple[int, int]) -> None:
        """Keep a pose, with the corners in both pictures of `size`: width and height, px."""
        self.poses.append(pose)
        self.cells |= np.stack([covered_cells([corners], size) for corners in (left, right)])

    def progress(self) -> dict[str, float]:
        """Return the share of the needed poses that are kept, 0..1, by `picture` (coverage), `size` and `tilt`."""
        if not self.poses:
            return dict.fromkeys(("picture", "size", "tilt"), 0.0)
        lowest, highest = np.min(self.poses, axis=0), np.max(self.poses, axis=0)
        tilts = np.clip(np.concatenate((-lowest[3:], highest[3:])) / MIN_TILT_SINE, 0, 1)
        return {
            "picture": min(1.0, max(self._covered() / ENOUGH_COVERAGE, 1 - self._empty_parts().size / len(PARTS))),
            "size": min(1.0, float(highest[2]) / MIN_NEAR_SIZE),
            "tilt": float(tilts.mean()),
        }

    def missing(self) -> list[Missing]:
        """Return the poses that are still missing, the most urgent first; an empty list if there are enough."""
        if len(self.poses) >= MAX_SAMPLES:
            return []
        parts = self._empty_parts()
        is_missing = {
            Missing.NEARER: not any(pose.size >= MIN_NEAR_SIZE for pose in self.poses),
            **dict.fromkeys((PARTS[number] for number in parts), self._covered() < ENOUGH_COVERAGE),
            Missing.LEFT_NEARER: not any(pose.tilt_across <= -MIN_TILT_SINE for pose in self.poses),
            Missing.RIGHT_NEARER: not any(pose.tilt_across >= MIN_TILT_SINE for pose in self.poses),
            Missing.TOP_NEARER: not any(pose.tilt_down <= -MIN_TILT_SINE for pose in self.poses),
            Missing.BOTTOM_NEARER: not any(pose.tilt_down >= MIN_TILT_SINE for pose in self.poses),
            Missing.MORE: len(self.poses) < MIN_SAMPLES,
        }
        return [kind for kind, missing in is_missing.items() if missing]

    def _covered(self) -> float:
        return float(self.cells.mean(axis=(1, 2)).min())

    def _empty_parts(self) -> Indices:
        """Return the numbers of the parts in which no board has been held, the least covered one first."""
        zones = np.digitize([pose[:2] for pose in self.poses] or np.empty((0, 2)), (BORDER_ZONE, 1 - BORDER_ZONE))
        rows = np.array_split(self.cells.mean(axis=0), 3)
        covered = np.array([part.mean() for row in rows for part in np.array_split(row, 3, axis=1)])
        order = np.argsort(covered, kind="stable")
        return order[~np.isin(order, 3 * zones[:, 1] + zones[:, 0])]
