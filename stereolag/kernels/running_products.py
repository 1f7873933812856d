"""Running sums of the products of two images, for every lag: what a window correlation is made of.

A *column sum* holds the products of one image column over the window's height, for every lag. One row down it gains
the products that enter and loses those that leave. A *window sum* slides right: one column sum gained and one lost. So
a window costs the same whatever its size. The lag is the innermost axis, in strips of sixteen
(:class:`stereolag.kernels.lag_range.LagTable`).

Of an image, ``at``, ``below`` and ``above`` count pixels from its first one, row after row; `offsets` lead from the
right pixel of the first lag to those of each strip. Sums of uint8 products are int32, and exact; other images have
float64 sums by the same code.
"""

from __future__ import annotations

from typing import Any

import numpy.typing as npt

from stereolag.kernels.compilation import compiled
from stereolag.kernels.lanes import LANES, cast, item, load, splat, store

Array = npt.NDArray[Any]


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
