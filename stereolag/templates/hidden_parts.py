"""Places where a part of the template is covered or outside the image, found by the blocks that still agree.

An occluder leaves the other blocks unchanged, whereas it can spoil the score over all pixels. A place that is partly
outside the image has fewer blocks.
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
from stereolag.templates.patterns import Pattern, blurred, in_grey, pattern_of, reduced, warped, without_rim
from stereolag.templates.places import NOWHERE, Places, peaks
from stereolag.templates.score_maps import Plane, fft_score_map, scores_at

BLOCKS_PER_SIDE = 4

REDUCED_SIDE_PX = 36
"""Side of the template, the root of its area, in the reduced image that is searched first."""

MIN_SIDE_PX = 20
"""Least side of a template: smaller blocks contain too little."""

EQUALISED_ZERO = (128,) * 4
"""8-bit values of the channels of a pixel that is equal to the mean around it."""

MAX_CANDIDATES = 12
"""Places compared block by block, in the reduced image and then in the full one."""

MIN_BLOCK_SCORE = 0.6
"""Least score of a block that agrees."""

MIN_AGREEING = 0.3
"""Least share of the blocks that agree, in the full image.

Measured at 243 places with 10 to 50 % hidden that were then found: from 0.31.
"""

MIN_SCORE = 0.7
"""Least score of a place in the full image. Measured at the same places: from 0.75."""

MIN_REDUCED_SCORE = 0.5
"""Least score of a place in the reduced image. Measured at places that are the template: from 0.8."""

MAX_BELOW_BEST = 0.3
"""Largest difference of a place's score from the best in the reduced image."""

FLAT_ENERGY = 20 * float(np.finfo(np.float32).eps)
"""Energy up to which a block is flat, as a share of its sum of squares."""


def hidden_places(image: Image, pattern: Pattern, progress: Progress) -> Places:
    """Return the likeliest places of a template that is partly covered, or up to half outside the image.

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
        Rows and columns are negative above and left of the image. The scores are over the blocks that agree.
    """
    if min(pattern.shape) < MIN_SIDE_PX or pattern.silhouette:
        return NOWHERE
    factor = max(1.0, math.sqrt(pattern.shape[0] * pattern.shape[1]) / REDUCED_SIDE_PX)
    grey_image, grey = in_grey(image, pattern)
    if factor >= 2:  # in two steps, the first an exact half, which takes far less time
        even = grey_image[: grey_image.shape[0] // 2 * 2, : grey_image.shape[1] // 2 * 2]
        reduced_image = reduced(reduced(even, 2), factor / 2)
    else:
        reduced_image = reduced(grey_image, factor)
    small = warped(grey, 1 / factor, 0.0)
    if small is not None and (grey.weights == 1).all():  # only the rim has lower weights
        small = without_rim(small, int((small.weights == 0).any()))  # with all weights 1, running sums suffice
    if small is None or min(small.shape) < BLOCKS_PER_SIDE:
        return NOWHERE
    coarse, fine = _Blocks(small), _Blocks(pattern)
    if not (coarse.varying.any() and fine.varying.any()):
        return NOWHERE
    down, across = image.shape[0] / reduced_image.shape[0], image.shape[1] / reduced_image.shape[1]
    candidates = [
        coarse.best_near(reduced_image, row, col, 1) for row, col in _candidates(reduced_image, small, progress)
    ]
    progress(0.6)
    least = max([MIN_REDUCED_SCORE, *(place.score - MAX_BELOW_BEST for place in candidates)])
    refined = in_threads(
        [
            partial(
                fine.best_near,
                image,
                round((place.row + small.shape[0] / 2) * down - pattern.shape[0] / 2),
                round((place.col + small.shape[1] / 2) * across - pattern.shape[1] / 2),
                math.ceil(factor / 2) + 1,
            )
            for place in candidates
            if place.score >= least
        ],
        lambda done: progress(0.6 + 0.4 * done),
    )
    found = [place for place in refined if place.agrees.mean() >= MIN_AGREEING and place.score >= MIN_SCORE]
    rows, cols = (np.array([place[side] for place in found], dtype=np.intp) for side in range(2))
    scores = np.array([_visible_score(image, pattern, fine, place) for place in found])
    return Places(rows, cols, scores, pattern.shape)


class _Place(NamedTuple):
    """A place, the mean score of its best blocks, and which of the blocks that vary agree."""

    row: int
    col: int
    score: float
    agrees: Mask


class _Blocks:
    """The blocks of a template.

    Parameters
    ----------
    pattern
        The template.

    Attributes
    ----------
    varying
        (blocks down, blocks across), the blocks that are not flat.
    """

    def __init__(self, pattern: Pattern) -> None:
        self._edges = np.array(
            [np.linspace(0, side, BLOCKS_PER_SIDE + 1).round() for side in pattern.shape], dtype=np.int64
        )
        self._down, self._across = (
            np.repeat(np.eye(BLOCKS_PER_SIDE, dtype=np.float32), np.diff(ends), axis=1) for ends in self._edges
        )
        self._weights = pattern.weights.astype(np.float32)
        counts = np.maximum(self._summed(self._weights), 1e-6)
        planes = pattern.deviations.astype(np.float32)
        centred = planes - np.stack([self.spread(mean) for mean in self._summed(planes * self._weights) / counts])
        self._kernels = centred * self._weights
        energy, squares = (self._summed(self._weights * np.square(part)).sum(axis=0) for part in (centred, planes))
        self.varying = energy > FLAT_ENERGY * squares
        self._scales = np.stack([1 / counts, 1 / np.sqrt(np.where(self.varying, energy, np.inf))])

    def _summed(self, planes: Plane) -> Plane:
        """Return the sum over each block of planes (..., rows, cols)."""
        return np.asarray(self._down @ planes @ self._across.T)

    def spread(self, blocks: npt.NDArray[np.floating[Any]]) -> npt.NDArray[np.floating[Any]]:
        """Return a plane of the template's size with the value of its block at every pixel."""
        return np.asarray(blocks.repeat(np.diff(self._edges[0]), axis=0).repeat(np.diff(self._edges[1]), axis=1))

    def best_near(self, image: Image, row: int, col: int, reach: int) -> _Place:
        """Return the best place within `reach` px of (row, col)."""
        (height, width), (top, left) = self._weights.shape, (row - reach, col - reach)
        planes = _surrounded(image, top, left, row + height + reach, col + width + reach)
        gaps = np.asarray(np.isnan(planes).any(axis=0))
        planes[:, gaps] = 0
        windows = 2 * reach + 1
        scores = np.zeros((windows, windows, BLOCKS_PER_SIDE, BLOCKS_PER_SIDE), dtype=np.float32)
        score_blocks(
            planes, gaps if gaps.any() else gaps[:0], (self._kernels, self._weights), self._edges, self._scales, scores
        )
        scores = scores.reshape(windows**2, BLOCKS_PER_SIDE, BLOCKS_PER_SIDE)[:, self.varying]
        best_blocks = np.sort(scores, axis=1)[:, -max(1, round(scores.shape[1] / 2)) :]  # the better half
        means = best_blocks.clip(0).mean(axis=1)
        best = int(means.argmax())
        down, across = divmod(best, windows)
        return _Place(top + down, left + across, float(means[best]), scores[best] >= MIN_BLOCK_SCORE)


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
        (2, :data:`BLOCKS_PER_SIDE` + 1), the first row and column of each block, and the end of the last.
    scales
        (2, BLOCKS_PER_SIDE, BLOCKS_PER_SIDE), the inverse of each block's weight, and of the norm of its deviations, 0
        if it is flat.
    scores
        The result, (windows down, windows across, BLOCKS_PER_SIDE, BLOCKS_PER_SIDE).
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
            if spread > FLAT_ENERGY * squares and not hidden:
                scores[top, left, down, across] = products * scales[1, down, across] / math.sqrt(spread)


def _candidates(image: Image, pattern: Pattern, progress: Progress) -> list[tuple[int, int]]:
    """Return the likeliest places in the reduced image, by the score after local contrast was equalised.

    Then an occluder of high contrast cannot outweigh the other parts.
    """
    down, right = (side // 2 for side in pattern.shape)
    least_contrast = 0.02 * pattern.norm / math.sqrt(pattern.count)
    plane, gaps = image, None
    if image.dtype != np.uint8:
        plane = np.moveaxis(_surrounded(image, 0, 0, *image.shape[:2]), 0, 2)
        gaps = np.isnan(plane).any(axis=2)
        plane[gaps] = 0
    known = np.asarray(~gaps, dtype=np.float32) if gaps is not None and gaps.any() else None
    equalised = _equalised(plane, known, least_contrast)
    padded = cv2.copyMakeBorder(equalised, down, down, right, right, cv2.BORDER_CONSTANT, value=EQUALISED_ZERO)
    try:
        weights = pattern.weights.astype(np.float32)
        small = pattern_of(_equalised(pattern.colours, weights, least_contrast), pattern.weights)
    except ValueError:
        return []
    scores = fft_score_map(np.atleast_3d(padded), small, lambda done: progress(0.4 * done))
    # Outside the image, nothing correlates: a template half of which is there scores the root of a half at most.
    corners = np.ogrid[-down : scores.shape[0] - down, -right : scores.shape[1] - right]
    shares = (
        (np.minimum(at + side, length) - np.maximum(at, 0)) / side
        for at, side, length in zip(corners, small.shape, image.shape, strict=False)
    )
    scores /= np.sqrt(np.maximum(math.prod(shares), 0.5))
    found = peaks(scores, pattern.shape)
    return [found.moved(-down, -right).corner(place) for place in found.best(MAX_CANDIDATES, share=0.5)]


def _equalised(image: Image, weights: Plane | None, least_contrast: float) -> Image:
    """Return each pixel's difference from the mean around it over the contrast there, in 8 bits: 40 per unit."""
    border = cv2.BORDER_REFLECT if weights is None else cv2.BORDER_CONSTANT
    soft = partial(blurred, sigma=1.5, border=border, size=(7, 7))

    def local_mean(plane: Plane) -> Plane:
        return soft(plane) if factors is None else np.asarray(soft(plane * factors) / share)

    factors = None if weights is None else weights[:, :, np.newaxis]
    share = 1.0 if factors is None else np.maximum(soft(factors), 1e-3)
    deviations = image.astype(np.float32)
    deviations -= local_mean(deviations)
    squares = np.square(deviations) if image.shape[2] == 1 else np.square(deviations).sum(axis=2, keepdims=True)
    squares = local_mean(squares)
    squares += least_contrast**2
    deviations *= np.divide(40, np.sqrt(squares, out=squares), out=squares)
    if factors is not None:
        deviations *= factors > 0
    zero = np.array(EQUALISED_ZERO, dtype=np.float64)
    return np.asarray(cv2.add(deviations, zero, dtype=cv2.CV_8U)).reshape(image.shape)


def hidden_amounts(
    image_shape: Sequence[int], template_shape: Sequence[int], channels: int, itemsize: int
) -> dict[str, float]:
    """Return the memory (bytes) and the work (pixel values) of :func:`hidden_places`, by their names in the cost table.

    Parameters
    ----------
    image_shape, template_shape
        (rows, cols) or (rows, cols, channels).
    channels
        Number of channels compared.
    itemsize
        Bytes per value of the image.
    """
    (height, width), pixels = template_shape[:2], math.prod(image_shape[:2])
    if min(height, width) < MIN_SIDE_PX:
        return {"hidden": 0, "hidden_values": 0}
    factor, score = max(1.0, math.sqrt(height * width) / REDUCED_SIDE_PX), 4
    rows, cols = ((length + side) / factor for length, side in zip(image_shape, template_shape[:2], strict=False))
    places = rows * cols
    reach = math.ceil(factor / 2) + 1
    windows = (2 * reach + 1) ** 2
    # The luminance and the reduced image; its deviations and their squares.
    memory = (pixels * (channels > 1) + places) * itemsize + 6 * score * places
    scored = MAX_CANDIDATES * windows * channels * height * width
    return {"hidden": memory, "hidden_values": scored + 100 * places + pixels}


def _surrounded(image: Image, top: int, left: int, bottom: int, right: int) -> Plane:
    """Return a part of an image minus its mean, (channels, rows, cols) float32, NaN outside the image."""
    part = np.full((image.shape[2], bottom - top, right - left), np.nan, dtype=np.float32)
    inside = image[max(top, 0) : max(bottom, 0), max(left, 0) : max(right, 0)]
    if inside.size:
        values = inside.reshape(-1, image.shape[2])
        if image.dtype.kind == "f":
            values = values[np.isfinite(values).all(axis=1)]
        mean = values.mean(axis=0) if len(values) else 0.0
        rows, cols = (max(-side, 0) for side in (top, left))
        part[:, rows : rows + inside.shape[0], cols : cols + inside.shape[1]] = np.moveaxis(inside - mean, 2, 0)
    return part


def _visible_score(image: Image, pattern: Pattern, blocks: _Blocks, place: _Place) -> float:
    """Return the score of a place over the blocks that agree."""
    agrees = np.zeros(blocks.varying.shape)
    agrees[blocks.varying] = place.agrees
    weights = blocks.spread(agrees) * pattern.weights
    (top, bottom), (left, right) = ((int(side.min()), int(side.max()) + 1) for side in np.nonzero(weights))
    visible = pattern_of(pattern.colours[top:bottom, left:right], weights[top:bottom, left:right])
    at = np.array([place.row + top]), np.array([place.col + left])
    return float(scores_at(image, visible.deviations, visible.weights, *at)[0])
