"""Peaks at the ends of the search, whose outer neighbours the cost volume lacks."""

from __future__ import annotations

import cv2
import numpy as np

from stereolag.core.arrays import FloatMap, Mask
from stereolag.stereo.semi_global.cost import NOISE, EightBit

LEAST_SCORE = np.float32(0.01)
"""Scores below this count as this much, so that all have a logarithm."""


def peaks_at_end(
    left: EightBit, right: EightBit, window_size: int, disparity: int, where: Mask
) -> tuple[Mask, FloatMap]:
    """Return where windows correlate no worse at a disparity than one px to either side, and the offset of the peak.

    One lag more on either side would make the whole volume slower to fill and to optimise by a quarter, since its lags
    are processed in strips of sixteen. Few pixels are matched at an end of the search, and there, with no path to
    compare, the correlation alone tells where the peak is: by a Gaussian through its three scores.

    Parameters
    ----------
    left, right
        (H, W) uint8.
    window_size
        Side of the windows, px; odd.
    disparity
        The disparity at that end, px.
    where
        (H, W) the pixels matched there.

    Returns
    -------
    tuple of ndarray
        (H, W) bool, and float32 offset, -0.5..0.5 px; False and 0 elsewhere, and where a neighbour is out of the frame.
    """
    width = where.shape[1]
    inside, offset = np.zeros(where.shape, np.bool_), np.zeros(where.shape, np.float32)
    cols = slice(max(0, disparity + 1), min(width, width + disparity - 1))
    rows = np.flatnonzero(where[:, cols].any(axis=1))
    if rows.size == 0:
        return inside, offset
    reach = window_size // 2
    near = slice(max(0, rows[0] - reach), rows[-1] + 1 + reach)
    window = (window_size, window_size)

    def mean(values: FloatMap) -> FloatMap:
        return np.asarray(cv2.blur(values, window))

    here, there = (np.asarray(image[near], np.float32) - np.float32(128) for image in (left, right))
    here_mean, there_mean = mean(here), mean(there)
    norm = np.sqrt(mean(there * there) - there_mean * there_mean + np.float32(NOISE**2))
    spread = np.sqrt(mean(here * here) - here_mean * here_mean + np.float32(NOISE**2))

    def score(shift: int) -> FloatMap:
        moved, moved_mean, moved_norm = (np.roll(one, shift, axis=1) for one in (there, there_mean, norm))
        return np.asarray((mean(here * moved) - here_mean * moved_mean) / (spread * moved_norm))

    before, peak, after = (score(disparity + beside)[:, cols] for beside in (-1, 0, 1))
    at = where[near, cols]
    inside[near, cols] = at & (peak >= before) & (peak >= after)
    low, top, high = (np.log(np.maximum(one, LEAST_SCORE)) for one in (before, peak, after))
    bend = 2 * top - low - high
    fitted = np.divide(high - low, 2 * bend, out=np.zeros_like(bend), where=bend > 0)
    offset[near, cols] = np.where(inside[near, cols], fitted, np.float32(0))
    return inside, offset
