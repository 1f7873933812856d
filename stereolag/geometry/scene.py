"""The scene in metres: its points, the distances between them, the ground, and the nearest obstacle."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import NamedTuple

import cv2
import numpy as np
import numpy.typing as npt

from stereolag.core.arrays import FloatMap, Mask, median
from stereolag.geometry.calibration import Calibration

MAX_POINTS = 100_000
"""Default maximum number of points of a cloud."""

NEIGHBOUR_RADIUS_PX = 2
"""Half the side of the square in which a pixel's neighbours on the same surface are counted."""

MAX_SURFACE_STEP_PX = 1.0
"""Maximum difference of the disparities of neighbours on one surface, px."""

MIN_NEIGHBOURS = 9
"""Of the 25 pixels in that square, itself included, the minimum on the same surface: the convex corner of a surface has
9, a straight edge 15, a line of 1 px only 5."""


def clean_point_cloud(
    calibration: Calibration,
    disparity: npt.ArrayLike,
    colour: npt.ArrayLike,
    *,
    max_points: int | None = MAX_POINTS,
) -> tuple[FloatMap, npt.NDArray[np.uint8]]:
    """Return :meth:`~stereolag.geometry.calibration.Calibration.point_cloud` without flying pixels: points and colours.

    Above `max_points`, a uniform random sample is returned, always the same; None keeps all.
    """
    measured = np.asarray(disparity, dtype=np.float32)
    points, colours = calibration.point_cloud(np.where(flying_pixels(measured), np.float32(np.nan), measured), colour)
    return (points, colours) if max_points is None else subsampled(points, colours, max_points)


def flying_pixels(disparity: npt.ArrayLike) -> npt.NDArray[np.bool_]:
    """Return the pixels whose disparity is not on a surface: isolated, or between a near and a far surface.

    Matchers smear the edges of objects over a few pixels with disparities between those of the two sides; as points
    they form curtains behind every edge. A pixel is kept if at least 9 of the 25 pixels within ±2 px, including itself,
    have the same disparity to within 1 px: the error of disparities, unlike that of depths, does not grow with
    distance.

    Parameters
    ----------
    disparity
        (rows, cols), px; NaN where there is none.

    Returns
    -------
    flying
        (rows, cols) bool; False where there is no disparity.

    Raises
    ------
    ValueError
        A disparity that is not two-dimensional.
    """
    values = np.asarray(disparity, dtype=np.float32)
    if values.ndim != 2:
        raise ValueError(f"disparity has shape {values.shape}; allowed is (rows, cols).")
    known = np.isfinite(values)
    values = np.where(known, values, np.float32(np.nan))
    rows, cols = values.shape
    around = np.pad(values, NEIGHBOUR_RADIUS_PX, mode="reflect")  # the border of the image is not an edge of a surface
    neighbours = np.zeros(values.shape, dtype=np.uint8)
    for row in range(2 * NEIGHBOUR_RADIUS_PX + 1):
        for col in range(2 * NEIGHBOUR_RADIUS_PX + 1):
            neighbours += np.abs(around[row : row + rows, col : col + cols] - values) <= MAX_SURFACE_STEP_PX
    return known & (neighbours < MIN_NEIGHBOURS)


def subsampled(
    points: FloatMap, colours: npt.NDArray[np.uint8], max_points: int = MAX_POINTS
) -> tuple[FloatMap, npt.NDArray[np.uint8]]:
    """Return at most `max_points` of the points and their colours: a uniform random sample, always the same.

    Taking every n-th point instead would show the image rows as stripes.

    Raises
    ------
    ValueError
        `max_points` below 1.
    """
    if max_points < 1:
        raise ValueError(f"max_points is {max_points}; allowed are whole numbers from 1.")
    if len(points) <= max_points:
        return points, colours
    chosen = np.sort(np.random.default_rng(0).choice(len(points), max_points, replace=False))
    return points[chosen], colours[chosen]


MIN_OPACITY = 0.35
"""Opacity of a cell with a single point."""

OPAQUE_POINTS = 12
"""Number of points from which a cell is opaque."""


@dataclass(frozen=True, eq=False)
class BirdsEyeView:
    """A point cloud on a grid of square cells, X to the right and Z, the distance, upwards.

    Attributes
    ----------
    picture
        (rows, cols, 4) uint8 RGBA: the mean colour of the points in each cell, the more opaque the more points there
        are. The first row is the *nearest*.
    left, near
        X and Z of the corner of the first cell, metres.
    cell
        Side of a cell, metres.
    """

    picture: npt.NDArray[np.uint8]
    left: float
    near: float
    cell: float


def birds_eye_view(points: npt.ArrayLike, colours: npt.ArrayLike, *, cells: int = 400) -> BirdsEyeView:
    """Return (n, 3) points, metres, and their colours seen from above, on a grid with `cells` along its longer side.

    Raises
    ------
    ValueError
        No points, arrays of other shapes, or fewer than one cell.
    """
    positions, rgb = np.asarray(points, dtype=np.float64), np.asarray(colours)
    if positions.ndim != 2 or positions.shape[1] != 3 or positions.shape != rgb.shape or not len(positions):
        raise ValueError(
            f"points has shape {positions.shape} and colours {rgb.shape}; both must be (n, 3), n at least 1."
        )
    if cells < 1:
        raise ValueError(f"cells is {cells}; allowed are whole numbers from 1.")
    ground = positions[:, [2, 0]]
    first, last = ground.min(axis=0), ground.max(axis=0)
    cell = float((last - first).max() / cells) or 1.0
    rows, cols = ((ground - first) / cell).astype(np.intp).clip(max=cells - 1).T
    shape = int(rows.max()) + 1, int(cols.max()) + 1
    index = rows * shape[1] + cols
    count = np.bincount(index, minlength=shape[0] * shape[1])
    sums = [np.bincount(index, weights=rgb[:, channel], minlength=count.size) for channel in range(3)]
    opacity = np.where(
        count, MIN_OPACITY + (1 - MIN_OPACITY) * np.minimum(1, np.log(count.clip(1)) / np.log(OPAQUE_POINTS)), 0
    )
    picture = np.column_stack([*(total / count.clip(1) for total in sums), 255 * opacity])
    return BirdsEyeView(
        picture=np.rint(picture).astype(np.uint8).reshape(*shape, 4),
        left=float(first[1]),
        near=float(first[0]),
        cell=cell,
    )


TYPICAL_DISPARITY_ERROR_PX = 0.25
"""Error of a disparity assumed without ground truth, px: that of a good subpixel match of well-textured windows."""

ASSUMED_FIELD_OF_VIEW_DEG = 60.0
"""Horizontal field of view assumed for an unknown camera, degrees; phones and webcams have 55 to 75."""


@dataclass(frozen=True)
class ImagePoint:
    """A point of the left image with its disparity, all px."""

    row: float
    col: float
    disparity: float


@dataclass(frozen=True)
class Distance:
    """A distance and its typical error, metres; NaN where a point has no depth."""

    metres: float
    error: float


def typical_error(disparity: npt.ArrayLike, ground_truth: npt.ArrayLike) -> float:
    """Return the median absolute error of the disparities with ground truth, px; NaN if there are none.

    The median, because a few gross mismatches say nothing about the accuracy of a good match.
    """
    error = np.subtract(disparity, ground_truth, dtype=np.float64)
    np.abs(error, out=error)
    known = error[error < np.inf]
    return median(known) if known.size else math.nan


def distance_between(
    calibration: Calibration,
    first: ImagePoint,
    second: ImagePoint,
    *,
    width: int,
    height: int,
    disparity_error: float = TYPICAL_DISPARITY_ERROR_PX,
) -> Distance:
    """Return the distance between two points of the scene, seen in a left image of `width` × `height` px.

    Its error is the component of the depth errors along the line between the points; `disparity_error` is the typical
    error of each disparity, px, and the two are assumed to be independent.
    """
    cx, cy = calibration.centre(width, height)
    rays = np.array([(point.col - cx, point.row - cy, calibration.focal_px) for point in (first, second)])
    rays /= calibration.focal_px  # to a depth of 1
    disparities = np.array([first.disparity, second.disparity])
    depths = calibration.depth(disparities).astype(np.float64)
    between = depths[1] * rays[1] - depths[0] * rays[0]
    metres = float(np.linalg.norm(between))
    if not math.isfinite(metres):
        return Distance(math.nan, math.nan)
    direction = between / metres if metres else np.array([0.0, 0.0, 1.0])
    errors = calibration.depth_uncertainty(disparities, disparity_error) * (rays @ direction)
    return Distance(metres, float(np.linalg.norm(errors)))


def calibration_from_distance(
    known: Calibration | None, disparity: float, distance_m: float, *, width: int
) -> Calibration:
    """Return the calibration of images `width` px wide that puts a point of `disparity` px at `distance_m` metres.

    One known distance determines only the product of focal length and baseline, which is enough for depths. The focal
    length, on which widths and heights depend, is kept from the `known` calibration; without one the camera is assumed
    to have a horizontal field of view of 60°.

    Raises
    ------
    ValueError
        A disparity that is not in front of infinity, or a distance that is not above 0.
    """
    start = known or Calibration(width / (2 * math.tan(math.radians(ASSUMED_FIELD_OF_VIEW_DEG / 2))), baseline_m=1.0)
    return replace(start, rig=None).with_known_distance(disparity, distance_m)


_COLUMN_STEP = 8
"""Every n-th column is enough to find the ground."""

_MIN_GROUND_ROWS = 16
"""Minimum number of rows with enough pixels."""

_MAX_GROUND_ERROR_PX = 1.0
"""Maximum difference of a row's median disparity from the ground's line, px."""

_MIN_GROUND_SHARE = 0.4
"""Minimum share of the rows below the middle that the ground must explain."""

_MIN_GROUND_RISE_PX = 4.0
"""Minimum increase of the ground's disparity from the middle row to the lowest, px: a wall's does not increase."""


class Ground(NamedTuple):
    """Level ground: its disparity in each row is ``slope * (row - horizon)``, px."""

    slope: float
    horizon: float

    def disparities(self, rows: int) -> FloatMap:
        """Return the (rows, 1) disparity of the ground in each row of a picture, px: negative above the horizon."""
        return np.float32(self.slope) * (np.arange(rows, dtype=np.float32)[:, None] - np.float32(self.horizon))


def ground_of(disparity: FloatMap, known: Mask | None = None) -> Ground | None:
    """Return the ground in the lower half of a disparity map; None if its rows do not agree on one.

    The ground is the line with which most of the rows' median disparities agree (the "v-disparity" of Labayrade, Aubert
    & Tarel, "Real time obstacle detection in stereovision on non flat road geometry", IV 2002). `known` are the valid
    pixels; None for all with a disparity.
    """
    first = disparity.shape[0] // 2
    lower = disparity[first:, ::_COLUMN_STEP]
    valid = np.isfinite(lower) if known is None else known[first:, ::_COLUMN_STEP]
    lower = np.where(valid, lower, np.float32(np.nan))
    count = valid.sum(axis=1)
    rows = np.flatnonzero(count >= max(5, lower.shape[1] / 20))  # with enough pixels for a median
    if rows.size < _MIN_GROUND_ROWS:
        return None
    # NaN is sorted last; NumPy's nanmedian takes ten times as long.
    ordered, index = np.sort(lower[rows], axis=1), np.arange(rows.size)
    medians = (ordered[index, (count[rows] - 1) // 2] + ordered[index, count[rows] // 2]).astype(np.float64) / 2
    rows = rows + first
    # Every pair of rows that are well apart, or some 512 of them, proposes a line.
    above, below = np.triu_indices(rows.size, k=rows.size // 4)
    thinned = slice(None, None, max(1, above.size // 512))
    above, below = above[thinned], below[thinned]
    slopes = (medians[below] - medians[above]) / (rows[below] - rows[above])
    offsets = medians[above] - slopes * rows[above]
    agreeing = np.abs(slopes[:, None] * rows + offsets[:, None] - medians) <= _MAX_GROUND_ERROR_PX
    best = int(np.argmax(agreeing.sum(axis=1)))
    if agreeing[best].sum() < _MIN_GROUND_SHARE * (disparity.shape[0] - first):
        return None
    slope, offset = np.polyfit(rows[agreeing[best]], medians[agreeing[best]], 1)
    rises = slope * (disparity.shape[0] - first) >= _MIN_GROUND_RISE_PX
    return Ground(float(slope), float(-offset / slope)) if rises else None


MIN_OBSTACLE_SHARE = 0.001
"""Minimum share of the pixels: anything smaller is more likely a mismatch than an obstacle."""

_OBSTACLE_HEIGHTS = (0.2, 2.0)
"""Range of heights above the ground of an obstacle, as a multiple of the camera's: excludes kerbs and bridges."""

_NO_SURFACE = np.iinfo(np.int16).min
"""Mark of the pixels without a disparity, and of small surfaces."""


def nearest_obstacle(disparity: npt.ArrayLike, measured: Mask | None = None) -> float:
    """Return the disparity of the nearest obstacle, px: robustly, the value that a thousandth of the pixels reach.

    Only surfaces of at least that size count: wrong matches are scattered in small patches.

    Parameters
    ----------
    disparity
        (H, W) px; NaN = none.
    measured
        (H, W) valid pixels; None for all with a disparity. If these show no ground, all pixels are used to find it.

    Returns
    -------
    disparity
        px; NaN if there is none. If a ground is found, its pixels and anything overhanging the road are excluded: the
        height of a point above the ground, as a share of the camera's, is ``1 - d_ground / d``.

    Raises
    ------
    ValueError
        If the array is not (H, W).
    """
    values = np.asarray(disparity, dtype=np.float32)
    if values.ndim != 2 or values.size == 0:
        raise ValueError(f"disparity has shape {values.shape}; allowed is (rows, cols) with at least one pixel.")
    known = np.isfinite(values) if measured is None else measured
    ground = ground_of(values, known) or ground_of(values)
    min_disparity = np.zeros((len(values), 1), np.float32)
    if ground is not None:
        lowest, highest = (ground.disparities(len(values)) / np.float32(1 - height) for height in _OBSTACLE_HEIGHTS)
        # Both heights bound the disparity from below: 1 - 2.0 is negative, which counts above the horizon.
        min_disparity = np.maximum(0, np.maximum(lowest, highest))
    rank = max(1, round(MIN_OBSTACLE_SHARE * values.size))
    sixteenths = np.full(values.shape, _NO_SURFACE, np.int16)
    sixteenths[known] = np.clip(16 * values[known], _NO_SURFACE + 1, np.iinfo(np.int16).max)
    cv2.filterSpeckles(sixteenths, _NO_SURFACE, rank - 1, round(16 * MAX_SURFACE_STEP_PX))
    obstacles = values[(sixteenths != _NO_SURFACE) & (values > min_disparity)]
    return float(np.partition(obstacles, -rank)[-rank]) if obstacles.size >= rank else math.nan
