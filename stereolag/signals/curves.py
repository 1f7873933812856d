"""Correlation of two recordings as a function of their lag: by FFT, whitened (GCC-PHAT), and summed lag by lag.

All take zero-mean float64 vectors and return one value for each lag from ``first`` (≤ 0) to ``last`` (≥ 0).
"""

from __future__ import annotations

from functools import lru_cache

import numpy as np
from scipy import fft

from stereolag.core.arrays import Vector
from stereolag.core.jobs import Progress
from stereolag.signals.overlaps import (
    Spectrum,
    cross_spectrum,
    running_sums,
    sliding_pearson,
    turn_back,
    turn_forth,
    weighted_pearson,
)

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
    weighted_pearson(curve[-first:], 0, *sums_1, *sums_2)
    # A negative lag is a positive one with the recordings swapped.
    weighted_pearson(curve[:-first][::-1], 1, *sums_2, *sums_1)
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


def _faded(signal: Vector) -> Vector:
    """Return a copy faded in from zero at its start and out to zero at its end, by raised cosines."""
    faded = signal.copy()
    length = round(_FADED_SHARE * signal.size)
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
        turn_forth(_faded(signal) if whiten else signal, turn, row)
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


def transform_length(size: int) -> int:
    """Return the length of the transforms for recordings of at most `size` samples."""
    # A length with many factors of two is a tenth faster than the shortest fast one.
    return 128 * int(fft.next_fast_len(-(-size // 128)))


def _right_angle(size: int) -> Spectrum:
    """Return ``exp(-0.5j * pi * i / size)``; the last two are cached unless they are large."""
    return _kept_right_angle(size) if size <= _LARGEST_KEPT else _computed_right_angle(size)


@lru_cache(maxsize=2)
def _kept_right_angle(size: int) -> Spectrum:
    return _computed_right_angle(size)


def _computed_right_angle(size: int) -> Spectrum:
    """Return ``exp(-0.5j * pi * i / size)``, as products of coarse and fine steps: exponentials are slow."""
    fine = int(np.sqrt(size)) + 1
    angle = -0.5j * np.pi / size
    steps = np.outer(np.exp(angle * fine * np.arange(-(-size // fine))), np.exp(angle * np.arange(fine)))
    turn = steps.ravel()[:size]
    turn.flags.writeable = False
    return turn
