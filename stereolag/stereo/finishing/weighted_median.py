"""Weighted median: each pixel takes the middle value of its neighbours of like colour."""

from __future__ import annotations

from typing import Any

import cv2
import numpy as np
import numpy.typing as npt

from stereolag.arrays import Array, FloatMap
from stereolag.loops.bands import over_bands
from stereolag.loops.compilation import compiled

UNITS = 256
"""Values are compared in steps of 1/256."""

MISSING = np.iinfo(np.int32).min
TILE = 256
"""Pixels of a row that are worked on together: their neighbours stay in the processor's cache."""


def weighted_median(
    values: FloatMap, guide: npt.NDArray[np.uint8], radius: int, spacing: int, contrast: int
) -> FloatMap:
    """Return the weighted median of the values on a square grid around each pixel.

    That is the smallest value such that it and the smaller ones hold at least half of the weight. A neighbour weighs
    ``max(1, contrast * channels - difference)``, where the difference is that of the guide, summed over its channels.

    Parameters
    ----------
    values
        (H, W) float32; NaN = none: takes no part, and stays NaN.
    guide
        (H, W, channels) uint8.
    radius, spacing
        The neighbours lie at -radius, -radius + spacing, ..., radius both ways, px; the first is a multiple of the
        second.
    contrast
        Grey levels apart at which a neighbour all but loses its vote.

    Returns
    -------
    ndarray
        (H, W) float32, rounded to 1/256.
    """
    quantised = np.full(values.shape, MISSING, np.int32)
    known = np.isfinite(values)
    np.rint(values * np.float32(UNITS), out=quantised, where=known, casting="unsafe")
    border = (radius, radius, radius, radius)
    framed = cv2.copyMakeBorder(quantised, *border, cv2.BORDER_CONSTANT, value=MISSING)
    planes = np.stack(
        [
            cv2.copyMakeBorder(np.ascontiguousarray(plane), *border, cv2.BORDER_REPLICATE)
            for plane in np.moveaxis(guide, 2, 0)
        ]
    )
    out = np.empty(values.shape, np.int32)
    over_bands(
        lambda first, end: _median_rows(framed, planes, radius, spacing, contrast, first, end, out), values.shape[0]
    )
    return np.where(known, out.astype(np.float32) / np.float32(UNITS), np.float32(np.nan))


@compiled
def _median_rows(
    values: Array, planes: Array, radius: int, spacing: int, contrast: int, first: int, end: int, out: Array
) -> None:
    """Find the medians of rows `first` to `end`, many pixels at once, by halving the range that each may lie in.

    No sorting: how much weight lies at or below a value is a plain sum, the same for every pixel of the tile.
    """
    width, stride = out.shape[1], values.shape[1]
    side = 2 * (radius // spacing) + 1
    flat, pixels = values.reshape(-1), planes.reshape(-1)
    value, weight = np.empty(side * side * TILE, np.int32), np.empty(side * side * TILE, np.int32)
    low, high, total = np.empty(TILE, np.int32), np.empty(TILE, np.int32), np.empty(TILE, np.int32)
    middle, below = np.empty(TILE, np.int32), np.empty(TILE, np.int32)
    for y in range(first, end):
        for left in range(0, width, TILE):
            count = np.uint64(min(TILE, width - left))
            centre = np.uint64((y + radius) * stride + left + radius)
            for x in range(count):
                low[x] = high[x] = flat[centre + x]
                total[x] = 0
            for neighbour in range(side * side):
                place = np.uint64((y + neighbour // side * spacing) * stride + left + neighbour % side * spacing)
                votes = np.uint64(neighbour * TILE)
                _weigh(pixels, planes.shape[0], flat.size, centre, place, contrast, count, weight, votes)
                _vote(flat, centre, place, count, value, weight, votes, low, high, total)
            widest = 0
            for x in range(count):
                widest = max(widest, int(high[x]) - int(low[x]))
            while widest > 0:
                for x in range(count):
                    middle[x] = low[x] + ((high[x] - low[x]) >> 1)
                    below[x] = 0
                for neighbour in range(side * side):
                    _count(value, weight, np.uint64(neighbour * TILE), count, middle, below)
                _halve(total, count, middle, below, low, high)
                widest //= 2
            for x in range(count):
                out[y, left + int(x)] = low[x]


@compiled
def _weigh(
    pixels: Array,
    channels: int,
    plane: int,
    centre: Any,
    place: Any,
    contrast: int,
    count: Any,
    weight: Array,
    votes: Any,
) -> None:
    """Set the weight of one neighbour of each pixel of a tile.

    `centre` and `place` are where the tile and its neighbours begin in a plane of the guide, `votes` where their
    weights do.
    """
    most = np.int32(contrast * channels)
    for x in range(count):
        weight[votes + x] = most
    for channel in range(channels):
        here, there = np.uint64(channel * plane) + centre, np.uint64(channel * plane) + place
        for x in range(count):
            apart = np.int32(np.int32(pixels[there + x]) - np.int32(pixels[here + x]))
            weight[votes + x] -= max(apart, np.int32(-apart))


@compiled
def _vote(
    flat: Array,
    centre: Any,
    place: Any,
    count: Any,
    value: Array,
    weight: Array,
    votes: Any,
    low: Array,
    high: Array,
    total: Array,
) -> None:
    """Set the value of one neighbour of each pixel; a missing one repeats the middle and weighs nothing."""
    for x in range(count):
        known = flat[place + x] != np.int32(MISSING)
        number = flat[place + x] if known else flat[centre + x]
        votes_of = max(weight[votes + x], np.int32(1)) if known else np.int32(0)
        value[votes + x] = number
        weight[votes + x] = votes_of
        total[x] += votes_of
        low[x] = min(low[x], number)
        high[x] = max(high[x], number)


@compiled
def _count(value: Array, weight: Array, votes: Any, count: Any, middle: Array, below: Array) -> None:
    """Add the weight of one neighbour of each pixel to what lies at or below the middle of its range."""
    for x in range(count):
        below[x] += weight[votes + x] if value[votes + x] <= middle[x] else np.int32(0)


@compiled
def _halve(total: Array, count: Any, middle: Array, below: Array, low: Array, high: Array) -> None:
    """Keep the half of each range that holds the median."""
    for x in range(count):
        enough = 2 * below[x] >= total[x]
        high[x] = middle[x] if enough else high[x]
        low[x] = low[x] if enough else middle[x] + np.int32(1)


def weighted_median_reference(
    values: FloatMap, guide: npt.NDArray[np.uint8], radius: int, spacing: int, contrast: int
) -> FloatMap:
    """Return what :func:`weighted_median` must equal, pixel by pixel, for values that are whole 256ths."""
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
