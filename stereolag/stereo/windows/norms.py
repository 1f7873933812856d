"""Sums, norms and textures of all windows of an image."""

from __future__ import annotations

from typing import NamedTuple

import cv2
import numpy as np
from numpy.lib.stride_tricks import sliding_window_view

from stereolag.core.arrays import Array, DoubleMap, FloatMap
from stereolag.loops.compilation import compiled
from stereolag.loops.memory import fill


class Windows(NamedTuple):
    """Sums and norms of the windows of one image, (rows, cols)."""

    total: Array
    """Sum of the pixels."""
    inverse: FloatMap
    """1 / norm; NaN for an excluded window."""


class WindowNorms(NamedTuple):
    """Size, spacing and norm of the windows of an image."""

    window: int
    step: int
    share: float
    """``1 / window**2`` for norms about the mean, 0 for norms about zero."""
    norm: float
    """If above 0, the norm of every window, instead of its own."""
    floor: float
    """Energy up to which a window is flat."""


def describe_windows(
    image: Array, norms: WindowNorms, first: int, windows: Windows, where: tuple[int, int, int], texture: Array
) -> None:
    """Set the total, inverse norm and texture of the windows of a grid, from its row `first` on.

    Parameters
    ----------
    image
        (rows, cols).
    norms
        Size, spacing and norm of the windows.
    first
        Row of the grid.
    windows
        Set from row `where[0]` to row `where[1]`, and from column `where[2]` on; the dtype of their total, int32 or
        float64, must be wide enough for the sum of squares.
    texture
        (rows, cols) standard deviation, empty if not requested. If requested, that of a flat window is 0, and its
        inverse norm NaN.
    """
    side, step, (top, end, begin) = norms.window, norms.step, where
    rows = image[first * step : (first + end - top - 1) * step + side]
    depth = cv2.CV_32S if windows.total.dtype == np.int32 else cv2.CV_64F
    total, square = (
        np.ascontiguousarray(blur(rows, depth, (side, side), anchor=(0, 0), normalize=False)[::step, ::step])
        for blur in (cv2.boxFilter, cv2.sqrBoxFilter)
    )
    width = (image.shape[1] - side) // step + 1
    windows.total[top:end, begin : begin + width] = total[: end - top, :width]
    energy, (root, deviation) = np.empty(width), np.empty((2, width), np.float32)
    _set_norms(total, square, norms, where, windows.inverse, texture, energy, root, deviation)


@compiled(counted=False)
def _set_norms(
    total: Array,
    square: Array,
    norms: WindowNorms,
    where: tuple[int, int, int],
    inverse: FloatMap,
    texture: FloatMap,
    energy: DoubleMap,
    root: FloatMap,
    deviation: FloatMap,
) -> None:
    """Set the inverse norms and the textures as :func:`describe_windows` does; the last three are buffers."""
    (window, _, share, norm, floor), (top, end, begin) = norms, where
    for row in range(end - top):
        inverses = inverse[top + row, begin : begin + energy.size]
        _energies(total[row], square[row], share, energy)
        _roots(energy, floor, window, inverses, deviation)
        if norm > 0:
            fill(inverses, 1 / norm)
        if texture.size > 0:
            if share == 0:
                _energies(total[row], square[row], 1 / (window * window), energy)
                _roots(energy, floor, window, root, deviation)
            textures = texture[row]
            for col in range(textures.size):
                known = inverses[col]
                textures[col] = deviation[col]
                inverses[col] = known if deviation[col] > 0 else np.float32(np.nan)


@compiled(counted=False)
def _energies(total: Array, square: Array, share: float, energy: Array) -> None:
    """Set the sum of squared deviations from ``share * total``: the mean, or 0."""
    for x in range(energy.size):
        sum_of_window = np.float64(total[x])
        energy[x] = square[x] - sum_of_window * sum_of_window * share


@compiled(counted=False)
def _roots(energy: Array, floor: float, window: int, inverse: Array, deviation: Array) -> None:
    """Set ``1 / sqrt(energy)`` and the standard deviation; NaN and 0 where the energy is at most `floor`."""
    for x in range(energy.size):
        known = energy[x] > floor
        root = np.sqrt(np.float32(energy[x]) if known else np.float32(np.nan))
        inverse[x] = np.float32(1) / root
        deviation[x] = root * np.float32(1 / window) if known else np.float32(0)


def describe_windows_reference(image: Array, norms: WindowNorms) -> tuple[Array, Array, Array]:
    """Return the total, inverse norm and texture expected of :func:`describe_windows`, from the first row on."""
    window, step, share, norm, floor = norms
    windows = sliding_window_view(image.astype(np.float64), (window, window))[::step, ::step]
    total, square = windows.sum((2, 3)), (windows**2).sum((2, 3))
    energy, about_mean = square - share * total**2, square - total**2 / window**2
    with np.errstate(divide="ignore", invalid="ignore"):
        inverse = np.full(total.shape, 1 / norm) if norm > 0 else np.where(energy > floor, 1 / np.sqrt(energy), np.nan)
        texture = np.where(about_mean > floor, np.sqrt(about_mean) / window, 0)
    return total, np.where(texture > 0, inverse, np.nan), texture
