"""Our own motion between two frames: the rigid motion that most of the scene agrees with."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
import numpy.typing as npt

from stereolag.core.arrays import DoubleMap, FloatMap, Mask
from stereolag.core.inputs import Image, as_grey
from stereolag.geometry.calibration import Calibration

MOST_POINTS = 4000
"""Most points used, taken evenly over the image; more do not improve the motion."""

CELL = 8
"""Side of the image cells that contribute their best pixel each, if the image is given, px."""

FLAT_SHARE = 0.3
"""Share of the cells left out, those with the least structure: flow is least accurate without texture."""

LEAST_DISPARITY = 2.0
"""Least disparity used, px: farther points agree with any translation and would outvote near ones."""

FEWEST_POINTS = 20
TRIALS, CONFIDENCE = 500, 0.9999

Points = npt.NDArray[np.float64]
"""(H, W, 3) metres: X to the right, Y down, Z forward; NaN = none."""


@dataclass(frozen=True, eq=False)
class OwnMotion:
    """Motion of the static world in camera coordinates: ``X2 = rotation @ X1 + translation``.

    Attributes
    ----------
    rotation
        (3, 3).
    translation
        (3,) metres.
    inliers
        Share of the pixels used that agree, 0..1.
    """

    rotation: npt.NDArray[np.float64]
    translation: npt.NDArray[np.float64]
    inliers: float

    @property
    def travelled(self) -> npt.NDArray[np.float64]:
        """Return the camera's displacement in first-frame coordinates, (3,) metres: X right, Y down, Z forward."""
        return np.asarray(-self.rotation.T @ self.translation)

    def moved(self, points: Points) -> Points:
        """Return the positions of static points in camera coordinates at the second frame."""
        return np.asarray(points @ self.rotation.T + self.translation)


def camera_matrix(calibration: Calibration, shape: tuple[int, int]) -> npt.NDArray[np.float64]:
    """Return the (3, 3) matrix of the left camera for images of (rows, cols)."""
    cx, cy = calibration.centre(shape[1], shape[0])
    return np.array([[calibration.focal_px, 0, cx], [0, calibration.focal_px, cy], [0, 0, 1]])


def seen_points(
    calibration: Calibration,
    disparity: FloatMap,
    row: FloatMap,
    col: FloatMap,
    matrix: npt.NDArray[np.float64] | None = None,
) -> Points:
    """Return the points at (row, col) in the left image with a disparity, px; `matrix` defaults to the camera's."""
    if matrix is None:
        matrix = camera_matrix(calibration, (disparity.shape[0], disparity.shape[1]))
    depth = calibration.depth(disparity).astype(np.float64)
    x, y = (col - matrix[0, 2]) * depth, (row - matrix[1, 2]) * depth
    return np.stack([x / calibration.focal_px, y / calibration.focal_px, depth], axis=-1)


def projected(points: Points, matrix: npt.NDArray[np.float64]) -> tuple[DoubleMap, DoubleMap]:
    """Return the (row, col) at which points are seen; NaN behind the camera."""
    depth = np.where(points[..., 2] > 0, points[..., 2], np.nan)
    row = matrix[1, 2] + matrix[1, 1] * points[..., 1] / depth
    col = matrix[0, 2] + matrix[0, 0] * points[..., 0] / depth
    return np.asarray(row), np.asarray(col)


def estimate_own_motion(
    points: Points,
    row: FloatMap,
    col: FloatMap,
    matrix: npt.NDArray[np.float64],
    *,
    tolerance: float,
    farthest: float = np.inf,
    image: Image | None = None,
) -> OwnMotion:
    """Return the rigid motion that takes most points to their positions in the second frame.

    Parameters
    ----------
    points
        (H, W, 3) metres, seen in the first frame; NaN = none.
    row, col
        (H, W) image positions of the same points in the second frame, px; NaN = none.
    matrix
        (3, 3) camera matrix.
    tolerance
        Largest reprojection error of a static point, px.
    farthest
        Largest depth used, metres.
    image
        (H, W) or (H, W, 3 | 4), the first frame: if given, its corners are used, otherwise evenly spread pixels.

    Raises
    ------
    ValueError
        If there are fewer than 20 points, or not enough of them agree on a motion.

    Notes
    -----
    Perspective-n-point by RANSAC, refined with Levenberg-Marquardt on all inliers (OpenCV's ``solvePnPRansac`` and
    ``solvePnPRefineLM``). OpenCV seeds its random numbers anew in each call, so the result is deterministic.
    """
    known: Mask = np.isfinite(points).all(axis=2) & np.isfinite(row) & np.isfinite(col) & (points[..., 2] < farthest)
    places = np.flatnonzero(known) if image is None else corners(image, known)
    if places.size < FEWEST_POINTS:
        raise ValueError(f"Only {places.size} pixels have both depth and motion; at least {FEWEST_POINTS} are needed.")
    chosen = places[np.linspace(0, places.size - 1, min(places.size, MOST_POINTS)).astype(np.intp)]
    world = points.reshape(-1, 3)[chosen]
    seen = np.column_stack([col.reshape(-1)[chosen], row.reshape(-1)[chosen]]).astype(np.float64)
    found, turn, shift, agreeing = cv2.solvePnPRansac(
        world,
        seen,
        matrix,
        None,
        iterationsCount=TRIALS,
        reprojectionError=tolerance,
        confidence=CONFIDENCE,
        flags=cv2.SOLVEPNP_P3P,
    )
    if not found or agreeing is None or len(agreeing) < FEWEST_POINTS:
        raise ValueError("No rigid motion explains the flow: nothing static seems to be in view.")
    for _ in range(3):
        turn, shift = cv2.solvePnPRefineLM(world[agreeing[:, 0]], seen[agreeing[:, 0]], matrix, None, turn, shift)
        rotation = np.asarray(cv2.Rodrigues(turn)[0], np.float64)
        expected = projected(world @ rotation.T + shift[:, 0], matrix)
        error = np.hypot(expected[1] - seen[:, 0], expected[0] - seen[:, 1])
        agreeing = np.flatnonzero(error < tolerance)[:, None]
        if len(agreeing) < FEWEST_POINTS:
            raise ValueError("No rigid motion explains the flow: nothing static seems to be in view.")
    return OwnMotion(rotation, np.asarray(shift[:, 0], np.float64), len(agreeing) / len(chosen))


def corners(image: Image, known: Mask) -> npt.NDArray[np.intp]:
    """Return the flat indices of the best corner of every cell among the known pixels.

    The smaller eigenvalue of the structure tensor measures how distinct a window is from its neighbours (Shi & Tomasi,
    "Good features to track", CVPR 1994).
    """
    grey = cv2.GaussianBlur(as_grey(image).astype(np.float32), (0, 0), 1.0)
    strength = np.where(known, cv2.cornerMinEigenVal(grey, 7), np.float32(-1))
    rows, cols = (side // CELL for side in strength.shape)
    cells = strength[: rows * CELL, : cols * CELL].reshape(rows, CELL, cols, CELL).swapaxes(1, 2)
    flat = cells.reshape(rows, cols, CELL * CELL)
    best, strongest = flat.argmax(axis=2), flat.max(axis=2)
    there = strongest >= 0
    if not there.any():
        return np.empty(0, np.intp)
    there &= strongest >= np.quantile(strongest[there], FLAT_SHARE)
    row, col = np.nonzero(there)
    inside = best[there]
    found = (row * CELL + inside // CELL) * known.shape[1] + col * CELL + inside % CELL
    return np.asarray(found, np.intp)
