"""A template drawn anew at another size: letters begin on whole pixels there, and are as wide and high as fits them.

Its columns are then shifted by a pixel or two, letter by letter, and its height is another one than its width tells. A
sibling has a stroke more, or one less, which no such shift explains.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import cv2
import numpy as np

from stereolag.templates.fits import Fit, Plane, beyond, explained, gradient

SOFTER = 0.8
"""Blur, px, of a template enlarged to the square root of 2 beside one drawn at that size."""

STEPS = 10
"""Steps of the alignment."""

FARTHEST = np.array([2.0, 3.0, 0.1, 0.03])
"""Largest shift down and across, px, and largest change of height and of width, of the alignment."""

REACH, FINELY = 2.0, 0.25
"""Largest shift of a column and step of it, px."""

STIFF = 1.0
"""What a step of shift from a column to the next must save, in mean squared differences of a column."""

SMOOTH = 1.0
"""Spread of the blur of the shifts of the columns, px."""

STROKE, LETTER, FAINTEST = 1.5, 3.0, 0.15
"""Spreads of the blurs over a stroke and a letter, px of the template itself; least variance of a letter, as a share of
the largest."""

UNEXPLAINED = 0.16
"""Least squared difference over a stroke that no part of a pixel explains, as a share of the variance of its letter,
of something else.

Measured on screens drawn anew at 110 to 150 %: up to 0.15 where the template is; at words and numbers of which one
letter is another and that the shifts bring nearer, from 0.17, but for two of 91.
"""

LEFT = 0.78
"""Largest share of the difference that may be left if columns are shifted.

Measured: up to 0.74 at words; of icons, of which another has one mark, 0.67 to 1.
"""

OF_HEIGHT = 0.75
"""How much of the logarithm of the size the height tells, and the width the rest: it is rounded for each letter."""


@dataclass(frozen=True)
class Redrawing:
    """How a place is the template drawn anew.

    Parameters
    ----------
    size
        Size there over that of the template that was fitted.
    contrast
        Contrast over that fitted before.
    explained
        Share of the variance of the place that is explained.
    """

    size: float
    contrast: float
    explained: float


def redrawing(fit: Fit, scale: float) -> Redrawing | None:
    """Return how a place is the template drawn anew at this scale; None if it is something else."""
    weights = fit.counted.astype(np.float32)
    seen = fit.seen
    if scale > 1:
        seen = _blurred(seen, SOFTER * math.sqrt(scale**2 - 1))
    before = _in_light(fit.predicted, seen, weights)
    stretched, size = _stretched(fit.predicted, seen, weights)
    still = np.zeros(len(stretched), dtype=np.float32)
    drawn = _in_light(_moved(stretched, still, _shifts(stretched, seen, weights)), seen, weights)
    left, left_before = (float((np.square(seen - one).sum(axis=2) * weights).sum()) for one in (drawn, before))
    if left > LEFT * left_before or _unexplained(drawn, seen, weights, scale) > UNEXPLAINED:
        return None
    contrast = math.sqrt(float(drawn.var(axis=(0, 1)).sum() / fit.predicted.var(axis=(0, 1)).sum()))
    pixels = seen.reshape(weights.size, -1), drawn.reshape(weights.size, -1)
    return Redrawing(size, contrast, explained(*pixels, weights.ravel()))


def _stretched(predicted: Plane, seen: Plane, weights: Plane) -> tuple[Plane, float]:
    """Return the template moved, and its height and width changed, to be most like what is seen; and its size."""
    down, across = (np.arange(side, dtype=np.float32) - np.float32((side - 1) / 2) for side in predicted.shape[:2])
    motion, drawn = np.zeros(4), predicted
    for _ in range(STEPS):
        moved = _moved(predicted, motion[0] + motion[2] * down, motion[1] + motion[3] * across)
        drawn = _in_light(moved, seen, weights)
        rows, cols = (one * weights[:, :, np.newaxis] for one in gradient(drawn))
        terms = [rows, cols, rows * down[:, np.newaxis, np.newaxis], cols * across[:, np.newaxis]]
        slopes = np.stack([one.ravel() for one in terms]).astype(np.float64)
        products = slopes @ slopes.T
        products[np.diag_indices(4)] *= 1.001
        products[np.diag_indices(4)] += 1e-9
        residual = ((seen - drawn) * weights[:, :, np.newaxis]).ravel()
        motion = np.clip(motion + np.linalg.solve(products, slopes @ residual), -FARTHEST, FARTHEST)
    size = -OF_HEIGHT * math.log1p(motion[2]) - (1 - OF_HEIGHT) * math.log1p(motion[3])
    return drawn, math.exp(size)


def _shifts(drawn: Plane, seen: Plane, weights: Plane) -> Plane:
    """Return the shifts of the columns, each near that of the next, with the least squared difference of all."""
    shifts = np.arange(-REACH, REACH + FINELY / 2, FINELY)
    height, width = drawn.shape[:2]
    still = np.zeros(height, dtype=np.float32)
    moved = (_moved(drawn, still, np.full(width, shift, dtype=np.float32)) for shift in shifts)
    costs = np.stack([(np.square(seen - one).sum(axis=2) * weights).sum(axis=0) for one in moved], axis=1)
    costs /= max(float(costs.mean()), 1e-12)
    least, before = costs[0], []
    for cost in costs[1:]:
        around = np.pad(least, 1, constant_values=math.inf)
        ways = np.stack([around[:-2] + STIFF, least, around[2:] + STIFF])
        before.append(ways.argmin(axis=0) - 1)
        least = ways.min(axis=0) + cost
    path = [int(least.argmin())]
    for ways in reversed(before):
        path.append(path[-1] + int(ways[path[-1]]))
    best = shifts[path[::-1]].astype(np.float32).reshape(1, -1)
    return _blurred(best, SMOOTH).ravel()


def _unexplained(drawn: Plane, seen: Plane, weights: Plane, scale: float) -> float:
    """Return the largest difference over a stroke that no part of a pixel explains, as a share of its letter."""
    differences = np.square(np.minimum(beyond(seen, drawn), beyond(drawn, seen))).sum(axis=2) * weights
    means, squares = (_blurred(one, LETTER * scale) for one in (seen, np.square(seen)))
    variance = np.maximum(squares - np.square(means), 0).sum(axis=2)
    return float((_blurred(differences, STROKE * scale) / np.maximum(variance, FAINTEST * variance.max())).max())


def _moved(plane: Plane, rows: Plane, cols: Plane) -> Plane:
    """Return a plane whose rows and columns come from so many pixels further."""
    height, width = plane.shape[:2]
    across, down = np.meshgrid(np.arange(width) + cols, np.arange(height) + rows)
    at = np.asarray(across, dtype=np.float32), np.asarray(down, dtype=np.float32)
    moved = cv2.remap(plane, at[0], at[1], cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)
    return np.asarray(moved, dtype=np.float32).reshape(plane.shape)


def _in_light(plane: Plane, seen: Plane, weights: Plane) -> Plane:
    """Return a plane with a gain and an offset of each channel that bring it nearest to what is seen."""
    shares = (weights / weights.sum())[:, :, np.newaxis]
    level, wanted = ((one * shares).sum(axis=(0, 1)) for one in (plane, seen))
    about = (plane - level) * shares
    energy = (about * (plane - level)).sum(axis=(0, 1))
    gain = (about * (seen - wanted)).sum(axis=(0, 1)) / np.maximum(energy, 1e-12)
    return np.asarray((plane - level) * gain + wanted, dtype=np.float32)


def _blurred(plane: Plane, blur: float) -> Plane:
    blurred = cv2.GaussianBlur(plane, (0, 0), blur, borderType=cv2.BORDER_REPLICATE)
    return np.asarray(blurred, dtype=np.float32).reshape(plane.shape)
