"""Agreement of two long recordings at a lag, read piece by piece and never whitened as a whole.

Gives the same figures as :class:`stereolag.signals.whitening.WhitePair`, from sums over the whole recordings.
"""

from __future__ import annotations

import math
from functools import cached_property
from typing import Protocol

import numpy as np
import numpy.typing as npt

from stereolag.core.arrays import Vector
from stereolag.loops.compilation import compiled
from stereolag.signals.blocks import CentredRecording, block_pearson
from stereolag.signals.overlaps import overlap_slices
from stereolag.signals.whitening import (
    LONGEST_LOUD,
    LONGEST_RUN,
    STEPS,
    Agreement,
    Pair,
    common_colour,
    loudest_start,
    run_length,
    whitening_taps,
)

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
