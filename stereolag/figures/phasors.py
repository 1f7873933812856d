"""The cross-spectrum of two short stretches: an arrow (phasor) for each frequency, few enough to see every one."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from stereolag.arrays import Vector
from stereolag.signals.overlaps import overlap_slices
from stereolag.signals.whitening import loudest_stretch

SIZE = 125
"""Points of the transform. Odd: every frequency above 0 is an arrow, and there is none at half the sampling rate."""

LONGEST_LAG = 12
"""Samples, either way: so many zeros follow a stretch, and up to there nothing wraps around."""

LENGTH = SIZE - LONGEST_LAG
"""Samples of a stretch."""

LAG = 4
"""Samples that are left between two stretches: the phase difference turns twice over all frequencies."""

STEPS = (1, 2, 3, 4, 6, 8, 12, 16, 24, 32)
BLOCK = 8192
"""Samples of the loudest part in common, in which the stretch is looked for."""

FADED = 17
"""Samples over which a stretch rises and falls, so that its ends make no frequencies of their own."""

KNOCK_LENGTH = 60
TONE_FREQUENCY = SIZE // 5
"""Periods within the transform: one every five samples."""


_INAUDIBLE = 1e-9
"""Magnitudes below are rounding, and become 0."""


@dataclass(frozen=True, eq=False)
class Phasors:
    """The spectra of two stretches, and by how much the second is behind the first.

    Frequency k = 1..62 is k / 125 turns a sample. Its arrow is ``magnitude_1 * magnitude_2`` long and points
    ``turns`` clockwise; turned back by ``k * lag / 125``, the arrows add up to a complex number whose real part is
    the correlation at that lag: ``sum(x[i] * y[i + lag])`` over the square root of both energies.

    Attributes
    ----------
    name
        Of the example.
    magnitude_1, magnitude_2
        (62,) float64, of the stretches of recordings 1 and 2; the squares of each add up to 1.
    turns
        (62,) float64, -0.5..0.5: the phase difference, positive where recording 2 is behind.
    offset
        By how many samples of the recordings the second stretch begins later than the first.
    step
        Samples of the recordings whose mean is one of the stretch.
    """

    name: str
    magnitude_1: Vector
    magnitude_2: Vector
    turns: Vector
    offset: int = 0
    step: int = 1

    @property
    def lengths(self) -> Vector:
        """Return how long the arrows are; straight in line they would reach their sum."""
        return self.magnitude_1 * self.magnitude_2


def phasors(name: str, stretch_1: Vector, stretch_2: Vector, *, offset: int = 0, step: int = 1) -> Phasors:
    """Return the spectra of two stretches without their means.

    Parameters
    ----------
    name
        Of the example.
    stretch_1, stretch_2
        (N1,) and (N2,), at most 125 samples. Correlations at lags beyond ``125 - max(N1, N2)`` wrap around.
    offset, step
        See :class:`Phasors`.

    Raises
    ------
    ValueError
        A stretch is too long, or does not move at all.
    """
    magnitudes, angles = [], []
    for stretch in (stretch_1, stretch_2):
        moving = stretch - stretch.mean()
        energy = float(moving @ moving)
        if stretch.size > SIZE or not energy > 0:
            raise ValueError(
                f"A stretch has {stretch.size} samples and an energy of {energy:g}; allowed are up to {SIZE} samples "
                "and more than 0."
            )
        spectrum = np.fft.rfft(moving, SIZE)[1:] * np.sqrt(2 / SIZE / energy)
        magnitude = np.abs(spectrum)
        magnitudes.append(np.where(magnitude > _INAUDIBLE, magnitude, 0.0))
        angles.append(np.angle(spectrum))
    turns = (angles[0] - angles[1]) / (2 * np.pi)
    return Phasors(name, magnitudes[0], magnitudes[1], turns - np.rint(turns), offset, step)


def correlation(phasors: Phasors, *, whiten: bool = False) -> tuple[Vector, Vector]:
    """Return how far to the right the chain of arrows ends at each lag.

    Parameters
    ----------
    phasors
        The spectra.
    whiten
        Make all arrows equal, 1 together (PHAT); frequencies with nothing in them stay out.

    Returns
    -------
    lags, heights
        (97,) float64: from -12 to 12 samples in quarters, and the correlation there, -1..1.
    """
    lags = np.linspace(-LONGEST_LAG, LONGEST_LAG, 8 * LONGEST_LAG + 1)
    frequencies = np.arange(1, phasors.turns.size + 1) / SIZE
    lengths = phasors.lengths
    if whiten:
        heard = lengths > 0
        lengths = heard / heard.sum()
    return lags, np.cos(2 * np.pi * (np.outer(lags, frequencies) - phasors.turns)) @ lengths


def common_stretch(name: str, signal_1: Vector, signal_2: Vector, lag: int) -> Phasors | None:
    """Return the loudest stretch that both recordings hold, 4 samples apart; None where they share too little.

    Each sample of the stretch is the mean of `step` samples of the recording: that step is taken at which most
    frequencies take part.

    Parameters
    ----------
    name
        Of the example.
    signal_1, signal_2
        (N1,) and (N2,), the whole recordings.
    lag
        The true one, samples.
    """
    part_1, part_2 = overlap_slices(signal_1.size, signal_2.size, lag)
    loudest = _loudest_block(signal_1[part_1], signal_2[part_2])
    stretches = _stretches(name, signal_1[part_1][loudest], signal_2[part_2][loudest], lag)
    return max(stretches, key=lambda one: _taking_part(one.lengths), default=None)


def _loudest_block(common_1: Vector, common_2: Vector) -> slice:
    """Return which of many blocks is the loudest in both, without a copy of recordings that may be hours long."""
    blocks = common_1.size // BLOCK
    if blocks < 2:
        return slice(0, common_1.size)
    rows_1, rows_2 = (common[: blocks * BLOCK].reshape(blocks, BLOCK) for common in (common_1, common_2))
    start = BLOCK * int(np.argmax(np.einsum("ij,ij,ij,ij->i", rows_1, rows_1, rows_2, rows_2)))
    return slice(start, start + BLOCK)


def _stretches(name: str, common_1: Vector, common_2: Vector, lag: int) -> Iterator[Phasors]:
    """Yield the loudest stretch for every step that two equally long parts are long enough for."""
    for step in STEPS:
        left = LAG * step
        if common_1.size < LENGTH * step + left:
            return
        loudest = loudest_stretch(common_1[left:], common_2[left:], LENGTH * step)
        # Recording 2 from so much earlier on: what recording 1 begins with comes 4 of the new samples later.
        thinned = (part[loudest].reshape(-1, step).mean(1) for part in (common_1[left:], common_2))
        stretch_1, stretch_2 = (_faded(part) for part in thinned)
        if np.ptp(stretch_1) > 0 and np.ptp(stretch_2) > 0:
            yield phasors(name, stretch_1, stretch_2, offset=lag - left, step=step)


def _taking_part(lengths: Vector) -> float:
    """Return how many arrows of equal length would share out like these."""
    return float(lengths.sum() ** 2 / (lengths @ lengths))


def _faded(stretch: Vector) -> Vector:
    rise = np.sin(0.5 * np.pi * (np.arange(FADED) + 0.5) / FADED) ** 2
    window = np.concatenate((rise, np.ones(stretch.size - 2 * FADED), rise[::-1]))
    return np.asarray((stretch - stretch.mean()) * window)


def knock() -> Phasors:
    """Return one short sound that rings out, heard 4 samples later by recording 2 and unchanged."""
    sound = np.random.default_rng(7).normal(size=KNOCK_LENGTH) * np.exp(-np.arange(KNOCK_LENGTH) / 12)
    sound -= sound.mean()
    stretches = np.zeros((2, LENGTH))
    for row, start in zip(stretches, (20, 20 + LAG), strict=True):
        row[start : start + KNOCK_LENGTH] = sound
    return phasors("knock", *stretches)


def tone() -> Phasors:
    """Return a pure tone of whole periods, 4 samples later in recording 2: a single arrow."""
    samples = np.arange(SIZE)
    return phasors("tone", *(np.sin(2 * np.pi * (samples - lag) * TONE_FREQUENCY / SIZE) for lag in (0, LAG)))


def noise() -> Phasors:
    """Return two noises that have nothing to do with each other."""
    return phasors("noise", *(_faded(one) for one in np.random.default_rng(0).normal(size=(2, LENGTH))))
