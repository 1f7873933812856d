"""The search for a lag: whole recordings, blocks of long ones at few lags, and bands of long ones at every lag.

Blocks (overlap-save) never convert a recording as a whole; W. Press et al., "Numerical Recipes", 3rd ed. (2007),
section 13.1.

Correlating two hours in one transform takes many gigabytes. Bands of frequency take little: a band of width w is fully
described by w complex samples a second (R. Crochiere and L. Rabiner, "Multirate Digital Signal Processing" (1983),
section 7.2: the block transform as a filter bank). Each is correlated at a fraction of the sampling rate, the strongest
first. The correlation of the recordings is the sum of the bands' correlations, each rotated by its frequency, so the
sum of their magnitudes is an upper bound at all lags. When no other place can be as high as the best, the best and its
possible rivals are correlated sample by sample (:func:`block_curve`).
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from functools import cached_property, partial
from threading import Lock
from typing import Any

import numpy as np
import numpy.typing as npt
from scipy import fft

from stereolag.core.arrays import DoubleMap, FloatMap, Vector
from stereolag.core.jobs import Progress, silent
from stereolag.core.searches import SignalMethod
from stereolag.loops.compilation import compiled
from stereolag.signals.correlation import (
    FLAT,
    REACH,
    Lags,
    cross_spectrum,
    direct_curve,
    fft_curve,
    find_peak,
    main_lobe,
    overlap_length,
    overlap_slices,
    peak_ratio,
    phat_curve,
    refine_peak,
)
from stereolag.signals.sampling import enough_votes, sampled_votes

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
    """Return the curve of :func:`stereolag.signals.correlation.fft_curve`, for any `first` and `last`.

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
    """Return the result of :func:`stereolag.signals.correlation.overlap_pearson`, computed piece by piece."""
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


BLOCK = 2**15
"""Samples transformed at a time."""

_BLOCKS_AT_ONCE = 16

Bands = npt.NDArray[np.complex64]


def band_energies(recording: CentredRecording, step: int) -> Vector:
    """Return the energy of each of the ``step / 2`` bands, in squared sample units."""
    energies = np.zeros(step // 2)
    for _, spectra in _spectra(recording):
        power = spectra.real**2 + spectra.imag**2
        energies += power.reshape(len(power), energies.size, -1).sum(axis=(0, 2), dtype=np.float64)
    return energies * 2 / BLOCK


def band_signals(recording: CentredRecording, bands: Sequence[int], step: int) -> Bands:
    """Return (bands, ceil(samples / step)): the complex envelopes of the given bands, at every `step`-th sample.

    Scaled so that the real part of their product equals the product of the recordings' samples.
    """
    points = BLOCK // step
    signals = np.zeros((len(bands), -(-recording.size // step)), dtype=np.complex64)
    for start, spectra in _spectra(recording):
        for signal, band in zip(signals, bands, strict=True):
            part = fft.ifft(spectra[:, band * points : (band + 1) * points], axis=1)
            rest = signal[start // step :]
            rest[: part.size] = part.ravel()[: rest.size]
    signals *= np.float32(np.sqrt(2 / step))
    return signals


def _spectra(recording: CentredRecording) -> Iterator[tuple[int, Bands]]:
    """Yield the start of a group of blocks, and their (blocks, BLOCK / 2) spectra without the highest frequency."""
    rows = np.empty((_BLOCKS_AT_ONCE, BLOCK))
    for start in range(0, recording.size, rows.size):
        recording.fill(rows.ravel(), start)
        count = min(_BLOCKS_AT_ONCE, -(-(recording.size - start) // BLOCK))
        spectra = np.asarray(fft.rfft(rows[:count].astype(np.float32), axis=1, workers=2), dtype=np.complex64)
        # Unlike the other frequencies, the mean of a block has no negative counterpart.
        spectra[:, 0] *= np.float32(np.sqrt(0.5))
        yield start, spectra[:, :-1]


def band_products(first: Bands, second: Bands) -> Bands:
    """Return (N1 + N2,) the correlation of one band at the band's lags from ``1 - N1`` to N2.

    Parameters
    ----------
    first, second
        (N1,) and (N2,) envelopes of the band, from :func:`band_signals`.
    """
    size = int(fft.next_fast_len(first.size + second.size))
    rows = np.zeros((2, size), dtype=np.complex64)
    rows[0, : first.size] = first
    rows[1, : second.size] = second
    one, other = fft.fft(rows, axis=1, overwrite_x=True)
    np.conj(one, out=one)
    one *= other
    products = fft.ifft(one, overwrite_x=True)
    return np.concatenate((products[size - first.size + 1 :], products[: second.size + 1]))


@dataclass(frozen=True)
class FoundLag:
    """The result of a method, in samples."""

    lag: int
    peak_ratio: float
    ties: int
    fraction: float
    lags: npt.NDArray[np.int64] | None = None
    correlation: Vector | None = None
    votes: dict[int, int] | None = None
    opposite_lag: int | None = None


def normalised(given: npt.NDArray[Any]) -> Vector:
    """Return the signal with zero mean and height 1, so that squares neither over- nor underflow in any unit."""
    signal = given.astype(np.float64, copy=False)
    centred = signal - signal.mean()
    return np.asarray(centred / max(centred.max(), -centred.min()))


def search_whole(signal_1: Vector, signal_2: Vector, reach: int, method: SignalMethod, progress: Progress) -> FoundLag:
    """Return the peak of the curve of "fft", "phat" or "direct" over the lags up to `reach` both ways."""
    first, last = -min(reach, signal_1.size - 1), min(reach, signal_2.size - 1)
    overlap: Callable[[Lags], Lags] = partial(overlap_length, signal_1.size, signal_2.size)
    if method == "direct":
        curve = direct_curve(signal_1, signal_2, first, last, progress)
    elif method == "fft":
        curve = fft_curve(signal_1, signal_2, first, last)
    else:
        curve = phat_curve(signal_1, signal_2, first, last)
        overlap = np.ones_like
    return _peak_of(curve, first, overlap)


def search_blocks(signal_1: CentredRecording, signal_2: CentredRecording, reach: int, progress: Progress) -> FoundLag:
    """Return the result of :func:`search_whole` with the method "fft", computed block by block."""
    first, last = -min(reach, signal_1.size - 1), min(reach, signal_2.size - 1)
    curve = block_curve(signal_1, signal_2, first, last, progress)
    return _peak_of(curve, first, partial(overlap_length, signal_1.size, signal_2.size))


def _peak_of(curve: Vector, first: int, overlap: Callable[[Lags], Lags]) -> FoundLag:
    lags = np.arange(first, first + curve.size)
    peak, ties = find_peak(curve, lags, overlap)
    around = min(REACH, peak, curve.size - 1 - peak)
    near = slice(peak - around, peak + around + 1)
    fraction = refine_peak(curve[near] / np.sqrt(overlap(lags[near])))
    lags.flags.writeable = False
    curve.flags.writeable = False
    return FoundLag(int(lags[peak]), peak_ratio(curve, peak), ties, fraction, lags, curve)


def search_votes(signal_1: Vector, signal_2: Vector, reach: int, seed: int | None, progress: Progress) -> FoundLag:
    """Return the lag with the most votes; ValueError if there are none."""
    votes = sampled_votes(signal_1, signal_2, reach, np.random.default_rng(seed), progress)
    if not votes:
        raise ValueError(
            f"no sample of signal_1 is found within ±{reach} samples in signal_2; "
            "allow a larger max_lag, or use the method 'fft'."
        )
    lag, count = next(iter(votes.items()))
    rivals = [others for other, others in votes.items() if abs(other - lag) > 1]
    ratio = count / max(rivals) if rivals else float("inf")
    # Votes that coincide by chance are not a lag, and equal counts of them are not ties.
    enough = enough_votes(votes, lag)
    ties = sum(others == count for others in votes.values()) if enough else 1
    opposite = None if enough else _opposite_vote(signal_1, signal_2, reach, seed)
    around = min(REACH, signal_1.size - 1 + lag, signal_2.size - 1 - lag)
    near = np.arange(lag - around, lag + around + 1)
    curve = direct_curve(signal_1, signal_2, lag - around, lag + around, silent)
    fraction = refine_peak(curve / np.sqrt(overlap_length(signal_1.size, signal_2.size, near)))
    return FoundLag(lag, ratio, ties, fraction, votes=votes, opposite_lag=opposite)


def _opposite_vote(signal_1: Vector, signal_2: Vector, reach: int, seed: int | None) -> int | None:
    """Return the lag with enough votes when signal 2 is inverted, None if there are too few."""
    votes = sampled_votes(signal_1, -signal_2, reach, np.random.default_rng(seed), silent)
    lag = next(iter(votes), None)
    return lag if lag is not None and enough_votes(votes, lag) else None


LAGS_OF_A_BAND = 3_000_000
"""Most lags correlated at once: with a few bands, their transforms take 0.4 GB."""

SMALLEST_STEP = 8
BANDS_AT_ONCE = 8

KEPT_LAGS = 2**18
"""Most lags in the reduced curve."""

AROUND = 4096
"""Samples on either side of a place that are searched sample by sample."""

_MOST_PLACES = 6
_RIVAL = 0.6
"""From this share of the best bound on, another place may be higher: the bound is loose for bands of tones."""

_KEPT_OF_BOUND = 0.7
"""A clear peak reaches at least this share of its bound."""

_REST = 0.01
"""Share of the energy that is left out."""

_CELLS_AT_ONCE = 2**18
_GRAIN = 1024
"""Samples between stored running sums."""


class _Bound:
    """Upper bound of the correlation in each cell of `step` lags, from the bands added so far."""

    def __init__(self, signal_1: CentredRecording, signal_2: CentredRecording, reach: int, step: int) -> None:
        self.step = step
        self._lock = Lock()
        self.sizes = signal_1.size, signal_2.size
        lowest, highest = -min(reach, signal_1.size - 1), min(reach, signal_2.size - 1)
        cells_1 = -(-signal_1.size // step)
        self.first = max(lowest // step, 1 - cells_1)
        self._cells = slice(self.first + cells_1 - 1, highest // step + cells_1)
        self.total, self.weights, self.means, self.most = np.zeros(
            (4, self._cells.stop - self._cells.start), dtype=np.float32
        )
        self._weigh(signal_1, signal_2)

    def centres(self, cells: Lags) -> Lags:
        """Return the lags at the centres of cells."""
        lags = (self.first + cells) * self.step + self.step // 2
        return np.clip(lags, 1 - self.sizes[0], self.sizes[1] - 1)

    def add(self, band: int, first: Bands, second: Bands) -> None:
        """Add the magnitudes of the recordings' correlation in another band."""
        products = band_products(first, second)[self._cells.start : self._cells.stop + 1]
        if band == 0:
            # The product of the overlap's means is not agreement.
            products.real[:-1] -= self.means
            products.real[-1] -= self.means[-1]
        power = products.real**2
        power += products.imag**2
        # Between two lags, a band may be as high as both combined.
        magnitude = np.sqrt(power[:-1] + power[1:])
        with self._lock:
            self.total += magnitude

    def weighted(self) -> FloatMap:
        """Return the upper bound of Pearson's correlation times ``sqrt(overlap / longest overlap)``."""
        # Even in full agreement, a short overlap weighs no more than its length allows.
        return np.asarray(np.minimum(self.total * self.weights, self.most))

    def _weigh(self, signal_1: CentredRecording, signal_2: CentredRecording) -> None:
        """Compute, from running sums, the factors that turn the products at each lag into Pearson's correlation."""
        sums = [_Sums(signal) for signal in (signal_1, signal_2)]
        longest = min(self.sizes)
        for start in range(0, self.total.size, _CELLS_AT_ONCE):
            cells = np.arange(start, min(start + _CELLS_AT_ONCE, self.total.size))
            lags = self.centres(cells)
            overlap, begin = overlap_length(*self.sizes, lags), np.maximum(0, -lags)
            parts = [one.between(edge, edge + overlap) for one, edge in zip(sums, (begin, begin + lags), strict=True)]
            # The sum of squares about the mean of the overlap.
            energies = [squares - total**2 / overlap for total, squares in parts]
            varies = [energy > FLAT * one.energy for energy, one in zip(energies, sums, strict=True)]
            varying = varies[0] & varies[1] & (overlap > 1)
            energy = np.where(varying, energies[0] * energies[1], np.inf)
            self.most[cells] = np.sqrt(overlap / longest)
            self.weights[cells] = np.sqrt(overlap / longest / energy)
            self.means[cells] = parts[0][0] * parts[1][0] / overlap


class _Sums:
    """Running sums of a recording and of its squares, stored once per grain."""

    def __init__(self, signal: CentredRecording) -> None:
        steps = [_grains(piece) for piece in signal.pieces(0, signal.size)]
        self._sums = np.cumsum(np.concatenate([np.zeros((2, 1)), *steps], axis=1), axis=1)
        self._ends = np.minimum(np.arange(self._sums.shape[1]) * _GRAIN, signal.size).astype(np.float64)
        self.energy = float(self._sums[1, -1])

    def between(self, start: Lags, stop: Lags) -> tuple[Vector, Vector]:
        """Return the sums and the sums of squares of the samples from `start` to `stop`, exclusive."""
        total, squares = (np.interp(stop, self._ends, one) - np.interp(start, self._ends, one) for one in self._sums)
        return np.asarray(total), np.asarray(squares)


def _grains(piece: Vector) -> DoubleMap:
    starts = np.arange(0, piece.size, _GRAIN)
    return np.stack([np.add.reduceat(piece, starts), np.add.reduceat(piece * piece, starts)])


def search_bands(signal_1: CentredRecording, signal_2: CentredRecording, reach: int, progress: Progress) -> FoundLag:
    """Return the result of :func:`stereolag.signals.search.search_whole` with "fft", its curve reduced.

    The curve is reduced to one point per stretch of lags, with an upper bound in `correlation`; near the peak and its
    rivals, which are measured sample by sample, it is the highest value and its lag. `peak_ratio` does not exceed
    that of the whole curve, and `ties` counts only those near the peak and its rivals.
    """
    step = cell_size(signal_1.size, signal_2.size)
    bound = _Bound(signal_1, signal_2, reach, step)
    energies = [band_energies(signal, step) for signal in (signal_1, signal_2)]
    common = np.sqrt(energies[0] * energies[1]) / np.sqrt(energies[0].sum() * energies[1].sum())
    progress(0.1)
    order = np.argsort(-common, kind="stable")
    for start in range(0, order.size, BANDS_AT_ONCE):
        chosen = [int(band) for band in order[start : start + BANDS_AT_ONCE]]
        parts = [band_signals(signal, chosen, step) for signal in (signal_1, signal_2)]
        with ThreadPoolExecutor(2) as threads:
            for number, _ in enumerate(threads.map(bound.add, chosen, *parts), start=1):
                progress(0.1 + 0.6 * (start + number) / order.size)
        del parts  # before the next are made
        rest = float(common[order[start + BANDS_AT_ONCE :]].sum())
        if rest < _REST or _leads(bound.weighted(), AROUND // step, rest):
            break
    return _refined(signal_1, signal_2, bound, reach, progress)


def cell_size(size_1: int, size_2: int) -> int:
    """Return the number of lags per cell: a power of two."""
    cells = max(SMALLEST_STEP, -(-(size_1 + size_2) // LAGS_OF_A_BAND))
    return 1 << (cells - 1).bit_length()


def _leads(bound: FloatMap, around: int, rest: float) -> bool:
    """Return whether the rest of the energy cannot lift any cell above the best, its neighbours aside."""
    best = int(np.argmax(bound))
    highest = float(bound[best])
    bound[max(0, best - around) : best + around + 1] = 0
    return _KEPT_OF_BOUND * highest > float(bound.max()) + rest


def _places(bound: _Bound) -> list[int]:
    """Return the lags around which the correlation may be highest, best first."""
    weighted, around = bound.weighted(), AROUND // bound.step
    best = int(np.argmax(weighted))
    places, highest = [best], float(weighted[best])
    nearest = _nearest_ties(bound, weighted, best)
    while len(places) < _MOST_PLACES:
        weighted[max(0, places[-1] - around) : places[-1] + around + 1] = 0
        other = int(np.argmax(weighted))
        if weighted[other] < max(_RIVAL * highest, 1e-30):
            break
        places.append(other)
    return [int(lag) for lag in bound.centres(np.array([*places, *nearest]))]


def _nearest_ties(bound: _Bound, weighted: FloatMap, best: int) -> list[int]:
    """Return the cells nearest to lag 0, on either side, that may tie with the best (:func:`find_peak`)."""
    high = np.flatnonzero(weighted >= _KEPT_OF_BOUND * np.sqrt(0.5) * weighted[best])
    share = overlap_length(*bound.sizes, bound.centres(high)) / overlap_length(
        *bound.sizes, bound.centres(np.array([best]))
    )
    high = high[(share >= 0.5) & (weighted[high] >= _KEPT_OF_BOUND * np.sqrt(share) * weighted[best])]
    later = high[high + bound.first >= 0][:1]
    earlier = high[high + bound.first < 0][-1:]
    return [int(cell) for cell in (*later, *earlier)]


def _windows(places: list[int], first: int, last: int) -> list[tuple[int, int]]:
    """Return the first and last lags of the windows around all places, ascending and disjoint."""
    windows: list[tuple[int, int]] = []
    for place in sorted(places):
        low, high = max(first, place - AROUND), min(last, place + AROUND)
        if windows and low <= windows[-1][1] + 1:
            low = windows.pop()[0]
        windows.append((low, high))
    return windows


def _refined(
    signal_1: CentredRecording, signal_2: CentredRecording, bound: _Bound, reach: int, progress: Progress
) -> FoundLag:
    """Return the peak, measured sample by sample."""
    first, last = -min(reach, signal_1.size - 1), min(reach, signal_2.size - 1)
    windows = _windows(_places(bound), first, last)
    curves = []
    for number, window in enumerate(windows):
        curves.append(block_curve(signal_1, signal_2, *window))
        progress(0.7 + 0.3 * (number + 1) / len(windows))
    # A zero between two windows keeps their ends from counting as neighbours.
    lags = np.concatenate([np.arange(low - 1, high + 1) for low, high in windows])[1:]
    values = np.concatenate([np.append(0.0, curve) for curve in curves])[1:]
    peak, ties = find_peak(values, lags, lambda some: overlap_length(*bound.sizes, some))
    lag, height = int(lags[peak]), float(values[peak])

    near = next(number for number, (low, high) in enumerate(windows) if low <= lag <= high)
    low, curve = windows[near][0], curves[near]
    around = min(REACH, lag - low, low + curve.size - 1 - lag)
    middle = slice(lag - low - around, lag - low + around + 1)
    overlap = overlap_length(*bound.sizes, np.arange(lag - around, lag + around + 1))
    kept = _Reduced(bound, windows, height)
    for (start, _), one in zip(windows, curves, strict=True):
        kept.put(start, one)
    kept.mark(lag, height)
    lobe, end = main_lobe(curve, lag - low)
    outside = [curve[:lobe], curve[end:], *curves[:near], *curves[near + 1 :]]
    rival = max(kept.beyond, *(float(part.max(initial=0.0)) for part in outside))
    ratio = height / rival if rival > 0 else np.inf
    lowest = int(np.argmin(values))
    return FoundLag(
        lag,
        ratio if height > 0 else np.nan,
        ties,
        refine_peak(curve[middle] / np.sqrt(overlap)),
        kept.lags,
        kept.values,
        opposite_lag=int(lags[lowest]) if -values[lowest] > 1.1 * height else None,
    )


class _Reduced:
    """A curve reduced to the highest point of every stretch of cells.

    Attributes
    ----------
    lags, values
        Ascending lags, and the bound at each, capped at the height of the peak; replaced by measured values where
        there are any.
    beyond
        Highest bound outside the measured windows.
    """

    def __init__(self, bound: _Bound, windows: list[tuple[int, int]], height: float) -> None:
        cells = -(-bound.total.size // KEPT_LAGS)
        self._begin, self._step = bound.first * bound.step, cells * bound.step
        rows = np.zeros((-(-bound.total.size // cells), cells), dtype=np.float32)
        row = rows.ravel()
        row[: bound.total.size] = bound.weighted()
        for low, high in windows:
            row[max(0, low // bound.step - bound.first) : high // bound.step - bound.first + 1] = 0
        best = rows.argmax(axis=1) + cells * np.arange(len(rows))
        self.lags = bound.centres(best)
        self.values = row[best].astype(np.float64)
        if height > 0:
            np.minimum(self.values, height, out=self.values)
        self.beyond = float(self.values.max())

    def put(self, low: int, curve: Vector) -> None:
        """Enter the values measured from lag `low` on."""
        stretch = (np.arange(low, low + curve.size) - self._begin) // self._step
        starts = np.flatnonzero(np.diff(stretch, prepend=-1))
        for start, stop in zip(starts.tolist(), (*starts[1:].tolist(), curve.size), strict=True):
            top = start + int(np.argmax(curve[start:stop]))
            self.mark(low + top, float(curve[top]))

    def mark(self, lag: int, value: float) -> None:
        """Enter a measured value."""
        stretch = (lag - self._begin) // self._step
        self.lags[stretch], self.values[stretch] = lag, value
