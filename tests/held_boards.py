"""A chessboard held before a stereo camera that is known: where its corners are seen, and the pictures taken of it."""

from collections.abc import Iterator
from functools import cache
from typing import Any

import cv2
import numpy as np

from stereolag.core.arrays import Rgb
from stereolag.geometry.board_samples import PARTS, Collected, Missing, board_pose
from stereolag.geometry.boards import Board, Corners
from stereolag.geometry.camera_fits import Camera, Pose
from stereolag.geometry.drawn_boards import DrawnCamera

SIZE = 400, 300
CHESSBOARD = Board(9, 6)
SQUARE_M = 0.03
BASELINE_M = 2 * SQUARE_M
FOCAL_PX = 325.0
MATRIX = np.array([[FOCAL_PX, 0, SIZE[0] / 2], [0, FOCAL_PX, SIZE[1] / 2], [0, 0, 1]])
LEFT, RIGHT = (Camera(MATRIX, np.array([distortion, 0.05, 0, 0, 0])) for distortion in (-0.2, -0.18))
MARGIN = 1.6
"""Squares around the corners that must be seen for a board to be found."""
BESIDE = Pose(np.eye(3), np.array([-2.0, 0, 0]))

REMEDY: dict[Missing, dict[str, Any]] = {
    part: {"across": number % 3 / 2, "down": number // 3 / 2} for number, part in enumerate(PARTS)
} | {
    Missing.NEARER: {"share": 0.46},
    Missing.LEFT_NEARER: {"turn": (0, -0.5, 0)},
    Missing.RIGHT_NEARER: {"turn": (0, 0.5, 0)},
    Missing.TOP_NEARER: {"turn": (0.5, 0, 0)},
    Missing.BOTTOM_NEARER: {"turn": (-0.5, 0, 0)},
    Missing.MORE: {"across": 0.3, "down": 0.8, "share": 0.3},
}
"""How to hold the board if this is missing."""


def held(
    across: float = 0.5, down: float = 0.5, share: float = 0.35, turn: tuple[float, ...] = (0, 0, 0)
) -> tuple[Pose, Pose]:
    """Return the pose of a board in the frames of both cameras.

    Parameters
    ----------
    across, down
        Its place in the room that both pictures leave it, 0..1.
    share
        Its width as a share of that of a picture.
    turn
        Its rotation vector, radians.
    """
    rotation = np.asarray(cv2.Rodrigues(np.array(turn, dtype=float))[0], dtype=np.float64)
    wide, high = CHESSBOARD.columns - 1, CHESSBOARD.rows - 1
    distance = FOCAL_PX * wide / (share * SIZE[0])
    square = FOCAL_PX / distance
    taken = np.array([wide + 2, high]) * square + 2 * MARGIN * square
    centre = np.array([*((np.array([across, down]) - 0.5) * 0.9 * (SIZE - taken) / FOCAL_PX), 1]) * distance + [1, 0, 0]
    first = Pose(rotation, centre - rotation @ CHESSBOARD.points().mean(axis=0))
    return first, BESIDE.compose(first)


def seen(poses: tuple[Pose, Pose], noise: np.random.Generator | None = None) -> tuple[Corners, Corners]:
    found = []
    for camera, pose in zip((LEFT, RIGHT), poses, strict=True):
        places = camera.project(CHESSBOARD.points(), pose)
        places += 0 if noise is None else noise.normal(0, 0.05, places.shape)
        found.append(Corners(np.arange(CHESSBOARD.corners), places))
    return found[0], found[1]


def obeying(seed: int, most: int = 20) -> Iterator[tuple[Collected, tuple[Pose, Pose]]]:
    """Hold a board as what is missing demands until there is enough; yield what was collected before, and the pose."""
    random = np.random.default_rng(seed)
    collected = Collected()
    for _ in range(most):
        if not (wanted := collected.missing()):
            return
        poses = held(**{"turn": tuple(random.normal(0, 0.2, 3))} | REMEDY[wanted[0]])
        yield collected, poses
        corners = seen(poses)
        collected.keep(board_pose(*corners, CHESSBOARD, SIZE), *corners, SIZE)


@cache
def _drawn_cameras() -> tuple[DrawnCamera, DrawnCamera]:
    return DrawnCamera(LEFT, SIZE), DrawnCamera(RIGHT, SIZE)


def taken(poses: tuple[Pose, Pose]) -> tuple[Rgb, Rgb]:
    left, right = (
        camera.picture(CHESSBOARD, pose)[..., None].repeat(3, axis=2)
        for camera, pose in zip(_drawn_cameras(), poses, strict=True)
    )
    return left, right
