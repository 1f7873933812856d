"""Memory and time needed to find a lag, from the arrays that each method allocates."""

from __future__ import annotations

import math
from typing import Literal, TypeAlias

from stereolag.core.estimates import OVERHEAD, Estimate, kept_blocks, largest_fitting, rounded_down
from stereolag.core.searches import SignalMethod
from stereolag.signals.blocks import SHORTEST_BLOCK, block_length, suits_blocks
from stereolag.signals.curves import transform_length
from stereolag.signals.long_search import AROUND, BANDS_AT_ONCE, cell_size

REAL, COMPLEX, INDEX = 8, 16, 8
"""Bytes per sample of a recording, per value of its spectrum, and per lag."""

HALF_REAL, HALF_COMPLEX = 4, 8
"""The same in single precision."""

Way: TypeAlias = Literal["whole", "blocks", "bands"]

LONGEST_WHOLE = 2**23
"""Longest recording that is always transformed as a whole, samples: three minutes at 44.1 kHz, 1.2 GB."""

BAND_SECONDS = 3e-9
"""Seconds per lag of a band and doubling of their number, for its transforms and its share of the splitting."""

FFT_SECONDS = 1.4e-8
"""Seconds per point of the transform and doubling of its length, for three transforms and all other work."""

BLOCK_SECONDS = 3e-9
"""Seconds per point of a block and doubling of its length, for two real transforms and all other work."""

PIECE_SECONDS = 2e-8
"""Seconds per sample of either recording, for converting it for its mean, its energy and the score."""

BLOCK_VECTORS = 16
"""Most vectors over the lags at once: running sums and selections from them, the curve, and its peak search."""

SORT_SECONDS = 1.8e-8
"""Seconds per sample of the longer recording and doubling of its length, for sorting by value."""

PRODUCT_SECONDS = 2.5e-10
"""Seconds per product of two samples, including the sums taken along with it."""

SAMPLE_SECONDS = 1.5e-8
"""Seconds per sample of either recording, for removing its mean and scaling it."""


def estimate_lag(size_1: int, size_2: int, *, method: SignalMethod = "fft", max_lag: int | None = None) -> Estimate:
    """Return the memory and time that :func:`stereolag.signals.signal_lag` needs.

    "fft" with a `max_lag` that is small against the recordings (:func:`way_of`) allocates one block of each, their
    spectra, scratch vectors for both, the sum of the spectra, and vectors over the lags. For every lag of recordings
    above ``LONGEST_WHOLE`` samples it allocates a few bands of both and their transforms.

    Otherwise both recordings are kept as float64 with zero mean. In addition, at most,

    * "fft" and "phat" allocate two complex spectra, the twiddle factors of the transform and a scratch vector for each
      of two threads; later the curve, its lags and those selected by the peak search: at worst all lags whose overlap
      is at least half the longest, in seven vectors;
    * "direct" allocates the curve and the same for its peak, and the two overlaps at the peak; its time is proportional
      to the number of products, ``size_1 * size_2`` if every lag is searched;
    * "sampled" allocates three vectors for each recording (the means, the scales and the indices of its slices), and
      six of the longer one's length while that is sorted by value.

    Parameters
    ----------
    size_1, size_2
        Samples of the recordings, 2 or more.
    method, max_lag
        As for :func:`~stereolag.signals.signal_lag`.
    """
    total, longest, shortest = size_1 + size_2, max(size_1, size_2), min(size_1, size_2)
    reach = longest - 1 if max_lag is None else max_lag
    lags = _lag_count(size_1, size_2, reach)
    way = way_of(size_1, size_2, method, reach)
    if way != "whole":
        return (_estimate_blocks if way == "blocks" else _estimate_bands)(size_1, size_2, lags)
    recordings = REAL * total
    # During normalisation: also the recordings converted to float64, and one vector in conversion.
    memory = recordings + recordings + REAL * longest
    seconds = SAMPLE_SECONDS * total
    if method == "sampled":
        memory = max(memory, recordings + 3 * INDEX * total + 6 * REAL * longest)
        seconds += SORT_SECONDS * longest * math.log2(longest)
        return Estimate(memory + kept_blocks(REAL * longest, 3) + OVERHEAD, seconds)
    peak = (REAL + INDEX) * lags + 7 * INDEX * min(lags, longest)
    if method == "direct":
        memory = max(memory, recordings + peak, recordings + (REAL + INDEX) * lags + 2 * REAL * shortest)
        seconds += PRODUCT_SECONDS * product_count(size_1, size_2, reach)
        return Estimate(memory + kept_blocks(REAL * longest, 1) + OVERHEAD, seconds)
    size = transform_length(longest)
    transforms = 2 * COMPLEX * size + COMPLEX * size + 2 * COMPLEX * size
    # The FFT library caches the twiddle factors for the next transform of this length.
    memory = max(memory, recordings + transforms, recordings + COMPLEX * size + peak)
    seconds = FFT_SECONDS * size * math.log2(size)
    return Estimate(memory + kept_blocks(COMPLEX * size, 3) + OVERHEAD, seconds)


def way_of(size_1: int, size_2: int, method: SignalMethod, reach: int) -> Way:
    """Return how recordings of these sizes are processed, for lags up to `reach` both ways."""
    longest = max(size_1, size_2)
    if method != "fft":
        return "whole"
    if suits_blocks(longest, _lag_count(size_1, size_2, reach)):
        return "blocks"
    return "whole" if longest <= LONGEST_WHOLE else "bands"


def _lag_count(size_1: int, size_2: int, reach: int) -> int:
    return min(reach, size_1 - 1) + min(reach, size_2 - 1) + 1


def _estimate_blocks(size_1: int, size_2: int, lags: int) -> Estimate:
    size, total = block_length(lags), size_1 + size_2
    # Two rows, scratch vectors for both, their spectra and the sum; before that, one finiteness flag per sample.
    memory = max((2 + 2 + 2 + 1) * REAL * size, BLOCK_VECTORS * REAL * lags) + max(size_1, size_2)
    blocks = -(-min(size_1, size_2) // (size - lags + 1))
    seconds = BLOCK_SECONDS * blocks * size * math.log2(size) + PIECE_SECONDS * total
    return Estimate(memory + kept_blocks(REAL * size, 2) + OVERHEAD, seconds)


def _estimate_bands(size_1: int, size_2: int, lags: int) -> Estimate:
    step, total = cell_size(size_1, size_2), size_1 + size_2
    cells, size = lags // step + 2, total // step
    # For two bands at once, the transforms of both recordings and three copies, the twiddle factors, and the bands
    # in progress; later the bound and its search, which coexist with the windows being refined.
    memory = (2 * 5 + 1 + BANDS_AT_ONCE) * HALF_COMPLEX * size + 14 * HALF_REAL * cells
    memory += _estimate_blocks(SHORTEST_BLOCK, SHORTEST_BLOCK, 16 * AROUND).memory
    bands = step // 2
    seconds = BAND_SECONDS * bands * size * math.log2(size) + 4 * PIECE_SECONDS * total
    return Estimate(max(memory, size_1, size_2), seconds)


def fitting_recordings(allowed: int, *, sampling_rate: float, method: SignalMethod, max_lag: int | None) -> str:
    """Return a sentence with the length of two recordings that would fit into `allowed` bytes."""

    def of_length(size: int) -> Estimate:
        return estimate_lag(size, size, method=method, max_lag=None if max_lag is None else min(max_lag, size - 1))

    size = rounded_down(largest_fitting(of_length, allowed // REAL, allowed))
    fitting = (
        f"Two recordings of {size:,} samples ({size / sampling_rate:.3g} s at {sampling_rate:,.10g} Hz) would fit."
    )
    return fitting if method == "fft" else f"{fitting} The method 'fft' takes longer ones."


def product_count(size_1: int, size_2: int, reach: int) -> int:
    """Return the number of sample pairs that overlap, over all lags up to `reach` both ways."""

    def of_one_sign(first: int, second: int) -> int:
        """Sum ``min(first, second - lag)`` over the lags from 0 on."""
        count = min(reach, second - 1) + 1
        whole = min(count, max(0, second - first + 1))
        rest = count - whole
        return whole * first + rest * second - (whole + count - 1) * rest // 2

    return of_one_sign(size_1, size_2) + of_one_sign(size_2, size_1) - min(size_1, size_2)
