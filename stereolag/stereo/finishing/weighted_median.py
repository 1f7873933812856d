"""Weighted median: each pixel takes the median value of its neighbours of similar colour."""

from __future__ import annotations

from typing import Any

import cv2
import numpy as np
import numpy.typing as npt

from stereolag.core.arrays import Array, FloatMap
from stereolag.loops.bands import over_bands
from stereolag.loops.compilation import compiled
from stereolag.loops.vector_lanes import LANES, are_equal, cast, halved, larger, load, splat, store, where_at_most

UNITS = 256
"""Values are compared in steps of 1/256."""


def weighted_median(
    values: FloatMap, guide: npt.NDArray[np.uint8], radius: int, spacing: int, contrast: int
) -> FloatMap:
    """Return the weighted median of the values on a square grid around each pixel.

    This is the smallest value such that it and all smaller ones have at least half of the total weight. A neighbour
    weighs ``max(1, contrast * channels - difference)``, where the difference is between the guide's pixels, summed over
    its channels.

    Parameters
    ----------
    values
        (H, W) float32; NaN = none: ignored, and stays NaN.
    guide
        (H, W, channels) uint8.
    radius, spacing
        The neighbours are at -radius, -radius + spacing, ..., radius in both directions, px; `radius` is a multiple of
        `spacing`.
    contrast
        Grey-level difference at which a neighbour loses almost all its weight.

    Returns
    -------
    ndarray
        (H, W) float32, rounded to 1/256.
    """
    height, width, channels = guide.shape
    least, most = np.fmin.reduce(values, axis=None) * UNITS, np.fmax.reduce(values, axis=None) * UNITS
    if np.isnan(least):
        return values.copy()
    votes = (2 * (radius // spacing) + 1) ** 2 * contrast * channels
    # Sixteen numbers of 16 bits take half the registers; the lowest number marks a missing value.
    narrow = most - least < np.iinfo(np.uint16).max - 4 and votes <= np.iinfo(np.int16).max
    dtype: type[np.int16 | np.int32] = np.int16 if narrow else np.int32
    middle = round((float(least) + float(most)) / 2)
    # The border has no values, and leaves room to load the last sixteen pixels of a row.
    beyond = radius + -width % LANES
    framed = np.full((height + 2 * radius, width + radius + beyond), np.iinfo(dtype).min, dtype)
    planes = np.stack(
        [
            cv2.copyMakeBorder(np.ascontiguousarray(plane), radius, radius, radius, beyond, cv2.BORDER_REPLICATE)
            for plane in np.moveaxis(guide, 2, 0)
        ]
    )
    out = np.empty(values.shape, np.float32)
    over_bands(lambda first, end: _quantise_rows(values, middle, radius, first, end, framed), height)
    over_bands(
        lambda first, end: _median_rows(framed, planes, radius, spacing, contrast, middle, first, end, out), height
    )
    return out


@compiled
def _quantise_rows(values: FloatMap, middle: int, radius: int, first: int, end: int, framed: Array) -> None:
    """Set rows `first` to `end`, inside a border of the radius, to 256ths minus `middle`; skip missing values."""
    for y in range(first, end):
        row, source = framed[y + radius], values[y]
        for x in range(source.size):
            known = source[x] == source[x]
            number = np.int32(np.rint(source[x] * np.float32(UNITS))) if known else np.int32(middle)
            row[x + radius] = number - np.int32(middle) if known else row[x + radius]


@compiled
def _median_rows(
    values: Array,
    planes: Array,
    radius: int,
    spacing: int,
    contrast: int,
    middle: int,
    first: int,
    end: int,
    out: FloatMap,
) -> None:
    """Find the medians of rows `first` to `end`, sixteen pixels at once.

    Parameters
    ----------
    values
        (H, W) inside a border of the radius, 256ths minus `middle`; the lowest number of the dtype marks a missing
        value.
    planes
        (channels, H, W) guide with the same border.
    """
    width, stride = out.shape[1], values.shape[1]
    side = 2 * (radius // spacing) + 1
    numbers, weights = np.empty(side * side * LANES, values.dtype), np.empty(side * side * LANES, values.dtype)
    found = np.empty(width + LANES, values.dtype)
    missing = values[0, 0]
    for y in range(first, end):
        for x in range(0, width, LANES):
            centre = (y + radius) * stride + x + radius
            at = 0
            for row in range(y, y + side * spacing, spacing):
                for place in range(row * stride + x, row * stride + x + side * spacing, spacing):
                    _weigh(planes, centre, place, contrast, weights, at)
                    at += LANES
            store(found, x, _median(values, centre, y * stride + x, side, spacing, numbers, weights))
        for x in range(width):
            known = values[y + radius, x + radius] != missing
            number = np.float32(np.int32(found[x]) + np.int32(middle)) / np.float32(UNITS)
            out[y, x] = number if known else np.float32(np.nan)


@compiled
def _weigh(planes: Array, centre: int, place: int, contrast: int, weights: Array, at: int) -> None:
    """Set the weights of one neighbour of each of sixteen pixels.

    `centre` and `place` are the start of the pixels and of their neighbours in a plane of the guide, `at` that of the
    weights.
    """
    channels, plane = planes.shape[0], planes.shape[1] * planes.shape[2]
    weight = splat(contrast * channels, weights.dtype)
    for channel in range(channels):
        here = cast(load(planes, channel * plane + centre), weights.dtype)
        there = cast(load(planes, channel * plane + place), weights.dtype)
        weight = weight - larger(here - there, there - here)
    store(weights, at, larger(weight, splat(1, weights.dtype)))


@compiled
def _median(values: Array, centre: int, corner: int, side: int, spacing: int, numbers: Array, weights: Array) -> Any:
    """Return the medians of sixteen pixels, by bisecting the range of each.

    Bisection needs no sorting: the weight at or below a value is a plain sum, the same operation for all pixels. The
    first neighbour is at `corner`; a missing one repeats the central value and gets no weight. If the central value is
    missing, the range is empty.
    """
    stride = values.shape[1]
    own = load(values, centre)
    nothing, missing = splat(0, values.dtype), splat(values[0, 0], values.dtype)
    low, high, total = own, own, nothing
    at = 0
    for row in range(corner, corner + side * spacing * stride, spacing * stride):
        for place in range(row, row + side * spacing, spacing):
            number = load(values, place)
            weight = where_at_most(number, missing, nothing, load(weights, at))
            number = where_at_most(number, missing, own, number)
            store(numbers, at, number)
            store(weights, at, weight)
            low, high = where_at_most(low, number, low, number), larger(high, number)
            total = total + weight
            at += LANES
    low, high = where_at_most(own, missing, own, low), where_at_most(own, missing, own, high)
    half = halved(total + splat(1, values.dtype))
    while not are_equal(low, high):
        middle, below = low + halved(high - low), nothing
        for at in range(0, side * side * LANES, LANES):
            below = below + where_at_most(load(numbers, at), middle, load(weights, at), nothing)
        low = where_at_most(half, below, low, middle + splat(1, values.dtype))
        high = where_at_most(half, below, middle, high)
    return low


def weighted_median_reference(
    values: FloatMap, guide: npt.NDArray[np.uint8], radius: int, spacing: int, contrast: int
) -> FloatMap:
    """Return the expected result of :func:`weighted_median`, pixel by pixel, for values that are whole 256ths."""
    height, width, channels = guide.shape
    out = values.copy()
    for y, x in np.argwhere(np.isfinite(values)):
        votes = sorted(
            (
                float(values[row, col]),
                max(1, contrast * channels - int(np.abs(guide[row, col].astype(int) - guide[y, x]).sum())),
            )
            for row in range(y - radius, y + radius + 1, spacing)
            for col in range(x - radius, x + radius + 1, spacing)
            if 0 <= row < height and 0 <= col < width and np.isfinite(values[row, col])
        )
        weights = np.cumsum([weight for _, weight in votes])
        out[y, x] = votes[int(np.searchsorted(2 * weights, weights[-1]))][0]
    return out
