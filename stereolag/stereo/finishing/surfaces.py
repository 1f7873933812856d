"""Filling of gaps with slanted surfaces: a plane per patch of similar colour, fitted to nearby measurements."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from typing import Any, NamedTuple

import cv2
import numpy as np
import numpy.typing as npt
from pydantic import Field

from stereolag.core.arrays import Array, FloatMap
from stereolag.core.settings import Settings
from stereolag.loops.bands import over_bands
from stereolag.loops.compilation import compiled
from stereolag.loops.memory import copy, fill
from stereolag.loops.vector_lanes import LANES, load, store, where_at_most

NEIGHBOURHOOD = 7
"""Side of the square of the grid within which patches may touch: a pixel is at most one square from its patch."""


@dataclass(frozen=True, eq=False)
class Superpixels:
    """Image divided into patches, numbered row by row along a grid of squares.

    Attributes
    ----------
    labels
        (H, W) int32, the patch of each pixel: that of its own square, or of one of the eight around it.
    centres
        (patches, channels + 2) float32: mean colour, row and column of each patch. An empty one keeps its last centre.
    grid
        Number of squares down and across.
    """

    labels: npt.NDArray[np.int32]
    centres: FloatMap
    grid: tuple[int, int]


def superpixels(planes: FloatMap, side: int, contrast: float) -> Superpixels:
    """Return the superpixels of an image.

    R. Achanta et al., "SLIC superpixels compared to state-of-the-art superpixel methods", 2012, on a fixed grid: a
    pixel chooses among the patches of its own square and of the eight around it.

    Parameters
    ----------
    planes
        (channels, H, W) float32, grey levels.
    side
        Side of the squares of the grid, px.
    contrast
        Colour difference, levels per channel, that weighs as much as the side of a square.
    """
    channels, height, width = planes.shape
    grid = max(1, round(height / side)), max(1, round(width / side))
    rows = ((np.arange(grid[0]) + 0.5) * height / grid[0]).astype(np.int64)
    cols = ((np.arange(grid[1]) + 0.5) * width / grid[1]).astype(np.int64)
    at = np.repeat(rows, grid[1]), np.tile(cols, grid[0])
    centres = np.column_stack([*(plane[at] for plane in planes), *at]).astype(np.float32)
    weights = np.float32(1 / (channels * contrast**2)), np.float32(1 / side**2)
    for _ in range(2):  # a third round does not improve the filling
        labels = _nearest_patches(planes, centres, grid, weights)
        centres = mean_centres(planes, labels, centres)
    return Superpixels(labels, centres, grid)


def _nearest_patches(
    planes: FloatMap, centres: FloatMap, grid: tuple[int, int], weights: tuple[Any, Any]
) -> npt.NDArray[np.int32]:
    labels = np.empty(planes.shape[1:], np.int32)
    over_bands(lambda first, end: choose_patches(planes, centres, grid, weights, first, end, labels), grid[0])
    return labels


@compiled
def choose_patches(
    planes: Array,
    centres: Array,
    grid: tuple[int, int],
    weights: tuple[Any, Any],
    first: int,
    end: int,
    labels: Array,
) -> None:
    """Assign every pixel in rows `first` to `end` of the grid to the nearest patch in colour and position.

    Ties go to the patch with the lower number. Equals :func:`choose_patches_reference`.
    """
    channels, height, width = planes.shape
    # The patches around each pixel are written out along the row, so that the loops over it vectorise.
    compared = np.empty((9, channels + 2, width), np.float32)
    padded = width + -width % LANES
    numbers, distances = np.empty((9, padded), np.int32), np.empty(padded, np.float32)
    nearest, nearest_patch = np.empty(padded, np.int32), np.empty(padded, np.int32)
    for row in range(first, end):
        _spread_centres(centres, grid, row, width, compared, numbers)
        for y in range(-(-row * height // grid[0]), -(-(row + 1) * height // grid[0])):
            fill(nearest, np.iinfo(np.int32).max)
            for one in range(9):
                _set_position_distances(compared, one, channels, np.float32(y), weights[1], distances)
                for channel in range(channels):
                    _add_colour_distances(planes, channel, y, compared, one, weights[0], distances)
                _keep_nearer(distances, numbers, one, nearest, nearest_patch)
            copy(nearest_patch, labels[y])


@compiled
def _spread_centres(
    centres: Array, grid: tuple[int, int], row: int, width: int, compared: Array, numbers: Array
) -> None:
    """Write out the nine patches around each column, at infinity where there is none.

    For each, set its number in `numbers`, and its colours, row and squared distance of the column in `compared`.
    """
    last = compared.shape[1] - 1
    for x in range(width):
        square, col = x * grid[1] // width, np.float32(x)
        for one in range(9):
            down, across = row + one // 3 - 1, square + one % 3 - 1
            inside = 0 <= down < grid[0] and 0 <= across < grid[1]
            patch = down * grid[1] + across if inside else 0
            numbers[one, x] = patch
            for number in range(last):
                compared[one, number, x] = centres[patch, number] if inside else np.float32(np.inf)
            distance = centres[patch, last] - col
            compared[one, last, x] = distance * distance if inside else np.float32(np.inf)


@compiled
def _set_position_distances(compared: Array, one: int, channels: int, y: Any, weight: Any, distances: Array) -> None:
    """Set the weighted squared distance in position of each pixel of a row from one of the patches around it."""
    for x in range(compared.shape[2]):
        down = compared[one, channels, x] - y
        distances[x] = (down * down + compared[one, channels + 1, x]) * weight


@compiled
def _add_colour_distances(
    planes: Array, channel: int, y: int, compared: Array, one: int, weight: Any, distances: Array
) -> None:
    """Add the weighted squared difference in one channel from that patch."""
    for x in range(compared.shape[2]):
        difference = planes[channel, y, x] - compared[one, channel, x]
        distances[x] += difference * difference * weight


@compiled
def _keep_nearer(distances: Array, numbers: Array, one: int, nearest: Array, nearest_patch: Array) -> None:
    """Assign to the patch the pixels that are nearer to it than to any before.

    Distances are compared by their bits: non-negative floats have the same order as the integers of their bits.
    """
    bits, row = distances.view(np.int32), one * numbers.shape[1]
    for x in range(0, distances.size, LANES):
        here, least = load(bits, x), load(nearest, x)
        store(nearest_patch, x, where_at_most(least, here, load(nearest_patch, x), load(numbers, row + x)))
        store(nearest, x, where_at_most(least, here, least, here))


@compiled
def mean_centres(planes: Array, labels: Array, before: Array) -> FloatMap:
    """Return the mean colour, row and column of each patch; an empty patch keeps those in `before`."""
    channels, height, width = planes.shape
    sums = np.zeros((before.shape[0], channels + 2), np.float64)
    counts = np.zeros(before.shape[0], np.int64)
    for y in range(height):
        for x in range(width):
            patch = labels[y, x]
            counts[patch] += 1
            sums[patch, channels] += y
            sums[patch, channels + 1] += x
            for channel in range(channels):
                sums[patch, channel] += planes[channel, y, x]
    out = before.copy()
    for patch in range(before.shape[0]):
        if counts[patch] > 0:
            for number in range(channels + 2):
                out[patch, number] = np.float32(sums[patch, number] / counts[patch])
    return out


def neighbours(grid: tuple[int, int]) -> npt.NDArray[np.int32]:
    """Return the numbers of the 7 × 7 patches around each patch, (patches, 49); its own number outside the grid."""
    number = np.arange(grid[0] * grid[1])
    down, across = np.divmod(np.arange(NEIGHBOURHOOD**2), NEIGHBOURHOOD)
    rows = number[:, None] // grid[1] + down - NEIGHBOURHOOD // 2
    cols = number[:, None] % grid[1] + across - NEIGHBOURHOOD // 2
    inside = (rows >= 0) & (rows < grid[0]) & (cols >= 0) & (cols < grid[1])
    return np.where(inside, rows * grid[1] + cols, number[:, None]).astype(np.int32)


@compiled
def borders(labels: Array, grid: tuple[int, int]) -> FloatMap:
    """Return (patches, 49, 3) float32: length and mean column and row of each patch's border with each neighbour."""
    height, width = labels.shape
    out = np.zeros((grid[0] * grid[1], NEIGHBOURHOOD * NEIGHBOURHOOD, 3), np.float32)
    middle = NEIGHBOURHOOD // 2
    for y in range(height):
        for x in range(width):
            for across in range(2):
                row, col = y + 1 - across, x + across
                if row == height or col == width or labels[row, col] == labels[y, x]:
                    continue
                one, other = labels[y, x], labels[row, col]
                grid_row, grid_col = other // grid[1] - one // grid[1], other % grid[1] - one % grid[1]
                place = (grid_row + middle) * NEIGHBOURHOOD + grid_col + middle
                for patch, number in ((one, place), (other, NEIGHBOURHOOD * NEIGHBOURHOOD - 1 - place)):
                    out[patch, number, 0] += 1
                    out[patch, number, 1] += x
                    out[patch, number, 2] += y
    for patch in range(out.shape[0]):
        for number in range(NEIGHBOURHOOD * NEIGHBOURHOOD):
            if out[patch, number, 0] > 0:
                out[patch, number, 1] /= out[patch, number, 0]
                out[patch, number, 2] /= out[patch, number, 0]
    return out


def choose_patches_reference(
    planes: FloatMap, centres: FloatMap, grid: tuple[int, int], weights: tuple[float, float]
) -> npt.NDArray[np.int32]:
    """Return the patches expected of :func:`choose_patches` for all pixels, computed with plain NumPy."""
    _, height, width = planes.shape
    y, x = np.indices((height, width), np.float32)
    square = np.arange(height)[:, None] * grid[0] // height, np.arange(width) * grid[1] // width
    number = np.arange(len(centres))[:, None, None]
    near = (abs(number // grid[1] - square[0]) <= 1) & (abs(number % grid[1] - square[1]) <= 1)
    *colours, rows, cols = centres.T[:, :, None, None]
    distances = ((rows - y) ** 2 + (cols - x) ** 2) * weights[1]
    for plane, colour in zip(planes, colours, strict=True):
        distances = distances + (plane - colour) ** 2 * weights[0]
    return np.asarray(np.where(near, distances, np.inf).argmin(axis=0), np.int32)


MAX_MEASURED_SAMPLES, MAX_GUESSED_SAMPLES = 32, 16
"""Largest numbers of measured and of guessed pixels, spread evenly over a patch, to which its plane is fitted."""

GUESS_WEIGHT = 0.03
"""Weight of a guessed pixel; a measured one has 1."""

PLANE_SCALE_PX = 2.0
"""Distance from a plane at which the weight of a measured pixel falls to a quarter, px of disparity."""

BORDER_WEIGHT = 2.0
"""Weight of a border pixel between two patches of one colour; a measured pixel has 1."""

BORDER_SCALE_PX = 2.0
"""Distance between two neighbouring planes at which the weight of their border falls to a quarter, px of disparity."""

BORDER_CONTRAST = 10.0
"""Colour difference, levels per channel, at which the weight of a border falls to 0.37 of BORDER_WEIGHT."""

MAX_TRIAL_SLANT = 2.0
"""Largest slant of a trial plane, px of disparity per pixel of the reduced map."""

LEVEL_WEIGHT = 1e-3
"""Weight that keeps a plane level if all its points are on one line."""


class Samples(NamedTuple):
    """Pixels of each patch to which its plane is fitted."""

    points: FloatMap
    """(patches, 3, most): columns, rows, disparities."""
    kept: npt.NDArray[np.int32]
    """Number of samples in each patch."""
    counts: npt.NDArray[np.int32]
    """Number of pixels they represent."""


@cache
def trials() -> FloatMap:
    """Return the three guesses through which each trial plane passes, (planes, 3), as shares of their number."""
    return np.random.default_rng(0).random((16, 3)).astype(np.float32)


def fitted_planes(patches: Superpixels, measured: Samples, guessed: Samples) -> FloatMap:
    """Return the plane of every patch with a gap, (patches, 3): slant per column and row, and value at its centre."""
    at = np.ascontiguousarray(patches.centres[:, -2:])
    joins = borders(patches.labels, patches.grid)
    colour = patches.centres[:, :-2]
    # Different colours separate patches: the weight of a border falls with the mean difference of the channels.
    near = neighbours(patches.grid)
    difference = np.abs(colour[near] - colour[:, None]).mean(axis=2)
    joins[:, :, 0] *= np.float32(BORDER_WEIGHT) * np.exp(-difference / np.float32(BORDER_CONTRAST))
    planes = best_of_trials(*guessed[:2], at, trials())
    for _ in range(20):  # each plane to its neighbours' planes of the previous sweep
        planes = refitted(planes, measured, guessed, joins, near, at)
    return planes


@compiled
def sampled(labels: Array, values: Array, patches: int, max_count: int) -> tuple[Array, Array, Array]:
    """Return the fields of `Samples`: up to `max_count` pixels of each patch, spread evenly over those with a value."""
    height, width = labels.shape
    counts = np.zeros(patches, np.int32)
    for y in range(height):
        for x in range(width):
            counts[labels[y, x]] += not np.isnan(values[y, x])
    points = np.zeros((patches, 3, max_count), np.float32)
    kept, visited = np.zeros(patches, np.int32), np.zeros(patches, np.int32)
    for y in range(height):
        for x in range(width):
            patch = labels[y, x]
            if np.isnan(values[y, x]):
                continue
            # The first pixel of each of `max_count` equal shares.
            if visited[patch] * max_count >= kept[patch] * max(counts[patch], max_count):
                points[patch, 0, kept[patch]] = x
                points[patch, 1, kept[patch]] = y
                points[patch, 2, kept[patch]] = values[y, x]
                kept[patch] += 1
            visited[patch] += 1
    return points, kept, counts


@compiled
def best_of_trials(points: Array, kept: Array, at: Array, trials: Array) -> FloatMap:
    """Return the plane with the most votes in each patch, among level ones and those through three samples.

    A patch with fewer than three samples has no plane: NaN.
    """
    out = np.full((kept.size, 3), np.nan, np.float32)
    for patch in range(kept.size):
        count = kept[patch]
        best = np.float32(-1)
        for trial in range(-3, trials.shape[0] if count >= 3 else -3):
            rise, fall = np.float32(0), np.float32(0)
            one = (trial + 4) * count // 4 if trial < 0 else int(trials[trial, 0] * count)
            x, y, value = points[patch, 0, one], points[patch, 1, one], points[patch, 2, one]
            if trial >= 0:
                two, three = int(trials[trial, 1] * count), int(trials[trial, 2] * count)
                ax, ay, az = points[patch, 0, two] - x, points[patch, 1, two] - y, points[patch, 2, two] - value
                bx, by, bz = points[patch, 0, three] - x, points[patch, 1, three] - y, points[patch, 2, three] - value
                area = ax * by - ay * bx
                if abs(area) < 2:
                    continue
                rise, fall = (az * by - ay * bz) / area, (ax * bz - az * bx) / area
                if max(abs(rise), abs(fall)) > np.float32(MAX_TRIAL_SLANT):
                    continue
            value += rise * (at[patch, 1] - x) + fall * (at[patch, 0] - y)
            votes = _votes(points, patch, count, at[patch, 1], at[patch, 0], rise, fall, value)
            if votes > best:
                best = votes
                out[patch, 0], out[patch, 1], out[patch, 2] = rise, fall, value
    return out


@compiled(fastmath={"reassoc", "contract"})
def _votes(points: Array, patch: int, count: int, col: Any, row: Any, rise: Any, fall: Any, value: Any) -> Any:
    """Return the votes of the points of a patch for a plane: 1 on the plane, and less with distance."""
    votes = np.float32(0)
    for number in range(count):
        x, y = points[patch, 0, number] - col, points[patch, 1, number] - row
        distance = (points[patch, 2, number] - value - rise * x - fall * y) / np.float32(PLANE_SCALE_PX)
        votes += np.float32(1) / (np.float32(1) + distance * distance)
    return votes


@compiled
def refitted(planes: Array, measured: Samples, guessed: Samples, joins: Array, near: Array, at: Array) -> FloatMap:
    """Return the planes refitted by least squares, each point weighted by its closeness to the current plane.

    Equals :func:`refitted_reference`, up to rounding.
    """
    out = planes.copy()
    joined = np.empty((1, 3, 3), np.float32)
    sums = np.empty(9, np.float64)
    for patch in range(planes.shape[0]):
        if np.isnan(planes[patch, 2]):
            continue
        fill(sums, 0)
        sums[0] = sums[3] = LEVEL_WEIGHT
        for samples, share, scale in ((measured, 1.0, PLANE_SCALE_PX), (guessed, GUESS_WEIGHT, 2 * PLANE_SCALE_PX)):
            count = samples.kept[patch]
            weight = np.float32(share * samples.counts[patch] / max(count, 1))
            _add(sums, planes, at, patch, samples.points, patch, count, weight, np.float32(scale))
        for number in range(near.shape[1]):
            other = near[patch, number]
            if joins[patch, number, 0] <= 0 or np.isnan(planes[other, 2]):
                continue
            # Two planes are one surface if they agree on the border and at both centres.
            joined[0, 0, 0], joined[0, 1, 0] = joins[patch, number, 1], joins[patch, number, 2]
            joined[0, 0, 1], joined[0, 1, 1] = at[patch, 1], at[patch, 0]
            joined[0, 0, 2], joined[0, 1, 2] = at[other, 1], at[other, 0]
            for place in range(3):
                across, down = joined[0, 0, place] - at[other, 1], joined[0, 1, place] - at[other, 0]
                joined[0, 2, place] = planes[other, 2] + planes[other, 0] * across + planes[other, 1] * down
            _add(sums, planes, at, patch, joined, 0, 3, joins[patch, number, 0], np.float32(BORDER_SCALE_PX))
        _solve(sums, out, patch)
    return out


@compiled(fastmath={"reassoc", "contract"})
def _add(
    sums: Array, planes: Array, at: Array, patch: int, points: Array, row: int, count: int, weight: Any, scale: Any
) -> None:
    """Add the points in a row of an array to a patch's normal equations, with less weight far from its plane."""
    rise, fall, value = planes[patch, 0], planes[patch, 1], planes[patch, 2]
    middle, centre = at[patch, 1], at[patch, 0]
    sxx = sxy = sx = syy = sy = s = sxz = syz = sz = np.float32(0)
    for number in range(count):
        x, y, z = points[row, 0, number] - middle, points[row, 1, number] - centre, points[row, 2, number]
        distance = (z - value - rise * x - fall * y) / scale
        nearness = np.float32(1) / (np.float32(1) + distance * distance)
        w = weight * nearness * nearness
        sxx += w * x * x
        sxy += w * x * y
        sx += w * x
        syy += w * y * y
        sy += w * y
        s += w
        sxz += w * x * z
        syz += w * y * z
        sz += w * z
    sums[0] += sxx
    sums[1] += sxy
    sums[2] += sx
    sums[3] += syy
    sums[4] += sy
    sums[5] += s
    sums[6] += sxz
    sums[7] += syz
    sums[8] += sz


@compiled
def _solve(sums: Array, planes: Array, patch: int) -> None:
    """Set the plane that solves its normal equations, by Cramer's rule; keep it if they have no solution."""
    xx, xy, x, yy, y, n, xz, yz, z = sums
    a, b, c = yy * n - y * y, x * y - xy * n, xy * y - x * yy
    determinant = xx * a + xy * b + x * c
    if determinant <= 1e-9 * xx * yy * n:
        return
    planes[patch, 0] = (a * xz + b * yz + c * z) / determinant
    planes[patch, 1] = (b * xz + (xx * n - x * x) * yz + (xy * x - xx * y) * z) / determinant
    planes[patch, 2] = (c * xz + (xy * x - xx * y) * yz + (xx * yy - xy * xy) * z) / determinant


def refitted_reference(
    planes: FloatMap,
    measured: Samples,
    guessed: Samples,
    joins: FloatMap,
    near: npt.NDArray[np.int32],
    at: FloatMap,
) -> FloatMap:
    """Return the expected result of :func:`refitted`, up to rounding, computed with plain NumPy."""

    def terms(patch: int, x: Array, y: Array) -> Array:
        return np.column_stack([x - at[patch, 1], y - at[patch, 0], np.ones(len(x))])

    out = planes.copy()
    for patch in np.flatnonzero(np.isfinite(planes[:, 2])).tolist():
        groups = []
        for samples, share, scale in ((measured, 1, PLANE_SCALE_PX), (guessed, GUESS_WEIGHT, 2 * PLANE_SCALE_PX)):
            kept = samples.kept[patch]
            if kept > 0:
                groups.append((samples.points[patch, :, :kept], share * samples.counts[patch] / kept, scale))
        for join, other in zip(joins[patch], near[patch], strict=True):
            if join[0] > 0 and np.isfinite(planes[other, 2]):
                x, y = np.array([join[1:], at[patch, ::-1], at[other, ::-1]]).T
                groups.append((np.array([x, y, terms(other, x, y) @ planes[other]]), join[0], BORDER_SCALE_PX))
        rows, values, weights = [np.eye(2, 3)], [np.zeros(2)], [np.full(2, LEVEL_WEIGHT)]
        for (x, y, z), weight, scale in groups:
            rows.append(terms(patch, x, y))
            values.append(z)
            weights.append(weight / (1 + ((z - rows[-1] @ planes[patch]) / scale) ** 2) ** 2)
        root = np.sqrt(np.concatenate(weights))
        out[patch] = np.linalg.lstsq(np.concatenate(rows) * root[:, None], np.concatenate(values) * root)[0]
    return out


REDUCTION = 2
"""Patches and planes are computed on every row and column of this many."""

MAX_HIDDEN_GAP_PX = 32
"""Width up to which a gap between surfaces at different depths is hidden from a camera by the nearer surface, px."""

MIN_DEPTH_STEP_PX = 2.5
"""Difference above which two surfaces are at different depths, px of disparity."""


class SurfaceFilling(Settings):
    """Surface filling: a gap continues the slanted surfaces around it, by patches of similar colour."""

    patch: int = Field(
        default=30,
        title="Patch",
        description="Approximate side of a patch, which is treated as one plane, px.",
        ge=8,
        le=200,
        json_schema_extra={"step": 2},
    )
    contrast: int = Field(
        default=23,
        title="Patch contrast",
        description="Difference of colour, levels of 255, that counts as much as a distance of one patch side.",
        ge=1,
        le=255,
    )


def filled_along_surfaces(
    disparity: FloatMap, guess: FloatMap, guide: npt.NDArray[np.uint8], settings: SurfaceFilling
) -> FloatMap:
    """Return the map with its gaps filled from planes.

    Each patch with a gap has one plane. It starts as the best of several planes through the guesses in the patch, which
    indicate the surface to look for. It is then refitted repeatedly to the measured pixels of the patch near it, to its
    neighbours' planes where these may be the same surface, and weakly to the guesses. This is slanted-plane stereo (K.
    Yamaguchi et al., "Efficient joint segmentation, occlusion labeling, stereo and flow estimation", 2014) for the gaps
    only.

    Parameters
    ----------
    disparity
        (H, W) float32 px; NaN = none.
    guess
        (H, W) float32 px, the map already filled in some way; its values in the gaps indicate the surface.
    guide
        (H, W) or (H, W, channels) uint8, the left image.
    settings
        Size and contrast of the patches.

    Returns
    -------
    ndarray
        (H, W) float32; a map without any measurement, or without a gap, is returned unchanged.
    """
    low, high = np.fmin.reduce(disparity, axis=None), np.fmax.reduce(disparity, axis=None)
    if np.isnan(low) or not np.isnan(disparity.sum()):
        return disparity
    size = -(-disparity.shape[1] // REDUCTION), -(-disparity.shape[0] // REDUCTION)
    small = cv2.resize(guide, size, interpolation=cv2.INTER_AREA)
    planes = np.ascontiguousarray(np.atleast_3d(small)[:, :, :3].transpose(2, 0, 1), np.float32)
    patches = superpixels(planes, settings.patch // REDUCTION, settings.contrast)
    sparse = disparity[::REDUCTION, ::REDUCTION]
    guesses = np.where(np.isnan(sparse), guess[::REDUCTION, ::REDUCTION], np.float32(np.nan))
    count = len(patches.centres)
    measured = Samples(*sampled(patches.labels, sparse, count, MAX_MEASURED_SAMPLES))
    guessed = Samples(*sampled(patches.labels, guesses, count, MAX_GUESSED_SAMPLES))
    surfaces = fitted_planes(patches, measured, guessed)
    at = np.ascontiguousarray(patches.centres[:, -2:])
    out = disparity.copy()
    over_bands(
        lambda first, end: fill_from_planes(disparity, guess, patches.labels, surfaces, at, low, high, first, end, out),
        len(out),
    )
    return out


@compiled
def fill_from_planes(
    disparity: Array,
    guess: Array,
    labels: Array,
    planes: Array,
    at: Array,
    low: Any,
    high: Any,
    first: int,
    end: int,
    out: Array,
) -> None:
    """Fill the gaps of rows `first` to `end` from the planes of their patches, clipped to `low`..`high`.

    In a narrow gap between a near and a far surface, no value is nearer than the guess, which belongs to the far one.
    The guess is kept where a patch has no plane.
    """
    width = out.shape[1]
    for y in range(first, end):
        start = 0
        for x in range(width + 1):
            if x < width and np.isnan(disparity[y, x]):
                continue
            hidden = 0 < start < x < width and x - start <= MAX_HIDDEN_GAP_PX
            hidden = hidden and abs(disparity[y, x] - disparity[y, start - 1]) > MIN_DEPTH_STEP_PX
            for gap in range(start, x):
                patch = labels[y // REDUCTION, gap // REDUCTION]
                across = np.float32(gap) / np.float32(REDUCTION) - at[patch, 1]
                down = np.float32(y) / np.float32(REDUCTION) - at[patch, 0]
                value = planes[patch, 2] + planes[patch, 0] * across + planes[patch, 1] * down
                value = guess[y, gap] if np.isnan(value) else min(max(value, low), high)
                out[y, gap] = min(value, guess[y, gap]) if hidden else value
            start = x + 1
