"""Rectification of a pair as taken, so that its rows match (Bouguet's method, by OpenCV)."""

from __future__ import annotations

from typing import NamedTuple

import cv2
import numpy as np
import numpy.typing as npt

from stereolag.core.inputs import Image, as_image
from stereolag.geometry.calibration import Calibration
from stereolag.geometry.rig import Rectification, StereoRig

MAX_ASPECT_ERROR_PX = 1.0
"""Largest difference in height from the calibrated images resized to the same width."""


class Rectified(NamedTuple):
    """A rectified pair: its images, of the same size and type as taken, and its calibration.

    Examples
    --------
    >>> import numpy as np
    >>> import stereolag as sl
    >>> from stereolag.geometry.rig import StereoRig
    >>> camera = [[200, 0, 79.5], [0, 200, 59.5], [0, 0, 1]]  # px
    >>> rig = StereoRig(camera, [], camera, [], np.eye(3), [-0.1, 0, 0])
    >>> taken = np.zeros((120, 160), np.uint8)
    >>> pair = sl.rectify(taken, taken, sl.Calibration(200.0, 0.1, rig=rig))
    >>> pair.left.shape, round(pair.calibration.baseline_m, 3)  # (rows, cols), metres
    ((120, 160), 0.1)
    """

    left: Image
    """The left image, in the size and type as taken."""
    right: Image
    """The right image, likewise; every point is in the same row as in the left image."""
    calibration: Calibration
    """Calibration of the rectified pair, for its disparities."""


def rectify(
    left: npt.ArrayLike, right: npt.ArrayLike, calibration: Calibration, *, alpha: float | None = None
) -> Rectified:
    """Undistort a pair and rotate both images so that matching points lie in the same row.

    Parameters
    ----------
    left, right
        (rows, cols) grey or (rows, cols, 3 | 4) RGB(A), as taken; uint8, uint16 or float; of one size. A size other
        than the calibration's, but of the same aspect ratio, scales the cameras.
    calibration
        Calibration with a ``rig``, the two cameras before rectification.
    alpha
        Content of the frame: 0 only pixels that the cameras took, 1 all of them, with black around. None rectifies as
        the calibration's maker did (R1, R2, P1, P2), or as 0 if that is unknown.

    Returns
    -------
    Rectified
        ``left``, ``right`` and ``calibration``, in this order. The calibration no longer has distortion or a rig;
        ``doffs_px`` is 0 unless its maker rectified the pair otherwise.

    Raises
    ------
    ValueError
        A calibration without a rig, images of different sizes or of another aspect ratio than they were calibrated at,
        or an alpha outside 0 to 1.

    Examples
    --------
    Two cameras with the same lens, the right one 0.1 m beside the left one:

    >>> import numpy as np
    >>> import stereolag as sl
    >>> from stereolag.geometry.rig import StereoRig
    >>> camera, lens = [[200, 0, 79.5], [0, 200, 59.5], [0, 0, 1]], [-0.1, 0, 0, 0]  # px; k1, k2, p1, p2
    >>> rig = StereoRig(camera, lens, camera, lens, np.eye(3), [-0.1, 0, 0])
    >>> taken = np.random.default_rng(0).integers(0, 256, (120, 160), dtype=np.uint8)
    >>> left, right, calibration = sl.rectify(taken, taken, sl.Calibration(200.0, 0.1, rig=rig))
    >>> round(calibration.focal_px), round(calibration.baseline_m, 3)  # px, metres
    (198, 0.1)
    """
    if calibration.rig is None:
        raise ValueError(
            "calibration has no rig (the cameras before rectification): it is of a pair that is already rectified."
        )
    images = as_image(left, "left"), as_image(right, "right")
    size = _common_size(*images)
    rig = _fitted(calibration.rig, size)
    how = rectification(rig, size, alpha)
    cameras = (
        (rig.left_matrix, rig.left_distortion, how.left_rotation, how.left_projection),
        (rig.right_matrix, rig.right_distortion, how.right_rotation, how.right_projection),
    )
    rectified = []
    for image, camera in zip(images, cameras, strict=True):
        maps = cv2.initUndistortRectifyMap(*camera, size, cv2.CV_32FC1)
        rectified.append(np.asarray(cv2.remap(image, *maps, cv2.INTER_LINEAR)))
    return Rectified(rectified[0], rectified[1], _calibration(how, size))


def rectified_calibration(rig: StereoRig, size: tuple[int, int], *, alpha: float | None = None) -> Calibration:
    """Return the calibration of the pair that :func:`rectify` makes from images of `size` (width, height)."""
    return _calibration(rectification(_fitted(rig, size), size, alpha), size)


def _common_size(left: Image, right: Image) -> tuple[int, int]:
    (height, width), (right_height, right_width) = left.shape[:2], right.shape[:2]
    if (height, width) != (right_height, right_width):
        raise ValueError(
            f"left is {width} × {height} and right is {right_width} × {right_height} pixels; "
            "both images must have the same size."
        )
    return width, height


def _fitted(rig: StereoRig, size: tuple[int, int]) -> StereoRig:
    """Return the rig for images of `size`, which must have the aspect ratio it was calibrated for."""
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


def rectification(rig: StereoRig, size: tuple[int, int], alpha: float | None = None) -> Rectification:
    """Return the rectification for images of `size` (width, height): the rig maker's, or one by Bouguet's method."""
    if alpha is None and rig.rectification is not None:
        return rig.rectification
    if alpha is not None and not 0 <= alpha <= 1:
        raise ValueError(f"alpha is {alpha}; allowed are numbers from 0 to 1.")
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
            alpha=alpha or 0.0,
        )
        return Rectification(*(np.asarray(matrix, dtype=np.float64) for matrix in matrices[:4]))
    except (cv2.error, ValueError) as error:
        raise ValueError(
            "The two cameras cannot be rectified: their matrices, distortion or pose are far from a stereo camera's."
        ) from error


def _calibration(how: Rectification, size: tuple[int, int]) -> Calibration:
    left, right = how.left_projection, how.right_projection
    return Calibration(
        focal_px=float(left[0, 0]),
        baseline_m=how.baseline_m,
        doffs_px=float(right[0, 2] - left[0, 2]),
        cx=float(left[0, 2]),
        cy=float(left[1, 2]),
        width=size[0],
        height=size[1],
    )
