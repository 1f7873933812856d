"""Census term: words with one bit per neighbour, set if it is darker (Zabih & Woodfill 1994)."""

from __future__ import annotations

from typing import Any, NamedTuple

import cv2
import numpy as np
import numpy.typing as npt

from stereolag.core.arrays import Array
from stereolag.loops.bands import over_bands
from stereolag.loops.compilation import compiled
from stereolag.loops.vector_lanes import popcount
from stereolag.stereo.semi_global.cost_terms.term import CostTerm, EightBit, Run, Volume
from stereolag.stereo.semi_global.costs import MatchingCost

RADIUS = 2
BITS = (2 * RADIUS + 1) ** 2 - 1
Words = npt.NDArray[np.uint32]


def census(image: npt.NDArray[Any]) -> Words:
    """Return (H, W) words of 24 bits, one per 5 × 5 neighbour in reading order, set if it is darker.

    The image is mirrored at its borders. Any increasing change of brightness leaves the words unchanged.
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
    """Return the expected result of :func:`census`, computed with plain NumPy."""
    padded = np.pad(image, RADIUS, mode="reflect")
    rows, cols = image.shape
    words = np.zeros(image.shape, np.int64)
    for row in range(2 * RADIUS + 1):
        for col in range(2 * RADIUS + 1):
            if (row, col) != (RADIUS, RADIUS):
                words = (words << 1) | (padded[row : row + rows, col : col + cols] < image)
    return words.astype(np.uint32)


class CensusFeatures(NamedTuple):
    """Features that the census term compares."""

    words: npt.NDArray[np.uint32]
    bit: np.float32
    """Cost of one differing bit."""


def census_features(image: EightBit, radius: int, settings: MatchingCost) -> CensusFeatures:
    """Return the census words of an image."""
    return CensusFeatures(census(image), np.float32(settings.census / BITS))


@compiled
def add_census(left: CensusFeatures, right: CensusFeatures, run: Run, carried: Array, costs: Array) -> None:
    """Add the cost of each differing bit."""
    words, lags = right.words.reshape(-1), np.uint64(run.lags)
    start = np.uint64(run.y) * np.uint64(right.words.shape[1]) + np.uint64(run.origin)
    for x in range(run.first, run.end):
        target = np.uint64(x - run.first) * lags
        _add_bits(left.words[run.y, x], words, start - np.uint64(x), left.bit, lags, costs, target)


@compiled
def _add_bits(word: Any, words: Array, source: Any, bit: Any, lags: Any, costs: Array, target: Any) -> None:
    for lag in range(lags):
        costs[target + lag] += bit * np.float32(popcount(np.uint32(word ^ words[source + lag])))


def census_cost_reference(left: EightBit, right: EightBit, radius: int, settings: MatchingCost) -> Volume:
    """Return the cost of the census term from its formula."""
    words, others = census_reference(left), census_reference(right)
    return np.asarray(settings.census / BITS * np.bitwise_count(words[:, :, None] ^ others[:, None, :]))


CENSUS = CostTerm("census", CensusFeatures, census_features, add_census, census_cost_reference)
