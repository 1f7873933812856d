"""A pair made ready for matching: rectified (Bouguet's method, by OpenCV), split, cropped and reduced."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any, NamedTuple, TypeVar

import cv2
import numpy as np
import numpy.typing as npt

from stereolag.core.arrays import FloatMap
from stereolag.core.inputs import Image, as_image
from stereolag.geometry.calibration import Calibration, Rectification, StereoRig

Picture = TypeVar("Picture", bound=npt.NDArray[Any])

MAX_ASPECT_ERROR_PX = 1.0
"""Maximum difference in height from the calibrated images resized to the same width, px."""


class Rectified(NamedTuple):
    """A rectified pair: its images, of the same size and type as taken, and its calibration.

    Examples
    --------
    >>> import numpy as np
    >>> import stereolag as sl
    >>> from stereolag.geometry.calibration import StereoRig
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
        than the calibration's, but of the same aspect ratio, scales the cameras. Pictures of cameras one above the
        other are turned (:func:`turned`), by ``calibration.turn``.
    calibration
        Calibration with a ``rig``, the two cameras before rectification.
    alpha
        Content of the frame: 0 shows only pixels that the cameras took, 1 all of them, surrounded by black, which
        matchers leave out: no pixel that was taken is exactly 0 then. None rectifies as the calibration's maker did
        (R1, R2, P1, P2), or as 0 if that is unknown.

    Returns
    -------
    Rectified
        ``left``, ``right`` and ``calibration``, in this order. The calibration no longer has distortion or a rig;
        ``doffs_px`` is 0 unless its maker rectified the pair otherwise.

    Raises
    ------
    ValueError
        A calibration without a rig, images of different sizes or of another aspect ratio than they were calibrated at,
        or an alpha outside 0 to 1; cameras that converge so much that hardly anything of the pictures would remain.

    Examples
    --------
    Two cameras with the same lens, the right one 0.1 m beside the left one:

    >>> import numpy as np
    >>> import stereolag as sl
    >>> from stereolag.geometry.calibration import StereoRig
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
    (height, width), (right_height, right_width) = (image.shape[:2] for image in images)
    if (height, width) != (right_height, right_width):
        raise ValueError(
            f"left is {width} × {height} and right is {right_width} × {right_height} pixels; "
            "both images must have the same size."
        )
    calibration = mode_for(calibration, width, height)
    if calibration.rig is None:
        raise ValueError(
            f"The calibration has no raw cameras for pictures of {width} × {height} pixels, only rectified ones."
        )
    rig = _rig_at_size(calibration.rig, (width, height))
    if rig.turn:
        images = turned(images[0], rig.turn), turned(images[1], rig.turn)
        rig = rig.turned(rig.turn, (width, height))
        width, height = height, width
    size = width, height
    rectification = rectification_for(rig, size, alpha)
    cameras = (
        (rig.left_matrix, rig.left_distortion, rectification.left_rotation, rectification.left_projection),
        (rig.right_matrix, rig.right_distortion, rectification.right_rotation, rectification.right_projection),
    )
    rectified = []
    to_maps = cv2.fisheye.initUndistortRectifyMap if rig.fisheye else cv2.initUndistortRectifyMap
    for name, image, camera in zip(("left", "right"), images, cameras, strict=True):
        maps: Any = to_maps(*camera, size, cv2.CV_32FC1)
        _check_retained(name, maps[0], maps[1], float(camera[3][0, 0] / camera[0][0, 0]))
        rectified.append(_resampled(image, maps))
    known = replace(_calibration(rectification, size), notes=calibration.notes, unit_stated=calibration.unit_stated)
    return Rectified(rectified[0], rectified[1], known)


MAX_MAGNIFICATION = 3.0
"""Maximum magnification of a picture by its rectification."""

MIN_RETAINED_SHARE = 0.3
"""Minimum share of the rectified frame that is filled, and of the picture that is shown."""

SHARE_CELLS = 24
"""Number of cells, across and down, in which the share of the picture that is shown is counted."""


def _check_retained(name: str, cols: FloatMap, rows: FloatMap, magnification: float) -> None:
    """Refuse a rectification that shows hardly anything of a picture, given the source of each of its pixels."""
    height, width = cols.shape
    inside = (cols >= 0) & (cols <= width - 1) & (rows >= 0) & (rows <= height - 1)
    cell_rows, cell_cols = (
        (source[inside] * (SHARE_CELLS / side)).astype(int) for source, side in ((rows, height), (cols, width))
    )
    filled, shown = float(inside.mean()), np.unique(cell_rows * SHARE_CELLS + cell_cols).size / SHARE_CELLS**2
    if magnification > MAX_MAGNIFICATION or min(filled, shown) < MIN_RETAINED_SHARE:
        raise ValueError(
            f"The {name} picture cannot be rectified with this calibration: it would be magnified {magnification:.1f} "
            f"times, show {100 * shown:.0f} % of what was taken and fill {100 * filled:.0f} % of the frame; allowed "
            f"are up to {MAX_MAGNIFICATION:g} times and from {100 * MIN_RETAINED_SHARE:.0f} %. The cameras converge "
            "too much, or the calibration is of other cameras."
        )


def _resampled(image: Image, maps: tuple[Image, Image]) -> Image:
    """Return an image resampled at positions (x, y): black outside the image, and nowhere else."""
    resampled = np.asarray(cv2.remap(image, *maps, cv2.INTER_LINEAR))
    (x, y), (height, width) = maps, image.shape[:2]
    inside = (x > -0.5) & (y > -0.5) & (x < width - 0.5) & (y < height - 0.5)
    if not inside.all():
        colours = resampled if resampled.ndim == 2 else resampled[:, :, :3]
        black = (colours if colours.ndim == 2 else colours.max(axis=2)) == 0
        colours[black & inside] = 1 if image.dtype.kind == "u" else np.finfo(image.dtype).tiny
    return resampled


def rectified_calibration(rig: StereoRig, size: tuple[int, int], *, alpha: float | None = None) -> Calibration:
    """Return the calibration of the pair that :func:`rectify` makes from images of `size` (width, height)."""
    rig = _rig_at_size(rig, size)
    if not rig.turn:
        return _calibration(rectification_for(rig, size, alpha), size)
    of_turned = rectified_calibration(rig.turned(rig.turn, size), size[::-1], alpha=alpha)
    return replace(of_turned, turn=rig.turn, width=size[0], height=size[1])


def _rig_at_size(rig: StereoRig, size: tuple[int, int]) -> StereoRig:
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


def rectification_for(rig: StereoRig, size: tuple[int, int], alpha: float | None = None) -> Rectification:
    """Return the rectification for images of `size` (width, height): the rig maker's, or one by Bouguet's method.

    If the cameras stand one above the other, the rig must be that of turned pictures (:meth:`StereoRig.turned`).
    """
    if alpha is None and rig.rectification is not None:
        return rig.rectification
    if alpha is not None and not 0 <= alpha <= 1:
        raise ValueError(f"alpha is {alpha}; allowed are numbers from 0 to 1.")
    cameras = rig.left_matrix, rig.left_distortion, rig.right_matrix, rig.right_distortion
    pose, flags, share = (rig.rotation, rig.translation[:, None]), cv2.CALIB_ZERO_DISPARITY, alpha or 0.0
    try:
        if rig.fisheye:
            matrices: Any = cv2.fisheye.stereoRectify(*cameras, size, *pose, flags, newImageSize=size, balance=share)
        else:
            matrices = cv2.stereoRectify(*cameras, size, *pose, flags=flags, alpha=share)
        return Rectification(*(np.asarray(matrix, dtype=np.float64) for matrix in matrices[:4]))
    except (cv2.error, ValueError) as error:
        raise ValueError(
            "The two cameras cannot be rectified: their matrices, distortion or pose are far from a stereo camera's."
        ) from error


def _calibration(rectification: Rectification, size: tuple[int, int]) -> Calibration:
    left, right = rectification.left_projection, rectification.right_projection
    return Calibration(
        focal_px=float(left[0, 0]),
        baseline_m=rectification.baseline_m,
        doffs_px=float(right[0, 2] - left[0, 2]),
        cx=float(left[0, 2]),
        cy=float(left[1, 2]),
        width=size[0],
        height=size[1],
    )


def scaled_image(image: Image, factor: float) -> Image:
    """Return an image at `factor` times its size, 0 < factor ≤ 1, each pixel the mean of those it replaces.

    Raises
    ------
    ValueError
        A factor outside these bounds, or one that leaves no pixel.
    """
    return np.asarray(cv2.resize(image, _size(image.shape, factor), interpolation=cv2.INTER_AREA))


def scaled_disparity(disparity: npt.ArrayLike, factor: float) -> FloatMap:
    """Return a (H, W) disparity map for images at `factor` times their size, 0 < factor ≤ 1, in px of that size.

    The nearest pixel is taken: the mean of a near and a far disparity belongs to neither surface.

    Raises
    ------
    ValueError
        A factor outside these bounds, or one that leaves no pixel.
    """
    values = np.asarray(disparity, dtype=np.float32)
    width, height = _size(values.shape, factor)
    small = cv2.resize(values, (width, height), interpolation=cv2.INTER_NEAREST_EXACT)
    return np.asarray(small * np.float32(width / values.shape[1]), dtype=np.float32)


def _size(shape: tuple[int, ...], factor: float) -> tuple[int, int]:
    """Return (width, height), in OpenCV's order."""
    width, height = round(shape[1] * factor), round(shape[0] * factor)
    if not 0 < factor <= 1 or min(width, height) < 1:
        raise ValueError(
            f"factor is {factor} for {shape[1]} × {shape[0]} pixels; allowed is above 0 to 1, and a pixel must be left."
        )
    return width, height


def turned(picture: Picture, quarters: int) -> Picture:
    """Return a picture or a map turned by quarters of a turn, counter-clockwise as seen; negative: clockwise.

    Cameras one above the other need both pictures turned alike, so that matching points lie in the same row: by 1 if
    the second camera is the lower one, by -1 if it is the upper one. ``turned(map, -quarters)`` turns a map back.

    Examples
    --------
    >>> import numpy as np
    >>> turned(np.array([[1, 2], [3, 4], [5, 6]]), 1)
    array([[2, 4, 6],
           [1, 3, 5]])
    """
    return np.ascontiguousarray(np.rot90(picture, quarters))  # type: ignore[return-value]


MAX_SIZE_DIFFERENCE = 0.03
"""Maximum relative difference of the sizes of images that count as one size with a few pixels cropped."""

MAX_ASPECT_DIFFERENCE = 0.01
"""Maximum relative difference of the aspect ratios of a calibration and its images."""

MIN_RESIZED_RATIO = 1.4
"""Ratio of the principal point to the middle of the images from which they seem resized, in columns and in rows."""

MAX_AXES_RATIO = 1.15
"""Maximum ratio between those two ratios in resized images."""


def cropped_to_common_size(left: Image, right: Image) -> tuple[Image, Image]:
    """Return both images cropped to the rows and columns they share, from the top left.

    Raises
    ------
    ValueError
        Sizes that differ by more than 3 %.
    """
    sizes = list(zip(left.shape[:2], right.shape[:2], strict=True))
    if any(abs(one - other) > MAX_SIZE_DIFFERENCE * max(one, other) for one, other in sizes):
        (height, width), (rows, cols) = left.shape[:2], right.shape[:2]
        raise ValueError(
            f"left is {width} × {height} and right is {cols} × {rows} pixels; both images must have the same size, "
            "give or take 3 %."
        )
    rows, cols = (min(pair) for pair in sizes)
    return left[:rows, :cols], right[:rows, :cols]


def as_same_bit_depth(left: Image, right: Image) -> tuple[Image, Image]:
    """Return both images in 16 bits if one has 8 and the other 16; otherwise unchanged.

    Cameras of 10, 12 or 14 bits often leave the upper ones of 16 unused. Both images show the same scene, so the depth
    is taken to be the one that brings their means closest.
    """
    if {left.dtype, right.dtype} != {np.dtype(np.uint8), np.dtype(np.uint16)}:
        return left, right
    deep, shallow = (left, right) if left.dtype == np.uint16 else (right, left)
    brightest, mean, target = int(deep.max()), _mean(deep), _mean(shallow) / 255
    bits = min(
        (bits for bits in (8, 10, 12, 14, 16) if brightest < 2**bits),
        key=lambda bits: abs(math.log((mean / (2**bits - 1) + 1e-6) / (target + 1e-6))),
    )
    stretched = np.minimum(np.rint(np.arange(2**16) * (65535 / (2**bits - 1))), 65535).astype(np.uint16)
    deep, shallow = stretched[deep], shallow.astype(np.uint16) * 257
    return (deep, shallow) if left.dtype == np.uint16 else (shallow, deep)


def _mean(image: Image) -> float:
    return float((image if image.ndim == 2 else image[:, :, :3]).mean())


def calibration_for(calibration: Calibration, width: int, height: int) -> Calibration:
    """Return the calibration for images of this size: the size it was made for, resized or slightly cropped.

    Raises
    ------
    ValueError
        Images of another aspect ratio; or, where the size is unknown, a principal point that is off the middle of the
        images by the same large factor in columns and in rows.
    """
    calibration = mode_for(calibration, width, height)
    if calibration.width is None or calibration.height is None:
        _check_centre(calibration, width, height)
        return calibration
    differences = abs(calibration.width - width) / width, abs(calibration.height - height) / height
    if max(differences) <= MAX_SIZE_DIFFERENCE:
        return calibration
    factor = width / calibration.width
    if abs(calibration.height * factor / height - 1) > MAX_ASPECT_DIFFERENCE:
        raise ValueError(
            f"The calibration is for {calibration.width} × {calibration.height} pixels and the images are "
            f"{width} × {height}: give those it was made for, or the same resized without cropping."
        )
    return calibration.scaled(factor)


def _check_centre(calibration: Calibration, width: int, height: int) -> None:
    """Refuse a calibration without a size that was clearly made for larger or smaller images: depths would be wrong."""
    rig = calibration.rig
    cx, cy = (calibration.cx, calibration.cy) if rig is None else rig.left_matrix[:2, 2].tolist()
    if cx is None or cy is None or min(cx, cy) <= 0:
        return
    ratios = (2 * cx + 1) / width, (2 * cy + 1) / height
    resized = min(ratios) > MIN_RESIZED_RATIO or max(ratios) < 1 / MIN_RESIZED_RATIO
    if resized and max(ratios) < MAX_AXES_RATIO * min(ratios):
        raise ValueError(
            f"The principal point of the calibration, column {cx:.0f} and row {cy:.0f}, is that of images of about "
            f"{2 * cx + 1:.0f} × {2 * cy + 1:.0f} pixels, and these are {width} × {height}: give images of the size it "
            "was made for, or state that size in it (image_width, image_height)."
        )


def mode_for(calibration: Calibration, width: int, height: int) -> Calibration:
    """Return the calibration's mode for pictures of this size, or the nearest one, the same aspect ratio preferred.

    A calibration without modes is returned unchanged.
    """

    def distance(one: Calibration) -> tuple[bool, float]:
        if one.width is None or one.height is None:
            return True, math.inf
        other_shape = abs(one.height / one.width / (height / width) - 1) > MAX_ASPECT_DIFFERENCE
        return other_shape, abs(math.log(one.width / width)) + abs(math.log(one.height / height))

    return min(calibration.modes, key=distance) if calibration.modes else calibration


def preview_divisor(width: int, height: int) -> int:
    """Return the integer by which to divide both sides of a picture so that it has at most a megapixel.

    A matcher's time grows with the number of pixels times the disparities: a third of the size takes a 27th of it.
    """
    return math.ceil(math.sqrt(width * height / 1e6))
