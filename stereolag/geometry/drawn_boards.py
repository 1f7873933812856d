"""Pictures of a calibration board, drawn as taken by a stereo camera of known geometry."""

from __future__ import annotations

import functools
from collections.abc import Iterator

import cv2
import numpy as np

from stereolag.geometry.boards import MARGIN_SQUARES, Board, Grey8, board_picture
from stereolag.geometry.calibration import StereoRig
from stereolag.geometry.camera_fits import Camera, Pose

FINER = 3
"""Rays per pixel, each way."""

FAR_OUTSIDE = 1e4
"""Position given to a ray that misses the board, px of the board."""

SQUARE_PX = 48
"""Side of a square on the board that the rays meet, px."""

BACKGROUND = 110
BLACK, WHITE = 25, 225
"""Grey levels of the background, and of the board's ink and paper."""

BLUR = 0.6
"""Standard deviation of the lens blur, px."""
NOISE = 2.0
"""Standard deviation of the sensor noise, grey levels."""

TRIES = 200

MOST_TILT = 0.6
"""Largest tilt about each axis, radians: a board seen more from the side is hardly found."""


class DrawnCamera:
    """A camera whose pictures, of so many px across and down, are drawn ray by ray, with its lens distortion."""

    def __init__(self, camera: Camera, size: tuple[int, int]) -> None:
        self.size = size
        places = np.stack(np.meshgrid(*(np.arange(side, dtype=np.float64) for side in size)), axis=-1).reshape(-1, 1, 2)
        criteria = (cv2.TERM_CRITERIA_COUNT | cv2.TERM_CRITERIA_EPS, 40, 1e-9)
        rays = cv2.undistortPoints(places, camera.matrix, camera.distortion, criteria=criteria)
        self._rays = cv2.convertPointsToHomogeneous(rays)[:, 0].astype(np.float64)

    def picture(self, board: Board, pose: Pose) -> Grey8:
        """Return the picture of a board at a pose, (height, width) uint8."""
        onto = self._rays @ np.linalg.inv(np.column_stack((pose.rotation[:, :2], pose.translation))).T
        with np.errstate(divide="ignore", invalid="ignore"):
            # The first inner corner is the origin; pixel centres are at whole numbers.
            places = (onto[:, :2] / onto[:, 2:] + (1 + MARGIN_SQUARES)) * SQUARE_PX - 0.5
        places[~(onto[:, 2] > 0)] = -FAR_OUTSIDE
        width, height = self.size
        maps = np.clip(places, -FAR_OUTSIDE, FAR_OUTSIDE).reshape(height, width, 2).astype(np.float32)
        fine = (FINER * width, FINER * height)
        across, down = (cv2.resize(one, fine, interpolation=cv2.INTER_LINEAR) for one in (maps[..., 0], maps[..., 1]))
        finer = cv2.remap(
            _printed(board),
            across,
            down,
            cv2.INTER_LINEAR,
            borderMode=cv2.BORDER_CONSTANT,
            borderValue=BACKGROUND,
        )
        return np.asarray(cv2.resize(finer, self.size, interpolation=cv2.INTER_AREA), dtype=np.uint8)


@functools.lru_cache(maxsize=4)
def _printed(board: Board) -> Grey8:
    """Return the board that the rays meet, in the grey levels of ink and paper."""
    return np.where(board_picture(board, SQUARE_PX) > 127, WHITE, BLACK).astype(np.uint8)


def drawn_pairs(
    rig: StereoRig,
    board: Board,
    count: int,
    *,
    square_m: float,
    seed: int = 0,
    partly: bool = False,
) -> Iterator[tuple[Grey8, Grey8]]:
    """Draw pairs of a board held at various positions and tilts in front of a stereo camera.

    The seed gives the positions, tilts and noise; `partly`: up to half of the board may be outside a picture.

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
    beside = Pose(rig.rotation, rig.translation / square_m)
    for number in range(count):
        poses = _poses(cameras, beside, size, board, random, number / max(1, count - 1), partly)
        left, right = (_taken(camera.picture(board, pose), random) for camera, pose in zip(drawn, poses, strict=True))
        yield left, right


def _poses(
    cameras: tuple[Camera, Camera],
    right: Pose,
    size: tuple[int, int],
    board: Board,
    random: np.random.Generator,
    part: float,
    partly: bool,
) -> tuple[Pose, Pose]:
    """Return the poses, in squares, of a board that both cameras see, the second of which stands at `right`."""
    matrix = cameras[0].matrix
    points = board.points()
    middle = points.mean(axis=0)
    for attempt in range(TRIES):
        turn = np.clip(random.normal(0, (0.35, 0.35, 0.2)), -MOST_TILT, MOST_TILT)
        rotation = np.asarray(cv2.Rodrigues(turn)[0], dtype=np.float64)
        # Later attempts are farther away and closer to the middle.
        ease = attempt / TRIES
        share = random.uniform(0.3, 0.6) * (1 - 0.5 * ease)
        distance = matrix[0, 0] * board.columns / (share * size[0])
        corner = random.uniform(-1, 1, 2) * (1 - ease)
        towards = corner * np.array(size) / 2 / np.diag(matrix)[:2]
        between = -0.5 * right.translation
        first = Pose(rotation, np.array([*(towards * distance * 0.8), distance]) + between - rotation @ middle)
        poses, seen = (first, right.beside(first)), []
        for camera, pose in zip(cameras, poses, strict=True):
            places = camera.projected(points, pose)
            border = 0.01 * size[0] + 0.2 * distance**-1 * camera.matrix[0, 0]
            seen.append(float(((places > border) & (places < np.array(size) - border)).all(axis=1).mean()))
        if min(seen) >= (0.5 if partly else 1.0) and (not partly or part < 0.3 or max(seen) < 1):
            return poses
    raise ValueError(
        f"The views of the two cameras hardly overlap: in {TRIES} places no board of {board.columns} × {board.rows} "
        "corners was in both pictures."
    )


def _taken(picture: Grey8, random: np.random.Generator) -> Grey8:
    """Return a picture with light falling off to one side, lens blur and sensor noise."""
    start, end = 1 + random.uniform(-0.15, 0.15, 2)
    real = cv2.GaussianBlur(picture * np.linspace(start, end, picture.shape[1]), (0, 0), BLUR)
    return np.asarray(np.clip(np.rint(real + random.normal(0, NOISE, real.shape)), 0, 255), dtype=np.uint8)
