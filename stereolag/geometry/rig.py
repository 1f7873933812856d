"""Two cameras before rectification, and the bounds of all numbers in a calibration."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import numpy.typing as npt

FOCAL_PX = (1e-3, 1e7)
BASELINE_M = (1e-9, 1e9)
MAX_CENTRE_PX = 1e7
MAX_DISTORTION = 1e9
"""From the cameras of a microscope to those of two satellites; beyond that, products overflow or lose all meaning."""


LARGEST_ROW_DIFFERENCE_PX = 0.1
LARGEST_TURN_LEFT = 0.02
"""Limits after rectification: rows farther apart, px, or cameras turned more against each other, radians, do not
match."""


@dataclass(frozen=True, eq=False)
class Rectification:
    """The rectification of a pair (R1, R2, P1 and P2 of OpenCV's ``stereoRectify``).

    Attributes
    ----------
    left_rotation, right_rotation
        (3, 3): from the frame of each camera to that of the rectified pair.
    left_projection, right_projection
        (3, 4), px: onto the rectified images; the right one has ``-focal * baseline`` (metres) at [0, 3].
    """

    left_rotation: npt.NDArray[np.float64]
    right_rotation: npt.NDArray[np.float64]
    left_projection: npt.NDArray[np.float64]
    right_projection: npt.NDArray[np.float64]

    def __post_init__(self) -> None:
        for name in ("left_rotation", "right_rotation"):
            set_array(self, name, (3, 3), 10.0)
            check_rotation(getattr(self, name), name)
        for name in ("left_projection", "right_projection"):
            set_array(self, name, (3, 4), FOCAL_PX[1] * BASELINE_M[1])
            check_range(float(getattr(self, name)[0, 0]), f"The focal length in {name}", FOCAL_PX)
        rows = self.left_projection[1] - self.right_projection[1]
        if np.abs(rows).max() > LARGEST_ROW_DIFFERENCE_PX:
            raise ValueError(
                f"left_projection and right_projection differ in their second row by {np.abs(rows).max():g}; the rows "
                "of such a pair do not match."
            )

    @property
    def baseline_m(self) -> float:
        """Return the distance between the cameras, metres."""
        return float(self.left_projection[0, 3] - self.right_projection[0, 3]) / float(self.left_projection[0, 0])

    def scaled(self, factor: float) -> Rectification:
        """Return the rectification for images resized by `factor`."""
        return replace(
            self,
            left_projection=_scaled_matrix(self.left_projection, factor),
            right_projection=_scaled_matrix(self.right_projection, factor),
        )


@dataclass(frozen=True, eq=False)
class StereoRig:
    """Two cameras as calibrated, before rectification (the model of OpenCV's ``stereoCalibrate``).

    Attributes
    ----------
    left_matrix, right_matrix
        (3, 3) camera matrices, px.
    left_distortion, right_distortion
        (4 | 5 | 8 | 12 | 14,) coefficients k1, k2, p1, p2, …; none at all for no distortion.
    rotation, translation
        (3, 3) and (3,), metres: a point at ``x`` in the left camera's frame is at ``rotation @ x + translation`` in the
        right one's, so ``translation[0]`` is negative.
    width, height
        Size of the images that the matrices are for, px; None if unknown.
    rectification
        How its maker rectified the pair; None if unknown.
    """

    left_matrix: npt.NDArray[np.float64]
    left_distortion: npt.NDArray[np.float64]
    right_matrix: npt.NDArray[np.float64]
    right_distortion: npt.NDArray[np.float64]
    rotation: npt.NDArray[np.float64]
    translation: npt.NDArray[np.float64]
    width: int | None = None
    height: int | None = None
    rectification: Rectification | None = None

    def __post_init__(self) -> None:
        set_array(self, "left_matrix", (3, 3))
        set_array(self, "right_matrix", (3, 3))
        set_array(self, "rotation", (3, 3), 10.0)
        set_array(self, "translation", (3,), BASELINE_M[1])
        for name in ("left_distortion", "right_distortion"):
            size = np.size(getattr(self, name))
            if size not in (0, 4, 5, 8, 12, 14):
                raise ValueError(f"{name} holds {size} coefficients; allowed are 0, 4, 5, 8, 12 and 14.")
            set_array(self, name, (size,), MAX_DISTORTION)
            if size == 0:
                object.__setattr__(self, name, np.zeros(5))
        for name in ("left_matrix", "right_matrix"):
            matrix = getattr(self, name)
            if not (matrix[0, 0] > 0 and matrix[1, 1] > 0 and np.array_equal(matrix[2], (0, 0, 1))):
                raise ValueError(f"{name} is not [[f, 0, cx], [0, f, cy], [0, 0, 1]] with focal lengths above 0.")
            for focal in (matrix[0, 0], matrix[1, 1]):
                check_range(float(focal), f"The focal length in {name}", FOCAL_PX)
        check_rotation(self.rotation, "rotation")
        if not -self.translation[0] > abs(self.translation[1]):
            raise ValueError(
                f"translation is {self.translation.tolist()} m; its first number must be negative and outweigh "
                "the second: the second camera stands to the right of the first."
            )

        if self.rectification is not None:
            self._check(self.rectification)

    def _check(self, given: Rectification) -> None:
        """Refuse a rectification of other cameras than these."""
        left_over = given.right_rotation @ self.rotation @ given.left_rotation.T - np.eye(3)
        if np.abs(left_over).max() > LARGEST_TURN_LEFT:
            raise ValueError(
                "The rectification (R1, R2) does not fit the rotation (R) between the cameras: it leaves them turned "
                f"by {math.degrees(np.abs(left_over).max()):.1f}° relative to each other; leave one of them out."
            )

    def scaled(self, factor: float) -> StereoRig:
        """Return the rig for images resized by `factor`."""
        check_positive(factor, "factor")
        return replace(
            self,
            left_matrix=_scaled_matrix(self.left_matrix, factor),
            right_matrix=_scaled_matrix(self.right_matrix, factor),
            width=scaled_size(self.width, factor),
            height=scaled_size(self.height, factor),
            rectification=None if self.rectification is None else self.rectification.scaled(factor),
        )


def set_array(owner: Any, name: str, shape: tuple[int, ...], most: float = MAX_CENTRE_PX) -> None:
    """Convert a named attribute of a frozen owner to an array of `shape`; ValueError if that is not possible."""
    array = np.array(getattr(owner, name), dtype=np.float64)
    if array.size != math.prod(shape) or not np.isfinite(array).all():
        raise ValueError(f"{name} has shape {array.shape}; allowed are {math.prod(shape)} finite numbers, {shape}.")
    largest = max(array.flat, key=abs, default=0.0)
    if abs(largest) > most:
        raise ValueError(f"{name} holds {largest:g}; allowed are numbers from -{most:g} to {most:g}.")
    object.__setattr__(owner, name, array.reshape(shape))


def check_rotation(rotation: npt.NDArray[np.float64], name: str) -> None:
    """Refuse a (3, 3) matrix that is not a rotation."""
    if not np.allclose(rotation @ rotation.T, np.eye(3), atol=1e-3) or np.linalg.det(rotation) < 0:
        raise ValueError(f"{name} is not a rotation: its rows must be orthogonal and of length 1.")


def check_positive(value: float, name: str) -> None:
    """Refuse a number that is not finite and above 0."""
    if not (value > 0 and math.isfinite(value)):
        raise ValueError(f"{name} is {value}; allowed are finite numbers above 0.")


def check_range(value: float, name: str, bounds: tuple[float, float]) -> None:
    """Refuse a number outside its bounds."""
    check_positive(value, name)
    if not bounds[0] <= value <= bounds[1]:
        raise ValueError(f"{name} is {value:g}; allowed are {bounds[0]:g} to {bounds[1]:g}.")


def scaled_centre(centre: float, factor: float) -> float:
    """Return a principal point (px, pixel centres at whole numbers) in an image resized by `factor`."""
    return (centre + 0.5) * factor - 0.5


def scaled_size(size: int | None, factor: float) -> int | None:
    """Return a side of an image resized by `factor`, px; None if it is unknown."""
    return None if size is None else max(1, round(size * factor))


def _scaled_matrix(matrix: npt.NDArray[np.float64], factor: float) -> npt.NDArray[np.float64]:
    scaled = matrix * factor
    scaled[:2, 2] = (matrix[:2, 2] + 0.5) * factor - 0.5
    scaled[2] = matrix[2]
    return scaled
