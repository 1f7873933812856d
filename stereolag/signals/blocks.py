"""Correlation of long recordings at few lags, by overlap-save: neither recording is ever converted as a whole.

W. Press et al., "Numerical Recipes", 3rd ed. (2007), section 13.1: convolution of very large data sets.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from functools import cached_property
from typing import Any

import numpy as np
import numpy.typing as npt
from scipy import fft

from stereolag.core.arrays import DoubleMap, Vector
from stereolag.core.jobs import Progress, silent
from stereolag.loops.compilation import compiled
from stereolag.signals.overlaps import FLAT, cross_spectrum, overlap_slices

SHORTEST_BLOCK = 2**16
"""Points of the smallest transform: shorter ones are no faster per sample."""

_BLOCKS_PER_REACH = 4
"""Length of a transform over the number of lags: all but one of this many parts of a block are new samples."""

_TRANSFORM_PER_BLOCK = 4
"""Blocks pay off if the recording is at least this many times as long."""

_PIECE = 2**18
"""Samples converted at a time where no transform is involved."""


class CentredRecording:
    """A recording of any number type, read piece by piece as float64 with zero mean and height 1.

    Parameters
    ----------
    signal
        (N,) integers or floats, all finite and not all equal.
    on_read
        Called after every read.
    """

    def __init__(self, signal: npt.NDArray[Any], on_read: Callable[[], None] | None = None) -> None:
        self._signal, self._on_read = signal, on_read
        self._mean = float(signal.mean(dtype=np.float64))
        self._height = max(float(signal.max()) - self._mean, self._mean - float(signal.min()))
        self.size = signal.size

    def fill(self, row: Vector, start: int) -> None:
        """Fill `row` with the samples from `start` on; zeros before the first sample and after the last."""
        first, stop = np.clip((start, start + row.size), 0, self.size)
        before, end = first - start, stop - start
        row[:before] = 0
        row[end:] = 0
        np.subtract(self._signal[first:stop], self._mean, out=row[before:end], dtype=np.float64)
        row[before:end] /= self._height
        if self._on_read is not None:
            self._on_read()

    def pieces(self, start: int, stop: int) -> Iterator[Vector]:
        """Yield the samples from `start` to `stop`, exclusive, a quarter of a million at a time."""
        for first in range(start, stop, _PIECE):
            piece = np.empty(min(_PIECE, stop - first))
            self.fill(piece, first)
            yield piece

    @cached_property
    def _totals(self) -> npt.NDArray[np.float64]:
        """Return (pieces + 1, 2): the sum and the sum of squares of all samples before each piece."""
        steps = [(np.sum(piece), np.sum(piece * piece)) for piece in self.pieces(0, self.size)]
        return np.cumsum([(0.0, 0.0), *steps], axis=0)

    @property
    def energy(self) -> float:
        """Return the sum of all squares."""
        return float(self._totals[-1, 1])

    def running_sums(self, first: int, last: int) -> DoubleMap:
        """Return the sums and the sums of squares of the first `first`, `first` + 1, … `last` samples, (2, N)."""
        before = first // _PIECE
        start = before * _PIECE
        samples = np.empty(last - start)
        self.fill(samples, start)
        sums = np.empty((2, samples.size + 1))
        sums[:, 0] = self._totals[before]
        sums[0, 1:], sums[1, 1:] = samples, samples * samples
        return np.asarray(np.cumsum(sums, axis=1, out=sums)[:, first - start :])


def block_length(lags: int) -> int:
    """Return the length of the transforms for this many lags."""
    return int(fft.next_fast_len(max(SHORTEST_BLOCK, _BLOCKS_PER_REACH * lags), real=True))


def suits_blocks(longest: int, lags: int) -> bool:
    """Return whether blocks take less memory and time than one transform of the `longest` recording."""
    return _TRANSFORM_PER_BLOCK * block_length(lags) <= longest


def block_curve(
    signal_1: CentredRecording, signal_2: CentredRecording, first: int, last: int, progress: Progress = silent
) -> Vector:
    """Return the curve of :func:`stereolag.signals.curves.fft_curve`, for any `first` and `last`.

    Parameters
    ----------
    signal_1, signal_2
        Recordings of N1 and N2 samples.
    first, last
        ``-N1 < first <= last < N2``, samples.
    """
    curve = block_products(signal_1, signal_2, first, last, block_length(last - first + 1), progress)
    for start in range(0, curve.size, _PIECE):
        _weigh_piece(curve[start : start + _PIECE], first + start, signal_1, signal_2)
    return curve


def _weigh_piece(products: Vector, first: int, signal_1: CentredRecording, signal_2: CentredRecording) -> None:
    """Turn the products from the lag `first` on into the weighted correlation, in place."""
    last = first + products.size - 1
    sizes = np.array([signal_1.size, signal_2.size])
    # Where the overlap begins and ends in either recording, at the last lag and at the first.
    starts = ((max(0, -last), max(0, -first)), (max(0, first), max(0, last)))
    stops = tuple(
        (min(one.size, other.size + sign * near), min(one.size, other.size + sign * far))
        for one, other, sign, near, far in (
            (signal_1, signal_2, -1, last, first),
            (signal_2, signal_1, 1, first, last),
        )
    )
    sums = [
        signal.running_sums(*edges)
        for signal, both in zip((signal_1, signal_2), zip(starts, stops, strict=True), strict=True)
        for edges in both
    ]
    edges = np.array([starts[0][0], stops[0][0], starts[1][0], stops[1][0]])
    weigh_overlaps(products, first, sizes, FLAT * np.array([signal_1.energy, signal_2.energy]), edges, *sums)


@compiled
def weigh_overlaps(
    products: Vector,
    first: int,
    sizes: npt.NDArray[np.int64],
    flat: Vector,
    edges: npt.NDArray[np.int64],
    before_1: DoubleMap,
    until_1: DoubleMap,
    before_2: DoubleMap,
    until_2: DoubleMap,
) -> None:
    """Turn products into Pearson's correlation times ``sqrt(overlap / longest overlap)``, in place; 0 where flat.

    Parameters
    ----------
    products
        (lags,) ``sum(signal_1[i] * signal_2[i + lag])`` over the overlap, for the lag `first` and the lags after it.
    sizes, flat
        (2,) lengths of the recordings, and the energy that their flat parts do not exceed.
    edges
        (4,) number of samples summed in the first column of each of the arrays below.
    before_1, until_1, before_2, until_2
        (2, columns) sums and sums of squares of the samples before the overlap starts and up to its end: of as many
        samples as in `edges`, and one more in each further column.
    """
    longest = min(sizes[0], sizes[1])
    for index in range(products.size):
        lag = first + index
        start, stop = max(0, -lag), min(sizes[0], sizes[1] - lag)
        overlap = float(stop - start)
        begin_1, end_1, begin_2, end_2 = (
            start - edges[0],
            stop - edges[1],
            start + lag - edges[2],
            stop + lag - edges[3],
        )
        sum_1, sum_2 = until_1[0, end_1] - before_1[0, begin_1], until_2[0, end_2] - before_2[0, begin_2]
        energy_1 = until_1[1, end_1] - before_1[1, begin_1] - sum_1 * sum_1 / overlap
        energy_2 = until_2[1, end_2] - before_2[1, begin_2] - sum_2 * sum_2 / overlap
        value = (products[index] - sum_1 * sum_2 / overlap) * np.sqrt(overlap / (longest * energy_1 * energy_2))
        products[index] = value if energy_1 > flat[0] and energy_2 > flat[1] else 0.0


def block_products(
    signal_1: CentredRecording,
    signal_2: CentredRecording,
    first: int,
    last: int,
    size: int,
    progress: Progress = silent,
) -> Vector:
    """Return ``sum(signal_1[i] * signal_2[i + lag])`` for every lag from `first` to `last`, without wrap-around.

    Every block of signal 1 is multiplied by the part of signal 2 that the lags align with it. All blocks have the same
    position in their transforms, so their spectra are summed, and only the sum is transformed back. `size` is the
    length of the transforms, larger than the number of lags.
    """
    lags = last - first + 1
    step = size - lags + 1
    begin, stop = max(0, -last), min(signal_1.size, signal_2.size - first)
    rows = np.empty((2, size))
    total = np.zeros(size // 2 + 1, dtype=np.complex128)
    for start in range(begin, stop, step):
        count = min(step, stop - start)
        signal_1.fill(rows[0, :count], start)
        rows[0, count:] = 0
        signal_2.fill(rows[1], start + first)
        spectra = fft.rfft(rows, axis=1, workers=2)
        total += cross_spectrum(*spectra)
        progress((start + count - begin) / (stop - begin))
    return np.asarray(fft.irfft(total, size, overwrite_x=True)[:lags])


def block_pearson(signal_1: CentredRecording, signal_2: CentredRecording, lag: int) -> float:
    """Return the result of :func:`stereolag.signals.overlaps.overlap_pearson`, computed piece by piece."""
    part_1, part_2 = overlap_slices(signal_1.size, signal_2.size, lag)
    overlap = part_1.stop - part_1.start
    means = [
        sum(float(np.sum(piece)) for piece in signal.pieces(part.start, part.stop)) / overlap
        for signal, part in ((signal_1, part_1), (signal_2, part_2))
    ]
    square_1 = square_2 = product = 0.0
    pieces_2 = signal_2.pieces(part_2.start, part_2.stop)
    for piece_1, piece_2 in zip(signal_1.pieces(part_1.start, part_1.stop), pieces_2, strict=True):
        piece_1 -= means[0]
        piece_2 -= means[1]
        square_1 += float(np.sum(piece_1 * piece_1))
        square_2 += float(np.sum(piece_2 * piece_2))
        product += float(np.sum(piece_1 * piece_2))
    if square_1 <= FLAT * signal_1.energy or square_2 <= FLAT * signal_2.energy:
        return float("nan")
    return float(np.clip(product / np.sqrt(square_1 * square_2), -1.0, 1.0))
