"""Resized and rotated templates, and reduced images, for a search over both sizes and angles."""

from __future__ import annotations

import math

import cv2
import numpy as np
import numpy.typing as npt

from stereolag.core.inputs import Image, as_grey
from stereolag.templates.patterns import Pattern, pattern_of

MOSTLY_OPAQUE = 0.75
"""A pixel of a warped template counts if the pixels it is interpolated from are opaque by at least this share."""


def warped(pattern: Pattern, scale: float, rotation: float) -> Pattern | None:
    """Return a template resized and rotated about its centre, in the upright box that then contains it.

    Excluded pixels do not bleed into those that count: colours are weighted by the mask, which is warped with them and
    thresholded.

    Parameters
    ----------
    pattern
        The template.
    scale
        Size after over size before.
    rotation
        Degrees, positive counter-clockwise as seen.

    Returns
    -------
    Pattern or None
        With float32 colours; None if fewer than two pixels of different value are left.
    """
    (height, width), (rows, cols) = pattern.shape, warped_shape(pattern.shape, scale, rotation)
    matrix = cv2.getRotationMatrix2D(((width - 1) / 2, (height - 1) / 2), rotation, scale)
    matrix[:, 2] += np.array([(cols - width) / 2, (rows - height) / 2])
    weight = pattern.opaque.astype(np.float32)
    layers = np.dstack([pattern.colours.astype(np.float32) * weight[:, :, np.newaxis], weight])
    if scale < 1:
        # As wide as the area of the source that one pixel then covers.
        blur = math.sqrt((1 / scale**2 - 1) / 12)
        layers = cv2.GaussianBlur(layers, (0, 0), blur, borderType=cv2.BORDER_CONSTANT)
    layers = cv2.warpAffine(layers, matrix, (cols, rows), flags=cv2.INTER_LINEAR)
    opaque = layers[:, :, -1] >= MOSTLY_OPAQUE
    if not opaque.any():
        return None
    colours = layers[:, :, :-1] / np.maximum(layers[:, :, -1:], MOSTLY_OPAQUE)
    if not np.ptp(colours[opaque], axis=0).any():
        return None
    return pattern_of(colours, opaque)


def warped_shape(shape: tuple[int, int], scale: float, rotation: float) -> tuple[int, int]:
    """Return height and width, px, of the upright box around a resized and rotated rectangle."""
    height, width = shape
    sine, cosine = abs(math.sin(math.radians(rotation))), abs(math.cos(math.radians(rotation)))
    tall, wide = scale * (height * cosine + width * sine), scale * (width * cosine + height * sine)
    return max(1, math.ceil(tall - 1e-6)), max(1, math.ceil(wide - 1e-6))


def grey_pattern(pattern: Pattern) -> Pattern | None:
    """Return the pattern of a template's luminance, None if that is uniform."""
    grey = as_grey(pattern.colours if pattern.colours.shape[2] == 3 else pattern.colours[:, :, 0])
    if not np.ptp(grey[pattern.opaque]):
        return None
    return pattern_of(grey[:, :, np.newaxis], pattern.opaque)


def reduced(image: Image, factor: float) -> npt.NDArray[np.float32]:
    """Return an image (rows, cols, channels) reduced by `factor`, 1 or more, by averaging areas, float32."""
    rows, cols = (max(1, round(side / factor)) for side in image.shape[:2])
    smaller = cv2.resize(image, (cols, rows), interpolation=cv2.INTER_AREA)
    return np.asarray(smaller, dtype=np.float32).reshape(rows, cols, -1)
