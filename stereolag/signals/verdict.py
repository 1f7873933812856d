"""Whether a lag can be relied on: its agreement beyond chance, other lags that fit, and the drift of the clocks."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Literal, TypeAlias

import numpy as np
from scipy import fft

from stereolag.core.arrays import Vector
from stereolag.signals.correlation import (
    REACH,
    Lags,
    Recording,
    main_lobe,
    overlap_length,
    overlap_slices,
    refine_peak,
)
from stereolag.signals.sampling import enough_votes
from stereolag.signals.search import FoundLag, lags_within
from stereolag.signals.whitening import Agreement, Pair, local_curve, loudest_stretch


def median_line(places: Vector, values: Vector) -> tuple[float, float]:
    """Return slope and intercept of the median line of Theil (1950) and Sen (1968).

    Agrees with :func:`scipy.stats.theilslopes`, whose package takes a second to import.

    Parameters
    ----------
    places, values
        (points,) abscissae, not all equal, and ordinates.
    """
    apart = places[:, np.newaxis] - places
    later = apart > 0
    slope = float(np.median((values[:, np.newaxis] - values)[later] / apart[later]))
    return slope, float(np.median(values) - slope * np.median(places))


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
    part_1, part_2 = overlap_slices(*pair.sizes, lag)
    size = part_1.stop - part_1.start
    count = min(_BLOCKS, size // _SHORTEST)
    if count < _FEWEST:
        return None
    length = min(size // count, _LONGEST)
    starts = np.arange(count) * (size // count) + (size // count - length) // 2
    reach = int(np.clip(_FARTHEST_PPM * 1e-6 * size, REACH, length // 4))
    curves = _block_curves(pair, part_1.start + starts, part_2.start + starts, length, reach, part_2)
    tops = np.argmax(curves, axis=1)
    noise = 1.4826 * np.median(np.abs(curves - np.median(curves, axis=1, keepdims=True)), axis=1)
    clear = (curves.max(axis=1) > _CLEAR * noise) & (tops > 0) & (tops < 2 * reach)
    fewest = max(_FEWEST, _MOST * count)
    if clear.sum() < fewest:
        return None
    refined = []
    for curve, top in zip(curves[clear], tops[clear].tolist(), strict=True):
        around = min(REACH, top, curve.size - 1 - top)
        refined.append(top + refine_peak(np.ascontiguousarray(curve[top - around : top + around + 1])))
    places, lags = starts[clear] + length / 2, lag + (np.array(refined) - reach)
    slope, intercept = median_line(places, lags)
    near = np.abs(lags - intercept - slope * places) <= _STRAY
    if near.sum() < fewest:
        return None
    (slope, intercept), covariance = np.polyfit(places[near], lags[near], 1, cov=True)
    return Drift(
        start=float(intercept),
        ppm=1e6 * float(slope),
        error_ppm=1e6 * float(np.sqrt(covariance[0, 0])),
        spread=float(np.std(lags[near] - intercept - slope * places[near], ddof=2)),
        span=float(slope) * size,
        places=tuple((part_1.start + places[near]).tolist()),
        lags=tuple(lags[near].tolist()),
    )


def _block_curves(pair: Pair, starts_1: Lags, starts_2: Lags, length: int, reach: int, overlap_2: slice) -> Vector:
    """Return (blocks, 2 * reach + 1) product sums of each block with recording 2, up to `reach` on either side."""
    white_1, white_2 = pair.white
    blocks_1 = np.stack([white_1.part(start, start + length) for start in starts_1.tolist()])
    blocks_2 = np.stack([white_2.part(start - reach, start + length + reach) for start in starts_2.tolist()])
    places = starts_2[:, np.newaxis] + np.arange(-reach, length + reach)
    blocks_2[(places < overlap_2.start) | (places >= overlap_2.stop)] = 0.0
    points = int(fft.next_fast_len(blocks_2.shape[1], real=True))
    spectra = np.conj(fft.rfft(blocks_1, points)) * fft.rfft(blocks_2, points)
    return np.asarray(fft.irfft(spectra, points)[:, : 2 * reach + 1])


_RIVAL = 0.85
"""Another lag is as good from this share of the height on; noise alone lowers a tooth of a comb by a few per cent."""

_STRETCH, _REACH = 2**16, 2**14
"""Length of the stretch searched for repetition, and largest distance between repeats, samples."""

_LINES, _LINE_SHARE = 8, 0.7
"""Most lines in the spectrum of a tonal curve, and the least share of its power that they contain."""

_FEWEST_PERIODS = 8
_FAINT = 0.05
"""Lines below this share of the strongest line's power are noise."""

_TEETH_SHARE = 0.5
"""Least share of the curve over which the teeth of a tone extend."""

_REGULAR = 0.75
"""Least share of the rivals that are evenly spaced."""

_MOST_RIVALS = 16


def rivals_of(pair: Pair, agreement: Agreement, found: FoundLag, first: int, last: int, needed: float) -> list[int]:
    """Return the lags from `first` to `last` at which the whitened recordings agree equally well, nearest first."""
    nearby = _repetitions(pair, agreement.lag, first, last, needed)
    if agreement.height >= needed and found.lags is not None and found.correlation is not None:
        for other in _high_points(pair, agreement.lag, found.lags, found.correlation):
            there = pair.best_agreement(other)
            if there.score >= _RIVAL * agreement.score and there.height >= needed:
                nearby.add(there.lag)
    rivals = _nearest(nearby, agreement.lag)
    # A horn blown twice fits itself again, but the sounds around it do not: a rival fits with and without whitening.
    least = _RIVAL * pair.pearson(agreement.lag) if rivals else 0.0
    return [other for other in rivals if pair.pearson(other) >= least]


def _nearest(found: set[int], lag: int) -> list[int]:
    return sorted(found - {lag}, key=lambda other: (abs(other - lag), other))[:_MOST_RIVALS]


def _loud_curve(recordings: tuple[Recording, Recording], lag: int) -> Vector:
    """Return the curve of the loudest common stretch, (2 * reach + 1,) with `lag` in the middle."""
    parts = loudest_stretch(*recordings, lag, _STRETCH)
    one, other = (whole.part(part.start, part.stop) for whole, part in zip(recordings, parts, strict=True))
    return local_curve(one, other, min(_REACH, one.size // 2))


def tone_rivals(pair: Pair, lag: int, first: int, last: int) -> list[int]:
    """Return the lags around `lag` at which tones common to both recordings line up.

    Whitening removes tones, and noise hides their teeth in the curve. The curve's spectrum reveals them: a few lines
    contain most of its power. The curve rebuilt from these lines alone has the teeth without the noise.
    """
    curve = _loud_curve(pair.raw, lag)
    reach = curve.size // 2
    count = min(_LINES, reach // 64)
    if count == 0:
        return []
    spectrum = fft.rfft(curve * np.hanning(curve.size))
    power = spectrum.real**2 + spectrum.imag**2
    left = power.copy()
    left[: 2 * _FEWEST_PERIODS] = 0.0
    held = np.zeros(power.size, dtype=np.bool_)
    for _ in range(count):
        line = int(np.argmax(left))
        if left[line] < _FAINT * power[held].max(initial=0.0):
            break
        held[max(0, line - 2) : line + 3] = True
        left[max(0, line - 2) : line + 3] = 0.0
    if power[held].sum() < _LINE_SHARE * power.sum():
        return []
    # Only the middle half, where the window is not small.
    middle = slice(reach // 2, curve.size - reach // 2)
    clean = (fft.irfft(np.where(held, spectrum, 0.0), curve.size) / np.maximum(np.hanning(curve.size), 0.1))[middle]
    best = int(np.argmax(clean))
    tops = _tops(clean, best, _RIVAL * clean[best])
    # Two sounds that happen to share a note for a while give a few teeth; a tone gives them everywhere.
    if tops.size < 2 or tops.size * float(np.median(np.diff(tops))) < _TEETH_SHARE * clean.size:
        return []
    found = {lag - reach + middle.start + int(top) for top in (best, *tops)}
    return _nearest({each for each in found if first <= each <= last}, lag)


def _repetitions(pair: Pair, lag: int, first: int, last: int, needed: float) -> set[int]:
    """Return the lags around `lag` at which the loudest common stretch fits as well as at its best lag."""
    curve = _loud_curve(pair.white, lag)
    reach = curve.size // 2
    if reach < 2:
        return set()
    begin = max(0, first - lag + reach)
    curve = curve[begin : max(0, last - lag + reach) + 1]
    start = lag - reach + begin
    best = int(np.argmax(curve))
    if pair.agreement(start + best).height < needed:
        return set()
    tops = _tops(curve, best, _RIVAL * curve[best])
    return {start + int(top) for top in tops} | ({start + best} if tops.size else set())


def _high_points(pair: Pair, lag: int, lags: Lags, curve: Vector) -> list[int]:
    """Return the lags of the curve's highest points outside the main lobe of `lag`, best first."""
    peak = int(np.searchsorted(lags, lag))
    if peak >= lags.size:
        return []
    overlap = overlap_length(*pair.sizes, lags)
    high = _tops(curve, peak, 0.6 * curve[peak])
    high = high[overlap[high] >= 0.25 * overlap[peak]]
    best = high[np.argsort(-curve[high], kind="stable")[:_MOST_RIVALS]]
    return [int(each) for each in lags[best]]


def _tops(curve: Vector, peak: int, least: float) -> Lags:
    """Return where the curve has a maximum of at least `least`, outside the main lobe of `peak`."""
    begin, end = main_lobe(curve, peak)
    high = np.flatnonzero(curve >= least)
    high = high[((high < begin) | (high >= end)) & (high > 0) & (high < curve.size - 1)]
    return np.asarray(high[(curve[high] > curve[high - 1]) & (curve[high] >= curve[high + 1])])


def regular_spacing(rivals: tuple[int, ...], lag: int) -> float | None:
    """Return the spacing of evenly spaced rivals, within one sample or 2 %; None if they are irregular."""
    if len(rivals) < 2:
        return None
    places = np.array(sorted({*rivals, lag}), dtype=np.float64)
    apart = float(np.median(np.diff(places)))
    numbers = np.round((places - rivals[0]) / apart)
    if np.unique(numbers).size < 3:
        return None
    # By medians, because a lag that a method put between two teeth is not on the grid.
    spacing, _ = median_line(numbers, places)
    away = places - spacing * numbers
    regular = np.abs(away - np.median(away)) <= max(1.0, 0.02 * apart)
    if regular.mean() < _REGULAR or np.unique(numbers[regular]).size < 3:
        return None
    return float(np.polyfit(numbers[regular], places[regular], 1)[0])


Verdict: TypeAlias = Literal["sure", "ambiguous", "nothing"]
Reason: TypeAlias = Literal["clear", "drift", "repeats", "rivals", "chance", "too_little", "few_votes", "opposite_sign"]

MARGIN = 1.8
"""An agreement this many standard deviations above the highest expected by chance is not due to chance."""

_SAMPLED = 2**16
"""Points of a curve used to estimate its spread."""


@dataclass(frozen=True)
class LagJudgement:
    """The evidence for and against a lag.

    Attributes
    ----------
    verdict, reason
        ``"sure"``: ``"clear"``, or ``"drift"`` if the lag changes enough to smear the peak.
        ``"ambiguous"``: ``"repeats"`` (evenly spaced rivals) or ``"rivals"``.
        ``"nothing"``: ``"chance"``; ``"too_little"`` (too few samples carry the agreement to be convincing);
        ``"few_votes"``; ``"opposite_sign"`` (the recordings match only if one of them is inverted).
    rivals
        Lags as good as the one found, among those searched, nearest first; at most 16.
    spacing
        Distance between neighbouring rivals if they are evenly spaced, samples; otherwise None.
    evidence, needed
        Standard deviations by which the whitened recordings agree at the lag, and the number needed to be sure.
    height
        Height of the peak above the curve's median, in robust standard deviations (1.4826 · MAD); NaN without a curve.
    chance
        Height that the highest of as many lags reaches by chance: ``sqrt(2 ln N)``.
    ribbon
        The values between which chance keeps the curve, or None without a curve.
    opposite_lag
        The lag at which the inverted recording 2 fits, None if it does not fit better.
    drift
        How the lag changes over time, None if it cannot be measured.
    """

    verdict: Verdict
    reason: Reason
    rivals: tuple[int, ...] = ()
    spacing: float | None = None
    evidence: float = math.nan
    needed: float = math.nan
    height: float = math.nan
    chance: float = math.nan
    ribbon: tuple[float, float] | None = None
    opposite_lag: int | None = None
    drift: Drift | None = None


def judge(pair: Pair, found: FoundLag, reach: int) -> LagJudgement:
    """Return whether the lag found is reliable, whatever method found it.

    The height of a peak in its curve is not enough: the curve of two unrelated recordings with one loud event each is
    flat except where the events meet, and that peak can have any height. So the recordings are whitened
    (:mod:`stereolag.signals.whitening`) and their agreement at the lag is measured in standard deviations of chance.
    The highest of N lags reaches ``sqrt(2 ln N)`` by chance; ``MARGIN`` more is convincing.

    Parameters
    ----------
    pair
        The recordings, original and whitened.
    found
        The lag, with its curve or its votes if the method has them; there may be gaps between the lags of the curve.
    reach
        The largest ``|lag|`` that was searched.
    """
    first, last = lags_within(pair.sizes, reach)
    chance = math.sqrt(2 * math.log(last - first + 2))
    needed = chance + MARGIN
    agreement = pair.best_agreement(found.lag)
    rivals = tuple(rivals_of(pair, agreement, found, first, last, needed))
    if agreement.height < needed and not rivals:
        rivals = tuple(tone_rivals(pair, found.lag, first, last))
    drift = measure_drift(pair, found.lag)
    height, ribbon, opposite = math.nan, None, found.opposite_lag
    if found.correlation is not None and found.lags is not None:
        height, ribbon = _height(found.correlation, chance)
        lowest = int(np.argmin(found.correlation))
        if opposite is None and -found.correlation[lowest] > 1.1 * found.correlation.max():
            opposite = int(found.lags[lowest])
    if opposite is not None and -pair.agreement(opposite).height < max(needed, agreement.height):
        opposite = None
    verdict, reason = _decided(agreement, rivals, needed, drift, opposite, found.votes)
    if verdict != "ambiguous":
        rivals = ()
    return LagJudgement(
        verdict,
        reason,
        rivals,
        regular_spacing(rivals, found.lag),
        agreement.height,
        needed,
        height,
        chance,
        ribbon,
        opposite,
        drift if verdict == "sure" else None,
    )


def _decided(
    agreement: Agreement,
    rivals: tuple[int, ...],
    needed: float,
    drift: Drift | None,
    opposite: int | None,
    votes: dict[int, int] | None,
) -> tuple[Verdict, Reason]:
    if rivals:
        return "ambiguous", "repeats" if regular_spacing(rivals, agreement.lag) is not None else "rivals"
    if votes is not None and not enough_votes(votes, agreement.lag):
        return "nothing", "few_votes" if opposite is None else "opposite_sign"
    if drift is not None and drift.shows:
        return "sure", "drift"
    if agreement.height >= needed:
        return "sure", "clear"
    if opposite is not None:
        return "nothing", "opposite_sign"
    return "nothing", "too_little" if agreement.reachable < needed else "chance"


def _height(curve: Vector, chance: float) -> tuple[float, tuple[float, float]]:
    """Return the robust height of the highest point, and the values between which chance keeps the curve."""
    some = curve[:: max(1, curve.size // _SAMPLED)]
    middle = float(np.median(some))
    deviation = 1.4826 * float(np.median(np.abs(some - middle)))
    height = (float(curve.max()) - middle) / deviation if deviation > 0 else math.inf
    return height, (middle - chance * deviation, middle + chance * deviation)
