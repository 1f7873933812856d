"""Places of a template of which a part is covered or outside the image: the blocks that still agree tell them.

One thing in front leaves the other blocks as they are, whereas it can spoil the score of all pixels together. Outside
the image there are no pixels: a place there has fewer blocks.
"""

from __future__ import annotations

import math
from functools import partial
from itertools import pairwise, product

import numpy as np

from stereolag.core.inputs import Image, as_grey
from stereolag.core.jobs import Progress, silent
from stereolag.templates.patterns import Pattern, grey_pattern, pattern_of, reduced, warped
from stereolag.templates.score_maps import (
    Indices,
    Places,
    ScoreMap,
    Scores,
    fft_score_map,
    in_threads,
    peaks,
    score_at,
    scores_at,
)

ALONG = 4
"""Blocks along each side of the template."""

AGREEING = 0.5
"""Share of the blocks, the best of them, by which a place is scored."""

SIDE = 36
"""Side of the template in the reduced image in which places are looked for, the root of its area, px."""

LEAST_SIDE = 20
"""Templates with a shorter side have too little in a block, px."""

LIKELY = 12
"""Places looked at in the full image."""

ROWS_AT_ONCE = 256
"""Rows of the map of all blocks computed at a time."""

AGREES = 0.6
"""Least score of a block that shows its part of the template."""

NOWHERE = Places(np.zeros(0, np.intp), np.zeros(0, np.intp), np.zeros(0), (0, 0))


def hidden_places(image: Image, pattern: Pattern, progress: Progress) -> Places:
    """Return the likeliest places of a template that is partly covered, or up to half of which is outside the image.

    Parameters
    ----------
    image
        (rows, cols, channels), as many channels as the pattern.
    pattern
        The template.
    progress
        Called with the fraction done.

    Returns
    -------
    Places
        Rows and columns are negative above and left of the image. The scores are of the blocks that agree.
    """
    if min(pattern.shape) < LEAST_SIDE or pattern.silhouette:
        return NOWHERE
    factor = max(1.0, math.sqrt(pattern.shape[0] * pattern.shape[1]) / SIDE)
    grey = grey_pattern(pattern) or pattern
    flat = as_grey(image)[:, :, np.newaxis] if image.shape[2] == 3 and grey is not pattern else image
    little = reduced(flat, factor)
    small = warped(grey, 1 / factor, 0.0)
    if small is None or min(small.shape) < ALONG or not (_blocks(small) and _blocks(pattern)):
        return NOWHERE
    scores, margin = _block_scores(little, small, progress)
    found = peaks(scores, small.shape)
    down, across = image.shape[0] / little.shape[0], image.shape[1] / little.shape[1]
    refined = in_threads(
        [
            partial(
                _refined,
                image,
                pattern,
                round((found.rows[one] - margin[0] + small.shape[0] / 2) * down - pattern.shape[0] / 2),
                round((found.cols[one] - margin[1] + small.shape[1] / 2) * across - pattern.shape[1] / 2),
                math.ceil(factor / 2) + 1,
            )
            for one in found.best(LIKELY, share=0.5)
        ],
        lambda done: progress(0.7 + 0.3 * done),
    )
    rows, cols, told = (np.array([place[side] for place in refined]) for side in range(3))
    return Places(rows.astype(np.intp), cols.astype(np.intp), told, pattern.shape)


def _blocks(pattern: Pattern) -> list[tuple[int, int, Pattern]]:
    """Return row, column and pattern of the blocks of a template in which something varies."""
    found = []
    rows, cols = (pairwise(np.linspace(0, side, ALONG + 1).round().astype(int).tolist()) for side in pattern.shape)
    for (top, bottom), (left, right) in product(rows, cols):
        part = np.s_[top:bottom, left:right]
        try:
            found.append((top, left, pattern_of(pattern.colours[part], pattern.weights[part])))
        except ValueError:
            continue
    return found


def _mean_of_best(scores: Scores) -> Scores:
    """Return the mean of the best blocks (blocks, ...), sorting them in their memory."""
    least = len(scores) - max(1, round(AGREEING * len(scores)))
    scores.partition(least, axis=0)
    return np.asarray(np.maximum(scores[least:], 0).mean(axis=0))


def _block_scores(image: Image, pattern: Pattern, progress: Progress) -> tuple[ScoreMap, tuple[int, int]]:
    """Return the mean score of the blocks that agree best, and how many rows and columns lie before the image."""
    margin = pattern.shape[0] // 2, pattern.shape[1] // 2
    rows, cols = (image.shape[axis] - pattern.shape[axis] + 1 + 2 * margin[axis] for axis in range(2))
    blocks, means = _blocks(pattern), np.empty((rows, cols), dtype=np.float32)

    def band(first: int) -> None:
        """Write the means of some rows, so that the maps of all blocks never take the memory of all rows."""
        part = means[first : first + ROWS_AT_ONCE]
        top = first - margin[0]
        strip = image[max(top, 0) : max(top + len(part) + pattern.shape[0] - 1, 0)]
        maps = np.zeros((len(blocks), *part.shape), dtype=np.float32)
        for scores, (row, col, block) in zip(maps, blocks, strict=True):
            if len(strip) >= block.shape[0]:
                _move(fft_score_map(strip, block, silent), scores, max(-top, 0) - row, margin[1] - col)
        part[:] = _mean_of_best(maps)

    in_threads([partial(band, first) for first in range(0, rows, ROWS_AT_ONCE)], lambda done: progress(0.7 * done))
    return means, margin


def _move(scores: ScoreMap, target: ScoreMap, down: int, right: int) -> None:
    """Write scores into a map, moved down and right, as far as they fall into it; NaN becomes 0."""
    part = scores[max(-down, 0) : max(len(target) - down, 0), max(-right, 0) : max(target.shape[1] - right, 0)]
    top, left = max(down, 0), max(right, 0)
    target[top : top + part.shape[0], left : left + part.shape[1]] = np.nan_to_num(part, nan=0.0)


def _refined(image: Image, pattern: Pattern, row: int, col: int, reach: int) -> tuple[int, int, float]:
    """Return the best place within `reach` px of one, and its score over the blocks that agree; -1 if none does."""
    blocks, steps = _blocks(pattern), np.arange(-reach, reach + 1)
    rows, cols = np.repeat(row + steps, steps.size), np.tile(col + steps, steps.size)
    scores = np.stack([_scores_inside(image, block, rows + down, cols + right) for down, right, block in blocks])
    best = int(np.argmax(_mean_of_best(scores.copy())))
    row, col, weights = int(rows[best]), int(cols[best]), np.zeros(pattern.shape)
    for (down, right, block), score in zip(blocks, scores[:, best], strict=True):
        if score >= AGREES:
            weights[down : down + block.shape[0], right : right + block.shape[1]] = block.weights
    if not weights.any():
        return row, col, -1.0
    (top, bottom), (left, right) = ((int(side.min()), int(side.max()) + 1) for side in np.nonzero(weights))
    seen = pattern_of(pattern.colours[top:bottom, left:right], weights[top:bottom, left:right])
    return row, col, score_at(image, seen.deviations, seen.weights, row + top, col + left)


def _scores_inside(image: Image, block: Pattern, rows: Indices, cols: Indices) -> Scores:
    """Return the score of each position of a block, 0 outside the image and where it is flat."""
    inside = (rows >= 0) & (rows + block.shape[0] <= image.shape[0])
    inside &= (cols >= 0) & (cols + block.shape[1] <= image.shape[1])
    scores = np.zeros(len(rows))
    known = scores_at(image, block.deviations, block.weights, rows[inside], cols[inside])
    scores[inside] = np.nan_to_num(known, nan=0.0)
    return scores
