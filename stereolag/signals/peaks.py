"""The peak of a curve over the lag: its position between the samples, its ties, and the extent of its main lobe."""

from __future__ import annotations

from collections.abc import Callable
from functools import lru_cache

import numpy as np
from scipy import fft

from stereolag.core.arrays import Array, Indices, Vector
from stereolag.loops.compilation import compiled
from stereolag.signals.correlation import Lags, faded

EQUAL = 1e-9
"""Correlations (-1..1) that differ by less are equal: FFT rounding is around 1e-15, noise far above."""

REACH = 32
"""Samples on either side used to interpolate a peak between two samples."""

_KAISER = 6.0
"""Shape parameter of the window."""


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


def _tops(curve: Vector, lags: Lags, indices: Indices) -> Indices:
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


def interpolate_peak(curve: Array, peak: int, reach: int = REACH) -> tuple[float, float]:
    """Return position (relative to the index `peak`, -0.5..0.5) and height of a band-limited curve's peak.

    A parabola through three samples is off by up to 0.1 sample where the curve is as sharp as sampling allows (white
    or whitened recordings), so the curve is interpolated with a Kaiser-windowed sinc.
    A peak on the border of the searched lags has no neighbours (reach 0): the offset is 0.

    Parameters
    ----------
    curve
        (N,) values, of which `reach` on either side are used, fewer near an end.
    peak
        Index of the highest value.
    reach
        With ``REACH`` the error is 0.01 sample at most, and less than 0.001 if the curve contains nothing above 0.95 of
        the Nyquist frequency.
    """
    reach = min(reach, peak, curve.size - 1 - peak)
    if reach == 0:
        return 0.0, float(curve[peak])
    fine = _interpolation(reach) @ curve[peak - reach : peak + reach + 1].astype(np.float64)
    top = min(max(int(np.argmax(fine)), 1), fine.size - 2)
    left, middle, right = fine[top - 1 : top + 2].tolist()
    bend = left - 2 * middle + right
    step = 0.5 * (left - right) / bend if bend < 0 else 0.0
    return min(max(-0.5 + (top + step) / (fine.size - 1), -0.5), 0.5), float(fine.max())


_OVERSAMPLING = 8
"""Positions per sample of the interpolated curve."""

_MARGIN = 64
"""Samples on either side that are interpolated too, and samples over which the curve is continued and faded out."""


def best_cycle(curve: Array, peak: int, reach: int) -> int:
    """Return the index nearest to the highest point of the interpolated curve, up to `reach` from `peak`.

    With few samples a cycle, the highest sample can belong to the next cycle.
    """
    low = max(0, peak - reach - _MARGIN)
    part = curve[low : peak + reach + _MARGIN + 1].astype(np.float64)
    # Continued and faded out at both ends, since an edge would ring.
    part = faded(np.pad(part, _MARGIN, mode="edge"), _MARGIN)
    points = int(fft.next_fast_len(part.size))
    fine = fft.irfft(fft.rfft(part, points), _OVERSAMPLING * points)
    begin = max(low, peak - reach)
    first, last = (_OVERSAMPLING * (place - low + _MARGIN) for place in (begin, min(curve.size - 1, peak + reach)))
    return begin + round(int(np.argmax(fine[first : last + 1])) / _OVERSAMPLING)


@lru_cache(maxsize=REACH)
def _interpolation(reach: int) -> Vector:
    """Return (65, 2 * reach + 1) weights that interpolate a band-limited curve at 65 positions from -0.5 to 0.5."""
    distance = np.linspace(-0.5, 0.5, 65)[:, np.newaxis] - np.arange(-reach, reach + 1)
    taper = np.i0(_KAISER * np.sqrt(1 - (distance / (reach + 1)) ** 2)) / np.i0(_KAISER)
    weights = np.sinc(distance) * taper
    weights.flags.writeable = False
    return np.asarray(weights)


@compiled
def main_lobe(curve: Vector, peak: int) -> tuple[int, int]:
    """Return the first index of the main lobe around `peak` and the index after its last.

    On either side, the lobe extends down to half the peak and on to the next minimum.
    """
    first, last = peak, peak
    while first > 0 and (curve[first] >= curve[peak] / 2 or curve[first - 1] <= curve[first]):
        first -= 1
    while last < curve.size - 1 and (curve[last] >= curve[peak] / 2 or curve[last + 1] <= curve[last]):
        last += 1
    return first, last + 1
