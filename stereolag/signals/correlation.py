"""Correlation of two recordings over the lag: Pearson's formula over the overlap, the curves, and their peaks.

At lag ``l``, sample ``i`` of signal 1 is paired with sample ``i + l`` of signal 2; the paired samples are the overlap.
The curves take zero-mean float64 vectors and have one value for each lag from ``first`` (≤ 0) to ``last`` (≥ 0).

A recording that is too long for one transform is read part by part (:class:`ConvertedRecording`) and correlated in
blocks (overlap-save); W. Press et al., "Numerical Recipes", 3rd ed. (2007), section 13.1.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from functools import cached_property, lru_cache
from typing import Any

import numpy as np
import numpy.typing as npt
from scipy import fft

from stereolag.core.arrays import DoubleMap, Vector
from stereolag.core.jobs import Progress, silent
from stereolag.loops.compilation import compiled

Spectrum = npt.NDArray[np.complex128]

FLAT = 1e-10
"""An overlap with less than this share of a recording's energy is flat: rounding would decide its correlation."""

GRAIN = 1024
"""Samples between stored running sums."""

_LOUD_STEPS = 8
"""The loudest stretch starts at a multiple of its length over this number."""


def overlap_length(size_1: int, size_2: int, lags: npt.NDArray[np.integer[Any]]) -> npt.NDArray[np.int64]:
    """Return the number of samples that overlap at each of the `lags`."""
    return np.asarray(np.minimum(size_1, size_2 - lags) - np.maximum(0, -lags))


def overlap_slices(size_1: int, size_2: int, lag: int) -> tuple[slice, slice]:
    """Return the parts of signal 1 and of signal 2 that overlap at `lag`."""
    start, stop = max(0, -lag), min(size_1, size_2 - lag)
    return slice(start, stop), slice(start + lag, stop + lag)


class Recording(ABC):
    """A recording as float64, read part by part.

    Attributes
    ----------
    size
        Number of samples.
    piece
        Number of samples read at a time.
    """

    size: int
    piece: int

    @abstractmethod
    def part(self, start: int, stop: int) -> Vector:
        """Return the samples from `start` to `stop`, exclusive; zeros before the first sample and after the last."""

    def pieces(self, start: int, stop: int) -> Iterator[Vector]:
        """Yield the samples from `start` to `stop`, exclusive, one piece at a time."""
        for first in range(start, stop, self.piece):
            yield self.part(first, min(first + self.piece, stop))

    @cached_property
    def energy(self) -> float:
        """Return the sum of all squares."""
        return sum(_dot(piece, piece) for piece in self.pieces(0, self.size))

    def total(self, start: int, stop: int) -> float:
        """Return the sum of the samples from `start` to `stop`, exclusive."""
        return sum(float(piece.sum()) for piece in self.pieces(start, stop))


class HeldRecording(Recording):
    """A recording in memory, as one piece."""

    def __init__(self, samples: npt.NDArray[Any]) -> None:
        self.size = self.piece = samples.size
        self._samples = samples

    def part(self, start: int, stop: int) -> Vector:
        """Return a view of the samples, or a copy if zeros are added."""
        inside = self._samples[max(0, start) : max(0, stop)]
        if inside.size == stop - start:
            return inside
        return np.pad(inside, (max(0, -start), max(0, stop - max(start, self.size))))


class Inverted(Recording):
    """A recording with its sign reversed."""

    def __init__(self, recording: Recording) -> None:
        self.size, self.piece = recording.size, recording.piece
        self._recording = recording

    def part(self, start: int, stop: int) -> Vector:
        """Return the samples, with their signs reversed."""
        return -self._recording.part(start, stop)


class ConvertedRecording(Recording):
    """A recording of any number type, converted to zero mean and height 1 as it is read.

    Parameters
    ----------
    signal
        (N,) integers or floats, all finite and not all equal.
    on_read
        Called after every read.
    """

    piece = 2**18

    def __init__(self, signal: npt.NDArray[Any], on_read: Callable[[], None] = lambda: None) -> None:
        self._signal, self._on_read, self.size = signal, on_read, signal.size
        self._mean = float(signal.mean(dtype=np.float64))
        self._height = max(float(signal.max()) - self._mean, self._mean - float(signal.min()))
        # Only then does single precision resolve the samples about their mean, and hold them at all.
        self._exact = signal.dtype.itemsize > 4 or abs(self._mean) > self._height

    def part(self, start: int, stop: int) -> Vector:
        """Return the samples, converted."""
        return np.asarray(self._converted(start, stop, np.float64))

    def single(self, start: int, stop: int) -> npt.NDArray[np.float32]:
        """Return the samples of :meth:`part` in single precision, which is read in half the time."""
        return np.asarray(self._converted(start, stop, np.float32))

    def _converted(self, start: int, stop: int, dtype: type[np.floating[Any]]) -> npt.NDArray[Any]:
        samples = np.empty(stop - start, dtype)
        first, end = min(max(start, 0), self.size), min(max(stop, 0), self.size)
        samples[: first - start] = 0
        samples[end - start :] = 0
        inside = samples[first - start : end - start]
        step = np.float64 if self._exact else dtype
        np.subtract(self._signal[first:end], self._mean, out=inside, dtype=step, casting="same_kind")
        inside /= dtype(self._height)
        self._on_read()
        return samples

    @cached_property
    def sums(self) -> DoubleMap:
        """Return (2, N): the sum and the sum of squares of all samples before each grain, and of all samples."""
        steps = [np.zeros((2, 1))]
        for piece in self.pieces(0, self.size):
            starts = np.arange(0, piece.size, GRAIN)
            steps.append(np.stack([np.add.reduceat(piece, starts), np.add.reduceat(piece * piece, starts)]))
        return np.cumsum(np.concatenate(steps, axis=1), axis=1)

    @cached_property
    def energy(self) -> float:
        """Return the sum of all squares."""
        return float(self.sums[1, -1])

    def total(self, start: int, stop: int) -> float:
        """Return the sum of the samples from `start` to `stop`, exclusive."""
        return float(self.running_sums(stop, stop)[0, 0] - self.running_sums(start, start)[0, 0])

    def running_sums(self, first: int, last: int) -> DoubleMap:
        """Return the sums and the sums of squares of the first `first`, `first` + 1, … `last` samples, (2, N)."""
        start = first // GRAIN * GRAIN
        before = float(self.sums[0, first // GRAIN]), float(self.sums[1, first // GRAIN])
        return running_sums(self.part(start, last), before)[:, first - start :]


def loudest_stretch(one: Recording, other: Recording, lag: int, longest: int) -> tuple[slice, slice]:
    """Return the parts of both, at most `longest` samples, in which they are loudest together at `lag`."""
    part, _ = overlap_slices(one.size, other.size, lag)
    start, size = part.start, part.stop - part.start
    if size > longest:
        step = longest // _LOUD_STEPS
        energies = []
        for first in range(part.start, part.stop, step):
            stop = min(first + step, part.stop)
            here = one.part(first, stop)
            energies.append(np.sum((here * (here if other is one else other.part(first + lag, stop + lag))) ** 2))
        loudest = int(np.argmax(np.convolve(energies, np.ones(_LOUD_STEPS), mode="valid")))
        start, size = start + min(step * loudest, size - longest), longest
    return slice(start, start + size), slice(start + lag, start + size + lag)


def overlap_pearson(signal_1: Recording, signal_2: Recording, lag: int) -> float:
    """Return Pearson's correlation of the overlap at `lag`, -1..1; NaN where either part is flat.

    Parameters
    ----------
    signal_1, signal_2
        Recordings of N1 and N2 samples, each with zero mean.
    lag
        Samples, ``-N1 < lag < N2``.
    """
    both = list(zip((signal_1, signal_2), overlap_slices(signal_1.size, signal_2.size, lag), strict=True))
    means = [signal.total(part.start, part.stop) / (part.stop - part.start) for signal, part in both]
    square_1 = square_2 = product = 0.0
    for pieces in zip(*(signal.pieces(part.start, part.stop) for signal, part in both), strict=True):
        first, second = (piece - mean for piece, mean in zip(pieces, means, strict=True))
        square_1 += _dot(first, first)
        square_2 += _dot(second, second)
        product += _dot(first, second)
    if square_1 <= FLAT * signal_1.energy or square_2 <= FLAT * signal_2.energy:
        return float("nan")
    return float(np.clip(product / np.sqrt(square_1 * square_2), -1.0, 1.0))


@compiled(fastmath={"reassoc", "contract"})
def _dot(first: Vector, second: Vector) -> float:
    # NumPy runs a long dot product on all BLAS threads, which takes 100 times as long on a busy machine.
    total = 0.0
    for i in range(first.size):
        total += first[i] * second[i]
    return total


@compiled
def running_sums(samples: Vector, before: tuple[float, float] = (0.0, 0.0)) -> DoubleMap:
    """Return (2, N + 1): the sums and the sums of squares of the first 0, 1, … N samples, added to those `before`."""
    sums = np.empty((2, samples.size + 1))
    total, squares = before
    for i in range(samples.size):
        sums[0, i], sums[1, i] = total, squares
        total += samples[i]
        squares += samples[i] * samples[i]
    sums[0, -1], sums[1, -1] = total, squares
    return sums


@compiled
def turn_forth(signal: Vector, turn: Spectrum, turned: Spectrum) -> None:
    """Fill `turned` (N,) with ``signal * turn``, and with zeros after the end of the signal."""
    for i in range(signal.size):
        turned[i] = complex(signal[i] * turn[i].real, signal[i] * turn[i].imag)
    for at in range(signal.size, turned.size):
        turned[at] = 0


@compiled
def cross_spectrum(spectrum_1: Spectrum, spectrum_2: Spectrum) -> Spectrum:
    """Return ``conj(spectrum_1) * spectrum_2``, in the memory of the first."""
    for i in range(spectrum_1.size):
        one, other = spectrum_1[i], spectrum_2[i]
        spectrum_1[i] = complex(
            one.real * other.real + one.imag * other.imag, one.real * other.imag - one.imag * other.real
        )
    return spectrum_1


@compiled
def turn_back(products: Spectrum, turn: Spectrum, first: int, last: int) -> Vector:
    """Return lags `first` (≤ 0) to `last` (≥ 0) of ``products * conj(turn)``: negative lags are the imaginary part.

    Parameters
    ----------
    products, turn
        (N,) complex128; lag ``l`` is at index ``l``, and a negative one at ``N + l``.
    """
    curve = np.empty(last - first + 1)
    for lag in range(last + 1):
        curve[lag - first] = products[lag].real * turn[lag].real + products[lag].imag * turn[lag].imag
    wrapped = products.size + first
    for i in range(-first):
        product, angle = products[wrapped + i], turn[wrapped + i]
        curve[i] = product.imag * angle.real - product.real * angle.imag
    return curve


@compiled
def weighted_pearson(
    products: Vector,
    first_lag: int,
    sizes: tuple[int, int],
    flat: tuple[float, float],
    edges: tuple[int, int, int],
    until_1: DoubleMap,
    before_2: DoubleMap,
    until_2: DoubleMap,
) -> None:
    """Turn products into Pearson's correlation times ``sqrt(overlap / longest overlap)``, in place; 0 where flat.

    Parameters
    ----------
    products
        (lags,) ``sum(signal_1[i] * signal_2[i + lag])`` over the overlap, for `first_lag` ≥ 0 and the lags after it.
    sizes, flat
        Lengths of the recordings, and the energy that their flat parts do not exceed.
    edges
        Number of samples summed in the first column of each of the arrays below.
    until_1, before_2, until_2
        Columns of the :func:`running_sums` of signal 1 up to the end of the overlap, and of signal 2 before the overlap
        and up to its end.
    """
    longest = min(sizes[0], sizes[1])
    for index in range(products.size):
        lag = first_lag + index
        stop = min(sizes[0], sizes[1] - lag)
        overlap = float(stop)
        end_1, begin_2, end_2 = stop - edges[0], lag - edges[1], stop + lag - edges[2]
        sum_1, sum_2 = until_1[0, end_1], until_2[0, end_2] - before_2[0, begin_2]
        # Everything is multiplied by the overlap to save divisions, which would dominate the loop.
        energy_1 = overlap * until_1[1, end_1] - sum_1 * sum_1
        energy_2 = overlap * (until_2[1, end_2] - before_2[1, begin_2]) - sum_2 * sum_2
        value = (overlap * products[index] - sum_1 * sum_2) * np.sqrt(overlap / (longest * energy_1 * energy_2))
        varies = (energy_1 > overlap * flat[0]) & (energy_2 > overlap * flat[1])
        products[index] = value if varies else 0.0


@compiled(fastmath={"reassoc", "contract"})
def sliding_pearson(signal_1: Vector, signal_2: Vector, first_lag: int, curve: Vector) -> None:
    """Fill `curve` like :func:`weighted_pearson`, with every overlap summed separately.

    `first_lag` may be negative; it is the lag of ``curve[0]``.
    """
    size_1, size_2 = signal_1.size, signal_2.size
    longest = min(size_1, size_2)
    flat_1, flat_2 = FLAT * _dot(signal_1, signal_1), FLAT * _dot(signal_2, signal_2)
    for index in range(curve.size):
        lag = first_lag + index
        start, stop = max(0, -lag), min(size_1, size_2 - lag)
        first, second = signal_1[start:stop], signal_2[start + lag : stop + lag]
        sum_1, sum_2, square_1, square_2, product = 0.0, 0.0, 0.0, 0.0, 0.0
        for i in range(first.size):
            sum_1 += first[i]
            sum_2 += second[i]
            square_1 += first[i] * first[i]
            square_2 += second[i] * second[i]
            product += first[i] * second[i]
        energy_1 = square_1 - sum_1 * sum_1 / first.size
        energy_2 = square_2 - sum_2 * sum_2 / first.size
        curve[index] = 0.0
        if energy_1 > flat_1 and energy_2 > flat_2:
            pearson = (product - sum_1 * sum_2 / first.size) / np.sqrt(energy_1 * energy_2)
            curve[index] = pearson * np.sqrt(first.size / longest)


def turn_forth_reference(signal: Vector, turn: Spectrum) -> Spectrum:
    """Return the expected result of :func:`turn_forth`."""
    return np.asarray(np.pad(signal, (0, turn.size - signal.size)) * turn)


def cross_spectrum_reference(spectrum_1: Spectrum, spectrum_2: Spectrum) -> Spectrum:
    """Return the expected result of :func:`cross_spectrum`."""
    return np.asarray(spectrum_1.conj() * spectrum_2)


def turn_back_reference(products: Spectrum, turn: Spectrum, first: int, last: int) -> Vector:
    """Return the expected result of :func:`turn_back`."""
    turned = products * turn.conj()
    return np.concatenate((turned.imag[turned.size + first :], turned.real[: last + 1]))


def weighted_pearson_reference(signal_1: Vector, signal_2: Vector, lags: npt.NDArray[np.int64]) -> Vector:
    """Return the results expected of :func:`weighted_pearson` and :func:`sliding_pearson`, by the plain formula."""
    scores = [overlap_pearson(HeldRecording(signal_1), HeldRecording(signal_2), int(lag)) for lag in lags]
    weight = overlap_length(signal_1.size, signal_2.size, lags) / min(signal_1.size, signal_2.size)
    return np.asarray(np.nan_to_num(np.array(scores) * np.sqrt(weight)))


_FADED_SHARE = 0.03
_WHITENING_FLOOR = 1e-3

_LARGEST_KEPT = 2**20
"""Points of the longest right angle that is cached for the next call: 16 MB."""

_TRANSFORMS_KEPT = 16
"""Number of lengths for which SciPy caches the twiddle factors."""

_PRODUCTS_PER_CALL = 200_000_000
"""Products of the sliding sum between two progress reports: about 0.03 s."""


def fft_curve(signal_1: Vector, signal_2: Vector, first: int, last: int) -> Vector:
    """Return the weighted Pearson correlation at every lag, from one FFT and running sums."""
    curve = _lag_products(signal_1, signal_2, first, last, whiten=False)
    sums_1, sums_2 = running_sums(signal_1), running_sums(signal_2)
    sizes, flat = (signal_1.size, signal_2.size), (FLAT * sums_1[1, -1], FLAT * sums_2[1, -1])
    weighted_pearson(curve[-first:], 0, sizes, flat, (0, 0, 0), sums_1, sums_2, sums_2)
    # A negative lag is a positive one with the recordings swapped.
    weighted_pearson(curve[:-first][::-1], 1, sizes[::-1], flat[::-1], (0, 0, 0), sums_2, sums_1, sums_1)
    return curve


def phat_curve(signal_1: Vector, signal_2: Vector, first: int, last: int) -> Vector:
    """Return the phase correlation at every lag: the FFT's cross-spectrum with every magnitude set to 1.

    Whitening amplifies the weakest parts of a recording. Two of them are the same in every recording and would suggest
    a lag of 0: the two ends, whose sharp cuts are therefore faded, 3 % at each; and frequencies with nothing but
    rounding errors, so magnitudes below a thousandth of the mean are set to less than 1.

    C. Knapp and G. Carter, "The generalized correlation method for estimation of time delay", IEEE Trans. ASSP 24
    (1976), the PHAT processor.
    """
    return _lag_products(signal_1, signal_2, first, last, whiten=True)


def direct_curve(signal_1: Vector, signal_2: Vector, first: int, last: int, progress: Progress) -> Vector:
    """Return the curve of :func:`fft_curve`, every lag's products summed one by one, for any `first` and `last`."""
    curve = np.empty(last - first + 1)
    lags_per_call = max(1, _PRODUCTS_PER_CALL // min(signal_1.size, signal_2.size))
    for start in range(0, curve.size, lags_per_call):
        sliding_pearson(signal_1, signal_2, first + start, curve[start : start + lags_per_call])
        progress(min(start + lags_per_call, curve.size) / curve.size)
    return curve


SHORTEST_BLOCK = 2**16
"""Points of the smallest transform: shorter ones are no faster per sample."""

_BLOCKS_PER_REACH = 4
"""Length of a transform over the number of lags: all but one of this many parts of a block are new samples."""


def block_length(lags: int) -> int:
    """Return the length of the transforms for this many lags."""
    return int(fft.next_fast_len(max(SHORTEST_BLOCK, _BLOCKS_PER_REACH * lags), real=True))


def block_curve(
    signal_1: ConvertedRecording, signal_2: ConvertedRecording, first: int, last: int, progress: Progress = silent
) -> Vector:
    """Return the curve of :func:`fft_curve`, for any `first` and `last`, without converting a recording as a whole.

    Parameters
    ----------
    signal_1, signal_2
        Recordings of N1 and N2 samples.
    first, last
        ``-N1 < first <= last < N2``, samples.
    """
    curve = block_products(signal_1, signal_2, first, last, block_length(last - first + 1), progress)
    earlier = min(max(0, -first), curve.size)
    _weigh(curve[earlier:], first + earlier, signal_1, signal_2)
    _weigh(curve[:earlier][::-1], 1 - first - earlier, signal_2, signal_1)
    return curve


def _weigh(products: Vector, first: int, signal_1: ConvertedRecording, signal_2: ConvertedRecording) -> None:
    """Turn the products from the lag `first` ≥ 0 on into the weighted correlation, in place."""
    sizes, flat = (signal_1.size, signal_2.size), (FLAT * signal_1.energy, FLAT * signal_2.energy)
    for start in range(0, products.size, signal_2.piece):
        piece = products[start : start + signal_2.piece]
        low, high = first + start, first + start + piece.size - 1
        ends_1 = min(sizes[0], sizes[1] - high), min(sizes[0], sizes[1] - low)
        ends_2 = min(sizes[0] + low, sizes[1]), min(sizes[0] + high, sizes[1])
        sums = signal_1.running_sums(*ends_1), signal_2.running_sums(low, high), signal_2.running_sums(*ends_2)
        weighted_pearson(piece, low, sizes, flat, (ends_1[0], low, ends_2[0]), *sums)


def block_products(
    signal_1: Recording, signal_2: Recording, first: int, last: int, size: int, progress: Progress = silent
) -> Vector:
    """Return ``sum(signal_1[i] * signal_2[i + lag])`` for every lag from `first` to `last`, without wrap-around.

    Every block of signal 1 is multiplied by the part of signal 2 that the lags align with it. All blocks have the same
    position in their transforms, so their spectra are summed, and only the sum is transformed back. `size` is the
    length of the transforms, larger than the number of lags.
    """
    lags = last - first + 1
    step = size - lags + 1
    begin, stop = max(0, -last), min(signal_1.size, signal_2.size - first)
    total = np.zeros(size // 2 + 1, dtype=np.complex128)

    def spectrum(recording: Recording, start: int, stop: int) -> Spectrum:
        return np.asarray(fft.rfft(recording.part(start, stop), size))

    # SciPy's own workers share stacks of many transforms, not two.
    with ThreadPoolExecutor(2) as threads:
        for start in range(begin, stop, step):
            end = min(start + step, stop)
            parts = (start, start + first), (end, start + first + size)
            total += cross_spectrum(*threads.map(spectrum, (signal_1, signal_2), *parts))
            progress((end - begin) / (stop - begin))
    return np.asarray(fft.irfft(total, size, overwrite_x=True)[:lags])


def faded(signal: Vector, length: int | None = None) -> Vector:
    """Return a copy faded in from zero at its start and out to zero at its end, by raised cosines.

    Over so many samples each; None: 3 % of them.
    """
    faded = signal.copy()
    length = round(_FADED_SHARE * signal.size) if length is None else length
    rise = np.sin(0.5 * np.pi * (np.arange(length) + 0.5) / max(length, 1)) ** 2
    faded[:length] *= rise
    faded[signal.size - length :] *= rise[::-1]
    return faded


def _lag_products(signal_1: Vector, signal_2: Vector, first: int, last: int, *, whiten: bool) -> Vector:
    """Return ``sum(signal_1[i] * signal_2[i + lag])`` for every lag, without wrap-around.

    If `whiten` is set, the signals are faded first (see :func:`phat_curve`).

    Both signals are rotated in the complex plane, by a right angle over the length of the transform. A product that
    wraps around the end is then at a right angle to the others: it ends up in the imaginary part and belongs to a
    negative lag. So a complex transform of length N replaces a zero-padded real one of length 2 N, in about half the
    time (the "right-angle convolution" of negacyclic transforms).
    """
    size = transform_length(max(signal_1.size, signal_2.size))
    turned = np.empty((2, size), dtype=np.complex128)
    turn = _right_angle(size)
    for signal, row in zip((signal_1, signal_2), turned, strict=True):
        turn_forth(faded(signal) if whiten else signal, turn, row)
    # The transforms need the most memory, so arrays that are quick to recompute are freed first.
    del turn
    spectrum = cross_spectrum(*fft.fft(turned, axis=1, workers=2, overwrite_x=True))
    if whiten:
        _whiten(spectrum)
    products = fft.ifft(spectrum, overwrite_x=True)
    if size > _LARGEST_KEPT:
        _forget_transforms()
    return turn_back(products, _right_angle(size), first, last)


def _whiten(spectrum: Spectrum) -> None:
    """Set every magnitude to 1, or to less if it is below a thousandth of their mean, in place."""
    magnitude = np.abs(spectrum)
    spectrum /= magnitude + _WHITENING_FLOOR * magnitude.mean()


def _forget_transforms() -> None:
    """Replace the long transforms in SciPy's cache by short ones: it keeps 16 bytes per point of the last 16."""
    for length in range(2, 2 + _TRANSFORMS_KEPT):
        fft.fft(np.zeros(length, dtype=np.complex128))


def transform_length(size: int, *, real: bool = False) -> int:
    """Return the length of the transforms, of real numbers or of complex ones, for at most `size` samples."""
    # A length with many factors of two is up to a third faster than the shortest fast one.
    return 128 * int(fft.next_fast_len(-(-size // 128), real=real))


def _right_angle(size: int) -> Spectrum:
    """Return ``exp(-0.5j * pi * i / size)``; the last two are cached unless they are large."""
    return (_kept_right_angle if size <= _LARGEST_KEPT else _computed_right_angle)(size)


def _computed_right_angle(size: int) -> Spectrum:
    """Return ``exp(-0.5j * pi * i / size)``, as products of coarse and fine steps: exponentials are slow."""
    fine = int(np.sqrt(size)) + 1
    angle = -0.5j * np.pi / size
    steps = np.outer(np.exp(angle * fine * np.arange(-(-size // fine))), np.exp(angle * np.arange(fine)))
    turn = steps.ravel()[:size]
    turn.flags.writeable = False
    return turn


_kept_right_angle = lru_cache(maxsize=2)(_computed_right_angle)


Lags = npt.NDArray[np.int64]

EQUAL = 1e-9
"""Two correlations (-1..1) that differ by less are equal: FFT rounding is around 1e-15, noise far above."""

REACH = 32
"""Samples on either side used to interpolate a peak between two samples."""

_POSITIONS = 65
_KAISER = 6.0


def find_peak(curve: Vector, lags: Lags, overlap: Callable[[Lags], Lags]) -> tuple[int, int]:
    """Return the index of the best lag and the number of equally good lags (1 if it is alone).

    The best lag is the maximum of the weighted `curve`. Lags whose unweighted correlation equals its own within
    ``EQUAL`` tie with it if their overlap is at least half as long (shorter overlaps agree by chance); neighbours count
    once. Among ties the smallest ``|lag|`` wins, and of two opposite lags the positive one.

    Parameters
    ----------
    curve
        (N,) correlation times ``sqrt(overlap / longest overlap)``; exactly 0 where there was nothing to correlate.
    lags
        (N,) ascending; there may be gaps between them.
    overlap
        Returns the overlap at given lags, samples; the same number for all if the curve has no weights.
    """
    best = int(np.argmax(curve))
    if curve[best] <= 0:
        measured = np.where(curve == 0, -np.inf, curve)
        return (int(np.argmax(measured)) if np.isfinite(measured).any() else int(np.argmin(np.abs(lags)))), 1
    # Half the overlap weighs sqrt(1/2): nothing lower can tie, and few lags are higher.
    high = np.flatnonzero(curve >= (curve[best] - EQUAL) * np.sqrt(0.5))
    share = overlap(lags[high]) / overlap(lags[best : best + 1])
    # A shorter overlap that agrees even better does so by chance, and is not a tie either.
    tied = high[(np.abs(curve[high] / np.sqrt(share) - curve[best]) <= EQUAL) & (share >= 0.5)]
    tops = _tops(curve, lags, tied)
    nearest = tops[np.lexsort((-lags[tops], np.abs(lags[tops])))[0]]
    return int(nearest), int(tops.size)


def _tops(curve: Vector, lags: Lags, indices: Lags) -> Lags:
    """Return the highest of the `indices` of every run of adjacent lags."""
    values = curve[indices]
    starts = np.flatnonzero(np.diff(lags[indices], prepend=lags[indices[0]] - 2) > 1)
    highest = np.repeat(np.maximum.reduceat(values, starts), np.diff(starts, append=indices.size))
    tops = np.flatnonzero(values == highest)
    # A run may contain its highest value more than once: take the first one from the run's start on.
    return np.asarray(indices[tops[np.searchsorted(tops, starts)]])


def peak_ratio(curve: Vector, peak: int) -> float:
    """Return the height of the peak over the highest value outside its main lobe.

    On either side, the main lobe extends down to half the peak and on to the next minimum. Infinite if nothing outside
    is positive, NaN if there is nothing outside or the peak itself is not positive.
    """
    first, end = main_lobe(curve, peak)
    outside = [side.max() for side in (curve[:first], curve[end:]) if side.size]
    if not outside or curve[peak] <= 0:
        return float("nan")
    second = float(max(outside))
    return float(curve[peak]) / second if second > 0 else float("inf")


def around_peak(peak: int, size: int, reach: int = REACH) -> slice:
    """Return the part of a curve of `size` values around a peak that reaches equally far both ways, at most `reach`."""
    near = min(reach, peak, size - 1 - peak)
    return slice(peak - near, peak + near + 1)


def interpolate_peak(window: Vector) -> tuple[float, float]:
    """Return position (relative to the middle of `window`, -0.5..0.5) and height of a band-limited curve's peak.

    A parabola through three samples is off by up to 0.1 sample where the curve is as sharp as sampling allows (white
    or whitened recordings), so the curve is interpolated with a Kaiser-windowed sinc.
    A peak on the border of the searched lags has no neighbours (reach 0): the offset is 0.

    Parameters
    ----------
    window
        (2 * reach + 1,) values around the peak. With a reach of ``REACH`` the error is 0.01 sample at most, and less
        than 0.001 if the curve contains nothing above 0.95 of the Nyquist frequency.
    """
    reach = window.size // 2
    if reach == 0:
        return 0.0, float(window[0])
    fine = _interpolation(reach) @ window
    top = int(np.clip(np.argmax(fine), 1, fine.size - 2))
    left, middle, right = fine[top - 1 : top + 2]
    bend = left - 2 * middle + right
    step = 0.5 * (left - right) / bend if bend < 0 else 0.0
    return float(np.clip(-0.5 + (top + step) / (fine.size - 1), -0.5, 0.5)), float(fine.max())


_FINER = 8
_MARGIN = 64


def best_cycle(curve: npt.NDArray[np.floating[Any]], peak: int, reach: int) -> int:
    """Return the index next to the highest point, between the samples, of a curve up to `reach` from an index.

    With few samples a cycle, the highest sample can belong to the next cycle.
    """
    low = max(0, peak - reach - _MARGIN)
    part = curve[low : peak + reach + _MARGIN + 1].astype(np.float64)
    # Continued and faded out at both ends: an edge would ring.
    part = faded(np.pad(part, _MARGIN, mode="edge"), _MARGIN)
    points = int(fft.next_fast_len(part.size))
    spectrum = fft.rfft(part, points)
    fine = fft.irfft(np.pad(spectrum, (0, _FINER * points // 2 + 1 - spectrum.size)), _FINER * points)
    begin = max(low, peak - reach)
    first, last = (_FINER * (place - low + _MARGIN) for place in (begin, min(curve.size - 1, peak + reach)))
    return begin + round(int(np.argmax(fine[first : last + 1])) / _FINER)


@lru_cache(maxsize=REACH)
def _interpolation(reach: int) -> Vector:
    """Return (positions, 2 * reach + 1) weights that interpolate a band-limited curve at positions from -0.5 to 0.5."""
    positions = np.linspace(-0.5, 0.5, _POSITIONS)
    distance = positions[:, np.newaxis] - np.arange(-reach, reach + 1)
    taper = np.i0(_KAISER * np.sqrt(1 - (distance / (reach + 1)) ** 2)) / np.i0(_KAISER)
    weights = np.sinc(distance) * taper
    weights.flags.writeable = False
    return np.asarray(weights)


@compiled
def main_lobe(curve: npt.NDArray[np.float64], peak: int) -> tuple[int, int]:
    """Return the first index of the main lobe around `peak` and the index after its last.

    On either side, the lobe extends down to half the peak and on to the next minimum.
    """
    first, last = peak, peak
    while first > 0 and (curve[first] >= curve[peak] / 2 or curve[first - 1] <= curve[first]):
        first -= 1
    while last < curve.size - 1 and (curve[last] >= curve[peak] / 2 or curve[last + 1] <= curve[last]):
        last += 1
    return first, last + 1
