"""Peaks at the ends of the search, which lack a neighbour in the cost volume."""

from __future__ import annotations

import math
from typing import Any

import cv2
import numpy as np

from stereolag.core.arrays import Array, EightBit, FloatMap, Mask
from stereolag.loops.bands import over_bands
from stereolag.loops.compilation import compiled
from stereolag.loops.vector_lanes import item
from stereolag.stereo.semi_global.cost import NOISE_GREYS

MIN_SCORE = 0.01
"""Lower scores are raised to this, so that all have a logarithm."""


def peaks_at_end(
    left: EightBit, right: EightBit, window_size: int, disparity: int, where: Mask
) -> tuple[Mask, FloatMap]:
    """Return where windows correlate no worse at a disparity than one px to either side, and the offset of the peak.

    One more lag on either side would make the whole volume a quarter slower to fill and to optimise, since its lags are
    processed in strips of sixteen. Few pixels are matched at an end of the search. There, without path costs to
    compare, the peak is located by the correlation alone: by a Gaussian through its three scores.

    Parameters
    ----------
    left, right
        (H, W) uint8.
    window_size
        Side of the windows, px; odd.
    disparity
        The disparity at that end, px.
    where
        (H, W) the pixels matched there.

    Returns
    -------
    tuple of ndarray
        (H, W) bool, and float32 offset, -0.5..0.5 px; False and 0 elsewhere, and where a neighbour is out of the frame.
    """
    inside, offset = np.zeros(where.shape, np.bool_), np.zeros(where.shape, np.float32)
    if where.any():
        here, there = (_framed(image, window_size // 2) for image in (left, right))
        over_bands(
            lambda first, end: fit_ends(here, there, disparity, where, first, end, inside, offset), where.shape[0]
        )
    return inside, offset


def _framed(image: EightBit, radius: int) -> Array:
    """Return the levels minus 128, which keep the sums small, with a border of the radius."""
    framed = cv2.copyMakeBorder(image, radius, radius, radius, radius, cv2.BORDER_REFLECT_101)
    return np.subtract(framed, 128, dtype=np.int16)


@compiled
def fit_ends(
    left: Array, right: Array, disparity: int, where: Mask, first: int, end: int, inside: Mask, offset: FloatMap
) -> None:
    """Fit the peaks of rows `first` to `end`; `left` and `right` have a border of the window's radius.

    Sums over the columns of the windows move down row by row. Equals :func:`fit_ends_reference`.
    """
    width, window = where.shape[1], left.shape[1] - where.shape[1] + 1
    low, high = max(0, disparity + 1), min(width, width + disparity - 1)
    top, bottom, begin, stop = end, first, high, low
    for y in range(first, end):
        for x in range(low, high):
            if where[y, x]:
                top, bottom, begin, stop = min(top, y), y + 1, min(begin, x), max(stop, x + 1)
    # Sums for each column of the compared part: the left levels and their squares, the right levels and their squares,
    # and the products one px below, at and above the disparity.
    columns = max(0, stop - begin) + window - 1
    sums, scores, ones = np.zeros((7, columns + 2), np.int32), np.empty(3), np.ones(columns + 2, np.int16)
    right_begin = begin - disparity - 1
    for y in range(top, bottom):
        if y > top:
            _add_row(left, right, y - 1, begin, right_begin, -1, ones, sums)
        for row in range(y if y == top else y + window - 1, y + window):
            _add_row(left, right, row, begin, right_begin, 1, ones, sums)
        for x in range(begin, stop):
            if not where[y, x]:
                continue
            mean, deviation = _spread(sums, 0, x - begin, window)
            for shift in range(3):
                other, norm = _spread(sums, 2, x - begin + 2 - shift, window)
                product = _total(sums, 4 + shift, x - begin, window) / (window * window)
                scores[shift] = (product - mean * other) / (deviation * norm)
            if scores[1] < scores[0] or scores[1] < scores[2]:
                continue
            inside[y, x] = True
            before, peak, after = _logarithm(scores[0]), _logarithm(scores[1]), _logarithm(scores[2])
            bend = 2 * peak - before - after
            offset[y, x] = (after - before) / (2 * bend) if bend > 0 else 0.0


@compiled
def _logarithm(score: float) -> float:
    return math.log(max(score, MIN_SCORE))


@compiled
def _add_row(
    left: Array, right: Array, row: int, begin: int, right_begin: int, sign: int, ones: Array, sums: Array
) -> None:
    """Add a row, times `sign`, to the sums, from column `begin` of the left and `right_begin` of the right image on.

    The compiler vectorises plain products of two rows.
    """
    size = sums.shape[1]
    here, there = left[row][begin : begin + size - 2], right[row][right_begin : right_begin + size]
    _add_products(here, ones, sign, sums[0, : size - 2])
    _add_products(here, here, sign, sums[1, : size - 2])
    _add_products(there, ones, sign, sums[2])
    _add_products(there, there, sign, sums[3])
    for shift in range(3):
        _add_products(here, there[2 - shift :], sign, sums[4 + shift, : size - 2])


@compiled
def _add_products(one: Array, other: Array, sign: int, sums: Array) -> None:
    for x in range(sums.size):
        sums[x] += np.int32(sign) * np.int32(one[x]) * np.int32(other[x])


@compiled
def _total(sums: Array, one: int, x: int, window: int) -> Any:
    total, begin = np.int32(0), one * sums.shape[1] + x
    for place in range(begin, begin + window):
        total += item(sums, place)
    return total


@compiled
def _spread(sums: Array, one: int, x: int, window: int) -> tuple[float, float]:
    """Return the mean and the deviation with noise of a window, from column sums `one` and the sums of squares next."""
    area = window * window
    mean = _total(sums, one, x, window) / area
    return mean, math.sqrt(_total(sums, one + 1, x, window) / area - mean * mean + NOISE_GREYS**2)


def fit_ends_reference(left: Array, right: Array, disparity: int, where: Mask, inside: Mask, offset: FloatMap) -> None:
    """Do what :func:`fit_ends` does for all rows, with plain NumPy."""
    width, window = where.shape[1], left.shape[1] - where.shape[1] + 1
    views = [np.lib.stride_tricks.sliding_window_view(one.astype(float), (window, window)) for one in (left, right)]
    for y, x in np.argwhere(where):
        if not 0 <= x - disparity - 1 <= x - disparity + 1 < width:
            continue
        here, *others = views[0][y, x], *(views[1][y, x - disparity - beside] for beside in (-1, 0, 1))
        norm = math.sqrt(here.var() + NOISE_GREYS**2)
        scores = [
            np.mean((here - here.mean()) * one) / (norm * math.sqrt(one.var() + NOISE_GREYS**2)) for one in others
        ]
        inside[y, x] = scores[1] >= max(scores)
        before, peak, after = np.log(np.maximum(scores, MIN_SCORE))
        bend = 2 * peak - before - after
        offset[y, x] = (after - before) / (2 * bend) if inside[y, x] and bend > 0 else 0.0
