"""Combined smoothing and filling: the weighted mean of a flow over surfaces bounded by image edges."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import numpy.typing as npt

from stereolag.core.arrays import Array, FloatMap
from stereolag.loops.bands import over_bands
from stereolag.loops.compilation import compiled
from stereolag.motion.pyramid import Flow

REACH = 4.0
"""Standard deviation of the averaging kernel on a uniform surface, px."""

EDGE = 15.0
"""Height of an edge that counts as much as a distance of :data:`REACH`, grey levels of 255."""

LEAST = np.float32(1e-6)
"""Least weight of a pixel, so that even an area without any certain pixel has a mean."""


def edge_aware_mean(flow: Flow, weight: FloatMap, guide: npt.NDArray[np.uint8]) -> Flow:
    """Return the weighted mean of the flow around every pixel, over neighbours on the same image surface.

    Pixels without weight are filled from those with weight, however far away: a neighbour's share falls with its
    distance along the surface, to which edges of the guide add (normalised convolution with the recursive filter of
    Gastal & Oliveira, "Domain transform for edge-aware image and video processing", 2011).

    Parameters
    ----------
    flow
        (2, H, W) px, finite.
    weight
        (H, W) float32, at least 0.
    guide
        (H, W) uint8.
    """
    ramp = np.exp(-math.sqrt(2) / REACH * (1 + REACH / EDGE * np.arange(256))).astype(np.float32)
    sure = np.maximum(weight, LEAST)
    planes = np.empty((3, *guide.shape), np.float32)
    np.multiply(flow, sure, out=planes[:2])
    planes[2] = sure
    over_bands(lambda first, end: _along_rows(planes, guide, ramp, first, end), guide.shape[0])
    over_bands(lambda first, end: _along_columns(planes, guide, ramp, first, end), guide.shape[1])
    return np.asarray(planes[:2] / planes[2])


@compiled(fastmath={"reassoc", "contract"})
def _along_rows(planes: Array, guide: Array, ramp: Array, first: int, end: int) -> None:
    """Filter rows `first` to `end` in both directions: each value passes a share, given by `ramp`, to the next."""
    cols = guide.shape[1]
    share = np.empty(cols, np.float32)
    for row in range(first, end):
        for col in range(1, cols):
            share[col] = ramp[abs(np.int64(guide[row, col]) - np.int64(guide[row, col - 1]))]
        a, b, c = planes[0, row], planes[1, row], planes[2, row]
        for col in range(1, cols):
            a[col] += share[col] * (a[col - 1] - a[col])
            b[col] += share[col] * (b[col - 1] - b[col])
            c[col] += share[col] * (c[col - 1] - c[col])
        for back in range(1, cols):
            col = cols - 1 - back
            a[col] += share[col + 1] * (a[col + 1] - a[col])
            b[col] += share[col + 1] * (b[col + 1] - b[col])
            c[col] += share[col + 1] * (c[col + 1] - c[col])


@compiled(fastmath={"reassoc", "contract"})
def _along_columns(planes: Array, guide: Array, ramp: Array, first: int, end: int) -> None:
    """Filter columns `first` to `end` in both directions, row by row to follow the memory layout."""
    rows = guide.shape[0]
    share = np.empty(end - first, np.float32)
    for row in range(1, rows):
        _shares(guide, row, ramp, first, share)
        for plane in range(3):
            _move_on(planes[plane, row - 1, first:end], planes[plane, row, first:end], share)
    for back in range(1, rows):
        row = rows - 1 - back
        _shares(guide, row + 1, ramp, first, share)
        for plane in range(3):
            _move_on(planes[plane, row + 1, first:end], planes[plane, row, first:end], share)


@compiled
def _shares(guide: Array, row: int, ramp: Array, first: int, share: Array) -> None:
    """Set the shares passed between a row and the one above it."""
    for col in range(share.size):
        share[col] = ramp[abs(np.int64(guide[row, first + col]) - np.int64(guide[row - 1, first + col]))]


@compiled(fastmath={"reassoc", "contract"})
def _move_on(source: Array, target: Array, share: Array) -> None:
    for col in range(target.size):
        target[col] += share[col] * (source[col] - target[col])


def edge_aware_mean_reference(flow: Flow, weight: FloatMap, guide: npt.NDArray[np.uint8]) -> Flow:
    """Return the result of :func:`edge_aware_mean` up to rounding, computed pixel by pixel in float64 for reference."""
    sure = np.maximum(weight, LEAST).astype(np.float64)
    planes = np.stack([flow[0] * sure, flow[1] * sure, sure])
    levels: Any = guide.astype(np.float64)
    for axis in (2, 1):
        line, edges = np.moveaxis(planes, axis, 0), np.moveaxis(levels, axis - 1, 0)
        share = np.exp(-math.sqrt(2) / REACH * (1 + REACH / EDGE * np.abs(np.diff(edges, axis=0))))
        for place in range(1, len(line)):
            line[place] += share[place - 1] * (line[place - 1] - line[place])
        for place in range(len(line) - 2, -1, -1):
            line[place] += share[place] * (line[place + 1] - line[place])
    return np.asarray(planes[:2] / planes[2], dtype=np.float32)
