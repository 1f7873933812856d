"""Semi-global optimisation, checked against its recurrence, and the choice of the cheapest lag."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from stereolag.stereo.semi_global.paths import SemiGlobal, optimise, path_sums, path_sums_reference
from stereolag.stereo.semi_global.selection import cheapest_lags, cheapest_lags_reference, valley_offset

SHAPES = {"rows": st.integers(1, 7), "cols": st.integers(1, 8), "lags": st.integers(1, 35), "seed": st.integers(0, 99)}


@settings(max_examples=25)
@given(**SHAPES)
def test_the_paths_follow_the_recurrence(rows: int, cols: int, lags: int, seed: int) -> None:
    rng = np.random.default_rng(seed)
    costs = rng.integers(0, 251, (rows, cols, lags), dtype=np.uint8)
    guide = rng.integers(0, 256, (rows, cols), dtype=np.uint8)
    large = np.sort(rng.integers(10, 3000, 256)).astype(np.uint16)[::-1].copy()
    np.testing.assert_array_equal(path_sums(costs, guide, 10, large), path_sums_reference(costs, guide, 10, large))


@settings(max_examples=40)
@given(smallest=st.integers(-20, 20), few=st.booleans(), **SHAPES)
def test_the_cheapest_lags_are_those_of_the_formula(
    rows: int, cols: int, lags: int, seed: int, smallest: int, few: bool
) -> None:
    rng = np.random.default_rng(seed)
    sums = rng.integers(0, 3 if few else 52_000, (rows, cols, lags)).astype(np.uint16)
    found = cheapest_lags(sums, smallest)
    for ours, plain in zip(found, cheapest_lags_reference(sums, smallest), strict=True):
        np.testing.assert_array_equal(ours, plain)


def test_the_sums_do_not_depend_on_how_often_progress_is_told(monkeypatch: pytest.MonkeyPatch) -> None:
    rng = np.random.default_rng(0)
    costs, guide = rng.integers(0, 251, (7, 9, 5), dtype=np.uint8), rng.integers(0, 256, (7, 9), dtype=np.uint8)
    whole = optimise(costs, guide, SemiGlobal())
    monkeypatch.setattr("stereolag.stereo.semi_global.paths.CELLS_AT_ONCE", 3 * 9 * 5)
    told: list[float] = []
    np.testing.assert_array_equal(optimise(costs, guide, SemiGlobal(), told.append), whole)
    assert told == [1 / 7, 3 / 7, 5 / 7, 1.0]


def test_the_highest_costs_and_penalties_fit_sixteen_bits() -> None:
    costs = np.full((4, 5, 3), 250, np.uint8)
    costs[::2, ::2, 1] = 0
    sums = optimise(
        costs, np.zeros((4, 5), np.uint8), SemiGlobal(penalty_small=250, penalty_large=3000, penalty_at_edges=3000)
    )
    plain = path_sums_reference(costs, np.zeros((4, 5), np.uint8), 250, np.full(256, 3000, np.uint16))
    np.testing.assert_array_equal(sums, plain)


def test_a_smooth_surface_wins_over_a_lone_cheaper_pixel() -> None:
    costs = np.full((15, 15, 8), 100, np.uint8)
    costs[:, :, 3] = 20
    costs[7, 7] = 100
    costs[7, 7, 6] = 10
    sums = optimise(costs, np.zeros((15, 15), np.uint8), SemiGlobal())
    assert (cheapest_lags(sums, 0).lag == 3).all()


def test_a_jump_falls_on_the_edge_of_the_picture() -> None:
    rng = np.random.default_rng(0)
    guide = np.full((30, 40), 50, np.uint8)
    guide[:, 20:] = 180
    costs = rng.integers(80, 120, (30, 40, 16), dtype=np.uint8)
    costs[:, :16, 3] -= 60
    costs[:, 24:, 11] -= 60
    lag = cheapest_lags(optimise(costs, guide, SemiGlobal()), 0).lag
    assert (np.abs(lag[:, :20] - 3) <= 2).mean() > 0.98
    assert (np.abs(lag[:, 20:] - 11) <= 2).mean() > 0.98


def test_penalties_out_of_order_are_refused() -> None:
    with pytest.raises(ValueError, match="penalty_large 50"):
        SemiGlobal(penalty_large=50)


def test_the_valley_lies_towards_the_lower_flank() -> None:
    before, lowest, after = np.array([30, 10, 90, 20, -1]), np.full(5, 10), np.array([30, 90, 10, 40, 50])
    offset = valley_offset(before, lowest, after)
    assert offset[0] == 0 and offset[1] == -0.5 and offset[2] == 0.5 and -0.5 < offset[3] < 0 and offset[4] == 0
    np.testing.assert_array_equal(valley_offset(after[:4], lowest[:4], before[:4]), -offset[:4])
    assert not valley_offset(lowest, lowest, lowest).any()
