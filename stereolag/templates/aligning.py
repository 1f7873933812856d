"""Alignment of an image patch with a template, to a fraction of a pixel: shift, size, angle and blur."""

from __future__ import annotations

import math
from typing import TypeAlias

import cv2
import numpy as np
import numpy.typing as npt

from stereolag.core.inputs import Image

Plane: TypeAlias = npt.NDArray[np.float32]
Matrix: TypeAlias = npt.NDArray[np.float64]

MAX_MOTION = np.array([1.2, 1.2, 0.05, 0.05])
"""Largest motion of the alignment: shift down and across, px; change of size (logarithm) and of angle (radians)."""

MOTION_RIDGE = 1e-4
"""Ridge of the fitted motion, as a share of the gradient's energy in the steeper of two directions: where a template
varies less than that, as stripes do along themselves, its shift is undetermined."""

PATCH_MARGIN_PX = 4
"""Pixels kept around a place."""

MIN_BLUR_GAIN = 0.1
"""Least share of the residual that a blur must explain: it also explains a little of noise."""

BLUR_RIM_PX = 2
"""Width of the rim that is left out when the blur is fitted: there, pixels from outside are mixed in."""


class Patch:
    """The image at and around a place, minus the template's mean."""

    def __init__(self, image: Image, mean: Matrix, row: int, col: int, shape: tuple[int, int]) -> None:
        top, left = max(0, row - PATCH_MARGIN_PX), max(0, col - PATCH_MARGIN_PX)
        bottom, right = max(top, row + shape[0]) + PATCH_MARGIN_PX, max(left, col + shape[1]) + PATCH_MARGIN_PX
        self._pixels = np.nan_to_num((image[top:bottom, left:right] - mean).astype(np.float32))
        self._corner = np.array([col - left, row - top])
        self._shape = shape

    def warped(self, motion: Matrix, margin: int = 0) -> Plane:
        """Return the patch, and `margin` px around it, moved by (rows, cols, logarithm of size, angle in radians)."""
        down, right, log_size, angle = motion
        cosine, sine = math.exp(log_size) * math.cos(angle), math.exp(log_size) * math.sin(angle)
        linear = np.array([[cosine, -sine], [sine, cosine]])
        middle = (np.array(self._shape[::-1]) - 1) / 2
        offset = middle + self._corner + np.array([right, down]) - linear @ (middle + margin)
        size = self._shape[1] + 2 * margin, self._shape[0] + 2 * margin
        warped = cv2.warpAffine(
            self._pixels,
            np.column_stack([linear, offset]),
            size,
            flags=cv2.INTER_LINEAR | cv2.WARP_INVERSE_MAP,
            borderMode=cv2.BORDER_REPLICATE,
        )
        return np.asarray(warped, dtype=np.float32).reshape(*size[::-1], -1)


def gradient(image: Plane) -> list[Plane]:
    """Return the derivatives down and to the right."""
    return [
        np.asarray(cv2.Sobel(image, cv2.CV_32F, *order, ksize=3, scale=1 / 8), dtype=np.float32).reshape(image.shape)
        for order in ((0, 1), (1, 0))
    ]


def squared_gradient(image: Plane) -> Plane:
    """Return the squared length of the gradient, summed over channels, (rows, cols)."""
    down, right = (np.square(derivative).sum(axis=2) for derivative in gradient(image))
    return np.asarray(down + right)


class MotionSolver:
    """Least-squares steps of the motion that :meth:`Patch.warped` takes, linearised by the image gradient.

    Parameters
    ----------
    valid
        (rows, cols), the pixels compared.
    channels
        Number of channels.
    refine_pose
        Whether size and angle are fitted as well as the shift.
    """

    def __init__(self, valid: npt.NDArray[np.bool_], channels: int, refine_pose: bool) -> None:
        self._valid = slice(None) if valid.all() else np.repeat(valid, channels)
        self._refine_pose = refine_pose
        inner = np.zeros(valid.shape, np.float32)
        inner[BLUR_RIM_PX:-BLUR_RIM_PX, BLUR_RIM_PX:-BLUR_RIM_PX] = 1
        self._inner = np.repeat(inner[valid], channels)
        # One value per pixel and channel: products with a short last axis take several times as long.
        self._rows, self._cols = (
            np.repeat(at - (side - 1) / 2, channels).astype(np.float32)
            for at, side in zip(np.nonzero(valid), valid.shape, strict=True)
        )

    def step(self, predicted: Plane, residual: Plane, weights: Plane) -> tuple[Matrix, float]:
        """Return the motion, and the change of the squared blur (px²), that explain most of the weighted residual."""
        roots = np.repeat(np.sqrt(weights), predicted.shape[2])
        down, right = (derivative.ravel()[self._valid] * roots for derivative in gradient(predicted))
        terms = [-down, -right]
        if self._refine_pose:
            terms += [-(self._rows * down + self._cols * right), self._rows * right - self._cols * down]
        # A little more blur adds half of the Laplacian for each square px of its variance.
        laplacian = np.asarray(cv2.Laplacian(predicted, cv2.CV_32F, borderType=cv2.BORDER_REPLICATE))
        weighted = np.stack([*terms, laplacian.ravel()[self._valid] * roots * self._inner / 2])
        products = (weighted @ weighted.T).astype(np.float64)
        energies = np.append(np.repeat(products.diagonal()[:-1].reshape(-1, 2).max(axis=1), 2), products[-1, -1])
        products[np.diag_indices(len(products))] += 1e-9 + MOTION_RIDGE * energies
        target = residual.ravel() * roots
        sums = weighted @ target
        with_blur = np.linalg.solve(products, sums)
        without_blur = np.linalg.solve(products[:-1, :-1], sums[:-1])
        blur_gain = with_blur @ sums - without_blur @ sums[:-1]
        is_as_sharp = blur_gain < MIN_BLUR_GAIN * float(np.square(target * self._inner).sum())
        fitted = np.append(without_blur, 0.0) if is_as_sharp else with_blur
        motion = np.zeros(4)
        motion[: len(terms)] = fitted[:-1]
        return motion, float(fitted[-1])
