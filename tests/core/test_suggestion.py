"""The search for better settings: its trials, the settings it keeps, and when it reports that nothing is better."""

from __future__ import annotations

import time
from itertools import count

import numpy as np
import pytest
from scenes import steps_pair

import stereolag as sl
from stereolag.assess.judging import Criterion, TuningPair, Unjudged
from stereolag.assess.suggestion import (
    LIKELIEST,
    Outcome,
    Suggestion,
    candidates,
    differences,
    side_of,
    suggest_for_all,
)
from stereolag.core.settings import setting, title_of
from stereolag.stereo.finishing.checks import AmbiguityTest, LeftRightCheck, TextureTest
from stereolag.stereo.finishing.stages import SpeckleFilter
from stereolag.stereo.matcher import StereoMatcher
from stereolag.stereo.methods import METHODS
from stereolag.stereo.windows.matcher import CorrelationMatcher

LEFT, RIGHT, TRUTH = steps_pair()
WINDOWS = CorrelationMatcher(window_size=25, search=sl.SearchArea.rectified(32))
BLOCKS = sl.StereoBM(num_disparities=32, block_size=31)

TOLERANCES = {
    "left_right.tolerance", "speckle.size", "speckle.difference", "texture.least", "ambiguity.lead",
    "uniqueness_ratio", "disp12_max_diff", "speckle_window_size", "speckle_range", "texture_threshold",
}  # fmt: skip

STRICT = CorrelationMatcher(
    window_size=11,
    search=sl.SearchArea.rectified(48, 3),
    left_right=LeftRightCheck(tolerance=3),
    speckle=SpeckleFilter(size=40, difference=1.0),
    texture=TextureTest(least=2.0),
    ambiguity=AmbiguityTest(lead=0.05),
)


@pytest.mark.parametrize(
    "matcher",
    [
        *(method() for method in METHODS),
        *(sl.preset(name) for name in ("fast", "accurate")),
        STRICT,
        CorrelationMatcher(window_size=15, search=sl.SearchArea.centred(41)),
        CorrelationMatcher(window_size=15, overlap=0.5, score="phase", search=sl.SearchArea.rectified(32, vertical=2)),
        sl.StereoSGBM(min_disparity=-8, uniqueness_ratio=3, speckle_window_size=40),
    ],
)
def test_ranges_and_tolerances_stay(matcher: StereoMatcher) -> None:
    tried = candidates(matcher)
    assert 5 <= len(tried) <= 36
    assert len(set(tried)) == len(tried)
    assert matcher not in tried
    for one in tried:
        assert one.search_range() == matcher.search_range()
        changed = {name for name, old, _ in differences(matcher, one) if old is not None}
        assert not changed & TOLERANCES
        assert not {name for name in changed if "disparit" in name or "vertical" in name}


def test_an_unpadded_search_keeps_its_window_which_is_its_range() -> None:
    unpadded = CorrelationMatcher(window_size=20, search=sl.SearchArea.centred(20))
    assert not candidates(unpadded)
    found = sl.suggest(unpadded, LEFT, RIGHT, ground_truth=TRUTH)
    assert (found.outcome, found.matcher, found.tried) == (Outcome.AS_GOOD, unpadded, 0)


def test_differences_reach_into_settings_of_settings() -> None:
    after = sl.preset("fast").model_copy(update={"median": None})
    assert [name for name, _, _ in differences(sl.preset("fast"), after)] == ["median"]
    strip = CorrelationMatcher(search=sl.SearchArea.rectified(64, vertical=2))
    assert list(differences(CorrelationMatcher(), strip)) == [("search.vertical", 0, 2)]


@pytest.mark.parametrize(
    ("kind", "name", "title"),
    [
        (sl.StereoBM, "block_size", "Block"),
        (CorrelationMatcher, "median.radius", "Median radius"),
        (CorrelationMatcher, "search.search_size", "Search area"),
        (sl.SemiGlobalMatcher, "optimisation.penalty_small", "Penalty of a slant"),
    ],
)
def test_what_is_changed_has_a_title(kind: type[StereoMatcher], name: str, title: str) -> None:
    assert title_of(kind, name) == title


@pytest.mark.parametrize("start", [WINDOWS, BLOCKS, sl.StereoSGBM(num_disparities=32, block_size=11, p1=1, p2=2)])
@pytest.mark.parametrize("truth", [None, TRUTH], ids=["blind", "with truth"])
def test_a_bad_start_gets_better(start: StereoMatcher, truth: np.ndarray | None) -> None:
    found = sl.suggest(start, LEFT, RIGHT, ground_truth=truth, budget_s=60)
    assert found.finished
    assert found.outcome is Outcome.BETTER
    assert found.criterion is (Criterion.ESTIMATED_BAD_2 if truth is None else Criterion.TRUE_BAD_2)
    assert found.bad < found.bad_before
    assert {name: (setting(start, name), setting(found.matcher, name)) for name in found.changes} == found.changes
    before, after = (sl.evaluate(one.compute(LEFT, RIGHT).disparity, TRUTH).bad[2.0] for one in (start, found.matcher))
    assert after < before - 1
    if truth is not None:
        assert (found.bad_before, found.bad) == pytest.approx((before, after))
        assert found.bad == min(trial.bad for trial in found.trials)


def test_the_best_is_not_changed_again() -> None:
    found = sl.suggest(BLOCKS, LEFT, RIGHT, budget_s=60)
    again = sl.suggest(found.matcher, LEFT, RIGHT, budget_s=60)
    assert again.outcome is Outcome.AS_GOOD
    assert again.matcher == found.matcher
    assert not again.changes
    assert again.bad == again.bad_before == pytest.approx(found.bad)
    assert again.tried > 5


def test_of_windows_that_cannot_be_told_apart_the_smallest_is_taken() -> None:
    found = sl.suggest(WINDOWS, LEFT, RIGHT, budget_s=60)
    lowest = min(found.trials, key=lambda trial: trial.bad)
    assert side_of(found.matcher) <= side_of(lowest.matcher)
    assert found.bad < lowest.bad + 1
    assert side_of(sl.StereoBM(block_size=13)) == 13


def test_the_judge_itself_has_nothing_to_judge_it_by() -> None:
    accurate = sl.preset("accurate", 32)
    told: list[float] = []
    found = sl.suggest(accurate, LEFT, RIGHT, progress=told.append)
    assert (found.outcome, found.matcher, found.trials) == (Unjudged.JUDGES_ITSELF, accurate, ())
    assert np.isnan([found.bad, found.bad_before]).all()
    assert told[-1] == 1
    seeing = sl.suggest(accurate, LEFT, RIGHT, ground_truth=TRUTH, budget_s=60)
    assert seeing.bad <= seeing.bad_before
    assert seeing.tried


def test_on_unrelated_images_nothing_is_suggested() -> None:
    noise = np.random.default_rng(0).integers(0, 256, (2, 100, 150), dtype=np.uint8)
    found = sl.suggest(BLOCKS, *noise)
    assert (found.outcome, found.matcher) == (Unjudged.TOO_LITTLE_MEASURED, BLOCKS)


def test_a_short_time_is_spent_on_strips_but_whole_images_decide() -> None:
    tall = [np.tile(image, (4, 1)) for image in (LEFT, RIGHT, TRUTH)]
    pair = TuningPair.of(*tall)
    WINDOWS.compute(*tall[:2])  # loads the compiled loops before the timing
    start = time.perf_counter()
    pair.judge(WINDOWS)
    once_s = time.perf_counter() - start
    found = suggest_for_all(WINDOWS, [pair], budget_s=5 * once_s)  # a quarter of all, however fast the machine
    whole = [trial for trial in found.trials if trial.whole]
    assert 1 <= len(whole) < found.tried or not found.finished
    assert found.bad_before == pytest.approx(pair.judge(WINDOWS).bad)
    if found.outcome is Outcome.BETTER:
        assert found.bad == pytest.approx(pair.judge(found.matcher).bad)
    late = suggest_for_all(WINDOWS, [pair], budget_s=1e-6)
    assert (late.outcome, late.finished) == (Outcome.BETTER, False)
    assert [trial.whole for trial in late.trials] == [False] * LIKELIEST + [True]


def test_strips_are_not_lower_than_the_window_to_begin_with() -> None:
    left, right, truth = steps_pair()
    wide = [np.hstack([np.vstack([one] * 2)] * 3)[:200] for one in (left, right, truth)]
    start = CorrelationMatcher(window_size=101, search=sl.SearchArea.rectified(16))
    found = sl.suggest(start, wide[0], wide[1], ground_truth=wide[2], budget_s=0.05)
    assert found.start == start


@pytest.mark.parametrize("budget_s", [0.0, -1.0, float("nan"), float("inf")])
def test_a_budget_that_is_no_time_is_refused(budget_s: float) -> None:
    left, right, truth = steps_pair()
    with pytest.raises(ValueError, match=r"budget_s is .* allowed is a finite number above 0"):
        sl.suggest(sl.StereoBM(), left, right, ground_truth=truth, budget_s=budget_s)


def test_it_ends_when_told_and_keeps_what_is_better() -> None:
    asked = count()
    found = sl.suggest(BLOCKS, LEFT, RIGHT, budget_s=60, cancelled=lambda: next(asked) >= 3)
    assert not found.finished
    assert found.tried == 3
    assert found.bad <= found.bad_before
    at_once = sl.suggest(BLOCKS, LEFT, RIGHT, budget_s=60, cancelled=lambda: True)
    assert (at_once.outcome, at_once.matcher, at_once.finished) == (Outcome.AS_GOOD, BLOCKS, False)


def test_every_trial_is_told() -> None:
    told: list[Suggestion] = []
    progress: list[float] = []
    end = sl.suggest(BLOCKS, LEFT, RIGHT, budget_s=60, found=told.append, progress=progress.append)
    assert [len(one.trials) for one in told] == list(range(len(end.trials) + 1))
    assert {one.matcher for one in told} == {BLOCKS}
    assert not any(one.finished for one in told)
    assert progress == sorted(progress)
    assert progress[-1] == 1


def test_several_pairs_are_judged_by_their_mean() -> None:
    pairs = [TuningPair.of(LEFT, RIGHT, TRUTH), TuningPair.of(LEFT[:100], RIGHT[:100], TRUTH[:100])]
    found = suggest_for_all(BLOCKS, iter(pairs), budget_s=60)
    assert found.bad_before == pytest.approx(np.mean([pair.judge(BLOCKS).bad for pair in pairs]))
    assert found.bad == pytest.approx(np.mean([pair.judge(found.matcher).bad for pair in pairs]))
    assert found.bad < found.bad_before
    mixed = suggest_for_all(BLOCKS, [pairs[0], TuningPair.of(LEFT, RIGHT, search_range=(0, 32))], budget_s=60)
    assert mixed.criterion is Criterion.ESTIMATED_BAD_2
    noise = np.random.default_rng(0).integers(0, 256, (2, 100, 150), dtype=np.uint8)
    unjudged = TuningPair.of(*noise, search_range=(0, 32))
    assert suggest_for_all(BLOCKS, [pairs[0], unjudged], budget_s=60).bad_before == pairs[0].judge(BLOCKS).bad
    assert suggest_for_all(BLOCKS, [unjudged]).outcome is Unjudged.TOO_LITTLE_MEASURED
    with pytest.raises(ValueError, match="pairs is empty"):
        suggest_for_all(BLOCKS, [])


def test_a_start_that_does_not_fit_is_refused() -> None:
    with pytest.raises(ValueError, match="window_size is 201"):
        sl.suggest(CorrelationMatcher(window_size=201), LEFT, RIGHT)
