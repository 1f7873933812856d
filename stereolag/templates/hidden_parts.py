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

from stereolag.core.arrays import Array, Mask
from stereolag.core.inputs import Image
from stereolag.core.jobs import Progress
from stereolag.loops.bands import in_threads
from stereolag.loops.compilation import compiled
from stereolag.templates.patterns import Pattern, blurred, in_grey, pattern_of, reduced, warped
from stereolag.templates.places import NOWHERE, Places, peaks
from stereolag.templates.score_maps import Plane, fft_score_map, scores_at

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
        self._edges = np.array([np.linspace(0, side, ALONG + 1).round() for side in pattern.shape], dtype=np.int64)
        self._down, self._across = (
            np.repeat(np.eye(ALONG, dtype=np.float32), np.diff(edges), axis=1) for edges in self._edges
        )
        self._weights = pattern.weights.astype(np.float32)
        counts = np.maximum(self._summed(self._weights), 1e-6)
        planes = pattern.deviations.astype(np.float32)
        centred = planes - np.stack([self.spread(mean) for mean in self._summed(planes * self._weights) / counts])
        self._kernels = centred * self._weights
        energy, squares = (self._summed(self._weights * np.square(one)).sum(axis=0) for one in (centred, planes))
        self.varying = energy > FLAT * squares
        self._scales = np.stack([1 / counts, 1 / np.sqrt(np.where(self.varying, energy, np.inf))])

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
        gaps = np.asarray(np.isnan(planes).any(axis=0))
        planes[:, gaps] = 0
        scores = np.zeros((2 * reach + 1, 2 * reach + 1, ALONG, ALONG), dtype=np.float32)
        score_blocks(
            planes, gaps if gaps.any() else gaps[:0], (self._kernels, self._weights), self._edges, self._scales, scores
        )
        scores = scores.reshape(-1, ALONG, ALONG)[:, self.varying]
        best = np.sort(scores, axis=1)[:, -max(1, round(AGREEING * scores.shape[1])) :].clip(0).mean(axis=1)
        one = int(best.argmax())
        down, across = divmod(one, 2 * reach + 1)
        return _Place(top + down, left + across, float(best[one]), scores[one] >= AGREES)


@compiled(fastmath={"contract", "reassoc"}, counted=False)
def score_blocks(
    planes: Array, gaps: Array, template: tuple[Array, Array], edges: Array, scales: Array, scores: Array
) -> None:
    """Set the score of every block in the windows around a place: 0 where it is flat, or has pixels without data.

    Parameters
    ----------
    planes
        (channels, rows, cols) around 0, 0 without data.
    gaps
        (rows, cols) bool, which pixels have no data; of no rows if all have.
    template
        The deviations from each block's mean times the weights, (channels, height, width), and the weights.
    edges
        (2, :data:`ALONG` + 1), the first row and column of each block, and the end of the last.
    scales
        (2, ALONG, ALONG), one over the weight of each block, and one over the norm of its deviations, 0 if it is flat.
    scores
        The result, (windows down, windows across, ALONG, ALONG).
    """
    (kernels, weights), (rows, cols), kind = template, edges, planes.dtype.type
    for top, left in np.ndindex(scores.shape[:2]):
        for down, across in np.ndindex(scores.shape[2:]):
            squares = between = products = 0.0
            hidden = False
            for channel in range(len(planes)):
                total = square = product = kind(0)
                for row in range(rows[down], rows[down + 1]):
                    line = planes[channel, top + row, left + cols[across] : left + cols[across + 1]]
                    weight = weights[row, cols[across] : cols[across + 1]]
                    kernel = kernels[channel, row, cols[across] : cols[across + 1]]
                    for col in range(line.size):
                        value = line[col]
                        total += weight[col] * value
                        square += weight[col] * value * value
                        product += kernel[col] * value
                squares += square
                between += total * total * scales[0, down, across]
                products += product
            if len(gaps):
                for row in range(rows[down], rows[down + 1]):
                    for col in range(cols[across], cols[across + 1]):
                        hidden |= gaps[top + row, left + col] and weights[row, col] > 0
            spread = squares - between
            if spread > FLAT * squares and not hidden:
                scores[top, left, down, across] = products * scales[1, down, across] / math.sqrt(spread)


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
    border = cv2.BORDER_REFLECT if weights is None else cv2.BORDER_CONSTANT
    softened = partial(blurred, spread=EVENED, border=border, size=(7, 7))

    def averaged(plane: Plane) -> Plane:
        return softened(plane) if counts is None else np.asarray(softened(plane * counts) / share)

    counts = None if weights is None else weights[:, :, np.newaxis]
    share = 1.0 if counts is None else np.maximum(softened(counts), 1e-3)
    away = image.astype(np.float32)
    away -= averaged(away)
    squares = np.square(away) if away.shape[2] == 1 else np.square(away).sum(axis=2, keepdims=True)
    squares = averaged(squares)
    squares += least**2
    away *= np.divide(FULL, np.sqrt(squares, out=squares), out=squares)
    if counts is not None:
        away *= counts > 0
    return np.asarray(cv2.add(away, np.array([MIDDLE] * 4, dtype=np.float64), dtype=cv2.CV_8U)).reshape(image.shape)


def hidden_amounts(
    image_shape: Sequence[int], template_shape: Sequence[int], channels: int, itemsize: int
) -> dict[str, float]:
    """Return what :func:`hidden_places` needs for an image of so many compared channels and bytes a value.

    Bytes, and pixel values read or written, one after the other, under their names in the cost table.
    """
    (height, width), pixels = template_shape[:2], math.prod(image_shape[:2])
    if min(height, width) < LEAST_SIDE:
        return {"hidden": 0, "hidden_values": 0}
    factor, score = max(1.0, math.sqrt(height * width) / SIDE), 4
    rows, cols = ((length + side) / factor for length, side in zip(image_shape, template_shape[:2], strict=False))
    places = rows * cols
    reach = math.ceil(factor / 2) + 1
    around = (2 * reach + 1) ** 2
    # The luminance and the reduced image; what is left of it and its squares.
    memory = (pixels * (channels > 1) + places) * itemsize + 6 * score * places
    scored = LIKELY * around * channels * height * width
    return {"hidden": memory, "hidden_values": scored + 100 * places + pixels}


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
