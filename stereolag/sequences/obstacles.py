"""The nearest thing that stands on the ground before the camera."""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt

from stereolag.geometry.ground import ground_of

LEAST_SHARE = 0.001
"""Of the pixels: what is smaller is a wrong match rather than an obstacle."""

LOWEST, HIGHEST = 0.2, 2.0
"""Heights above the ground, in heights of the camera, between which something is an obstacle: no kerb, no bridge."""


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
