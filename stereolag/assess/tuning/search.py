"""The trials of a search for good settings within a time budget, and their outcome."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from enum import StrEnum
from typing import Any, NamedTuple

from stereolag.assess.tuning.candidates import candidates, differences, side_of
from stereolag.assess.tuning.judgement import Gain, Judgement
from stereolag.assess.tuning.objective import Criterion, TuningPair, Unjudged, criterion_of
from stereolag.core.progress import Progress
from stereolag.stereo.matcher import StereoMatcher

SMALLEST_GAIN = 0.1
"""Percentage points of bad-2; a change that gains less is not worth making."""

FOR_ALL = 0.75
"""Whole images are used throughout if that is estimated to take at most this share of the time left."""

FOR_STRIPS, LEAST_SHARE = 0.5, 0.1
"""Share of the time left that trials on strips may take, and least share of the rows in the strips."""


LIKELIEST = 6
"""Number tried on strips however little time is left, so that a busy machine does not prevent all trials."""


class Outcome(StrEnum):
    """The outcome of a search."""

    BETTER = "better"
    """The settings found are better on the whole images, by more than chance could produce."""
    AS_GOOD = "as good"
    """None of those tried is better: the initial settings stay."""


class Trial(NamedTuple):
    """One set of settings tried."""

    matcher: StereoMatcher
    bad: float
    """Their bad-2, %."""
    gain: float
    """Decrease relative to the initial settings on the same pixels, in percentage points."""
    whole: bool
    """Whether tried on the whole images rather than on strips."""


@dataclass(frozen=True)
class Suggestion:
    """The settings found by a search, and the trials behind them.

    Attributes
    ----------
    start
        The initial settings.
    matcher
        The best settings; the initial ones if no others are really better.
    outcome
        Whether better settings were found, or why none could be judged.
    criterion
        Whether the figures are true or estimated bad-2.
    bad, bad_before
        Bad-2 of the settings found and of the initial ones, on the whole images, %; NaN if nothing was judged.
    trials
        All trials besides the initial settings, in order; settings tried on strips and then on the whole images appear
        twice.
    finished
        Whether all trials were made, rather than cut short by the time budget or a cancel.

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
        """Return the changed settings as {name: (old value, new value)}, with dotted names for nested settings."""
        return {name: (old, new) for name, old, new in differences(self.start, self.matcher)}

    @property
    def tried(self) -> int:
        """Return the number of different settings tried besides the initial ones."""
        return len({trial.matcher for trial in self.trials})


class Clock:
    """The clock of a search: time left, progress reported, and whether it was cancelled."""

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
        """Return the seconds left; negative after the budget is used up."""
        return self._end - time.perf_counter()

    def report(self, done: float) -> None:
        """Report the fraction done, or the share of the budget used if that is larger."""
        self._told = min(1.0, max(self._told, done, 1 - self.left_s / self._budget_s))
        self._progress(self._told)

    def tick(self, _: float) -> None:
        """Report the time used, from within a trial."""
        self.report(self._told)


def search(
    start: StereoMatcher, pairs: Sequence[TuningPair], clock: Clock, found: Callable[[Suggestion], None] | None
) -> Suggestion:
    """Try all candidates on the whole images or, if time is short, on strips first and then the best on the whole.

    Only whole images decide, and if bad-2 is an estimate, only a certain gain (:attr:`Gain.sure`). Pairs that cannot
    judge are left out.
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
    """Return the initial settings, because others cannot be judged."""
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
        """Return the expected seconds of a trial on the whole images, scaled from the initial settings' time."""
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
        """Try settings one after another; return whether all were tried, and the results, best first.

        Parameters
        ----------
        pairs
            The pairs, or strips of them.
        those
            The settings.
        steps
            Total number of trials in the search.
        whole
            Whether the pairs are whole.
        reserved_s
            Seconds that must remain after a trial.
        at_least
            Number to try however little time is left.
        despite_cancel
            Whether to try these even if the search was cancelled.
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
            except ValueError:  # settings that do not fit the images, or need too much memory
                continue
            gain = Gain.between(before, after)
            results.append(_Found(matcher, after, gain))
            self.trials.append(Trial(matcher, _mean_bad(after), gain.points, whole))
            self.clock.report(len(self.trials) / steps)
            self._tell()
        return True, self._ranked(results)

    def outcome(self, ranked: Sequence[_Found], *, finished: bool) -> Suggestion:
        """Return the suggestion that follows from the trials on the whole images, given best first."""
        self.clock.report(1.0)
        end = replace(self._so_far, trials=tuple(self.trials), finished=finished)
        better = [one for one in ranked if self._merit(one.gain) > 0 and one.gain.points > SMALLEST_GAIN]
        if not better:
            return end
        best = self._finest(better) if self.criterion is Criterion.ESTIMATED_BAD_2 else better[0]
        return replace(end, matcher=best.matcher, bad=_mean_bad(best.after), outcome=Outcome.BETTER)

    @staticmethod
    def _finest(better: Sequence[_Found]) -> _Found:
        """Return the settings with the smallest window among the best and those indistinguishable from them.

        Dense maps from different windows differ at the edges of surfaces. The reference is blurred there too, as it is
        made with windows, and it does not judge occluded areas, so it slightly favours large windows. Hence within one
        standard error the smaller window wins (Breiman et al., *Classification and Regression Trees*, 1984, 3.4).
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
