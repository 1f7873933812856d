"""Agreement of two recordings at a lag in excess of chance, whatever they sound like.

Rumbling recordings agree by chance over long stretches, loud events by chance in a few samples. Both effects are
removed: the recordings are whitened, and their agreement is measured in its own standard deviations, sample by sample.
Recordings of four seconds and of hours are treated alike, piece by piece; long ones are whitened anew at each read.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy import fft, linalg

from stereolag.core.arrays import DoubleMap, Vector
from stereolag.loops.compilation import compiled
from stereolag.signals.correlation import HeldRecording, Recording, overlap_pearson, overlap_slices

_ORDER = 16
_FLOOR = 1e-4
"""White noise added to the autocorrelation, 40 dB below the recording, so that a tone leaves something."""

_LONGEST_LOUD = 2**17
"""Samples used for the autocorrelations: the loudest stretch of each recording."""

_RUNS, _LONGEST_RUN = 64, 1024
"""Number of runs into which the samples carrying an agreement are divided, and length of the longest, samples."""

_PIECE = 2**16
"""Samples compared at a time: a multiple of the longest run."""

_TILE = 2**11
"""Samples filtered at a time: few enough to stay in the L1 cache."""

_STEPS = 8
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


class Pair:
    """Two recordings, original and whitened by one common filter, so that their lag is unchanged.

    The filter predicts each sample from the 16 before it (linear prediction by the autocorrelation method; J. Makhoul,
    "Linear prediction: a tutorial review", Proc. IEEE 63 (1975)) and leaves the part that could not be predicted.
    """

    def __init__(self, recording_1: Recording, recording_2: Recording) -> None:
        self.raw = recording_1, recording_2
        self.sizes = recording_1.size, recording_2.size
        self._known: dict[int, Agreement] = {}

    @cached_property
    def white(self) -> tuple[Recording, Recording]:
        """Both recordings, whitened."""
        loud_1, loud_2 = (autocorrelation(_loudest(one), _ORDER) for one in self.raw)
        mean = (loud_1 + loud_2) / 2
        order = min(_ORDER, min(self.sizes) // 8)
        mean[0] *= 1 + _FLOOR
        taps = np.append(1.0, -linalg.solve_toeplitz(mean[:order], mean[1 : order + 1]) if order else [])
        return whitened(self.raw[0], taps), whitened(self.raw[1], taps)

    @cached_property
    def _colour(self) -> float:
        """The factor by which residual colour in both whitened recordings widens chance agreement (Bartlett)."""
        one, other = (autocorrelation(_loudest(white), _MEMORY) for white in self.white)
        return math.sqrt(max(1.0, 1 + 2 * float(one[1:] @ other[1:])))

    def pearson(self, lag: int) -> float:
        """Return Pearson's correlation of the original recordings where they overlap, -1..1; NaN where flat."""
        return overlap_pearson(*self.raw, lag)

    def agreement(self, lag: int) -> Agreement:
        """Return the agreement of the whitened recordings at exactly `lag`."""
        return self._best(range(lag, lag + 1))

    def best_agreement(self, lag: int) -> Agreement:
        """Return the best agreement up to one sample from `lag`."""
        return self._best(range(max(1 - self.sizes[0], lag - 1), min(self.sizes[1] - 1, lag + 1) + 1))

    def _best(self, lags: range) -> Agreement:
        new = [lag for lag in lags if lag not in self._known]
        for lag, sums in zip(new, self._sums(new, _LONGEST_RUN), strict=True):
            self._known[lag] = self._agreement(lag, sums)
        return max((self._known[lag] for lag in lags), key=lambda one: one.height)

    def _agreement(self, lag: int, sums: Vector) -> Agreement:
        """Return the agreement at a lag from the sums of :func:`add_agreement`."""
        total, squares, carried, energy_1, energy_2 = sums[:5]
        energy, deviation = math.sqrt(energy_1 * energy_2), math.sqrt(squares)
        if not (energy > 0 and deviation > 0):
            return Agreement(lag, 0.0, 0.0, 0.0)
        # A note that both happen to share agrees over hundreds of samples at once: they count as one.
        together = int(min(_LONGEST_RUN, (carried / deviation) ** 2 / _RUNS))
        if together > 1:
            squares, runs = (sums if together == _LONGEST_RUN else self._sums([lag], together)[0])[5:7]
            deviation = max(deviation, math.sqrt(max(0.0, squares - total**2 / runs)))
        deviation *= self._colour
        return Agreement(lag, total / energy, total / deviation, carried / deviation)

    def _sums(self, lags: list[int], together: int) -> DoubleMap:
        """Return (lags, 9) sums of :func:`add_agreement` over the whole overlap at each of the neighbouring lags.

        A piece of either recording is read once for all of them.
        """
        sums = np.zeros((len(lags), 9))
        overlaps = [overlap_slices(*self.sizes, lag) for lag in lags]
        firsts = [min((parts[side].start for parts in overlaps), default=0) for side in (0, 1)]
        for start in range(0, max((part.stop - part.start for part, _ in overlaps), default=0), _PIECE):
            rows = [
                white.part(first + start, first + start + _PIECE + len(lags))
                for white, first in zip(self.white, firsts, strict=True)
            ]
            for parts, found in zip(overlaps, sums, strict=True):
                count = max(0, min(_PIECE, parts[0].stop - parts[0].start - start))
                one, other = (
                    row[part.start - first :][:count] for row, part, first in zip(rows, parts, firsts, strict=True)
                )
                add_agreement(one, other, together, found)
        # The last run may be shorter.
        sums[:, 5] += sums[:, 7] ** 2
        sums[:, 6] += sums[:, 8] > 0
        return sums


class _WhiteRecording(Recording):
    """A recording that is whitened as it is read."""

    piece = _PIECE

    def __init__(self, recording: Recording, taps: Vector) -> None:
        self.size = recording.size
        self._recording, self._taps, self._mean = recording, taps, 0.0
        self._mean = sum(float(piece.sum()) for piece in self.pieces(0, self.size)) / self.size

    def part(self, start: int, stop: int) -> Vector:
        """Return the samples, whitened."""
        order = self._taps.size - 1
        samples = np.empty(stop - start)
        whiten(self._recording.part(start - order, stop), self._taps, samples)
        samples -= self._mean
        # The first samples have no predecessors to be predicted from; after the last, the filter would ring.
        samples[: max(0, order - start)] = -self._mean
        samples[: max(0, -start)] = 0.0
        samples[max(0, self.size - start) :] = 0.0
        return samples


def whitened(recording: Recording, taps: Vector) -> Recording:
    """Return a recording filtered by `taps`, with zero mean: in memory if it is there itself."""
    if not isinstance(recording, HeldRecording):
        return _WhiteRecording(recording, taps)
    filtered = np.convolve(recording.part(0, recording.size), taps)[: recording.size]
    # The first samples have no predecessors to be predicted from: their jump is not sound.
    filtered[: taps.size - 1] = 0.0
    return HeldRecording(np.asarray(filtered - filtered.mean()))


def loudest_stretch(one: Recording, other: Recording, lag: int, longest: int) -> tuple[slice, slice]:
    """Return the parts of both, at most `longest` samples, in which they are loudest together at `lag`."""
    part, _ = overlap_slices(one.size, other.size, lag)
    start, size = part.start, part.stop - part.start
    if size > longest:
        step = longest // _STEPS
        energies = []
        for first in range(part.start, part.stop, step):
            stop = min(first + step, part.stop)
            here = one.part(first, stop)
            energies.append(np.sum((here * (here if other is one else other.part(first + lag, stop + lag))) ** 2))
        loudest = int(np.argmax(np.convolve(energies, np.ones(_STEPS), mode="valid")))
        start, size = start + min(step * loudest, size - longest), longest
    return slice(start, start + size), slice(start + lag, start + size + lag)


def _loudest(one: Recording) -> Vector:
    part, _ = loudest_stretch(one, one, 0, _LONGEST_LOUD)
    return one.part(part.start, part.stop)


def autocorrelation(given: Vector, reach: int) -> Vector:
    """Return Pearson's autocorrelation at lags 0 to `reach`, 0 beyond the recording."""
    if reach < _FEW_LAGS:
        found = np.zeros(reach + 1)
        for lag in range(min(reach + 1, given.size)):
            found[lag] = np.einsum("i,i", given[: given.size - lag], given[lag:])
    else:
        size = int(fft.next_fast_len(given.size + reach, real=True))
        spectrum = fft.rfft(given, size)
        found = fft.irfft(spectrum.real**2 + spectrum.imag**2, size)[: reach + 1]
    return np.asarray(found / found[0]) if found[0] > 0 else np.zeros_like(found)


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


def add_agreement_reference(one: Vector, other: Vector, together: int) -> Vector:
    """Return the expected result of :func:`add_agreement` on zeros."""
    products = one * other
    runs = np.add.reduceat(products, np.arange(0, products.size, together))
    left = products.size % together
    whole = runs[:-1] if left else runs
    plain = [products.sum(), (products**2).sum(), np.abs(products).sum(), (one**2).sum(), (other**2).sum()]
    return np.array([*plain, (whole**2).sum(), whole.size, runs[-1] if left else 0.0, left])
