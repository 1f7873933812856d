"""The ground before a camera, as the disparities of its rows show it."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from stereolag.arrays import FloatMap

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
