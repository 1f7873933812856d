"""How well two pictures agree through a disparity map: a figure of merit that needs no truth."""

from __future__ import annotations

import cv2
import numpy as np
import numpy.typing as npt

from stereolag.inputs import Image, as_grey, as_stereo_pair
from stereolag.progress import Progress, silent
from stereolag.stereo.matcher import StereoMatcher
from stereolag.stereo.result import DisparityMap

FloatMap = npt.NDArray[np.float32]

TOLERANCE_PX = 1.0
PATCH = 7
"""Side of the patches whose correlation says whether two places look alike, px."""


def seen_from_the_right(
    matcher: StereoMatcher, left: npt.ArrayLike, right: npt.ArrayLike, *, progress: Progress = silent
) -> DisparityMap:
    """Return the disparity map of the *mirrored* pair: what the same settings find with the right picture in charge.

    Mirrored, the right picture is a left one; its map, mirrored back, belongs to the pixels of the right picture.
    """
    images = as_stereo_pair(left, right)
    return matcher.compute(
        np.ascontiguousarray(images[1][:, ::-1]), np.ascontiguousarray(images[0][:, ::-1]), progress=progress
    )


def consistent(result: DisparityMap, mirrored: DisparityMap) -> npt.NDArray[np.bool_]:
    """Return (H, W) where the left picture's match, followed to the right picture, comes back within 1 px.

    Parameters
    ----------
    result
        The map of the left picture.
    mirrored
        That of :func:`seen_from_the_right`.
    """
    height, width = result.disparity.shape
    rows, cols = np.indices((height, width))
    there_row = np.rint(rows + np.nan_to_num(result.dy)).astype(np.intp)
    there_col = np.rint(cols + np.nan_to_num(result.dx)).astype(np.intp)
    inside = result.valid & (there_row >= 0) & (there_row < height) & (there_col >= 0) & (there_col < width)
    back = mirrored.disparity[:, ::-1][np.where(inside, there_row, 0), np.where(inside, there_col, 0)]
    return np.asarray(inside & (np.abs(back - result.disparity) <= TOLERANCE_PX))


def likeness(result: DisparityMap, left: Image, right: Image) -> FloatMap:
    """Return (H, W) ZNCC, 0..1, of each 7 × 7 patch of the left picture with the place the map sends it to.

    0 where the map has no answer, where nothing correlates, and where the patch is flat.
    """
    rows, cols = np.indices(result.disparity.shape, dtype=np.float32)
    grey = [as_grey(image).astype(np.float32) for image in (left, right)]
    moved = cv2.remap(grey[1], cols + np.nan_to_num(result.dx), rows + np.nan_to_num(result.dy), cv2.INTER_LINEAR)
    mean = float(grey[0].mean())
    first, second = grey[0] - mean, np.asarray(moved) - mean
    means = cv2.blur(first, (PATCH, PATCH)), cv2.blur(second, (PATCH, PATCH))
    covariance = cv2.blur(first * second, (PATCH, PATCH)) - means[0] * means[1]
    variance = [
        np.maximum(cv2.blur(image * image, (PATCH, PATCH)) - average * average, 0)
        for image, average in zip((first, second), means, strict=True)
    ]
    norm = np.sqrt(variance[0] * variance[1])
    flat = norm <= 1e-5 * float(np.var(first) + 1e-12)
    score = np.divide(covariance, norm, where=~flat, out=np.zeros_like(norm))
    return np.where(result.valid, np.clip(score, 0, 1), np.float32(0)).astype(np.float32)


def agreement(result: DisparityMap, mirrored: DisparityMap, left: npt.ArrayLike, right: npt.ArrayLike) -> float:
    """Return the left-right-consistent photometric agreement of a map, 0..1.

    The mean over all pixels of :func:`likeness` where the map is :func:`consistent`, and 0 elsewhere: a map that is
    wrong, blank, or sure of two different things scores low. Filled pixels count as blank: nothing was measured there.
    """
    images = as_stereo_pair(left, right)
    sure = consistent(result, mirrored) & ~result.filled
    return float(np.mean(np.where(sure, likeness(result, *images), 0)))
