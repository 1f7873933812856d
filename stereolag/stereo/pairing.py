"""Pictures as they come made into a stereo pair: cut apart, brought to one size, with the calibration that fits."""

from __future__ import annotations

import math

from stereolag.calibration import Calibration
from stereolag.inputs import Image

LARGEST_DIFFERENCE = 0.03
"""Of the larger size; what differs by more is not the same picture cropped by a few pixels."""

LARGEST_ASPECT_DIFFERENCE = 0.01

MOST_PREVIEW_PIXELS = 1_000_000


def halves(image: Image) -> tuple[Image, Image]:
    """Return the left and the right half of a side-by-side picture; of an odd width the middle column is left out.

    Raises
    ------
    ValueError
        A picture of one column.
    """
    half = image.shape[1] // 2
    if half == 0:
        raise ValueError("The side-by-side picture is 1 pixel wide; at least 2 are needed.")
    return image[:, :half], image[:, -half:]


def cropped_alike(left: Image, right: Image) -> tuple[Image, Image]:
    """Return both images with the rows and columns that they share, from the top left.

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


def calibration_for(calibration: Calibration, width: int, height: int) -> Calibration:
    """Return the calibration for images of this size, which are those it was made for, resized or cropped a little.

    Raises
    ------
    ValueError
        Images of another shape.
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
    """Return the whole number by which to divide both sides so that at most a megapixel is left.

    A matcher's time goes with the number of pixels times the disparities: a third of the size takes a 27th.
    """
    return math.ceil(math.sqrt(width * height / MOST_PREVIEW_PIXELS))
