"""Sums, norms and textures of all windows of an image, by running sums over rows and columns."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import numpy.typing as npt
from numpy.lib.stride_tricks import sliding_window_view

from stereolag.core.arrays import Array, DoubleMap, FloatMap
from stereolag.loops.compilation import compiled
from stereolag.loops.memory import fill
from stereolag.loops.vector_lanes import LANES, load, splat, store


class Windows(NamedTuple):
    """Sums and norms of the windows of one image, (rows, cols)."""

    total: Array
    """Sum of the pixels."""
    inverse: npt.NDArray[np.float32]
    """1 / norm; NaN for an excluded window."""


@compiled(counted=False)
def add_pixels(row: Array, pixels: Array, column_total: Array, column_square: Array) -> None:
    """Add an image row to the column sums of pixels and of squares; `pixels` is a buffer of the sums' type."""
    for x in range(row.size):
        pixels[x] = row[x]
    for x in range(row.size):
        column_total[x] += pixels[x]
        column_square[x] += pixels[x] * pixels[x]


@compiled(counted=False)
def slide_columns(enters: Array, leaves: Array, column_total: Array, column_square: Array) -> None:
    """Move the column sums of pixels and of squares down by a row: add one image row, and subtract another."""
    for x in range(enters.size):
        total, square = column_total[x], column_square[x]
        new, old = enters[x] + 0 * total, leaves[x] + 0 * total  # of the type of the sums
        column_total[x] = total + new - old
        column_square[x] = square + new * new - old * old


@compiled(counted=False)
def sum_columns(columns: Array, count: int, window: int, span: Array, sums: Array) -> None:
    """Set ``sums[x] = columns[x : x + window].sum()`` for `count` windows.

    All three arrays have room for sixteen more. `span` is set to the sums of 1, 2, 4, ... neighbours in turn, and those
    that make up the window are added, so that no sum waits for the one beside it.
    """
    done, width, keep = window & 1, 2, splat(window & 1, sums.dtype)
    for x in range(0, count + window - 1, LANES):
        column = load(columns, x)
        store(span, x, column + load(columns, x + 1))
        store(sums, x, keep * column)
    while width <= window:
        if window & width:
            for x in range(0, count, LANES):
                store(sums, x, load(sums, x) + load(span, x + done))
            done += width
        if 2 * width <= window:
            for x in range(0, count + window - 2 * width, LANES):
                store(span, x, load(span, x) + load(span, x + width))
        width *= 2


@compiled(counted=False)
def energies(total: Array, square: Array, share: float, energy: Array) -> None:
    """Set the sum of squared deviations from ``share * total``: the mean, or 0."""
    for x in range(energy.size):
        sum_of_window = np.float64(total[x])
        energy[x] = square[x] - sum_of_window * sum_of_window * share


@compiled(counted=False)
def roots(energy: Array, floor: float, window: int, inverse: Array, deviation: Array) -> None:
    """Set ``1 / sqrt(energy)`` and the standard deviation; NaN and 0 where the energy is at most `floor`."""
    for x in range(energy.size):
        known = energy[x] > floor
        root = np.sqrt(np.float32(energy[x]) if known else np.float32(np.nan))
        inverse[x] = np.float32(1) / root
        deviation[x] = root * np.float32(1 / window) if known else np.float32(0)


@compiled(counted=False)
def take_every(step: int, values: Array, row: Array) -> None:
    """Set the row to every `step`-th of the values; the loop without a step vectorises."""
    if step == 1:
        for x in range(row.size):
            row[x] = values[x]
    else:
        for x in range(row.size):
            row[x] = values[x * step]


class WindowNorms(NamedTuple):
    """The windows of an image that are described, and their norms."""

    window: int
    step: int
    share: float
    """``1 / window**2`` for norms about the mean, 0 for norms about zero."""
    norm: float
    """Norm of every window, if above 0."""
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
        The windows of the grid.
    first
        The first row of the grid.
    windows
        Set from row `where[0]` to row `where[1]` and from column `where[2]` on; the dtype of their total must be wide
        enough for the sum of squares.
    texture
        (rows, cols) standard deviation, empty if not requested; if it is, a flat window gets 0, and NaN as inverse
        norm.
    """
    width, dtype = image.shape[1], windows.total.dtype
    sums = [np.zeros(width + 2 * LANES, dtype) for _ in range(6)]
    floats = [np.empty(width - norms.window + 1, kind) for kind in (np.float64, np.float32, np.float32)]
    _describe_rows(image, norms, first, windows, where, texture, RowOfWindows._make([*sums, *floats]))


class RowOfWindows(NamedTuple):
    """Buffers for the windows of a row, one px apart; sums have room for two strips more than the image's width."""

    column_total: Array
    column_square: Array
    total: Array
    square: Array
    pixels: Array
    span: Array
    energy: DoubleMap
    inverse: FloatMap
    deviation: FloatMap


@compiled(counted=False)
def _describe_rows(
    image: Array,
    norms: WindowNorms,
    first: int,
    windows: Windows,
    where: tuple[int, int, int],
    texture: Array,
    row_buffers: RowOfWindows,
) -> None:
    """Set what :func:`describe_windows` does, row by row."""
    window, step, share, norm, floor = norms
    total, inverse = windows
    top, end, begin = where
    width = image.shape[1] - window + 1
    columns = slice(begin, begin + (width - 1) // step + 1)
    column_total, column_square, row_total, row_square, pixels, span, energy, root, deviation = row_buffers
    for y in range(first * step, first * step + window - 1):
        add_pixels(image[y], pixels, column_total, column_square)
    for row in range(end - top):
        sums, inverses = total[top + row, columns], inverse[top + row, columns]
        bottom = (first + row) * step + window - 1
        for y in range(bottom if row == 0 else bottom - step + 1, bottom + 1):
            if row > 0:
                slide_columns(image[y], image[y - window], column_total, column_square)
            else:
                add_pixels(image[y], pixels, column_total, column_square)
        sum_columns(column_total, width, window, span, row_total)
        sum_columns(column_square, width, window, span, row_square)
        take_every(step, row_total, sums)
        if norm > 0:
            fill(inverses, 1 / norm)
        else:
            energies(row_total, row_square, share, energy)
            roots(energy, floor, window, root, deviation)
            take_every(step, root, inverses)
        if texture.size > 0:
            about_mean = norm == 0 and share > 0
            if not about_mean:
                energies(row_total, row_square, 1 / (window * window), energy)
                roots(energy, floor, window, root, deviation)
            take_every(step, deviation, texture[row])
            # About the mean, a flat window has no inverse norm yet.
            for col in range(0 if about_mean else texture.shape[1]):
                known = inverses[col]
                inverses[col] = known if texture[row, col] > 0 else np.float32(np.nan)


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
