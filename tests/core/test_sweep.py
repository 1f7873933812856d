"""Grids of settings."""

from __future__ import annotations

import numpy as np
import pytest
from pairs import shifted_pair

from stereolag.assess.judging import Criterion, TuningPair
from stereolag.assess.sweep import range_of_sweep, sweep
from stereolag.core.settings import changed
from stereolag.stereo.opencv import StereoBM
from stereolag.stereo.windows.matcher import CorrelationMatcher
from stereolag.stereo.windows.search import SearchArea

PAIR = shifted_pair(80, 140, 0, -9)
BENCH = [TuningPair.of(*PAIR, search_range=(0, 16))]
MATCHER = CorrelationMatcher(window_size=11, search=SearchArea.rectified(16))


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
    assert grid.bad.shape == (3, 2)
    assert grid.criterion is Criterion.ESTIMATED_BAD_2
    assert grid.finished
    assert grid.best is not None
    assert grid.best[0] == 2
    assert grid.matchers[2][1] == MATCHER
    np.testing.assert_array_equal(grid.maps[2][1], MATCHER.compute(*PAIR).disparity)
    assert steps[-1] == 1


def test_settings_that_do_not_fit_are_holes_in_the_grid() -> None:
    centred = CorrelationMatcher(window_size=9, search=SearchArea.centred(15))
    grid = sweep(centred, BENCH, rows=("window_size", [9, 21]), cols=("search.search_size", [15, 33]))
    assert np.isnan(grid.bad[1, 0])
    assert grid.matchers[1][0] is grid.maps[1][0] is None
    assert np.isfinite(grid.bad[[0, 0, 1], [0, 1, 1]]).all()


def test_truth_decides_where_it_is_given() -> None:
    truth = np.full(PAIR[0].shape, 9.0)
    grid = sweep(
        StereoBM(num_disparities=16, block_size=11),
        [TuningPair.of(*PAIR, truth)],
        rows=("block_size", [5, 11]),
        cols=("min_disparity", [-32, 0]),
    )
    assert grid.criterion is Criterion.TRUE_BAD_2
    assert np.all(grid.bad[:, 1] < 30)
    assert np.all(grid.bad[:, 0] > 90)


def test_a_setting_that_does_not_exist_is_named() -> None:
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
    assert np.isfinite(grid.bad).tolist() == [[True, False], [False, False]]


def test_a_sweep_that_is_called_off_keeps_its_cells() -> None:
    asked = iter([False, False, False, True])
    grid = sweep(
        MATCHER, BENCH, rows=("window_size", [5, 11]), cols=("overlap", [0.5, 0.95]), cancelled=lambda: next(asked)
    )
    assert not grid.finished
    assert np.isfinite(grid.bad).tolist() == [[True, True], [True, False]]
    assert grid.maps[1][1] is grid.matchers[1][1] is None


def test_several_pairs_are_judged_together() -> None:
    truth = np.full(PAIR[0].shape, 9.0)
    pairs = [TuningPair.of(*PAIR, truth), TuningPair.of(*PAIR, truth - 5)]
    grid = sweep(MATCHER, pairs, rows=("window_size", [11]), cols=("overlap", [0.95]))
    assert grid.bad[0, 0] == pytest.approx(np.mean([pair.judge(MATCHER).bad for pair in pairs]))
    np.testing.assert_array_equal(grid.maps[0][0], MATCHER.compute(*PAIR).disparity)
    with pytest.raises(ValueError, match="pairs is empty"):
        sweep(MATCHER, [], rows=("window_size", [11]), cols=("overlap", [0.95]))


def test_maps_without_a_judge_have_no_figure() -> None:
    unjudged = TuningPair(*PAIR, np.full(PAIR[0].shape, np.nan, np.float32), Criterion.ESTIMATED_BAD_2)
    grid = sweep(MATCHER, [unjudged], rows=("window_size", [5, 11]), cols=("overlap", [0.95]))
    assert np.isnan(grid.bad).all()
    judged = sweep(MATCHER, [unjudged, *BENCH], rows=("window_size", [5, 11]), cols=("overlap", [0.95]))
    assert judged.bad[1, 0] == BENCH[0].judge(MATCHER).bad
    assert grid.best is None
    assert grid.maps[1][0] is not None


def test_the_range_of_a_sweep_holds_every_cell() -> None:
    rows, cols = ("num_disparities", (16, 64, 32)), ("min_disparity", (-8, 0))
    assert range_of_sweep(StereoBM(), rows=rows, cols=cols) == (-8, 72)
