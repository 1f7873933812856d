"""The lobe of a peak: the places whose scores are high because the peak's is, and those beyond it."""

from __future__ import annotations

import cv2
import numpy as np
import numpy.typing as npt

from stereolag.explaining.one_window import Lag, Surface, highest, score_at
from stereolag.stereo.windows.search import LagRange

NEIGHBOURS = np.ones((3, 3), np.uint8)


def passes(scores: Surface, peak: tuple[int, int], *, wrapped: bool = False) -> Surface:
    """Return for every place the lowest score on the best way there from the peak: the height of the pass between.

    It is the place's own score wherever one can walk there from the peak without climbing. Where one cannot, the place
    lies on another hill, which rises above the pass by the difference. This is the greyscale reconstruction of `scores`
    from the peak (Vincent 1993), along rows as well as in both directions.

    Parameters
    ----------
    scores
        (n_dy, n_dx); NaN = no candidate, which no way crosses.
    peak
        Its indices (row, col).
    wrapped
        Whether the first row and column follow the last ones, as in a circular correlation.

    Returns
    -------
    ndarray
        (n_dy, n_dx) float64; NaN where there is no candidate, and the lowest score of all where no way leads.
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
    """Return (n_dy, n_dx) whether a place belongs to the lobe of the peak.

    It does unless every way there sinks by more than `dip` below the place's own score: what rises less than that above
    a pass is a ripple on the slope.
    """
    return np.isfinite(scores) & (scores - heights_of_passes <= dip)


def beyond_lobe(
    surface: Surface, lags: LagRange, peak: Lag | None, dip: float, *, wrapped: bool
) -> tuple[Lag | None, float, float]:
    """Return what lies beyond the lobe of a peak and what on its flank.

    Parameters
    ----------
    surface, lags
        The scores and the lags they belong to.
    peak
        (dy, dx) of the best score; None where there is none.
    dip, wrapped
        As for :func:`lobe` and :func:`passes`.

    Returns
    -------
    (dy, dx) or None
        The best lag outside the lobe.
    float
        The height of the pass before it; NaN where there is none.
    float
        The best score in the lobe farther than 1 px from the peak; NaN where there is none.
    """
    if peak is None:
        return None, float("nan"), float("nan")
    row, col = peak[0] - lags.dy_first, peak[1] - lags.dx_first
    heights = passes(surface, (row, col), wrapped=wrapped)
    own = lobe(surface, heights, dip)
    second = highest(np.where(own, np.nan, surface), lags)
    own[max(0, row - 1) : row + 2, max(0, col - 1) : col + 2] = False
    return second, score_at(heights, lags, second), float(surface[own].max()) if own.any() else float("nan")
