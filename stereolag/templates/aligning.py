"""A place of an image, moved and blurred by parts of a pixel until a template fits it."""

from __future__ import annotations

import math
from typing import TypeAlias

import cv2
import numpy as np
import numpy.typing as npt

from stereolag.core.inputs import Image

Plane: TypeAlias = npt.NDArray[np.float32]
Matrix: TypeAlias = npt.NDArray[np.float64]

FARTHEST, STILL = np.array([1.2, 1.2, 0.05, 0.05]), 1e-4
"""Largest shift down and across, px, and change of size (a logarithm) and angle (radians), of the alignment; and what a
template varies less along, beside the other way, cannot tell how far it is moved: stripes along themselves."""

AROUND = 4
"""Px around a place that are kept, too."""

TOLD, RIM = 0.1, 2
"""Least share of what remains that a blur explains, as of noise and other things it explains a little too; and width of
the rim, px, that does not tell it."""


class Place:
    """What an image shows around a place, less the template's mean."""

    def __init__(self, image: Image, mean: Matrix, row: int, col: int, shape: tuple[int, int]) -> None:
        top, left = max(0, row - AROUND), max(0, col - AROUND)
        part = image[top : max(top, row + shape[0]) + AROUND, left : max(left, col + shape[1]) + AROUND]
        self._part = np.nan_to_num((part - mean).astype(np.float32))
        self._corner = np.array([col - left, row - top])
        self._shape = shape

    def moved(self, motion: Matrix, margin: int = 0) -> Plane:
        """Return the place, and so many px around it, moved by (rows, cols, logarithm of size, angle)."""
        down, right, size, angle = motion
        cosine, sine = math.exp(size) * math.cos(angle), math.exp(size) * math.sin(angle)
        linear = np.array([[cosine, -sine], [sine, cosine]])
        middle = (np.array(self._shape[::-1]) - 1) / 2
        offset = middle + self._corner + np.array([right, down]) - linear @ (middle + margin)
        size = self._shape[1] + 2 * margin, self._shape[0] + 2 * margin
        moved = cv2.warpAffine(
            self._part,
            np.column_stack([linear, offset]),
            size,
            flags=cv2.INTER_LINEAR | cv2.WARP_INVERSE_MAP,
            borderMode=cv2.BORDER_REPLICATE,
        )
        return np.asarray(moved, dtype=np.float32).reshape(*size[::-1], -1)


def gradient(image: Plane) -> list[Plane]:
    """Return the derivatives down and to the right."""
    return [
        np.asarray(cv2.Sobel(image, cv2.CV_32F, *order, ksize=3, scale=1 / 8), dtype=np.float32).reshape(image.shape)
        for order in ((0, 1), (1, 0))
    ]


class Motions:
    """The motions of a place, as :meth:`Place.moved` takes them.

    Parameters
    ----------
    on
        (rows, cols), the pixels that count.
    channels
        Number of channels.
    posed
        Whether there are changes of size and angle beside shifts.
    """

    def __init__(self, on: npt.NDArray[np.bool_], channels: int, posed: bool) -> None:
        self._on = slice(None) if on.all() else np.repeat(on, channels)
        self._posed = posed
        # The rim of a blurred place shows what is beyond it as well.
        inner = np.zeros(on.shape, np.float32)
        inner[RIM:-RIM, RIM:-RIM] = 1
        self._inner = np.repeat(inner[on], channels)
        # As long as the values of all channels: products with a short last axis take several times as long.
        self._rows, self._cols = (
            np.repeat(at - (side - 1) / 2, channels).astype(np.float32)
            for at, side in zip(np.nonzero(on), on.shape, strict=True)
        )

    def explaining(self, predicted: Plane, residual: Plane, trust: Plane) -> tuple[Matrix, float]:
        """Return the motion and the blur that explain most of the residual of pixels that are trusted more or less."""
        roots = np.repeat(np.sqrt(trust), predicted.shape[2])
        down, right = (one.ravel()[self._on] * roots for one in gradient(predicted))
        terms = [-down, -right]
        if self._posed:
            terms += [-(self._rows * down + self._cols * right), self._rows * right - self._cols * down]
        # A little more blur adds half of the Laplacian for each square px of its spread.
        bend = np.asarray(cv2.Laplacian(predicted, cv2.CV_32F, borderType=cv2.BORDER_REPLICATE)).ravel()[self._on]
        weighted = np.stack([*terms, bend * roots * self._inner / 2])
        products = (weighted @ weighted.T).astype(np.float64)
        energies = np.append(np.repeat(products.diagonal()[:-1].reshape(-1, 2).max(axis=1), 2), products[-1, -1])
        products[np.diag_indices(len(products))] += 1e-9 + STILL * energies
        wanted = residual.ravel() * roots
        sums = weighted @ wanted
        solved, still = np.linalg.solve(products, sums), np.linalg.solve(products[:-1, :-1], sums[:-1])
        moved = np.zeros(4)
        if solved @ sums - still @ sums[:-1] < TOLD * float(np.square(wanted * self._inner).sum()):
            moved[: len(terms)] = still
            return moved, 0.0
        moved[: len(terms)] = solved[:-1]
        return moved, float(solved[-1])
