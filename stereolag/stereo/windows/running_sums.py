"""Running sums of the products of two images, for every lag: what a window correlation is made of.

A *column sum* holds the products of one image column over the window's height, for every lag. One row down it gains
the products that enter and loses those that leave. A *window sum* slides right: one column sum gained and one lost. So
a window costs the same whatever its size. The lag is the innermost axis, in strips of sixteen
(:class:`stereolag.stereo.windows.search.LagTable`).

Of an image, ``at``, ``below`` and ``above`` count pixels from its first one, row after row; `offsets` lead from the
right pixel of the first lag to those of each strip. Sums of uint8 products are int32, and exact; other images have
float64 sums by the same code.
"""

from __future__ import annotations

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view

from stereolag.arrays import Array
from stereolag.loops.compilation import compiled
from stereolag.loops.vector_lanes import LANES, cast, item, load, splat, store


@compiled
def add_row(columns: Array, width: int, left: Array, left_at: int, right: Array, right_at: int, offsets: Array) -> None:
    """Add one row's products to the column sums: ``columns[x, lag] += left[x] * right[x + lag]``."""
    at = 0
    for x in range(width):
        pixel = splat(item(left, left_at + x), columns.dtype)
        for strip in range(offsets.size):
            there = load(right, right_at + x + item(offsets, strip))
            store(columns, at, load(columns, at) + pixel * cast(there, columns.dtype))
            at += LANES


@compiled
def replace_row(
    columns: Array,
    width: int,
    left: Array,
    left_below: int,
    left_above: int,
    right: Array,
    right_below: int,
    right_above: int,
    offsets: Array,
) -> None:
    """Move the column sums down one row: the products of the row `below` enter, those of the row `above` leave."""
    at = 0
    for x in range(width):
        enters = splat(item(left, left_below + x), columns.dtype)
        leaves = splat(item(left, left_above + x), columns.dtype)
        for strip in range(offsets.size):
            offset = x + item(offsets, strip)
            gain = enters * cast(load(right, right_below + offset), columns.dtype)
            loss = leaves * cast(load(right, right_above + offset), columns.dtype)
            store(columns, at, load(columns, at) + gain - loss)
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
    """Set ``1 / sqrt(energy)``, and 0 where the energy is no more than `floor`."""
    for x in range(energy.size):
        root = np.float32(1) / np.sqrt(np.float32(energy[x]))
        inverse[x] = root if energy[x] > floor else np.float32(0)


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
                    inverse[row, col] = 0


def describe_windows_reference(
    image: Array, window: int, step: int, share: float, norm: float, floor: float
) -> tuple[Array, Array, Array]:
    """Return the total, inverse norm and texture that :func:`describe_windows` must set, from the first row on."""
    windows = sliding_window_view(image.astype(np.float64), (window, window))[::step, ::step]
    total, square = windows.sum((2, 3)), (windows**2).sum((2, 3))
    energy, about_mean = square - share * total**2, square - total**2 / window**2
    with np.errstate(divide="ignore", invalid="ignore"):
        inverse = np.full(total.shape, 1 / norm) if norm > 0 else np.where(energy > floor, 1 / np.sqrt(energy), 0)
        texture = np.where(about_mean > floor, np.sqrt(about_mean) / window, 0)
    return total, np.where(texture > 0, inverse, 0), texture
