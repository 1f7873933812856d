"""How a lag changes over the recordings: measured in blocks, its slope the drift of one clock against the other."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy import fft

from stereolag.arrays import Vector
from stereolag.signals.median_lines import median_line
from stereolag.signals.overlaps import overlap_slices
from stereolag.signals.peaks import REACH, refine_peak
from stereolag.signals.whitening import Pair

_BLOCKS = 16
_SHORTEST, _LONGEST = 1024, 2**14
"""Samples of a block; of a longer one the middle is used."""

_FARTHEST_PPM = 300
_CLEAR = 5.5
"""Standard deviations by which the peak of a block rises above its chance; the highest of 1,600 lags is at 3.8."""

_STRAY = 2.0
"""Samples off the line from which on a block has found something else."""

_MOST, _FEWEST = 0.6, 5
"""The share, and the number, of blocks that must lie on the line."""


@dataclass(frozen=True)
class Drift:
    """The lag over time.

    Attributes
    ----------
    start
        The lag at the first sample that both have in common, samples.
    ppm
        Samples by which the lag grows per million; positive where the clock of recording 2 runs faster.
    error_ppm
        Its standard error.
    spread
        Standard deviation of the lag of a block about the line, samples.
    span
        By how much the lag changes from the first to the last sample in common, samples, signed.
    places, lags
        (blocks,) where in recording 1 the middle of each block that lies on the line is, and its lag, samples.
    """

    start: float
    ppm: float
    error_ppm: float
    spread: float
    span: float
    places: tuple[float, ...]
    lags: tuple[float, ...]

    @property
    def blocks(self) -> int:
        """How many blocks lie on the line."""
        return len(self.lags)

    @property
    def shows(self) -> bool:
        """Whether the lag changes by more than it is uncertain, and by enough to smear the peak."""
        return abs(self.span) >= 1.0 and abs(self.ppm) > 4 * self.error_ppm


def measure_drift(pair: Pair, lag: int) -> Drift | None:
    """Return how the lag changes about `lag`; None where the blocks are too short or find no common line.

    The samples in common are cut into at most 16 blocks. Each is looked for by itself, up to 300 ppm of the whole
    (at least 32 samples) beside `lag`; a straight line through those that are found clearly is the drift, by the
    median of all slopes (P. K. Sen, "Estimates of the regression coefficient based on Kendall's tau", J. Am. Stat.
    Assoc. 63 (1968)) and then least squares.
    """
    part_1, _ = overlap_slices(*pair.sizes, lag)
    size = part_1.stop - part_1.start
    count = min(_BLOCKS, size // _SHORTEST)
    if count < _FEWEST:
        return None
    starts, length = _cut(size, count)
    reach = int(np.clip(_FARTHEST_PPM * 1e-6 * size, REACH, length // 4))
    curves = _block_curves(*pair.blocks(lag, starts, length, reach), reach)
    tops = np.argmax(curves, axis=1)
    noise = 1.4826 * np.median(np.abs(curves - np.median(curves, axis=1, keepdims=True)), axis=1)
    clear = (curves.max(axis=1) > _CLEAR * noise) & (tops > 0) & (tops < 2 * reach)
    if clear.sum() < max(_FEWEST, _MOST * count):
        return None
    lags = np.array([_refined(curve, int(top)) for curve, top in zip(curves[clear], tops[clear], strict=True)]) - reach
    return _line(part_1.start, starts[clear] + length / 2, lag + lags, size, count)


def _cut(size: int, count: int) -> tuple[np.ndarray[tuple[int], np.dtype[np.int64]], int]:
    """Return where `count` blocks begin, and their length."""
    whole = size // count
    length = min(whole, _LONGEST)
    return np.arange(count) * whole + (whole - length) // 2, length


def _block_curves(blocks_1: Vector, blocks_2: Vector, reach: int) -> Vector:
    """Return (blocks, 2 * reach + 1) products of each block of recording 1 with recording 2 up to `reach` beside it."""
    points = int(fft.next_fast_len(blocks_2.shape[1], real=True))
    spectra = np.conj(fft.rfft(blocks_1, points)) * fft.rfft(blocks_2, points)
    return np.asarray(fft.irfft(spectra, points)[:, : 2 * reach + 1])


def _refined(curve: Vector, top: int) -> float:
    around = min(REACH, top, curve.size - 1 - top)
    return top + refine_peak(np.ascontiguousarray(curve[top - around : top + around + 1]))


def _line(start: int, places: Vector, lags: Vector, size: int, count: int) -> Drift | None:
    slope, intercept = median_line(places, lags)
    near = np.abs(lags - intercept - slope * places) <= _STRAY
    if near.sum() < max(_FEWEST, _MOST * count):
        return None
    (slope, intercept), covariance = np.polyfit(places[near], lags[near], 1, cov=True)
    spread = float(np.std(lags[near] - intercept - slope * places[near], ddof=2))
    return Drift(
        float(intercept),
        1e6 * float(slope),
        1e6 * float(np.sqrt(covariance[0, 0])),
        spread,
        float(slope) * size,
        tuple((start + places[near]).tolist()),
        tuple(lags[near].tolist()),
    )
