"""Horizontal gradient term: it sharpens vertical edges."""

from __future__ import annotations

from typing import Any, NamedTuple

import cv2
import numpy as np
import numpy.typing as npt

from stereolag.core.arrays import Array
from stereolag.loops.compilation import compiled
from stereolag.stereo.semi_global.cost_terms.term import CostTerm, EightBit, Run, Volume
from stereolag.stereo.semi_global.costs import MatchingCost

SOBEL_UNIT = 4
"""The Sobel filter adds up four differences between grey levels two pixels apart."""


class GradientFeatures(NamedTuple):
    """Features that the gradient term compares."""

    gradient: npt.NDArray[np.float32]
    """Horizontal gradient, in units of cost."""
    cap: np.float32
    """Highest cost of a difference."""


def gradient_features(image: EightBit, radius: int, settings: MatchingCost) -> GradientFeatures:
    """Return the horizontal gradient of an image."""
    scale = settings.gradient / settings.gradient_limit / SOBEL_UNIT
    gradient = np.asarray(cv2.Sobel(image, cv2.CV_32F, 1, 0, scale=scale), np.float32)
    return GradientFeatures(gradient, np.float32(settings.gradient))


@compiled
def add_gradient(left: GradientFeatures, right: GradientFeatures, run: Run, carried: Array, costs: Array) -> None:
    """Add the difference of the gradients, up to the cap."""
    gradients, lags = right.gradient.reshape(-1), np.uint64(run.lags)
    start = np.uint64(run.y) * np.uint64(right.gradient.shape[1]) + np.uint64(run.origin)
    for x in range(run.first, run.end):
        target = np.uint64(x - run.first) * lags
        _add_apart(left.gradient[run.y, x], gradients, start - np.uint64(x), left.cap, lags, costs, target)


@compiled
def _add_apart(gradient: Any, gradients: Array, source: Any, cap: Any, lags: Any, costs: Array, target: Any) -> None:
    for lag in range(lags):
        costs[target + lag] += min(abs(gradient - gradients[source + lag]), cap)


def gradient_reference(left: EightBit, right: EightBit, radius: int, settings: MatchingCost) -> Volume:
    """Return the cost of the gradient term from its formula."""
    slopes = []
    for image in (left, right):
        padded = np.pad(image.astype(np.int64), 1, mode="reflect")
        smooth = padded[:-2] + 2 * padded[1:-1] + padded[2:]
        slopes.append((smooth[:, 2:] - smooth[:, :-2]) / SOBEL_UNIT)
    apart = np.abs(slopes[0][:, :, None] - slopes[1][:, None, :])
    return np.asarray(settings.gradient * np.minimum(apart / settings.gradient_limit, 1))


GRADIENT = CostTerm("gradient", GradientFeatures, gradient_features, add_gradient, gradient_reference)
