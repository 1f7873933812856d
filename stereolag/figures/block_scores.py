"""A score map packed for reading under the pointer: the best score of each pixel shown, and its place."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
import numpy.typing as npt

from stereolag.figures.packing import packed_pictures, scores_as_colours

SCORE_MAP_WIDTH = 700

BAND = 32
"""Rows of blocks processed at a time, so that the map of a large image is never copied as a whole."""

ScoreMap = npt.NDArray[np.float32]
Offsets = npt.NDArray[np.intp]


def block_side(score_map: ScoreMap) -> int:
    """Return how many places along each side share one pixel of the map shown."""
    return max(1, -(-int(score_map.shape[1]) // SCORE_MAP_WIDTH))


def best_of_blocks(score_map: ScoreMap, factor: int) -> tuple[ScoreMap, Offsets, Offsets]:
    """Return the highest score of each block of factor × factor places, and its row and column offsets.

    Offsets are from the block's top-left corner; a block without scores is NaN.
    """
    bands = [
        _best_of_band(score_map[first : first + factor * BAND], factor)
        for first in range(0, score_map.shape[0], factor * BAND)
    ]
    best, down, right = (np.concatenate(parts) for parts in zip(*bands, strict=True))
    return best, down, right


def _best_of_band(score_map: ScoreMap, factor: int) -> tuple[ScoreMap, Offsets, Offsets]:
    rows, cols = (-(-side // factor) for side in score_map.shape)
    padded = np.full((rows * factor, cols * factor), -np.inf, dtype=np.float32)
    padded[: score_map.shape[0], : score_map.shape[1]] = np.nan_to_num(score_map, nan=-np.inf)
    blocks = padded.reshape(rows, factor, cols, factor).swapaxes(1, 2).reshape(rows, cols, factor * factor)
    down, right = np.divmod(blocks.argmax(axis=2), factor)
    best = blocks.max(axis=2)
    return np.where(np.isneginf(best), np.float32(np.nan), best), down, right


def packed_score_map(png: bytes, score_map: ScoreMap, *, name: str, words: Mapping[str, Any]) -> bytes:
    """Return a map as :func:`~stereolag.figures.packing.packed_pictures`: picture, best scores and their offsets.

    Parameters
    ----------
    png
        The map as drawn by :func:`~stereolag.figures.templates.score_map_png`.
    score_map
        (rows, cols), NaN = no score.
    name
        Name of the search to which a clicked place is sent.
    words
        Texts below the map.
    """
    factor = block_side(score_map)
    best, down, right = best_of_blocks(score_map, factor)
    offsets = np.stack([down, right, np.zeros_like(down)], axis=-1).astype(np.uint8)
    return packed_pictures(
        {"name": name, "factor": factor, "words": dict(words)}, (png, scores_as_colours(best), offsets)
    )
