"""Point clouds fit to be looked at: without flying pixels, and no more points than a browser can turn."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from stereolag.calibration import Calibration, Float32Array

MOST_POINTS = 100_000
REACH = 2
"""Px; neighbours are looked for in the square of ±2 px."""

FEWEST_NEIGHBOURS = 9
"""Of the 25 pixels of that square: the convex corner of a surface has 9, a straight edge 15, a line of 1 px only 5."""


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
        What turns the disparity into metres.
    disparity, colour
        (rows, cols) px and the left image, as :meth:`~stereolag.calibration.Calibration.point_cloud` takes them.
    max_points
        Of more than that an even random choice is returned, the same every time; None keeps all.

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
    """Return where a disparity hangs in the air: on no surface, but alone or between a near and a far one.

    Matchers smear the edges of things over a few pixels, whose disparities lie between those of both sides; as points
    they form curtains behind every edge. A pixel is kept if at least 9 of the 25 pixels within ±2 px, itself among
    them, have its disparity give or take the tolerance.

    Parameters
    ----------
    disparity
        (rows, cols), px; NaN where there is none.
    tolerance
        Px, from 0. It is of the disparity, whose error, unlike that of the depth, does not grow with the distance.

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
    around = np.pad(values, REACH, mode="reflect")  # the frame of the picture is no edge of a surface
    neighbours = np.zeros(values.shape, dtype=np.uint8)
    for row in range(2 * REACH + 1):
        for col in range(2 * REACH + 1):
            neighbours += np.abs(around[row : row + rows, col : col + cols] - values) <= tolerance
    return known & (neighbours < FEWEST_NEIGHBOURS)


def subsampled(
    points: Float32Array, colours: npt.NDArray[np.uint8], max_points: int = MOST_POINTS
) -> tuple[Float32Array, npt.NDArray[np.uint8]]:
    """Return at most `max_points` of the points and their colours: an even random choice, the same every time.

    Every n-th point would do too, were it not that image rows then show as stripes.

    Raises
    ------
    ValueError
        Fewer than one point asked for.
    """
    if max_points < 1:
        raise ValueError(f"max_points is {max_points}; allowed are whole numbers from 1.")
    if len(points) <= max_points:
        return points, colours
    chosen = np.sort(np.random.default_rng(0).choice(len(points), max_points, replace=False))
    return points[chosen], colours[chosen]
