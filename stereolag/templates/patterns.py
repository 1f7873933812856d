"""A template prepared for the search: its opaque pixels with their mean removed, resized and rotated where asked."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property

import cv2
import numpy as np
import numpy.typing as npt

from stereolag.core.arrays import Mask
from stereolag.core.inputs import Image, as_grey


@dataclass(frozen=True)
class Pattern:
    """A template ready for comparison.

    Parameters
    ----------
    colours
        (height, width, channels), the template's own pixels and dtype, without alpha.
    opaque
        (height, width), True where a pixel takes part in the comparison.
    deviations
        (channels, height, width) float64: each channel minus its mean over the opaque pixels, 0 elsewhere.
    """

    colours: Image
    opaque: Mask
    deviations: npt.NDArray[np.float64]

    @property
    def shape(self) -> tuple[int, int]:
        """Height and width, px."""
        return self.opaque.shape[0], self.opaque.shape[1]

    @cached_property
    def count(self) -> int:
        """Number of opaque pixels."""
        return int(np.count_nonzero(self.opaque))

    @cached_property
    def norm(self) -> float:
        """Root of the sum of squared deviations."""
        return float(np.sqrt(np.square(self.deviations).sum()))


def pattern_of(colours: Image, opaque: Mask) -> Pattern:
    """Return the pattern of a template from its (height, width, channels) colours and its mask of opaque pixels.

    Raises
    ------
    ValueError
        No opaque pixels, or every channel constant over them: the correlation coefficient would be 0/0.
    """
    if not opaque.any():
        raise ValueError("template has no opaque pixel under its mask; at least 2 of different value are needed.")
    pixels = colours[opaque]
    if not np.ptp(pixels, axis=0).any():
        value = ", ".join(f"{channel:g}" for channel in pixels[0])
        raise ValueError(
            f"template is constant ({value} in all its {len(pixels)} opaque pixels); "
            "a correlation needs something that varies."
        )
    # Relative to its first pixel, a constant channel is exactly 0, whatever the rounding of its mean.
    relative = pixels.astype(np.float64) - pixels[0].astype(np.float64)
    deviations = np.zeros((colours.shape[2], *opaque.shape))
    deviations[:, opaque] = (relative - relative.mean(axis=0)).T
    return Pattern(colours, opaque, deviations)


def opaque_pixels(template: Image, mask: Image | None) -> Mask:
    """Return the pixels of a checked template that count: those its mask marks, else those its alpha leaves opaque.

    Any mask value above 0 marks a pixel. In an alpha channel only the highest value present counts as opaque, because
    the background shows through a half-transparent rim pixel.

    Raises
    ------
    ValueError
        A mask of another size than the template.
    """
    if mask is not None:
        if mask.shape[:2] != template.shape[:2]:
            (mh, mw), (th, tw) = mask.shape[:2], template.shape[:2]
            raise ValueError(f"mask is {mw} × {mh} and template is {tw} × {th} pixels; both must have the same size.")
        marked = mask if mask.ndim == 2 else mask[:, :, :3].max(axis=2)
        return np.asarray(marked > 0)
    if template.ndim == 3 and template.shape[2] == 4:
        alpha = template[:, :, 3]
        return np.asarray((alpha == alpha.max()) & (alpha > 0))
    return np.ones(template.shape[:2], dtype=np.bool_)


def same_channels(image: Image, template: Image) -> tuple[Image, Image]:
    """Return both as (rows, cols, channels) without alpha; if one of them is grey, the luminance of the other."""
    if image.ndim == 2 or template.ndim == 2:
        return as_grey(image)[:, :, np.newaxis], as_grey(template)[:, :, np.newaxis]
    return image[:, :, :3], template[:, :, :3]


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
