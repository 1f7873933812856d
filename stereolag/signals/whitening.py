"""Agreement of two recordings at a lag in excess of chance, whatever they sound like.

Rumbling recordings agree by chance over long stretches, loud events by chance in a few samples. Both effects are
removed: the recordings are whitened, and their agreement is measured in its own standard deviations, sample by sample.
"""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import numpy.typing as npt
from scipy import fft, linalg

from stereolag.core.arrays import Vector
from stereolag.signals.overlaps import overlap_pearson, overlap_slices

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
