"""Pictures of a calibration board, drawn as taken by a stereo camera of known geometry."""

from __future__ import annotations

import functools
from collections.abc import Iterator

import cv2
import numpy as np

from stereolag.core.arrays import EightBit
from stereolag.geometry.boards import MARGIN_SQUARES, Board, board_picture
from stereolag.geometry.calibration import StereoRig
from stereolag.geometry.camera_fits import Camera, Pose

RAYS_PER_PIXEL = 3
"""Number of rays per pixel, across and down."""

FAR_OUTSIDE_PX = 1e4
"""Coordinate that stands for outside the board, px of the board's picture."""

SQUARE_PX = 48
"""Side of a square in the board's picture, which the rays sample, px."""

BACKGROUND_LEVEL = 110
"""Grey level around the board."""

INK_LEVEL, PAPER_LEVEL = 25, 225
"""Grey levels of the board."""

BLUR_PX = 0.6
"""Standard deviation of the lens blur, px."""

NOISE_LEVELS = 2.0
"""Standard deviation of the sensor noise, grey levels."""

MAX_ATTEMPTS = 200
"""Maximum number of random poses tried for one that both cameras see."""

MAX_TILT_RAD = 0.6
"""Maximum tilt about each axis, radians: a board seen more from the side is hardly found."""


class DrawnCamera:
    """A camera whose pictures, of `size` (width, height) px, are drawn ray by ray, with its lens distortion."""

    def __init__(self, camera: Camera, size: tuple[int, int]) -> None:
        self.size = size
        pixels = np.stack(np.meshgrid(*(np.arange(side, dtype=np.float64) for side in size)), axis=-1).reshape(-1, 1, 2)
        criteria = (cv2.TERM_CRITERIA_COUNT | cv2.TERM_CRITERIA_EPS, 40, 1e-9)
        rays = cv2.undistortPoints(pixels, camera.matrix, camera.distortion, criteria=criteria)
        self._rays = cv2.convertPointsToHomogeneous(rays)[:, 0].astype(np.float64)

    def picture(self, board: Board, pose: Pose) -> EightBit:
        """Return the picture of a board at a pose, (height, width) uint8."""
        # Homogeneous coordinates on the board's plane, in squares.
        on_board = self._rays @ np.linalg.inv(np.column_stack((pose.rotation[:, :2], pose.translation))).T
        with np.errstate(divide="ignore", invalid="ignore"):
            # The first inner corner is the origin; pixel centres are at whole numbers.
            printed_px = (on_board[:, :2] / on_board[:, 2:] + (1 + MARGIN_SQUARES)) * SQUARE_PX - 0.5
        printed_px[~(on_board[:, 2] > 0)] = -FAR_OUTSIDE_PX
        width, height = self.size
        maps = np.clip(printed_px, -FAR_OUTSIDE_PX, FAR_OUTSIDE_PX).reshape(height, width, 2).astype(np.float32)
        fine_size = (RAYS_PER_PIXEL * width, RAYS_PER_PIXEL * height)
        across, down = (cv2.resize(maps[..., axis], fine_size, interpolation=cv2.INTER_LINEAR) for axis in (0, 1))
        fine = cv2.remap(
            _printed(board),
            across,
            down,
            cv2.INTER_LINEAR,
            borderMode=cv2.BORDER_CONSTANT,
            borderValue=BACKGROUND_LEVEL,
        )
        return np.asarray(cv2.resize(fine, self.size, interpolation=cv2.INTER_AREA), dtype=np.uint8)


@functools.lru_cache(maxsize=4)
def _printed(board: Board) -> EightBit:
    """Return the board's picture in the grey levels of ink and paper."""
    return np.where(board_picture(board, SQUARE_PX) > 127, PAPER_LEVEL, INK_LEVEL).astype(np.uint8)


def drawn_pairs(
    rig: StereoRig,
    board: Board,
    count: int,
    *,
    square_m: float,
    seed: int = 0,
    partly: bool = False,
) -> Iterator[tuple[EightBit, EightBit]]:
    """Draw pairs of a board held at various positions and tilts in front of a stereo camera.

    The seed determines the positions, tilts and noise; `partly`: up to half of the board may be outside a picture.

    Raises
    ------
    ValueError
        A rig without a size, or one whose two cameras hardly share a view.
    """
    if rig.width is None or rig.height is None:
        raise ValueError("rig has no width and height; a picture needs its size.")
    random = np.random.default_rng(seed)
    size = rig.width, rig.height
    cameras = Camera(rig.left_matrix, rig.left_distortion), Camera(rig.right_matrix, rig.right_distortion)
    drawn = [DrawnCamera(camera, size) for camera in cameras]
    right_pose = Pose(rig.rotation, rig.translation / square_m)
    for number in range(count):
        poses = _random_poses(cameras, right_pose, size, board, random, number / max(1, count - 1), partly)
        left, right = (camera.picture(board, pose) for camera, pose in zip(drawn, poses, strict=True))
        yield _with_imaging_defects(left, random), _with_imaging_defects(right, random)


def _random_poses(
    cameras: tuple[Camera, Camera],
    right: Pose,
    size: tuple[int, int],
    board: Board,
    random: np.random.Generator,
    progress: float,
    partly: bool,
) -> tuple[Pose, Pose]:
    """Return random poses of a board, in squares, one in the frame of each camera, so that both see it.

    `right` is the pose of the right camera; `progress` the share of the pairs already drawn: if `partly`, no board is
    complete in a picture after the first 30 %.
    """
    matrix = cameras[0].matrix
    points = board.points()
    middle = points.mean(axis=0)
    for attempt in range(MAX_ATTEMPTS):
        turn = np.clip(random.normal(0, (0.35, 0.35, 0.2)), -MAX_TILT_RAD, MAX_TILT_RAD)
        rotation = np.asarray(cv2.Rodrigues(turn)[0], dtype=np.float64)
        # Later attempts are farther away and closer to the middle.
        ease = attempt / MAX_ATTEMPTS
        share = random.uniform(0.3, 0.6) * (1 - 0.5 * ease)
        distance = matrix[0, 0] * board.columns / (share * size[0])
        corner = random.uniform(-1, 1, 2) * (1 - ease)
        towards = corner * np.array(size) / 2 / np.diag(matrix)[:2]
        between = -0.5 * right.translation
        left_pose = Pose(rotation, np.array([*(towards * distance * 0.8), distance]) + between - rotation @ middle)
        poses, visible = (left_pose, right.compose(left_pose)), []
        for camera, pose in zip(cameras, poses, strict=True):
            image_points = camera.project(points, pose)
            border = 0.01 * size[0] + 0.2 * distance**-1 * camera.matrix[0, 0]
            inside = (image_points > border) & (image_points < np.array(size) - border)
            visible.append(float(inside.all(axis=1).mean()))
        if min(visible) >= (0.5 if partly else 1.0) and (not partly or progress < 0.3 or max(visible) < 1):
            return poses
    raise ValueError(
        f"The views of the two cameras hardly overlap: in {MAX_ATTEMPTS} places no board of "
        f"{board.columns} × {board.rows} corners was in both pictures."
    )


def _with_imaging_defects(picture: EightBit, random: np.random.Generator) -> EightBit:
    """Return a picture with light falling off to one side, lens blur and sensor noise."""
    first_gain, last_gain = 1 + random.uniform(-0.15, 0.15, 2)
    blurred = cv2.GaussianBlur(picture * np.linspace(first_gain, last_gain, picture.shape[1]), (0, 0), BLUR_PX)
    noisy = blurred + random.normal(0, NOISE_LEVELS, blurred.shape)
    return np.asarray(np.clip(np.rint(noisy), 0, 255), dtype=np.uint8)
