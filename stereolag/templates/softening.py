"""The blur under which two renderings of one drawing are compared, and background bleeding into a template's rim."""

from __future__ import annotations

import math

import cv2
import numpy as np

from stereolag.templates.aligning import PATCH_MARGIN_PX, Plane
from stereolag.templates.patterns import blurred

LUMA_SIGMA_PX = 0.8
"""Sigma of the blur after which two renderings of one drawing agree, wherever it falls on the pixel grid."""

CHROMA_SIGMA_PX = 2.0
"""The same for colour minus brightness: JPEG keeps it at half the resolution."""

LUMA_TO_CHROMA_SIGMA_PX = math.sqrt(CHROMA_SIGMA_PX**2 - LUMA_SIGMA_PX**2)
"""Sigma of the blur that takes a blurred brightness to the blur of the colours."""

LUMA_SHARES = np.array([[0.299, 0.587, 0.114]])
"""Shares of red, green and blue in the brightness, as in JPEG."""

BLEED_SIGMAS_PX = (0.25, 0.5, 0.75, 1.0, 1.25, 1.5)
"""Blurs tried to explain how the background is mixed into a template's rim."""

MIN_BLEED = 0.01
"""Least share of the background in a block that can be explained by it."""


class Blur:
    """A blur normalised by weights, stronger for colour than for brightness.

    Parameters
    ----------
    weights
        (rows, cols), the weight of each pixel.
    """

    def __init__(self, weights: Plane) -> None:
        self.weights = weights
        self._factors = None if (weights == 1).all() else weights[:, :, np.newaxis]
        self._blurred_weights: dict[float, Plane] = {}

    def __call__(self, image: Plane, extra_variance: float = 0.0) -> Plane:
        """Return a blurred image; `extra_variance` is added to the squared sigmas, px²."""
        bright = brightness(image)
        soft = self.by(bright, math.sqrt(LUMA_SIGMA_PX**2 + extra_variance))
        if image.shape[2] == 1:
            return soft
        return soft + self.by(image - bright, math.sqrt(CHROMA_SIGMA_PX**2 + extra_variance))

    def evened(self, image: Plane) -> Plane:
        """Return a blurred image with its brightness blurred as much as its colours are."""
        bright = brightness(image)
        return np.asarray(image - bright + self.by(bright, LUMA_TO_CHROMA_SIGMA_PX))

    def by(self, image: Plane, sigma: float) -> Plane:
        """Return an image blurred by this sigma, px."""
        weighted = image if self._factors is None else image * self._factors
        if sigma not in self._blurred_weights:
            if len(self._blurred_weights) == 4:  # planes; the first are reused, later ones are tried once each
                self._blurred_weights.popitem()
            inside = blurred(self.weights, sigma, cv2.BORDER_CONSTANT)
            self._blurred_weights[sigma] = np.maximum(inside, 1e-3)[:, :, np.newaxis]
        return np.asarray(blurred(weighted, sigma, cv2.BORDER_CONSTANT) / self._blurred_weights[sigma])


def brightness(image: Plane) -> Plane:
    """Return the brightness (rows, cols, 1) of an image (rows, cols, channels)."""
    bright = image if image.shape[2] == 1 else cv2.transform(image, LUMA_SHARES)
    return np.asarray(bright, dtype=np.float32).reshape(*image.shape[:2], 1)


class BackgroundBleed:
    """The background around a template, mixed into its rim by blur.

    Parameters
    ----------
    alpha
        (rows, cols), the opacity of the template.
    """

    def __init__(self, alpha: Plane) -> None:
        self._alpha = np.pad(alpha, PATCH_MARGIN_PX)
        self._shares = [self._cropped(self._blurred(1 - self._alpha, sigma)) for sigma in BLEED_SIGMAS_PX]

    @property
    def max_share(self) -> Plane:
        """Share of the background in each pixel under the strongest blur."""
        return self._shares[-1]

    def change(self, surroundings: Plane, drawn: Plane, residual: Plane, blur: Blur) -> Plane:
        """Return the change of the prediction by the background, under the blur that explains most of the residual.

        Parameters
        ----------
        surroundings
            The image at the place and :data:`~stereolag.templates.aligning.PATCH_MARGIN_PX` px on every side of it.
        drawn
            The template as predicted there, sharp.
        residual
            Image minus prediction, both blurred.
        blur
            The blur under which both are compared.
        """
        # Pixels next to the rim are mixed as well.
        outside = cv2.erode((self._alpha == 0).astype(np.float32), np.ones((3, 3), np.uint8))
        outside = np.asarray(outside, dtype=np.float32)[:, :, np.newaxis]
        soft = self._blurred(surroundings * outside, PATCH_MARGIN_PX / 2)
        soft /= np.maximum(self._blurred(outside, PATCH_MARGIN_PX / 2), 1e-6)
        background = self._cropped(soft)
        changes = [blur((background - drawn) * share[:, :, np.newaxis]) for share in self._shares]
        best = np.zeros_like(residual)
        for part in (brightness, lambda plane: plane - brightness(plane)):
            errors = [
                float((np.square(part(residual - change)).sum(axis=2) * blur.weights).sum()) for change in changes
            ]
            best += part(changes[int(np.argmin(errors))])
        return best

    def _blurred(self, plane: Plane, sigma: float) -> Plane:
        return blurred(plane, sigma, cv2.BORDER_REPLICATE)

    def _cropped(self, plane: Plane) -> Plane:
        return plane[PATCH_MARGIN_PX:-PATCH_MARGIN_PX, PATCH_MARGIN_PX:-PATCH_MARGIN_PX]
