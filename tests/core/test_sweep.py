"""Agreement without truth, grids of settings, and the search for good ones."""

from __future__ import annotations

from itertools import count

import numpy as np
import pytest
from pairs import shifted_pair

from stereolag.settings import changed
from stereolag.stereo.opencv import StereoBM
from stereolag.stereo.windows.matcher import CorrelationMatcher
from stereolag.stereo.windows.search import SearchArea
from stereolag.tuning.objective import (
    SCALES,
    TuningPair,
    affordable_pair,
    consistent,
    likeness,
    photometric_consistency,
    seen_from_the_right,
)
from stereolag.tuning.suggestion import Suggestion, search_settings
from stereolag.tuning.sweep import sweep

PAIR = shifted_pair(80, 140, 0, -9)
BENCH = TuningPair.of(*PAIR)
MATCHER = CorrelationMatcher(window_size=11, search=SearchArea.rectified(16))


def test_a_right_map_agrees_and_a_wrong_one_does_not() -> None:
    right_one = photometric_consistency(MATCHER.compute(*PAIR), seen_from_the_right(MATCHER, *PAIR), *PAIR)
    narrow = CorrelationMatcher(window_size=11, search=SearchArea.rectified(6))
    wrong = photometric_consistency(narrow.compute(*PAIR), seen_from_the_right(narrow, *PAIR), *PAIR)
    assert right_one > 0.7
    assert wrong < 0.2
    assert 0 <= wrong <= right_one <= 1


def test_the_way_there_and_back() -> None:
    result, mirrored = MATCHER.compute(*PAIR), seen_from_the_right(MATCHER, *PAIR)
    sure = consistent(result, mirrored)
    assert sure[20:-20, 40:-20].all()
    assert not sure[~result.valid].any()
    alike = likeness(result, *PAIR)
    assert np.median(alike[20:-20, 40:-20]) > 0.95
    assert np.all(alike[~result.valid] == 0)


def test_vertical_displacements_come_back_too() -> None:
    pair = shifted_pair(80, 120, 4, -5)
    matcher = CorrelationMatcher(window_size=15, search=SearchArea.centred(31))
    sure = consistent(matcher.compute(*pair), seen_from_the_right(matcher, *pair))
    assert sure[25:-25, 25:-25].mean() > 0.98


def test_changes_are_validated_by_name_and_value() -> None:
    assert changed(MATCHER, {"search.vertical": 2, "window_size": 9}).search.vertical == 2  # type: ignore[attr-defined]
    assert MATCHER.search.vertical == 0  # type: ignore[union-attr]
    with pytest.raises(ValueError, match="no setting 'windowsize'"):
        changed(MATCHER, {"windowsize": 9})
    with pytest.raises(ValueError, match=r"no setting 'window_size\.depth'"):
        changed(MATCHER, {"window_size.depth": 9})
    with pytest.raises(ValueError, match="window_size"):
        changed(MATCHER, {"window_size": 1})


def test_a_grid_finds_the_range_that_holds_the_shift() -> None:
    steps: list[float] = []
    grid = sweep(
        MATCHER,
        BENCH,
        rows=("search.num_disparities", [4, 8, 16]),
        cols=("window_size", [5, 11]),
        progress=steps.append,
    )
    assert grid.objectives.shape == (3, 2)
    assert grid.best is not None
    assert grid.best[0] == 2
    assert grid.matchers[2][1] == MATCHER
    np.testing.assert_array_equal(grid.maps[2][1], MATCHER.compute(*PAIR).disparity)
    assert steps[-1] == 1


def test_settings_that_do_not_fit_are_holes_in_the_grid() -> None:
    centred = CorrelationMatcher(window_size=9, search=SearchArea.centred(15))
    grid = sweep(centred, BENCH, rows=("window_size", [9, 21]), cols=("search.search_size", [15, 33]))
    assert np.isnan(grid.objectives[1, 0])
    assert grid.matchers[1][0] is grid.maps[1][0] is None
    assert np.isfinite(grid.objectives[[0, 0, 1], [0, 1, 1]]).all()


def test_truth_decides_where_it_is_given() -> None:
    truth = np.full(PAIR[0].shape, 9.0)
    grid = sweep(
        StereoBM(num_disparities=16, block_size=11),
        TuningPair.of(*PAIR, truth),
        rows=("block_size", [5, 11]),
        cols=("min_disparity", [-32, 0]),
    )
    assert np.all(grid.objectives[:, 1] > 0.7)
    assert np.all(grid.objectives[:, 0] < 0.1)


def test_suggest_mends_a_bad_start_and_says_why() -> None:
    bad = CorrelationMatcher(window_size=3, search=SearchArea.rectified(4))
    choices = {"search.num_disparities": (4, 8, 16), "window_size": (3, 7, 11)}
    found = search_settings(bad, BENCH, choices=choices, budget_s=60)
    assert found.finished
    assert found.matcher.search.num_disparities == 16  # type: ignore[attr-defined]
    assert found.objective > found.objective_before + 0.3
    old, new, gain = found.changes["search.num_disparities"]
    assert (old, new) == (4, 16)
    assert sum(change[2] for change in found.changes.values()) == pytest.approx(
        found.objective - found.objective_before
    )
    assert gain > 0.3
    again = search_settings(found.matcher, BENCH, choices=choices, budget_s=60)
    assert again.matcher == found.matcher
    assert not again.changes


def test_suggest_stops_when_told_and_keeps_the_best() -> None:
    asked = count()
    bad = CorrelationMatcher(window_size=3, search=SearchArea.rectified(4))
    choices = {"search.num_disparities": (16, 8), "window_size": (7, 11, 15)}
    found = search_settings(bad, BENCH, choices=choices, budget_s=60, cancelled=lambda: next(asked) >= 1)
    assert not found.finished
    assert found.tried == 2
    assert found.objective > found.objective_before


def test_every_trial_reports_the_best_so_far() -> None:
    told: list[Suggestion] = []
    bad = CorrelationMatcher(window_size=3, search=SearchArea.rectified(4))
    choices = {"search.num_disparities": (8, 16), "window_size": (7, 500)}
    end = search_settings(bad, BENCH, choices=choices, budget_s=60, found=told.append)
    assert told[0].matcher == bad
    assert [one.objective for one in told] == sorted(one.objective for one in told)
    assert told[-1] == end
    assert end.finished
    assert end.tried == len(told) - 1


def test_a_setting_that_does_not_exist_is_named() -> None:
    with pytest.raises(ValueError, match="no setting 'block'"):
        search_settings(MATCHER, BENCH, choices={"block": (1,)})
    with pytest.raises(ValueError, match="no setting 'block'"):
        sweep(MATCHER, BENCH, rows=("block", (1,)), cols=("window_size", (5,)))
    with pytest.raises(ValueError, match="two different ones"):
        sweep(MATCHER, BENCH, rows=("window_size", (5,)), cols=("window_size", (5,)))
    with pytest.raises(ValueError, match="no values"):
        sweep(MATCHER, BENCH, rows=("overlap", ()), cols=("window_size", (5,)))


def test_settings_too_large_for_the_images_are_holes_too() -> None:
    grid = sweep(
        StereoBM(num_disparities=16), BENCH, rows=("num_disparities", [16, 512]), cols=("block_size", [5, 101])
    )
    assert np.isfinite(grid.objectives).tolist() == [[True, False], [False, False]]


def test_a_bench_is_as_large_as_the_budget_allows() -> None:
    assert affordable_pair(MATCHER, *PAIR, trials=1, budget_s=1e6).scale == SCALES[0]
    small = affordable_pair(MATCHER, *PAIR, trials=10**9, budget_s=1.0)
    assert small.scale == SCALES[-1]
    assert small.left.shape == (20, 35)
