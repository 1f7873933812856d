"""Whether a lag can be relied on: the decision between all lags that the evidence speaks for.

The candidates are the highest peaks under every weight (:mod:`stereolag.signals.evidence`), each also with drift and
dropped buffers undone (:mod:`stereolag.signals.drift`), and all are scored by one measure.
The best is sure if it is beyond chance, no other fits as well, and no weight is as convinced of another lag.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Literal, NamedTuple, TypeAlias

import numpy as np
from scipy import fft

from stereolag.core.arrays import Indices, Vector
from stereolag.signals.correlation import (
    faded,
    loudest_stretch,
    overlap_length,
    overlap_pearson,
    overlap_slices,
)
from stereolag.signals.drift import follow_lag, median_line, with_steps_placed
from stereolag.signals.evidence import Evidence, Peak, Samples, needed_for, standardised
from stereolag.signals.over_time import LagOverTime, Stretch, on_first_clock
from stereolag.signals.peaks import main_lobe
from stereolag.signals.recordings import HeldRecording, Inverted, Recording
from stereolag.signals.search import FoundLag, enough_votes, lags_within

Recordings: TypeAlias = tuple[Recording, Recording]

Verdict: TypeAlias = Literal["sure", "ambiguous", "nothing"]
Reason: TypeAlias = Literal[
    "clear", "drift", "steps", "repeats", "rivals", "chance", "one_lag", "too_little", "few_votes", "opposite_sign"
]

_FEWEST = 16
"""Samples of a recording below which nothing can be told."""

LONGEST_JUDGED = 2**22
"""Samples of both recordings up to which they are judged as a whole."""

_SECTIONS, _SECTION = 16, 2**15
"""Number and most samples of the sections by which longer recordings are judged."""

_SECTION_REACH, _SECTION_MARGIN = 2000, 64
_TRIED = 4
"""Most lags around which the lag is followed over time."""

_OTHER_PLACES = 4
_AS_GOOD = 0.95
"""Share of the evidence without it from which on a drift or a step is believed."""

_RIVAL = 0.85
"""Another lag is as good from this share of the height on; noise alone lowers a tooth of a comb by a few per cent."""

_UNDOUBTED = 3.0
"""From this score on, more evidence only tells that the sections are of the clearer parts."""

_VISIBLE = 4.0
"""Pearson's correlation shows a lag from this many standard deviations of chance on."""

_STRETCH, _REACH = 2**16, 2**14
"""Length of the stretch searched for repetition, and largest distance between repeats, samples."""

_TOWERS = 2.0
"""From this many times what is needed on, a peak is beyond the level of chance, however few samples carry it."""

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
_SAMPLED = 2**15
"""Points of a curve used to estimate its spread."""


class Arrival(NamedTuple):
    """A lag at which the recordings agree beyond chance: the direct sound, an echo, or one of two sounds.

    Attributes
    ----------
    lag
        Samples, with its fraction.
    sigma
        Evidence in standard deviations of chance.
    """

    lag: float
    sigma: float


@dataclass(frozen=True)
class LagJudgement:
    """The evidence for and against a lag.

    Attributes
    ----------
    verdict, reason
        ``"sure"``: ``"clear"``, ``"drift"`` if the lag changes enough to smear the peak, or ``"steps"`` if it jumps.
        ``"ambiguous"``: ``"repeats"`` (evenly spaced rivals) or ``"rivals"``.
        ``"nothing"``: ``"chance"``; ``"one_lag"`` (chance too, and no lag but 0 was searched); ``"too_little"`` (too
        few samples carry the agreement to be convincing); ``"few_votes"``; ``"opposite_sign"`` (the recordings match
        only if one of them is inverted).
    lag
        The lag that the evidence speaks for, with its fraction, samples: with drift, in the middle of the longest
        stretch. The method's own lag if it speaks for none.
    rivals
        Lags as good as this one, among those searched, nearest first; at most 16.
    spacing
        Distance between neighbouring rivals if they are evenly spaced, samples; otherwise None.
    arrivals
        All lags found beyond chance, the one with the most evidence first.
    evidence, needed
        Evidence for the lag in standard deviations of chance, and the number needed to be sure.
    height
        Height of the peak above the curve's median, in robust standard deviations (1.4826 · MAD); NaN without a curve.
    chance
        Height that the highest of as many lags reaches by chance: ``sqrt(2 ln N)``.
    ribbon
        The values between which chance keeps the curve, or None without a curve.
    opposite_lag
        The lag at which the inverted recording 2 fits, None if it does not fit better.
    over_time
        How the lag changes over time, None if it cannot be measured.
    """

    verdict: Verdict
    reason: Reason
    lag: float
    rivals: tuple[int, ...] = ()
    spacing: float | None = None
    arrivals: tuple[Arrival, ...] = ()
    evidence: float = math.nan
    needed: float = math.nan
    height: float = math.nan
    chance: float = math.nan
    ribbon: tuple[float, float] | None = None
    opposite_lag: int | None = None
    over_time: LagOverTime | None = None

    @property
    def drift(self) -> LagOverTime | None:
        """The lag over time, by the name that earlier scripts read."""
        return self.over_time


@dataclass(frozen=True)
class _Alignment:
    """The evidence of both recordings, recording 2 read on the clock of recording 1 if the lag changes.

    Attributes
    ----------
    evidence, peaks
        The evidence, and its peaks, the most convincing first.
    shift
        The lag that is undone already, samples; with drift, the one in the middle of the longest stretch.
    over_time
        The lag over time, None if it could not be measured.
    others
        Lags of other alignments with as much evidence, samples.
    falls
        Whether the correlation reaches farther down than up before any drift is undone. Undoing one that is none raises
        a side lobe of inverted recordings above their trough.
    """

    evidence: Evidence
    peaks: list[Peak]
    shift: float = 0.0
    over_time: LagOverTime | None = None
    others: tuple[float, ...] = ()
    falls: bool = False

    @property
    def score(self) -> float:
        """Evidence of the best peak, in units of what is needed."""
        return self.peaks[0].score

    @property
    def lag(self) -> float:
        """Lag of the best peak, samples, by the weight with the narrowest lobe that has enough evidence.

        Within the lobe of a peak that is beyond chance, few lags are left to choose from. If the narrower lobes lead to
        two of them, as to neighbouring cycles, none counts.
        """
        best, lobes = self.peaks[0], {weight: curve.lobe for weight, curve in self.evidence.curves.items()}
        lobe = lobes[best.weight]
        least = min(1.0, needed_for(2 * lobe + 1) / self.evidence.needed)
        there = [peak for peak in self.peaks if abs(peak.lag - best.lag) <= lobe and lobes[peak.weight] < lobe]
        lags = [peak.lag for peak in there]
        agreed = [peak for peak in there if peak.score > least and max(lags) - min(lags) <= 1]
        return self.shift + min(agreed, key=lambda peak: lobes[peak.weight], default=best).lag

    @property
    def changes(self) -> bool:
        """Whether the lag changes enough to matter."""
        return self.over_time is not None and self.over_time.shows

    def contradicted_by(self, recordings: Recordings) -> list[float]:
        """Return the lags that fit as well, and those of which a weight is convinced that prefers another one.

        A horn blown twice fits itself again under one weight or another, but the sounds around it do not: far from the
        best, another lag fits without any weight as well.
        """
        lags = self.evidence.curves[self.peaks[0].weight].rivals(self.peaks[0])
        for weight in self.evidence.curves:
            leader = next((peak for peak in self.peaks if peak.weight == weight and peak.score > 1), None)
            if leader is not None and not self.is_at(self.shift + leader.lag):
                lags.append(leader.lag)
        found = [self.shift + lag for lag in lags] + [*self.others]
        if self.changes or not found:
            return found
        near = 4 * self.evidence.curves[self.peaks[0].weight].envelope + 32
        sizes = recordings[0].size, recordings[1].size
        overlap = overlap_length(*sizes, np.round([self.lag, *found]).astype(int))
        least = _RIVAL * overlap_pearson(*recordings, round(self.lag))
        if least < _RIVAL * _VISIBLE / math.sqrt(overlap[0]):
            return found
        # In a longer overlap, as much agreement is a smaller share.
        shares = np.maximum(overlap[1:] / overlap[0], 1).tolist()
        return [
            lag
            for lag, share in zip(found, shares, strict=True)
            if abs(lag - self.lag) <= near or share * overlap_pearson(*recordings, round(lag)) >= least
        ]

    @property
    def arrivals(self) -> tuple[Arrival, ...]:
        """All lags beyond chance, each once."""
        found: list[Arrival] = []
        for given in self.peaks if self.score > 1 else ():
            curve = self.evidence.curves[given.weight]
            apart = max(3, curve.envelope)
            if any(abs(self.shift + given.lag - one.lag) <= apart for one in found):
                continue
            peak = self.evidence.beside(given, [one.lag - self.shift for one in found])
            best = next(one for one in self.peaks if one.weight == peak.weight)
            if peak.score > 1 and (given is best or not curve.repeats(best, peak)):
                found.append(Arrival(self.shift + peak.lag, peak.score * self.evidence.needed))
        return tuple(found)

    def is_at(self, lag: float) -> bool:
        """Return whether a lag is the one of the best peak, at some time."""
        if self.over_time is not None and self.changes:
            return self.over_time.lowest - 3 <= lag <= self.over_time.highest + 3
        return abs(lag - self.lag) <= max(3, self.evidence.curves[self.peaks[0].weight].lobe)


def judge(recordings: Recordings, found: FoundLag, reach: int, *, bound: bool) -> LagJudgement:
    """Return the lag that the evidence speaks for, and whether it is reliable.

    Parameters
    ----------
    recordings
        The recordings.
    found
        The lag that a method found, with its curve or its votes if it has them; there may be gaps between the lags of
        the curve.
    reach
        The largest ``|lag|`` that was searched.
    bound
        Whether the verdict is on the lag found, whichever lag the evidence speaks for.
    """
    sizes = recordings[0].size, recordings[1].size
    first, last = lags_within(sizes, reach)
    chance = math.sqrt(2 * math.log(last - first + 2))
    needed = needed_for(last - first + 1)
    height, ribbon = (math.nan, None) if found.correlation is None else _height(found.correlation, chance)
    own = found.lag + found.fraction
    few_votes = found.votes is not None and not enough_votes(found.votes, found.lag)
    best: _Alignment | None = None
    opposite: int | None = None
    rivals: Sequence[float] = ()
    reason: Reason = "too_little"
    if min(sizes) >= _FEWEST:
        best = _best(recordings, found, first, last)
        if best.score <= 1 or best.falls or best.evidence.prefers_opposite(best.peaks[0]):
            opposite = _opposite(recordings, found, first, last, best)
        if opposite is not None:
            reason = "opposite_sign"
        elif best.score > 1:
            rivals = best.contradicted_by(recordings) + ([best.lag] if bound and not best.is_at(own) else [])
            if found.ties > 1:
                rivals += _high_points(found, recordings)
            reason = "rivals" if rivals else "few_votes" if few_votes else "clear"
        else:
            rivals = tone_rivals(recordings, found.lag, first, last)
            stands_out = any(peak.above > _TOWERS * needed and peak.carried < needed for peak in best.peaks)
            little = stands_out or best.peaks[0].carriers < needed
            reason = "few_votes" if few_votes else "too_little" if little else "chance"
            reason = "rivals" if rivals else "one_lag" if first == last else reason
    lag = own
    # The plain curve's fraction is finer than that of a weighted one, but its highest sample can be the wrong cycle.
    if best is not None and best.score > 1 and not bound and (best.changes or abs(best.lag - own) > 1):
        lag = own if any(abs(own - one) <= 1 for one in rivals) else best.lag
    whole = found.lag if abs(lag - found.lag) <= 0.5 else round(lag)
    others = [*rivals, best.lag] if rivals and best is not None and best.score > 1 else rivals
    nearest = _nearest({round(one) for one in others if first <= round(one) <= last and abs(one - lag) > 1}, whole)
    spacing = regular_spacing(nearest, whole)
    over_time = None
    if best is not None and reason == "clear":
        over_time = best.over_time
        if over_time is not None and best.changes:
            reason = "steps" if over_time.steps else "drift"
            over_time = with_steps_placed(*recordings, over_time)
    return LagJudgement(
        verdict="ambiguous" if reason == "rivals" else "sure" if reason in {"clear", "drift", "steps"} else "nothing",
        reason="repeats" if reason == "rivals" and spacing is not None else reason,
        lag=lag,
        rivals=nearest,
        spacing=spacing,
        arrivals=best.arrivals if best is not None and opposite is None else (),
        evidence=best.score * needed if best is not None else 0.0,
        needed=needed,
        height=height,
        chance=chance,
        ribbon=ribbon,
        opposite_lag=opposite,
        over_time=over_time,
    )


def judged_samples(size_1: int, size_2: int, *, held: bool) -> int:
    """Return the number of samples of both recordings that are judged, whether or not they are held in memory."""
    return min(size_1 + size_2, LONGEST_JUDGED if held else 2 * _SECTIONS * _SECTION)


def _whole(recordings: Recordings) -> bool:
    """Return whether recordings are judged as a whole."""
    held = all(isinstance(one, HeldRecording) for one in recordings)
    return held and sum(one.size for one in recordings) <= LONGEST_JUDGED


def _best(recordings: Recordings, found: FoundLag, first: int, last: int) -> _Alignment:
    """Return the alignment with the most evidence, among those of the candidates and their lags over time."""
    searched = last - first + 1
    if not _whole(recordings):
        places = [found.lag, *_high_points(found, recordings)]
        every = [_by_sections(recordings, lag, searched) for lag in places]
        best = max(every, key=lambda one: one.score)
        alike = [
            one
            for one in every
            if one.score > max(1, _RIVAL * (best.score if best.changes else min(best.score, _UNDOUBTED)))
        ]
        best = alike[0] if alike else best
        others = tuple(one.lag for one in alike if not best.is_at(one.lag))
        return replace(best, others=others, falls=found.opposite_lag is not None)
    samples_1, samples_2 = (standardised(one.part(0, one.size)) for one in recordings)
    held = HeldRecording(samples_1), HeldRecording(samples_2)
    straight = Evidence(samples_1, samples_2, first, last, searched)
    best = _Alignment(straight, straight.peaks((found.lag,)))
    falls = straight.prefers_opposite(best.peaks[0])
    tried: list[float] = []
    order = sorted(best.peaks, key=lambda peak: -peak.score - 0.05 * peak.above / straight.needed)
    smeared = [] if best.score > 1 else straight.smeared()
    for lag in [*smeared, *(peak.lag for peak in order)]:
        common = overlap_slices(samples_1.size, samples_2.size, round(lag))[0]
        reach = 0.008 * (common.stop - common.start)
        if len(tried) >= (1 if best.score > 1 else _TRIED):
            break
        if any(abs(lag - other) <= max(48, reach) for other in tried):
            continue
        tried.append(lag)
        apart = [abs(other.lag - lag) for other in best.peaks if other.score > 1]
        near = 48 + round(max(apart, default=0))
        over_time = follow_lag(*held, round(lag), near)
        if over_time is None:
            continue
        if abs(over_time.span) < 0.5 and not over_time.steps:
            if best.over_time is None and best.is_at(over_time.middle):
                best = replace(best, over_time=over_time)
            continue
        found_there = _along(over_time, samples_1, samples_2, searched)
        if not _pays_its_steps(found_there, over_time, searched, samples_1.size):
            continue
        same = best.score > 1 and abs(best.lag - lag) <= max(48, 1.5 * reach) and over_time.shows
        # Undoing a lag that does change raises the peak over the whole curve too, not only over what lies around.
        higher = found_there.peaks[0].above >= _AS_GOOD * best.peaks[0].above
        if higher and found_there.score > best.score * (_AS_GOOD if same else 1.0):
            best = found_there
    return replace(best, falls=falls)


def _along(over_time: LagOverTime, samples_1: Samples, samples_2: Samples, searched: int) -> _Alignment:
    """Return the evidence for a lag over time: recording 2 is read on the clock of recording 1."""
    moved = on_first_clock(samples_2, over_time, 0, samples_1.size)
    evidence = Evidence(samples_1, moved, 1 - samples_1.size, samples_1.size - 1, searched)
    peaks = evidence.peaks()
    near = abs(peaks[0].lag) < 48
    return _Alignment(evidence, peaks, over_time.middle, over_time.moved(peaks[0].lag) if near else None)


def _by_sections(recordings: Recordings, lag: int, searched: int, *, may_change: bool = True) -> _Alignment:
    """Return the evidence for a lag of long recordings, by sections of them one after the other."""
    common = overlap_slices(recordings[0].size, recordings[1].size, lag)[0]
    over_time = follow_lag(*recordings, lag) if may_change else None
    line = over_time if over_time and over_time.shows else LagOverTime((Stretch(common.start, common.stop, lag, 0.0),))
    size = min(_SECTION, (common.stop - common.start) // _SECTIONS)
    starts = np.linspace(common.start, common.stop - size, _SECTIONS).astype(int).tolist()
    parts = []
    for start in starts:
        begin = start + math.floor(line.lag_at(start + size / 2)) - _SECTION_MARGIN
        part = recordings[1].part(begin, begin + size + 2 * _SECTION_MARGIN)
        if line is over_time:
            part = on_first_clock(part, line.seen_from(start, begin), start, size).astype(np.float64)
        else:
            part = part[_SECTION_MARGIN : _SECTION_MARGIN + size]
        # Faded, since the cuts would be clicks that both have in common.
        parts.append((faded(recordings[0].part(start, start + size)), faded(part)))
    samples_1, samples_2 = (standardised(np.concatenate(each)) for each in zip(*parts, strict=True))
    evidence = Evidence(samples_1, samples_2, -_SECTION_REACH, _SECTION_REACH, searched)
    peaks = evidence.peaks((0.0,))
    if line is not over_time:
        return _Alignment(evidence, peaks, lag, over_time)
    found = _Alignment(evidence, peaks, line.middle, line.moved(peaks[0].lag))
    if not _pays_its_steps(found, line, searched, recordings[0].size):
        return _by_sections(recordings, lag, searched, may_change=False)
    return found


def _pays_its_steps(found: _Alignment, over_time: LagOverTime, searched: int, size: int) -> bool:
    """Return whether there is more evidence than for the best of all lags over time with as many steps."""
    steps = len(over_time.steps)
    return not steps or found.score * found.evidence.needed > needed_for(searched, steps, size)


def _high_points(found: FoundLag, recordings: Recordings) -> list[int]:
    """Return the lags of the highest points of a curve outside the main lobe of the lag found, best first."""
    if found.lags is None or found.correlation is None:
        return []
    peak = int(np.searchsorted(found.lags, found.lag))
    overlap = overlap_length(recordings[0].size, recordings[1].size, found.lags)
    high = _tops(found.correlation, peak, 0.6 * found.correlation[peak])
    high = high[overlap[high] >= 0.25 * overlap[peak]]
    best = high[np.argsort(-found.correlation[high], kind="stable")[:_OTHER_PLACES]]
    return [int(each) for each in found.lags[best]]


def _opposite(recordings: Recordings, found: FoundLag, first: int, last: int, best: _Alignment) -> int | None:
    """Return the lag at which the inverted recording 2 fits beyond chance and clearly better than at the best lag."""
    searched = last - first + 1
    if not _whole(recordings):
        lag = found.opposite_lag
        if lag is None and found.lags is not None and found.correlation is not None:
            lag = int(found.lags[np.argmin(found.correlation)])
        if lag is None:
            return None
        inverted = _by_sections((recordings[0], Inverted(recordings[1])), lag, searched)
    else:
        samples_1, samples_2 = (standardised(one.part(0, one.size)) for one in recordings)
        evidence = Evidence(samples_1, -samples_2, first, last, searched)
        inverted = _Alignment(evidence, evidence.peaks())
        if best.over_time is not None and best.changes:
            followed = _along(best.over_time, samples_1, -samples_2, searched)
            inverted = max(inverted, followed, key=lambda one: one.score)
    if inverted.score <= 1 or (best.score > 1 and not inverted.peaks[0].is_above(best.peaks[0])):
        return None
    return round(inverted.lag)


def _nearest(found: set[int], lag: int) -> tuple[int, ...]:
    return tuple(sorted(found - {lag}, key=lambda other: (abs(other - lag), other))[:_MOST_RIVALS])


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


def tone_rivals(recordings: Recordings, lag: int, first: int, last: int) -> tuple[int, ...]:
    """Return the lags around `lag` at which tones common to both recordings line up.

    Whitening removes tones, and noise hides their teeth in the curve of the loudest common stretch. Its spectrum shows
    them: a few lines contain most of its power. The curve rebuilt from these lines alone has the teeth, not the noise.
    """
    parts = loudest_stretch(*recordings, lag, _STRETCH)
    one, other = (whole.part(part.start, part.stop) for whole, part in zip(recordings, parts, strict=True))
    reach = min(_REACH, one.size // 2)
    curve = local_curve(one, other, reach)  # `lag` is in its middle
    count = min(_LINES, reach // 64)
    if count == 0:
        return ()
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
        return ()
    # Only the middle half, where the window is not small.
    middle = slice(reach // 2, curve.size - reach // 2)
    clean = (fft.irfft(np.where(held, spectrum, 0.0), curve.size) / np.maximum(np.hanning(curve.size), 0.1))[middle]
    best = int(np.argmax(clean))
    tops = _tops(clean, best, _RIVAL * clean[best])
    # Two sounds that happen to share a note for a while give a few teeth; a tone gives them everywhere.
    if tops.size < 2 or tops.size * float(np.median(np.diff(tops))) < _TEETH_SHARE * clean.size:
        return ()
    found = {lag - reach + middle.start + int(top) for top in (best, *tops)}
    return _nearest({each for each in found if first <= each <= last}, lag)


def _tops(curve: Vector, peak: int, least: float) -> Indices:
    """Return where the curve has a maximum of at least `least`, outside the main lobe of `peak`."""
    begin, end = main_lobe(curve, peak)
    high = np.flatnonzero(curve >= least)
    high = high[((high < begin) | (high >= end)) & (high > 0) & (high < curve.size - 1)]
    return np.asarray(high[(curve[high] > curve[high - 1]) & (curve[high] >= curve[high + 1])])


def regular_spacing(rivals: Sequence[int], lag: int) -> float | None:
    """Return the spacing of evenly spaced rivals, within one sample or 2 %; None if they are irregular.

    Some may be missing in between.
    """
    if len(rivals) < 2:
        return None
    places = np.array(sorted({*rivals, lag}), dtype=np.float64)
    apart = np.diff(places)
    for least, share in ((float(np.median(apart)), _REGULAR), (float(apart.min()), 1.0)):
        numbers = np.round((places - rivals[0]) / least)
        if np.unique(numbers).size < 3:
            continue
        # By medians, because a lag that a method put between two teeth is not on the grid.
        spacing, _ = median_line(numbers, places)
        away = places - spacing * numbers
        regular = np.abs(away - np.median(away)) <= max(min(1.0, least / 8), 0.02 * least)
        if regular.mean() >= share and np.unique(numbers[regular]).size >= 3:
            return float(np.polyfit(numbers[regular], places[regular], 1)[0])
    return None


def _height(curve: Vector, chance: float) -> tuple[float, tuple[float, float]]:
    """Return the robust height of the highest point, and the values between which chance keeps the curve."""
    some = curve[:: max(1, curve.size // _SAMPLED)]
    middle = float(np.median(some))
    deviation = 1.4826 * float(np.median(np.abs(some - middle)))
    height = (float(curve.max()) - middle) / deviation if deviation > 0 else math.inf
    return height, (middle - chance * deviation, middle + chance * deviation)
