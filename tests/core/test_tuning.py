"""Settings judged on pairs, tried in grids, and searched for: what counts, what stays, and when nothing is better."""

import math
import time
from collections.abc import Callable
from functools import cache
from itertools import count

import numpy as np
import pytest
from pairs import shifted_pair, steps_pair

import stereolag as sl
from stereolag import CorrelationMatcher, SearchArea, SemiGlobalMatcher, StereoBM, StereoSGBM, evaluate
from stereolag.assess import judging, suggestion
from stereolag.core.settings import changed, setting, title_of
from stereolag.stereo.finishing.stages import AmbiguityTest, LeftRightCheck, SpeckleFilter, TextureTest
from stereolag.stereo.matcher import Reason, StereoMatcher
from stereolag.stereo.methods import METHODS, preset
from stereolag.stereo.semi_global.cost import MatchingCost

LEFT, RIGHT, TRUTH = steps_pair()
NOISE = np.random.default_rng(0).integers(0, 256, (2, 100, 150), dtype=np.uint8)
WINDOWS = CorrelationMatcher(window_size=25, search=SearchArea.rectified(32))
BLOCKS = StereoBM(num_disparities=32, block_size=31)
UNPADDED = CorrelationMatcher(window_size=20, search=SearchArea.centred(20))


@cache
def seeing() -> judging.TuningPair:
    return judging.TuningPair.of(LEFT, RIGHT, TRUTH)


@cache
def blind() -> judging.TuningPair:
    return judging.TuningPair.of(LEFT, RIGHT, search_range=(0, 32))


# A map judged against a reference, and the certainty of a gain


@pytest.mark.parametrize("shape", [(5, 7), (8, 8), (61, 90), (120, 33)])
def test_bad_is_that_of_the_evaluation_whatever_the_blocks(shape: tuple[int, int]) -> None:
    rng = np.random.default_rng(0)
    reference = rng.uniform(0, 30, shape).astype(np.float32)
    disparity = reference + rng.normal(0, 2, shape).astype(np.float32)
    disparity[rng.random(shape) < 0.1] = np.nan
    reference[rng.random(shape) < 0.3] = np.nan
    judged = judging.Judgement.of(disparity, reference)
    assert judged.bad == pytest.approx(evaluate(disparity, reference, thresholds=(2.0,)).bad[2.0])
    assert judged.judged.sum() == np.isfinite(reference).sum()
    assert judged.dense == np.isfinite(disparity).all()
    assert len(judged.wrong) == min(8, shape[0]) * min(8, shape[1])
    assert math.isnan(judging.Judgement.of(disparity, np.full(shape, np.nan, np.float32)).bad), "nothing is judged"


def test_a_gain_everywhere_is_sure_and_one_in_a_corner_is_not() -> None:
    reference = np.zeros((160, 160), np.float32)
    start = np.where(np.random.default_rng(0).random(reference.shape) < 0.3, 9, 0).astype(np.float32)
    everywhere, corner = start.copy(), start.copy()
    everywhere[::5] = 0
    corner[:70, :75] = 0
    before, spread, local = (judging.Judgement.of(one, reference) for one in (start, everywhere, corner))
    sure, chance = judging.Gain.between([before], [spread]), judging.Gain.between([before], [local])
    assert sure.points == pytest.approx(before.bad - spread.bad)
    assert chance.points == pytest.approx(before.bad - local.bad)
    assert sure.points == pytest.approx(chance.points, rel=0.1)
    assert sure.sure > 0.8 * sure.points
    assert chance.sure < 0.6 * chance.points
    assert judging.Gain.between([before], [before]) == judging.Gain(0.0, 0.0)
    twice = judging.Gain.between([before, before], [spread, before])
    assert (twice.points, twice.error) == pytest.approx((sure.points / 2, sure.error / 2))
    wrong, right = (
        judging.Judgement.of(np.full((1, 1), one, np.float32), np.zeros((1, 1), np.float32)) for one in (9, 0)
    )
    alone = judging.Gain.between([wrong], [right])  # of one block
    assert (alone.points, alone.sure) == (100, -math.inf)


# Pairs with and without truth


def test_without_truth_what_the_accurate_preset_measured_is_the_judge() -> None:
    accurate = preset("accurate", 32).compute(LEFT, RIGHT)
    reference = judging.measured_reference(LEFT, RIGHT, search_range=(0, 32))
    measured = accurate.reason == Reason.MEASURED
    assert (accurate.reason == Reason.FILLED).any()
    np.testing.assert_array_equal(np.isfinite(reference), measured)
    np.testing.assert_array_equal(reference[measured], accurate.disparity[measured])
    np.testing.assert_array_equal(blind().reference, reference)
    assert judging.criterion_of([seeing()]) is judging.Criterion.TRUE_BAD_2
    assert (
        judging.criterion_of([seeing(), blind()])
        is judging.criterion_of([blind()])
        is judging.Criterion.ESTIMATED_BAD_2
    )


def test_the_estimate_orders_settings_as_the_truth_does() -> None:
    search = SearchArea.rectified(32)
    settings = [
        preset("fast", 32),
        *(CorrelationMatcher(window_size=size, search=search) for size in (3, 5, 11, 31)),
        *(StereoBM(num_disparities=32, block_size=size) for size in (5, 15, 31)),
        StereoSGBM(num_disparities=32),
    ]
    ranks = [np.argsort(np.argsort([pair.judge(one).bad for one in settings])) for pair in (blind(), seeing())]
    assert np.corrcoef(ranks)[0, 1] > 0.9


def test_strips_are_matched_as_the_whole_is() -> None:
    left, right = shifted_pair(400, 120, 0, -9)
    pair = judging.TuningPair.of(left, right, np.full(left.shape, 9.0))
    strips = pair.strips(0.5)
    assert strips.left.shape == strips.right.shape == strips.reference.shape == (3 * judging.STRIP_ROWS, 120)
    matcher = CorrelationMatcher(window_size=11, search=SearchArea.rectified(16))
    whole, part = (matcher.compute(one.left, one.right).disparity for one in (pair, strips))
    judged = np.isfinite(strips.reference)
    assert judged.mean() == pytest.approx(1 - 2 * judging.SEAM_ROWS / judging.STRIP_ROWS)
    tops = [round(400 / 3 * number + (400 / 3 - judging.STRIP_ROWS) / 2) for number in range(3)]
    rows = np.concatenate([np.arange(top, top + judging.STRIP_ROWS) for top in tops])
    np.testing.assert_array_equal(part[judged], whole[rows][judged])
    assert pair.strips(0.9) is pair
    sparse = np.full(left.shape, np.nan)
    sparse[0] = 9
    assert len(judging.TuningPair.of(left, right, sparse).strips(0.2).reference) == 400


def test_the_widest_range_holds_all() -> None:
    assert judging.widest_range([StereoBM(min_disparity=-16, num_disparities=32), StereoBM(num_disparities=64)]) == (
        -16,
        80,
    )
    assert judging.widest_range([UNPADDED]) is None
    tried = judging.combinations(StereoBM(), ("num_disparities", (16, 64, 7)), ("min_disparity", (-8, 0)))
    assert judging.widest_range(filter(None, tried)) == (-8, 72)


# The numeric settings of a method, and their values


@pytest.mark.parametrize("matcher", [*(method() for method in METHODS), preset("fast"), preset("accurate")])
def test_every_value_offered_can_be_set(matcher: StereoMatcher) -> None:
    known = judging.parameters(matcher)
    assert known
    for name, parameter in known.items():
        values = parameter.values(7)
        assert parameter.value in values
        assert 2 <= len(values) <= 7
        assert list(values) == sorted(set(values))
        fitting = 0
        for value in values:
            try:
                changed(matcher, {name: value})
                fitting += 1
            except ValueError as error:
                # A field alone never refuses, only a combination: a window larger than the search area, or P2 ≤ P1.
                assert any(words in str(error) for words in ("must be", "needs", "together"))
        assert fitting >= 2


def test_windows_are_tried_in_half_octaves_and_fractions_throughout() -> None:
    known = judging.parameters(CorrelationMatcher(window_size=20, search=SearchArea.rectified(64)))
    assert known["window_size"].values(7) == (7, 10, 14, 20, 28, 40, 57)
    assert known["search.vertical"].values(4) == (0, 1, 2, 4)
    assert known["overlap"].values(5)[0] < 0.3
    assert judging.parameters(StereoBM())["block_size"].values(5) == (11, 15, 21, 29, 43)


@pytest.mark.parametrize(
    ("name", "free", "without"),
    [
        ("search.vertical", CorrelationMatcher(), preset("fast")),
        ("cost.gradient_limit", SemiGlobalMatcher(), SemiGlobalMatcher(cost=MatchingCost(gradient=0))),
        ("speckle_range", StereoBM(speckle_window_size=50), StereoBM()),
    ],
)
def test_settings_without_an_effect_are_not_offered(name: str, free: StereoMatcher, without: StereoMatcher) -> None:
    assert name in judging.parameters(free)
    assert name not in judging.parameters(without)


# Grids

SHIFTED = shifted_pair(80, 140, 0, -9)
NINE = np.full(SHIFTED[0].shape, 9.0)
MATCHER = CorrelationMatcher(window_size=11, search=SearchArea.rectified(16))
SIZES, DENSE = ("window_size", (5, 11)), ("overlap", (0.95,))


@cache
def bench() -> judging.TuningPair:
    return judging.TuningPair.of(*SHIFTED, search_range=(0, 16))


def test_changes_are_validated_by_name_and_value() -> None:
    assert setting(changed(MATCHER, {"search.vertical": 2, "window_size": 9}), "search.vertical") == 2
    assert setting(MATCHER, "search.vertical") == 0
    for name, value, said in [
        ("windowsize", 9, "no setting 'windowsize'"),
        ("window_size.depth", 9, r"no setting 'window_size\.depth'"),
        ("window_size", 1, "window_size"),
    ]:
        with pytest.raises(ValueError, match=said):
            changed(MATCHER, {name: value})


def test_a_grid_finds_the_range_that_holds_the_shift() -> None:
    steps: list[float] = []
    grid = judging.sweep(
        MATCHER, [bench()], rows=("search.num_disparities", [4, 8, 16]), cols=SIZES, progress=steps.append
    )
    assert grid.bad.shape == (3, 2)
    assert grid.criterion is judging.Criterion.ESTIMATED_BAD_2
    assert grid.finished
    assert grid.best[0] == 2
    np.testing.assert_array_equal(grid.maps[2, 1], MATCHER.compute(*SHIFTED).disparity)
    assert steps[-1] == 1


def test_settings_that_do_not_fit_are_holes_in_the_grid() -> None:
    centred = CorrelationMatcher(window_size=9, search=SearchArea.centred(15))
    grid = judging.sweep(centred, [bench()], rows=("window_size", [9, 21]), cols=("search.search_size", [15, 33]))
    assert np.isfinite(grid.bad).tolist() == [[True, True], [False, True]]
    assert grid.shown.tolist() == [[True, True], [False, True]]
    assert np.isnan(grid.maps[1, 0]).all()
    wide, large = ("num_disparities", [16, 512]), ("block_size", [5, 101])
    grid = judging.sweep(StereoBM(num_disparities=16), [bench()], rows=wide, cols=large)
    assert np.isfinite(grid.bad).tolist() == [[True, False], [False, False]]


def test_a_sweep_that_is_called_off_keeps_its_cells() -> None:
    asked = iter([False, False, False, True])
    grid = judging.sweep(MATCHER, [bench()], rows=SIZES, cols=("overlap", [0.5, 0.95]), cancelled=lambda: next(asked))
    assert not grid.finished
    assert np.isfinite(grid.bad).tolist() == [[True, True], [True, False]]
    assert grid.shown.tolist() == [[True, True], [True, False]]


def test_several_pairs_are_judged_together_by_those_that_can() -> None:
    pairs = [judging.TuningPair.of(*SHIFTED, NINE), judging.TuningPair.of(*SHIFTED, NINE - 5)]
    grid = judging.sweep(MATCHER, pairs, rows=("window_size", [11]), cols=DENSE)
    assert grid.criterion is judging.Criterion.TRUE_BAD_2
    assert grid.bad[0, 0] == pytest.approx(np.mean([pair.judge(MATCHER).bad for pair in pairs]))
    np.testing.assert_array_equal(grid.maps[0, 0], MATCHER.compute(*SHIFTED).disparity)
    unjudged = judging.TuningPair.unjudgeable(*SHIFTED)
    judged = judging.sweep(MATCHER, [unjudged, bench()], rows=SIZES, cols=DENSE)
    assert judged.bad[1, 0] == bench().judge(MATCHER).bad
    alone = judging.sweep(MATCHER, [unjudged], rows=SIZES, cols=DENSE)
    assert np.isnan(alone.bad).all()
    assert alone.best is None
    assert alone.shown.all()


# Candidates of a search

TOLERANCES = {
    "left_right.tolerance", "speckle.size", "speckle.difference", "texture.least", "ambiguity.lead",
    "uniqueness_ratio", "disp12_max_diff", "speckle_window_size", "speckle_range", "texture_threshold",
}  # fmt: skip

STRICT = CorrelationMatcher(
    window_size=11,
    search=SearchArea.rectified(48, 3),
    left_right=LeftRightCheck(tolerance=3),
    speckle=SpeckleFilter(size=40, difference=1.0),
    texture=TextureTest(least=2.0),
    ambiguity=AmbiguityTest(lead=0.05),
)


@pytest.mark.parametrize(
    "matcher",
    [
        *(method() for method in METHODS),
        *(preset(name) for name in ("fast", "accurate")),
        STRICT,
        CorrelationMatcher(window_size=15, search=SearchArea.centred(41)),
        CorrelationMatcher(window_size=15, overlap=0.5, score="phase", search=SearchArea.rectified(32, vertical=2)),
        StereoSGBM(min_disparity=-8, uniqueness_ratio=3, speckle_window_size=40),
    ],
)
def test_ranges_and_tolerances_stay(matcher: StereoMatcher) -> None:
    tried = suggestion.candidates(matcher)
    assert 5 <= len(tried) <= 36
    assert len(set(tried)) == len(tried)
    assert matcher not in tried
    for one in tried:
        assert one.search_range() == matcher.search_range()
        names = {name for name, old, _ in suggestion.differences(matcher, one) if old is not None}
        assert not names & TOLERANCES
        assert not {name for name in names if "disparit" in name or "vertical" in name}
    assert not suggestion.candidates(UNPADDED)  # its window is its range


def test_differences_reach_into_settings_of_settings() -> None:
    after = preset("fast").model_copy(update={"median": None})
    assert [name for name, _, _ in suggestion.differences(preset("fast"), after)] == ["median"]
    strip = CorrelationMatcher(search=SearchArea.rectified(64, vertical=2))
    assert list(suggestion.differences(CorrelationMatcher(), strip)) == [("search.vertical", 0, 2)]
    assert suggestion.side_of(StereoBM(block_size=13)) == 13
    assert title_of(CorrelationMatcher, "median.radius") == "Median radius"


# The search


@cache
def best_blocks() -> suggestion.Suggestion:
    """Return what is found without truth, after every trial and the progress were told."""
    told: list[suggestion.Suggestion] = []
    progress: list[float] = []
    end = sl.suggest(BLOCKS, LEFT, RIGHT, budget_s=60, found=told.append, progress=progress.append)
    assert [len(one.trials) for one in told] == list(range(len(end.trials) + 1))
    assert {one.matcher for one in told} == {BLOCKS}
    assert not any(one.finished for one in told)
    assert progress == sorted(progress)
    assert progress[-1] == 1
    return end


@pytest.mark.parametrize(
    ("start", "truth"),
    [
        (WINDOWS, None),
        (BLOCKS, None),
        (WINDOWS, TRUTH),
        (StereoSGBM(num_disparities=32, block_size=11, p1=1, p2=2), TRUTH),
    ],
    ids=["windows, blind", "blocks, blind", "windows", "semi-global"],
)
def test_a_bad_start_gets_better(start: StereoMatcher, truth: np.ndarray | None) -> None:
    known = start is BLOCKS and truth is None
    found = best_blocks() if known else sl.suggest(start, LEFT, RIGHT, ground_truth=truth, budget_s=60)
    assert found.finished
    assert found.outcome is suggestion.Outcome.BETTER
    assert found.criterion is (judging.Criterion.ESTIMATED_BAD_2 if truth is None else judging.Criterion.TRUE_BAD_2)
    assert found.bad < found.bad_before
    assert {name: (setting(start, name), setting(found.matcher, name)) for name in found.changes} == found.changes
    before, after = (sl.evaluate(one.compute(LEFT, RIGHT).disparity, TRUTH).bad[2.0] for one in (start, found.matcher))
    assert after < before - 1
    lowest = min(found.trials, key=lambda trial: trial.bad)
    if truth is not None:
        assert (found.bad_before, found.bad) == pytest.approx((before, after))
        assert found.bad == lowest.bad
    elif start == WINDOWS:  # of windows that cannot be told apart, the smallest
        assert suggestion.side_of(found.matcher) <= suggestion.side_of(lowest.matcher)
        assert found.bad < lowest.bad + 1


def test_the_best_is_not_changed_again() -> None:
    again = sl.suggest(best_blocks().matcher, LEFT, RIGHT, budget_s=60)
    assert (again.outcome, again.matcher, again.changes) == (suggestion.Outcome.AS_GOOD, best_blocks().matcher, {})
    assert again.bad == again.bad_before == pytest.approx(best_blocks().bad)
    assert again.tried > 5
    nothing = sl.suggest(UNPADDED, LEFT, RIGHT, ground_truth=TRUTH)
    assert (nothing.outcome, nothing.matcher, nothing.tried) == (suggestion.Outcome.AS_GOOD, UNPADDED, 0)


def test_nothing_is_suggested_without_a_judge() -> None:
    accurate = preset("accurate", 32)
    told: list[float] = []
    found = sl.suggest(accurate, LEFT, RIGHT, progress=told.append)
    assert (found.outcome, found.matcher, found.trials) == (judging.Unjudged.JUDGES_ITSELF, accurate, ())
    assert np.isnan([found.bad, found.bad_before]).all()
    assert told[-1] == 1
    with_truth = sl.suggest(accurate, LEFT, RIGHT, ground_truth=TRUTH, budget_s=60)
    assert with_truth.bad <= with_truth.bad_before
    assert with_truth.tried
    unrelated = sl.suggest(BLOCKS, *NOISE)
    assert (unrelated.outcome, unrelated.matcher) == (judging.Unjudged.TOO_LITTLE_MEASURED, BLOCKS)


def test_a_short_time_is_spent_on_strips_but_whole_images_decide() -> None:
    tall = [np.tile(image, (4, 1)) for image in (LEFT, RIGHT, TRUTH)]
    pair = judging.TuningPair.of(*tall)
    WINDOWS.compute(*tall[:2])  # loads the compiled loops before the timing
    start = time.perf_counter()
    pair.judge(WINDOWS)
    once_s = time.perf_counter() - start
    found = suggestion.suggest_for_all(
        WINDOWS, [pair], budget_s=5 * once_s
    )  # a quarter of all, however fast the machine
    whole = [trial for trial in found.trials if trial.whole]
    assert 1 <= len(whole) < found.tried or not found.finished
    assert found.bad_before == pytest.approx(pair.judge(WINDOWS).bad)
    if found.outcome is suggestion.Outcome.BETTER:
        assert found.bad == pytest.approx(pair.judge(found.matcher).bad)
    late = suggestion.suggest_for_all(WINDOWS, [pair], budget_s=1e-6)
    assert (late.outcome, late.finished) == (suggestion.Outcome.BETTER, False)
    assert [trial.whole for trial in late.trials] == [False] * suggestion.MIN_TRIALS + [True]


def test_strips_are_not_lower_than_the_window_to_begin_with() -> None:
    wide = [np.hstack([np.vstack([one] * 2)] * 3)[:200] for one in (LEFT, RIGHT, TRUTH)]
    start = CorrelationMatcher(window_size=101, search=SearchArea.rectified(16))
    assert sl.suggest(start, wide[0], wide[1], ground_truth=wide[2], budget_s=0.05).start == start


def test_it_ends_when_told_and_keeps_what_is_better() -> None:
    asked = count()
    found = sl.suggest(BLOCKS, LEFT, RIGHT, budget_s=60, cancelled=lambda: next(asked) >= 3)
    assert not found.finished
    assert found.tried == 3
    assert found.bad <= found.bad_before
    at_once = sl.suggest(BLOCKS, LEFT, RIGHT, budget_s=60, cancelled=lambda: True)
    assert (at_once.outcome, at_once.matcher, at_once.finished) == (suggestion.Outcome.AS_GOOD, BLOCKS, False)


def test_several_pairs_are_searched_for_by_their_mean() -> None:
    pairs = [seeing(), judging.TuningPair.of(LEFT[:100], RIGHT[:100], TRUTH[:100])]
    found = suggestion.suggest_for_all(BLOCKS, iter(pairs), budget_s=60)
    assert found.bad_before == pytest.approx(np.mean([pair.judge(BLOCKS).bad for pair in pairs]))
    assert found.bad == pytest.approx(np.mean([pair.judge(found.matcher).bad for pair in pairs]))
    assert found.bad < found.bad_before
    unjudged = judging.TuningPair.of(*NOISE, search_range=(0, 32))
    assert (
        suggestion.suggest_for_all(BLOCKS, [seeing(), unjudged], budget_s=60).bad_before == seeing().judge(BLOCKS).bad
    )
    assert suggestion.suggest_for_all(BLOCKS, [unjudged]).outcome is judging.Unjudged.TOO_LITTLE_MEASURED


@pytest.mark.parametrize(
    ("act", "said"),
    [
        (lambda: sl.suggest(CorrelationMatcher(window_size=201), LEFT, RIGHT), "window_size is 201"),
        (lambda: judging.TuningPair.of(LEFT, RIGHT, np.zeros((20, 31))), "truth has shape"),
        (lambda: judging.TuningPair.of(LEFT, RIGHT, np.full(TRUTH.shape, np.nan)), "no finite disparity"),
        *(
            (lambda budget=budget: sl.suggest(BLOCKS, LEFT, RIGHT, budget_s=budget), f"budget_s is {budget}")
            for budget in (0.0, -1.0, math.nan, math.inf)
        ),
    ],
)
def test_what_makes_no_sense_is_refused(act: Callable[[], object], said: str) -> None:
    with pytest.raises(ValueError, match=said):
        act()


# Estimates


def test_a_sweep_is_its_largest_cell_and_all_maps() -> None:
    left = np.random.default_rng(0).integers(0, 256, (500, 800), dtype=np.uint8)
    pair = judging.TuningPair.of(left, left, np.zeros(left.shape))
    told = judging.estimate_sweep(
        StereoSGBM(), [pair], rows=("block_size", (3, 4, 5)), cols=("num_disparities", (64, 256))
    )
    largest = pair.estimate(StereoSGBM(block_size=5, num_disparities=256))
    assert told.memory == largest.memory
    assert told.seconds > largest.seconds


def test_a_search_is_its_largest_trial_and_without_truth_its_judge() -> None:
    shape, grey = (500, 800), np.uint8
    with_truth, without = (
        suggestion.estimate_suggestion(StereoBM(), shape, grey, blind=blind, budget_s=1e9) for blind in (False, True)
    )
    judge = judging.estimate_reference((0, 64), shape, grey)
    assert with_truth.memory == max(
        one.estimate(shape, grey).memory for one in (StereoBM(), *suggestion.candidates(StereoBM()))
    )
    assert without.memory == judge.memory > with_truth.memory
    assert without.seconds == with_truth.seconds + judge.seconds
    assert suggestion.estimate_suggestion(StereoBM(), shape, grey, blind=True, budget_s=0.1).seconds == 0.1
    assert judging.estimate_reference(None, shape) == judge
