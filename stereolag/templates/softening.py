"""How soft two renderings of one drawing are compared, and what is mixed into the rim of a template from beside it."""

from __future__ import annotations

import math

import cv2
import numpy as np

from stereolag.templates.aligning import AROUND, Plane
from stereolag.templates.patterns import blurred

BLUR = 0.8
"""Spread of the blur, px, after which two renderings of one drawing agree, however it falls on the pixels."""

BLUR_OF_COLOURS = 2.0
"""The same of its colours beside its brightness: JPEG keeps them at half the resolution."""

BRIGHTNESS = np.array([[0.299, 0.587, 0.114]])
"""Shares of red, green and blue in a brightness, as JPEG keeps it."""

BLUR_BESIDE = math.sqrt(BLUR_OF_COLOURS**2 - BLUR**2)
"""The blur that brings a blurred brightness to that of the colours."""

MIXED, LEAST_MIXED = (0.25, 0.5, 0.75, 1.0, 1.25, 1.5), 0.01
"""Spreads of the blurs, px, that mix what is beside a template into its rim; and the least share of that in a block."""


KEPT = 4
"""Spreads whose weights a blur keeps: a plane each."""


class Blur:
    """A blur without what its weights exclude, of colours more than of brightness.

    Parameters
    ----------
    weights
        (rows, cols), how much a pixel counts.
    """

    def __init__(self, weights: Plane) -> None:
        self.counts = weights
        self._weights = None if (weights == 1).all() else weights[:, :, np.newaxis]
        self._shares: dict[float, Plane] = {}

    def __call__(self, image: Plane, softer: float = 0.0) -> Plane:
        """Return an image blurred, by so much more of a squared spread, px."""
        bright = brightness(image)
        soft = self.by(bright, math.sqrt(BLUR**2 + softer))
        if image.shape[2] == 1:
            return soft
        return soft + self.by(image - bright, math.sqrt(BLUR_OF_COLOURS**2 + softer))

    def softened(self, image: Plane) -> Plane:
        """Return a blurred image with its brightness blurred as its colours are."""
        bright = brightness(image)
        return np.asarray(image - bright + self.by(bright, BLUR_BESIDE))

    def by(self, image: Plane, spread: float) -> Plane:
        """Return an image blurred by this spread, px."""
        weighted = image if self._weights is None else image * self._weights
        if spread not in self._shares:
            if len(self._shares) == KEPT:  # those after the first are tried in turn, each once
                self._shares.popitem()
            inside = blurred(self.counts, spread, cv2.BORDER_CONSTANT)
            self._shares[spread] = np.maximum(inside, 1e-3)[:, :, np.newaxis]
        return np.asarray(blurred(weighted, spread, cv2.BORDER_CONSTANT) / self._shares[spread])


def brightness(image: Plane) -> Plane:
    """Return the brightness of an image (rows, cols, channels), (rows, cols, 1)."""
    bright = image if image.shape[2] == 1 else cv2.transform(image, BRIGHTNESS)
    return np.asarray(bright, dtype=np.float32).reshape(*image.shape[:2], 1)


class Rim:
    """What is beside a template, as its rim shows it.

    Parameters
    ----------
    alpha
        (rows, cols), how opaque the template is.
    """

    def __init__(self, alpha: Plane) -> None:
        self._alpha = np.pad(alpha, AROUND)
        self._shares = [self._inner(self._soft(1 - self._alpha, spread)) for spread in MIXED]

    @property
    def reached(self) -> Plane:
        """The largest share of what is beside it in each pixel."""
        return self._shares[-1]

    def mixed_in(self, around: Plane, drawn: Plane, left: Plane, blur: Blur) -> Plane:
        """Return what is beside a template, mixed in by the blur that explains most.

        Parameters
        ----------
        around
            The place and :data:`~stereolag.templates.aligning.AROUND` px on every side of it.
        drawn
            What the template predicts there, sharp.
        left
            What remains of the place, blurred.
        blur
            The blur by which both are compared.
        """
        # What is next to the rim is mixed too.
        away = np.asarray(cv2.erode((self._alpha == 0).astype(np.float32), np.ones((3, 3), np.uint8)), dtype=np.float32)
        away = away[:, :, np.newaxis]
        seen = self._soft(around * away, AROUND / 2)
        beside = self._inner(np.asarray(seen / np.maximum(self._soft(away, AROUND / 2), 1e-6)))
        steps = [blur((beside - drawn) * share[:, :, np.newaxis]) for share in self._shares]
        mixed = np.zeros_like(left)
        for part in (brightness, lambda plane: plane - brightness(plane)):
            fits = [float((np.square(part(left - step)).sum(axis=2) * blur.counts).sum()) for step in steps]
            mixed += part(steps[int(np.argmin(fits))])
        return mixed

    def _soft(self, plane: Plane, spread: float) -> Plane:
        return blurred(plane, spread, cv2.BORDER_REPLICATE)

    def _inner(self, plane: Plane) -> Plane:
        return plane[AROUND:-AROUND, AROUND:-AROUND]
