"""Change of the lag over the recordings, measured in blocks; its slope is the drift of one clock against the other."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy import fft

from stereolag.core.arrays import Vector
from stereolag.signals.median_lines import median_line
from stereolag.signals.overlaps import overlap_slices
from stereolag.signals.peaks import REACH, refine_peak
from stereolag.signals.whitening import Pair

_BLOCKS = 16
_SHORTEST, _LONGEST = 1024, 2**14
"""Shortest and longest block, samples; of longer blocks the middle is used."""

_FARTHEST_PPM = 300
_CLEAR = 5.5
"""The peak of a block is clear above this many standard deviations of noise; the highest of 1,600 lags is at 3.8."""

_STRAY = 2.0
"""A block this far off the line has found something else, samples."""

_MOST, _FEWEST = 0.6, 5
"""Least share and least number of blocks on the line."""


@dataclass(frozen=True)
class Drift:
    """The lag as a function of time.

    Attributes
    ----------
    start
        Lag at the first sample common to both recordings, samples.
    ppm
        Growth of the lag, samples per million; positive if the clock of recording 2 runs faster.
    error_ppm
        Standard error of `ppm`.
    spread
        Standard deviation of the blocks' lags about the line, samples.
    span
        Change of the lag from the first to the last common sample, samples, signed.
    places, lags
        (blocks,) centre of each block on the line, as a position in recording 1, and its lag, samples.
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
        """Number of blocks on the line."""
        return len(self.lags)

    @property
    def shows(self) -> bool:
        """Whether the lag changes by more than its uncertainty, and by enough to smear the peak."""
        return abs(self.span) >= 1.0 and abs(self.ppm) > 4 * self.error_ppm


def measure_drift(pair: Pair, lag: int) -> Drift | None:
    """Return the drift of the lag around `lag`; None if the blocks are too short or share no line.

    The overlap is cut into at most 16 blocks. Each is searched separately, up to 300 ppm of the overlap (at least 32
    samples) on either side of `lag`. The drift is a straight line through the blocks with a clear peak, by the median
    of all slopes (P. K. Sen, "Estimates of the regression coefficient based on Kendall's tau", J. Am. Stat. Assoc. 63
    (1968)) and then least squares.
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
    """Return the starts of `count` blocks, and their length."""
    whole = size // count
    length = min(whole, _LONGEST)
    return np.arange(count) * whole + (whole - length) // 2, length


def _block_curves(blocks_1: Vector, blocks_2: Vector, reach: int) -> Vector:
    """Return (blocks, 2 * reach + 1) product sums of each block with recording 2, up to `reach` on either side."""
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
