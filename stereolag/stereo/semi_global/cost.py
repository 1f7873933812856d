"""Matching cost of every pixel at every lag: the settings, the terms, each listed in ``TERMS``, and their sum.

A compiled loop adds a term's cost for a run of neighbouring pixels at every lag. Inner loops over the lags are separate
functions: in the body of the loop over the pixels they take four times as long.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Annotated, Any, NamedTuple

import cv2
import numpy as np
import numpy.typing as npt
from pydantic import Field, model_validator

from stereolag.core.arrays import Array
from stereolag.core.settings import Applies, Settings, marker
from stereolag.loops.bands import over_bands
from stereolag.loops.compilation import compiled, compiled_as, literal_unroll
from stereolag.loops.vector_lanes import popcount

MOST = 250
"""Largest sum of the weights: a volume stores costs in 8 bits."""


@dataclass(frozen=True)
class TermWeight:
    """Marker for the weight of a term: its highest cost."""


class MatchingCost(Settings):
    """Cost of a mismatch: window correlation plus finer terms that keep edges sharp."""

    correlation: Annotated[int, TermWeight()] = Field(
        default=100,
        title="Correlation",
        description="Cost of windows that are each other's negative (ZNCC -1); +1 costs nothing.",
        ge=0,
        le=100,
    )
    census: Annotated[int, TermWeight()] = Field(
        default=100,
        title="Census",
        description="Cost where all of the 5 × 5 neighbours have changed from darker to brighter or back.",
        ge=0,
        le=100,
    )
    gradient: Annotated[int, TermWeight()] = Field(
        default=40,
        title="Gradient",
        description="Cost of a horizontal gradient that differs by the limit or more.",
        ge=0,
        le=50,
    )
    gradient_limit: Annotated[int, Applies(lambda settings: settings.gradient > 0, "needs gradient above 0")] = Field(
        default=8,
        title="Gradient limit",
        description="Difference of gradients, grey levels of 255, above which the cost no longer rises.",
        ge=1,
        le=64,
    )

    @model_validator(mode="after")
    def _highest_is_allowed(self) -> MatchingCost:
        if not 0 < self.highest <= MOST:
            *names, last = self.weights()
            raise ValueError(
                f"{', '.join(names)} and {last} add up to {self.highest}; allowed are 1 to {MOST} together."
            )
        return self

    @property
    def highest(self) -> int:
        """Return the cost of a lag at which nothing fits, at most :data:`MOST`."""
        return sum(getattr(self, name) for name in self.weights())

    @classmethod
    def weights(cls) -> list[str]:
        """Return the names of the weights, one per term."""
        return [name for name, field in cls.model_fields.items() if marker(field, TermWeight)]


EightBit = npt.NDArray[np.uint8]
Volume = npt.NDArray[np.float64]
Costs = npt.NDArray[np.uint8]


class Run(NamedTuple):
    """Pixels of one row that are processed together, so that their costs stay in the processor's cache."""

    y: int
    first: int
    end: int
    """Columns `first` to `end`; the runs of a row follow one another."""
    is_top: bool
    """Whether this is the first row of its band."""
    lags: int
    origin: int
    """Column of the right features, without a border, that column 0 of the left image meets at the first lag."""


class CostTerm(NamedTuple):
    """One term of the matching cost.

    Attributes
    ----------
    weight
        The field of :class:`stereolag.stereo.semi_global.cost.MatchingCost` with its highest cost.
    kind
        The type of its features, by which compiled code identifies the term.
    features
        Computes the features of one image: a named tuple of numbers and arrays, (H, W) or (H, W) with a border of the
        window's radius; called with the image, the radius and the settings.
    add
        Compiled; called with the features of both images, a run, an int32 buffer kept from one row of a band to the
        next, and the float32 costs of the run, (pixels × lags), to which it adds its own.
    reference
        The plain formula: (H, W, W) cost of each pixel of the left image with each pixel in the same row of the right
        image; called with both images, the radius and the settings.
    """

    weight: str
    kind: type[Any]
    features: Callable[[EightBit, int, MatchingCost], Any]
    add: Callable[..., None]
    reference: Callable[[EightBit, EightBit, int, MatchingCost], Volume]


NOISE = 2.0
"""Standard deviation taken for noise, grey levels of 255: a window that varies less correlates with nothing."""


class CorrelationFeatures(NamedTuple):
    """Features that the correlation term compares."""

    padded: npt.NDArray[np.int16]
    """Grey levels minus 128, with a border of the window's radius."""
    total: npt.NDArray[np.float32]
    """Sum of these levels over the window around every pixel."""
    mean: npt.NDArray[np.float32]
    inverse: npt.NDArray[np.float32]
    """Inverse square root of the window's energy about its mean."""
    half: np.float32
    """Cost of a correlation of 0."""


def correlation_features(image: EightBit, radius: int, settings: MatchingCost) -> CorrelationFeatures:
    """Return the padded image with the sums and norms of its windows."""
    side = 2 * radius + 1
    padded = cv2.copyMakeBorder(image, radius, radius, radius, radius, cv2.BORDER_REFLECT_101).astype(np.int16)
    padded -= 128
    inside = (slice(radius, radius + image.shape[0]), slice(radius, radius + image.shape[1]))
    total = np.asarray(cv2.boxFilter(padded, cv2.CV_32F, (side, side), normalize=False)[inside], np.float32)
    energy = np.asarray(cv2.sqrBoxFilter(padded, cv2.CV_32F, (side, side), normalize=False)[inside], np.float32)
    energy += np.float32(side**2 * NOISE**2) - total * total * np.float32(1 / side**2)
    return CorrelationFeatures(
        padded=padded,
        total=total,
        mean=total * np.float32(1 / side**2),
        inverse=np.reciprocal(np.sqrt(energy, out=energy), out=energy),
        half=np.float32(settings.correlation * 0.5),
    )


@compiled
def add_correlation(
    left: CorrelationFeatures, right: CorrelationFeatures, run: Run, carried: Array, costs: Array
) -> None:
    """Add half the weight times one minus the correlation of the windows.

    Products are summed down each column of the window once and then along the row, so that the time does not depend on
    the window size; both sums are carried from run to run. Arrays are flattened once per run: a view made for every
    pixel takes three times as long as the arithmetic.
    """
    width, stride = np.uint64(left.total.shape[1]), np.uint64(left.padded.shape[1])
    lags, side = np.uint64(run.lags), stride - width + np.uint64(1)
    zero, one = np.uint64(0), np.uint64(1)
    # Column 0 stays zero: it is the column that leaves the window until the window is full.
    columns, window = carried[lags:], carried[:lags]
    left_pixels, right_pixels = left.padded.reshape(-1), right.padded.reshape(-1)
    totals, inverses = right.total.reshape(-1), right.inverse.reshape(-1)
    right_stride, origin, y = np.uint64(right.padded.shape[1]), np.uint64(run.origin), np.uint64(run.y)
    reach = origin + side // np.uint64(2)
    first, end = np.uint64(run.first), np.uint64(run.end)
    if run.first == 0:
        if run.is_top:
            columns[:] = 0
            for row in range(y, y + side - one):
                for col in range(stride):
                    newest, pixel = row * right_stride + reach - col, left_pixels[row * stride + col]
                    _slide(columns, (col + one) * lags, zero, window, lags, right_pixels, newest, zero, pixel, 0)
        window[:] = 0
    incoming, outgoing = y + side - one, y if run.is_top else y - one
    for col in range(zero if run.first == 0 else first + side - one, end + side - one):
        here, leaving = (col + one) * lags, (col + one - side) * lags if col >= side else zero
        newest, oldest = incoming * right_stride + reach - col, outgoing * right_stride + reach - col
        gained, lost = left_pixels[incoming * stride + col], 0 if run.is_top else left_pixels[outgoing * stride + col]
        _slide(columns, here, leaving, window, lags, right_pixels, newest, oldest, gained, lost)
        if col + one >= side:
            x = col + one - side
            scale, source = np.float32(left.half * left.inverse[y, x]), y * right_stride + origin - x
            target = (x - first) * lags
            _add_scores(window, left.mean[y, x], scale, left.half, totals, inverses, source, lags, costs, target)


@compiled
def _slide(
    columns: Array,
    here: Any,
    leaving: Any,
    window: Array,
    lags: Any,
    pixels: Array,
    newest: Any,
    oldest: Any,
    gained: Any,
    lost: Any,
) -> None:
    """Move a column of products down one row, and add it to the window in place of the leaving column.

    `gained` and `lost` are the left image's pixels in the rows that the column gains and loses; `newest` and `oldest`
    are where the right image's pixels of those rows begin.
    """
    more, less = np.int32(gained), np.int32(lost)
    for lag in range(lags):
        products = more * np.int32(pixels[newest + lag]) - less * np.int32(pixels[oldest + lag])
        column = np.int32(columns[here + lag] + products)
        columns[here + lag] = column
        window[lag] += column - columns[leaving + lag]


@compiled
def _add_scores(
    window: Array,
    mean: Any,
    scale: Any,
    half: Any,
    totals: Array,
    inverses: Array,
    source: Any,
    lags: Any,
    costs: Array,
    target: Any,
) -> None:
    for lag in range(lags):
        covariance = np.float32(window[lag]) - mean * totals[source + lag]
        costs[target + lag] += half - covariance * scale * inverses[source + lag]


def correlation_reference(left: EightBit, right: EightBit, radius: int, settings: MatchingCost) -> Volume:
    """Return the cost of the correlation term from its formula."""
    side = 2 * radius + 1
    free, norm = [], []
    for image in (left, right):
        padded = np.pad(image.astype(float), radius, mode="reflect")
        windows = np.lib.stride_tricks.sliding_window_view(padded, (side, side))
        free.append(windows - windows.mean(axis=(2, 3), keepdims=True))
        norm.append(np.sqrt((free[-1] ** 2).sum(axis=(2, 3)) + (side * NOISE) ** 2))
    scores = np.einsum("yxij,yzij->yxz", *free) / (norm[0][:, :, None] * norm[1][:, None, :])
    return np.asarray(settings.correlation * (1 - scores) / 2)


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


SOBEL_UNIT = 4
"""The Sobel filter adds up four differences between grey levels two pixels apart."""


class GradientFeatures(NamedTuple):
    """Features that the gradient term compares."""

    gradient: npt.NDArray[np.float32]
    """Horizontal gradient, in units of cost."""
    cap: np.float32
    """Highest cost of a difference."""


def gradient_features(image: EightBit, radius: int, settings: MatchingCost) -> GradientFeatures:
    """Return the horizontal gradient of an image."""
    scale = settings.gradient / settings.gradient_limit / SOBEL_UNIT
    gradient = np.asarray(cv2.Sobel(image, cv2.CV_32F, 1, 0, scale=scale), np.float32)
    return GradientFeatures(gradient, np.float32(settings.gradient))


@compiled
def add_gradient(left: GradientFeatures, right: GradientFeatures, run: Run, carried: Array, costs: Array) -> None:
    """Add the difference of the gradients, up to the cap."""
    gradients, lags = right.gradient.reshape(-1), np.uint64(run.lags)
    start = np.uint64(run.y) * np.uint64(right.gradient.shape[1]) + np.uint64(run.origin)
    for x in range(run.first, run.end):
        target = np.uint64(x - run.first) * lags
        _add_apart(left.gradient[run.y, x], gradients, start - np.uint64(x), left.cap, lags, costs, target)


@compiled
def _add_apart(gradient: Any, gradients: Array, source: Any, cap: Any, lags: Any, costs: Array, target: Any) -> None:
    for lag in range(lags):
        costs[target + lag] += min(abs(gradient - gradients[source + lag]), cap)


def gradient_reference(left: EightBit, right: EightBit, radius: int, settings: MatchingCost) -> Volume:
    """Return the cost of the gradient term from its formula."""
    slopes = []
    for image in (left, right):
        padded = np.pad(image.astype(np.int64), 1, mode="reflect")
        smooth = padded[:-2] + 2 * padded[1:-1] + padded[2:]
        slopes.append((smooth[:, 2:] - smooth[:, :-2]) / SOBEL_UNIT)
    apart = np.abs(slopes[0][:, :, None] - slopes[1][:, None, :])
    return np.asarray(settings.gradient * np.minimum(apart / settings.gradient_limit, 1))


TERMS = (
    CostTerm("correlation", CorrelationFeatures, correlation_features, add_correlation, correlation_reference),
    CostTerm("census", CensusFeatures, census_features, add_census, census_cost_reference),
    CostTerm("gradient", GradientFeatures, gradient_features, add_gradient, gradient_reference),
)
"""Every term, in the order their costs are added."""


UNSEEN = 0.28
"""Cost of a lag that leads out of the frame, as a share of the highest cost: between a good match and a mismatch."""

RUN_CELLS = 4096
"""Pixels times lags of a run; their costs fill half of a core's L1 cache."""


def matching_cost(
    left: EightBit,
    right: EightBit,
    *,
    window_size: int,
    min_disparity: int,
    num_disparities: int,
    settings: MatchingCost,
) -> Costs:
    """Return the cost of every pixel of the left image at every disparity.

    The cost is the sum of ZNCC on windows, truncated gradient difference, and Hamming distance of census words:
    correlation handles flat and noisy regions, the other two sharpen the edges that a window blurs (Hirschmüller &
    Scharstein, "Evaluation of stereo matching costs on images with radiometric differences", 2009; Mei et al., "On
    building an accurate stereo matching system on graphics hardware", 2011). A lag that leads out of the frame costs
    more than a match and less than a mismatch, so that the optimisation extends the neighbours' disparity to the border
    of the image.

    Parameters
    ----------
    left, right
        (H, W) uint8, see :func:`stereolag.core.inputs.as_eight_bit`.
    window_size
        Side of the correlation window, px; odd.
    min_disparity, num_disparities
        Range of disparities, px.
    settings
        Weights of the terms.

    Returns
    -------
    ndarray
        (H, W, num_disparities) uint8, 0..250.
    """
    radius = window_size // 2
    before, after = max(0, -min_disparity), max(0, min_disparity + num_disparities - 1)
    pairs = tuple(
        (
            term.features(left, radius, settings),
            _mirrored(term.features(right, radius, settings), radius, before, after),
        )
        for term in TERMS
    )
    origin, unseen = left.shape[1] - 1 + radius + before, int(UNSEEN * settings.highest)
    costs = np.empty((*left.shape, num_disparities), np.uint8)
    over_bands(
        lambda first, end: cost_rows(pairs, radius, min_disparity, origin, unseen, first, end, costs), left.shape[0]
    )
    return costs


def _add(left: Any, right: Any, run: Run, carried: Array, costs: Array) -> None:
    """Add one term, chosen by the type of its features."""
    next(term.add for term in TERMS if term.kind is type(left))(left, right, run, carried, costs)


@compiled_as(_add, strict=False)
def _add_compiled(left: Any, right: Any, run: Any, carried: Any, costs: Any) -> Any:
    """Return the compiled form of :func:`_add`, which chooses the term at compile time."""
    add = next(term.add for term in TERMS if term.kind is left.instance_class)
    return lambda left, right, run, carried, costs: add(left, right, run, carried, costs)


@compiled
def cost_rows(
    pairs: Any, radius: int, smallest: int, origin: int, unseen: int, first: int, end: int, costs: Costs
) -> None:
    """Set the costs of rows `first` to `end`.

    Parameters
    ----------
    pairs
        Features of the left and the right image, for each term. Those of the right image are mirrored left to right, so
        that larger lags are at larger addresses, and are zero beyond its frame.
    radius
        Radius of the correlation window, px.
    smallest
        Disparity of the first lag, px.
    origin
        Column of the right features that corresponds to column 0 of the image.
    unseen
        Cost of a lag that leads out of the frame.
    costs
        (H, W, lags).
    """
    width, lags = costs.shape[1], costs.shape[2]
    pixels = max(1, RUN_CELLS // lags)
    sums = np.empty(pixels * lags, np.float32)
    carried = np.zeros((width + 2 * radius + 2) * lags, np.int32)
    out = costs.reshape(-1)
    for y in range(first, end):
        for x in range(0, width, pixels):
            run = Run(y, x, min(x + pixels, width), y == first, lags, origin + smallest)
            sums[:] = 0
            for pair in literal_unroll(pairs):
                _add(pair[0], pair[1], run, carried, sums)
            _round(sums, out, np.uint64((y * width + x) * lags), np.uint64((run.end - x) * lags))
            for seen in range(x, run.end):
                _mark_unseen(costs, y, seen, seen - smallest, unseen)


@compiled
def _round(sums: Array, out: Array, target: Any, count: Any) -> None:
    for cell in range(count):
        out[target + cell] = np.uint8(np.int32(sums[cell] + np.float32(0.5)))


@compiled
def _mark_unseen(costs: Costs, y: int, x: int, column: int, unseen: int) -> None:
    """Set the cost of the lags that lead out of the frame: lag k leads to ``column - k`` of the right image."""
    for lag in range(max(0, column + 1), costs.shape[2]):
        costs[y, x, lag] = unseen
    for lag in range(0, min(costs.shape[2], column - costs.shape[1] + 1)):
        costs[y, x, lag] = unseen


def _mirrored(features: Any, radius: int, before: int, after: int) -> Any:
    """Return features with their arrays mirrored left to right, and padded so that every lag can be read."""
    arrays = [one for one in features if isinstance(one, np.ndarray)]
    narrowest = min(one.shape[1] for one in arrays)

    def mirror(array: Array) -> Array:
        margin = radius - (array.shape[1] - narrowest) // 2
        return np.pad(array[:, ::-1], ((0, 0), (before + margin, after + margin)))

    return type(features)(*(mirror(one) if isinstance(one, np.ndarray) else one for one in features))


def cost_reference(
    left: EightBit,
    right: EightBit,
    radius: int,
    smallest: int,
    count: int,
    unseen: int,
    settings: MatchingCost,
) -> Volume:
    """Return the (H, W, count) costs expected of :func:`cost_rows` before rounding, computed with plain NumPy."""
    summed = sum(term.reference(left, right, radius, settings) for term in TERMS)
    x = np.arange(left.shape[1])
    other = x[:, None] - smallest - np.arange(count)
    seen = (other >= 0) & (other < left.shape[1])
    return np.where(seen, np.asarray(summed)[:, x[:, None], np.where(seen, other, 0)], float(unseen))
