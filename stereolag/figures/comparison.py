"""Maps held against each other: their difference, and where they agree."""

from __future__ import annotations

import cv2
import numpy as np
import numpy.typing as npt

from stereolag.figures.colours import NO_ANSWER, Rgb, coloured
from stereolag.figures.pictures import as_rgb
from stereolag.inputs import Image

LARGEST_DIFFERENCE = 4.0
"""Px at the ends of the colours: locked, so that maps compared one after another can be compared."""


def _diverging() -> Rgb:
    """Return blue over white to red, as Brewer's RdBu."""
    ends = np.array([(33, 102, 172), (146, 197, 222), (247, 247, 247), (244, 165, 130), (178, 24, 43)])
    at = np.linspace(0, 4, 256)
    return np.stack([np.rint(np.interp(at, np.arange(5), part)) for part in ends.T], axis=1).astype(np.uint8)


BELOW_TO_ABOVE = _diverging()

ALL_AGREE, SOME_AGREE, ALL_DIFFER = (52, 168, 123), (240, 186, 76), (214, 84, 84)


def difference_picture(difference: npt.NDArray[np.float32]) -> Rgb:
    """Return differences, px, as a picture: red where positive, blue where negative, grey where one is missing."""
    return coloured(difference, -LARGEST_DIFFERENCE, LARGEST_DIFFERENCE, BELOW_TO_ABOVE)


def agreement_picture(agreeing: npt.NDArray[np.uint8], methods: int, image: Image) -> Rgb:
    """Return how many of the methods agree as colours over the image."""
    palette = np.array([NO_ANSWER, ALL_DIFFER, *[SOME_AGREE] * (methods - 2), ALL_AGREE], dtype=np.uint8)
    return tinted(palette[agreeing], image)


def tinted(colours: Rgb, image: Image) -> Rgb:
    """Return colours with the light and shade of an image, so that one sees where in the scene they lie."""
    grey = cv2.cvtColor(np.ascontiguousarray(as_rgb(image)), cv2.COLOR_RGB2GRAY)
    shade = (0.65 + 0.35 * grey.astype(np.float32) / 255)[:, :, None]
    return np.rint(colours * shade).astype(np.uint8)
