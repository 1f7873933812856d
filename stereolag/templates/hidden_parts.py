"""Places of a template of which a part is covered or outside the image: the blocks that still agree tell them.

One thing in front leaves the other blocks as they are, whereas it can spoil the score of all pixels together. Outside
the image there are no pixels: a place there has fewer blocks.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from functools import partial
from itertools import pairwise, product
from typing import NamedTuple

import cv2
import numpy as np

from stereolag.core.inputs import Image, as_grey
from stereolag.core.jobs import Progress
from stereolag.templates.patterns import Pattern, grey_pattern, pattern_of, reduced, warped
from stereolag.templates.score_maps import (
    Places,
    Plane,
    ScoreMap,
    Scores,
    in_threads,
    peaks,
    score_at,
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

LEAST_AGREEING = 0.25
"""Least share of the blocks that agree: half of them do where the most that the verdict allows is hidden."""

LEAST_LIKELY = 0.5
"""Least mean score in the reduced image: from 0.8 at places that are the template."""

FLAT = 20 * float(np.finfo(np.float32).eps)
"""A block is flat up to this energy, as a share of its sum of squares."""

VALUES_AT_ONCE = 300_000
"""Pixel values of windows multiplied at a time: they stay in the cache."""

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
    if small is not None and (grey.weights == 1).all():  # only the rim counts less, from what is beyond it
        small = pattern_of(small.colours, small.weights > 0)
    if small is None or min(small.shape) < ALONG or not (_blocks(small) and _blocks(pattern)):
        return NOWHERE
    scores, margin = _block_scores(little, small, progress)
    found = peaks(scores, small.shape)
    down, across = image.shape[0] / little.shape[0], image.shape[1] / little.shape[1]
    blocks = _Blocks(pattern)
    refined = in_threads(
        [
            partial(
                _refined,
                image,
                pattern,
                blocks,
                round((found.rows[one] - margin[0] + small.shape[0] / 2) * down - pattern.shape[0] / 2),
                round((found.cols[one] - margin[1] + small.shape[1] / 2) * across - pattern.shape[1] / 2),
                math.ceil(factor / 2) + 1,
            )
            for one in found.best(LIKELY, share=0.5)
        ],
        lambda done: progress(0.7 + 0.3 * done),
    )
    seen = [place for place in refined if place is not None]
    if not seen:
        return NOWHERE
    rows, cols, told = (np.array([place[side] for place in seen]) for side in range(3))
    return Places(rows.astype(np.intp), cols.astype(np.intp), told, pattern.shape)


class _Blocks:
    """The blocks of a template in which something varies, each in a window of the size of the largest.

    Parameters
    ----------
    pattern
        The template.

    Attributes
    ----------
    tops, lefts
        First row and column of each window in the template.
    weights
        (blocks, height, width), the weights of the pixels of each block.
    """

    def __init__(self, pattern: Pattern) -> None:
        blocks, whole = _blocks(pattern), pattern.shape
        height, width = (max(block.shape[axis] for _, _, block in blocks) for axis in range(2))
        channels = len(pattern.deviations)
        self.tops = [min(row, whole[0] - height) for row, _, _ in blocks]
        self.lefts = [min(col, whole[1] - width) for _, col, _ in blocks]
        self.weights = np.zeros((len(blocks), height, width), dtype=np.float32)
        self._kernels = np.zeros((len(blocks), channels, height, width), dtype=np.float32)
        for number, (row, col, block) in enumerate(blocks):
            down, right = row - self.tops[number], col - self.lefts[number]
            inside = np.s_[..., down : down + block.shape[0], right : right + block.shape[1]]
            self.weights[number][inside] = block.weights
            self._kernels[number][inside] = block.weights * block.deviations / block.norm

    def scores(self, planes: Plane, some: slice = slice(None)) -> ScoreMap:
        """Return the score of some of the blocks wherever their window fits into planes (channels, rows, cols).

        It is 0 where the block is flat or holds a pixel without data. Every place is a column of one matrix product:
        for windows this small that takes less time than transforms.
        """
        kernels, weights = self._kernels[some], self.weights[some]
        channels, height, width = kernels.shape[1:]
        windows = np.lib.stride_tricks.sliding_window_view(planes, (height, width), axis=(1, 2))
        rows, cols = windows.shape[1:3]
        kernels = kernels.reshape(len(kernels), -1)
        # Most blocks weigh all their pixels alike: what only depends on the weights is computed once.
        unlike = {one.tobytes(): one.ravel() for one in weights}
        which = [list(unlike).index(one.tobytes()) for one in weights]
        weights = np.stack(list(unlike.values()))
        counts = weights.sum(axis=1)[:, np.newaxis]
        scores = np.empty((len(kernels), rows, cols), dtype=np.float32)
        step = max(1, VALUES_AT_ONCE // (channels * height * width * cols))
        for first in range(0, rows, step):
            part = windows[:, first : first + step].transpose(0, 3, 4, 1, 2)
            matrix = part.reshape(channels, height * width, -1)
            out = scores[:, first : first + step]
            products = kernels @ matrix.reshape(-1, matrix.shape[2])
            means = np.square(weights @ matrix).sum(axis=0) / counts
            squares = (weights @ np.square(matrix, out=matrix)).sum(axis=0)
            spread = squares - means
            spread[~(spread > FLAT * squares)] = np.inf  # NaN too
            products /= np.sqrt(spread)[which]
            out[:] = np.nan_to_num(products, copy=False, nan=0.0).reshape(out.shape)
        return scores


class HiddenAmounts(NamedTuple):
    """What :func:`hidden_places` needs."""

    memory: float
    """Bytes."""
    values: float
    """Pixel values scored, or written into the maps of blocks."""


def hidden_amounts(
    image_shape: Sequence[int], template_shape: Sequence[int], channels: int, itemsize: int
) -> HiddenAmounts:
    """Return what :func:`hidden_places` needs for an image of so many compared channels and bytes a value."""
    (height, width), pixels = template_shape[:2], math.prod(image_shape[:2])
    if min(height, width) < LEAST_SIDE:
        return HiddenAmounts(0, 0)
    factor, threads, score = max(1.0, math.sqrt(height * width) / SIDE), max(1, cv2.getNumThreads()), 4
    rows, cols = ((length + side) / factor for length, side in zip(image_shape, template_shape[:2], strict=False))
    bands = min(threads, math.ceil(rows / ROWS_AT_ONCE))
    band = min(rows, ROWS_AT_ONCE) * cols
    places = rows * cols
    # The luminance and the reduced image; the means; in every thread the maps of all blocks, half of them sorted, and
    # the transforms of one.
    maps = (pixels * (channels > 1) + places) * itemsize + 2 * score * places
    maps += bands * band * (score * (1.5 * ALONG**2 + 2) + 32)
    around = (2 * math.ceil(factor / 2) + 3) ** 2
    gathered = min(VALUES_AT_ONCE + channels * height * width / ALONG**2, around * channels * height * width / ALONG**2)
    scored = LIKELY * around * channels * height * width
    return HiddenAmounts(max(maps, threads * 40 * gathered), scored + 10 * ALONG**2 * places)


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
    """Return the mean score of the blocks that agree best, and how many rows and columns lie before the image.

    NaN where they cannot reach :data:`LEAST_LIKELY`.
    """
    (height, width), blocks = pattern.shape, _Blocks(pattern)
    margin = height // 2, width // 2
    planes = _surrounded(image, *(-side for side in margin), *(image.shape[axis] + margin[axis] for axis in range(2)))
    rows, cols = planes.shape[1] - height + 1, planes.shape[2] - width + 1
    means = np.full((rows, cols), np.nan, dtype=np.float32)
    best = max(1, round(AGREEING * len(blocks.tops)))

    def band(first: int) -> None:
        """Write the means of some rows, so that the maps of all blocks never take the memory of all rows."""
        part = means[first : first + ROWS_AT_ONCE]
        maps = blocks.scores(planes[:, first : first + len(part) + height - 1])
        moved = [
            one[top : top + len(part), left : left + cols]
            for one, top, left in zip(maps, blocks.tops, blocks.lefts, strict=True)
        ]
        total = np.zeros(part.shape, dtype=np.float32)
        for one in moved:
            total += np.maximum(one, 0, out=one)
        likely = np.nonzero(total >= best * LEAST_LIKELY)
        part[likely] = _mean_of_best(np.stack([one[likely] for one in moved]))

    in_threads([partial(band, first) for first in range(0, rows, ROWS_AT_ONCE)], lambda done: progress(0.7 * done))
    return means, margin


def _surrounded(image: Image, top: int, left: int, bottom: int, right: int) -> Plane:
    """Return a part of an image (channels, rows, cols) around 0 in single precision, NaN outside the image."""
    part = np.full((image.shape[2], bottom - top, right - left), np.nan, dtype=np.float32)
    inside = image[max(top, 0) : max(bottom, 0), max(left, 0) : max(right, 0)]
    if inside.size:
        first = inside.reshape(-1, image.shape[2])
        middle = np.nan_to_num(np.nanmean(first.astype(np.float64), axis=0)) if np.isfinite(first).any() else 0.0
        rows, cols = (max(-side, 0) for side in (top, left))
        part[:, rows : rows + inside.shape[0], cols : cols + inside.shape[1]] = np.moveaxis(inside - middle, 2, 0)
    return part


def _refined(
    image: Image, pattern: Pattern, blocks: _Blocks, row: int, col: int, reach: int
) -> tuple[int, int, float] | None:
    """Return the best place within `reach` px of one, and its score over the blocks that agree; None if too few do."""
    top, left = row - reach, col - reach
    planes = _surrounded(image, top, left, row + pattern.shape[0] + reach, col + pattern.shape[1] + reach)
    height, width = blocks.weights.shape[1:]
    scores = np.concatenate(
        [
            blocks.scores(
                planes[:, down : down + height + 2 * reach, right : right + width + 2 * reach],
                slice(number, number + 1),
            )
            for number, (down, right) in enumerate(zip(blocks.tops, blocks.lefts, strict=True))
        ]
    )
    best = np.unravel_index(int(np.argmax(_mean_of_best(scores.copy()))), scores.shape[1:])
    row, col = top + int(best[0]), left + int(best[1])
    agree = scores[:, best[0], best[1]] >= AGREES
    if agree.mean() < LEAST_AGREEING:
        return None
    weights = np.zeros(pattern.shape)
    for number in np.flatnonzero(agree):
        down, right = blocks.tops[number], blocks.lefts[number]
        weights[down : down + height, right : right + width][blocks.weights[number] > 0] = 1
    weights *= pattern.weights
    (top, bottom), (left, right) = ((int(side.min()), int(side.max()) + 1) for side in np.nonzero(weights))
    seen = pattern_of(pattern.colours[top:bottom, left:right], weights[top:bottom, left:right])
    return row, col, score_at(image, seen.deviations, seen.weights, row + top, col + left)
