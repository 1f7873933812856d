"""Matching cost of every pixel at every lag, summed over its terms in one pass over the pair."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

from stereolag.core.arrays import Array
from stereolag.core.inputs import Image
from stereolag.loops.bands import over_bands
from stereolag.loops.compilation import compiled, compiled_as, literal_unroll
from stereolag.stereo.semi_global.cost_terms import TERMS, MatchingCost, Run

Costs = npt.NDArray[np.uint8]

UNSEEN = 0.28
"""Cost of a lag that leads out of the frame, as a share of the highest cost: between a good match and a mismatch."""

RUN_CELLS = 4096
"""Pixels times lags of a run; their costs fill half of a core's L1 cache."""


def matching_cost(
    left: Image,
    right: Image,
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
    pairs = features_of(left, right, radius, settings, before, after)
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


def features_of(
    left: npt.NDArray[np.uint8],
    right: npt.NDArray[np.uint8],
    radius: int,
    settings: MatchingCost,
    before: int,
    after: int,
) -> tuple[tuple[Any, Any], ...]:
    """Return the features of both images for each term, as :func:`cost_rows` expects them.

    Those of the right image are padded with `before` and `after` zeros, so that every lag can be read.
    """
    return tuple(
        (
            term.features(left, radius, settings),
            _mirrored(term.features(right, radius, settings), radius, before, after),
        )
        for term in TERMS
    )


def _mirrored(features: Any, radius: int, before: int, after: int) -> Any:
    """Return features with their arrays mirrored left to right and padded to one width."""
    arrays = [one for one in features if isinstance(one, np.ndarray)]
    narrowest = min(one.shape[1] for one in arrays)

    def mirror(array: Array) -> Array:
        margin = radius - (array.shape[1] - narrowest) // 2
        return np.pad(array[:, ::-1], ((0, 0), (before + margin, after + margin)))

    return type(features)(*(mirror(one) if isinstance(one, np.ndarray) else one for one in features))


def cost_reference(
    left: npt.NDArray[np.uint8],
    right: npt.NDArray[np.uint8],
    radius: int,
    smallest: int,
    count: int,
    unseen: int,
    settings: MatchingCost,
) -> npt.NDArray[np.float64]:
    """Return the (H, W, count) costs expected of :func:`cost_rows` before rounding, computed with plain NumPy."""
    summed = sum(term.reference(left, right, radius, settings) for term in TERMS)
    x = np.arange(left.shape[1])
    other = x[:, None] - smallest - np.arange(count)
    seen = (other >= 0) & (other < left.shape[1])
    return np.where(seen, np.asarray(summed)[:, x[:, None], np.where(seen, other, 0)], float(unseen))
