"""The matching cost of every pixel at every lag: correlation, census and gradient in one pass over the pair."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from stereolag.arrays import Array
from stereolag.loops.compilation import compiled
from stereolag.loops.popcount import popcount
from stereolag.stereo.semi_global.census import census_reference

Costs = npt.NDArray[np.uint8]


class Features(NamedTuple):
    """What the cost compares, for one image.

    The right image's arrays are mirrored left to right, so that larger lags lie at larger addresses, and `origin` is
    the place of its column 0; beyond its frame they hold zeros.
    """

    padded: npt.NDArray[np.int16]
    """Grey levels less 128, with a border of the window's radius on each side."""
    total: npt.NDArray[np.float32]
    """Sum of the window around every pixel, of those levels."""
    mean: npt.NDArray[np.float32]
    """Their mean."""
    inverse: npt.NDArray[np.float32]
    """One over the root of the window's energy about its mean."""
    words: npt.NDArray[np.uint32]
    """Census."""
    gradient: npt.NDArray[np.float32]
    """Horizontal gradient, in units of cost."""
    origin: int


class Weights(NamedTuple):
    """Share of each term in the cost."""

    correlation: float
    """Cost of a correlation of -1; one of +1 costs nothing."""
    bit: float
    """Cost of one census bit that differs."""
    gradient: float
    """The most that a difference of the gradients costs."""
    unseen: float
    """Cost of a lag that leads out of the frame."""


@compiled
def cost_rows(
    left: Features, right: Features, radius: int, smallest: int, weights: Weights, first: int, end: int, costs: Costs
) -> None:
    """Set the costs of rows `first` to `end`; `smallest` is the disparity of the first lag.

    Equals :func:`cost_reference`. The correlation's products are summed down each column of the window once and then
    along the row, so that the time does not depend on the window. Arrays are flattened once and for all: a view made
    for every pixel takes three times as long as the arithmetic.
    """
    width, lags, side = np.uint64(costs.shape[1]), np.uint64(costs.shape[2]), np.uint64(2 * radius + 1)
    zero, one = np.uint64(0), np.uint64(1)
    span = width + side - one
    # Column 0 stays zero: it is what leaves the window before that is full.
    columns, window = np.zeros((span + one) * lags, np.int32), np.zeros(lags, np.int32)
    left_pixels, right_pixels = left.padded.reshape(-1), right.padded.reshape(-1)
    totals, inverses = right.total.reshape(-1), right.inverse.reshape(-1)
    words, gradients = right.words.reshape(-1), right.gradient.reshape(-1)
    out = costs.reshape(-1)
    stride, right_stride = np.uint64(left.padded.shape[1]), np.uint64(right.padded.shape[1])
    origin = np.uint64(right.origin + smallest)
    reach = origin + np.uint64(radius)
    half, bit, cap = np.float32(weights.correlation * 0.5), np.float32(weights.bit), np.float32(weights.gradient)
    for row in range(np.uint64(first), np.uint64(first) + side - one):
        for col in range(span):
            newest = row * right_stride + reach - col
            pixel = left_pixels[row * stride + col]
            _slide(columns, (col + one) * lags, zero, window, lags, right_pixels, newest, zero, pixel, 0)
    for y in range(np.uint64(first), np.uint64(end)):
        window[:] = 0
        top = y == np.uint64(first)
        incoming, outgoing = y + side - one, y if top else y - one
        for col in range(span):
            here, leaving = (col + one) * lags, (col + one - side) * lags if col >= side else zero
            newest, oldest = incoming * right_stride + reach - col, outgoing * right_stride + reach - col
            gained, lost = left_pixels[incoming * stride + col], 0 if top else left_pixels[outgoing * stride + col]
            _slide(columns, here, leaving, window, lags, right_pixels, newest, oldest, gained, lost)
            if col + one < side:
                continue
            x = col + one - side
            source, target = y * right_stride + origin - x, (y * width + x) * lags
            scale = np.float32(half * left.inverse[y, x])
            _join(
                window,
                left.mean[y, x],
                scale,
                half,
                totals,
                inverses,
                left.words[y, x],
                words,
                bit,
                left.gradient[y, x],
                gradients,
                cap,
                source,
                lags,
                out,
                target,
            )
            _mark_unseen(costs, int(y), int(x), int(x) - smallest, weights.unseen)


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
    """Move a column of products down by one row, and take it into the window in place of the one that leaves.

    `gained` and `lost` are the left image's pixels of the row that the column gains and of the one it loses; `newest`
    and `oldest` say where the right image's pixels of those rows begin.
    """
    more, less = np.int32(gained), np.int32(lost)
    for lag in range(lags):
        products = more * np.int32(pixels[newest + lag]) - less * np.int32(pixels[oldest + lag])
        column = np.int32(columns[here + lag] + products)
        columns[here + lag] = column
        window[lag] += column - columns[leaving + lag]


@compiled
def _join(
    window: Array,
    mean: Any,
    scale: Any,
    half: Any,
    totals: Array,
    inverses: Array,
    word: Any,
    words: Array,
    bit: Any,
    gradient: Any,
    gradients: Array,
    cap: Any,
    source: Any,
    lags: Any,
    out: Array,
    target: Any,
) -> None:
    """Set the costs of one pixel, from `target` on; the right image's features begin at `source`.

    A function of its own: the same loop in the body of :func:`cost_rows` takes four times as long.
    """
    for lag in range(lags):
        covariance = np.float32(window[lag]) - mean * totals[source + lag]
        score = half - covariance * scale * inverses[source + lag]
        different = np.float32(popcount(np.uint32(word ^ words[source + lag])))
        apart = min(abs(gradient - gradients[source + lag]), cap)
        cost = score + bit * different + apart
        out[target + lag] = np.uint8(np.int32(cost + np.float32(0.5)))


@compiled
def _mark_unseen(costs: Costs, y: int, x: int, column: int, unseen: float) -> None:
    """Set the cost of the lags that lead out of the frame: lag k leads to ``column - k`` of the right image."""
    for lag in range(max(0, column + 1), costs.shape[2]):
        costs[y, x, lag] = np.uint8(unseen)
    for lag in range(0, min(costs.shape[2], column - costs.shape[1] + 1)):
        costs[y, x, lag] = np.uint8(unseen)


def cost_reference(
    left: npt.NDArray[np.uint8],
    right: npt.NDArray[np.uint8],
    radius: int,
    smallest: int,
    count: int,
    noise: float,
    gradient_limit: float,
    weights: Weights,
) -> npt.NDArray[np.float64]:
    """Return what :func:`cost_rows` must equal when rounded: (H, W, count), from the images, by plain NumPy.

    `noise` is a standard deviation in grey levels, `gradient_limit` the difference of the gradients that costs most.
    """
    height, width = left.shape
    side = 2 * radius + 1
    windows = [
        np.lib.stride_tricks.sliding_window_view(np.pad(image.astype(float), radius, mode="reflect"), (side, side))
        for image in (left, right)
    ]
    words = [census_reference(image) for image in (left, right)]
    slopes = [_sobel_reference(image) for image in (left, right)]
    free = [window - window.mean(axis=(2, 3), keepdims=True) for window in windows]
    energy = [(window**2).sum(axis=(2, 3)) + (side * noise) ** 2 for window in free]
    costs = np.full((height, width, count), weights.unseen, np.float64)
    for x in range(width):
        for lag in range(count):
            other = x - smallest - lag
            if 0 <= other < width:
                covariance = (free[0][:, x] * free[1][:, other]).sum(axis=(1, 2))
                score = covariance / np.sqrt(energy[0][:, x] * energy[1][:, other])
                different = np.bitwise_count(words[0][:, x] ^ words[1][:, other])
                apart = np.minimum(np.abs(slopes[0][:, x] - slopes[1][:, other]) / gradient_limit, 1)
                costs[:, x, lag] = (
                    weights.correlation * (1 - score) / 2 + weights.bit * different + weights.gradient * apart
                )
    return costs


def _sobel_reference(image: npt.NDArray[np.uint8]) -> npt.NDArray[np.float64]:
    padded = np.pad(image.astype(np.int64), 1, mode="reflect")
    smooth = padded[:-2] + 2 * padded[1:-1] + padded[2:]
    return (smooth[:, 2:] - smooth[:, :-2]) / 4
