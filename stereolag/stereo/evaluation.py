"""Evaluation of disparity maps: against ground truth, against each other, and the confidence of their pixels."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np
import numpy.typing as npt

from stereolag.core.arrays import FloatMap
from stereolag.core.inputs import as_grey, as_stereo_pair
from stereolag.stereo.matcher import DisparityMap, Reason


@dataclass(frozen=True)
class Evaluation:
    """Standard error measures of a disparity map against ground truth.

    Attributes
    ----------
    density
        Share of the pixels with ground truth that have an estimate, 0..1.
    epe
        Mean absolute error of the estimated pixels, px (end-point error); NaN if nothing was estimated.
    bad
        {threshold px: % of the pixels with ground truth that are off by more than the threshold *or missing*}.
    bad_measured
        {threshold px: % of the estimated pixels with ground truth that are off by more}; NaN if none were estimated.
    d1_all
        % of the pixels with ground truth that are missing, or off by more than 3 px *and* 5 % (KITTI's D1-all).
    truth_pixels
        Number of pixels with ground truth.

    Examples
    --------
    >>> import numpy as np
    >>> import stereolag as sl
    >>> figures = sl.evaluate([[10.0, 14.5, np.nan, 9.5]], [[10.0, 10.0, 10.0, 10.0]])  # px
    >>> figures.density  # share of the truth
    0.75
    >>> figures.bad[2.0], round(figures.bad_measured[2.0], 1)  # %: only the first counts missing pixels
    (50.0, 33.3)
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
    """Compare a disparity map with the ground truth.

    Parameters
    ----------
    disparity, ground_truth
        (H, W) px; NaN or infinite = no disparity, no ground truth.
    thresholds
        Errors above which a pixel counts as bad, px.
    mask
        (H, W) bool: evaluate only these pixels, for example the non-occluded ones.

    Raises
    ------
    ValueError
        Arrays of different shape, a threshold that is not positive, or no ground truth at all.

    Notes
    -----
    `bad` counts a missing pixel as wrong, as the Middlebury benchmark does for dense methods; `bad_measured` does
    not. D1-all is the outlier rate of Menze & Geiger, "Object Scene Flow for Autonomous Vehicles", CVPR 2015.

    Examples
    --------
    >>> import stereolag as sl
    >>> from stereolag import samples
    >>> cube = samples.stereo_pairs()["cube"]
    >>> result = sl.StereoBM(num_disparities=64).compute(sl.read_image(cube.left), sl.read_image(cube.right))
    >>> figures = sl.evaluate(result.disparity, sl.read_disparity(cube.disparity))
    >>> round(figures.bad[2.0])  # % of the pixels: off by more than 2 px, or missing
    23
    """
    wrong_thresholds = [threshold for threshold in thresholds if not threshold > 0]
    if wrong_thresholds:
        raise ValueError(f"thresholds holds {wrong_thresholds}; every threshold must be above 0 px.")
    judged = judged_pixels(disparity, ground_truth, mask)
    measured = judged & np.isfinite(disparity)
    everywhere = bool(measured.all())  # spares a copy of both
    estimate, truth = (
        np.asarray(values).ravel() if everywhere else np.asarray(values)[measured]
        for values in (disparity, ground_truth)
    )
    error = np.subtract(estimate, truth, dtype=np.float64)
    np.abs(error, out=error)
    pixels = int(np.count_nonzero(judged))
    missing, large = pixels - error.size, error > 3
    outliers = int(np.count_nonzero(error[large] > 0.05 * np.abs(truth[large].astype(np.float64))))

    def percent(count: int, of: int) -> float:
        return 100 * count / of if of else float("nan")

    wrong = {float(threshold): int(np.count_nonzero(error > threshold)) for threshold in thresholds}
    return Evaluation(
        density=error.size / pixels,
        epe=float(error.mean()) if error.size else float("nan"),
        bad={threshold: percent(count + missing, pixels) for threshold, count in wrong.items()},
        bad_measured={threshold: percent(count, error.size) for threshold, count in wrong.items()},
        d1_all=percent(outliers + missing, pixels),
        truth_pixels=pixels,
    )


def judged_pixels(
    disparity: npt.ArrayLike, ground_truth: npt.ArrayLike, mask: npt.ArrayLike | None
) -> npt.NDArray[np.bool_]:
    """Return the (H, W) mask of pixels to evaluate: those with ground truth that `mask` allows.

    Raises
    ------
    ValueError
        Arrays of different shape, or no ground truth at all.
    """
    truth = np.asarray(ground_truth)
    if truth.ndim != 2 or np.shape(disparity) != truth.shape:
        raise ValueError(
            f"disparity has shape {np.shape(disparity)} and ground_truth {truth.shape}; both must be the same (H, W)."
        )
    judged = np.asarray(np.isfinite(truth))
    if mask is not None:
        if np.shape(mask) != truth.shape:
            raise ValueError(f"mask has shape {np.shape(mask)}; it must match the ground truth's, {truth.shape}.")
        judged &= np.asarray(mask, dtype=np.bool_)
    if not judged.any():
        raise ValueError("ground_truth contains no finite disparity to compare with.")
    return judged


MAX_CURVE_POINTS = 200
"""Largest number of points of a curve; more would not be visible."""


@dataclass(frozen=True, eq=False)
class CoverageCurve:
    """Error of a disparity map as its least certain pixels are discarded.

    Attributes
    ----------
    coverage
        (n,) share of the pixels with ground truth that are kept, 0..1, ascending; a single point without a score.
    bad
        (n,) % of the kept pixels that are off by more than the threshold.
    """

    coverage: npt.NDArray[np.float64]
    bad: npt.NDArray[np.float64]


def error_against_coverage(
    disparity: npt.ArrayLike,
    ground_truth: npt.ArrayLike,
    score: npt.ArrayLike,
    *,
    threshold: float = 2.0,
    mask: npt.ArrayLike | None = None,
) -> CoverageCurve:
    """Return the error of the best-scored pixels as more and more of them are kept.

    Parameters
    ----------
    disparity, ground_truth
        (H, W) px; NaN or infinite = no disparity, no ground truth.
    score
        (H, W), higher is more certain; all NaN if the method has none: the curve is then a single point.
    threshold
        Error above which a pixel counts as bad, px.
    mask
        (H, W) bool: evaluate only these pixels.

    Returns
    -------
    CoverageCurve
        Empty if nothing was measured. Pixels of equal score are kept or discarded together.

    Raises
    ------
    ValueError
        Arrays of different shape, a threshold that is not positive, or no ground truth at all.

    Notes
    -----
    This is the curve of error rate over density of Hu & Mordohai, "A Quantitative Evaluation of Confidence Measures for
    Stereo Vision", PAMI 2012. A good score makes it rise to the right; an uninformative score leaves it flat.
    """
    if not threshold > 0:
        raise ValueError(f"threshold is {threshold} px; it must be above 0 px.")
    if np.shape(score) != np.shape(disparity):
        raise ValueError(f"score has shape {np.shape(score)} and disparity {np.shape(disparity)}; both must be (H, W).")
    judged = judged_pixels(disparity, ground_truth, mask)
    total = int(np.count_nonzero(judged))
    estimate, truth, scores = (np.asarray(values, dtype=np.float64) for values in (disparity, ground_truth, score))
    measured = judged & np.isfinite(estimate)
    error, scores = np.abs(estimate - truth)[measured], scores[measured]
    # Pixels without a score, such as filled ones, come after all others.
    order = np.argsort(np.where(np.isnan(scores), np.inf, -scores), kind="stable")
    kept = _counts(scores[order])
    return CoverageCurve(
        coverage=kept / total,
        bad=100 * np.cumsum(error[order] > threshold)[kept - 1] / kept,
    )


def _counts(scores: npt.NDArray[np.float64]) -> npt.NDArray[np.intp]:
    """Return the numbers of pixels to keep, one per point of the curve, never splitting pixels of equal score.

    The scores are in descending order.
    """
    if not scores.size:
        return np.empty(0, dtype=np.intp)
    differs = (scores[1:] != scores[:-1]) & ~(np.isnan(scores[1:]) & np.isnan(scores[:-1]))
    ends = np.append(np.flatnonzero(differs) + 1, scores.size)
    wanted = np.linspace(scores.size / MAX_CURVE_POINTS, scores.size, MAX_CURVE_POINTS)
    return np.unique(ends[np.searchsorted(ends, wanted)])


MAX_AGREEING_SPREAD_PX = 1.0
"""Largest spread of the disparities of maps that agree, px."""


def consensus(maps: Sequence[FloatMap]) -> npt.NDArray[np.uint8]:
    """Return the number of maps that agree at each pixel.

    Parameters
    ----------
    maps
        (H, W) disparities of one size, px, NaN = no disparity.

    Returns
    -------
    ndarray
        (H, W) uint8: the size of the largest group that agrees; 1 where no two agree, 0 where no map has a disparity.

    Raises
    ------
    ValueError
        No maps, or maps of different size.
    """
    sizes = {disparity.shape for disparity in maps}
    if len(sizes) != 1:
        raise ValueError(f"maps have the sizes {sorted(sizes)}; allowed are one or more maps of the same size.")
    ordered = np.sort(np.stack(maps), axis=0)  # NaN goes last
    agreeing: npt.NDArray[np.uint8] = np.isfinite(ordered[0]).astype(np.uint8)
    for size in range(2, len(maps) + 1):
        span = ordered[size - 1 :] - ordered[: len(maps) - size + 1]
        agreeing[(span <= MAX_AGREEING_SPREAD_PX).any(axis=0)] = size
    return agreeing


PATCH_PX = 7
"""Side of the patches that are compared if a method gives no score, px."""

MIN_VARIANCE_SHARE = 1e-5
"""A patch cannot be correlated if its variance is below this share of the image's."""

BAND_PIXELS = 2**20
"""Pixels in a band of rows whose patches are compared at a time: whole intermediate maps take a lot of memory."""


def confidence(result: DisparityMap, left: npt.ArrayLike, right: npt.ArrayLike) -> FloatMap:
    """Return the confidence of every measured disparity, (H, W) float32, 0..1; NaN where it is missing or filled.

    Parameters
    ----------
    result
        If its scores are within -1..1 (ZNCC, NCC, phase: similarity of the windows; semi-global: 1 minus the cost of
        the paths as a share of the highest), they are the confidence, with those below 0 as 0. For a method without
        scores (StereoBM, StereoSGBM), or with unbounded ones (plain correlation), it is the ZNCC of the 7 × 7 px around
        the pixel and around its match in the right image, 0 for flat patches.
    left, right
        The pair of the map.

    Raises
    ------
    ValueError
        Images of another size than the map.
    """
    shape = np.shape(left)[:2]
    if shape != result.disparity.shape:
        raise ValueError(f"left is {shape} and the map {result.disparity.shape}; they must be of one size.")
    measured = np.asarray(result.reason == np.uint8(Reason.MEASURED)) & result.valid
    score = result.score if has_scores(result) else _zncc_of_matches(result, left, right)
    known = measured & np.isfinite(score)
    return np.where(known, np.clip(score, 0, 1), np.float32(np.nan)).astype(np.float32)


def has_scores(result: DisparityMap) -> bool:
    """Return whether a map has scores, and all are within -1..1."""
    lowest, highest = np.fmin.reduce(result.score, axis=None), np.fmax.reduce(result.score, axis=None)
    return bool(lowest >= -1.001 and highest <= 1.001)


def _zncc_of_matches(result: DisparityMap, left: npt.ArrayLike, right: npt.ArrayLike) -> FloatMap:
    """Return the (H, W) ZNCC of the patches around each pixel and around its match; 0 where either is flat."""
    first, second = (as_grey(image).astype(np.float32) for image in as_stereo_pair(left, right))
    height, width = first.shape
    mean, variance = float(first.mean()), float(first.var())
    step, margin = max(1, BAND_PIXELS // width), PATCH_PX // 2
    zncc = np.empty_like(first)
    for start in range(0, height, step):
        end = min(start + step, height)
        band = slice(max(0, start - margin), min(height, end + margin))
        rows, cols = np.mgrid[band, 0:width].astype(np.float32)
        rows += np.nan_to_num(result.dy[band])
        cols += np.nan_to_num(result.dx[band])
        matched = np.asarray(cv2.remap(second, cols, rows, cv2.INTER_LINEAR))
        inner = slice(start - band.start, end - band.start)
        zncc[start:end] = _patch_zncc(first[band] - mean, matched - mean, variance)[inner]
    return zncc


def _patch_zncc(first: FloatMap, second: FloatMap, variance: float) -> FloatMap:
    """Return the ZNCC of the patches of two images of one size; 0 where they are flat relative to `variance`."""

    def blurred(image: FloatMap) -> FloatMap:
        return np.asarray(cv2.blur(image, (PATCH_PX, PATCH_PX)))

    means = blurred(first), blurred(second)
    covariance = blurred(first * second) - means[0] * means[1]
    variances = [
        np.maximum(blurred(image * image) - mean * mean, 0) for image, mean in zip((first, second), means, strict=True)
    ]
    norm = np.sqrt(variances[0] * variances[1])
    textured = norm > MIN_VARIANCE_SHARE * variance + np.finfo(np.float32).tiny
    return np.asarray(np.divide(covariance, norm, where=textured, out=np.zeros_like(norm)))
