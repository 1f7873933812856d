"""Suggested settings for one pair, or for several together: the candidates, their trials, and the outcome."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from enum import StrEnum
from functools import singledispatch
from itertools import product
from typing import Any, NamedTuple

import numpy.typing as npt

from stereolag.assess.judging import (
    Criterion,
    Gain,
    Judgement,
    TuningPair,
    Unjudged,
    criterion_of,
    estimate_reference,
    judges_itself,
    parameters,
)
from stereolag.core.inputs import check_positive
from stereolag.core.jobs import Estimate, Progress, silent
from stereolag.core.settings import FitsImage, Number, Settings, changed, marker
from stereolag.stereo.finishing.stages import LeftRightCheck, MedianFilter, SpeckleFilter
from stereolag.stereo.matcher import StereoMatcher
from stereolag.stereo.opencv import StereoBM, StereoSGBM
from stereolag.stereo.semi_global.matcher import SemiGlobalMatcher
from stereolag.stereo.windows.matcher import CorrelationMatcher
from stereolag.stereo.windows.search import CentredSearch

Step = dict[str, Any]
"""Settings to change together, with names as in :func:`stereolag.core.settings.changed`."""

UNCHANGED: Step = {}
"""The settings as they are."""

EVERY_PIXEL_OVERLAP = 0.95
"""Overlap that places windows of up to 29 px at every pixel, as the left-right check requires."""


def candidates(matcher: StereoMatcher) -> list[StereoMatcher]:
    """Return the settings to try in place of a matcher's, most promising first.

    All have the same search range as the matcher, which is not included.
    """
    found: list[StereoMatcher] = []
    for choice in _likely_first(*steps(matcher)):
        try:
            tried = changed(matcher, {name: value for step in choice for name, value in step.items()})
        except ValueError:  # incompatible steps
            continue
        if tried != matcher and tried not in found and tried.search_range() == matcher.search_range():
            found.append(tried)
    return found


def _likely_first(*axes: Sequence[Any]) -> list[tuple[Any, ...]]:
    """Return every combination of one value per axis, ordered by the sum of the values' positions on their axes."""
    ranks = sorted(product(*map(range, map(len, axes))), key=sum)
    return [tuple(axis[rank] for axis, rank in zip(axes, choice, strict=True)) for choice in ranks]


@singledispatch
def steps(matcher: StereoMatcher) -> Sequence[Sequence[Step]]:
    """Return the axes of steps, most promising first, of which all combinations are tried.

    For any other method, this varies the sides that must fit into the image, and the stages that all methods share.
    """
    known = parameters(matcher)
    sides = [
        [UNCHANGED, *_each(name, *known[name].values(7))]
        for name, field in type(matcher).model_fields.items()
        if name in known and marker(field, FitsImage) is not None
    ]
    return [*sides, _finishing(matcher)]


@steps.register
def _of_windows(matcher: CorrelationMatcher) -> Sequence[Sequence[Step]]:
    windows: list[Step] = _each("window_size", 9, 11, 7, 13, 15, 5, 21)
    if isinstance(matcher.search, CentredSearch):  # a square that keeps its reach
        around = matcher.search.search_size - matcher.window_size
        windows = [step | {"search.search_size": around + step["window_size"]} for step in windows] if around else []
    every_pixel = {"overlap": max(matcher.overlap, EVERY_PIXEL_OVERLAP), "score": "zncc", "engine": "auto"}
    finishing = [every_pixel | step if step else step for step in _finishing(matcher)]
    return [[*windows, UNCHANGED], [*finishing, {"score": "zncc"}]]


@steps.register
def _of_bm(matcher: StereoBM) -> Sequence[Sequence[Step]]:
    sizes, caps = _each("block_size", 11, 9, 13, 15, 17, 7, 21), _each("pre_filter_cap", 63, 31)
    return [[*sizes, UNCHANGED], [*caps, UNCHANGED]]


@steps.register
def _of_sgbm(matcher: StereoSGBM) -> Sequence[Sequence[Step]]:
    # StereoSGBM sums costs over the block, so that P2 is per pixel of it. P1 is a quarter, as in OpenCV's own examples.
    pairs = _likely_first((9, 1, 7, 3, 5, 11), (16, 32, 64, 128))
    penalties = [{"block_size": size, "p1": jump * size**2 // 4, "p2": jump * size**2} for size, jump in pairs]
    return [[step | {"pre_filter_cap": 31} for step in penalties]]


@steps.register
def _of_semi_global(matcher: SemiGlobalMatcher) -> Sequence[Sequence[Step]]:
    now = {name: getattr(matcher.optimisation, name) for name in ("penalty_small", "penalty_at_edges", "penalty_large")}
    scaled = [
        {f"optimisation.{name}": max(1, round(factor * value)) for name, value in now.items()} for factor in (0.5, 2.0)
    ]
    return [[UNCHANGED, *_each("window_size", 9, 7, 11, 5)], [UNCHANGED, *scaled], _finishing(matcher)]


def _each(name: str, *values: Number) -> list[Step]:
    return [{name: value} for value in values]


def _finishing(matcher: StereoMatcher) -> list[Step]:
    """Return steps that turn all stages on, with medians of different radius, then the current settings.

    Active checks keep their tolerance. A hole counts as wrong, so that checking and then filling beats either alone.
    """
    if not {"left_right", "speckle", "filling", "median"} <= set(type(matcher).model_fields):
        return [UNCHANGED]
    now = dict(matcher)
    checked = {"left_right": now["left_right"] or LeftRightCheck(), "speckle": now["speckle"] or SpeckleFilter()}
    median: MedianFilter = now["median"] or MedianFilter()
    medians = [{"median": changed(median, {"radius": radius})} for radius in (6, 10)]
    return [*(checked | {"filling": True} | step for step in medians), UNCHANGED]


def side_of(matcher: StereoMatcher) -> int:
    """Return the side of a matcher's window or block, px; 0 if it has none."""
    fields = type(matcher).model_fields
    return next((getattr(matcher, name) for name, field in fields.items() if marker(field, FitsImage) is not None), 0)


def differences(before: Settings, after: Settings, path: str = "") -> Iterator[tuple[str, Any, Any]]:
    """Yield the differences between two settings of one class: dotted name, old value and new value."""
    for (name, old), (_, new) in zip(before, after, strict=True):
        if isinstance(old, Settings) and type(old) is type(new):
            yield from differences(old, new, f"{path}{name}.")
        elif old != new:
            yield f"{path}{name}", old, new


MIN_GAIN = 0.1
"""Gain in bad-2 from which a change is worth making, percentage points."""

MAX_WHOLE_TIME_SHARE = 0.75
"""Whole images are used throughout if that is estimated to take at most this share of the remaining time."""

STRIPS_TIME_SHARE = 0.5
"""Share of the remaining time for trials on strips."""

MIN_STRIPS_SHARE = 0.1
"""Share of the rows in the strips, at least."""

MIN_TRIALS = 6
"""Number of trials on strips however little time remains, so that a busy machine does not prevent them all."""


class Outcome(StrEnum):
    """The outcome of a search."""

    BETTER = "better"
    """The settings found are better on the whole images, by more than chance could produce."""
    AS_GOOD = "as good"
    """None of those tried is better: the initial settings stay."""


class Trial(NamedTuple):
    """Settings that were tried, and how they did."""

    matcher: StereoMatcher
    bad: float
    """Their bad-2, %."""
    gain: float
    """Decrease relative to the initial settings on the same pixels, in percentage points."""
    whole: bool
    """Whether they were tried on the whole images rather than on strips."""
    sure_gain: float = math.nan
    """The gain minus the part that may be due to chance."""
    judgements: Sequence[Judgement] = ()
    """The judgement on every pair."""


@dataclass(frozen=True)
class Suggestion:
    """The settings found by a search, and the trials behind them.

    Attributes
    ----------
    start
        The initial settings.
    matcher
        The best settings; the initial ones if no others are certainly better.
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
        Whether all trials were made; False if the time budget or a cancel ended the search.

    Examples
    --------
    >>> import numpy as np
    >>> import stereolag as sl
    >>> random = np.random.default_rng(0)
    >>> left = random.normal(128, 40, (60, 100))
    >>> right = np.roll(left, -5, axis=1) + random.normal(0, 20, left.shape)  # disparity 5 px
    >>> start = sl.CorrelationMatcher(window_size=3, search=sl.SearchArea.rectified(16))
    >>> suggestion = sl.suggest(start, left, right, ground_truth=np.full(left.shape, 5.0), budget_s=120)
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


class _Search:
    """A search from initial settings within a time budget, with the arguments of :func:`suggest`."""

    def __init__(
        self,
        start: StereoMatcher,
        budget_s: float,
        progress: Progress | None,
        found: Callable[[Suggestion], None] | None,
        cancelled: Callable[[], bool],
    ) -> None:
        check_positive(budget_s, "budget_s", "s")
        self.start, self.budget_s, self.cancelled = start, budget_s, cancelled
        self.progress, self.found = progress or silent, found or (lambda _: None)
        self.end, self.reported = time.perf_counter() + budget_s, 0.0

    @property
    def remaining_s(self) -> float:
        """Return the remaining seconds of the budget; negative if it is exceeded."""
        return self.end - time.perf_counter()

    def report(self, done: float) -> None:
        """Report the fraction done, or the share of the budget used if that is larger."""
        self.reported = min(1.0, max(self.reported, done, 1 - self.remaining_s / self.budget_s))
        self.progress(self.reported)

    def tick(self, _: float = 0.0) -> None:
        """Report the time used, from within a trial."""
        self.report(self.reported)

    def suggestion(self, pairs: Sequence[TuningPair]) -> Suggestion:
        """Return the outcome of the search; pairs that cannot judge are left out."""
        reasons = [pair.unjudged(self.start) for pair in pairs]
        self.pairs = [pair for pair, reason in zip(pairs, reasons, strict=True) if reason is None]
        if self.pairs:
            result = self._searched()
        else:
            result = Suggestion(self.start, self.start, next(filter(None, reasons)), Criterion.ESTIMATED_BAD_2)
        self.report(1.0)
        return result

    def _searched(self) -> Suggestion:
        """Try all candidates on the whole images or, if time is short, on strips, and the best of them on the whole.

        Only whole images decide, and if bad-2 is an estimate, only a certain gain (:attr:`Gain.sure`).
        """
        start, remaining_s = self.start, self.remaining_s
        self.before = self._judged(start, self.pairs)
        self.start_s, bad = remaining_s - self.remaining_s, _mean_bad(self.before)
        self.so_far = Suggestion(start, start, Outcome.AS_GOOD, criterion_of(self.pairs), bad, bad, finished=False)
        self.found(self.so_far)
        tried = candidates(start)
        seconds = [*map(self._seconds, tried)]
        if sum(seconds) <= MAX_WHOLE_TIME_SHARE * self.remaining_s:
            finished, ranked = self._ranked(self.pairs, tried, len(tried))
        else:
            share = max(MIN_STRIPS_SHARE, STRIPS_TIME_SHARE * self.remaining_s / sum(seconds))
            strips, steps = [pair.strips(share, side_of(start)) for pair in self.pairs], 2 * len(tried)
            finished, ranked = self._ranked(
                strips, tried, steps, whole=False, reserved_s=max(seconds), min_trials=MIN_TRIALS
            )
            finalists = [trial.matcher for trial in ranked if trial.gain > 0]
            _, ranked = self._ranked(self.pairs, finalists, steps, min_trials=1, despite_cancel=True)
        result = replace(self.so_far, finished=finished)
        better = [trial for trial in ranked if self._merit(trial) > 0 and trial.gain > MIN_GAIN]
        if not better:
            return result
        best = _finest(better) if result.criterion is Criterion.ESTIMATED_BAD_2 else better[0]
        return replace(result, matcher=best.matcher, bad=best.bad, outcome=Outcome.BETTER)

    def _ranked(
        self,
        pairs: Sequence[TuningPair],
        matchers: Sequence[StereoMatcher],
        steps: int,
        *,
        whole: bool = True,
        reserved_s: float = 0.0,
        min_trials: int = 0,
        despite_cancel: bool = False,
    ) -> tuple[bool, list[Trial]]:
        """Try settings one after another; return whether all were tried, and the trials, best first.

        Parameters
        ----------
        pairs
            The `whole` pairs, or strips of them.
        matchers
            The settings.
        steps
            Number of trials in the whole search, of which progress is reported.
        reserved_s
            Time that must remain after a trial, s.
        min_trials
            Number of trials made however little time remains, and even after a cancel if `despite_cancel`.
        """
        before = self.before if whole else self._judged(self.start, pairs)
        share = pairs[0].left.shape[0] / self.pairs[0].left.shape[0]
        trials: list[Trial] = []
        finished = True
        for number, matcher in enumerate(matchers):
            cancelled = self.cancelled()
            forced = number < min_trials and (despite_cancel or not cancelled)
            late = self.remaining_s < self._seconds(matcher) * share + reserved_s
            if (cancelled or late) and not forced:
                finished = False
                break
            try:
                after = self._judged(matcher, pairs)
            except ValueError:  # settings that do not fit the images, or need too much memory
                continue
            gain = Gain.between(before, after)
            trials.append(Trial(matcher, _mean_bad(after), gain.points, whole, gain.sure, after))
            self.so_far = replace(self.so_far, trials=(*self.so_far.trials, trials[-1]))
            self.report(len(self.so_far.trials) / steps)
            self.found(self.so_far)
        return finished, sorted(trials, key=self._merit, reverse=True)

    def _seconds(self, matcher: StereoMatcher) -> float:
        """Return the expected seconds of a trial on the whole images, scaled from the initial settings' time."""
        expected, of_start = (sum(pair.estimate(one).seconds for pair in self.pairs) for one in (matcher, self.start))
        return self.start_s * expected / of_start

    def _judged(self, matcher: StereoMatcher, pairs: Sequence[TuningPair]) -> list[Judgement]:
        return [pair.judge(matcher, progress=self.tick) for pair in pairs]

    def _merit(self, trial: Trial) -> float:
        return trial.sure_gain if self.so_far.criterion is Criterion.ESTIMATED_BAD_2 else trial.gain


def _finest(better: Sequence[Trial]) -> Trial:
    """Return the trial with the smallest window among the best one and those within its standard error.

    Dense maps from different windows differ at the edges of surfaces. The reference is also made with windows, thus
    blurred there, and does not judge occluded areas, so that it slightly favours large windows. Hence the smaller
    window wins within one standard error (Breiman et al., *Classification and Regression Trees*, 1984, 3.4).
    """
    best = better[0]

    def as_good(other: Trial) -> bool:
        lead = Gain.between(other.judgements, best.judgements)
        dense = all(one.dense for one in (*best.judgements, *other.judgements))
        return other is best or (dense and lead.points <= lead.error)

    return min(filter(as_good, better), key=lambda trial: side_of(trial.matcher))


def _mean_bad(judgements: Sequence[Judgement]) -> float:
    return sum(one.bad for one in judgements) / len(judgements)


def suggest(
    matcher: StereoMatcher,
    left: npt.ArrayLike,
    right: npt.ArrayLike,
    *,
    ground_truth: npt.ArrayLike | None = None,
    budget_s: float = 20.0,
    progress: Progress | None = None,
    found: Callable[[Suggestion], None] | None = None,
    cancelled: Callable[[], bool] = lambda: False,
) -> Suggestion:
    """Search for settings of a matcher that suit a pair better.

    Promising steps are tried in combination (:func:`candidates`); the search range and the tolerances of checks are
    kept. The suggested settings are better on the whole images, or they are the initial ones. Without ground truth,
    settings are judged against the disparities measured by the accurate preset over the same range
    (:func:`stereolag.assess.judging.measured_reference`).

    Parameters
    ----------
    matcher
        The initial settings.
    left, right
        (H, W), (H, W, 3) or (H, W, 4) images of one size and type.
    ground_truth
        (H, W) disparity, px; NaN or infinite = unknown.
    budget_s
        Time budget, s. If it is too short, the search still computes the reference and the map of the initial settings,
        tries the most promising others on strips of the images, and the best of these on the whole images.
    progress
        Called with the fraction done, 0..1.
    found
        Called after every trial with the trials so far; its settings are still the initial ones.
    cancelled
        Called before every trial; True ends the search, after the best so far is tried on the whole images.

    Returns
    -------
    Suggestion
        ``.matcher`` and ``.changes``, with bad-2 before and after.

    Raises
    ------
    ValueError
        If the images or the ground truth do not fit together, the initial settings do not fit the images, the range
        needs more memory than one job may take, or the budget is not a finite number above 0.

    Examples
    --------
    A noisy pair, and windows that are too small for it:

    >>> import numpy as np
    >>> import stereolag as sl
    >>> random = np.random.default_rng(0)
    >>> left = random.normal(128, 40, (60, 100))
    >>> right = np.roll(left, -5, axis=1) + random.normal(0, 20, left.shape)
    >>> truth = np.full(left.shape, 5.0)  # px
    >>> start = sl.CorrelationMatcher(window_size=3, search=sl.SearchArea.rectified(16))
    >>> sl.suggest(start, left, right, ground_truth=truth).changes["window_size"]  # px, from and to
    (3, ...)
    """
    search = _Search(matcher, budget_s, progress, found, cancelled)
    if ground_truth is None and judges_itself(matcher):
        pair = TuningPair.unjudgeable(left, right)
    else:
        pair = TuningPair.of(left, right, ground_truth, search_range=matcher.search_range(), progress=search.tick)
    return search.suggestion([pair])


def suggest_for_all(
    matcher: StereoMatcher,
    pairs: Iterable[TuningPair],
    *,
    budget_s: float = 20.0,
    progress: Progress | None = None,
    found: Callable[[Suggestion], None] | None = None,
    cancelled: Callable[[], bool] = lambda: False,
) -> Suggestion:
    """Search for settings that suit several pairs better together, by their mean bad-2; otherwise as :func:`suggest`.

    Parameters
    ----------
    pairs
        At least one; if they are generated lazily, the budget includes the time to make them. The mean is an
        estimate if any pair's bad-2 is; pairs that cannot judge are left out.

    Raises
    ------
    ValueError
        If the initial settings do not fit the images.
    """
    search = _Search(matcher, budget_s, progress, found, cancelled)
    given = []
    for pair in pairs:
        given.append(pair)
        search.tick()
    return search.suggestion(given)


def estimate_suggestion(
    matcher: StereoMatcher, shape: tuple[int, ...], dtype: npt.DTypeLike, *, blind: bool, budget_s: float
) -> Estimate:
    """Return the memory and time of :func:`suggest` for two images of a shape and dtype.

    `blind` means without ground truth. Settings that alone need more memory than one job may take are not tried.
    """
    jobs = [one.estimate(shape, dtype) for one in (matcher, *candidates(matcher))]
    jobs += [estimate_reference(matcher.search_range(), shape, dtype)] if blind else []
    return Estimate(max(job.memory for job in jobs), min(budget_s, sum(job.seconds for job in jobs)))
