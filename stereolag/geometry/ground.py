"""The ground in front of a camera, from the disparities of its rows."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from stereolag.core.arrays import FloatMap

_COLUMNS = 8
"""One in this many columns is enough to find the ground."""
_LEAST_ROWS = 16
_NEAR_GROUND = 1.0
"""Largest difference of a row's disparity from the ground's line, px."""
_LEAST_AGREEMENT = 0.4
"""Least share of the rows below the middle that the ground must explain."""
_LEAST_RISE = 4.0
"""Least growth of the ground's disparity from there to the lowest row, px: a wall's does not grow."""


class Ground(NamedTuple):
    """Level ground: its disparity in each row is ``slope * (row - horizon)``, px."""

    slope: float
    horizon: float


def ground_of(disparity: FloatMap) -> Ground | None:
    """Return the ground shown by the rows of the lower half; None if they do not agree on one.

    It is the line with which most of the rows' median disparities agree (the "v-disparity" of Labayrade, Aubert &
    Tarel, "Real time obstacle detection in stereovision on non flat road geometry", IV 2002).
    """
    first = disparity.shape[0] // 2
    lower = disparity[first:, ::_COLUMNS]
    rows = np.flatnonzero(np.isfinite(lower).sum(axis=1) * 4 >= lower.shape[1])
    if rows.size < _LEAST_ROWS:
        return None
    medians = np.nanmedian(lower[rows], axis=1).astype(np.float64)
    rows = rows + first
    # Every pair of rows that are well apart proposes a line.
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
