"""The census transform: which neighbours are darker, as the bits of one word (Zabih & Woodfill 1994)."""

from __future__ import annotations

from typing import Any

import cv2
import numpy as np
import numpy.typing as npt

from stereolag.loops.bands import over_bands
from stereolag.loops.compilation import compiled

RADIUS = 2
BITS = (2 * RADIUS + 1) ** 2 - 1
Words = npt.NDArray[np.uint32]


def census(image: npt.NDArray[Any]) -> Words:
    """Return (H, W) words of 24 bits: for the 5 × 5 neighbours in reading order, whether each is darker.

    The image is mirrored at its borders. Any increasing change of brightness leaves the words as they are.
    """
    padded = cv2.copyMakeBorder(image, RADIUS, RADIUS, RADIUS, RADIUS, cv2.BORDER_REFLECT_101)
    words = np.empty(image.shape, np.uint32)
    over_bands(lambda first, end: _census_rows(padded, first, end, words), image.shape[0])
    return words


@compiled
def _census_rows(padded: npt.NDArray[Any], first: int, end: int, words: Words) -> None:
    for y in range(first, end):
        for x in range(words.shape[1]):
            words[y, x] = 0
        for row in range(2 * RADIUS + 1):
            for col in range(2 * RADIUS + 1):
                if row == RADIUS and col == RADIUS:
                    continue
                for x in range(words.shape[1]):
                    darker = padded[y + row, x + col] < padded[y + RADIUS, x + RADIUS]
                    words[y, x] = np.uint32(words[y, x] << np.uint32(1)) | np.uint32(darker)


def census_reference(image: npt.NDArray[Any]) -> Words:
    """Return what :func:`census` must equal, by plain NumPy."""
    padded = np.pad(image, RADIUS, mode="reflect")
    rows, cols = image.shape
    words = np.zeros(image.shape, np.int64)
    for row in range(2 * RADIUS + 1):
        for col in range(2 * RADIUS + 1):
            if (row, col) != (RADIUS, RADIUS):
                words = (words << 1) | (padded[row : row + rows, col : col + cols] < image)
    return words.astype(np.uint32)
