"""Preparation of a stereo pair: splitting, matching and reducing images, with the calibration that fits."""

from __future__ import annotations

import math

import cv2
import numpy as np
import numpy.typing as npt

from stereolag.core.arrays import FloatMap
from stereolag.core.inputs import DEPTHS, Image
from stereolag.geometry.calibration import Calibration


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


LARGEST_DIFFERENCE = 0.03
"""Share of the larger size; images that differ by more are not the same size with a few pixels cropped."""

LARGEST_ASPECT_DIFFERENCE = 0.01

MOST_PREVIEW_PIXELS = 1_000_000


def halves(image: Image) -> tuple[Image, Image]:
    """Return the left and right halves of a side-by-side image; if its width is odd, the middle column is left out.

    Raises
    ------
    ValueError
        An image with only one column.
    """
    half = image.shape[1] // 2
    if half == 0:
        raise ValueError("The side-by-side image is 1 pixel wide; at least 2 are needed.")
    return image[:, :half], image[:, -half:]


def cropped_alike(left: Image, right: Image) -> tuple[Image, Image]:
    """Return both images cropped to the rows and columns they share, from the top left.

    Raises
    ------
    ValueError
        Sizes that differ by more than 3 %.
    """
    sizes = list(zip(left.shape[:2], right.shape[:2], strict=True))
    if any(abs(one - other) > LARGEST_DIFFERENCE * max(one, other) for one, other in sizes):
        (height, width), (rows, cols) = left.shape[:2], right.shape[:2]
        raise ValueError(
            f"left is {width} × {height} and right is {cols} × {rows} pixels; both images must have the same size, "
            "give or take 3 %."
        )
    rows, cols = (min(pair) for pair in sizes)
    return left[:rows, :cols], right[:rows, :cols]


def as_deep(left: Image, right: Image) -> tuple[Image, Image]:
    """Return both images in 16 bits if one has 8 and the other 16; otherwise unchanged.

    Cameras of 10, 12 or 14 bits often leave the upper ones of 16 empty. Both images show one scene, so the full range
    is taken to be the number of bits that brings their means closest.
    """
    if {left.dtype, right.dtype} != {np.dtype(np.uint8), np.dtype(np.uint16)}:
        return left, right
    deep, shallow = (left, right) if left.dtype == np.uint16 else (right, left)
    brightest, mean, wanted = int(deep.max()), _mean(deep), _mean(shallow) / 255
    bits = min(
        (bits for bits in DEPTHS if brightest < 2**bits),
        key=lambda bits: abs(math.log((mean / (2**bits - 1) + 1e-6) / (wanted + 1e-6))),
    )
    spread = np.minimum(np.rint(np.arange(2**16) * (65535 / (2**bits - 1))), 65535).astype(np.uint16)
    deep, shallow = spread[deep], shallow.astype(np.uint16) * 257
    return (deep, shallow) if left.dtype == np.uint16 else (shallow, deep)


def _mean(image: Image) -> float:
    return float((image if image.ndim == 2 else image[:, :, :3]).mean())


def calibration_for(calibration: Calibration, width: int, height: int) -> Calibration:
    """Return the calibration for images of this size: the size it was made for, resized or slightly cropped.

    Raises
    ------
    ValueError
        Images of another aspect ratio.
    """
    if calibration.width is None or calibration.height is None:
        return calibration
    differences = abs(calibration.width - width) / width, abs(calibration.height - height) / height
    if max(differences) <= LARGEST_DIFFERENCE:
        return calibration
    factor = width / calibration.width
    if abs(calibration.height * factor / height - 1) > LARGEST_ASPECT_DIFFERENCE:
        raise ValueError(
            f"The calibration is for {calibration.width} × {calibration.height} pixels and the images are "
            f"{width} × {height}: give those it was made for, or the same resized without cropping."
        )
    return calibration.scaled(factor)


def preview_divisor(width: int, height: int) -> int:
    """Return the integer by which to divide both sides so that at most a megapixel is left.

    A matcher's time grows with the number of pixels times the disparities: a third of the size takes a 27th.
    """
    return math.ceil(math.sqrt(width * height / MOST_PREVIEW_PIXELS))
