"""Filling: what could not be measured continues the surface behind."""

from __future__ import annotations

import numpy as np

from stereolag.arrays import FloatMap, ReasonMap
from stereolag.loops.compilation import compiled
from stereolag.stereo.reasons import Reason


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


@compiled
def fill_rows(disparity: FloatMap) -> FloatMap:
    """Return the map with each gap in a row filled from the smaller, the farther, of its two ends.

    A gap at the end of a row has one end only; a row without a value stays NaN. Equals :func:`fill_rows_reference`.
    """
    height, width = disparity.shape
    out = disparity.copy()
    for y in range(height):
        last = np.float32(np.nan)
        start = 0
        for x in range(width + 1):
            if x < width and np.isnan(disparity[y, x]):
                continue
            after = disparity[y, x] if x < width else np.float32(np.nan)
            value = after if np.isnan(last) or after < last else last
            for gap in range(start, x):
                out[y, gap] = value
            last, start = after, x + 1
    return out


def fill_rows_reference(disparity: FloatMap) -> FloatMap:
    """Return what :func:`fill_rows` must equal, by plain NumPy."""
    height, width = disparity.shape
    known = np.isfinite(disparity)
    cols = np.arange(width)
    before = np.maximum.accumulate(np.where(known, cols, -1), axis=1)
    after = np.minimum.accumulate(np.where(known, cols, width)[:, ::-1], axis=1)[:, ::-1]
    rows = np.arange(height)[:, None]
    framed = np.pad(disparity, ((0, 0), (1, 1)), constant_values=np.nan)
    return np.asarray(np.fmin(framed[rows, before + 1], framed[rows, after + 1]))
