"""The lobe of a peak: the lags whose scores are high because of that peak, as opposed to those beyond it."""

from __future__ import annotations

import cv2
import numpy as np
import numpy.typing as npt

from stereolag.assess.explaining.one_window import Lag, Surface, highest, score_at
from stereolag.stereo.windows.search import LagRange

NEIGHBOURS = np.ones((3, 3), np.uint8)


def passes(scores: Surface, peak: tuple[int, int], *, wrapped: bool = False) -> Surface:
    """Return, for every lag, the height of the pass to it: the lowest score on the best path from the peak.

    It equals the lag's own score where the path from the peak never climbs. Elsewhere the lag is on another hill, which
    rises above the pass by the difference. This is the greyscale reconstruction of `scores` from the peak (Vincent
    1993), for searches along the row as well as in both directions.

    Parameters
    ----------
    scores
        (n_dy, n_dx); NaN = no candidate, which no path crosses.
    peak
        Its indices (row, col).
    wrapped
        Whether the last row and column wrap around to the first, as in a circular correlation.

    Returns
    -------
    ndarray
        (n_dy, n_dx) float64; NaN where there is no candidate, and the lowest score of all where no path leads.
    """
    known = np.isfinite(scores)
    ground = np.where(known, scores, -np.inf)
    lowest = float(ground[known].min())
    reached = np.full(scores.shape, -np.inf)
    reached[peak] = ground[peak]
    while True:
        framed = np.pad(reached, 1, mode="wrap") if wrapped else np.pad(reached, 1, constant_values=-np.inf)
        spread = cv2.dilate(framed, NEIGHBOURS)[1:-1, 1:-1]
        farther = np.minimum(spread, ground)
        if np.array_equal(farther, reached):
            return np.where(known, np.maximum(reached, lowest), np.nan)
        reached = farther


def lobe(scores: Surface, heights_of_passes: Surface, dip: float) -> npt.NDArray[np.bool_]:
    """Return the (n_dy, n_dx) mask of the lags in the lobe of the peak.

    A lag is outside if every path to it drops more than `dip` below its own score; a smaller rise above the pass is
    only a ripple on the slope.
    """
    return np.isfinite(scores) & (scores - heights_of_passes <= dip)


def beyond_lobe(
    surface: Surface, lags: LagRange, peak: Lag | None, dip: float, *, wrapped: bool
) -> tuple[Lag | None, float, float]:
    """Return the runner-up beyond the lobe of a peak and the best score on its flank.

    Parameters
    ----------
    surface, lags
        The scores and the lags they belong to.
    peak
        (dy, dx) of the best score; None if no lag was scored.
    dip, wrapped
        As for :func:`lobe` and :func:`passes`.

    Returns
    -------
    (dy, dx) or None
        The best lag outside the lobe.
    float
        The height of the pass to it; NaN without such a lag.
    float
        The best score in the lobe more than 1 px from the peak; NaN if the lobe is no wider.
    """
    if peak is None:
        return None, float("nan"), float("nan")
    row, col = peak[0] - lags.dy_first, peak[1] - lags.dx_first
    heights = passes(surface, (row, col), wrapped=wrapped)
    own = lobe(surface, heights, dip)
    second = highest(np.where(own, np.nan, surface), lags)
    own[max(0, row - 1) : row + 2, max(0, col - 1) : col + 2] = False
    return second, score_at(heights, lags, second), float(surface[own].max()) if own.any() else float("nan")
