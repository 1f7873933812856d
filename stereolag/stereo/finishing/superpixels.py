"""Superpixels: an image cut into patches of similar colour, each about as large as a given square."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from stereolag.core.arrays import Array, FloatMap
from stereolag.loops.bands import over_bands
from stereolag.loops.compilation import compiled

ROUNDS = 2
"""Number of times the pixels are assigned to patches; a third round does not improve the filling."""

AROUND = 7
"""Touching patches are within a square of this side on the grid: a pixel is at most one square from its patch."""


@dataclass(frozen=True, eq=False)
class Superpixels:
    """Image cut into patches, numbered row by row along a grid of squares.

    Attributes
    ----------
    labels
        (H, W) int32, the patch of each pixel: that of its own square, or of one of the eight around it.
    centres
        (patches, channels + 2) float32: mean colour, row and column of each patch. An empty one keeps its last centre.
    grid
        Number of squares down and across.
    """

    labels: npt.NDArray[np.int32]
    centres: FloatMap
    grid: tuple[int, int]


def superpixels(planes: FloatMap, side: int, contrast: float) -> Superpixels:
    """Return the superpixels of an image.

    R. Achanta et al., "SLIC superpixels compared to state-of-the-art superpixel methods", 2012, on a fixed grid: a
    pixel chooses among the patches of its own square and of the eight around it.

    Parameters
    ----------
    planes
        (channels, H, W) float32, grey levels.
    side
        Side of the squares of the grid, px.
    contrast
        Colour difference, levels per channel, that weighs as much as the side of a square.
    """
    channels, height, width = planes.shape
    grid = max(1, round(height / side)), max(1, round(width / side))
    rows = ((np.arange(grid[0]) + 0.5) * height / grid[0]).astype(np.int64)
    cols = ((np.arange(grid[1]) + 0.5) * width / grid[1]).astype(np.int64)
    at = np.repeat(rows, grid[1]), np.tile(cols, grid[0])
    centres = np.column_stack([*(plane[at] for plane in planes), *at]).astype(np.float32)
    weights = np.float32(1 / (channels * contrast**2)), np.float32(1 / side**2)
    labels = _nearest_patches(planes, centres, grid, weights)
    for _ in range(ROUNDS - 1):
        centres = mean_centres(planes, labels, centres)
        labels = _nearest_patches(planes, centres, grid, weights)
    return Superpixels(labels, mean_centres(planes, labels, centres), grid)


def _nearest_patches(
    planes: FloatMap, centres: FloatMap, grid: tuple[int, int], weights: tuple[Any, Any]
) -> npt.NDArray[np.int32]:
    labels = np.empty(planes.shape[1:], np.int32)
    over_bands(lambda first, end: choose_patches(planes, centres, grid, weights, first, end, labels), grid[0])
    return labels


@compiled
def choose_patches(
    planes: Array,
    centres: Array,
    grid: tuple[int, int],
    weights: tuple[Any, Any],
    first: int,
    end: int,
    labels: Array,
) -> None:
    """Assign every pixel in rows `first` to `end` of the grid to the nearest patch in colour and position.

    Ties go to the patch with the lower number. Equals :func:`choose_patches_reference`.
    """
    channels, height, width = planes.shape
    # The patches around each pixel are written out along the row, so that the loops over it vectorise.
    compared = np.empty((9, channels + 2, width), np.float32)
    numbers = np.empty((9, width), np.int32)
    nearest, away = np.empty(width, np.float32), np.empty(width, np.float32)
    nearest_patch = np.empty(width, np.int32)
    for row in range(first, end):
        _spread_centres(centres, grid, row, width, compared, numbers)
        for y in range(-(-row * height // grid[0]), -(-(row + 1) * height // grid[0])):
            nearest[:] = np.float32(np.inf)
            for one in range(9):
                _place_distances(compared, one, channels, np.float32(y), weights[1], away)
                for channel in range(channels):
                    _add_colour_distances(planes, channel, y, compared, one, weights[0], away)
                _keep_nearer(away, numbers, one, nearest, nearest_patch)
            labels[y] = nearest_patch


@compiled
def _spread_centres(
    centres: Array, grid: tuple[int, int], row: int, width: int, compared: Array, numbers: Array
) -> None:
    """Write out the centres and numbers of the nine patches around each column, at infinity where there is none."""
    for one in range(9):
        down = row + one // 3 - 1
        for x in range(width):
            across = x * grid[1] // width + one % 3 - 1
            inside = 0 <= down < grid[0] and 0 <= across < grid[1]
            numbers[one, x] = down * grid[1] + across if inside else 0
            for number in range(compared.shape[1]):
                compared[one, number, x] = centres[numbers[one, x], number] if inside else np.float32(np.inf)


@compiled
def _place_distances(compared: Array, one: int, channels: int, y: Any, weight: Any, away: Array) -> None:
    """Set the weighted squared distance of each pixel of a row from one of the patches around it."""
    for x in range(away.size):
        down, across = compared[one, channels, x] - y, compared[one, channels + 1, x] - np.float32(x)
        away[x] = (down * down + across * across) * weight


@compiled
def _add_colour_distances(
    planes: Array, channel: int, y: int, compared: Array, one: int, weight: Any, away: Array
) -> None:
    """Add the weighted squared difference from that patch in one channel."""
    for x in range(away.size):
        apart = planes[channel, y, x] - compared[one, channel, x]
        away[x] += apart * apart * weight


@compiled
def _keep_nearer(away: Array, numbers: Array, one: int, nearest: Array, nearest_patch: Array) -> None:
    """Assign to the patch the pixels that are nearer to it than to any before."""
    for x in range(away.size):
        nearer = away[x] < nearest[x]
        nearest_patch[x] = numbers[one, x] if nearer else nearest_patch[x]
        nearest[x] = away[x] if nearer else nearest[x]


@compiled
def mean_centres(planes: Array, labels: Array, before: Array) -> FloatMap:
    """Return the mean colour, row and column of each patch; an empty patch keeps those in `before`."""
    channels, height, width = planes.shape
    sums = np.zeros((before.shape[0], channels + 2), np.float64)
    counts = np.zeros(before.shape[0], np.int64)
    for y in range(height):
        for x in range(width):
            patch = labels[y, x]
            counts[patch] += 1
            sums[patch, channels] += y
            sums[patch, channels + 1] += x
            for channel in range(channels):
                sums[patch, channel] += planes[channel, y, x]
    out = before.copy()
    for patch in range(before.shape[0]):
        if counts[patch] > 0:
            for number in range(channels + 2):
                out[patch, number] = np.float32(sums[patch, number] / counts[patch])
    return out


def neighbours(grid: tuple[int, int]) -> npt.NDArray[np.int32]:
    """Return the numbers of the 7 × 7 patches around each on the grid, (patches, 49); its own beyond the grid."""
    number = np.arange(grid[0] * grid[1])
    down, across = np.divmod(np.arange(AROUND**2), AROUND)
    rows = number[:, None] // grid[1] + down - AROUND // 2
    cols = number[:, None] % grid[1] + across - AROUND // 2
    inside = (rows >= 0) & (rows < grid[0]) & (cols >= 0) & (cols < grid[1])
    return np.where(inside, rows * grid[1] + cols, number[:, None]).astype(np.int32)


@compiled
def borders(labels: Array, grid: tuple[int, int]) -> FloatMap:
    """Return (patches, 49, 3) float32: length and mean column and row of each patch's border with each neighbour."""
    height, width = labels.shape
    out = np.zeros((grid[0] * grid[1], AROUND * AROUND, 3), np.float32)
    middle = AROUND // 2
    for y in range(height):
        for x in range(width):
            for across in range(2):
                row, col = y + 1 - across, x + across
                if row == height or col == width or labels[row, col] == labels[y, x]:
                    continue
                one, other = labels[y, x], labels[row, col]
                place = (other // grid[1] - one // grid[1] + middle) * AROUND + other % grid[1] - one % grid[1] + middle
                for patch, number in ((one, place), (other, AROUND * AROUND - 1 - place)):
                    out[patch, number, 0] += 1
                    out[patch, number, 1] += x
                    out[patch, number, 2] += y
    for patch in range(out.shape[0]):
        for number in range(AROUND * AROUND):
            if out[patch, number, 0] > 0:
                out[patch, number, 1] /= out[patch, number, 0]
                out[patch, number, 2] /= out[patch, number, 0]
    return out


def choose_patches_reference(
    planes: FloatMap, centres: FloatMap, grid: tuple[int, int], weights: tuple[float, float]
) -> npt.NDArray[np.int32]:
    """Return the patches expected of :func:`choose_patches` for all pixels, computed with plain NumPy."""
    _, height, width = planes.shape
    y, x = np.indices((height, width), np.float32)
    square = np.arange(height)[:, None] * grid[0] // height, np.arange(width) * grid[1] // width
    number = np.arange(len(centres))[:, None, None]
    near = (abs(number // grid[1] - square[0]) <= 1) & (abs(number % grid[1] - square[1]) <= 1)
    *colours, rows, cols = centres.T[:, :, None, None]
    away = ((rows - y) ** 2 + (cols - x) ** 2) * weights[1]
    for plane, colour in zip(planes, colours, strict=True):
        away = away + (plane - colour) ** 2 * weights[0]
    return np.asarray(np.where(near, away, np.inf).argmin(axis=0), np.int32)
