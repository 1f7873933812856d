"""The trials of a search for good settings, within a time, and what they come to."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from enum import StrEnum
from typing import Any, NamedTuple

from stereolag.progress import Progress
from stereolag.stereo.matcher import StereoMatcher
from stereolag.tuning.candidates import candidates, differences, side_of
from stereolag.tuning.judgement import Gain, Judgement
from stereolag.tuning.objective import Criterion, TuningPair, Unjudged, criterion_of

SMALLEST_GAIN = 0.1
"""Points of bad-2; a change that brings less is not worth making."""

FOR_ALL = 0.75
"""Whole images are used throughout where that should take no more of the time left; on a busy machine it takes more."""

FOR_STRIPS, LEAST_SHARE = 0.5, 0.1
"""The part of the time left that trials on strips may take, and the least share of the rows that they are made on."""


LIKELIEST = 6
"""So many are tried on strips whatever the time: a busy machine must not keep all from being tried."""


class Outcome(StrEnum):
    """What a search came to."""

    BETTER = "better"
    """The settings found are better on the whole images, by more than chance makes of equal ones."""
    AS_GOOD = "as good"
    """None of those tried is: the settings to begin with stay."""


class Trial(NamedTuple):
    """Settings that were tried."""

    matcher: StereoMatcher
    bad: float
    """Their bad-2, %."""
    gain: float
    """Points by which it is lower than that of the settings to begin with, on the same pixels."""
    whole: bool
    """Whether on the whole images, or on strips of them."""


@dataclass(frozen=True)
class Suggestion:
    """Settings found by search, and why.

    Attributes
    ----------
    start
        The settings to begin with.
    matcher
        The best settings; those to begin with where no others are really better.
    outcome
        Which of both, or why there was nothing to judge them by.
    criterion
        What the figures are: true or estimated bad-2.
    bad, bad_before
        Bad-2 of the settings found and of those to begin with, on the whole images, %; NaN where nothing was judged.
    trials
        The settings tried besides those to begin with, one after another; those tried on strips and then on the whole
        images twice.
    finished
        Whether all was tried that was to be tried, and not ended by the time or a cancel.

    Examples
    --------
    >>> import numpy as np
    >>> import stereolag as sl
    >>> random = np.random.default_rng(0)
    >>> left = random.normal(128, 40, (60, 100))
    >>> right = np.roll(left, -5, axis=1) + random.normal(0, 20, left.shape)  # disparity 5 px
    >>> start = sl.CorrelationMatcher(window_size=3, search=sl.SearchArea.rectified(16))
    >>> suggestion = sl.suggest(start, left, right, ground_truth=np.full(left.shape, 5.0))
    >>> suggestion.outcome.value, suggestion.finished
    ('better', True)
    >>> suggestion.bad < suggestion.bad_before  # %
    True
    """

    start: StereoMatcher
    matcher: StereoMatcher
    outcome: Outcome | Unjudged
    criterion: Criterion
    bad: float = math.nan
    bad_before: float = math.nan
    trials: tuple[Trial, ...] = ()
    finished: bool = True

    @property
    def changes(self) -> dict[str, tuple[Any, Any]]:
        """Return {name: (old value, new value)} of what was changed, with dots for settings within settings."""
        return {name: (old, new) for name, old, new in differences(self.start, self.matcher)}

    @property
    def tried(self) -> int:
        """Return how many different settings were tried besides those to begin with."""
        return len({trial.matcher for trial in self.trials})


class Clock:
    """The time of a search: what is left of it, what of it is told, and whether it was called off."""

    def __init__(self, budget_s: float, progress: Progress, cancelled: Callable[[], bool]) -> None:
        if not 0 < budget_s < math.inf:
            raise ValueError(f"budget_s is {budget_s} s; allowed is a finite number above 0.")
        self._end = time.perf_counter() + budget_s
        self._budget_s = budget_s
        self._progress = progress
        self._told = 0.0
        self.cancelled = cancelled

    @property
    def left_s(self) -> float:
        """Return the seconds left; negative where it takes longer."""
        return self._end - time.perf_counter()

    def report(self, done: float) -> None:
        """Tell what is done of all there is to do, or the share of the time that is gone where that is more."""
        self._told = min(1.0, max(self._told, done, 1 - self.left_s / self._budget_s))
        self._progress(self._told)

    def tick(self, _: float) -> None:
        """Tell the time within a trial."""
        self.report(self._told)


def search(
    start: StereoMatcher, pairs: Sequence[TuningPair], clock: Clock, found: Callable[[Suggestion], None] | None
) -> Suggestion:
    """Try all candidates on the whole images; where the time is short, on strips first, and then the best of them.

    Only whole images decide, and only a gain that is sure (:attr:`Gain.sure`) where bad-2 is an estimate. Pairs that
    cannot judge are left out.
    """
    why = [pair.unjudged(start) for pair in pairs]
    pairs = [pair for pair, reason in zip(pairs, why, strict=True) if reason is None]
    if not pairs:
        return nothing_to_judge_by(start, next(filter(None, why)), clock)
    run = _Run(start, pairs, clock, found, criterion_of(pairs))
    tried = candidates(start)
    total_s = sum(map(run.seconds, tried))
    if total_s <= FOR_ALL * clock.left_s:
        finished, ranked = run.tried(pairs, tried, steps=len(tried))
        return run.outcome(ranked, finished=finished)
    share = max(LEAST_SHARE, FOR_STRIPS * clock.left_s / total_s)
    strips = [pair.strips(share, side_of(start)) for pair in pairs]
    finished, ranked = run.tried(
        strips,
        tried,
        steps=2 * len(tried),
        whole=False,
        reserved_s=max(map(run.seconds, tried)),
        at_least=LIKELIEST,
    )
    finalists = [one.matcher for one in ranked if one.gain.points > 0]
    _, ranked = run.tried(pairs, finalists, steps=2 * len(tried), at_least=1, despite_cancel=True)
    return run.outcome(ranked, finished=finished)


def nothing_to_judge_by(start: StereoMatcher, why: Unjudged, clock: Clock) -> Suggestion:
    """Return the settings to begin with, because there is nothing to judge others by."""
    clock.report(1.0)
    return Suggestion(start, start, why, Criterion.ESTIMATED_BAD_2)


class _Found(NamedTuple):
    matcher: StereoMatcher
    after: list[Judgement]
    gain: Gain

    @property
    def dense(self) -> bool:
        return all(one.dense for one in self.after)


@dataclass
class _Run:
    """The trials so far."""

    start: StereoMatcher
    pairs: Sequence[TuningPair]
    clock: Clock
    found: Callable[[Suggestion], None] | None
    criterion: Criterion
    trials: list[Trial] = field(default_factory=list)

    def __post_init__(self) -> None:
        began = self.clock.left_s
        self._before = self._judged(self.start, self.pairs)
        self._once_s = began - self.clock.left_s
        bad = _mean_bad(self._before)
        self._so_far = Suggestion(self.start, self.start, Outcome.AS_GOOD, self.criterion, bad, bad)
        self._tell()

    def seconds(self, matcher: StereoMatcher) -> float:
        """Return how long a trial on the whole images should take, by what those to begin with took."""
        mine, first = (sum(pair.estimate(one).seconds for pair in self.pairs) for one in (matcher, self.start))
        return self._once_s * mine / first

    def tried(
        self,
        pairs: Sequence[TuningPair],
        those: Sequence[StereoMatcher],
        *,
        steps: int,
        whole: bool = True,
        reserved_s: float = 0.0,
        at_least: int = 0,
        despite_cancel: bool = False,
    ) -> tuple[bool, list[_Found]]:
        """Try settings one after another; return whether there was time for all, and what they gain, best first.

        Parameters
        ----------
        pairs
            The pairs, or strips of them.
        those
            The settings.
        steps
            Trials of the search altogether.
        whole
            Whether the pairs are whole.
        reserved_s
            Seconds to be left besides what a trial takes.
        at_least
            So many are tried whatever the time.
        despite_cancel
            And whether or not the search was called off.
        """
        before = self._before if whole else self._judged(self.start, pairs)
        results: list[_Found] = []
        for number, matcher in enumerate(those):
            needed_s = self.seconds(matcher) * pairs[0].left.shape[0] / self.pairs[0].left.shape[0] + reserved_s
            cancelled = self.clock.cancelled()
            forced = number < at_least and (despite_cancel or not cancelled)
            if (cancelled or self.clock.left_s < needed_s) and not forced:
                return False, self._ranked(results)
            try:
                after = self._judged(matcher, pairs)
            except ValueError:  # settings that do not fit the images, or their memory
                continue
            gain = Gain.between(before, after)
            results.append(_Found(matcher, after, gain))
            self.trials.append(Trial(matcher, _mean_bad(after), gain.points, whole))
            self.clock.report(len(self.trials) / steps)
            self._tell()
        return True, self._ranked(results)

    def outcome(self, ranked: Sequence[_Found], *, finished: bool) -> Suggestion:
        """Return what the trials on the whole images come to, the best first."""
        self.clock.report(1.0)
        end = replace(self._so_far, trials=tuple(self.trials), finished=finished)
        better = [one for one in ranked if self._merit(one.gain) > 0 and one.gain.points > SMALLEST_GAIN]
        if not better:
            return end
        best = self._finest(better) if self.criterion is Criterion.ESTIMATED_BAD_2 else better[0]
        return replace(end, matcher=best.matcher, bad=_mean_bad(best.after), outcome=Outcome.BETTER)

    @staticmethod
    def _finest(better: Sequence[_Found]) -> _Found:
        """Return the settings of the smallest window among the best and those that cannot be told from them.

        Dense maps of other windows differ at the edges of surfaces. The reference, made with windows itself, is blurred
        there too, and what is hidden from one camera it does not judge: it favours large windows a little. So one
        standard error decides for the smaller one (Breiman et al., *Classification and Regression Trees*, 1984, 3.4).
        """
        best = better[0]

        def as_good(other: _Found) -> bool:
            lead = Gain.between(other.after, best.after)
            return other is best or (best.dense and other.dense and lead.points <= lead.error)

        return min(filter(as_good, better), key=lambda one: side_of(one.matcher))

    def _judged(self, matcher: StereoMatcher, pairs: Sequence[TuningPair]) -> list[Judgement]:
        return [pair.judge(matcher, progress=self.clock.tick) for pair in pairs]

    def _merit(self, gain: Gain) -> float:
        return gain.sure if self.criterion is Criterion.ESTIMATED_BAD_2 else gain.points

    def _ranked(self, results: Sequence[_Found]) -> list[_Found]:
        return sorted(results, key=lambda one: -self._merit(one.gain))

    def _tell(self) -> None:
        if self.found is not None:
            self.found(replace(self._so_far, trials=tuple(self.trials), finished=False))


def _mean_bad(judgements: Sequence[Judgement]) -> float:
    return sum(one.bad for one in judgements) / len(judgements)
