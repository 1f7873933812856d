"""Running sums of the products of two images, for every lag: what a window correlation is made of.

A *column sum* holds the products of one image column over the window's height, for every lag. One row down it gains
the products that enter and loses those that leave (:func:`changing_rows`). A *window sum* slides right: one column sum gained and one lost. So
a window costs the same whatever its size. The lag is the innermost axis, in strips of sixteen
(:class:`stereolag.stereo.windows.search.LagTable`).

Of an image, ``at``, ``below`` and ``above`` count pixels from its first one, row after row; `offsets` lead from the
right pixel of the first lag to those of each strip. Sums of uint8 products are int32, and exact; other images have
float64 sums by the same code.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numba import types
from numba.extending import overload
from numpy.lib.stride_tricks import sliding_window_view

from stereolag.arrays import Array
from stereolag.loops.compilation import compiled
from stereolag.loops.vector_lanes import LANES, item, load, paired_products, splat, store


NEITHER, ENTERING, BOTH = 0, 1, 2
"""What a row does to the column sums that end in it: nothing, enter them, or enter as another leaves."""


def changing_rows(image: Array, window: int) -> Array:
    """Return the rows of an image as :func:`change` takes them.

    Parameters
    ----------
    image
        (H, W) uint8 or float64.
    window
        How many rows below a pixel lies the one at whose coming it leaves.

    Returns
    -------
    ndarray
        (H, W) int32 of uint8 images: the pixel that enters in the low 16 bits, the one that leaves in the high ones,
        0 where that would lie above the image. Others stay as they are.
    """
    if image.dtype != np.uint8:
        return image
    rows = image.astype(np.int32)
    rows[window:] |= rows[:-window] << 16
    return rows


def left_change(left: Array, at: int, back: int, which: int, rows: Array) -> Any:
    """Return a left pixel that enters, and the one `back` before it that leaves, in all lanes. In compiled code only."""


@overload(left_change, strict=False)
def _left_change_of_type(left: Any, at: Any, back: Any, which: Any, rows: Any) -> Any:
    def packed(left: Array, at: int, back: int, which: int, rows: Array) -> Any:
        enters = np.int32(item(left, at)) if which != NEITHER else np.int32(0)
        leaves = np.int32(item(left, at - back)) if which == BOTH else np.int32(0)
        return splat(enters - leaves * 65536, np.int32)

    def apart(left: Array, at: int, back: int, which: int, rows: Array) -> Any:
        enters = item(left, at) if which != NEITHER else 0.0
        leaves = item(left, at - back) if which == BOTH else 0.0
        return splat(enters, rows.dtype), splat(leaves, rows.dtype)

    return packed if isinstance(rows.dtype, types.Integer) else apart


def change(left: Any, rows: Array, at: int, back: int) -> Any:
    """Return by how much the products of a left pixel with sixteen right ones change. In compiled code only."""


@overload(change, strict=False)
def _change_of_type(left: Any, rows: Any, at: Any, back: Any) -> Any:
    def packed(left: Any, rows: Array, at: int, back: int) -> Any:
        return paired_products(load(rows, at), left)

    def apart(left: Any, rows: Array, at: int, back: int) -> Any:
        return left[0] * load(rows, at) - left[1] * load(rows, at - back)

    return packed if isinstance(rows.dtype, types.Integer) else apart


@compiled
def change_row(
    columns: Array,
    width: int,
    left: Array,
    left_at: int,
    left_back: int,
    right_rows: Array,
    right_at: int,
    right_back: int,
    offsets: Array,
    which: int,
) -> None:
    """Change the column sums by a row: ``columns[x, lag] += left[x] * right[x + lag]``, less what leaves."""
    at = 0
    for x in range(width):
        pixel = left_change(left, left_at + x, left_back, which, right_rows)
        for strip in range(offsets.size):
            there = right_at + x + item(offsets, strip)
            store(columns, at, load(columns, at) + change(pixel, right_rows, there, right_back))
            at += LANES


@compiled
def slide(window_sums: Array, columns: Array, entering: int, leaving: int) -> None:
    """Move the window sums right: column `entering` enters; `leaving` leaves, unless it is negative."""
    lags = columns.shape[1]
    keep = splat(1 if leaving >= 0 else 0, columns.dtype)
    gone = max(leaving, 0) * lags
    for lag in range(0, lags, LANES):
        total = load(window_sums, lag) + load(columns, entering * lags + lag)
        store(window_sums, lag, total - keep * load(columns, gone + lag))


@compiled
def move_down(image: Array, top: int, window: int, column_total: Array, column_square: Array) -> None:
    """Move the column sums of pixels and of their squares from row ``top - 1`` to row `top`."""
    for x in range(image.shape[1]):
        entering, leaving = image[top + window - 1, x], image[top - 1, x]
        column_total[x] += entering
        column_total[x] -= leaving
        column_square[x] += entering * entering
        column_square[x] -= leaving * leaving


@compiled
def fill_columns(image: Array, top: int, window: int, column_total: Array, column_square: Array) -> None:
    """Set the column sums of the rows from `top` to ``top + window``."""
    column_total[:] = 0
    column_square[:] = 0
    for y in range(top, top + window):
        for x in range(image.shape[1]):
            column_total[x] += image[y, x]
            column_square[x] += image[y, x] * image[y, x]


@compiled
def sum_columns(columns: Array, window: int, sums: Array) -> None:
    """Set ``sums[x] = columns[x : x + window].sum()``."""
    total = columns[0] - columns[0]
    for x in range(window - 1):
        total += columns[x]
    for x in range(sums.size):
        total += columns[x + window - 1]
        sums[x] = total
        total -= columns[x]


@compiled
def energies(total: Array, square: Array, share: float, energy: Array) -> None:
    """Set the sum of squared deviations from ``share * total``: the mean, or 0."""
    for x in range(energy.size):
        sum_of_window = np.float64(total[x])
        energy[x] = square[x] - sum_of_window * sum_of_window * share


@compiled
def inverse_roots(energy: Array, floor: float, inverse: Array) -> None:
    """Set ``1 / sqrt(energy)``, and NaN where the energy is no more than `floor`."""
    for x in range(energy.size):
        root = np.float32(1) / np.sqrt(np.float32(energy[x]))
        inverse[x] = root if energy[x] > floor else np.float32(np.nan)


@compiled
def describe_windows(
    image: Array,
    window: int,
    step: int,
    first: int,
    share: float,
    norm: float,
    floor: float,
    total: Array,
    inverse: Array,
    texture: Array,
) -> None:
    """Set total, inverse norm and texture of the windows of a grid from its row `first` on.

    Parameters
    ----------
    image
        (rows, cols).
    share
        ``1 / window**2`` for norms about the mean, 0 for norms about zero.
    norm
        Norm of every window, if above 0.
    floor
        Energy below which a window is flat.
    total, inverse
        (rows, cols) of the grid; the dtype of `total` must hold the sum of squares.
    texture
        The same: standard deviation. A flat window has none and, there, no inverse norm either. Empty if not asked for.
    """
    columns, width = image.shape[1], image.shape[1] - window + 1
    column_total, column_square = np.zeros(columns, total.dtype), np.zeros(columns, total.dtype)
    row_total, row_square = np.zeros(width, total.dtype), np.zeros(width, total.dtype)
    energy, root = np.zeros(width), np.zeros(width, np.float32)
    fill_columns(image, first * step, window, column_total, column_square)
    for row in range(total.shape[0]):
        if row > 0:
            for top in range((first + row - 1) * step + 1, (first + row) * step + 1):
                move_down(image, top, window, column_total, column_square)
        sum_columns(column_total, window, row_total)
        sum_columns(column_square, window, row_square)
        total[row] = row_total[::step]
        if norm > 0:
            inverse[row] = 1 / norm
        else:
            energies(row_total, row_square, share, energy)
            inverse_roots(energy, floor, root)
            inverse[row] = root[::step]
        if texture.size > 0:
            if norm > 0 or share == 0:
                energies(row_total, row_square, 1 / window**2, energy)
            for col in range(texture.shape[1]):
                flat = energy[col * step] <= floor
                texture[row, col] = 0 if flat else np.sqrt(np.float32(energy[col * step])) / window
                if flat:
                    inverse[row, col] = np.nan


def describe_windows_reference(
    image: Array, window: int, step: int, share: float, norm: float, floor: float
) -> tuple[Array, Array, Array]:
    """Return the total, inverse norm and texture that :func:`describe_windows` must set, from the first row on."""
    windows = sliding_window_view(image.astype(np.float64), (window, window))[::step, ::step]
    total, square = windows.sum((2, 3)), (windows**2).sum((2, 3))
    energy, about_mean = square - share * total**2, square - total**2 / window**2
    with np.errstate(divide="ignore", invalid="ignore"):
        inverse = np.full(total.shape, 1 / norm) if norm > 0 else np.where(energy > floor, 1 / np.sqrt(energy), np.nan)
        texture = np.where(about_mean > floor, np.sqrt(about_mean) / window, 0)
    return total, np.where(texture > 0, inverse, np.nan), texture
