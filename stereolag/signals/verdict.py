"""Whether a lag can be relied on: the decision between the lags that have evidence.

The candidates are the highest peaks under every weight (:mod:`stereolag.signals.evidence`), each also with drift and
dropped buffers undone (:mod:`stereolag.signals.drift`). All are scored by one measure. The best is sure if it is beyond
chance, no other lag fits as well, and no weight has convincing evidence for another lag.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
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
from stereolag.signals.drift import follow_lag, median_line
from stereolag.signals.evidence import MEDIAN_POINTS, Evidence, Peak, Samples, needed_for, standardised
from stereolag.signals.over_time import LagOverTime, Stretch, on_first_clock
from stereolag.signals.peaks import main_lobe
from stereolag.signals.recordings import HeldRecording, Inverted, Recording
from stereolag.signals.search import FoundLag, enough_votes, lags_within

Recordings: TypeAlias = tuple[Recording, Recording]

Verdict: TypeAlias = Literal["sure", "ambiguous", "nothing"]
Reason: TypeAlias = Literal[
    "clear", "drift", "steps", "repeats", "rivals", "chance", "one_lag", "too_little", "few_votes", "opposite_sign"
]

_MIN_SAMPLES = 16
"""Samples of the shorter recording below which there is no verdict."""

MAX_JUDGED_WHOLE = 2**22
"""Samples of both recordings together up to which they are judged as a whole."""

_SECTIONS = 16
"""Sections by which longer recordings are judged."""

_MIN_SECTION_LENGTH = 64
"""Samples; a shorter overlap has fewer sections."""

_MAX_SECTION_LENGTH = 2**15
"""Samples; longest section."""

_SECTION_REACH = 2000
"""Largest lag at which sections are correlated, beyond the one they are aligned by, samples."""

_SECTION_MARGIN = 64
"""Samples of recording 2 read on either side of a section."""

_MAX_FOLLOWED_LAGS = 4
"""Lags that are followed over time, as long as there is no evidence for one."""

_MAX_OTHER_LAGS = 4
"""High points of the curve of long recordings that are judged besides the lag found."""

_MIN_CLEAR_GAIN = 1.1
"""Gain in height from which on a drift or step is believed although the evidence is less: chance gains 5 %."""

_MIN_RIVAL_HEIGHT = 0.85
"""Share of the height from which on another lag is as good; noise lowers a tooth of a comb by a few per cent."""

_MAX_COMPARED_SCORE = 3.0
"""Score above which more evidence only means that the sections fall on the clearer parts of the recordings."""

_MIN_VISIBLE_HEIGHT = 4.0
"""Standard deviations of chance from which on Pearson's correlation shows a lag."""

_TONE_STRETCH = 2**16
"""Samples of the stretch that is searched for tones."""

_TONE_REACH = 2**14
"""Largest distance between the teeth of a tone, samples."""

_MIN_TOWERING_RATIO = 2.0
"""Multiple of the evidence needed from which on a peak is no chance level, however few samples contribute to it."""

_MAX_LINES = 8
"""Lines in the spectrum of a tonal curve, at most."""

_MIN_LINE_SHARE = 0.7
"""Share of the power of a tonal curve that its lines contain at least."""

_MIN_PERIODS = 8
"""Periods of a tone within the reach, at least."""

_MIN_LINE_POWER = 0.05
"""Share of the strongest line's power below which a line is noise."""

_MIN_TEETH_SHARE = 0.5
"""Share of the curve over which the teeth of a tone extend at least."""

_MIN_REGULAR_SHARE = 0.75
"""Share of the rivals that are evenly spaced, at least."""


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
        ``"nothing"``: ``"chance"``; ``"one_lag"`` (chance too, and only one lag was searched); ``"too_little"`` (too
        few samples contribute to the agreement); ``"few_votes"``; ``"opposite_sign"`` (the recordings match
        only if one of them is inverted).
    lag
        The lag with the most evidence, including its fraction, samples; with drift, in the middle of the longest
        stretch. The method's own lag if there is no evidence for any.
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
    """The evidence of both recordings, recording 2 resampled to the clock of recording 1 if the lag changes.

    Attributes
    ----------
    evidence, peaks
        The evidence, and its peaks, the most convincing first.
    shift
        Lag by which recording 2 is moved already, samples; with drift, that in the middle of the longest stretch.
    over_time
        The lag over time, None if it could not be measured.
    others
        Lags of other alignments with as much evidence, samples.
    prefers_opposite
        Whether the correlation has a deeper trough than its peak before any drift is undone. Undoing a spurious drift
        raises a side lobe of inverted recordings above their trough.
    """

    evidence: Evidence
    peaks: list[Peak]
    shift: float = 0.0
    over_time: LagOverTime | None = None
    others: tuple[float, ...] = ()
    prefers_opposite: bool = False

    @property
    def score(self) -> float:
        """Evidence of the best peak over that needed."""
        return self.peaks[0].score

    @property
    def lag(self) -> float:
        """Lag of the best peak, samples, measured under the weight with the narrowest lobe that has enough evidence.

        That takes less evidence, since few lags are within the lobe of a peak. Narrower lobes with different lags, or
        of a neighbouring cycle, are ignored.
        """
        best, lobes = self.peaks[0], {weight: curve.lobe for weight, curve in self.evidence.curves.items()}
        lobe = lobes[best.weight]
        min_score = min(1.0, needed_for(2 * lobe + 1) / self.evidence.needed)
        curve = self.evidence.curves[best.weight]
        narrower = [
            peak
            for peak in self.peaks
            if abs(peak.lag - best.lag) <= lobe and lobes[peak.weight] < lobe and curve.is_one_peak(best.lag, peak.lag)
        ]
        lags = [peak.lag for peak in narrower]
        convincing = [peak for peak in narrower if peak.score > min_score and max(lags) - min(lags) <= 1]
        return self.shift + min(convincing, key=lambda peak: lobes[peak.weight], default=best).lag

    def gain_over(self, other: _Alignment) -> float:
        """Return the ratio of the heights at the best peaks of this alignment and another; the least of all weights.

        Undoing a real change of the lag adds the agreement of the rest under every weight.
        """
        curves, others = self.evidence.curves, other.evidence.curves
        lag, other_lag = self.peaks[0].lag, other.peaks[0].lag
        return min(
            curves[one].height_at(lag) / max(others[one].height_at(other_lag), 1e-30)
            for one in curves.keys() & others.keys()
        )

    @property
    def changes(self) -> bool:
        """Whether the lag changes enough to matter."""
        return self.over_time is not None and self.over_time.changes

    def rivals(self, recordings: Recordings) -> list[float]:
        """Return the lags that fit as well as the best, and those that another weight has convincing evidence for.

        A horn blown twice fits itself again under one weight or another, but the sounds around it do not: far from the
        best lag, a rival must also fit without any weight.
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
        overlap = overlap_length(recordings[0].size, recordings[1].size, np.round([self.lag, *found]).astype(int))
        min_pearson = _MIN_RIVAL_HEIGHT * overlap_pearson(*recordings, round(self.lag))
        if min_pearson < _MIN_RIVAL_HEIGHT * _MIN_VISIBLE_HEIGHT / math.sqrt(overlap[0]):
            return found
        # The same agreement is a smaller share of a longer overlap.
        factors = np.maximum(overlap[1:] / overlap[0], 1).tolist()
        return [
            lag
            for lag, factor in zip(found, factors, strict=True)
            if abs(lag - self.lag) <= near or factor * overlap_pearson(*recordings, round(lag)) >= min_pearson
        ]

    @property
    def arrivals(self) -> tuple[Arrival, ...]:
        """All lags beyond chance, each once."""
        if self.score <= 1:
            return ()
        found = self._with_arrivals((), self.peaks)
        # Two louder echoes hide the direct sound.
        return self._with_arrivals(found, self.evidence.lower_peaks(self.peaks[0])) if len(found) > 1 else found

    def _with_arrivals(self, known: tuple[Arrival, ...], peaks: Iterable[Peak]) -> tuple[Arrival, ...]:
        """Return arrivals with those of more peaks that are beyond chance beside them."""
        found = [*known]
        for candidate in peaks:
            curve = self.evidence.curves[candidate.weight]
            apart = max(3, curve.envelope)
            if any(abs(self.shift + candidate.lag - arrival.lag) <= apart for arrival in found):
                continue
            peak = self.evidence.beside(candidate, [arrival.lag - self.shift for arrival in found])
            best = next(other for other in self.peaks if other.weight == peak.weight)
            if peak.score > 1 and (candidate is best or not curve.repeats(best, peak)):
                found.append(Arrival(self.shift + peak.lag, peak.score * self.evidence.needed))
        return tuple(found)

    def is_at(self, lag: float) -> bool:
        """Return whether a lag is that of the best peak at some time."""
        if self.over_time is not None and self.changes:
            return self.over_time.lowest - 3 <= lag <= self.over_time.highest + 3
        return abs(lag - self.lag) <= max(3, self.evidence.curves[self.peaks[0].weight].lobe)


def judge(recordings: Recordings, found: FoundLag, reach: int, *, fixed: bool) -> LagJudgement:
    """Return the lag with the most evidence, and whether it is reliable.

    Parameters
    ----------
    recordings
        The recordings.
    found
        The lag that a method found, with its curve or votes if it has them; the lags of the curve may have gaps.
    reach
        The largest ``|lag|`` that was searched.
    fixed
        Whether to judge the lag found, even if another one has more evidence.
    """
    sizes = recordings[0].size, recordings[1].size
    first, last = lags_within(sizes, reach)
    chance = math.sqrt(2 * math.log(last - first + 2))
    needed = needed_for(last - first + 1)
    height, ribbon = (math.nan, None) if found.correlation is None else _robust_height(found.correlation, chance)
    own = found.lag + found.fraction
    if min(sizes) < _MIN_SAMPLES:
        return LagJudgement(
            "nothing", "too_little", own, evidence=0.0, needed=needed, height=height, chance=chance, ribbon=ribbon
        )
    searched = range(first, last + 1)
    best = _best(recordings, found, searched)
    opposite = None
    if best.score <= 1 or best.prefers_opposite or best.evidence.prefers_opposite(best.peaks[0]):
        opposite = _opposite(recordings, found, searched, best)
    few_votes = found.votes is not None and not enough_votes(found.votes, found.lag)
    rivals: Sequence[float] = ()
    reason: Reason = "opposite_sign"
    if opposite is None and best.score > 1:
        rivals = best.rivals(recordings) + ([best.lag] if fixed and not best.is_at(own) else [])
        if found.ties > 1:
            rivals += _high_lags(found, recordings)
        reason = "rivals" if rivals else "few_votes" if few_votes else "clear"
    elif opposite is None:
        rivals = tone_rivals(recordings, found.lag, first, last)
        stands_out = any(
            peak.global_height > _MIN_TOWERING_RATIO * needed and peak.agreement < needed for peak in best.peaks
        )
        too_few_samples = stands_out or best.peaks[0].max_agreement < needed
        reason = "few_votes" if few_votes else "too_little" if too_few_samples else "chance"
        reason = "rivals" if rivals else "one_lag" if first == last else reason
    lag = own
    # The plain curve's fraction is more precise than a weighted one's, but its highest sample can be the wrong cycle.
    if best.score > 1 and not fixed and (best.changes or abs(best.lag - own) > 1):
        lag = own if any(abs(own - rival) <= 1 for rival in rivals) else best.lag
    whole = found.rounded(lag)
    others = [*rivals, best.lag] if rivals and best.score > 1 else rivals
    within = {round(other) for other in others if round(other) in searched and abs(other - lag) > 1}
    nearest = _nearest_rivals(within, whole)
    spacing = regular_spacing(nearest, whole)
    over_time = best.over_time if reason == "clear" else None
    if over_time is not None and best.changes:
        reason = "steps" if over_time.steps else "drift"
    return LagJudgement(
        verdict="ambiguous" if reason == "rivals" else "sure" if reason in {"clear", "drift", "steps"} else "nothing",
        reason="repeats" if reason == "rivals" and spacing is not None else reason,
        lag=lag,
        rivals=nearest,
        spacing=spacing,
        arrivals=best.arrivals if opposite is None else (),
        evidence=best.score * needed,
        needed=needed,
        height=height,
        chance=chance,
        ribbon=ribbon,
        opposite_lag=opposite,
        over_time=over_time,
    )


def judged_samples(size_1: int, size_2: int, *, held: bool) -> int:
    """Return the number of samples of both recordings that are judged; `held` if the recordings are in memory."""
    return min(size_1 + size_2, MAX_JUDGED_WHOLE if held else 2 * _SECTIONS * _MAX_SECTION_LENGTH)


def _judged_whole(recordings: Recordings) -> bool:
    """Return whether recordings are judged as a whole."""
    held = all(isinstance(recording, HeldRecording) for recording in recordings)
    return held and sum(recording.size for recording in recordings) <= MAX_JUDGED_WHOLE


def _best(recordings: Recordings, found: FoundLag, searched: range) -> _Alignment:
    """Return the alignment with the most evidence, of those at the candidate lags and at their lags over time."""
    if not _judged_whole(recordings):
        return _best_by_sections(recordings, found, searched)
    samples_1, samples_2 = (standardised(recording.part(0, recording.size)) for recording in recordings)
    held = HeldRecording(samples_1), HeldRecording(samples_2)
    straight = Evidence(samples_1, samples_2, searched[0], searched[-1], len(searched))
    best = _Alignment(straight, straight.peaks((found.lag,)))
    prefers_opposite = straight.prefers_opposite(best.peaks[0])
    followed: list[float] = []
    order = sorted(best.peaks, key=lambda peak: -peak.score - 0.05 * peak.global_height / straight.needed)
    smeared = [] if best.score > 1 else straight.smeared()
    for lag in [*smeared, *(peak.lag for peak in order)]:
        common = overlap_slices(samples_1.size, samples_2.size, round(lag))[0]
        reach = 0.008 * (common.stop - common.start)
        if len(followed) >= (1 if best.score > 1 else _MAX_FOLLOWED_LAGS):
            break
        if any(abs(lag - other) <= max(48, reach) for other in followed):
            continue
        followed.append(lag)
        apart = [abs(other.lag - lag) for other in best.peaks if other.score > 1]
        near = 48 + round(max(apart, default=0))
        over_time = follow_lag(*held, round(lag), near)
        if over_time is None:
            continue
        if abs(over_time.span) < 0.5 and not over_time.steps:
            if best.over_time is None and best.is_at(over_time.middle):
                best = replace(best, over_time=over_time)
            continue
        alignment = _aligned_by(over_time, samples_1, samples_2, len(searched))
        if round(alignment.lag) not in searched:
            continue
        if not _justifies_steps(alignment, over_time, len(searched), samples_1.size):
            continue
        gain = alignment.gain_over(best)
        # Evidence is limited by the samples that contribute, which differ from weight to weight.
        enough = min(best.score, 1.0) if over_time.changes and gain > _MIN_CLEAR_GAIN else best.score
        # The heights of peaks say nothing of an inverted recording, which has troughs instead.
        if (gain > 1 or prefers_opposite) and alignment.score > enough:
            best = alignment
    return replace(best, prefers_opposite=prefers_opposite)


def _best_by_sections(recordings: Recordings, found: FoundLag, searched: range) -> _Alignment:
    """Return the alignment of long recordings with the most evidence, at the lag found or another high point."""
    alignments = [_by_sections(recordings, lag, searched) for lag in (found.lag, *_high_lags(found, recordings))]
    best = max(alignments, key=lambda alignment: alignment.score)
    min_score = max(1, _MIN_RIVAL_HEIGHT * (best.score if best.changes else min(best.score, _MAX_COMPARED_SCORE)))
    equal = [alignment for alignment in alignments if alignment.score > min_score]
    best = equal[0] if equal else best
    others = tuple(alignment.lag for alignment in equal if not best.is_at(alignment.lag))
    return replace(best, others=others, prefers_opposite=found.opposite_lag is not None)


def _aligned_by(over_time: LagOverTime, samples_1: Samples, samples_2: Samples, searched: int) -> _Alignment:
    """Return the alignment by a lag over time, with recording 2 resampled to the clock of recording 1."""
    moved = on_first_clock(samples_2, over_time, 0, samples_1.size)
    evidence = Evidence(samples_1, moved, 1 - samples_1.size, samples_1.size - 1, searched)
    peaks = evidence.peaks()
    near = abs(peaks[0].lag) < 48
    return _Alignment(evidence, peaks, over_time.middle, over_time.shifted(peaks[0].lag) if near else None)


def _by_sections(recordings: Recordings, lag: int, searched: range, *, may_change: bool = True) -> _Alignment:
    """Return the alignment of long recordings at a lag, by sections of them, joined.

    With `may_change`, the lag is followed over time, as far as it stays among those searched.
    """
    common = overlap_slices(recordings[0].size, recordings[1].size, lag)[0]
    over_time = follow_lag(*recordings, lag) if may_change else None
    line = (
        over_time if over_time and over_time.changes else LagOverTime((Stretch(common.start, common.stop, lag, 0.0),))
    )
    length = common.stop - common.start
    sections = min(_SECTIONS, max(1, length // _MIN_SECTION_LENGTH))
    size = min(_MAX_SECTION_LENGTH, length // sections)
    starts = np.linspace(common.start, common.stop - size, sections).astype(int).tolist()
    parts = []
    for start in starts:
        begin = start + math.floor(line.lag_at(start + size / 2)) - _SECTION_MARGIN
        part = recordings[1].part(begin, begin + size + 2 * _SECTION_MARGIN)
        if line is over_time:
            part = on_first_clock(part, line.stretch_at(start).for_part(begin), start, size).astype(np.float64)
        else:
            part = part[_SECTION_MARGIN : _SECTION_MARGIN + size]
        # Faded, since the cuts would be clicks common to both.
        parts.append((faded(recordings[0].part(start, start + size)), faded(part)))
    samples_1, samples_2 = (standardised(np.concatenate(each)) for each in zip(*parts, strict=True))
    reach = min(_SECTION_REACH, samples_1.size - 1)
    evidence = Evidence(samples_1, samples_2, -reach, reach, len(searched))
    base = line.middle if line is over_time else lag
    peaks = evidence.peaks((0.0,))
    peaks = [peak for peak in peaks if round(base + peak.lag) in searched] or peaks
    if line is not over_time:
        return _Alignment(evidence, peaks, lag, over_time)
    found = _Alignment(evidence, peaks, line.middle, line.shifted(peaks[0].lag))
    if round(found.lag) not in searched or not _justifies_steps(found, line, len(searched), recordings[0].size):
        return _by_sections(recordings, lag, searched, may_change=False)
    return found


def _justifies_steps(found: _Alignment, over_time: LagOverTime, searched: int, size: int) -> bool:
    """Return whether there is more evidence than chance gives the best of all lags over time with as many steps."""
    steps = len(over_time.steps)
    return not steps or found.score * found.evidence.needed > needed_for(searched, steps, size)


def _high_lags(found: FoundLag, recordings: Recordings) -> list[int]:
    """Return the lags of the highest points of a curve outside the main lobe of its peak, highest first."""
    if found.lags is None or found.correlation is None:
        return []
    peak = int(np.searchsorted(found.lags, found.lag))
    overlap = overlap_length(recordings[0].size, recordings[1].size, found.lags)
    high = _tops(found.correlation, peak, 0.6 * found.correlation[peak])
    high = high[overlap[high] >= 0.25 * overlap[peak]]
    best = high[np.argsort(-found.correlation[high], kind="stable")[:_MAX_OTHER_LAGS]]
    return [int(each) for each in found.lags[best]]


def _opposite(recordings: Recordings, found: FoundLag, searched: range, best: _Alignment) -> int | None:
    """Return the lag at which the inverted recording 2 fits beyond chance and clearly better than at the best lag.

    None if there is no such lag.
    """
    if not _judged_whole(recordings):
        lag = found.opposite_lag
        if lag is None and found.lags is not None and found.correlation is not None:
            lag = int(found.lags[np.argmin(found.correlation)])
        if lag is None:
            return None
        inverted = _by_sections((recordings[0], Inverted(recordings[1])), lag, searched)
    else:
        samples_1, samples_2 = (standardised(recording.part(0, recording.size)) for recording in recordings)
        evidence = Evidence(samples_1, -samples_2, searched[0], searched[-1], len(searched))
        inverted = _Alignment(evidence, evidence.peaks())
        if best.over_time is not None and best.changes:
            followed = _aligned_by(best.over_time, samples_1, -samples_2, len(searched))
            inverted = max(inverted, followed, key=lambda alignment: alignment.score)
    peak = inverted.peaks[0]
    turned = best.score > 1 and inverted.evidence.curves[peak.weight].is_one_sided(peak.lag)
    if inverted.score <= 1 or turned or (best.score > 1 and not peak.is_clearly_above(best.peaks[0])):
        return None
    return round(inverted.lag)


def _nearest_rivals(rivals: set[int], lag: int) -> tuple[int, ...]:
    """Return the 16 rivals nearest to a lag."""
    return tuple(sorted(rivals - {lag}, key=lambda other: (abs(other - lag), other))[:16])


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

    Whitening removes tones, and noise hides their teeth in the correlation of the loudest common stretch. The spectrum
    of that curve shows them: a few lines contain most of its power. The curve rebuilt from these lines alone has the
    teeth without the noise.
    """
    parts = loudest_stretch(*recordings, lag, _TONE_STRETCH)
    first_part, second_part = (
        recording.part(part.start, part.stop) for recording, part in zip(recordings, parts, strict=True)
    )
    reach = min(_TONE_REACH, first_part.size // 2)
    curve = local_curve(first_part, second_part, reach)  # `lag` is in its middle
    count = min(_MAX_LINES, reach // 64)
    if count == 0:
        return ()
    spectrum = fft.rfft(curve * np.hanning(curve.size))
    power = spectrum.real**2 + spectrum.imag**2
    residual = power.copy()
    residual[: 2 * _MIN_PERIODS] = 0.0
    in_lines = np.zeros(power.size, dtype=np.bool_)
    for _ in range(count):
        line = int(np.argmax(residual))
        if residual[line] < _MIN_LINE_POWER * power[in_lines].max(initial=0.0):
            break
        in_lines[max(0, line - 2) : line + 3] = True
        residual[max(0, line - 2) : line + 3] = 0.0
    if power[in_lines].sum() < _MIN_LINE_SHARE * power.sum():
        return ()
    # Only the middle half, where the window is large.
    middle = slice(reach // 2, curve.size - reach // 2)
    clean = (fft.irfft(np.where(in_lines, spectrum, 0.0), curve.size) / np.maximum(np.hanning(curve.size), 0.1))[middle]
    best = int(np.argmax(clean))
    tops = _tops(clean, best, _MIN_RIVAL_HEIGHT * clean[best])
    # Two sounds that share a note for a while have a few teeth; a tone has them everywhere.
    if tops.size < 2 or tops.size * float(np.median(np.diff(tops))) < _MIN_TEETH_SHARE * clean.size:
        return ()
    found = {lag - reach + middle.start + int(top) for top in (best, *tops)}
    return _nearest_rivals({each for each in found if first <= each <= last}, lag)


def _tops(curve: Vector, peak: int, min_height: float) -> Indices:
    """Return the indices of the maxima of at least `min_height` outside the main lobe of `peak`."""
    begin, end = main_lobe(curve, peak)
    high = np.flatnonzero(curve >= min_height)
    high = high[((high < begin) | (high >= end)) & (high > 0) & (high < curve.size - 1)]
    return np.asarray(high[(curve[high] > curve[high - 1]) & (curve[high] >= curve[high + 1])])


def regular_spacing(rivals: Sequence[int], lag: int) -> float | None:
    """Return the spacing of evenly spaced rivals, within one sample or 2 %; None if they are irregular.

    Some may be missing.
    """
    if len(rivals) < 2:
        return None
    places = np.array(sorted({*rivals, lag}), dtype=np.float64)
    apart = np.diff(places)
    for unit, min_share in ((float(np.median(apart)), _MIN_REGULAR_SHARE), (float(apart.min()), 1.0)):
        numbers = np.round((places - rivals[0]) / unit)
        if np.unique(numbers).size < 3:
            continue
        # By medians, since the lag of a method may be between two teeth.
        spacing, _ = median_line(numbers, places)
        offsets = places - spacing * numbers
        regular = np.abs(offsets - np.median(offsets)) <= max(min(1.0, unit / 8), 0.02 * unit)
        if regular.mean() >= min_share and np.unique(numbers[regular]).size >= 3:
            return float(np.polyfit(numbers[regular], places[regular], 1)[0])
    return None


def _robust_height(curve: Vector, chance: float) -> tuple[float, tuple[float, float]]:
    """Return the robust height of the highest point, and the values between which chance keeps the curve."""
    some = curve[:: max(1, curve.size // MEDIAN_POINTS)]
    middle = float(np.median(some))
    deviation = 1.4826 * float(np.median(np.abs(some - middle)))
    height = (float(curve.max()) - middle) / deviation if deviation > 0 else math.inf
    return height, (middle - chance * deviation, middle + chance * deviation)
