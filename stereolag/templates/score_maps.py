"""The correlation coefficient (ZNCC) of a template at every place of an image.

By FFT or plainly by sliding, over the pixels of the template T with their weights w and the window I under them,
channels c with their own weighted means:
``sum_c w (I_c - mean I_c)(T_c - mean T_c) / sqrt(sum_c w (I_c - mean I_c)**2 * sum_c w (T_c - mean T_c)**2)``.
Removing the template's mean already cancels the window's mean in the products; the window's energy follows from its
sums (Lewis, Fast Normalized Cross-Correlation, 1995), or under a mask from correlations with the weights
(Padfield, Masked Object Registration in the Fourier Domain, 2012).
"""

from __future__ import annotations

import math
import threading
from functools import partial
from typing import Any

import cv2
import numpy as np
import numpy.typing as npt

from stereolag.core.arrays import Array, Indices, Mask
from stereolag.core.inputs import FLAT_WHOLE, Image
from stereolag.core.jobs import Progress
from stereolag.loops.bands import in_threads
from stereolag.loops.compilation import compiled
from stereolag.templates.patterns import Pattern

Plane = npt.NDArray[np.floating[Any]]
ScoreMap = npt.NDArray[np.float32]

STRIP_PLACES = 28_000
"""Places of a map computed at a time, so that their values stay in the cache."""


class Memory(threading.local):
    """Memory for the planes of a tile, kept and reused by each thread: new memory is slow at first."""

    def __init__(self) -> None:
        self._parts: dict[str, npt.NDArray[Any]] = {}

    def part(self, name: str, shape: tuple[int, ...], kind: npt.DTypeLike) -> npt.NDArray[Any]:
        """Return uninitialised memory of that shape, the same for every call with that name."""
        size = math.prod(shape)
        if name not in self._parts or self._parts[name].size < size or self._parts[name].dtype != kind:
            self._parts[name] = np.empty(size, dtype=kind)
        return self._parts[name][:size].reshape(shape)


_AS_GOOD_AS_ONE = np.float32(1 - 2.0**-20)
"""Score that is rounded up to 1: sums in single precision have rounding errors, different ones at each of several
copies."""


def pearson(products: Plane, energy: Plane, tolerance: float, out: ScoreMap | None = None) -> ScoreMap:
    """Return the score of each window, -1..1, NaN where the window is flat.

    Parameters
    ----------
    products
        (rows, cols), the sum of products of the deviations of the window and of a template whose norm is 1.
    energy
        (rows, cols), the sum of squared deviations of the window.
    tolerance
        A window with no more energy than this is flat.
    out
        Memory for the scores.
    """
    scores = np.empty(products.shape, dtype=np.float32) if out is None else out
    step = max(1, STRIP_PLACES // scores.shape[1])
    for rows in (slice(first, first + step) for first in range(0, len(scores), step)):
        strip, factors = scores[rows], energy[rows].astype(products.dtype)
        has_flat = factors.min() <= tolerance
        if has_flat:
            factors[factors <= tolerance] = np.nan
        np.multiply(products[rows], cv2.pow(factors, -0.5, dst=factors), out=strip, casting="same_kind")
        if has_flat or strip.max() > _AS_GOOD_AS_ONE or strip.min() < -1:
            np.clip(strip, -1.0, 1.0, out=strip)
            strip[strip > _AS_GOOD_AS_ONE] = 1.0
    return scores


@compiled(fastmath={"contract"}, counted=False)
def score_windows(
    planes: Array,
    products: Array,
    size: tuple[int, int],
    tolerance: float,
    memory: tuple[Array, Array],
    scores: Array,
    corner: tuple[int, int],
) -> None:
    """Set the score of each window as :func:`pearson` does; its energy is from running sums down and across.

    Parameters
    ----------
    planes
        (channels, rows, cols), numbers around 0; the sums of whole numbers are exact below 2**53.
    products
        (rows, cols), the sums of products.
    size
        Height and width of the window, px.
    tolerance
        A window with no more energy than this is flat.
    memory
        float64 for the sums of every column and for a row of windows: (channels, 2, cols of the planes) and (3, cols).
    scores
        The result, a float32 map of which this is a part.
    corner
        Row and column of the first window in that map.
    """
    (height, width), (columns, row_sums), (rows, cols) = size, memory, products.shape
    kind = products.dtype.type
    sums, squares, energy = row_sums[0], row_sums[1], row_sums[2]
    for channel in range(len(planes)):
        for at in range(columns.shape[2]):
            columns[channel, 0, at] = columns[channel, 1, at] = 0.0
        for row in range(height - 1):
            _add_row(planes[channel, row], columns[channel, 0], columns[channel, 1], 1.0)
    for row in range(rows):
        for at in range(cols):
            energy[at] = 0.0
        for channel in range(len(planes)):
            column_sums, column_squares = columns[channel, 0], columns[channel, 1]
            _add_row(planes[channel, row + height - 1], column_sums, column_squares, 1.0)
            total = square_total = 0.0
            for at in range(width):
                total += column_sums[at]
                square_total += column_squares[at]
            entering, entering_squares = column_sums[width:], column_squares[width:]
            for at in range(cols - 1):
                sums[at], squares[at] = total, square_total
                total += entering[at] - column_sums[at]
                square_total += entering_squares[at] - column_squares[at]
            sums[cols - 1], squares[cols - 1] = total, square_total
            for at in range(cols):
                energy[at] += squares[at] - sums[at] * sums[at] * (1 / (height * width))
            _add_row(planes[channel, row], column_sums, column_squares, -1.0)
        line, scored = products[row], scores[corner[0] + row][corner[1] :]
        for at in range(cols):
            spread = kind(energy[at])
            score = np.float32(line[at] / np.sqrt(spread))
            score = max(min(score, np.float32(1)), np.float32(-1))
            score = np.float32(1) if score > _AS_GOOD_AS_ONE else score
            scored[at] = score if spread > tolerance else np.float32(np.nan)


@compiled(fastmath={"contract"}, counted=False)
def _add_row(line: Array, sums: Array, squares: Array, sign: float) -> None:
    """Add numbers and their squares to the sums of their columns, or subtract them."""
    for at in range(line.size):
        value = float(line[at])
        sums[at] += sign * value
        squares[at] += sign * value * value


VALUES_AT_ONCE = 1_000_000
"""Pixel values gathered at a time."""


def scores_at(
    image: npt.NDArray[Any], deviations: Plane, weights: Plane, rows: Indices, cols: Indices
) -> npt.NDArray[np.float64]:
    """Return the score of each position, -1..1, NaN where the window is flat or a pixel with a weight has no data.

    Parameters
    ----------
    image
        (rows, cols, channels).
    deviations
        (channels, height, width), the template with its weighted mean removed.
    weights
        (height, width), the weight of each pixel.
    rows, cols
        Top-left pixels of the positions.
    """
    windows = np.lib.stride_tricks.sliding_window_view(image[:, :, : len(deviations)], weights.shape, axis=(0, 1))
    valid = weights > 0
    valid_weights, template = weights[valid], deviations[:, valid]
    scores = np.full(len(rows), np.nan)
    step = VALUES_AT_ONCE // template.size + 1
    for batch in (slice(start, start + step) for start in range(0, len(rows), step)):
        pixels = windows[rows[batch], cols[batch]][:, :, valid].astype(np.float64)
        # Relative to its first pixel, a flat window is exactly 0, and a large offset costs no precision.
        pixels -= pixels[:, :, :1].copy()
        # Not "@": the linear algebra library starts threads for it, which then wait busily for more.
        pixels -= np.einsum("ncp,p->nc", pixels, valid_weights / valid_weights.sum())[:, :, np.newaxis]
        weighted = pixels * valid_weights
        norms = np.sqrt(np.einsum("ncp,ncp->n", weighted, pixels) * (valid_weights * template**2).sum())
        np.divide(np.einsum("ncp,cp->n", weighted, template), norms, out=scores[batch], where=norms > 0)
    return np.asarray(np.clip(scores, -1.0, 1.0))


def best_position(image: Image, pattern: Pattern, rows: Indices, cols: Indices) -> tuple[int, int, float] | None:
    """Return the best of these positions and its score; None if there are none or all are flat."""
    scores = scores_at(np.ascontiguousarray(image), pattern.deviations, pattern.weights, rows, cols)
    if np.isnan(scores).all():
        return None
    best = int(np.nanargmax(scores))
    return int(rows[best]), int(cols[best]), float(scores[best])


MAX_TILE_PX = 1296
"""Largest side of a tile, unless the template is large: tiles fit into the cache and overlap little."""

FFT_UNIT = 48
"""OpenCV's transforms are fastest at 48 · 2**i · 3**j · 5**k points; 512 points take twice as long."""


def direct_score_map(image: Image, pattern: Pattern, progress: Progress) -> ScoreMap:
    """Return the score of every position by sliding the template along the rows: the slow, plain reference.

    Parameters
    ----------
    image
        (rows, cols, channels), of which those of the pattern come first.
    pattern
        The template.
    progress
        Called with the fraction done after every line of the template.

    Returns
    -------
    ndarray
        (rows - height + 1, cols - width + 1) float32, -1..1, NaN where the window is flat.
    """
    image = image[:, :, : len(pattern.deviations)]
    planes = _centred(image, np.empty((image.shape[2], *image.shape[:2])))
    squares = np.square(planes).sum(axis=0)
    height, width = pattern.shape
    kernels = pattern.weights * pattern.deviations / pattern.norm
    channels, rows, cols = len(planes), image.shape[0] - height + 1, image.shape[1] - width + 1
    products, square_sums, sums = np.zeros((rows, cols)), np.zeros((rows, cols)), np.zeros((channels, rows, cols))
    for row in range(rows):
        for line in range(height):
            square_sums[row] += np.correlate(squares[row + line], pattern.weights[line], "valid")
            for channel in range(channels):
                pixels = planes[channel, row + line]
                sums[channel, row] += np.correlate(pixels, pattern.weights[line], "valid")
                products[row] += np.correlate(pixels, kernels[channel, line], "valid")
            progress((row + (line + 1) / height) / rows)
    energy = square_sums - np.square(sums).sum(axis=0) / pattern.count
    return without_gaps(pearson(products, energy, _flatness(image, planes, pattern)), image, pattern)


def without_gaps(scores: ScoreMap, image: Image, pattern: Pattern) -> ScoreMap:
    """Set a score map to NaN, in place, where the window contains a pixel without data; return it."""
    gaps = with_gaps(image, pattern.shape)
    if gaps is not None:
        scores[gaps] = np.nan
    return scores


def with_gaps(image: Image, shape: tuple[int, int]) -> Mask | None:
    """Return the places of a template of that shape that contain a pixel without data (NaN); None if there is none."""
    if image.dtype.kind != "f" or not np.isnan(image).any():
        return None
    gaps = np.asarray(np.isnan(image).any(axis=2), dtype=np.uint8)
    hidden = cv2.dilate(gaps, np.ones(shape, np.uint8), anchor=(0, 0), borderType=cv2.BORDER_CONSTANT)
    return np.asarray(hidden[: image.shape[0] - shape[0] + 1, : image.shape[1] - shape[1] + 1] > 0)


def fft_score_map(image: Image, pattern: Pattern, progress: Progress) -> ScoreMap:
    """Return the score of every position by FFT, tile by tile (overlap-save), as :func:`direct_score_map` does.

    8-bit images are correlated in single precision, which takes a third of the time; :func:`best_position` gives a
    place its exact score. Without a mask, their sums over windows are exact. Others are in double precision. The tiles
    run on all cores; `progress` is called in the caller's own thread.
    """
    image = image[:, :, : len(pattern.deviations)]
    height, width = pattern.shape
    places = image.shape[0] - height + 1, image.shape[1] - width + 1
    (down, across), transformed = tiling(places, pattern.shape)
    engine = (_Single if image.dtype == np.uint8 else _Double)(transformed)
    kernels = [engine.template(plane) for plane in pattern.weights * pattern.deviations / pattern.norm]
    # With equal weights, running sums are faster.
    weights = None if (pattern.weights == 1).all() else engine.template(pattern.weights)
    scores = np.empty(places, dtype=np.float32)
    tiles = [
        partial(
            _score_tile,
            scores,
            (row, col),
            image[row : row + down + height - 1, col : col + across + width - 1],
            pattern,
            kernels,
            weights,
            engine,
        )
        for row in range(0, places[0], down)
        for col in range(0, places[1], across)
    ]
    in_threads(tiles, progress)
    return without_gaps(scores, image, pattern)


def _score_tile(
    scores: ScoreMap,
    corner: tuple[int, int],
    block: Image,
    pattern: Pattern,
    kernels: list[Plane],
    weights: Plane | None,
    engine: _Single,
) -> None:
    """Set the scores of one tile, whose first position is that corner.

    `block` is the part of the image that its windows cover; `kernels` and `weights` are the template's as the engine
    takes them, the latter None if all are equal.
    """
    shape = block.shape[:2]
    places = shape[0] - pattern.shape[0] + 1, shape[1] - pattern.shape[1] + 1
    planes = _centred(block, engine.memory.part("planes", (len(kernels), *shape), engine.kind))
    tolerance = _flatness(block, planes, pattern)
    operands = engine.operands("spectra", planes)
    products = engine.correlated(operands, kernels, places, "products")
    if weights is None:
        columns, row = (len(planes), 2, shape[1]), (3, places[1])
        memory = engine.memory.part("columns", columns, np.float64), engine.memory.part("row", row, np.float64)
        score_windows(planes, products, pattern.shape, tolerance, memory, scores, corner)
        return
    # Sums of integers are integers: rounded to the nearest, they are exact.
    exact = _exact(planes, block, pattern)
    squares = engine.memory.part("squares", (1, *shape), engine.kind)
    np.einsum("crx,crx->rx", planes, planes, out=squares[0])
    energy = engine.correlated(engine.operands("square spectra", squares), [weights], places, "energy", exact)
    for operand in operands:
        sums = engine.correlated([operand], [weights], places, "sums", exact)
        energy -= np.multiply(np.square(sums, out=sums), 1 / sums.dtype.type(pattern.count), out=sums)
    tile = scores[corner[0] : corner[0] + places[0], corner[1] : corner[1] + places[1]]
    pearson(products, energy, tolerance, tile)


class _Single:
    """Correlations in single precision by OpenCV's template matching, which includes a fast transform.

    Parameters
    ----------
    shape
        Rows and columns of the transforms of a tile, for :class:`_Double`.
    """

    kind: np.dtype[Any] = np.dtype(np.float32)

    def __init__(self, shape: tuple[int, int]) -> None:
        self.shape = shape
        self.memory = Memory()

    def template(self, plane: Plane) -> Plane:
        """Return a plane of a template as :meth:`correlated` takes it."""
        return plane.astype(self.kind)

    def operands(self, name: str, planes: Plane) -> list[Plane]:
        """Return planes as :meth:`correlated` takes them, in the memory of that name if they must be transformed."""
        return list(planes)

    def correlated(
        self, images: list[Plane], templates: list[Plane], places: tuple[int, ...], name: str, exact: bool = False
    ) -> Plane:
        """Return the sum of the correlations of each image with its template at (rows, cols) places.

        In the memory of that name; `exact`: whether the sums are whole numbers, so that they can be rounded.
        """
        total = self.memory.part(name, places, self.kind)
        for number, (image, template) in enumerate(zip(images, templates, strict=True)):
            part = self.memory.part("part", places, self.kind) if number else total
            cv2.matchTemplate(image, template, cv2.TM_CCORR, result=part)
            if number:
                total += part
        return np.rint(total, out=total) if exact else total


class _Double(_Single):
    """The same in double precision, by OpenCV's transform."""

    kind = np.dtype(np.float64)

    def template(self, plane: Plane) -> Plane:
        padded = np.zeros(self.shape, dtype=self.kind)
        padded[: plane.shape[0], : plane.shape[1]] = plane
        return np.asarray(cv2.dft(padded, dst=padded, nonzeroRows=plane.shape[0]))

    def operands(self, name: str, planes: Plane) -> list[Plane]:
        spectra = self.memory.part(name, (len(planes), *self.shape), self.kind)
        spectra[:, planes.shape[1] :] = 0
        spectra[:, : planes.shape[1], planes.shape[2] :] = 0
        spectra[:, : planes.shape[1], : planes.shape[2]] = planes
        return [np.asarray(cv2.dft(spectrum, dst=spectrum, nonzeroRows=planes.shape[1])) for spectrum in spectra]

    def correlated(
        self, images: list[Plane], templates: list[Plane], places: tuple[int, ...], name: str, exact: bool = False
    ) -> Plane:
        total = self.memory.part(name, self.shape, self.kind)
        for number, (image, template) in enumerate(zip(images, templates, strict=True)):
            part = self.memory.part("part", self.shape, self.kind) if number else total
            cv2.mulSpectrums(image, template, 0, c=part, conjB=True)
            if number:
                total += part
        inverse = cv2.DFT_INVERSE | cv2.DFT_SCALE | cv2.DFT_REAL_OUTPUT
        cv2.dft(total, dst=total, flags=inverse, nonzeroRows=places[0])
        sums = total[: places[0], : places[1]]
        return np.rint(sums, out=sums) if exact else sums


def _centred(image: Image, out: Plane) -> Plane:
    """Return the image minus its mean as (channels, rows, cols), in `out`, 0 without data; integers stay integers."""
    if image.dtype.kind == "u":
        for channel, mean in enumerate(np.rint(cv2.mean(image))[: image.shape[2]]):
            np.subtract(image[:, :, channel], out.dtype.type(mean), out=out[channel])
        return out
    out[:] = np.moveaxis(image, 2, 0)
    gaps = np.isnan(out)
    out[gaps] = 0
    out -= out.sum(axis=(1, 2), keepdims=True) / np.maximum((~gaps).sum(axis=(1, 2), keepdims=True), 1)
    out[gaps] = 0
    return out


def _exact(planes: Plane, image: Image, pattern: Pattern) -> bool:
    """Return whether weighted sums over windows are sums of whole numbers, without rounding."""
    sums_exact = planes.dtype == np.float64 or bool((pattern.weights == 1).all())
    return image.dtype.kind == "u" and pattern.has_binary_weights and sums_exact


ROUNDING_UNITS = 20
"""Rounding error of a sum over a window, in units of the last place of the transforms of image and weights."""


def _flatness(image: Image, planes: Plane, pattern: Pattern) -> float:
    """Return the weighted sum of squared deviations up to which a window counts as flat.

    A transform spreads the rounding of its largest values over all places, but in proportion to the root of their
    summed squares: a single hot pixel does not make its surroundings flat.
    """
    if _exact(planes, image, pattern):
        return FLAT_WHOLE
    largest, norms = max(cv2.norm(plane, cv2.NORM_INF) for plane in planes), [cv2.norm(plane) for plane in planes]
    magnitude = largest * math.hypot(*norms) * cv2.norm(pattern.weights)
    return ROUNDING_UNITS * float(np.finfo(planes.dtype).eps) * magnitude


MAX_SINGLE_TILE_PLACES = 2**17
"""Largest number of places of a map that is computed as one tile, by one thread."""


def tiling(places: tuple[int, int], shape: tuple[int, ...]) -> tuple[tuple[int, int], tuple[int, int]]:
    """Return the number of positions of a tile down and across, and the shape of its FFT, for the least total work."""
    (down, rows), (across, cols) = (_along(*axis) for axis in zip(places, shape, strict=False))
    if (down, across) == places and math.prod(places) > MAX_SINGLE_TILE_PLACES:
        down = -(-down // 2)
        rows = _fft_length(down + shape[0] - 1)
    return (down, across), (rows, cols)


def _along(places: int, size: int) -> tuple[int, int]:
    """Return, along one axis, the number of positions of a tile and the length of its FFT."""
    longest = max(MAX_TILE_PX, 2 * _fft_length(size))
    fewest = -(-places // (longest - size + 1))
    choices = [(-(-places // tiles), tiles) for tiles in range(fewest, 2 * fewest + 1)]
    step, _ = min(choices, key=lambda choice: choice[1] * _fft_length(choice[0] + size - 1))
    return step, _fft_length(step + size - 1)


def _fft_length(least: int) -> int:
    return FFT_UNIT * int(cv2.getOptimalDFTSize(-(-least // FFT_UNIT)))
