"""The confidence of each disparity of a map, a number from 0 to 1 for every method."""

from __future__ import annotations

import cv2
import numpy as np
import numpy.typing as npt

from stereolag.core.arrays import FloatMap
from stereolag.core.inputs import as_grey, as_stereo_pair
from stereolag.stereo.matcher import DisparityMap
from stereolag.stereo.reasons import Reason

PATCH = 7
"""Side of the patches that are compared if a method gives no score, px."""
FLAT = 1e-5
"""A patch whose variance is below this share of the image's cannot be correlated."""
_BAND_PIXELS = 2**20
"""Patches are compared in bands of rows, since whole intermediate maps take a lot of memory."""


def confidence(result: DisparityMap, left: npt.ArrayLike, right: npt.ArrayLike) -> FloatMap:
    """Return the confidence of every measured disparity, (H, W) float32, 0..1; NaN where it is missing or filled.

    Parameters
    ----------
    result
        If its scores are within -1..1 (ZNCC, NCC, phase: similarity of the windows; semi-global: 1 minus the cost of
        the paths as a share of the highest), they are the confidence, with those below 0 as 0. For a method without
        scores (StereoBM, StereoSGBM), or with others (the plain correlation), it is the ZNCC of the 7 × 7 px around the
        pixel with those around its match in the right image, 0 for flat ones.
    left, right
        The pair from which it was made.

    Raises
    ------
    ValueError
        Images of another size than the map.
    """
    shape = np.shape(left)[:2]
    if shape != result.disparity.shape:
        raise ValueError(f"left is {shape} and the map {result.disparity.shape}; they must be of one size.")
    measured = np.asarray(result.reason == Reason.MEASURED) & result.valid
    sure = result.score if has_scores(result) else _likeness(result, left, right)
    known = measured & np.isfinite(sure)
    return np.where(known, np.clip(sure, 0, 1), np.float32(np.nan)).astype(np.float32)


def has_scores(result: DisparityMap) -> bool:
    """Return whether a map has scores, all within -1..1."""
    lowest, highest = np.fmin.reduce(result.score, axis=None), np.fmax.reduce(result.score, axis=None)
    return bool(lowest >= -1.001 and highest <= 1.001)


def _likeness(result: DisparityMap, left: npt.ArrayLike, right: npt.ArrayLike) -> FloatMap:
    """Return the (H, W) ZNCC of the patches around each pixel and around its match; 0 where either is flat."""
    first, second = (as_grey(image).astype(np.float32) for image in as_stereo_pair(left, right))
    height, width = first.shape
    mean, variance = float(first.mean()), float(first.var())
    step, margin = max(1, _BAND_PIXELS // width), PATCH // 2
    found = np.empty_like(first)
    for start in range(0, height, step):
        end = min(start + step, height)
        band = slice(max(0, start - margin), min(height, end + margin))
        rows, cols = np.mgrid[band, 0:width].astype(np.float32)
        rows += np.nan_to_num(result.dy[band])
        cols += np.nan_to_num(result.dx[band])
        there = np.asarray(cv2.remap(second, cols, rows, cv2.INTER_LINEAR))
        inner = slice(start - band.start, end - band.start)
        found[start:end] = _patch_correlation(first[band] - mean, there - mean, variance)[inner]
    return found


def _patch_correlation(first: FloatMap, second: FloatMap, variance: float) -> FloatMap:
    """Return the ZNCC of the patches of two images of one size; 0 where either varies by only a trace of `variance`."""

    def blurred(image: FloatMap) -> FloatMap:
        return np.asarray(cv2.blur(image, (PATCH, PATCH)))

    means = blurred(first), blurred(second)
    covariance = blurred(first * second) - means[0] * means[1]
    variances = [
        np.maximum(blurred(image * image) - average * average, 0)
        for image, average in zip((first, second), means, strict=True)
    ]
    norm = np.sqrt(variances[0] * variances[1])
    textured = norm > FLAT * variance + np.finfo(np.float32).tiny
    return np.asarray(np.divide(covariance, norm, where=textured, out=np.zeros_like(norm)))
