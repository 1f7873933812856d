"""Running sums of the products of two images at every lag, the basis of window correlation.

A *column sum* is the sum of the products of one image column over the window's height, for every lag. Moving down one
row adds the products that enter and subtracts those that leave, both in one instruction if the pixels are whole numbers
(:func:`changing_rows`). A *window sum* slides right by adding one column sum and subtracting another, so a window costs
the same whatever its size. The lag is the innermost axis, in strips of sixteen
(:class:`stereolag.stereo.windows.search.LagTable`).

``at`` is an index into the flattened image, and ``back`` the distance from an entering pixel to the leaving one above
it; `offsets` lead from the right pixel of the first lag to those of each strip. Sums of uint8 products are int32, and
exact; other images have float64 sums in the same code.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numba import types
from numba.extending import overload
from numpy.lib.stride_tricks import sliding_window_view

from stereolag.core.arrays import Array
from stereolag.loops.compilation import compiled
from stereolag.loops.vector_lanes import LANES, item, load, paired_products, splat, store

NEITHER, ENTERING, BOTH = 0, 1, 2
"""How a row changes the column sums that end in it: not at all, by entering, or by entering as another leaves."""


def changing_rows(image: Array, window: int) -> Array:
    """Return the rows of an image as :func:`change` expects them.

    Parameters
    ----------
    image
        (H, W) uint8 or float64.
    window
        Height of the window: a pixel leaves when the one this many rows below enters.

    Returns
    -------
    ndarray
        (H, W) int32 for uint8 images: the entering pixel in the low 16 bits, the leaving one in the high ones, 0 where
        that would be above the image. Other images are returned unchanged.
    """
    if image.dtype != np.uint8:
        return image
    rows = image.astype(np.int32)
    rows[window:] |= rows[:-window] << 16
    return rows


def left_change(left: Array, at: int, back: int, which: int, rows: Array) -> Any:
    """Return an entering left pixel and the leaving one `back` before it, in all lanes; for compiled code only."""


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
    """Return the change in the products of a left pixel with sixteen right ones; for compiled code only."""


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
    """Change the column sums by a row: ``columns[x, lag] += left[x] * right[x + lag]``, minus the leaving products."""
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
def add_pixels(row: Array, pixels: Array, column_total: Array, column_square: Array) -> None:
    """Add an image row to the column sums of pixels and of squares; `pixels` is a buffer of the sums' type."""
    for x in range(row.size):
        pixels[x] = row[x]
    for x in range(row.size):
        column_total[x] += pixels[x]
        column_square[x] += pixels[x] * pixels[x]


@compiled
def take_pixels(row: Array, pixels: Array, column_total: Array, column_square: Array) -> None:
    """Subtract an image row from the column sums of pixels and of squares."""
    for x in range(row.size):
        pixels[x] = row[x]
    for x in range(row.size):
        column_total[x] -= pixels[x]
        column_square[x] -= pixels[x] * pixels[x]


@compiled
def sum_columns(columns: Array, count: int, window: int, span: Array, sums: Array) -> None:
    """Set ``sums[x] = columns[x : x + window].sum()`` for `count` windows.

    All three arrays have room for sixteen more. `span` is set to the sums of 1, 2, 4, ... neighbours in turn, and those
    that make up the window are added, so that no sum waits for the one beside it.
    """
    span[:] = columns
    sums[:] = 0
    done, width = 0, 1
    while width <= window:
        if window & width:
            for x in range(0, count, LANES):
                store(sums, x, load(sums, x) + load(span, x + done))
            done += width
        for x in range(0, count + window - 2 * width, LANES):
            store(span, x, load(span, x) + load(span, x + width))
        width *= 2


@compiled
def energies(total: Array, square: Array, share: float, energy: Array) -> None:
    """Set the sum of squared deviations from ``share * total``: the mean, or 0."""
    for x in range(energy.size):
        sum_of_window = np.float64(total[x])
        energy[x] = square[x] - sum_of_window * sum_of_window * share


@compiled
def inverse_roots(energy: Array, floor: float, inverse: Array) -> None:
    """Set ``1 / sqrt(energy)``, or NaN where the energy is at most `floor`."""
    for x in range(energy.size):
        known = np.float32(energy[x]) if energy[x] > floor else np.float32(np.nan)
        inverse[x] = np.float32(1) / np.sqrt(known)


@compiled
def deviations(energy: Array, floor: float, window: int, texture: Array) -> None:
    """Set the standard deviation, or 0 where the energy is at most `floor`."""
    for x in range(energy.size):
        known = np.float32(energy[x]) if energy[x] > floor else np.float32(0)
        texture[x] = np.sqrt(known) * np.float32(1 / window)


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
    """Set the total, inverse norm and texture of the windows of a grid, from its row `first` on.

    Parameters
    ----------
    image
        (rows, cols).
    share
        ``1 / window**2`` for norms about the mean, 0 for norms about zero.
    norm
        Norm of every window, if above 0.
    floor
        Energy up to which a window is flat.
    total, inverse
        (rows, cols) of the grid; the dtype of `total` must be wide enough for the sum of squares.
    texture
        (rows, cols) standard deviation, empty if not requested; if it is, a flat window gets 0, and NaN as inverse
        norm.
    """
    columns, width = image.shape[1], image.shape[1] - window + 1
    room = columns + 2 * LANES
    column_total, column_square = np.zeros(room, total.dtype), np.zeros(room, total.dtype)
    row_total, row_square = np.zeros(room, total.dtype), np.zeros(room, total.dtype)
    pixels, span = np.zeros(room, total.dtype), np.zeros(room, total.dtype)
    energy, root, deviation = np.zeros(width), np.zeros(width, np.float32), np.zeros(width, np.float32)
    for y in range(first * step, first * step + window - 1):
        add_pixels(image[y], pixels, column_total, column_square)
    for row in range(total.shape[0]):
        bottom = (first + row) * step + window - 1
        for y in range(bottom if row == 0 else bottom - step + 1, bottom + 1):
            add_pixels(image[y], pixels, column_total, column_square)
            if row > 0:
                take_pixels(image[y - window], pixels, column_total, column_square)
        sum_columns(column_total, width, window, span, row_total)
        sum_columns(column_square, width, window, span, row_square)
        total[row] = row_total[:width:step]
        if norm > 0:
            inverse[row] = 1 / norm
        else:
            energies(row_total, row_square, share, energy)
            inverse_roots(energy, floor, root)
            inverse[row] = root[::step]
        if texture.size > 0:
            if norm > 0 or share == 0:
                energies(row_total, row_square, 1 / window**2, energy)
            deviations(energy, floor, window, deviation)
            texture[row] = deviation[::step]
            for col in range(texture.shape[1]):
                inverse[row, col] = inverse[row, col] if texture[row, col] > 0 else np.float32(np.nan)


def describe_windows_reference(
    image: Array, window: int, step: int, share: float, norm: float, floor: float
) -> tuple[Array, Array, Array]:
    """Return the total, inverse norm and texture expected of :func:`describe_windows`, from the first row on."""
    windows = sliding_window_view(image.astype(np.float64), (window, window))[::step, ::step]
    total, square = windows.sum((2, 3)), (windows**2).sum((2, 3))
    energy, about_mean = square - share * total**2, square - total**2 / window**2
    with np.errstate(divide="ignore", invalid="ignore"):
        inverse = np.full(total.shape, 1 / norm) if norm > 0 else np.where(energy > floor, 1 / np.sqrt(energy), np.nan)
        texture = np.where(about_mean > floor, np.sqrt(about_mean) / window, 0)
    return total, np.where(texture > 0, inverse, np.nan), texture
