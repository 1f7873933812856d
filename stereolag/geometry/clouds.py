"""Point clouds for display: without flying pixels, with no more points than a browser can rotate, and from above."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from stereolag.geometry.calibration import Calibration, Float32Array

MOST_POINTS = 100_000
REACH = 2
"""Neighbours are counted in the square of ±2 px."""

FEWEST_NEIGHBOURS = 9
"""Of the 25 pixels in that square: the convex corner of a surface has 9, a straight edge 15, a line of 1 px only 5."""


def clean_point_cloud(
    calibration: Calibration,
    disparity: npt.ArrayLike,
    colour: npt.ArrayLike,
    *,
    max_points: int | None = MOST_POINTS,
) -> tuple[Float32Array, npt.NDArray[np.uint8]]:
    """Return the coloured points of a disparity map without its flying pixels.

    Parameters
    ----------
    calibration
        Turns the disparity into metres.
    disparity, colour
        (rows, cols) px and the left image, as for
        :meth:`~stereolag.geometry.calibration.Calibration.point_cloud`.
    max_points
        Above this number, an even random choice is returned, always the same; None keeps all.

    Returns
    -------
    points
        (n, 3) float32, metres: X to the right, Y down, Z forward.
    colours
        (n, 3) uint8 RGB.
    """
    measured = np.asarray(disparity, dtype=np.float32)
    points, colours = calibration.point_cloud(np.where(flying_pixels(measured), np.float32(np.nan), measured), colour)
    return (points, colours) if max_points is None else subsampled(points, colours, max_points)


def flying_pixels(disparity: npt.ArrayLike, *, tolerance: float = 1.0) -> npt.NDArray[np.bool_]:
    """Return where a disparity is on no surface: alone, or between a near and a far one.

    Matchers smear the edges of objects over a few pixels with disparities between those of the two sides; as points
    they form curtains behind every edge. A pixel is kept if at least 9 of the 25 pixels within ±2 px, including itself,
    have the same disparity to within the tolerance.

    Parameters
    ----------
    disparity
        (rows, cols), px; NaN where there is none.
    tolerance
        Px, from 0. It applies to the disparity, whose error, unlike the depth's, does not grow with the distance.

    Returns
    -------
    flying
        (rows, cols) bool; False where there is no disparity.

    Raises
    ------
    ValueError
        A disparity that is not two-dimensional, or a negative tolerance.
    """
    values = np.asarray(disparity, dtype=np.float32)
    if values.ndim != 2:
        raise ValueError(f"disparity has shape {values.shape}; allowed is (rows, cols).")
    if not tolerance >= 0:
        raise ValueError(f"tolerance is {tolerance} px; allowed are numbers from 0.")
    known = np.isfinite(values)
    values = np.where(known, values, np.float32(np.nan))
    rows, cols = values.shape
    around = np.pad(values, REACH, mode="reflect")  # the border of the image is not an edge of a surface
    neighbours = np.zeros(values.shape, dtype=np.uint8)
    for row in range(2 * REACH + 1):
        for col in range(2 * REACH + 1):
            neighbours += np.abs(around[row : row + rows, col : col + cols] - values) <= tolerance
    return known & (neighbours < FEWEST_NEIGHBOURS)


def subsampled(
    points: Float32Array, colours: npt.NDArray[np.uint8], max_points: int = MOST_POINTS
) -> tuple[Float32Array, npt.NDArray[np.uint8]]:
    """Return at most `max_points` of the points and their colours: an even random choice, always the same.

    Taking every n-th point instead would show the image rows as stripes.

    Raises
    ------
    ValueError
        Fewer than one point requested.
    """
    if max_points < 1:
        raise ValueError(f"max_points is {max_points}; allowed are whole numbers from 1.")
    if len(points) <= max_points:
        return points, colours
    chosen = np.sort(np.random.default_rng(0).choice(len(points), max_points, replace=False))
    return points[chosen], colours[chosen]


FAINTEST = 0.35
"""Opacity of a cell with a single point."""

FULL_AT = 12
"""Number of points from which a cell is opaque."""


@dataclass(frozen=True, eq=False)
class BirdsEyeView:
    """A point cloud on a grid of square cells, X to the right and Z, the distance, upwards.

    Attributes
    ----------
    picture
        (rows, cols, 4) uint8 RGBA: the mean colour of the points in each cell, more opaque the more points there are.
        The first row is the *nearest*.
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
        Number of cells along the longer side of the grid.

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
