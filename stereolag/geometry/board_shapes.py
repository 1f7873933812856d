"""The shape of a calibration board, measured in its pictures: paper on cardboard is neither flat nor evenly printed."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from functools import partial

import cv2
import numpy as np
import scipy  # scipy.spatial is loaded only on first use: the quick judgement of a pair does not need it

from stereolag.core.arrays import DoubleMap
from stereolag.geometry.boards import Board, Corners
from stereolag.geometry.camera_fits import (
    FIT_CRITERIA,
    MIN_PICTURES_TO_VALIDATE,
    Camera,
    Observation,
    SeparateFits,
    fit_camera,
)

BothCorners = Mapping[int, tuple[Corners, Corners]]
"""The corners in the left and the right picture of each pair, by its number."""

MIN_SHAPE_CORRELATION = 0.7
"""Minimum correlation of the shapes that the two cameras measure independently: simulated boards have at most 0.3 if
flat, 0.6 if printed unevenly, and at least 0.9 if bent."""

MIN_STRETCH = 0.003
"""Minimum relative difference of the focal lengths across and down that suggests squares higher than wide, or lower;
both cameras must have it."""

MAX_ERROR_RATIO = 0.9
"""The shape measured by one camera must lower the other one's error to this share of it."""


def observations_of(both: BothCorners, board: Board) -> list[list[Observation]]:
    """Return the observations of each camera, of a board taken to be flat, in the order of the pairs."""
    points = board.points()
    return [[Observation(points[pair[side].numbers], pair[side].points) for pair in both.values()] for side in (0, 1)]


def seems_bent(board: Board, both: BothCorners, fits: SeparateFits) -> bool:
    """Return whether the residuals of cameras fitted to a flat board suggest a bent one: both show the same shape."""
    left, right = (
        _residual_shape(board, observations, camera).ravel()
        for observations, camera in zip(_inliers(both, board, fits), (fits.left, fits.right), strict=True)
    )
    return float(np.corrcoef(left, right)[0, 1]) > MIN_SHAPE_CORRELATION


def measured_shape(
    board: Board, both: BothCorners, size: tuple[int, int], fits: SeparateFits, *, bent: bool
) -> tuple[DoubleMap, BothCorners] | None:
    """Return the shape of a board and its corners as if it were flat; None if it seems flat or cannot be measured.

    Each camera measures the shape in its own pictures, together with its lens (Strobl, Hirzinger, *More accurate
    pinhole camera calibration with imperfect planar target*, ICCV workshops 2011, by OpenCV). The shape is accepted if
    both agree: the shape measured by one camera must predict the pictures of the other.

    Parameters
    ----------
    board
        The board.
    both
        Its corners in the pictures.
    size
        Width and height of the pictures.
    fits
        The cameras fitted to a flat board.
    bent
        Whether it seems bent. If not, it is measured only if its squares seem higher than wide, or lower.

    Returns
    -------
    points
        (n, 3) positions of the corners, in squares, aligned with those of the flat board.
    flattened
        The corners in the pictures, moved to where a flat board would have them: OpenCV's fits are reliable only for
        flat boards.
    """
    whole = [
        [observation for observation in observations if len(observation.image_points) == board.corners]
        for observations in _inliers(both, board, fits)
    ]
    stretches = [float(camera.matrix[0, 0] / camera.matrix[1, 1] - 1) for camera in (fits.left, fits.right)]
    stretched = max(min(stretches), -max(stretches)) > MIN_STRETCH
    if min(map(len, whole)) < MIN_PICTURES_TO_VALIDATE or not (stretched or bent):
        return None
    try:
        with ThreadPoolExecutor() as threads:
            measured = threads.map(partial(_measure_shape, board, size=size, flags=fits.flags), whole)
            (left_shape, left_camera), (right_shape, right_camera) = measured
        for observations, camera, shape in (
            (whole[0], left_camera, right_shape),
            (whole[1], right_camera, left_shape),
        ):
            flattened = [
                Observation(flat, _flat_positions(camera, flat, shape, image_points))
                for flat, image_points in observations
            ]
            before, after = (
                float(np.square(fit_camera(one, size, fits.flags)[2]).mean()) for one in (observations, flattened)
            )
            if after > MAX_ERROR_RATIO**2 * before:
                return None
    except (cv2.error, ValueError):  # the pictures determine a camera, but not the shape as well
        return None
    points = np.asarray(np.mean((left_shape, right_shape), axis=0))
    once = _inliers(_flattened(both, board, points, (left_camera, right_camera)), board, fits)
    refitted = [fit_camera(observations, size, fits.flags)[0] for observations in once]
    return points, _flattened(both, board, points, refitted)


def _inliers(both: BothCorners, board: Board, fits: SeparateFits) -> list[list[Observation]]:
    """Return the observations of each camera without the outliers."""
    return [
        [observation for number, observation in enumerate(observations) if number not in outliers]
        for observations, outliers in zip(observations_of(both, board), fits.outliers, strict=True)
    ]


def _flattened(both: BothCorners, board: Board, points: DoubleMap, cameras: Sequence[Camera]) -> BothCorners:
    """Return where the cameras would see the corners of a board, whose shape is `points`, if it were flat."""
    flat = board.points()

    def flatten(corners: Corners, camera: Camera) -> Corners:
        numbers = corners.numbers
        return Corners(numbers, _flat_positions(camera, flat[numbers], points[numbers], corners.points))

    return {number: (flatten(left, cameras[0]), flatten(right, cameras[1])) for number, (left, right) in both.items()}


def _flat_positions(camera: Camera, flat: DoubleMap, points: DoubleMap, image_points: DoubleMap) -> DoubleMap:
    """Return where a camera would see the points of a flat board, (n, 2) px, given where it sees the real ones."""
    pose = camera.pose(points, image_points)
    return image_points + camera.project(flat, pose) - camera.project(points, pose)


def _residual_shape(board: Board, observations: Sequence[Observation], camera: Camera) -> DoubleMap:
    """Return each corner's offset from its grid, (n, 3) squares, by least squares for the camera and its poses."""
    normal, right_hand_side = np.zeros((board.corners, 3, 3)), np.zeros((board.corners, 3))
    for points, image_points in observations:
        numbers = (points @ (1, board.columns, 0)).astype(np.intp)
        pose = camera.pose(points, image_points)
        residual, jacobian = image_points - camera.project(points, pose), camera.jacobian(points, pose)
        normal[numbers] += np.einsum("nij,nik->njk", jacobian, jacobian)
        right_hand_side[numbers] += np.einsum("nij,ni->nj", jacobian, residual)
    return np.asarray(np.einsum("nij,nj->ni", np.linalg.pinv(normal, hermitian=True), right_hand_side))


def _measure_shape(
    board: Board, observations: Sequence[Observation], *, size: tuple[int, int], flags: int
) -> tuple[DoubleMap, Camera]:
    """Return the shape of a board that one camera measures, and the camera.

    The shape is aligned with the flat board by rotation, translation and scale.
    """
    points = [observation.points.astype(np.float32) for observation in observations]
    image_points = [observation.image_points.astype(np.float32) for observation in observations]
    fixed = board.columns - 1
    _, matrix, distortion, _, _, found = cv2.calibrateCameraRO(
        points, image_points, size, fixed, np.eye(3), np.zeros(14), flags=flags, criteria=FIT_CRITERIA
    )
    flat = board.points()
    middle = flat.mean(axis=0)
    shape = np.asarray(found, dtype=np.float64).reshape(-1, 3)
    shape = shape - shape.mean(axis=0)
    turn, _ = scipy.spatial.transform.Rotation.align_vectors(flat - middle, shape)
    shape = turn.apply(shape)
    shape = np.asarray(shape * (np.vdot(flat - middle, shape) / np.vdot(shape, shape)) + middle)
    return shape, Camera(np.asarray(matrix, dtype=np.float64), np.asarray(distortion, dtype=np.float64).ravel())
