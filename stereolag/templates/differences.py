"""How what is seen differs from what was predicted: in all, beyond a part of a pixel, and in windows of a few px."""

from __future__ import annotations

import cv2
import numpy as np

from stereolag.templates.aligning import RIM, Matrix, Plane, gradient
from stereolag.templates.patterns import FULL_WEIGHT, blurred

TOLERANCE = 0.5
"""Share of a pixel by which edges may be displaced without counting as a difference."""

MARK, STRONG, ANOTHER, UNMOVED, NOISY = 1.5, 0.4, 0.14, 0.08, 20
"""Spread of a window about a mark, px; least variance in it, as a share of the largest; and least squared difference in
it, as a share of that variance, of another mark: as it is, and less what a move and a blur of its own explain; and how
many times the median of all differences that is at least: noise and JPEG make 2 to 14, other marks 48 and more but for
one of a dozen.

A frame that agrees, or many such marks, hide one from what is told block by block. Measured on cards and signs of a
map: from 0.082 at 8 of 14 taken for others; up to 0.06 where the template is, but for 1 of 243.
"""


def explained(seen: Plane, predicted: Plane, counts: Plane) -> float:
    """Return the share of the variance of pixels seen, one after another, that those predicted explain."""
    varies = float(counts @ squares(seen - counts @ seen / counts.sum()))
    left = float(counts @ squares(seen - predicted))
    return max(0.0, 1 - left / varies) if varies > 0 else 0.0


def squares(vectors: Plane) -> Plane:
    """Return the squared length of each of (n, channels) vectors."""
    return np.asarray(np.einsum("ij,ij->i", vectors, vectors))


def beyond(one: Plane, other: Plane) -> Plane:
    """Return by how much one image leaves the range of the other within a part of a pixel around."""
    square = np.ones((3, 3), np.uint8)
    highest, lowest = (change(other, square).reshape(other.shape) for change in (cv2.dilate, cv2.erode))
    upper, lower = other + TOLERANCE * (highest - other), other + TOLERANCE * (lowest - other)
    return np.asarray(np.maximum(np.maximum(lower - one, one - upper), 0))


class Windows:
    """Means and variances over windows of a few px, of what counts.

    Parameters
    ----------
    weights
        (rows, cols), how much a pixel counts.
    spread
        Spread of the windows, px.

    Attributes
    ----------
    shares
        (rows, cols), how much of the window about each pixel counts.
    """

    def __init__(self, weights: Plane, spread: float) -> None:
        self._weights, self._spread = weights[:, :, np.newaxis], spread
        self.shares = np.maximum(blurred(weights, spread, cv2.BORDER_REPLICATE), 1e-3)

    def mean(self, plane: Plane) -> Plane:
        """Return the means of a plane (rows, cols, channels)."""
        soft = blurred(plane * self._weights, self._spread, cv2.BORDER_REPLICATE)
        return np.asarray(soft.reshape(plane.shape) / self.shares[:, :, np.newaxis], dtype=np.float32)

    def squared(self, plane: Plane) -> Plane:
        """Return the means of the squares of a plane, summed over channels."""
        return self.mean(np.square(plane).sum(axis=2, keepdims=True))[:, :, 0]

    def variance(self, plane: Plane) -> Plane:
        """Return the variances of a plane, summed over channels."""
        return np.asarray(np.maximum(self.squared(plane) - np.square(self.mean(plane)).sum(axis=2), 0))

    def compared(self, drawn: Plane, seen: Plane, faintest: float) -> tuple[Plane, Plane]:
        """Return the squared differences, as shares of the larger variance, 0 where that is faint; and that variance.

        Faint is less than this share of the largest: nothing is drawn there that could differ.
        """
        most = np.maximum(self.variance(drawn), self.variance(seen))
        left = self.variance(drawn - seen) / np.maximum(most, 1e-12)
        return np.asarray(np.where(most > faintest * most.max(), left, 0), dtype=np.float32), most


def another_mark(seen: Plane, predicted: Plane, weights: Plane) -> bool:
    """Return whether some mark differs by more than a move by a part of a pixel, or a blur, of its own explains."""
    if min(weights.shape) <= 2 * RIM:
        return False
    windows, left, inner = Windows(weights, MARK), seen - predicted, np.s_[RIM:-RIM, RIM:-RIM]
    usual = float(np.median(windows.variance(left)[inner]))
    if windows.squared(left)[inner].max() <= NOISY * usual:
        return False
    shares, most = windows.compared(predicted, seen, STRONG)
    where = np.zeros(weights.shape, dtype=np.bool_)
    where[inner] = (shares[inner] > ANOTHER) & (windows.shares[inner] > FULL_WEIGHT)  # no ground shines through
    if not where.any():
        return False

    def common(one: Plane, other: Plane) -> Matrix:
        return windows.mean((one * other).sum(axis=2, keepdims=True))[where].ravel().astype(np.float64)

    bend = cv2.Laplacian(predicted, cv2.CV_32F, borderType=cv2.BORDER_REPLICATE).reshape(left.shape)
    terms = [*gradient(predicted), np.asarray(bend, dtype=np.float32)]
    products = np.array([[common(one, other) for other in terms] for one in terms]).transpose(2, 0, 1)
    sums = np.stack([common(one, left) for one in terms], axis=1)
    ridge = (1e-9 + 1e-3 * float(products.max())) * np.eye(len(terms))
    moves = np.linalg.solve(products + ridge, sums[:, :, np.newaxis])[:, :, 0]
    rest = common(left, left) - (moves * sums).sum(axis=1)
    return bool((rest > np.maximum(UNMOVED * most[where], NOISY * usual)).any())
