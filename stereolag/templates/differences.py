"""Differences between an image and its prediction: overall, beyond a fraction of a pixel, and in small windows."""

from __future__ import annotations

import cv2
import numpy as np

from stereolag.templates.aligning import BLUR_RIM_PX, Matrix, Plane, gradient
from stereolag.templates.patterns import FULL_WEIGHT, blurred

EDGE_TOLERANCE_PX = 0.5
"""Displacement of an edge that does not count as a difference."""

MARK_SIGMA_PX = 1.5
"""Sigma of the Gaussian window about a mark."""

MIN_MARK_VARIANCE = 0.4
"""Least variance in the window of a mark, as a share of the largest of all windows."""

MIN_MARK_DIFFERENCE = 0.14
"""Least squared difference between two marks, as a share of that variance."""

MIN_UNMOVED_DIFFERENCE = 0.08
"""The same after each mark was moved by a fraction of a pixel and blurred.

Measured on cards and signs of a map: from 0.082 at 8 of 14 marks that differ; up to 0.06 where the template is, but for
1 of 243.
"""

MIN_OVER_NOISE = 20
"""Least squared difference between two marks over the median of all windows.

Measured: 2 to 14 for noise and JPEG, 48 and more for other marks but for one of a dozen.
"""


def explained_variance(observed: Plane, predicted: Plane, weights: Plane) -> float:
    """Return the share of the weighted variance of observed (n, channels) pixels that the prediction explains."""
    variance = float(weights @ squares(observed - weights @ observed / weights.sum()))
    residual = float(weights @ squares(observed - predicted))
    return max(0.0, 1 - residual / variance) if variance > 0 else 0.0


def squares(vectors: Plane) -> Plane:
    """Return the squared length of each of (n, channels) vectors."""
    return np.asarray(np.einsum("ij,ij->i", vectors, vectors))


def excess(image: Plane, other: Plane) -> Plane:
    """Return how far each pixel lies outside the range of the other image's values within a fraction of a pixel."""
    square = np.ones((3, 3), np.uint8)
    highest, lowest = (change(other, square).reshape(other.shape) for change in (cv2.dilate, cv2.erode))
    upper, lower = other + EDGE_TOLERANCE_PX * (highest - other), other + EDGE_TOLERANCE_PX * (lowest - other)
    return np.asarray(np.maximum(np.maximum(lower - image, image - upper), 0))


class Windows:
    """Weighted means and variances over Gaussian windows of a few pixels.

    Parameters
    ----------
    weights
        (rows, cols), the weight of each pixel.
    sigma
        Sigma of the windows, px.

    Attributes
    ----------
    shares
        (rows, cols), the mean weight in the window about each pixel.
    """

    def __init__(self, weights: Plane, sigma: float) -> None:
        self._weights, self._sigma = weights[:, :, np.newaxis], sigma
        self.shares = np.maximum(blurred(weights, sigma, cv2.BORDER_REPLICATE), 1e-3)

    def mean(self, plane: Plane) -> Plane:
        """Return the means of a plane (rows, cols, channels)."""
        soft = blurred(plane * self._weights, self._sigma, cv2.BORDER_REPLICATE)
        return np.asarray(soft.reshape(plane.shape) / self.shares[:, :, np.newaxis], dtype=np.float32)

    def mean_square(self, plane: Plane) -> Plane:
        """Return the means of the squares of a plane, summed over channels."""
        return self.mean(np.square(plane).sum(axis=2, keepdims=True))[:, :, 0]

    def variance(self, plane: Plane) -> Plane:
        """Return the variances of a plane, summed over channels."""
        return np.asarray(np.maximum(self.mean_square(plane) - np.square(self.mean(plane)).sum(axis=2), 0))

    def relative_differences(self, drawn: Plane, observed: Plane, min_variance: float) -> tuple[Plane, Plane]:
        """Return the variance of the difference as a share of the larger of both variances, and that variance.

        The share is 0 where the larger variance is below `min_variance`, a share of its maximum: nothing is drawn there
        that could differ.
        """
        larger = np.maximum(self.variance(drawn), self.variance(observed))
        shares = self.variance(drawn - observed) / np.maximum(larger, 1e-12)
        return np.asarray(np.where(larger > min_variance * larger.max(), shares, 0), dtype=np.float32), larger


def has_another_mark(observed: Plane, predicted: Plane, weights: Plane) -> bool:
    """Return whether a mark differs by more than a shift by a fraction of a pixel, or a blur, of that mark explains.

    A frame that agrees, or many such marks, hide one that differs from the comparison of blocks.
    """
    if min(weights.shape) <= 2 * BLUR_RIM_PX:
        return False
    windows, residual = Windows(weights, MARK_SIGMA_PX), observed - predicted
    inner = np.s_[BLUR_RIM_PX:-BLUR_RIM_PX, BLUR_RIM_PX:-BLUR_RIM_PX]
    median_variance = float(np.median(windows.variance(residual)[inner]))
    if windows.mean_square(residual)[inner].max() <= MIN_OVER_NOISE * median_variance:
        return False
    shares, variance = windows.relative_differences(predicted, observed, MIN_MARK_VARIANCE)
    where = np.zeros(weights.shape, dtype=np.bool_)
    opaque = windows.shares[inner] > FULL_WEIGHT  # no background shows through
    where[inner] = (shares[inner] > MIN_MARK_DIFFERENCE) & opaque
    if not where.any():
        return False

    def mean_product(plane: Plane, other: Plane) -> Matrix:
        return windows.mean((plane * other).sum(axis=2, keepdims=True))[where].ravel().astype(np.float64)

    laplacian = cv2.Laplacian(predicted, cv2.CV_32F, borderType=cv2.BORDER_REPLICATE).reshape(residual.shape)
    terms = [*gradient(predicted), np.asarray(laplacian, dtype=np.float32)]
    products = np.array([[mean_product(plane, other) for other in terms] for plane in terms]).transpose(2, 0, 1)
    sums = np.stack([mean_product(plane, residual) for plane in terms], axis=1)
    ridge = (1e-9 + 1e-3 * float(products.max())) * np.eye(len(terms))
    moves = np.linalg.solve(products + ridge, sums[:, :, np.newaxis])[:, :, 0]
    unexplained = mean_product(residual, residual) - (moves * sums).sum(axis=1)
    limits = np.maximum(MIN_UNMOVED_DIFFERENCE * variance[where], MIN_OVER_NOISE * median_variance)
    return bool((unexplained > limits).any())
