"""How good settings are on a pair: one figure, with ground truth or without."""

from __future__ import annotations

import time
from dataclasses import dataclass
from functools import partial

import cv2
import numpy as np
import numpy.typing as npt

from stereolag.arrays import FloatMap
from stereolag.estimates import Estimate, check_memory
from stereolag.geometry.scaling import scaled_disparity, scaled_image
from stereolag.inputs import Image, as_grey, as_stereo_pair
from stereolag.progress import Progress, silent
from stereolag.settings import scaled_settings
from stereolag.stereo.estimates import ANSWER, fitting_pair
from stereolag.stereo.evaluation import evaluate
from stereolag.stereo.matcher import DisparityMap, StereoMatcher

RIGHT_WITHIN_PX = 2.0

AGREEMENT = 120
"""Bytes of a pixel while two maps are compared: both, the places to which they lead, and the patches there."""

JUDGEMENT = 80
"""Bytes of a pixel while a map is compared with the ground truth, in float64."""

AGREEMENT_SECONDS = 2e-7
"""Seconds per pixel to compare two maps, or one with the ground truth."""

SCALES = (1.0, 0.75, 0.5, 0.35, 0.25)
"""Sizes in which a pair is tuned on, full size first."""


@dataclass(frozen=True, eq=False)
class TuningPair:
    """A pair on which settings are tried, made smaller where trying takes too long in full.

    Attributes
    ----------
    left, right
        The images at their reduced size.
    truth
        (H, W) at that size, but in px of full size; None where unknown.
    scale
        Reduced size over full size.
    """

    left: Image
    right: Image
    truth: FloatMap | None
    scale: float

    @classmethod
    def of(
        cls, left: npt.ArrayLike, right: npt.ArrayLike, truth: npt.ArrayLike | None = None, *, scale: float = 1.0
    ) -> TuningPair:
        """Return a pair to tune on, `scale` times the size of the images.

        Raises
        ------
        ValueError
            Images or a truth that do not fit together, or a scale that is not above 0 to 1.
        """
        images = as_stereo_pair(left, right)
        known = None if truth is None else np.asarray(truth, dtype=np.float32)
        if known is not None and known.shape != images[0].shape[:2]:
            raise ValueError(
                f"truth has shape {known.shape} and the images {images[0].shape[:2]}; both must be the same."
            )
        if scale == 1:
            return cls(*images, known, 1.0)
        if known is not None:
            known = scaled_disparity(known, scale) / np.float32(scale)
        return cls(scaled_image(images[0], scale), scaled_image(images[1], scale), known, scale)

    def estimate(self, matcher: StereoMatcher) -> Estimate:
        """Return what :meth:`objective` will take.

        Without truth the pair is matched twice, and the first map waits for the second.
        """
        return self._estimate(matcher, self.left.shape)

    def _estimate(self, matcher: StereoMatcher, shape: tuple[int, ...]) -> Estimate:
        fitting = matcher if self.scale == 1 else scaled_settings(matcher, self.scale)
        once = fitting.estimate(shape, self.left.dtype)
        pixels, judged = shape[0] * shape[1], AGREEMENT_SECONDS * shape[0] * shape[1]
        if self.truth is not None:
            return Estimate(max(once.memory, (ANSWER + JUDGEMENT) * pixels), once.seconds + judged)
        mirrored = 2 * int(np.prod(shape)) * self.left.dtype.itemsize
        memory = max(once.memory + ANSWER * pixels, AGREEMENT * pixels) + mirrored
        return Estimate(memory, 2 * once.seconds + judged)

    def objective(self, matcher: StereoMatcher) -> tuple[float, FloatMap]:
        """Return how good settings are, 0..1 and higher is better, and their disparity map.

        With truth: the share of its pixels measured within 2 px, missing ones counted as wrong. Without: the
        left-right-consistent photometric consistency.

        Parameters
        ----------
        matcher
            Settings meant for the full size.

        Returns
        -------
        objective
            Never NaN.
        disparity
            At the size of this pair, in px of full size.

        Raises
        ------
        ValueError
            Settings that do not fit the images, or that need more memory than one job may take.
        """
        check_memory(
            self.estimate(matcher),
            partial(
                fitting_pair, shape=self.left.shape, of_shape=partial(self._estimate, matcher), of_disparities=None
            ),
        )
        fitting = matcher if self.scale == 1 else scaled_settings(matcher, self.scale)
        result = fitting.compute(self.left, self.right)
        disparity = result.disparity / np.float32(self.scale)
        if self.truth is not None:
            judged = evaluate(disparity, self.truth, thresholds=(RIGHT_WITHIN_PX,))
            return 1 - judged.bad[RIGHT_WITHIN_PX] / 100, disparity
        mirrored = seen_from_the_right(fitting, self.left, self.right)
        return photometric_consistency(result, mirrored, self.left, self.right), disparity


def affordable_pair(
    matcher: StereoMatcher,
    left: npt.ArrayLike,
    right: npt.ArrayLike,
    truth: npt.ArrayLike | None = None,
    *,
    trials: int,
    budget_s: float,
) -> TuningPair:
    """Return the largest pair on which so many trials should fit into a budget, judged by one trial in full size.

    Pixels times disparities make the cost, so it falls with the third power of the scale.

    Raises
    ------
    ValueError
        Images that do not fit together, or settings that do not fit the images.
    """
    tuning_pair = TuningPair.of(left, right, truth)
    start = time.perf_counter()
    tuning_pair.objective(matcher)
    expected_s = trials * (time.perf_counter() - start)
    scale = next((scale for scale in SCALES if expected_s * scale**3 <= budget_s), SCALES[-1])
    return tuning_pair if scale == 1 else TuningPair.of(left, right, truth, scale=scale)


TOLERANCE_PX = 1.0
PATCH = 7
"""Side of the patches whose correlation says whether two places look alike, px."""


def seen_from_the_right(
    matcher: StereoMatcher, left: npt.ArrayLike, right: npt.ArrayLike, *, progress: Progress = silent
) -> DisparityMap:
    """Return the disparity map of the *mirrored* pair: what the same settings find with the right image in charge.

    Mirrored, the right image is a left one; its map, mirrored back, belongs to the pixels of the right image.
    """
    images = as_stereo_pair(left, right)
    return matcher.compute(
        np.ascontiguousarray(images[1][:, ::-1]), np.ascontiguousarray(images[0][:, ::-1]), progress=progress
    )


def consistent(result: DisparityMap, mirrored: DisparityMap) -> npt.NDArray[np.bool_]:
    """Return (H, W) where the left image's match, followed to the right image, comes back within 1 px.

    Parameters
    ----------
    result
        The map of the left image.
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
    """Return (H, W) ZNCC, 0..1, of each 7 × 7 patch of the left image with the place the map sends it to.

    0 where the map has no disparity, where nothing correlates, and where the patch is flat.
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


def photometric_consistency(
    result: DisparityMap, mirrored: DisparityMap, left: npt.ArrayLike, right: npt.ArrayLike
) -> float:
    """Return how well the two images agree through a map, 0..1: a figure that needs no ground truth.

    The mean over all pixels of :func:`likeness` where the map is :func:`consistent`, and 0 elsewhere: a map that is
    wrong, blank, or sure of two different things scores low. Filled pixels count as blank: nothing was measured there.
    """
    images = as_stereo_pair(left, right)
    sure = consistent(result, mirrored) & ~result.filled
    return float(np.mean(np.where(sure, likeness(result, *images), 0)))
