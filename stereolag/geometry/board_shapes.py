"""The shape of a calibration board, measured in the pictures of it: paper on cardboard is neither flat nor even."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from functools import partial

import cv2
import numpy as np
import scipy  # scipy.spatial is loaded only on first use: the quick judgement of a pair does not need it

from stereolag.core.arrays import DoubleMap
from stereolag.geometry.boards import Board, Corners
from stereolag.geometry.camera_fits import CONVERGED, ENOUGH_TO_LEAVE_OUT, Camera, SeparateFits, Sight, fitted_camera

BothCorners = Mapping[int, tuple[Corners, Corners]]
"""The corners in the left and the right picture of each pair, by its number."""

ALIKE = 0.7
"""Least correlation of the shapes that both cameras see in a board, each by itself: simulated boards have at most 0.3
if flat, 0.6 if printed unevenly, and at least 0.9 if bent."""

UNEQUAL_SIDES = 0.003
"""Difference of the focal lengths across and down, as a share: both cameras have it if squares are higher than wide."""

WORTHWHILE = 0.9
"""The shape that one camera has measured must lower the error of the other one to this share."""


def sights_of(both: BothCorners, board: Board) -> list[list[Sight]]:
    """Return what each camera sees of a flat board, in the order of the pairs."""
    points = board.points()
    return [[Sight(points[pair[side].numbers], pair[side].points) for pair in both.values()] for side in (0, 1)]


def seems_bent(board: Board, both: BothCorners, fits: SeparateFits) -> bool:
    """Return whether what cameras fitted to a flat board leave over may come from its shape: both see the same one."""
    kept = _kept(both, board, fits)
    first, second = (
        _shape_left_over(board, sights, camera).ravel()
        for sights, camera in zip(kept, (fits.left, fits.right), strict=True)
    )
    return float(np.corrcoef(first, second)[0, 1]) > ALIKE


def measured_shape(
    board: Board, both: BothCorners, size: tuple[int, int], fits: SeparateFits, *, bent: bool
) -> tuple[DoubleMap, BothCorners] | None:
    """Return where the corners of a board are, and where they would be seen if it were flat; None if it seems to be.

    Each camera measures the shape in its own pictures, together with its lens (Strobl, Hirzinger, *More accurate
    pinhole camera calibration with imperfect planar target*, ICCV workshops 2011, by OpenCV). It counts if both find
    the same: the shape of one must predict the pictures of the other.

    Parameters
    ----------
    board
        The board, of which the shape is in question.
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
        (n, 3) places of the corners, in squares, laid over those of the flat board.
    flattened
        The corners in the pictures, moved to where a flat board has them: OpenCV's fits are sure for those alone.
    """
    whole = [[sight for sight in sights if len(sight.places) == board.corners] for sights in _kept(both, board, fits)]
    unequal = [float(camera.matrix[0, 0] / camera.matrix[1, 1] - 1) for camera in (fits.left, fits.right)]
    stretched = max(min(unequal), -max(unequal)) > UNEQUAL_SIDES
    if min(map(len, whole)) < ENOUGH_TO_LEAVE_OUT or not (stretched or bent):
        return None
    try:
        with ThreadPoolExecutor() as aside:
            (left, first), (right, second) = aside.map(partial(_measured, board, size=size, flags=fits.flags), whole)
        for sights, camera, shape in ((whole[0], first, right), (whole[1], second, left)):
            moved = [Sight(points, _flat_places(camera, points, shape, places)) for points, places in sights]
            before, after = (
                float(np.square(fitted_camera(one, size, fits.flags)[2]).mean()) for one in (sights, moved)
            )
            if after > WORTHWHILE**2 * before:
                return None
    except (cv2.error, ValueError):  # the pictures determine a camera, and no more than that
        return None
    points = np.asarray(np.mean((left, right), axis=0))
    once = _kept(_flattened(both, board, points, (first, second)), board, fits)
    refitted = [fitted_camera(sights, size, fits.flags)[0] for sights in once]
    return points, _flattened(both, board, points, refitted)


def _kept(both: BothCorners, board: Board, fits: SeparateFits) -> list[list[Sight]]:
    """Return what each camera sees of a flat board, without the pictures that do not show it."""
    return [
        [sight for number, sight in enumerate(sights) if number not in out]
        for sights, out in zip(sights_of(both, board), fits.outliers, strict=True)
    ]


def _flattened(both: BothCorners, board: Board, points: DoubleMap, cameras: Sequence[Camera]) -> BothCorners:
    """Return where the cameras would see the corners of a board if it were flat."""
    flat = board.points()

    def moved(corners: Corners, camera: Camera) -> Corners:
        numbers = corners.numbers
        return Corners(numbers, _flat_places(camera, flat[numbers], points[numbers], corners.points))

    return {number: (moved(left, cameras[0]), moved(right, cameras[1])) for number, (left, right) in both.items()}


def _flat_places(camera: Camera, flat: DoubleMap, points: DoubleMap, places: DoubleMap) -> DoubleMap:
    """Return where a camera that sees the points of a board at some places would see those of a flat one, (n, 2) px."""
    pose = camera.pose(points, places)
    return places + camera.projected(flat, pose) - camera.projected(points, pose)


def _shape_left_over(board: Board, sights: Sequence[Sight], camera: Camera) -> DoubleMap:
    """Return how far off its place each corner of a board is if the camera and its poses are right, (n, 3) squares."""
    normal, against = np.zeros((board.corners, 3, 3)), np.zeros((board.corners, 3))
    for points, places in sights:
        numbers = (points @ (1, board.columns, 0)).astype(np.intp)
        pose = camera.pose(points, places)
        seen, slopes = camera.projected(points, pose), camera.slopes(points, pose)
        normal[numbers] += np.einsum("nij,nik->njk", slopes, slopes)
        against[numbers] += np.einsum("nij,ni->nj", slopes, places - seen)
    return np.asarray(np.einsum("nij,nj->ni", np.linalg.pinv(normal, hermitian=True), against))


def _measured(board: Board, sights: Sequence[Sight], *, size: tuple[int, int], flags: int) -> tuple[DoubleMap, Camera]:
    """Return the shape of a board that one camera measures, laid over the flat one and as large on average, and it."""
    points = [sight.points.astype(np.float32) for sight in sights]
    places = [sight.places.astype(np.float32) for sight in sights]
    fixed = board.columns - 1
    _, matrix, distortion, _, _, found = cv2.calibrateCameraRO(
        points, places, size, fixed, np.eye(3), np.zeros(14), flags=flags, criteria=CONVERGED
    )
    flat = board.points()
    middle = flat.mean(axis=0)
    shape = np.asarray(found, dtype=np.float64).reshape(-1, 3)
    shape = shape - shape.mean(axis=0)
    turn, _ = scipy.spatial.transform.Rotation.align_vectors(flat - middle, shape)
    shape = turn.apply(shape)
    shape = np.asarray(shape * (np.vdot(flat - middle, shape) / np.vdot(shape, shape)) + middle)
    return shape, Camera(np.asarray(matrix, dtype=np.float64), np.asarray(distortion, dtype=np.float64).ravel())
