"""Suggested settings for one pair, or for several together."""

from __future__ import annotations

from collections.abc import Callable, Iterable

import numpy.typing as npt

from stereolag.assess.tuning.candidates import candidates
from stereolag.assess.tuning.objective import TuningPair, Unjudged, estimate_reference, judges_itself
from stereolag.assess.tuning.search import Clock, Suggestion, nothing_to_judge_by, search
from stereolag.core.estimates import Estimate
from stereolag.core.inputs import as_stereo_pair
from stereolag.core.progress import Progress, silent
from stereolag.stereo.matcher import StereoMatcher


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

    Promising steps are tried in combination (:mod:`.candidates`); the search range and the tolerances
    of checks are kept. The suggestion is better on the whole images, or it is the initial settings. Without ground
    truth, settings are judged against the disparities measured by the accurate preset over the same range
    (:func:`stereolag.assess.tuning.objective.measured_reference`).

    Parameters
    ----------
    matcher
        The initial settings.
    left, right
        (H, W), (H, W, 3) or (H, W, 4) images of one size and type.
    ground_truth
        (H, W) disparity, px; NaN or infinite = unknown.
    budget_s
        Time budget, s. If it is too short, the search still computes the reference and the initial settings, tries the
        most promising others on strips of the images and the best of these on the whole images.
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
    images = as_stereo_pair(left, right)
    clock = Clock(budget_s, progress or silent, cancelled)
    if ground_truth is None and judges_itself(matcher):
        return nothing_to_judge_by(matcher, Unjudged.JUDGES_ITSELF, clock)
    pair = TuningPair.of(*images, ground_truth, search_range=matcher.search_range(), progress=clock.tick)
    return search(matcher, [pair], clock, found)


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
        At least one; if they are generated lazily, the time to make them counts against the budget. The mean is an
        estimate if any pair's bad-2 is; pairs that cannot judge are left out.

    Raises
    ------
    ValueError
        If there are no pairs, or the initial settings do not fit the images.
    """
    clock = Clock(budget_s, progress or silent, cancelled)
    made = []
    for pair in pairs:
        made.append(pair)
        clock.tick(0.0)
    if not made:
        raise ValueError("pairs is empty; give at least one.")
    return search(matcher, made, clock, found)


def estimate_suggestion(
    matcher: StereoMatcher, shape: tuple[int, ...], dtype: npt.DTypeLike, *, blind: bool, budget_s: float
) -> Estimate:
    """Return the memory and time of :func:`suggest` for two images of a shape and dtype.

    `blind` means without ground truth. Settings that alone need more memory than one job may take are not tried.
    """
    jobs = [one.estimate(shape, dtype) for one in (matcher, *candidates(matcher))]
    if blind:
        jobs.append(estimate_reference(matcher.search_range(), shape, dtype))
    return Estimate(max(job.memory for job in jobs), min(budget_s, sum(job.seconds for job in jobs)))
