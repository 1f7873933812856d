"""Agreement of two recordings at a lag in excess of chance, whatever they sound like.

Rumbling recordings agree by chance over long stretches, loud events by chance in a few samples. Both effects are
removed: the recordings are whitened, and their agreement is measured in its own standard deviations, sample by sample.
Long recordings (:class:`LongPair`) are read piece by piece and never whitened as a whole.
"""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from dataclasses import dataclass
from functools import cached_property
from typing import Protocol

import numpy as np
import numpy.typing as npt
from scipy import fft, linalg

from stereolag.core.arrays import Vector
from stereolag.loops.compilation import compiled
from stereolag.signals.correlation import overlap_pearson, overlap_slices
from stereolag.signals.search import CentredRecording, block_pearson

_ORDER = 16
_FLOOR = 1e-4
"""White noise added to the autocorrelation, 40 dB below the recording, so that a tone leaves something."""

LONGEST_LOUD = 2**17
"""Samples used for the autocorrelations: the loudest stretch of each recording."""

_RUNS, LONGEST_RUN = 64, 1024
"""Number of runs into which the samples carrying an agreement are divided, and length of the longest, samples."""

STEPS = 8
"""The loudest stretch starts at a multiple of its length over this number."""

_FEW_LAGS = 32
"""Below this number of lags, sums of products are faster than transforms."""

_MEMORY = 256
"""Lags over which whitened recordings may still be autocorrelated."""


@dataclass(frozen=True)
class Agreement:
    """The agreement of two recordings at a lag.

    Attributes
    ----------
    lag
        Samples.
    score
        Pearson's correlation of the whitened recordings there, -1..1.
    height
        Agreement in standard deviations of chance.
    reachable
        Height if all of these samples agreed: the root of the number that carry the agreement.
    """

    lag: int
    score: float
    height: float
    reachable: float


class Pair(ABC):
    """Two recordings, original and whitened, and their agreement at a lag."""

    sizes: tuple[int, int]

    @abstractmethod
    def agreement(self, lag: int) -> Agreement:
        """Return the agreement of the whitened recordings at exactly `lag`."""

    @abstractmethod
    def pearson(self, lag: int) -> float:
        """Return Pearson's correlation of the original recordings where they overlap, -1..1; NaN where flat."""

    @abstractmethod
    def loudest(self, lag: int, longest: int, *, white: bool = True) -> tuple[Vector, Vector]:
        """Return the parts of both recordings that are loudest together at `lag`, at most `longest` samples."""

    @abstractmethod
    def blocks(self, lag: int, starts: npt.NDArray[np.int64], length: int, margin: int) -> tuple[Vector, Vector]:
        """Return blocks of the whitened overlap at `lag`, (blocks, length), with a margin in the second recording.

        The blocks of the second are (blocks, length + 2 * margin), zero beyond the overlap; `starts` count from the
        start of the overlap.
        """

    def best_agreement(self, lag: int, within: int = 1) -> Agreement:
        """Return the best agreement up to `within` samples from `lag`."""
        last, first = self.sizes[1] - 1, 1 - self.sizes[0]
        near = range(max(first, lag - within), min(last, lag + within) + 1)
        return max((self.agreement(each) for each in near), key=lambda one: one.height)


class WhitePair(Pair):
    """Two recordings whitened by one common filter, so that their lag is unchanged.

    The filter predicts each sample from the 16 before it (linear prediction by the autocorrelation method; J. Makhoul,
    "Linear prediction: a tutorial review", Proc. IEEE 63 (1975)) and leaves the part that could not be predicted.
    """

    def __init__(self, signal_1: Vector, signal_2: Vector) -> None:
        self.sizes = signal_1.size, signal_2.size
        self.raw = signal_1, signal_2

    @cached_property
    def white(self) -> tuple[Vector, Vector]:
        """Both recordings, whitened on first access."""
        taps = whitening_taps(_loudest(self.raw[0]), _loudest(self.raw[1]), min(self.sizes))
        return _filtered(self.raw[0], taps), _filtered(self.raw[1], taps)

    @cached_property
    def colour(self) -> float:
        """Standard deviation of chance agreement, relative to that of white recordings."""
        return common_colour(_loudest(self.white[0]), _loudest(self.white[1]))

    def overlap(self, lag: int) -> tuple[Vector, Vector]:
        """Return the parts of the whitened recordings that overlap at `lag`."""
        part_1, part_2 = overlap_slices(*self.sizes, lag)
        return self.white[0][part_1], self.white[1][part_2]

    def agreement(self, lag: int) -> Agreement:
        """Return the agreement of the whitened recordings at exactly `lag`."""
        first, second = self.overlap(lag)
        energy = math.sqrt(float(np.einsum("i,i", first, first)) * float(np.einsum("i,i", second, second)))
        products = first * second
        total, deviation = float(products.sum()), math.sqrt(float(np.einsum("i,i", products, products)))
        if not (energy > 0 and deviation > 0):
            return Agreement(lag, 0.0, 0.0, 0.0)
        carried = float(np.abs(products).sum())
        together = run_length(carried, deviation)
        if together > 1:
            sums = np.add.reduceat(products, np.arange(0, products.size, together))
            deviation = max(deviation, math.sqrt(float(sums @ sums - total**2 / sums.size)))
        deviation *= self.colour
        return Agreement(lag, total / energy, total / deviation, carried / deviation)

    def pearson(self, lag: int) -> float:
        """Return Pearson's correlation of the original recordings, -1..1; NaN where flat."""
        return overlap_pearson(*self.raw, lag)

    def loudest(self, lag: int, longest: int, *, white: bool = True) -> tuple[Vector, Vector]:
        """Return the parts of both recordings that are loudest together."""
        part_1, part_2 = overlap_slices(*self.sizes, lag)
        one, other = self.white if white else self.raw
        one, other = one[part_1], other[part_2]
        part = loudest_stretch(one, other, longest)
        return one[part], other[part]

    def blocks(self, lag: int, starts: npt.NDArray[np.int64], length: int, margin: int) -> tuple[Vector, Vector]:
        """Return blocks of the overlap."""
        first, second = self.overlap(lag)
        padded = np.pad(second, margin)
        return (
            np.stack([first[start : start + length] for start in starts]),
            np.stack([padded[start : start + length + 2 * margin] for start in starts]),
        )


def whitening_taps(loud_1: Vector, loud_2: Vector, shortest: int) -> Vector:
    """Return the common filter of both recordings, from a loud stretch of each and the length of the shorter."""
    mean = (autocorrelation(loud_1, _ORDER) + autocorrelation(loud_2, _ORDER)) / 2
    order = min(_ORDER, shortest // 8)
    mean[0] *= 1 + _FLOOR
    return np.append(1.0, -linalg.solve_toeplitz(mean[:order], mean[1 : order + 1]) if order else [])


def common_colour(loud_1: Vector, loud_2: Vector) -> float:
    """Return the factor by which residual colour in both recordings widens chance agreement (Bartlett).

    `loud_1` and `loud_2` are loud stretches of the whitened recordings.
    """
    one, other = autocorrelation(loud_1, _MEMORY), autocorrelation(loud_2, _MEMORY)
    return math.sqrt(max(1.0, 1 + 2 * float(one[1:] @ other[1:])))


def run_length(carried: float, deviation: float) -> int:
    """Return how many samples count as one: a note that both happen to share agrees over hundreds at once.

    Parameters
    ----------
    carried, deviation
        Sum of the products' magnitudes, and root of the sum of their squares.
    """
    return int(min(LONGEST_RUN, (carried / deviation) ** 2 / _RUNS))


def local_curve(first: Vector, second: Vector, reach: int) -> Vector:
    """Return the mean product of two equally long parts at lags ``-reach..reach``, relative to perfect agreement.

    Parameters
    ----------
    first, second
        (N,) float64.
    reach
        Samples, less than N.
    """
    size = int(fft.next_fast_len(first.size + reach, real=True))
    products = fft.irfft(np.conj(fft.rfft(first, size)) * fft.rfft(second, size), size)
    lags = np.arange(-reach, reach + 1)
    energy = math.sqrt(float(first @ first) * float(second @ second)) or 1.0
    return np.asarray(products[lags] / energy * first.size / (first.size - np.abs(lags)))


def loudest_stretch(first: Vector, second: Vector, longest: int) -> slice:
    """Return the `longest` samples in which both are loudest together, or everything if there are no more."""
    if first.size <= longest:
        return slice(0, first.size)
    step = longest // STEPS
    energy = np.add.reduceat((first * second) ** 2, np.arange(0, first.size, step))
    start = loudest_start(energy, first.size, longest)
    return slice(start, start + longest)


def loudest_start(energy: Vector, size: int, longest: int) -> int:
    """Return the start of the loudest stretch, given the energy of each eighth of its length."""
    start = longest // STEPS * int(np.argmax(np.convolve(energy, np.ones(STEPS), mode="valid")))
    return min(start, size - longest)


def _loudest(given: Vector) -> Vector:
    return given[loudest_stretch(given, given, LONGEST_LOUD)]


def _filtered(given: Vector, taps: npt.NDArray[np.float64]) -> Vector:
    filtered = np.convolve(given, taps)[: given.size]
    # The first samples have no predecessors to be predicted from: their jump is not sound.
    filtered[: taps.size - 1] = 0.0
    return np.asarray(filtered - filtered.mean())


def autocorrelation(given: Vector, reach: int) -> Vector:
    """Return Pearson's autocorrelation at lags 0 to `reach`, 0 beyond the recording."""
    if reach < _FEW_LAGS:
        few = range(min(reach + 1, given.size))
        products = [float(np.einsum("i,i", given[: given.size - lag], given[lag:])) for lag in few]
        return _relative(np.pad(products, (0, reach + 1 - len(few))))
    size = int(fft.next_fast_len(given.size + reach, real=True))
    spectrum = fft.rfft(given, size)
    return _relative(fft.irfft(spectrum.real**2 + spectrum.imag**2, size)[: reach + 1])


def _relative(found: Vector) -> Vector:
    """Return the values divided by the first of them, zeros if that is zero."""
    return np.asarray(found / found[0]) if found[0] > 0 else np.zeros_like(found)


_PIECE = 2**16
"""Samples read at a time: a multiple of the longest run."""

_TILE = 2**11
"""Samples filtered at a time: few enough to stay in the L1 cache."""


class _Readable(Protocol):
    size: int

    def fill(self, row: Vector, start: int) -> None: ...


class _WhiteRecording:
    """A recording that is whitened as it is read."""

    def __init__(self, recording: CentredRecording, taps: Vector) -> None:
        self.size = recording.size
        self._recording, self._taps, self._mean = recording, taps, 0.0
        total, self.energy_steps = _steps(self, self, 0, 0, self.size, LONGEST_LOUD // STEPS)
        self._mean = total / self.size

    def fill(self, row: Vector, start: int) -> None:
        """Fill `row` with the samples from `start` on; zeros before the first sample and after the last."""
        order = self._taps.size - 1
        samples = np.empty(row.size + order)
        self._recording.fill(samples, start - order)
        whiten(samples, self._taps, row)
        row -= self._mean
        # The first samples have no predecessors to be predicted from; after the last, the filter would ring.
        row[: max(0, order - start)] = -self._mean
        row[: max(0, -start)] = 0.0
        row[max(0, self.size - start) :] = 0.0


class LongPair(Pair):
    """Two recordings whitened by one common filter as they are read."""

    def __init__(self, recording_1: CentredRecording, recording_2: CentredRecording) -> None:
        self.sizes = recording_1.size, recording_2.size
        self._raw = recording_1, recording_2
        taps = whitening_taps(_loud(recording_1, None), _loud(recording_2, None), min(self.sizes))
        self._white = _WhiteRecording(recording_1, taps), _WhiteRecording(recording_2, taps)
        self._known: dict[int, Agreement] = {}
        self._scores: dict[int, float] = {}

    @cached_property
    def _colour(self) -> float:
        return common_colour(*(_loud(one, one.energy_steps) for one in self._white))

    def agreement(self, lag: int) -> Agreement:
        """Return the agreement of the whitened recordings at exactly `lag`."""
        if lag not in self._known:
            self._measure(lag, lag)
        return self._known[lag]

    def best_agreement(self, lag: int, within: int = 1) -> Agreement:
        """Return the best agreement up to `within` samples from `lag`; the recordings are read once."""
        self._measure(max(1 - self.sizes[0], lag - within), min(self.sizes[1] - 1, lag + within))
        return super().best_agreement(lag, within)

    def pearson(self, lag: int) -> float:
        """Return Pearson's correlation of the original recordings, -1..1; NaN where flat."""
        if lag not in self._scores:
            self._scores[lag] = block_pearson(*self._raw, lag)
        return self._scores[lag]

    def loudest(self, lag: int, longest: int, *, white: bool = True) -> tuple[Vector, Vector]:
        """Return the parts of both recordings that are loudest together."""
        one, other = self._white if white else self._raw
        part, _ = overlap_slices(*self.sizes, lag)
        size = part.stop - part.start
        start = 0
        if size > longest:
            _, energy = _steps(one, other, part.start, lag, size, longest // STEPS)
            start = loudest_start(energy, size, longest)
        parts = np.empty((2, min(size, longest)))
        one.fill(parts[0], part.start + start)
        other.fill(parts[1], part.start + start + lag)
        return parts[0], parts[1]

    def blocks(self, lag: int, starts: npt.NDArray[np.int64], length: int, margin: int) -> tuple[Vector, Vector]:
        """Return blocks of the overlap."""
        part_1, part_2 = overlap_slices(*self.sizes, lag)
        blocks_1, blocks_2 = np.empty((starts.size, length)), np.empty((starts.size, length + 2 * margin))
        for start, block_1, block_2 in zip(starts, blocks_1, blocks_2, strict=True):
            self._white[0].fill(block_1, part_1.start + start)
            self._white[1].fill(block_2, part_2.start + start - margin)
            block_2[: max(0, margin - start)] = 0.0
            block_2[max(0, part_2.stop - part_2.start - start + margin) :] = 0.0
        return blocks_1, blocks_2

    def _measure(self, first: int, last: int) -> None:
        """Measure the agreement at neighbouring lags, if possible in one pass."""
        lags = [lag for lag in range(first, last + 1) if lag not in self._known]
        sums = self._sums(lags, LONGEST_RUN)
        for lag, found in zip(lags, sums, strict=True):
            total, squares, carried, energy_1, energy_2 = found[:5]
            energy, deviation = math.sqrt(energy_1 * energy_2), math.sqrt(squares)
            if not (energy > 0 and deviation > 0):
                self._known[lag] = Agreement(lag, 0.0, 0.0, 0.0)
                continue
            together = run_length(carried, deviation)
            if together > 1:
                squares, runs = (found if together == LONGEST_RUN else self._sums([lag], together)[0])[5:7]
                deviation = max(deviation, math.sqrt(max(0.0, squares - total**2 / runs)))
            deviation *= self._colour
            self._known[lag] = Agreement(lag, total / energy, total / deviation, carried / deviation)

    def _sums(self, lags: list[int], together: int) -> Vector:
        """Return (lags, 9) sums of :func:`add_agreement` over the whole overlap at each of the neighbouring lags."""
        sums = np.zeros((len(lags), 9))
        if not lags:
            return sums
        parts = [overlap_slices(*self.sizes, lag) for lag in lags]
        begin = [min(both[side].start for both in parts) for side in (0, 1)]
        wider = [max(both[side].start for both in parts) - begin[side] for side in (0, 1)]
        longest = max(part.stop - part.start for part, _ in parts)
        rows = [np.empty(_PIECE + wider[side]) for side in (0, 1)]
        for start in range(0, longest, _PIECE):
            for white, row, first in zip(self._white, rows, begin, strict=True):
                white.fill(row, first + start)
            for (part_1, part_2), found in zip(parts, sums, strict=True):
                count = min(_PIECE, part_1.stop - part_1.start - start)
                if count > 0:
                    one = rows[0][part_1.start - begin[0] :][:count]
                    other = rows[1][part_2.start - begin[1] :][:count]
                    add_agreement(one, other, together, found)
        for found in sums:
            found[5] += found[7] ** 2
            found[6] += found[8] > 0
        return sums


def _steps(
    one: _Readable, other: _Readable, start: int, lag: int, size: int, step: int
) -> tuple[float, npt.NDArray[np.float64]]:
    """Return the sum of `one`, and the sum of the squared products of both for every `step` of `size` samples."""
    energy, total = np.zeros(-(-size // step)), 0.0
    first, second = np.empty(step), np.empty(step)
    for number, offset in enumerate(range(0, size, step)):
        count = min(step, size - offset)
        one.fill(first[:count], start + offset)
        if other is one:
            second = first
        else:
            other.fill(second[:count], start + offset + lag)
        added = add_energy(first[:count], second[:count])
        total += added[0]
        energy[number] = added[1]
    return total, energy


def _loud(one: _Readable, energy: Vector | None) -> Vector:
    """Return the loudest stretch of one recording."""
    if energy is None:
        _, energy = _steps(one, one, 0, 0, one.size, LONGEST_LOUD // STEPS)
    start = loudest_start(energy, one.size, LONGEST_LOUD) if one.size > LONGEST_LOUD else 0
    part = np.empty(min(one.size, LONGEST_LOUD))
    one.fill(part, start)
    return part


@compiled(fastmath={"reassoc", "contract"})
def whiten(samples: Vector, taps: Vector, whitened: Vector) -> None:
    """Fill `whitened` (N,) with the filtered `samples` (N + taps - 1,)."""
    order = taps.size - 1
    for start in range(0, whitened.size, _TILE):
        tile = whitened[start : start + _TILE]
        tile[:] = 0.0
        for tap in range(order + 1):
            weight, moved = taps[tap], samples[start + order - tap :]
            for i in range(tile.size):
                tile[i] += weight * moved[i]


@compiled(fastmath={"reassoc", "contract"})
def add_energy(one: Vector, other: Vector) -> tuple[float, float]:
    """Return the sum of `one` and the sum of the squared products of both."""
    total, energy = 0.0, 0.0
    for i in range(one.size):
        product = one[i] * other[i]
        total += one[i]
        energy += product * product
    return total, energy


@compiled(fastmath={"reassoc", "contract"})
def add_agreement(one: Vector, other: Vector, together: int, sums: Vector) -> None:
    """Add the sums of two overlapping parts to `sums`.

    Parameters
    ----------
    one, other
        (N,).
    together
        Samples per run.
    sums
        (9,) sums of the products, their squares and their magnitudes; of the squares of `one` and of `other`; of the
        squared sums over complete runs, and the number of these; the sum of the unfinished run, and its length.
    """
    place = 0
    while place < one.size:
        stop = min(one.size, place + together - int(sums[8]))
        total, squares, carried, energy_1, energy_2 = 0.0, 0.0, 0.0, 0.0, 0.0
        for i in range(place, stop):
            product = one[i] * other[i]
            total += product
            squares += product * product
            carried += abs(product)
            energy_1 += one[i] * one[i]
            energy_2 += other[i] * other[i]
        sums[0] += total
        sums[1] += squares
        sums[2] += carried
        sums[3] += energy_1
        sums[4] += energy_2
        sums[7] += total
        sums[8] += stop - place
        if sums[8] >= together:
            sums[5] += sums[7] * sums[7]
            sums[6] += 1.0
            sums[7] = sums[8] = 0.0
        place = stop


def whiten_reference(samples: Vector, taps: Vector) -> Vector:
    """Return the expected result of :func:`whiten`."""
    return np.convolve(samples, taps, mode="valid")


def add_energy_reference(one: Vector, other: Vector) -> tuple[float, float]:
    """Return the expected result of :func:`add_energy`."""
    return float(one.sum()), float(((one * other) ** 2).sum())


def add_agreement_reference(one: Vector, other: Vector, together: int) -> Vector:
    """Return the expected result of :func:`add_agreement` on zeros."""
    products = one * other
    runs = np.add.reduceat(products, np.arange(0, products.size, together))
    left = products.size % together
    whole = runs[:-1] if left else runs
    plain = [products.sum(), (products**2).sum(), np.abs(products).sum(), (one**2).sum(), (other**2).sum()]
    return np.array([*plain, (whole**2).sum(), whole.size, runs[-1] if left else 0.0, left])
