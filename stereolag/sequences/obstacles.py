"""The nearest thing that stands on the ground before the camera."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from stereolag.arrays import FloatMap

LEAST_SHARE = 0.001
"""Of the pixels: what is smaller is a wrong match rather than an obstacle."""

LOWEST, HIGHEST = 0.2, 2.0
"""Heights above the ground, in heights of the camera, between which something is an obstacle: no kerb, no bridge."""

_COLUMNS = 8
"""Every so manieth column tells the ground as well as all of them."""
_LEAST_ROWS = 16
_NEAR_GROUND = 1.0
"""Px; how far from the ground's line the disparity of a row may lie."""
_LEAST_AGREEMENT = 0.4
"""Share of the rows below the middle that the ground must explain."""
_LEAST_RISE = 4.0
"""Px; by how much its disparity grows from there to the lowest row: a wall's does not."""


class Ground(NamedTuple):
    """A level ground: its disparity in each row is ``slope * (row - horizon)``, px."""

    slope: float
    horizon: float


def nearest_obstacle(disparity: npt.ArrayLike) -> float:
    """Return the disparity of the nearest obstacle, px, robustly: that which a thousandth of the pixels exceed.

    Parameters
    ----------
    disparity
        (H, W) px; NaN = none.

    Returns
    -------
    disparity
        px; NaN where there is none. Pixels of the ground do not count, where a ground is seen, nor what hangs over the
        road: a point at height h above the ground has the share ``1 - d_ground / d`` of the camera's own height.

    Raises
    ------
    ValueError
        An array that is not (H, W).
    """
    values = np.asarray(disparity, dtype=np.float32)
    if values.ndim != 2 or values.size == 0:
        raise ValueError(f"disparity has shape {values.shape}; allowed is (rows, cols) with at least one pixel.")
    known = np.isfinite(values) & (values > 0)
    ground = ground_of(values)
    if ground is not None:
        below = np.float32(ground.slope) * (np.arange(len(values), dtype=np.float32) - np.float32(ground.horizon))
        with np.errstate(invalid="ignore"):
            known &= (values * np.float32(1 - LOWEST) > below[:, None]) & (
                values * np.float32(1 - HIGHEST) < below[:, None]
            )
    obstacles = values[known]
    rank = max(1, round(LEAST_SHARE * values.size))
    if obstacles.size < rank:
        return math.nan
    return float(np.partition(obstacles, obstacles.size - rank)[obstacles.size - rank])


def ground_of(disparity: FloatMap) -> Ground | None:
    """Return the ground as the rows of the lower half show it; None where they do not agree on one.

    The median of each row's disparities, through which the line goes that most of them agree with (the "v-disparity" of
    Labayrade, Aubert & Tarel, "Real time obstacle detection in stereovision on non flat road geometry", IV 2002).
    """
    first = disparity.shape[0] // 2
    lower = disparity[first:, ::_COLUMNS]
    rows = np.flatnonzero(np.isfinite(lower).sum(axis=1) * 4 >= lower.shape[1])
    if rows.size < _LEAST_ROWS:
        return None
    medians = np.nanmedian(lower[rows], axis=1).astype(np.float64)
    rows = rows + first
    # Every pair of rows that lie well apart proposes a line.
    one, two = np.triu_indices(rows.size, k=rows.size // 4)
    thinned = slice(None, None, max(1, one.size // 512))
    one, two = one[thinned], two[thinned]
    slopes = (medians[two] - medians[one]) / (rows[two] - rows[one])
    offsets = medians[one] - slopes * rows[one]
    agreeing = np.abs(slopes[:, None] * rows + offsets[:, None] - medians) <= _NEAR_GROUND
    best = int(np.argmax(agreeing.sum(axis=1)))
    if agreeing[best].sum() < _LEAST_AGREEMENT * (disparity.shape[0] - first):
        return None
    slope, offset = np.polyfit(rows[agreeing[best]], medians[agreeing[best]], 1)
    rises = slope * (disparity.shape[0] - first) >= _LEAST_RISE
    return Ground(float(slope), float(-offset / slope)) if rises else None
