"""The cross-spectrum of two short stretches: one arrow (phasor) per frequency, few enough to be seen one by one."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from stereolag.core.arrays import Vector
from stereolag.signals.by_hand import STEPS
from stereolag.signals.correlation import faded, loudest_stretch, overlap_slices
from stereolag.signals.evidence import effective_count
from stereolag.signals.recordings import HeldRecording

SIZE = 125
"""Points of the transform; odd, so that every frequency above 0 is an arrow, with none at half the sampling rate."""

LONGEST_LAG = 12
"""Samples, either way: this many zeros pad a stretch, so correlations up to this lag do not wrap around."""

LAGS = np.linspace(-LONGEST_LAG, LONGEST_LAG, 8 * LONGEST_LAG + 1)
"""The lags at which arrows are added up: every quarter of a sample."""

LENGTH = SIZE - LONGEST_LAG
"""Samples of a stretch."""

LAG = 4
"""Lag between the two stretches, samples: the phase difference makes two turns over all frequencies."""

BLOCK = 8192
"""Samples of the loudest common part, in which the stretch is searched for."""

FADED = 17
"""Samples over which a stretch fades in and out, so that its ends add no frequencies of their own."""

KNOCK_LENGTH = 60
"""Samples."""

TONE_FREQUENCY = SIZE // 5
"""Periods per transform: one every five samples."""

_MIN_MAGNITUDE = 1e-9
"""Magnitudes below this are rounding errors and become 0."""


@dataclass(frozen=True, eq=False)
class Phasors:
    """The spectra of two stretches, and the phase by which the second is behind the first.

    Frequency k = 1..62 is k / 125 turns per sample. Its arrow is ``magnitude_1 * magnitude_2`` long and points
    ``turns`` clockwise; turned back by ``k * lag / 125``, the arrows add up to a complex number whose real part is
    the correlation at that lag: ``sum(x[i] * y[i + lag])`` over the square root of the product of both energies.

    Attributes
    ----------
    name
        Name of the example.
    magnitude_1, magnitude_2
        (62,) float64, for recordings 1 and 2; the squares of each sum to 1.
    turns
        (62,) float64, -0.5..0.5: the phase difference, positive where recording 2 is behind.
    offset
        Samples of the recordings by which the second stretch begins later than the first.
    step
        Samples of the recordings averaged into one of the stretch.
    """

    name: str
    magnitude_1: Vector
    magnitude_2: Vector
    turns: Vector
    offset: int = 0
    step: int = 1

    def lengths(self, *, whiten: bool = False) -> Vector:
        """Return the lengths of the arrows, (62,) float64.

        Whitened (PHAT), all are equal except those of empty frequencies, and their sum is 1.
        """
        products = self.magnitude_1 * self.magnitude_2
        return (products > 0) / np.count_nonzero(products) if whiten else products


def phasors(name: str, stretch_1: Vector, stretch_2: Vector, *, offset: int = 0, step: int = 1) -> Phasors:
    """Return the spectra of two stretches without their means.

    Parameters
    ----------
    name
        Name of the example.
    stretch_1, stretch_2
        (N1,) and (N2,), at most 125 samples. Correlations at lags beyond ``125 - max(N1, N2)`` wrap around.
    offset, step
        See :class:`Phasors`.

    Raises
    ------
    ValueError
        If a stretch is too long or constant.
    """
    magnitudes, angles = [], []
    for stretch in (stretch_1, stretch_2):
        centred = stretch - stretch.mean()
        energy = float(centred @ centred)
        if stretch.size > SIZE or not energy > 0:
            raise ValueError(
                f"A stretch has {stretch.size} samples and an energy of {energy:g}; allowed are up to {SIZE} samples "
                "and more than 0."
            )
        spectrum = np.fft.rfft(centred, SIZE)[1:] * np.sqrt(2 / SIZE / energy)
        magnitude = np.abs(spectrum)
        magnitudes.append(np.where(magnitude > _MIN_MAGNITUDE, magnitude, 0.0))
        angles.append(np.angle(spectrum))
    turns = (angles[0] - angles[1]) / (2 * np.pi)
    return Phasors(name, magnitudes[0], magnitudes[1], turns - np.rint(turns), offset, step)


def chains(phasors: Phasors, *, whiten: bool = False) -> npt.NDArray[np.complex128]:
    """Return the arrows chained head to tail at each of `LAGS`: the end of each arrow, (97, 62) complex128.

    The real part of the last end is the correlation, -1..1.
    """
    frequencies = np.arange(1, phasors.turns.size + 1) / SIZE
    turned = np.outer(LAGS, frequencies) - phasors.turns
    return np.cumsum(phasors.lengths(whiten=whiten) * np.exp(2j * np.pi * turned), axis=1)


def correlation(phasors: Phasors, *, whiten: bool = False) -> tuple[Vector, Vector]:
    """Return `LAGS`, and the correlation at each."""
    return LAGS, chains(phasors, whiten=whiten)[:, -1].real


EQUAL = 1e-6
"""Heights that differ by less are equal: a tone has a highest peak in every period."""


def peaks(heights: Vector) -> list[int]:
    """Return the indices in `LAGS` of the highest peaks, that of the smallest lag first."""
    return sorted(np.flatnonzero(heights > heights.max() - EQUAL).tolist(), key=lambda index: abs(LAGS[index]))


def common_stretch(name: str, signal_1: Vector, signal_2: Vector, lag: int) -> Phasors | None:
    """Return the loudest stretch common to both recordings, 4 samples apart; None if they share too little.

    Each sample of the stretch is the mean of `step` samples of the recording; the step is the one at which the most
    frequencies contribute.

    Parameters
    ----------
    name
        Name of the example.
    signal_1, signal_2
        (N1,) and (N2,), the whole recordings.
    lag
        The true lag, samples.
    """
    part_1, part_2 = overlap_slices(signal_1.size, signal_2.size, lag)
    loudest = _loudest_block(signal_1[part_1], signal_2[part_2])
    stretches = _stretches(name, signal_1[part_1][loudest], signal_2[part_2][loudest], lag)
    return max(stretches, key=lambda phasors: effective_count(phasors.lengths()), default=None)


def _loudest_block(common_1: Vector, common_2: Vector) -> slice:
    """Return the block that is loudest in both, without copying recordings that may be hours long."""
    blocks = common_1.size // BLOCK
    if blocks < 2:
        return slice(0, common_1.size)
    rows_1, rows_2 = (common[: blocks * BLOCK].reshape(blocks, BLOCK) for common in (common_1, common_2))
    start = BLOCK * int(np.argmax(np.einsum("ij,ij,ij,ij->i", rows_1, rows_1, rows_2, rows_2)))
    return slice(start, start + BLOCK)


def _stretches(name: str, common_1: Vector, common_2: Vector, lag: int) -> Iterator[Phasors]:
    """Yield the loudest stretch for every step for which two equally long parts are long enough."""
    for step in STEPS:
        offset = LAG * step
        if common_1.size < LENGTH * step + offset:
            return
        held = HeldRecording(common_1[offset:]), HeldRecording(common_2[offset:])
        loudest, _ = loudest_stretch(*held, 0, LENGTH * step)
        # Recording 2 starts `offset` samples earlier, so its stretch lags by 4 samples of a stretch.
        averaged = (part[loudest].reshape(-1, step).mean(1) for part in (common_1[offset:], common_2))
        stretch_1, stretch_2 = (_faded(part) for part in averaged)
        if np.ptp(stretch_1) > 0 and np.ptp(stretch_2) > 0:
            yield phasors(name, stretch_1, stretch_2, offset=lag - offset, step=step)


def _faded(stretch: Vector) -> Vector:
    return faded(stretch - stretch.mean(), FADED)


def knock() -> Phasors:
    """Return one short decaying sound, 4 samples later in recording 2 and otherwise unchanged."""
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
    """Return two unrelated noises."""
    return phasors("noise", *(_faded(row) for row in np.random.default_rng(0).normal(size=(2, LENGTH))))
