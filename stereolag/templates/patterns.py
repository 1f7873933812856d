"""A template prepared for the search: weights and deviations of its pixels, resized and rotated if asked for."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import cv2
import numpy as np
import numpy.typing as npt

from stereolag.core.arrays import Mask
from stereolag.core.inputs import Image, as_grey, grey_level

Weights = npt.NDArray[np.float64]

MIN_WEIGHT = 0.01
"""Smaller weights are set to 0: most pixels of a box around a soft shape then cost nothing."""

FULL_WEIGHT = 0.95
"""Least weight of a pixel through which no background shows: alpha 251 of 255."""


@dataclass(frozen=True)
class Pattern:
    """A template ready for comparison.

    Parameters
    ----------
    colours
        (height, width, channels), the template's own pixels and dtype, without alpha; for a silhouette, its alpha.
    weights
        (height, width), 0..1, the weight of each pixel in the comparison.
    deviations
        (channels, height, width) float64: each channel minus its weighted mean, 0 where the weight is 0.
    silhouette
        Whether the edges of `colours` are compared, as (horizontal, vertical) channels of `deviations`. The further
        channels of the image are then its difference from the silhouette's colour, grey levels of 255.
    most_opaque
        Largest alpha, 0..1, with which `colours` lie over a background; 0 if no alpha is known.
    """

    colours: Image
    weights: Weights
    deviations: npt.NDArray[np.float64]
    silhouette: bool = False
    most_opaque: float = 0.0

    @property
    def shape(self) -> tuple[int, int]:
        """Height and width, px."""
        return self.weights.shape[0], self.weights.shape[1]

    @cached_property
    def opaque(self) -> Mask:
        """The pixels through which no background shows, (height, width)."""
        return np.asarray(self.weights >= FULL_WEIGHT)

    @cached_property
    def has_binary_weights(self) -> bool:
        """Whether every weight is 0 or 1, so that weighted sums of integers are integers."""
        return bool(((self.weights == 0) | (self.weights == 1)).all())

    @cached_property
    def count(self) -> float:
        """Sum of the weights."""
        return float(self.weights.sum())

    @cached_property
    def norm(self) -> float:
        """Root of the weighted sum of squared deviations."""
        return float(np.sqrt((self.weights * np.square(self.deviations)).sum()))

    def fits(self, image: Image) -> bool:
        """Return whether the template is no larger than an image."""
        return all(side <= length for side, length in zip(self.shape, image.shape, strict=False))

    def mirrored(self) -> Pattern:
        """Return the mirror image, left and right exchanged."""
        colours, weights = (np.ascontiguousarray(side[:, ::-1]) for side in (self.colours, self.weights))
        return pattern_of(colours, weights, silhouette=self.silhouette, most_opaque=self.most_opaque)


def pattern_of(
    colours: Image,
    weights: npt.NDArray[np.float64] | Mask,
    *,
    silhouette: bool = False,
    most_opaque: float = 0.0,
) -> Pattern:
    """Return the pattern of a template from its (height, width, channels) colours and the weights of its pixels.

    Raises
    ------
    ValueError
        No pixel with a weight, or every channel constant over them: the correlation coefficient would be 0/0.
    """
    counts = weights > 0
    if not counts.any():
        raise ValueError("The template has no opaque pixel under its mask; at least 2 of different value are needed.")
    pixels = (edges(colours) if silhouette else colours)[counts]
    if not np.ptp(pixels, axis=0).any():
        value = ", ".join(f"{channel:g}" for channel in pixels[0])
        raise ValueError(
            f"The template is constant ({value} in "
            f"{'its only opaque pixel' if len(pixels) == 1 else f'all its {len(pixels)} opaque pixels'}); "
            "a correlation needs something that varies, such as an edge."
        )
    # Relative to its first pixel, a constant channel is exactly 0, whatever the rounding of its mean.
    relative = pixels.astype(np.float64) - pixels[0].astype(np.float64)
    deviations = np.zeros((pixels.shape[1], *weights.shape))
    deviations[:, counts] = (relative - np.average(relative, axis=0, weights=weights[counts])).T
    return Pattern(colours, weights.astype(np.float64), deviations, silhouette, most_opaque)


def opacity(template: Image, mask: Image | None) -> Weights:
    """Return the mask, or else the alpha, of a checked template over its largest value, 0..1; 1 without either.

    Raises
    ------
    ValueError
        A mask of another size than the template.
    """
    if mask is not None:
        if mask.shape[:2] != template.shape[:2]:
            (mh, mw), (th, tw) = mask.shape[:2], template.shape[:2]
            raise ValueError(f"mask is {mw} × {mh} and template is {tw} × {th} pixels; both must have the same size.")
        shares = mask if mask.ndim == 2 else mask[:, :, :3].max(axis=2)
    elif template.ndim == 3 and template.shape[2] == 4:
        shares = template[:, :, 3]
    else:
        return np.ones(template.shape[:2])
    return np.maximum(shares, 0) / max(float(shares.max()), np.finfo(np.float64).tiny)


def weights_of(shares: Weights) -> Weights:
    """Return the weights of pixels of that opacity: its cube.

    The less opaque a pixel, the more of an unknown background shows through it. Of random glows on photographs, 55 %
    scored best at their true place with a weight of 1 wherever alpha is not 0, 75 % with alpha itself as the weight,
    93 % with its cube.
    """
    weights = np.power(shares, 3)
    return np.where(weights < MIN_WEIGHT, 0.0, weights)


def opaque_pixels(template: Image, mask: Image | None) -> Mask:
    """Return the mask of the pixels of a checked template with at least half of the largest weight."""
    return np.asarray(weights_of(opacity(template, mask)) >= 0.5)


def same_channels(image: Image, template: Image) -> tuple[Image, Image]:
    """Return both as (rows, cols, channels) without alpha; if one of them is grey, the other as its luminance."""
    if image.ndim == 2 or template.ndim == 2:
        return as_grey(image)[:, :, np.newaxis], as_grey(template)[:, :, np.newaxis]
    return image[:, :, :3], template[:, :, :3]


MAX_COLOUR_DEVIATION = 2.0
"""Largest standard deviation of the colours of a silhouette, grey levels of 255.

Without the rim, one pixel inside its opaque part and two outside: a filter that resamples it rings there, or mixes in
the colour of transparent pixels.
"""

MAX_RINGING = 12.0
"""Largest standard deviation of the colours of its opaque part with the rim, grey levels of 255.

Measured: up to 11 where Lanczos's filter rings in icons of 22 to 46 px; from 27 in soft shapes of several colours.
"""

NEARNESS_OFFSET = 8.0
"""Distance of colours, grey levels of 255, far above which only the ratio of two distances matters."""


def prepared(image: Image, template: Image, mask: Image | None, *, exact: bool = False) -> tuple[Image, Pattern]:
    """Return the image (rows, cols, channels) and the pattern to compare with it.

    A template of one colour has only a shape. The edges of its alpha are compared with those of a map of the image that
    is highest where the image has that colour; the differences from that colour are further channels. If `exact`, only
    its pixels are compared. With a separate mask, the one colour must be exactly one.

    Raises
    ------
    ValueError
        As for :func:`pattern_of`.
    """
    large, colours = same_channels(image, template)
    shares = opacity(template, mask)
    weights = weights_of(shares)
    if colours.dtype.kind == "f":
        gaps = np.asarray(np.isnan(colours).any(axis=2))
        colours, weights = np.where(gaps[:, :, np.newaxis], 0, colours), np.where(gaps, 0.0, weights)
    if not exact and np.ptp(weights):
        level = grey_level(colours, colours)
        colour = _one_colour(colours, weights, level if mask is None else 0.0)
        if colour is not None:
            difference = np.asarray((large - np.asarray(colour, np.float32)) / np.float32(level), np.float32)
            shape = shares.astype(np.float32)[:, :, np.newaxis]
            return np.dstack([edges(nearness(difference)), difference]), pattern_of(
                shape, np.ones(shares.shape), silhouette=True
            )
    has_alpha = mask is None and template.ndim == 3 and template.shape[2] == 4 and template.dtype.kind == "u"
    most = float(template[:, :, 3].max()) / np.iinfo(template.dtype).max if has_alpha else 0.0
    return large, pattern_of(colours, weights, most_opaque=most)


def _one_colour(colours: Image, weights: Weights, level: float) -> Weights | None:
    """Return the colour of a template of one colour, else None.

    `level` is one grey level of 255 in the template's units; at 0 the colour must be exactly one.
    """
    opaque, visible = weights >= FULL_WEIGHT * weights.max(), weights > 0
    first = colours[opaque][0].astype(np.float64)
    relative = colours - first  # exactly 0 if all are one
    mean = np.average(relative[opaque], axis=0, weights=weights[opaque])
    away = np.square(relative - mean).mean(axis=2) * weights
    near_soft, near_opaque_or_hidden = (
        cv2.dilate(mask.astype(np.uint8), np.ones((side, side), np.uint8)) > 0
        for mask, side in ((~opaque, 3), (opaque | ~visible, 5))
    )
    at_rim = np.where(opaque, near_soft, near_opaque_or_hidden)
    unit = weights.sum() * level**2
    inner = away[visible & ~at_rim].sum()
    if inner > MAX_COLOUR_DEVIATION**2 * unit or away[opaque].sum() > MAX_RINGING**2 * unit:
        return None
    return first + mean if level or not away.any() else None


def nearness(difference: npt.NDArray[np.float32]) -> npt.NDArray[np.float32]:
    """Return the negative logarithm of the distance to a colour, (rows, cols), from (rows, cols, channels) differences.

    Differences are in grey levels of 255.
    """
    return np.asarray(-np.log(np.linalg.norm(difference, axis=2) + NEARNESS_OFFSET))


def edges(plane: Image) -> npt.NDArray[np.float32]:
    """Return the horizontal and vertical differences (rows, cols, 2) of a plane, smoothed across by Sobel's filter."""
    smooth: Image = plane.reshape(plane.shape[:2]).astype(np.float32)
    return np.dstack([cv2.Sobel(smooth, -1, *axis, borderType=cv2.BORDER_REPLICATE) for axis in ((1, 0), (0, 1))])


MIN_VALID_SHARE = 0.75
"""Least share of a warped template's pixel that is interpolated from pixels with a weight, for it to have one."""


def warped(pattern: Pattern, scale: float, rotation: float) -> Pattern | None:
    """Return a template resized and rotated about its centre, in the upright box that then contains it.

    Colours are multiplied by their weights, which are warped as well, so that pixels bleed into others by their weight.

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
        With float32 colours; None if fewer than two pixels of different value remain.
    """
    (height, width), (rows, cols) = pattern.shape, warped_shape(pattern.shape, scale, rotation)
    matrix = cv2.getRotationMatrix2D(((width - 1) / 2, (height - 1) / 2), rotation, scale)
    matrix[:, 2] += np.array([(cols - width) / 2, (rows - height) / 2])
    weight = pattern.weights.astype(np.float32)
    layers = np.dstack([pattern.colours.astype(np.float32) * weight[:, :, np.newaxis], weight, weight > 0])
    if scale < 1:
        # As wide as the area of the source that one pixel covers afterwards.
        layers = blurred(layers, math.sqrt((1 / scale**2 - 1) / 12), cv2.BORDER_CONSTANT)
    layers = cv2.warpAffine(layers, matrix, (cols, rows), flags=cv2.INTER_LINEAR)
    if pattern.silhouette:  # outside its box it is as transparent as in its corners
        colours, weights = layers[:, :, :-2], np.ones((rows, cols))
    else:
        weights = layers[:, :, -2].astype(np.float64)
        # Rounded up to 1, so that weighted sums of integers stay integers.
        weights = np.where(weights > 1 - 1e-3, 1.0, weights)
        weights[(layers[:, :, -1] < MIN_VALID_SHARE) | (weights < MIN_WEIGHT)] = 0
        colours = layers[:, :, :-2] / np.maximum(layers[:, :, -2:-1], MIN_WEIGHT)
    try:
        return pattern_of(colours, weights, silhouette=pattern.silhouette, most_opaque=pattern.most_opaque)
    except ValueError:
        return None


def without_rim(pattern: Pattern, rim: int) -> Pattern | None:
    """Return a template without `rim` px on each side and with weights of 0 and 1 alone; None if it is constant."""
    inner = slice(rim, -rim or None)
    try:
        return pattern_of(pattern.colours[inner, inner], pattern.weights[inner, inner] > 0)
    except ValueError:
        return None


def warped_shape(shape: tuple[int, int], scale: float, rotation: float) -> tuple[int, int]:
    """Return height and width, px, of the upright box around a resized and rotated rectangle."""
    height, width = shape
    sine, cosine = abs(math.sin(math.radians(rotation))), abs(math.cos(math.radians(rotation)))
    tall, wide = scale * (height * cosine + width * sine), scale * (width * cosine + height * sine)
    return max(1, math.ceil(tall - 1e-6)), max(1, math.ceil(wide - 1e-6))


def in_grey(image: Image, pattern: Pattern) -> tuple[Image, Pattern]:
    """Return the luminance of an image and a template, or both unchanged if that of the template is constant."""
    colours = pattern.colours
    if colours.shape[2] == 1 or not np.ptp(as_grey(colours)[pattern.weights > 0]):
        return image, pattern
    return as_grey(image)[:, :, np.newaxis], pattern_of(as_grey(colours)[:, :, np.newaxis], pattern.weights)


def blurred(
    plane: npt.NDArray[np.floating[Any]], sigma: float, border: int, size: tuple[int, int] = (0, 0)
) -> npt.NDArray[np.float32]:
    """Return a plane or an image blurred by a Gaussian; `size`: of its kernel, by default from sigma."""
    return np.asarray(cv2.GaussianBlur(plane, size, sigma, borderType=border), dtype=np.float32).reshape(plane.shape)


def reduced(image: Image, factor: float) -> Image:
    """Return an image (rows, cols, channels), reduced by `factor`, 1 or more, by averaging areas; of the same dtype."""
    rows, cols = (max(1, round(side / factor)) for side in image.shape[:2])
    return np.asarray(cv2.resize(image, (cols, rows), interpolation=cv2.INTER_AREA)).reshape(rows, cols, -1)
