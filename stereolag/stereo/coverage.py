"""Whether a score knows where it is wrong: error against coverage."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from stereolag.stereo.evaluation import judged_pixels

MOST_POINTS = 200
"""A curve of more would look the same."""


@dataclass(frozen=True, eq=False)
class CoverageCurve:
    """The error of a disparity map as its least sure pixels are given up.

    Attributes
    ----------
    coverage
        (n,) share of the truth pixels that are kept, 0..1, ascending; one point alone where there is no score.
    bad
        (n,) % of the kept pixels that are off by more than the threshold.
    mean_error
        (n,) mean absolute error of the kept pixels, px.
    """

    coverage: npt.NDArray[np.float64]
    bad: npt.NDArray[np.float64]
    mean_error: npt.NDArray[np.float64]


def error_against_coverage(
    disparity: npt.ArrayLike,
    ground_truth: npt.ArrayLike,
    score: npt.ArrayLike,
    *,
    threshold: float = 2.0,
    mask: npt.ArrayLike | None = None,
) -> CoverageCurve:
    """Keep the pixels of the best score, then more and more of them, and judge what is kept.

    Parameters
    ----------
    disparity, ground_truth
        (H, W) px; NaN or infinite = no answer, no truth.
    score
        (H, W), higher is surer; NaN throughout where the method gives none: the curve is then a single point.
    threshold
        Error above which a pixel counts as bad, px.
    mask
        (H, W) bool: judge these pixels alone.

    Returns
    -------
    CoverageCurve
        Without any point where nothing was measured. Pixels of one and the same score are kept or given up together.

    Raises
    ------
    ValueError
        Arrays of different shape, a threshold that is not positive, or no truth at all.

    Notes
    -----
    The curve of error rate over density of Hu & Mordohai, "A Quantitative Evaluation of Confidence Measures for
    Stereo Vision", PAMI 2012. A good score makes it rise to the right; a score that knows nothing leaves it flat.
    """
    if not threshold > 0:
        raise ValueError(f"threshold is {threshold} px; it must be above 0 px.")
    if np.shape(score) != np.shape(disparity):
        raise ValueError(f"score has shape {np.shape(score)} and disparity {np.shape(disparity)}; both must be (H, W).")
    judged = judged_pixels(disparity, ground_truth, mask)
    total = int(np.count_nonzero(judged))
    estimate, truth, sureness = (np.asarray(one, dtype=np.float64) for one in (disparity, ground_truth, score))
    measured = judged & np.isfinite(estimate)
    error, sureness = np.abs(estimate - truth)[measured], sureness[measured]
    # What has no score, filled pixels say, comes after all that has one.
    order = np.argsort(np.where(np.isnan(sureness), np.inf, -sureness), kind="stable")
    kept = _counts(sureness[order])
    return CoverageCurve(
        coverage=kept / total,
        bad=100 * np.cumsum(error[order] > threshold)[kept - 1] / kept,
        mean_error=np.cumsum(error[order])[kept - 1] / kept,
    )


def _counts(falling: npt.NDArray[np.float64]) -> npt.NDArray[np.intp]:
    """Return how many pixels to keep at each point of the curve: never some of those that share a score."""
    if not falling.size:
        return np.empty(0, dtype=np.intp)
    differs = (falling[1:] != falling[:-1]) & ~(np.isnan(falling[1:]) & np.isnan(falling[:-1]))
    ends = np.append(np.flatnonzero(differs) + 1, falling.size)
    wanted = np.linspace(falling.size / MOST_POINTS, falling.size, MOST_POINTS)
    return np.unique(ends[np.searchsorted(ends, wanted)])
