"""Matching cost of every pixel at every lag: the settings, the features compared, the terms, and their sum.

One pass over the lags, sixteen at a time, computes all three terms of a pixel and writes their rounded sum. Costs are
summed in 16 bits, in units of 1/256 (``PARTS_PER_COST``). The plain formulas of the terms are the references.
"""

from __future__ import annotations

from functools import partial
from typing import Annotated, Any, NamedTuple

import cv2
import numpy as np
import numpy.typing as npt
from pydantic import Field, model_validator

from stereolag.core.arrays import Array, EightBit, FloatMap
from stereolag.core.settings import Applies, Settings
from stereolag.loops.bands import in_threads, over_bands
from stereolag.loops.compilation import compiled
from stereolag.loops.memory import fill, volume
from stereolag.loops.vector_lanes import (
    LANES,
    cast,
    high_product,
    item,
    lanes_for,
    larger,
    load,
    paired_products,
    put,
    smaller,
    splat,
    store,
    summed_bit_counts,
)

MAX_COST = 250
"""Largest sum of the weights: a volume stores costs in 8 bits."""


class MatchingCost(Settings):
    """Cost of a mismatch: window correlation plus finer terms that keep edges sharp."""

    correlation: int = Field(
        default=100,
        title="Correlation",
        description="Cost of windows that are each other's negative (ZNCC -1); +1 costs nothing.",
        ge=0,
        le=100,
    )
    census: int = Field(
        default=100,
        title="Census",
        description="Cost where all of the 5 × 5 neighbours have changed from darker to brighter or back.",
        ge=0,
        le=100,
    )
    gradient: int = Field(
        default=40,
        title="Gradient",
        description="Cost of a horizontal gradient that differs by the limit or more.",
        ge=0,
        le=50,
    )
    gradient_limit: Annotated[int, Applies(lambda settings: settings.gradient > 0, "needs gradient above 0")] = Field(
        default=8,
        title="Gradient limit",
        description="Difference of gradients, grey levels of 255, above which the cost no longer rises.",
        ge=1,
        le=64,
    )

    @model_validator(mode="after")
    def _highest_is_allowed(self) -> MatchingCost:
        if not 0 < self.highest <= MAX_COST:
            raise ValueError(
                f"correlation, census and gradient add up to {self.highest}; allowed are 1 to {MAX_COST} together."
            )
        return self

    @property
    def highest(self) -> int:
        """Return the cost of a complete mismatch, at most :data:`MAX_COST`."""
        return self.correlation + self.census + self.gradient


Volume = npt.NDArray[np.float64]
"""(H, W, W) cost of each pixel of the left image with each pixel in the same row of the right image."""

Costs = npt.NDArray[np.uint8]

NOISE_GREYS = 2.0
"""Standard deviation of the noise, grey levels of 255: a window of lower contrast correlates with nothing."""

BORDER = cv2.BORDER_REFLECT_101
"""Windows at the border of an image extend into its mirror image."""

PARTS_PER_COST = 256
"""Parts of a unit of cost, in which terms are summed: the parts of MAX_COST fit in 16 bits."""


class Features(NamedTuple):
    """Features of one image that the terms compare, each (H, W), except that `levels` have a border of the radius."""

    levels: npt.NDArray[Any]
    """int16 grey levels minus 128; int32 for the right image, see :func:`right_features`."""
    total: npt.NDArray[np.float32]
    """Sum of these levels over the window around every pixel."""
    inverse: npt.NDArray[np.float32]
    """Inverse square root of the window's energy about its mean."""
    gradient: npt.NDArray[np.int16]
    """Horizontal Sobel filter."""
    census: npt.NDArray[np.uint16]
    """The low 16 bits of the census words."""
    census_high: npt.NDArray[np.uint16]
    """The 8 bits above."""


def features(image: EightBit, radius: int) -> Features:
    """Return the features of an image for windows of a radius."""
    side = 2 * radius + 1
    levels = np.subtract(image, 128, dtype=np.int16)
    total, energy = (
        np.asarray(blur(levels, cv2.CV_32F, (side, side), normalize=False, borderType=BORDER), np.float32)
        for blur in (cv2.boxFilter, cv2.sqrBoxFilter)
    )
    _invert(total, np.float32(1 / side**2), np.float32(side**2 * NOISE_GREYS**2), energy)
    low, high = census(image)
    return Features(
        levels=cv2.copyMakeBorder(levels, radius, radius, radius, radius, BORDER),
        total=total,
        inverse=energy,
        gradient=np.asarray(cv2.Sobel(image, cv2.CV_16S, 1, 0), np.int16),
        census=low,
        census_high=high,
    )


@compiled
def _invert(total: FloatMap, share: Any, noise: Any, energy: FloatMap) -> None:
    """Convert sums of squares over windows into inverse square roots of the energy about the mean, plus noise."""
    for y in range(total.shape[0]):
        for x in range(total.shape[1]):
            about_mean = energy[y, x] + (noise - total[y, x] * total[y, x] * share)
            energy[y, x] = np.float32(1) / np.sqrt(about_mean)


def right_features(image: EightBit, radius: int, before: int, after: int) -> Features:
    """Return the features of the right image, mirrored left to right, so that larger lags are at larger addresses.

    They have `before` and `after` more columns at the ends, so that every lag can be read. The high 16 bits of each
    level hold the level one window's height above, which leaves the window when this one enters.
    """
    found, side = features(image, radius), 2 * radius + 1
    levels = found.levels.view(np.uint16).astype(np.int32)
    levels[side:] |= np.left_shift(found.levels[:-side], 16, dtype=np.int32)

    def framed(array: Array) -> Array:
        rows, cols = array.shape
        frame = np.zeros((rows, before + cols + after), array.dtype)
        cv2.flip(array, 1, dst=frame[:, before : before + cols])
        return frame

    return Features(*(framed(one) for one in found._replace(levels=levels)))


def correlation_reference(left: EightBit, right: EightBit, radius: int, settings: MatchingCost) -> Volume:
    """Return the cost of the correlation term from its formula."""
    side = 2 * radius + 1
    mean_free, norms = [], []
    for image in (left, right):
        padded = np.pad(image.astype(float), radius, mode="reflect")
        windows = np.lib.stride_tricks.sliding_window_view(padded, (side, side))
        mean_free.append(windows - windows.mean(axis=(2, 3), keepdims=True))
        norms.append(np.sqrt((mean_free[-1] ** 2).sum(axis=(2, 3)) + (side * NOISE_GREYS) ** 2))
    scores = np.einsum("yxij,yzij->yxz", *mean_free) / (norms[0][:, :, None] * norms[1][:, None, :])
    return np.asarray(settings.correlation * (1 - scores) / 2)


CENSUS_RADIUS = 2
"""Radius of the census window, px."""

CENSUS_BITS = (2 * CENSUS_RADIUS + 1) ** 2 - 1
"""Number of neighbours in the census window, each a bit of the census word; the first 8 are its high bits."""

Words = npt.NDArray[np.uint16]


def census(image: npt.NDArray[Any]) -> tuple[Words, Words]:
    """Return the low 16 and the high 8 bits of the census words: one bit per 5 × 5 neighbour, set if it is darker.

    The neighbours are in reading order; the image is mirrored at its borders. Any increasing change of brightness
    leaves the words unchanged.
    """
    padded = cv2.copyMakeBorder(image, CENSUS_RADIUS, CENSUS_RADIUS, CENSUS_RADIUS, CENSUS_RADIUS, BORDER)
    low, high = np.zeros(image.shape, np.uint16), np.zeros(image.shape, np.uint16)
    _census_rows(padded, low, high)
    return low, high


@compiled
def _census_rows(padded: npt.NDArray[Any], low: Words, high: Words) -> None:
    side, stride, width = 2 * CENSUS_RADIUS + 1, padded.shape[1], low.shape[1]
    for y in range(low.shape[0]):
        centre = (y + CENSUS_RADIUS) * stride + CENSUS_RADIUS
        for bit in range(CENSUS_BITS):
            place = bit if bit < CENSUS_BITS // 2 else bit + 1  # the pixel itself is not a neighbour
            neighbour = (y + place // side) * stride + place % side
            _add_bit(padded, neighbour, centre, high if bit < CENSUS_BITS - 16 else low, y * width, width)


@compiled
def _add_bit(padded: Array, neighbour: int, centre: int, words: Words, at: int, count: int) -> None:
    """Append one bit to `count` words from place `at` on: whether the neighbour is darker than the centre."""
    for x in range(count):
        darker = np.uint16(item(padded, neighbour + x) < item(padded, centre + x))
        put(words, at + x, np.uint16(np.uint16(item(words, at + x) << np.uint16(1)) | darker))


def census_reference(image: npt.NDArray[Any]) -> npt.NDArray[np.uint32]:
    """Return the words of 24 bits expected of :func:`census`, computed with plain NumPy."""
    side, padded = 2 * CENSUS_RADIUS + 1, np.pad(image, CENSUS_RADIUS, mode="reflect")
    windows = np.lib.stride_tricks.sliding_window_view(padded, (side, side)).reshape(*image.shape, side**2)
    neighbours = np.delete(windows, CENSUS_BITS // 2, axis=2)
    return np.asarray((neighbours < image[:, :, None]) @ (1 << np.arange(CENSUS_BITS)[::-1]), np.uint32)


def census_cost_reference(left: EightBit, right: EightBit, settings: MatchingCost) -> Volume:
    """Return the cost of the census term from its formula."""
    words, others = census_reference(left), census_reference(right)
    return np.asarray(settings.census / CENSUS_BITS * np.bitwise_count(words[:, :, None] ^ others[:, None, :]))


SOBEL_UNIT = 4
"""The Sobel filter adds up four differences between grey levels two pixels apart."""


def gradient_reference(left: EightBit, right: EightBit, settings: MatchingCost) -> Volume:
    """Return the cost of the gradient term from its formula."""
    slopes = []
    for image in (left, right):
        padded = np.pad(image.astype(np.int64), 1, mode="reflect")
        smooth = padded[:-2] + 2 * padded[1:-1] + padded[2:]
        slopes.append((smooth[:, 2:] - smooth[:, :-2]) / SOBEL_UNIT)
    differences = np.abs(slopes[0][:, :, None] - slopes[1][:, None, :])
    return np.asarray(settings.gradient * np.minimum(differences / settings.gradient_limit, 1))


class Scale(NamedTuple):
    """Factors that convert a count into parts of cost: ``(min(count, cap) * shift * factor) >> 16``."""

    cap: int
    shift: int
    """A power of two with which the highest count just fits in 16 bits."""
    factor: int

    @staticmethod
    def of(weight: int, cap: int) -> Scale:
        """Return the scale at which a count of `cap` costs `weight`."""
        shift = 1 << (16 - cap.bit_length())
        return Scale(cap, shift, round(weight * PARTS_PER_COST / cap * 2**16 / shift))


class Weights(NamedTuple):
    """The settings in the form that the loop needs."""

    half: float
    """Cost of a correlation of 0, in parts."""
    census: Scale
    gradient: Scale
    out_of_frame: int
    """Cost of a lag that leads out of the frame."""


NOT_TRIED = 255
"""Cost of the lags after the last one tried, above :data:`MAX_COST`, so that no path ends there or passes through."""

OUT_OF_FRAME_SHARE = 0.28
"""Cost of a lag that leads out of the frame, as a share of the highest cost: between a good match and a mismatch."""


def matching_cost(
    left: EightBit,
    right: EightBit,
    *,
    window_size: int,
    min_disparity: int,
    num_disparities: int,
    settings: MatchingCost,
) -> Costs:
    """Return the cost of every pixel of the left image at every disparity.

    The cost is the sum of ZNCC on windows, truncated gradient difference, and Hamming distance of census words:
    correlation handles flat and noisy regions; the other two sharpen the edges that a window blurs (Hirschmüller &
    Scharstein, "Evaluation of stereo matching costs on images with radiometric differences", 2009; Mei et al., "On
    building an accurate stereo matching system on graphics hardware", 2011). A lag that leads out of the frame costs
    more than a match and less than a mismatch, so that the optimisation extends the neighbours' disparity to the border
    of the image.

    Parameters
    ----------
    left, right
        (H, W) uint8, see :func:`stereolag.core.inputs.as_eight_bit`.
    window_size
        Side of the correlation window, px; odd.
    min_disparity, num_disparities
        Range of disparities, px.
    settings
        Weights of the terms.

    Returns
    -------
    ndarray
        (H, W, D) uint8, 0..250, in whole strips of sixteen; :data:`NOT_TRIED` from ``num_disparities`` on.
    """
    radius = window_size // 2
    lanes = lanes_for(num_disparities)
    before, after = max(0, -min_disparity), max(0, min_disparity + lanes - 1)
    here, there = in_threads([partial(features, left, radius), partial(right_features, right, radius, before, after)])
    weights = Weights(
        half=settings.correlation * PARTS_PER_COST / 2,
        census=Scale.of(settings.census, CENSUS_BITS),
        gradient=Scale.of(settings.gradient, settings.gradient_limit * SOBEL_UNIT),
        out_of_frame=int(OUT_OF_FRAME_SHARE * settings.highest),
    )
    # The column of the right features that column 0 is compared with at the first lag.
    origin = left.shape[1] - 1 + before + min_disparity
    lags = min_disparity, num_disparities
    costs = volume((*left.shape, lanes), np.uint8)
    over_bands(lambda first, end: cost_rows(here, there, radius, lags, origin, weights, first, end, costs), len(left))
    return costs


@compiled
def cost_rows(
    left: Features,
    right: Features,
    radius: int,
    tried: tuple[int, int],
    origin: int,
    weights: Weights,
    first: int,
    end: int,
    costs: Costs,
) -> None:
    """Set the costs of rows `first` to `end`.

    Products are summed down each column of the window once and then along the row, so that the time does not depend on
    the window's size.

    Parameters
    ----------
    left, right
        From :func:`features` and :func:`right_features`.
    radius
        Radius of the correlation window, px.
    tried
        Disparity of the first lag, px, and number of lags.
    origin
        Column of the right features that column 0 of the left image is compared with at the first lag.
    weights
        The settings.
    costs
        (H, W, lags).
    """
    width, lags, side = costs.shape[1], costs.shape[2], 2 * radius + 1
    columns, window = np.zeros((width + side - 1) * lags, np.int32), np.zeros(lags, np.int32)
    levels, right_levels = left.levels, right.levels
    for row in range(first, first + side - 1):
        for col in range(width + side - 1):
            pixel = splat(np.int32(levels[row, col]) & np.int32(0xFFFF), np.int32)
            there = row * right_levels.shape[1] + origin + 2 * radius - col
            for lag in range(0, lags, LANES):
                at = col * lags + lag
                product = paired_products(load(right_levels, there + lag), pixel)
                store(columns, at, load(columns, at) + product)
    for y in range(first, end):
        fill(window, 0)
        _cost_row(left, right, radius, origin, weights, y, y > first, columns, window, costs)
        for x in range(width):
            # Lag k leads to ``column - k`` of the right image.
            column = x - tried[0]
            if column < tried[1] - 1:
                fill(costs[y, x, max(0, column + 1) :], weights.out_of_frame)
            if column >= width:
                fill(costs[y, x, : column - width + 1], weights.out_of_frame)
            if tried[1] < lags:
                fill(costs[y, x, tried[1] :], NOT_TRIED)


@compiled
def _cost_row(
    left: Features,
    right: Features,
    radius: int,
    origin: int,
    weights: Weights,
    y: int,
    leaves: bool,
    columns: Array,
    window: Array,
    costs: Costs,
) -> None:
    """Set the costs of a row; if `leaves`, the level above the window leaves each column."""
    levels, totals, inverses, gradients, words, high_words = left
    right_levels, right_totals, right_inverses, right_gradients, right_words, right_high_words = right
    width, side = costs.shape[1], 2 * radius + 1
    share = np.float32(1 / side**2)
    lags = window.size
    stride = width + side - 1
    half = splat(weights.half, np.float32)
    # The shift truncates; half a unit makes it round, and 1 makes up for the fractions that the terms lose.
    shift, half_unit = splat(8, np.uint16), splat(PARTS_PER_COST // 2 + 1, np.uint16)
    gradient_cap, gradient_shift = splat(weights.gradient.cap, np.uint16), splat(weights.gradient.shift, np.uint16)
    gradient_factor = splat(weights.gradient.factor, np.uint16)
    bits_shift, bits_factor = splat(weights.census.shift, np.uint16), splat(weights.census.factor, np.uint16)
    bottom = y + side - 1
    for col in range(stride):
        leaving = np.int32(item(levels, (y - 1) * stride + col)) if leaves else np.int32(0)
        entering = np.int32(item(levels, bottom * stride + col))
        pixel = splat((entering & np.int32(0xFFFF)) - leaving * np.int32(65536), np.int32)
        # The levels have a border on both sides, so that mirrored ones begin twice the radius farther on.
        newest = bottom * right_levels.shape[1] + origin + 2 * radius - col
        here = col * lags
        if col < side - 1:
            for lag in range(0, lags, LANES):
                column = load(columns, here + lag) + paired_products(load(right_levels, newest + lag), pixel)
                store(columns, here + lag, column)
                store(window, lag, load(window, lag) + column)
            continue
        x = col - side + 1
        place = y * width + x
        mean = splat(item(totals, place) * share, np.float32)
        scale = splat(item(inverses, place) * weights.half, np.float32)
        gradient = splat(item(gradients, place), np.int16)
        word, high_word = splat(item(words, place), np.uint16), splat(item(high_words, place), np.uint16)
        there = y * right_totals.shape[1] + origin - x
        gone = x * lags
        for lag in range(0, lags, LANES):
            column = load(columns, here + lag) + paired_products(load(right_levels, newest + lag), pixel)
            store(columns, here + lag, column)
            products = load(window, lag) + column
            store(window, lag, products - load(columns, gone + lag))
            covariance = cast(products, np.float32) - mean * load(right_totals, there + lag)
            uncorrelated = half - covariance * scale * load(right_inverses, there + lag)
            other = load(right_gradients, there + lag)
            difference = smaller(cast(larger(gradient - other, other - gradient), np.uint16), gradient_cap)
            differing = summed_bit_counts(
                word ^ load(right_words, there + lag), high_word ^ load(right_high_words, there + lag)
            )
            total = (
                cast(cast(uncorrelated, np.int32), np.uint16)
                + high_product(difference * gradient_shift, gradient_factor)
                + high_product(differing * bits_shift, bits_factor)
                + half_unit
            )
            store(costs, place * lags + lag, cast(total >> shift, np.uint8))


def cost_reference(
    left: EightBit,
    right: EightBit,
    radius: int,
    smallest: int,
    count: int,
    out_of_frame: int,
    settings: MatchingCost,
) -> Volume:
    """Return the (H, W, count) costs expected of :func:`cost_rows` before rounding, computed with plain NumPy."""
    summed = correlation_reference(left, right, radius, settings) + census_cost_reference(left, right, settings)
    summed += gradient_reference(left, right, settings)
    x = np.arange(left.shape[1])
    other = x[:, None] - smallest - np.arange(count)
    inside = (other >= 0) & (other < left.shape[1])
    return np.where(inside, summed[:, x[:, None], np.where(inside, other, 0)], float(out_of_frame))
