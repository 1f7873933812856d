"""The search for good settings."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy.typing as npt

from stereolag.progress import Progress, silent
from stereolag.settings import changed, setting
from stereolag.stereo.matcher import StereoMatcher
from stereolag.tuning.objective import TuningPair, affordable_pair
from stereolag.tuning.parameters import parameters

Choices = Mapping[str, Sequence[Any]]
"""Values to try for each parameter, named as in :func:`stereolag.settings.changed`."""

VALUES = 5
"""So many values of each parameter are tried."""

SMALLEST_GAIN = 1e-3
"""A change that brings less is not worth making."""


@dataclass(frozen=True)
class Suggestion:
    """Settings found by search, and why.

    Attributes
    ----------
    matcher
        The best settings tried.
    objective, objective_before
        Theirs, and that of the settings the search began with; 0..1, higher is better.
    tried
        How many settings were tried.
    changes
        {name: (old value, new value, gain in objective)} of what was changed for the better.
    finished
        Whether the search ended by itself, and not by the time or a cancel.
    scale
        Size of the pair on which they were tried, over its full size.
    """

    matcher: StereoMatcher
    objective: float
    objective_before: float
    tried: int
    changes: dict[str, tuple[Any, Any, float]]
    finished: bool
    scale: float


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
    """Search the numbers among the settings of a matcher for those that suit a pair best.

    Every number that has an effect is tried over its range, one after another, until nothing gets better. The pair is
    made smaller where the budget would not do in full size.

    Parameters
    ----------
    matcher
        The settings to begin with.
    left, right
        (H, W), (H, W, 3) or (H, W, 4) images of one size and type.
    ground_truth
        (H, W) disparity, px; NaN or infinite = unknown. Without it settings are judged by how well the two images
        agree through the map (:func:`stereolag.tuning.objective.photometric_consistency`).
    budget_s
        No further setting is tried after so many seconds.
    progress
        Called with the share of the budget or of the first round used, whichever is farther.
    found
        Called after every trial with the best so far.
    cancelled
        Asked before every trial; True ends the search with the best so far.

    Returns
    -------
    Suggestion
        ``.matcher`` and ``.changes``, and how much better it is.

    Raises
    ------
    ValueError
        Images or a ground truth that do not fit together, or settings to begin with that do not fit the images.
    """
    choices = {name: parameter.values(VALUES) for name, parameter in parameters(matcher).items()}
    trials = sum(map(len, choices.values()))
    pair = affordable_pair(matcher, left, right, ground_truth, trials=trials, budget_s=budget_s)
    return search_settings(
        matcher, pair, choices=choices, budget_s=budget_s, progress=progress, found=found, cancelled=cancelled
    )


def search_settings(
    matcher: StereoMatcher,
    pair: TuningPair,
    *,
    choices: Choices,
    budget_s: float = 20.0,
    progress: Progress | None = None,
    found: Callable[[Suggestion], None] | None = None,
    cancelled: Callable[[], bool] = lambda: False,
) -> Suggestion:
    """Search given values: one parameter at a time, again until nothing gets better; otherwise as :func:`suggest`.

    Parameters
    ----------
    choices
        The values to try for each parameter, in the order in which the parameters are tried.

    Raises
    ------
    ValueError
        A parameter that does not exist, or settings to begin with that do not fit the images.
    """
    report = progress or silent
    start = time.perf_counter()
    for name in choices:
        setting(matcher, name)
    trials = 1 + sum(len(values) for values in choices.values())
    for best in _trials(matcher, pair, choices):
        used = (time.perf_counter() - start) / budget_s
        report(min(1.0, max(used, best.tried / trials)))
        if found is not None:
            found(best)
        if best.finished or used >= 1 or cancelled():
            break
    report(1.0)
    return best


def _trials(matcher: StereoMatcher, pair: TuningPair, choices: Choices) -> Iterator[Suggestion]:
    """Yield the best so far after every trial; the last one is finished."""
    at_first = pair.objective(matcher)[0]
    best = Suggestion(matcher, at_first, at_first, 1, {}, False, pair.scale)
    yield best
    improved = True
    while improved:
        before = best.matcher
        for name, values in choices.items():
            for value in values:
                after = _after_trial(best, name, value, pair)
                if after is not None:
                    best = after
                    yield best
        improved = best.matcher != before
    yield replace(best, finished=True)


def _after_trial(best: Suggestion, name: str, value: object, pair: TuningPair) -> Suggestion | None:
    """Return the best after one more trial; None where there was nothing to try or the settings do not fit."""
    try:
        settings = changed(best.matcher, {name: value})
        if settings == best.matcher:
            return None
        found, _ = pair.objective(settings)
    except ValueError:
        return None
    gain = found - best.objective
    if gain <= SMALLEST_GAIN:
        return replace(best, tried=best.tried + 1)
    old, _, gained = best.changes.get(name, (setting(best.matcher, name), None, 0.0))
    changes = best.changes | {name: (old, value, gained + gain)}
    return replace(best, matcher=settings, objective=found, tried=best.tried + 1, changes=changes)
