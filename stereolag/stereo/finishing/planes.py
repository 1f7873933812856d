"""Planes of patches: fitted to the measurements in each patch, and joined to those of its neighbours."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from stereolag.core.arrays import Array, FloatMap
from stereolag.loops.compilation import compiled
from stereolag.stereo.finishing.superpixels import Superpixels, borders, neighbours

MEASURED_SAMPLES, GUESSED_SAMPLES = 32, 16
"""Largest numbers of pixels, spread evenly over a patch, that its plane is fitted to."""

GUESS_WEIGHT = 0.03
"""Weight of a guessed pixel; a measured one has 1."""

TRIALS = np.random.default_rng(0).random((16, 3)).astype(np.float32)
"""The three guesses that each trial plane goes through, as shares of their number."""

SWEEPS = 20
"""Number of times all planes are refitted, each to its neighbours' planes from the sweep before."""

SPREAD = 2.0
"""Distance from the plane at which a pixel has lost most of its weight, px of disparity."""

JOIN = 2.0
"""Weight of a border pixel between two patches of one colour; a measured pixel has 1."""

JOIN_SPREAD = 2.0
"""Distance between two neighbouring planes at which they hardly count as one surface, px of disparity."""

JOIN_CONTRAST = 10.0
"""Colour difference, levels per channel, at which the weight of a border falls to 0.37 of JOIN."""

STEEPEST = 2.0
"""Steepest trial plane, px of disparity per pixel of the reduced map."""

LEVEL = 1e-3
"""Weight that keeps a plane level if all its points are on one line."""


class Samples(NamedTuple):
    """Pixels of each patch that its plane is fitted to."""

    points: FloatMap
    """(patches, 3, most): columns, rows, disparities."""
    kept: npt.NDArray[np.int32]
    """Number of samples in each patch."""
    counts: npt.NDArray[np.int32]
    """Number of pixels they represent."""


def fitted(patches: Superpixels, measured: Samples, guessed: Samples) -> FloatMap:
    """Return the plane of every patch with a gap, (patches, 3): slant per column and row, and value at its centre."""
    at = np.ascontiguousarray(patches.centres[:, -2:])
    joins = borders(patches.labels, patches.grid)
    colour = patches.centres[:, :-2]
    # Different colours separate patches: the weight of a border falls with the mean difference of the channels.
    near = neighbours(patches.grid)
    apart = np.abs(colour[near] - colour[:, None]).mean(axis=2)
    joins[:, :, 0] *= np.float32(JOIN) * np.exp(-apart / np.float32(JOIN_CONTRAST))
    planes = best_of_trials(*guessed[:2], at, TRIALS)
    for _ in range(SWEEPS):
        planes = refitted(planes, *measured, *guessed, joins, near, at)
    return planes


@compiled
def sampled(labels: Array, values: Array, patches: int, most: int) -> tuple[Array, Array, Array]:
    """Return the fields of `Samples`: at most `most` pixels of each patch, spread evenly among those with a value."""
    height, width = labels.shape
    counts = np.zeros(patches, np.int32)
    for y in range(height):
        for x in range(width):
            counts[labels[y, x]] += not np.isnan(values[y, x])
    points = np.zeros((patches, 3, most), np.float32)
    kept, seen = np.zeros(patches, np.int32), np.zeros(patches, np.int32)
    for y in range(height):
        for x in range(width):
            patch = labels[y, x]
            if np.isnan(values[y, x]):
                continue
            # The first pixel of each of `most` equal shares.
            if seen[patch] * most >= kept[patch] * max(counts[patch], most):
                points[patch, 0, kept[patch]] = x
                points[patch, 1, kept[patch]] = y
                points[patch, 2, kept[patch]] = values[y, x]
                kept[patch] += 1
            seen[patch] += 1
    return points, kept, counts


@compiled
def best_of_trials(points: Array, kept: Array, at: Array, trials: Array) -> FloatMap:
    """Return the plane nearest to most samples of each patch, among level ones and those through three samples.

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
                if max(abs(rise), abs(fall)) > np.float32(STEEPEST):
                    continue
            value += rise * (at[patch, 1] - x) + fall * (at[patch, 0] - y)
            votes = _votes(points, patch, count, at[patch, 1], at[patch, 0], rise, fall, value)
            if votes > best:
                best = votes
                out[patch, 0], out[patch, 1], out[patch, 2] = rise, fall, value
    return out


@compiled(fastmath={"reassoc", "contract"})
def _votes(points: Array, patch: int, count: int, col: Any, row: Any, rise: Any, fall: Any, value: Any) -> Any:
    """Return the number of points of a patch near a plane: each counts 1 on the plane, and less with distance."""
    votes = np.float32(0)
    for number in range(count):
        x, y = points[patch, 0, number] - col, points[patch, 1, number] - row
        away = (points[patch, 2, number] - value - rise * x - fall * y) / np.float32(SPREAD)
        votes += np.float32(1) / (np.float32(1) + away * away)
    return votes


@compiled
def refitted(
    planes: Array,
    measured: Array,
    measured_kept: Array,
    measured_counts: Array,
    guessed: Array,
    guessed_kept: Array,
    guessed_counts: Array,
    joins: Array,
    near: Array,
    at: Array,
) -> FloatMap:
    """Return the planes refitted by least squares, each point weighted by its closeness to the current plane.

    Equals :func:`refitted_reference`, up to rounding.
    """
    out = planes.copy()
    joined = np.empty((1, 3, 3), np.float32)
    sums = np.empty(9, np.float64)
    for patch in range(planes.shape[0]):
        if np.isnan(planes[patch, 2]):
            continue
        sums[:] = 0
        sums[0] = sums[3] = LEVEL
        count = measured_kept[patch]
        weight = measured_counts[patch] / max(count, 1)
        _add(sums, planes, at, patch, measured, patch, count, np.float32(weight), np.float32(SPREAD))
        count = guessed_kept[patch]
        weight = GUESS_WEIGHT * guessed_counts[patch] / max(count, 1)
        _add(sums, planes, at, patch, guessed, patch, count, np.float32(weight), np.float32(2 * SPREAD))
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
            _add(sums, planes, at, patch, joined, 0, 3, joins[patch, number, 0], np.float32(JOIN_SPREAD))
        _solve(sums, out, patch)
    return out


@compiled(fastmath={"reassoc", "contract"})
def _add(
    sums: Array,
    planes: Array,
    at: Array,
    patch: int,
    points: Array,
    row: int,
    count: int,
    weight: Any,
    spread: Any,
) -> None:
    """Add the points in a row of an array to a patch's normal equations, with less weight far from its plane."""
    rise, fall, value = planes[patch, 0], planes[patch, 1], planes[patch, 2]
    middle, centre = at[patch, 1], at[patch, 0]
    sxx = sxy = sx = syy = sy = s = sxz = syz = sz = np.float32(0)
    for number in range(count):
        x, y, z = points[row, 0, number] - middle, points[row, 1, number] - centre, points[row, 2, number]
        away = (z - value - rise * x - fall * y) / spread
        nearness = np.float32(1) / (np.float32(1) + away * away)
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
    scale = xx * a + xy * b + x * c
    if scale <= 1e-9 * xx * yy * n:
        return
    planes[patch, 0] = (a * xz + b * yz + c * z) / scale
    planes[patch, 1] = (b * xz + (xx * n - x * x) * yz + (xy * x - xx * y) * z) / scale
    planes[patch, 2] = (c * xz + (xy * x - xx * y) * yz + (xx * yy - xy * xy) * z) / scale


def refitted_reference(
    planes: FloatMap,
    measured: Samples,
    guessed: Samples,
    joins: FloatMap,
    near: npt.NDArray[np.int32],
    at: FloatMap,
) -> FloatMap:
    """Return the expected result of :func:`refitted`, up to rounding, computed with plain NumPy."""

    def above(patch: int, x: Array, y: Array) -> Array:
        return np.column_stack([x - at[patch, 1], y - at[patch, 0], np.ones(len(x))])

    out = planes.copy()
    for patch in np.flatnonzero(np.isfinite(planes[:, 2])).tolist():
        groups = [
            (samples.points[patch, :, : samples.kept[patch]], share * samples.counts[patch] / samples.kept[patch], far)
            for samples, share, far in ((measured, 1, SPREAD), (guessed, GUESS_WEIGHT, 2 * SPREAD))
            if samples.kept[patch] > 0
        ]
        for join, other in zip(joins[patch], near[patch], strict=True):
            if join[0] > 0 and np.isfinite(planes[other, 2]):
                x, y = np.array([join[1:], at[patch, ::-1], at[other, ::-1]]).T
                groups.append((np.array([x, y, above(other, x, y) @ planes[other]]), join[0], JOIN_SPREAD))
        rows, values, weights = [np.eye(2, 3)], [np.zeros(2)], [np.full(2, LEVEL)]
        for (x, y, z), weight, far in groups:
            rows.append(above(patch, x, y))
            values.append(z)
            weights.append(weight / (1 + ((z - rows[-1] @ planes[patch]) / far) ** 2) ** 2)
        root = np.sqrt(np.concatenate(weights))
        out[patch] = np.linalg.lstsq(np.concatenate(rows) * root[:, None], np.concatenate(values) * root)[0]
    return out
