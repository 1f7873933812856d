"""Recordings as float64, in memory or converted part by part, and the sums over their samples."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Iterator
from functools import cached_property

import numpy as np

from stereolag.core.arrays import Array, DoubleMap, Vector
from stereolag.loops.compilation import compiled

GRAIN = 1024
"""Samples between stored running sums."""


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
        """The sum of all squares."""
        return sum(dot(piece, piece) for piece in self.pieces(0, self.size))

    def total(self, start: int, stop: int) -> float:
        """Return the sum of the samples from `start` to `stop`, exclusive."""
        return sum(float(piece.sum()) for piece in self.pieces(start, stop))


class HeldRecording(Recording):
    """A recording in memory, as one piece."""

    def __init__(self, samples: Array) -> None:
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

    def __init__(self, signal: Array, on_read: Callable[[], None] = lambda: None) -> None:
        self._signal, self._on_read, self.size = signal, on_read, signal.size
        self._mean = float(signal.mean(dtype=np.float64))
        self._height = max(float(signal.max()) - self._mean, self._mean - float(signal.min()))
        # In these cases single precision cannot hold the samples, or not resolve them about their mean.
        self._exact = signal.dtype.itemsize > 4 or abs(self._mean) > self._height

    def part(self, start: int, stop: int, dtype: type[np.floating] = np.float64) -> Array:
        """Return the samples, converted; reading them in single precision takes half the time."""
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
        """(2, N): the sum and the sum of squares of all samples before each grain, and of all samples."""
        steps = [np.zeros((2, 1))]
        for piece in self.pieces(0, self.size):
            starts = np.arange(0, piece.size, GRAIN)
            steps.append(np.stack([np.add.reduceat(piece, starts), np.add.reduceat(piece * piece, starts)]))
        return np.cumsum(np.concatenate(steps, axis=1), axis=1)

    @cached_property
    def energy(self) -> float:
        """The sum of all squares."""
        return float(self.sums[1, -1])

    def total(self, start: int, stop: int) -> float:
        """Return the sum of the samples from `start` to `stop`, exclusive."""
        return float(self.running_sums(stop, stop)[0, 0] - self.running_sums(start, start)[0, 0])

    def running_sums(self, first: int, last: int) -> DoubleMap:
        """Return the sums and the sums of squares of the first `first`, `first` + 1, … `last` samples, (2, N)."""
        start = first // GRAIN * GRAIN
        before = float(self.sums[0, first // GRAIN]), float(self.sums[1, first // GRAIN])
        return running_sums(self.part(start, last), before)[:, first - start :]


@compiled(fastmath={"reassoc", "contract"})
def dot(first: Vector, second: Vector) -> float:
    """Return the sum of the products of the samples of `first` and the first ones of `second`."""
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
