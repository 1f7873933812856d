"""Search over every lag of long recordings: in narrow bands of frequency, then sample by sample at the best places.

Correlating two hours in one transform takes many gigabytes. Bands take little: each is correlated at a fraction of
the sampling rate, the strongest first, and the sum of their magnitudes is an upper bound of the correlation at all
lags. When no other place can be as high as the best, the best and its possible rivals are correlated sample by sample
(:func:`stereolag.signals.blocks.block_curve`).
"""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor
from threading import Lock

import numpy as np

from stereolag.core.arrays import DoubleMap, FloatMap, Vector
from stereolag.core.jobs import Progress
from stereolag.signals.blocks import CentredRecording, block_curve
from stereolag.signals.finding import Found
from stereolag.signals.overlaps import FLAT, overlap_length
from stereolag.signals.peaks import REACH, Lags, find_peak, main_lobe, refine_peak
from stereolag.signals.subbands import Bands, band_energies, band_products, band_signals

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


def search_bands(signal_1: CentredRecording, signal_2: CentredRecording, reach: int, progress: Progress) -> Found:
    """Return the result of :func:`stereolag.signals.finding.search_whole` with "fft", its curve reduced.

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
) -> Found:
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
    return Found(
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
