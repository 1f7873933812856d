"""The correlation coefficient (ZNCC) at single placements of a template, where a whole map is not wanted."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt
from numba import njit

from stereolag.kernels.compilation import KEPT

Indices = npt.NDArray[np.intp]


def placement_score(
    image: npt.NDArray[Any], deviations: npt.NDArray[np.float64], opaque: npt.NDArray[np.bool_], row: int, col: int
) -> float:
    """Return the score of one placement, -1..1, NaN where the window is flat.

    Parameters
    ----------
    image
        (rows, cols, channels).
    deviations
        (channels, height, width), the template free of its mean, 0 where not opaque.
    opaque
        (height, width), the pixels that are compared.
    row, col
        Of the top-left pixel of the placement.
    """
    height, width = opaque.shape
    pixels = image[row : row + height, col : col + width][opaque].astype(np.float64)
    relative = pixels - pixels[0]
    window = relative - relative.mean(axis=0)
    norm = np.linalg.norm(window) * np.linalg.norm(deviations)
    if norm == 0:
        return float("nan")
    return float(np.clip(np.sum(window * deviations[:, opaque].T) / norm, -1.0, 1.0))


@njit(nogil=True, cache=KEPT)
def placement_scores(
    image: npt.NDArray[Any],
    deviations: npt.NDArray[np.float64],
    opaque: npt.NDArray[np.bool_],
    rows: Indices,
    cols: Indices,
) -> npt.NDArray[np.float64]:
    """Return :func:`placement_score` at each of `rows`, `cols`."""
    height, width = opaque.shape
    channels = deviations.shape[0]
    template_energy = (deviations**2).sum()
    count = opaque.sum()
    scores = np.empty(len(rows))
    for index in range(len(rows)):
        top, left = rows[index], cols[index]
        product = 0.0
        energy = 0.0
        for channel in range(channels):
            # Relative to its first pixel a flat window is 0 exactly, and a large offset costs no digits.
            first = float(image[top, left, channel])
            total = 0.0
            for row in range(height):
                for col in range(width):
                    if opaque[row, col]:
                        total += float(image[top + row, left + col, channel]) - first
            mean = total / count
            for row in range(height):
                for col in range(width):
                    if opaque[row, col]:
                        deviation = float(image[top + row, left + col, channel]) - first - mean
                        product += deviation * deviations[channel, row, col]
                        energy += deviation * deviation
        scores[index] = np.nan
        if energy > 0:
            scores[index] = max(-1.0, min(1.0, product / np.sqrt(template_energy * energy)))
    return scores
