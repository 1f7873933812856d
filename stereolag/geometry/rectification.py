"""Rectification: from a pair as the cameras took it to one whose rows match (Bouguet's method, by OpenCV)."""

from __future__ import annotations

from typing import Any, NamedTuple, TypeAlias

import cv2
import numpy as np
import numpy.typing as npt

from stereolag.geometry.calibration import Calibration
from stereolag.geometry.rig import StereoRig
from stereolag.inputs import Image, as_image

MAX_ASPECT_ERROR_PX = 1.0
"""How much the height may differ from that of the calibrated images, resized to the same width."""


class Rectified(NamedTuple):
    """A rectified pair: its images, of the same size and type as taken, and its calibration."""

    left: Image
    right: Image
    calibration: Calibration


def rectify(left: npt.ArrayLike, right: npt.ArrayLike, calibration: Calibration) -> Rectified:
    """Undistort a pair and rotate both images so that matching points lie in the same row.

    Parameters
    ----------
    left, right
        (rows, cols) grey or (rows, cols, 3 | 4) RGB(A), as taken; uint8, uint16 or float; of one size. A size other
        than the calibration's, but of the same aspect ratio, scales the cameras.
    calibration
        With its ``rig``, the two cameras before rectification.

    Returns
    -------
    Rectified
        ``left``, ``right`` and ``calibration``, in this order. Only pixels that both cameras can have seen are in the
        frame (``alpha=0``); the calibration has neither distortion nor rig left, and ``doffs_px == 0``.

    Raises
    ------
    ValueError
        A calibration without a rig, images of different size, or of another aspect ratio than they were calibrated at.
    """
    if calibration.rig is None:
        raise ValueError(
            "calibration has no rig, the cameras before rectification: it is that of a pair that is rectified already."
        )
    images = as_image(left, "left"), as_image(right, "right")
    size = _common_size(*images)
    rig = _fitted(calibration.rig, size)
    rotations, projections = _rectification(rig, size)
    cameras = (rig.left_matrix, rig.left_distortion), (rig.right_matrix, rig.right_distortion)
    rectified = []
    for image, (matrix, distortion), rotation, projection in zip(images, cameras, rotations, projections, strict=True):
        maps = cv2.initUndistortRectifyMap(matrix, distortion, rotation, projection, size, cv2.CV_32FC1)
        rectified.append(np.asarray(cv2.remap(image, *maps, cv2.INTER_LINEAR)))
    return Rectified(rectified[0], rectified[1], _calibration(projections, size))


def rectified_calibration(rig: StereoRig, size: tuple[int, int]) -> Calibration:
    """Return the calibration of the pair that :func:`rectify` makes of images of `size` (width, height)."""
    return _calibration(_rectification(_fitted(rig, size), size)[1], size)


def _common_size(left: Image, right: Image) -> tuple[int, int]:
    (height, width), (right_height, right_width) = left.shape[:2], right.shape[:2]
    if (height, width) != (right_height, right_width):
        raise ValueError(
            f"left is {width} × {height} and right is {right_width} × {right_height} pixels; "
            "both images must have the same size."
        )
    return width, height


def _fitted(rig: StereoRig, size: tuple[int, int]) -> StereoRig:
    """Return the rig for images of `size`, which must have the shape it was calibrated for."""
    width, height = size
    if rig.width is None or rig.height is None or (rig.width, rig.height) == size:
        return rig
    factor = width / rig.width
    if abs(rig.height * factor - height) > MAX_ASPECT_ERROR_PX:
        raise ValueError(
            f"The images are {width} × {height} pixels and the cameras were calibrated at {rig.width} × {rig.height}: "
            "give the images in that size, or resized without cropping."
        )
    return rig.scaled(factor)


_Matrices: TypeAlias = tuple[npt.NDArray[Any], npt.NDArray[Any]]


def _rectification(rig: StereoRig, size: tuple[int, int]) -> tuple[_Matrices, _Matrices]:
    """Return the rotations (3, 3) and the projections (3, 4) of both cameras."""
    try:
        matrices = cv2.stereoRectify(
            rig.left_matrix,
            rig.left_distortion,
            rig.right_matrix,
            rig.right_distortion,
            size,
            rig.rotation,
            rig.translation[:, None],
            flags=cv2.CALIB_ZERO_DISPARITY,
            alpha=0,
        )
    except cv2.error as error:
        raise ValueError(
            "The two cameras cannot be rectified: their matrices, distortion or pose are far from a stereo camera's."
        ) from error
    left_rotation, right_rotation, left_projection, right_projection = (np.asarray(matrix) for matrix in matrices[:4])
    return (left_rotation, right_rotation), (left_projection, right_projection)


def _calibration(projections: _Matrices, size: tuple[int, int]) -> Calibration:
    left, right = projections
    focal = float(left[0, 0])
    return Calibration(
        focal_px=focal,
        baseline_m=float(-right[0, 3]) / focal,
        doffs_px=float(right[0, 2] - left[0, 2]),
        cx=float(left[0, 2]),
        cy=float(left[1, 2]),
        width=size[0],
        height=size[1],
    )
