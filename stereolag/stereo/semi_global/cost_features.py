"""What the matching cost compares: window sums, census words and gradients of each image."""

from __future__ import annotations

from typing import Any

import cv2
import numpy as np
import numpy.typing as npt

from stereolag.stereo.semi_global.census import census
from stereolag.stereo.semi_global.cost_volume import Features

NOISE = 2.0
"""Standard deviation of the grey levels, of 255, taken for noise: a window that varies less correlates with nothing."""

SOBEL_UNIT = 4
"""The Sobel filter adds up four differences between grey levels two pixels apart."""


def features(image: npt.NDArray[np.uint8], radius: int, slope: float) -> Features:
    """Return what the cost compares.

    Parameters
    ----------
    image
        (H, W) uint8.
    radius
        Of the correlation's window, px.
    slope
        Cost of gradients that differ by one grey level a pixel.
    """
    side = 2 * radius + 1
    padded = cv2.copyMakeBorder(image, radius, radius, radius, radius, cv2.BORDER_REFLECT_101).astype(np.int16)
    padded -= 128
    inside = (slice(radius, radius + image.shape[0]), slice(radius, radius + image.shape[1]))
    total = np.asarray(cv2.boxFilter(padded, cv2.CV_32F, (side, side), normalize=False)[inside], np.float32)
    energy = np.asarray(cv2.sqrBoxFilter(padded, cv2.CV_32F, (side, side), normalize=False)[inside], np.float32)
    energy += np.float32(side**2 * NOISE**2) - total * total * np.float32(1 / side**2)
    return Features(
        padded=padded,
        total=total,
        mean=total * np.float32(1 / side**2),
        inverse=np.reciprocal(np.sqrt(energy, out=energy), out=energy),
        words=census(image),
        gradient=np.asarray(cv2.Sobel(image, cv2.CV_32F, 1, 0, scale=slope / SOBEL_UNIT), np.float32),
        origin=0,
    )


def mirrored(plain: Features, radius: int, before: int, after: int) -> Features:
    """Return the features mirrored left to right, with so many zeros beyond the frame that every lag can be read."""

    def mirror(array: npt.NDArray[Any], border: int) -> npt.NDArray[Any]:
        margin = radius - border
        return np.pad(array[:, ::-1], ((0, 0), (before + margin, after + margin)))

    width = plain.total.shape[1]
    return Features(
        padded=mirror(plain.padded, radius),
        total=mirror(plain.total, 0),
        mean=plain.mean,
        inverse=mirror(plain.inverse, 0),
        words=mirror(plain.words, 0),
        gradient=mirror(plain.gradient, 0),
        origin=width - 1 + radius + before,
    )
