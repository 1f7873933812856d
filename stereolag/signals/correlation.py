"""Correlation of two recordings over the lag: Pearson's formula over the overlap, and the curves.

At lag ``l``, sample ``i`` of signal 1 is paired with sample ``i + l`` of signal 2; the paired samples are the overlap.
The curves take zero-mean float64 vectors and have one value for each lag from ``first`` (≤ 0) to ``last`` (≥ 0).

A recording that is too long for one transform is read part by part (:class:`.ConvertedRecording`) and correlated in
blocks (overlap-save); W. Press et al., "Numerical Recipes", 3rd ed. (2007), section 13.1.
"""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor
from functools import lru_cache

import numpy as np
import numpy.typing as npt
from scipy import fft

from stereolag.core.arrays import DoubleMap, Vector
from stereolag.core.jobs import Progress, silent
from stereolag.loops.compilation import compiled
from stereolag.signals.recordings import ConvertedRecording, HeldRecording, Recording, dot, running_sums

Spectrum = npt.NDArray[np.complex128]
Lags = npt.NDArray[np.int64]

FLAT = 1e-10
"""An overlap with less than this share of a recording's energy is flat: rounding would decide its correlation."""

_STEPS_PER_STRETCH = 8
"""Steps per length of a stretch by which the loudest one is searched for."""


def overlap_length(size_1: int, size_2: int, lags: npt.NDArray[np.integer]) -> Lags:
    """Return the number of samples that overlap at each of the `lags`."""
    return np.asarray(np.minimum(size_1, size_2 - lags) - np.maximum(0, -lags))


def overlap_slices(size_1: int, size_2: int, lag: int) -> tuple[slice, slice]:
    """Return the parts of signal 1 and of signal 2 that overlap at `lag`."""
    start, stop = max(0, -lag), min(size_1, size_2 - lag)
    return slice(start, stop), slice(start + lag, stop + lag)


def loudest_stretch(signal_1: Recording, signal_2: Recording, lag: int, longest: int) -> tuple[slice, slice]:
    """Return the parts of both, at most `longest` samples, that are loudest together at `lag`."""
    part, _ = overlap_slices(signal_1.size, signal_2.size, lag)
    start, size = part.start, part.stop - part.start
    if size > longest:
        step = longest // _STEPS_PER_STRETCH
        energies = []
        for first in range(part.start, part.stop, step):
            stop = min(first + step, part.stop)
            energies.append(np.sum((signal_1.part(first, stop) * signal_2.part(first + lag, stop + lag)) ** 2))
        loudest = int(np.argmax(np.convolve(energies, np.ones(_STEPS_PER_STRETCH), mode="valid")))
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
        square_1 += dot(first, first)
        square_2 += dot(second, second)
        product += dot(first, second)
    if square_1 <= FLAT * signal_1.energy or square_2 <= FLAT * signal_2.energy:
        return float("nan")
    return float(np.clip(product / np.sqrt(square_1 * square_2), -1.0, 1.0))


@compiled
def rotate(signal: Vector, rotation: Spectrum, rotated: Spectrum) -> None:
    """Fill `rotated` (N,) with ``signal * rotation``, and with zeros after the end of the signal."""
    for i in range(signal.size):
        rotated[i] = complex(signal[i] * rotation[i].real, signal[i] * rotation[i].imag)
    for at in range(signal.size, rotated.size):
        rotated[at] = 0


@compiled
def cross_spectrum(spectrum_1: Spectrum, spectrum_2: Spectrum) -> Spectrum:
    """Return ``conj(spectrum_1) * spectrum_2``, in the memory of the first."""
    for i in range(spectrum_1.size):
        first, second = spectrum_1[i], spectrum_2[i]
        spectrum_1[i] = complex(
            first.real * second.real + first.imag * second.imag, first.real * second.imag - first.imag * second.real
        )
    return spectrum_1


@compiled
def rotate_back(products: Spectrum, rotation: Spectrum, first: int, last: int) -> Vector:
    """Return lags `first` (≤ 0) to `last` (≥ 0) of ``products * conj(rotation)``: negative lags are the imaginary part.

    Parameters
    ----------
    products, rotation
        (N,) complex128; lag ``l`` is at index ``l``, and a negative one at ``N + l``.
    """
    curve = np.empty(last - first + 1)
    for lag in range(last + 1):
        curve[lag - first] = products[lag].real * rotation[lag].real + products[lag].imag * rotation[lag].imag
    wrapped = products.size + first
    for i in range(-first):
        product, angle = products[wrapped + i], rotation[wrapped + i]
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
    flat_1, flat_2 = FLAT * dot(signal_1, signal_1), FLAT * dot(signal_2, signal_2)
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


def rotate_reference(signal: Vector, rotation: Spectrum) -> Spectrum:
    """Return the expected result of :func:`rotate`."""
    return np.asarray(np.pad(signal, (0, rotation.size - signal.size)) * rotation)


def cross_spectrum_reference(spectrum_1: Spectrum, spectrum_2: Spectrum) -> Spectrum:
    """Return the expected result of :func:`cross_spectrum`."""
    return np.asarray(spectrum_1.conj() * spectrum_2)


def rotate_back_reference(products: Spectrum, rotation: Spectrum, first: int, last: int) -> Vector:
    """Return the expected result of :func:`rotate_back`."""
    rotated = products * rotation.conj()
    return np.concatenate((rotated.imag[rotated.size + first :], rotated.real[: last + 1]))


def weighted_pearson_reference(signal_1: Vector, signal_2: Vector, lags: Lags) -> Vector:
    """Return the results expected of :func:`weighted_pearson` and :func:`sliding_pearson`, by the plain formula."""
    scores = [overlap_pearson(HeldRecording(signal_1), HeldRecording(signal_2), int(lag)) for lag in lags]
    weight = overlap_length(signal_1.size, signal_2.size, lags) / min(signal_1.size, signal_2.size)
    return np.asarray(np.nan_to_num(np.array(scores) * np.sqrt(weight)))


_MAX_CACHED_POINTS = 2**20
"""Points of the longest right angle that is cached for the next call: 16 MB."""

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
"""Length of a transform over the number of lags: in every block, all but one part of this many are new samples."""


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
    curve = _block_products(signal_1, signal_2, first, last, progress)
    earlier = min(max(0, -first), curve.size)
    _weight_products(curve[earlier:], first + earlier, signal_1, signal_2)
    _weight_products(curve[:earlier][::-1], 1 - first - earlier, signal_2, signal_1)
    return curve


def _weight_products(products: Vector, first: int, signal_1: ConvertedRecording, signal_2: ConvertedRecording) -> None:
    """Turn the products from the lag `first` ≥ 0 on into the weighted correlation, in place."""
    sizes, flat = (signal_1.size, signal_2.size), (FLAT * signal_1.energy, FLAT * signal_2.energy)
    for start in range(0, products.size, signal_2.piece):
        piece = products[start : start + signal_2.piece]
        low, high = first + start, first + start + piece.size - 1
        ends_1 = min(sizes[0], sizes[1] - high), min(sizes[0], sizes[1] - low)
        ends_2 = min(sizes[0] + low, sizes[1]), min(sizes[0] + high, sizes[1])
        sums = signal_1.running_sums(*ends_1), signal_2.running_sums(low, high), signal_2.running_sums(*ends_2)
        weighted_pearson(piece, low, sizes, flat, (ends_1[0], low, ends_2[0]), *sums)


def _block_products(signal_1: Recording, signal_2: Recording, first: int, last: int, progress: Progress) -> Vector:
    """Return ``sum(signal_1[i] * signal_2[i + lag])`` for every lag from `first` to `last`, without wrap-around.

    Every block of signal 1 is multiplied by the part of signal 2 that the lags align with it. All blocks have the same
    position in their transforms, so their spectra are summed, and only the sum is transformed back.
    """
    lags = last - first + 1
    size = block_length(lags)
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

    Over `length` samples each; None: 3 % of them.
    """
    faded = signal.copy()
    length = round(0.03 * signal.size) if length is None else length
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
    rotated = np.empty((2, size), dtype=np.complex128)
    right_angle = _right_angle if size <= _MAX_CACHED_POINTS else _right_angle.__wrapped__  # without the cache
    rotation = right_angle(size)
    for signal, row in zip((signal_1, signal_2), rotated, strict=True):
        rotate(faded(signal) if whiten else signal, rotation, row)
    # The transforms need the most memory, so arrays that are quick to recompute are freed first.
    del rotation
    spectrum = cross_spectrum(*fft.fft(rotated, axis=1, workers=2, overwrite_x=True))
    if whiten:
        magnitude = np.abs(spectrum)
        spectrum /= magnitude + 1e-3 * magnitude.mean()
    products = fft.ifft(spectrum, overwrite_x=True)
    if size > _MAX_CACHED_POINTS:
        _forget_transforms()
    return rotate_back(products, right_angle(size), first, last)


def _forget_transforms() -> None:
    """Replace the long transforms in SciPy's cache by short ones: it keeps 16 bytes per point of the last 16."""
    for length in range(2, 18):
        fft.fft(np.zeros(length, dtype=np.complex128))


def transform_length(size: int, *, real: bool = False) -> int:
    """Return the length of the transforms, of real numbers or of complex ones, for at most `size` samples."""
    # A length with many factors of two is up to a third faster than the shortest fast one.
    return 128 * int(fft.next_fast_len(-(-size // 128), real=real))


@lru_cache(maxsize=2)
def _right_angle(size: int) -> Spectrum:
    """Return ``exp(-0.5j * pi * i / size)``, as products of coarse and fine steps: exponentials are slow."""
    fine = int(np.sqrt(size)) + 1
    angle = -0.5j * np.pi / size
    steps = np.outer(np.exp(angle * fine * np.arange(-(-size // fine))), np.exp(angle * np.arange(fine)))
    rotation = steps.ravel()[:size]
    rotation.flags.writeable = False
    return rotation
