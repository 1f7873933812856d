"""Pearson's correlation over the overlap of two recordings: the plain formula, and the loops over every lag.

At lag ``l``, sample ``i`` of signal 1 is paired with sample ``i + l`` of signal 2; the paired samples are the overlap.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from stereolag.core.arrays import Vector
from stereolag.loops.compilation import compiled

Spectrum = npt.NDArray[np.complex128]

FLAT = 1e-10
"""An overlap with less than this share of a recording's energy is flat: rounding would decide its correlation."""


def overlap_length(size_1: int, size_2: int, lags: npt.NDArray[np.int64]) -> npt.NDArray[np.int64]:
    """Return the number of samples that overlap at each of the `lags`."""
    return np.asarray(np.minimum(size_1, size_2 - lags) - np.maximum(0, -lags))


def overlap_slices(size_1: int, size_2: int, lag: int) -> tuple[slice, slice]:
    """Return the parts of signal 1 and of signal 2 that overlap at `lag`."""
    start, stop = max(0, -lag), min(size_1, size_2 - lag)
    return slice(start, stop), slice(start + lag, stop + lag)


def overlap_pearson(signal_1: Vector, signal_2: Vector, lag: int) -> float:
    """Return Pearson's correlation of the overlap at `lag`, -1..1; NaN where either part is flat.

    Parameters
    ----------
    signal_1, signal_2
        (N1,) and (N2,) float64, each with zero mean.
    lag
        Samples, ``-N1 < lag < N2``.
    """
    part_1, part_2 = overlap_slices(signal_1.size, signal_2.size, lag)
    first = signal_1[part_1] - signal_1[part_1].mean()
    second = signal_2[part_2] - signal_2[part_2].mean()
    energy_1, energy_2 = _dot(first, first), _dot(second, second)
    if energy_1 <= FLAT * _dot(signal_1, signal_1) or energy_2 <= FLAT * _dot(signal_2, signal_2):
        return float("nan")
    return float(np.clip(_dot(first, second) / np.sqrt(energy_1 * energy_2), -1.0, 1.0))


@compiled(fastmath={"reassoc", "contract"})
def _dot(first: Vector, second: Vector) -> float:
    # NumPy runs a long dot product on all BLAS threads, which takes 100 times as long on a busy machine.
    total = 0.0
    for i in range(first.size):
        total += first[i] * second[i]
    return total


@compiled
def running_sums(signal: Vector) -> tuple[Vector, Vector]:
    """Return the sums and the sums of squares of the first 0, 1, … N samples, each (N + 1,)."""
    sums = np.empty(signal.size + 1)
    squares = np.empty(signal.size + 1)
    total, energy = 0.0, 0.0
    sums[0] = squares[0] = 0.0
    for i in range(signal.size):
        total += signal[i]
        energy += signal[i] * signal[i]
        sums[i + 1] = total
        squares[i + 1] = energy
    return sums, squares


@compiled
def turn_forth(signal: Vector, turn: Spectrum, turned: Spectrum) -> None:
    """Fill `turned` (N,) with ``signal * turn``, and with zeros after the end of the signal."""
    for i in range(signal.size):
        turned[i] = complex(signal[i] * turn[i].real, signal[i] * turn[i].imag)
    turned[signal.size :] = 0


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
    products: Vector, first_lag: int, sums_1: Vector, squares_1: Vector, sums_2: Vector, squares_2: Vector
) -> None:
    """Turn products into Pearson's correlation times ``sqrt(overlap / longest overlap)``, in place; 0 where flat.

    Parameters
    ----------
    products
        (lags,) ``sum(signal_1[i] * signal_2[i + lag])`` over the overlap, for `first_lag` ≥ 0 and the lags after it.
    sums_1, squares_1, sums_2, squares_2
        The :func:`running_sums` of both signals.
    """
    size_1, size_2 = sums_1.size - 1, sums_2.size - 1
    longest = min(size_1, size_2)
    flat_1, flat_2 = FLAT * squares_1[size_1], FLAT * squares_2[size_2]
    for index in range(products.size):
        lag = first_lag + index
        stop = min(size_1, size_2 - lag)
        overlap = float(stop)
        sum_1, sum_2 = sums_1[stop], sums_2[stop + lag] - sums_2[lag]
        # Everything is multiplied by the overlap to save divisions, which would dominate the loop.
        energy_1 = overlap * squares_1[stop] - sum_1 * sum_1
        energy_2 = overlap * (squares_2[stop + lag] - squares_2[lag]) - sum_2 * sum_2
        value = (overlap * products[index] - sum_1 * sum_2) * np.sqrt(overlap / (longest * energy_1 * energy_2))
        varies = (energy_1 > overlap * flat_1) & (energy_2 > overlap * flat_2)
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


def running_sums_reference(signal: Vector) -> tuple[Vector, Vector]:
    """Return the expected result of :func:`running_sums`, by plain NumPy."""
    return np.append(0.0, np.cumsum(signal)), np.append(0.0, np.cumsum(signal**2))


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
    """Return the results expected of :func:`weighted_pearson` and :func:`sliding_pearson`, by the plain formula.

    The same results are expected of :func:`stereolag.signals.blocks.weigh_overlaps`.
    """
    scores = np.array([overlap_pearson(signal_1, signal_2, int(lag)) for lag in lags])
    weight = overlap_length(signal_1.size, signal_2.size, lags) / min(signal_1.size, signal_2.size)
    return np.asarray(np.nan_to_num(scores * np.sqrt(weight)))
