"""Filling: what could not be measured continues the surface behind."""

from __future__ import annotations

import numpy as np

from stereolag.kernels.row_fill import fill_rows
from stereolag.stereo.result import FloatMap, Reason, ReasonMap


def filled_from_behind(disparity: FloatMap, reason: ReasonMap) -> tuple[FloatMap, ReasonMap]:
    """Return the map with every gap filled.

    Along its row a gap takes the smaller disparity of its two ends: what one camera cannot see lies on the farther
    surface, and the ground, which fills most of the gaps of a street, has one depth along a row. Fills from eight or
    sixteen directions were worse on it. A row without any measurement repeats the nearest row that has one.

    Parameters
    ----------
    disparity
        (H, W) float32 px; NaN = none.
    reason
        (H, W) uint8.

    Returns
    -------
    tuple of ndarray
        The map, and its reasons with FILLED where it was filled. A map without a single measurement stays as it is.
    """
    filled = fill_rows(disparity)
    known = np.flatnonzero(np.isfinite(filled[:, 0]))
    if known.size == 0:
        return disparity, reason
    rows = np.arange(len(filled))
    after = np.searchsorted(known, rows).clip(max=known.size - 1)
    before = (after - 1).clip(min=0)
    nearest = np.where(rows - known[before] <= np.abs(known[after] - rows), known[before], known[after])
    nearest[known] = known
    return filled[nearest], np.where(np.isnan(disparity), np.uint8(Reason.FILLED), reason)
