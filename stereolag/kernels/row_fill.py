"""Filling along the rows: what is hidden continues the surface behind."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from stereolag.kernels.compilation import compiled

FloatMap = npt.NDArray[np.float32]


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
