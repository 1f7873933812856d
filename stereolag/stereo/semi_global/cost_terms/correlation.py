"""Correlation term: it handles flat and noisy regions."""

from __future__ import annotations

from typing import Any, NamedTuple

import cv2
import numpy as np
import numpy.typing as npt

from stereolag.core.arrays import Array
from stereolag.loops.compilation import compiled
from stereolag.stereo.semi_global.cost_terms.term import CostTerm, EightBit, Run, Volume
from stereolag.stereo.semi_global.costs import MatchingCost

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


CORRELATION = CostTerm("correlation", CorrelationFeatures, correlation_features, add_correlation, correlation_reference)
