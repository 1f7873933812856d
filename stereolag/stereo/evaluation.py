"""How right a disparity map is, held against ground truth."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt


@dataclass(frozen=True)
class Evaluation:
    """The usual figures of a disparity map against its truth.

    Attributes
    ----------
    density
        Share of the truth pixels that have an estimate, 0..1.
    epe
        Mean absolute error of the estimated ones, px (end-point error); NaN where nothing was estimated.
    bad
        {threshold px: % of the truth pixels that are off by more than the threshold *or missing*}.
    bad_measured
        {threshold px: % of the estimated truth pixels that are off by more}; NaN where nothing was estimated.
    d1_all
        % of the truth pixels that are missing or off by more than 3 px *and* more than 5 % (KITTI's D1-all).
    truth_pixels
        How many pixels the figures rest on.
    """

    density: float
    epe: float
    bad: dict[float, float]
    bad_measured: dict[float, float]
    d1_all: float
    truth_pixels: int


def evaluate(
    disparity: npt.ArrayLike,
    ground_truth: npt.ArrayLike,
    *,
    thresholds: Sequence[float] = (0.5, 1.0, 2.0, 4.0),
    mask: npt.ArrayLike | None = None,
) -> Evaluation:
    """Compare a disparity map with the truth.

    Parameters
    ----------
    disparity, ground_truth
        (H, W) px; NaN or infinite = no answer, no truth.
    thresholds
        Errors above which a pixel counts as bad, px.
    mask
        (H, W) bool: judge these pixels alone, for example the non-occluded ones.

    Raises
    ------
    ValueError
        Arrays of different shape, a threshold that is not positive, or no truth at all.

    Notes
    -----
    `bad` counts a missing pixel as wrong, as the Middlebury benchmark does for dense methods; `bad_measured` does
    not. D1-all is the outlier rate of Menze & Geiger, "Object Scene Flow for Autonomous Vehicles", CVPR 2015.
    """
    wrong_thresholds = [threshold for threshold in thresholds if not threshold > 0]
    if wrong_thresholds:
        raise ValueError(f"thresholds holds {wrong_thresholds}; every threshold must be above 0 px.")
    judged = judged_pixels(disparity, ground_truth, mask)
    estimate, truth = (np.asarray(one, dtype=np.float64)[judged] for one in (disparity, ground_truth))
    measured = np.isfinite(estimate)
    error = np.abs(estimate[measured] - truth[measured])
    missing = truth.size - error.size
    outliers = int(np.count_nonzero((error > 3) & (error > 0.05 * np.abs(truth[measured]))))

    def percent(count: int, of: int) -> float:
        return 100 * count / of if of else float("nan")

    wrong = {float(threshold): int(np.count_nonzero(error > threshold)) for threshold in thresholds}
    return Evaluation(
        density=error.size / truth.size,
        epe=float(error.mean()) if error.size else float("nan"),
        bad={threshold: percent(count + missing, truth.size) for threshold, count in wrong.items()},
        bad_measured={threshold: percent(count, error.size) for threshold, count in wrong.items()},
        d1_all=percent(outliers + missing, truth.size),
        truth_pixels=int(truth.size),
    )


def judged_pixels(
    disparity: npt.ArrayLike, ground_truth: npt.ArrayLike, mask: npt.ArrayLike | None
) -> npt.NDArray[np.bool_]:
    """Return (H, W) where a disparity map is judged: where there is truth, and the mask allows it.

    Raises
    ------
    ValueError
        Arrays of different shape, or no truth at all.
    """
    truth = np.asarray(ground_truth, dtype=np.float64)
    if truth.ndim != 2 or np.shape(disparity) != truth.shape:
        raise ValueError(
            f"disparity has shape {np.shape(disparity)} and ground_truth {truth.shape}; both must be the same (H, W)."
        )
    judged = np.isfinite(truth)
    if mask is not None:
        if np.shape(mask) != truth.shape:
            raise ValueError(f"mask has shape {np.shape(mask)}; it must be that of the truth, {truth.shape}.")
        judged &= np.asarray(mask, dtype=np.bool_)
    if not judged.any():
        raise ValueError("ground_truth holds no finite disparity to compare with.")
    return judged
