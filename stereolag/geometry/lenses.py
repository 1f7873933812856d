"""One camera from pictures of a board: its matrix, its lens distortion, and their uncertainty."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np

from stereolag.core.arrays import DoubleMap, Vector
from stereolag.geometry.boards import Corners
from stereolag.geometry.relative_poses import Camera

LENSES = {
    "k1, k2": cv2.CALIB_FIX_K3,
    "k1, k2, k3": 0,
    "rational": cv2.CALIB_RATIONAL_MODEL,
}
"""Models of lens distortion, each in addition to the tangential p1, p2, with OpenCV's flags, simplest first."""

WORTHWHILE = 0.97
"""A richer model must lower the error on left-out pictures to this share: it is wrong where there were no corners."""

FOLDS = 3
ENOUGH_TO_LEAVE_OUT = 6
WORTHWHILE_ON_ITS_OWN = 0.7
"""With fewer pictures none can be left out; on the pictures it is fitted to, a richer model is always a bit better."""

FARTHEST_OUTLIER = 5.0
LEAST_OUTLIER_PX = 1.5
"""A picture whose error exceeds this multiple of the median, and this many px, does not show a flat board."""


@dataclass(frozen=True, eq=False)
class Lens:
    """A camera determined from its own pictures.

    Attributes
    ----------
    camera
        Matrix and distortion.
    focal_error
        Standard error of the focal length, as a share of it.
    outliers
        Numbers of the pictures whose corners do not fit a flat board.
    """

    camera: Camera
    focal_error: float
    outliers: frozenset[int]


@dataclass(frozen=True, eq=False)
class Sight:
    """The corners of a board in one picture: (n, 3) on the board, in squares, and (n, 2) in the picture, px."""

    points: DoubleMap
    places: DoubleMap

    @classmethod
    def of(cls, corners: Corners, board_points: DoubleMap) -> Sight:
        """Return the corners found in a picture with their positions on the board."""
        return cls(board_points[corners.numbers], corners.points)


def calibrated_lens(sights: Sequence[Sight], size: tuple[int, int], flags: int) -> Lens:
    """Return the camera that took these pictures of a board.

    Parameters
    ----------
    sights
        At least three.
    size
        Width and height of the pictures, px.
    flags
        One of :data:`LENSES`.

    Raises
    ------
    ValueError
        Corners that do not determine a camera.
    """
    camera, focal_error, errors = _fitted(sights, size, flags)
    limit = max(LEAST_OUTLIER_PX, FARTHEST_OUTLIER * float(np.median(errors)))
    outliers = frozenset(np.flatnonzero(errors > limit).tolist())
    if outliers and len(sights) - len(outliers) >= 3:
        kept = [sight for number, sight in enumerate(sights) if number not in outliers]
        camera, focal_error, _ = _fitted(kept, size, flags)
    return Lens(camera, focal_error, outliers)


def suitable_lens(cameras: Sequence[Sequence[Sight]], size: tuple[int, int]) -> int:
    """Return the flags of the simplest model of :data:`LENSES` that predicts pictures it was not fitted to as well.

    In turn, every third picture is left out and predicted from the others, if there are enough.

    Parameters
    ----------
    cameras
        The pictures of each camera.
    size
        Width and height of the pictures, px.
    """
    enough = min(len(sights) for sights in cameras) >= ENOUGH_TO_LEAVE_OUT
    best, *richer = LENSES.values()
    least = _foretelling(cameras, size, best, FOLDS if enough else 1)
    for flags in richer:
        error = _foretelling(cameras, size, flags, FOLDS if enough else 1)
        if error < (WORTHWHILE if enough else WORTHWHILE_ON_ITS_OWN) * least:
            best, least = flags, error
    return best


def _foretelling(cameras: Sequence[Sequence[Sight]], size: tuple[int, int], flags: int, folds: int) -> float:
    """Return the median error on pictures left out, px; with a single fold none is left out."""
    errors = []
    for sights in cameras:
        for fold in range(folds):
            given = [sight for number, sight in enumerate(sights) if folds == 1 or number % folds != fold]
            try:
                camera, _, _ = _fitted(given, size, flags)
            except ValueError:
                return np.inf
            errors += [_error(sight, camera) for number, sight in enumerate(sights) if number % folds == fold]
    return float(np.median(errors))


def _error(sight: Sight, camera: Camera) -> float:
    """Return how far the corners are from where the camera would see them, px RMS, with the board at its best pose."""
    found, turn, place = cv2.solvePnP(sight.points, sight.places, camera.matrix, camera.distortion)
    if not found:
        return np.inf
    placed = cv2.projectPoints(sight.points, turn, place, camera.matrix, camera.distortion)[0][:, 0]
    return float(np.sqrt(np.square(placed - sight.places).sum(axis=1).mean()))


def _fitted(sights: Sequence[Sight], size: tuple[int, int], flags: int) -> tuple[Camera, float, DoubleMap]:
    """Return the camera, the standard error of its focal length as a share of it, and each picture's error, px RMS."""
    points = [sight.points.astype(np.float32) for sight in sights]
    places = [sight.places.astype(np.float32) for sight in sights]
    try:
        _, matrix, distortion, _, _, deviations, _, errors = cv2.calibrateCameraExtended(
            points, places, size, np.eye(3), np.zeros(14), flags=flags
        )
    except cv2.error as error:
        raise ValueError(
            f"{len(sights)} pictures of the board do not determine the camera: show it at more places and tilted more."
        ) from error
    numbers = (matrix, distortion, deviations)
    if not all(np.isfinite(one).all() for one in numbers) or matrix[0, 0] <= 0 or matrix[1, 1] <= 0:
        raise ValueError(
            f"{len(sights)} pictures of the board do not determine the camera: show it at more places and tilted more."
        )
    camera = Camera(np.asarray(matrix, dtype=np.float64), np.asarray(distortion, dtype=np.float64).ravel())
    focal_error = float(deviations[0, 0] / matrix[0, 0])
    return camera, focal_error, np.asarray(errors, dtype=np.float64).ravel()


def without_zeros(distortion: Vector) -> Vector:
    """Return distortion coefficients without the trailing zeros of richer models: 5, 8, 12 or 14."""
    last = int(np.flatnonzero(distortion).max(initial=0)) + 1
    return distortion[: next(count for count in (5, 8, 12, 14) if count >= last)]
