"""A point cloud as seen from straight above."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

FAINTEST = 0.35
"""Opacity of a cell that holds a single point."""

FULL_AT = 12
"""Points from which on a cell is opaque."""


@dataclass(frozen=True, eq=False)
class BirdsEyeView:
    """A point cloud on a grid of square cells, X to the right and Z, the distance, upwards.

    Attributes
    ----------
    picture
        (rows, cols, 4) uint8 RGBA: the mean colour of the points in each cell, the more opaque the more there are. The
        first row is the *nearest*.
    left, near
        X and Z of the corner of the first cell, metres.
    cell
        Side of a cell, metres.
    """

    picture: npt.NDArray[np.uint8]
    left: float
    near: float
    cell: float


def seen_from_above(points: npt.ArrayLike, colours: npt.ArrayLike, *, cells: int = 400) -> BirdsEyeView:
    """Sort points into the cells of a grid on the ground.

    Parameters
    ----------
    points
        (n, 3) metres: X to the right, Y down, Z forward.
    colours
        (n, 3) uint8 RGB.
    cells
        How many cells the longer side of the grid has.

    Raises
    ------
    ValueError
        No points, arrays of other shapes, or fewer than one cell.
    """
    places, shades = np.asarray(points, dtype=np.float64), np.asarray(colours)
    if places.ndim != 2 or places.shape[1] != 3 or places.shape != shades.shape or not len(places):
        raise ValueError(
            f"points has shape {places.shape} and colours {shades.shape}; both must be (n, 3), n at least 1."
        )
    if cells < 1:
        raise ValueError(f"cells is {cells}; allowed are whole numbers from 1.")
    ground = places[:, [2, 0]]
    first, last = ground.min(axis=0), ground.max(axis=0)
    cell = float((last - first).max() / cells) or 1.0
    rows, cols = ((ground - first) / cell).astype(np.intp).clip(max=cells - 1).T
    shape = int(rows.max()) + 1, int(cols.max()) + 1
    index = rows * shape[1] + cols
    count = np.bincount(index, minlength=shape[0] * shape[1])
    sums = [np.bincount(index, weights=shades[:, band], minlength=count.size) for band in range(3)]
    opacity = np.where(count, FAINTEST + (1 - FAINTEST) * np.minimum(1, np.log(count.clip(1)) / np.log(FULL_AT)), 0)
    picture = np.column_stack([*(total / count.clip(1) for total in sums), 255 * opacity])
    return BirdsEyeView(
        picture=np.rint(picture).astype(np.uint8).reshape(*shape, 4),
        left=float(first[1]),
        near=float(first[0]),
        cell=cell,
    )
