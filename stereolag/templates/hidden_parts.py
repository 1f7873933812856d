"""Places of a template of which a part is covered or outside the image: the blocks that still agree tell them.

One thing in front leaves the other blocks as they are, whereas it can spoil the score of all pixels together. Outside
the image there are no pixels: a place there has fewer blocks.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from functools import partial
from typing import Any, NamedTuple

import cv2
import numpy as np
import numpy.typing as npt

from stereolag.core.arrays import Mask
from stereolag.core.inputs import Image
from stereolag.core.jobs import Progress
from stereolag.templates.patterns import Pattern, in_grey, pattern_of, reduced, warped
from stereolag.templates.places import Places, peaks
from stereolag.templates.score_maps import Plane, fft_score_map, in_threads, scores_at

ALONG = 4
"""Blocks along each side of the template."""

AGREEING = 0.5
"""Share of the blocks, the best of them, by which a place is scored."""

SIDE = 36
"""Side of the template in the reduced image in which places are looked for, the root of its area, px."""

LEAST_SIDE = 20
"""Templates with a shorter side have too little in a block, px."""

EVENED, STEADY = 1.5, 0.02
"""Spread, px, of what every pixel is compared with, and the least contrast there as a share of the template's."""

MIDDLE, FULL = 128, 40
"""What no difference is, and what a difference as large as the contrast around it adds to that, in 8 bits."""

LIKELY = 12
"""Places looked at, in the reduced image and then in the full one."""

AGREES = 0.6
"""Least score of a block that shows its part of the template."""

LEAST_AGREEING, LEAST_SCORE = 0.3, 0.7
"""Least share of the blocks that agree, and least mean score of the best of them, in the full image.

Measured at 243 places with 10 to 50 % hidden that the verdict then took: from 0.31 and from 0.75.
"""

LEAST_LIKELY, BELOW = 0.5, 0.3
"""Least mean score of the best blocks in the reduced image, from 0.8 at places that are the template, and how far below
the best place's it may be."""

FLAT = 20 * float(np.finfo(np.float32).eps)
"""A block is flat up to this energy, as a share of its sum of squares."""

VALUES_AT_ONCE = 100_000
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
    flat, grey = in_grey(image, pattern)
    if factor >= 2:  # in two steps, the first an exact half, which takes far less time
        little = reduced(reduced(flat[: flat.shape[0] // 2 * 2, : flat.shape[1] // 2 * 2], 2), factor / 2)
    else:
        little = reduced(flat, factor)
    small = warped(grey, 1 / factor, 0.0)
    if small is not None and (grey.weights == 1).all():  # only the rim counts less, from what is beyond it
        rim = int((small.weights == 0).any())  # without it, running sums do for the weights
        inner = slice(rim, -rim or None)
        small = pattern_of(small.colours[inner, inner], small.weights[inner, inner] > 0)
    if small is None or min(small.shape) < ALONG:
        return NOWHERE
    coarse, fine = _Blocks(small), _Blocks(pattern)
    if not (coarse.varying.any() and fine.varying.any()):
        return NOWHERE
    down, across = image.shape[0] / little.shape[0], image.shape[1] / little.shape[1]
    likely = [coarse.best_near(little, row, col, 1) for row, col in _roughly(little, small, progress)]
    progress(0.6)
    least = max([LEAST_LIKELY, *(place.score - BELOW for place in likely)])
    refined = in_threads(
        [
            partial(
                fine.best_near,
                image,
                round((place.row + small.shape[0] / 2) * down - pattern.shape[0] / 2),
                round((place.col + small.shape[1] / 2) * across - pattern.shape[1] / 2),
                math.ceil(factor / 2) + 1,
            )
            for place in likely
            if place.score >= least
        ],
        lambda done: progress(0.6 + 0.4 * done),
    )
    seen = [place for place in refined if place.agree.mean() >= LEAST_AGREEING and place.score >= LEAST_SCORE]
    if not seen:
        return NOWHERE
    rows, cols = (np.array([place[side] for place in seen], dtype=np.intp) for side in range(2))
    return Places(rows, cols, np.array([_seen_score(image, pattern, fine, place) for place in seen]), pattern.shape)


class _Place(NamedTuple):
    """A place, the mean score of the best of its blocks, and which of those that vary agree."""

    row: int
    col: int
    score: float
    agree: Mask


class _Blocks:
    """The blocks of a template.

    Parameters
    ----------
    pattern
        The template.

    Attributes
    ----------
    varying
        (blocks down, blocks across), those in which something varies.
    """

    def __init__(self, pattern: Pattern) -> None:
        self._edges = [np.linspace(0, side, ALONG + 1).round().astype(int) for side in pattern.shape]
        self._down, self._across = (
            np.repeat(np.eye(ALONG, dtype=np.float32), np.diff(edges), axis=1) for edges in self._edges
        )
        self._weights = pattern.weights.astype(np.float32)
        self._alike = bool((self._weights == 1).all())
        self._counts = self._summed(self._weights)
        planes = pattern.deviations.astype(np.float32)
        means = self._summed(planes * self._weights) / np.maximum(self._counts, 1e-6)
        centred = planes - np.stack([self.spread(mean) for mean in means])
        self._kernels = centred * self._weights
        energy, squares = (self._summed(self._weights * np.square(one)).sum(axis=0) for one in (centred, planes))
        self.varying = energy > FLAT * squares
        self._norms = np.sqrt(np.where(self.varying, energy, np.inf))

    def _summed(self, planes: Plane) -> Plane:
        """Return the sum over each block of planes (..., rows, cols)."""
        return np.asarray(self._down @ planes @ self._across.T)

    def spread(self, blocks: npt.NDArray[np.floating[Any]]) -> npt.NDArray[np.floating[Any]]:
        """Return a plane of the template's size with the value of its block at every pixel."""
        return np.asarray(blocks.repeat(np.diff(self._edges[0]), axis=0).repeat(np.diff(self._edges[1]), axis=1))

    def best_near(self, image: Image, row: int, col: int, reach: int) -> _Place:
        """Return the best place within `reach` px of one."""
        (height, width), (top, left) = self._weights.shape, (row - reach, col - reach)
        planes = _surrounded(image, top, left, row + height + reach, col + width + reach)
        gaps = np.isnan(planes).any(axis=0)
        planes[:, gaps] = 0
        windows = np.lib.stride_tricks.sliding_window_view(planes, (height, width), axis=(1, 2))
        hidden = np.lib.stride_tricks.sliding_window_view(gaps, (height, width))
        rows, cols = np.indices(hidden.shape[:2]).reshape(2, -1)
        step = max(1, VALUES_AT_ONCE // self._kernels.size)
        scores = np.concatenate(
            [
                self._scores(windows[:, rows[some], cols[some]], hidden[rows[some], cols[some]])
                for some in (slice(first, first + step) for first in range(0, len(rows), step))
            ]
        )[:, self.varying]
        best = np.sort(scores, axis=1)[:, -max(1, round(AGREEING * scores.shape[1])) :].clip(0).mean(axis=1)
        one = int(best.argmax())
        return _Place(top + int(rows[one]), left + int(cols[one]), float(best[one]), scores[one] >= AGREES)

    def _scores(self, windows: Plane, gaps: Mask) -> Plane:
        """Return the scores of the blocks in windows (channels, windows, rows, cols), 0 if flat or without data."""
        weighted = windows if self._alike else windows * self._weights
        sums, squares = self._summed(weighted), self._summed(weighted * windows).sum(axis=0)
        spread = squares - np.square(sums).sum(axis=0) / np.maximum(self._counts, 1e-6)
        spread[~(spread > FLAT * squares)] = np.inf
        if gaps.any():
            spread[self._summed(self._weights * gaps) > 0] = np.inf
        products = self._summed(windows * self._kernels[:, np.newaxis]).sum(axis=0)
        return np.asarray(products / (self._norms * np.sqrt(spread)))


def _roughly(image: Image, pattern: Pattern, progress: Progress) -> list[tuple[int, int]]:
    """Return the likeliest places in the reduced image.

    By the score of what is left when every part varies alike: then what covers one part cannot drown the others.
    """
    down, right = (side // 2 for side in pattern.shape)
    least = STEADY * pattern.norm / math.sqrt(pattern.count)
    plane, gaps = image, None
    if image.dtype != np.uint8:
        plane = np.moveaxis(_surrounded(image, 0, 0, *image.shape[:2]), 0, 2)
        gaps = np.isnan(plane).any(axis=2)
        plane[gaps] = 0
    known = np.asarray(~gaps, dtype=np.float32) if gaps is not None and gaps.any() else None
    evened = _evened(plane, known, least)
    around = cv2.copyMakeBorder(evened, down, down, right, right, cv2.BORDER_CONSTANT, value=(MIDDLE,) * 4)
    try:
        small = pattern_of(_evened(pattern.colours, pattern.weights.astype(np.float32), least), pattern.weights)
    except ValueError:
        return []
    scores = fft_score_map(np.atleast_3d(around), small, lambda done: progress(0.4 * done))
    found = peaks(scores, pattern.shape)
    return [(int(found.rows[one]) - down, int(found.cols[one]) - right) for one in found.best(LIKELY, share=0.5)]


def _evened(image: Image, weights: Plane | None, least: float) -> Image:
    """Return each pixel's difference from the mean around it over the contrast there, :data:`MIDDLE` for none."""

    def blurred(plane: Plane) -> Plane:
        border = cv2.BORDER_REFLECT if weights is None else cv2.BORDER_CONSTANT
        spread = cv2.GaussianBlur(plane, (7, 7), EVENED, borderType=border)
        return np.asarray(spread, dtype=np.float32).reshape(plane.shape)

    def averaged(plane: Plane) -> Plane:
        return blurred(plane) if counts is None else np.asarray(blurred(plane * counts) / share)

    counts = None if weights is None else weights[:, :, np.newaxis]
    share = 1.0 if counts is None else np.maximum(blurred(counts), 1e-3)
    away = image.astype(np.float32)
    away -= averaged(away)
    squares = np.square(away) if away.shape[2] == 1 else np.square(away).sum(axis=2, keepdims=True)
    squares = averaged(squares)
    squares += least**2
    away *= np.divide(FULL, np.sqrt(squares, out=squares), out=squares)
    if counts is not None:
        away *= counts > 0
    return np.asarray(cv2.add(away, np.array([MIDDLE] * 4, dtype=np.float64), dtype=cv2.CV_8U)).reshape(image.shape)


class HiddenAmounts(NamedTuple):
    """What :func:`hidden_places` needs."""

    memory: float
    """Bytes."""
    values: float
    """Pixel values read or written, one after the other."""


def hidden_amounts(
    image_shape: Sequence[int], template_shape: Sequence[int], channels: int, itemsize: int
) -> HiddenAmounts:
    """Return what :func:`hidden_places` needs for an image of so many compared channels and bytes a value."""
    (height, width), pixels = template_shape[:2], math.prod(image_shape[:2])
    if min(height, width) < LEAST_SIDE:
        return HiddenAmounts(0, 0)
    factor, threads, score = max(1.0, math.sqrt(height * width) / SIDE), max(1, cv2.getNumThreads()), 4
    rows, cols = ((length + side) / factor for length, side in zip(image_shape, template_shape[:2], strict=False))
    places = rows * cols
    reach = math.ceil(factor / 2) + 1
    around = (2 * reach + 1) ** 2
    # The luminance and the reduced image; what is left of it and its squares; in every thread a window, its products.
    maps = (pixels * (channels > 1) + places) * itemsize + 6 * score * places
    windows = threads * 5 * score * channels * (height + 2 * reach) * (width + 2 * reach)
    scored = LIKELY * around * channels * height * width
    return HiddenAmounts(max(maps, windows), 5 * scored + 100 * places + pixels)


def _surrounded(image: Image, top: int, left: int, bottom: int, right: int) -> Plane:
    """Return a part of an image (channels, rows, cols) around 0 in single precision, NaN outside the image."""
    part = np.full((image.shape[2], bottom - top, right - left), np.nan, dtype=np.float32)
    inside = image[max(top, 0) : max(bottom, 0), max(left, 0) : max(right, 0)]
    if inside.size:
        values = inside.reshape(-1, image.shape[2])
        if image.dtype.kind == "f":
            values = values[np.isfinite(values).all(axis=1)]
        middle = values.mean(axis=0) if len(values) else 0.0
        rows, cols = (max(-side, 0) for side in (top, left))
        part[:, rows : rows + inside.shape[0], cols : cols + inside.shape[1]] = np.moveaxis(inside - middle, 2, 0)
    return part


def _seen_score(image: Image, pattern: Pattern, blocks: _Blocks, place: _Place) -> float:
    """Return the score of a place over the blocks that agree."""
    agree = np.zeros(blocks.varying.shape)
    agree[blocks.varying] = place.agree
    weights = blocks.spread(agree) * pattern.weights
    (top, bottom), (left, right) = ((int(side.min()), int(side.max()) + 1) for side in np.nonzero(weights))
    seen = pattern_of(pattern.colours[top:bottom, left:right], weights[top:bottom, left:right])
    at = np.array([place.row + top]), np.array([place.col + left])
    return float(scores_at(image, seen.deviations, seen.weights, *at)[0])
