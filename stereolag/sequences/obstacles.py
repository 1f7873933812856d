"""The nearest obstacle on the ground in front of the camera."""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt

from stereolag.geometry.scene import ground_of

LEAST_SHARE = 0.001
"""Least share of the pixels: anything smaller is more likely a mismatch than an obstacle."""

LOWEST, HIGHEST = 0.2, 2.0
"""Range of heights above the ground of an obstacle, in camera heights: excludes kerbs and bridges."""


def nearest_obstacle(disparity: npt.ArrayLike) -> float:
    """Return the disparity of the nearest obstacle, px: robustly, the one that a thousandth of the pixels reach.

    Parameters
    ----------
    disparity
        (H, W) px; NaN = none.

    Returns
    -------
    disparity
        px; NaN if there is none. If a ground is seen, its pixels and anything overhanging the road do not count: the
        height of a point above the ground, as a share of the camera's, is ``1 - d_ground / d``.

    Raises
    ------
    ValueError
        If the array is not (H, W).
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
