"""Semi-global matching: costs, paths and selection against plain formulas, and the matcher."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from pairs import shifted, texture

from stereolag.core.arrays import Array, DoubleMap, EightBit
from stereolag.core.jobs import silent
from stereolag.core.settings import Bounds, SettingsError
from stereolag.stereo.finishing.stages import AmbiguityTest, LeftRightCheck
from stereolag.stereo.matcher import Reason
from stereolag.stereo.semi_global import matcher as semi_global
from stereolag.stereo.semi_global.cost import (
    NOT_TRIED,
    OUT_OF_FRAME_SHARE,
    MatchingCost,
    cost_reference,
    matching_cost,
)
from stereolag.stereo.semi_global.ends import fit_ends, fit_ends_reference
from stereolag.stereo.semi_global.matcher import SemiGlobalMatcher, strips
from stereolag.stereo.semi_global.optimisation import (
    CheapestLags,
    SemiGlobal,
    cheapest_lags,
    cheapest_lags_reference,
    optimise,
    optimise_reference,
    place_valleys,
    valley_offset,
)


def pair(rows: int, cols: int, disparity: float) -> tuple[EightBit, EightBit]:
    """Return a smooth texture and the same moved left by any fraction of a pixel."""
    image = texture(rows, cols, blur=1.42)
    left, right = (np.clip(np.rint(one), 0, 255).astype(np.uint8) for one in (image, shifted(image, 0, -disparity)))
    return left, right


def matched(left: EightBit, right: EightBit, first: int = 0) -> tuple[DoubleMap, DoubleMap, DoubleMap]:
    """Return the disparities of every pixel: rounded to whole px, with the fraction, and from the right view."""
    found = SemiGlobalMatcher(num_disparities=16, min_disparity=first).cheapest_lags(left, right, silent)
    whole = found.lag.astype(float) + first
    return whole, whole + valley_offset(*found.around), found.right_lag.astype(float) + first


@pytest.mark.parametrize(("shift", "first"), [(0, -8), (5, 0), (-6, -12), (11, 3)])
def test_a_whole_shift_is_found_everywhere(shift: int, first: int) -> None:
    whole, disparity, from_right = (one[:, 20:-20] for one in matched(*pair(48, 96, shift), first))
    assert (whole == shift).all() and (from_right == shift).all()
    assert abs(disparity.mean() - shift) < 0.02


@pytest.mark.parametrize("fraction", [0.1, 0.25, 0.5, 0.6, 0.9])
def test_the_mean_error_between_the_lags_is_small_and_the_same_in_the_mirror(fraction: float) -> None:
    left, right = pair(100, 200, 6 + fraction)
    for one, other in ((left, right), (right[:, ::-1].copy(), left[:, ::-1].copy())):
        assert abs(matched(one, other)[1][10:-10, 25:-25].mean() - (6 + fraction)) < 0.05


@pytest.mark.parametrize("height", [1, 100, 5000])
def test_strips_cover_every_row_once_within_the_memory(height: int) -> None:
    pieces = list(strips(height, 4 * 2**20))
    assert [row for first, end in pieces for row in range(first, end)] == list(range(height))
    assert all(
        end - first + 2 * semi_global.OVERLAP <= semi_global.MAX_VOLUME_BYTES / 2**22 for first, end in pieces[1:]
    )


def test_strips_give_nearly_what_the_whole_gives_and_progress_only_grows(monkeypatch: pytest.MonkeyPatch) -> None:
    left, right = pair(120, 100, 5.3)
    whole, fine, _ = matched(left, right)
    monkeypatch.setattr(semi_global, "MAX_VOLUME_BYTES", 100 * 16 * 3 * 80)
    assert len(list(strips(120, 100 * 16 * 3))) > 2
    parts, fine_parts, _ = matched(left, right)
    assert (parts == whole).mean() > 0.99
    assert np.abs(fine_parts - fine)[parts == whole].mean() < 0.01
    told: list[float] = []
    SemiGlobalMatcher(num_disparities=16).cheapest_lags(left, right, told.append)
    assert told == sorted(told) and told[-1] == 1


@pytest.mark.parametrize("weights", [(100, 100, 40), (100, 0, 0), (0, 100, 0), (0, 0, 50), (3, 0, 0)])
def test_the_score_lies_between_none_and_all_of_the_weights_in_use(weights: tuple[int, int, int]) -> None:
    """It used to reach -0.23, and 1 without any weight, because it was computed from weights that were not in use."""
    cost = MatchingCost(**dict(zip(("correlation", "census", "gradient"), weights, strict=True)))
    matcher = SemiGlobalMatcher(num_disparities=16, window_size=5, cost=cost)
    noise = np.random.default_rng(0).integers(0, 256, (2, 40, 70), dtype=np.uint8)
    unrelated = matcher.compute(*noise).score
    same = matcher.compute(noise[0], noise[0]).score
    for score in (unrelated, same):
        assert score.min() >= 0 and score.max() <= 1
    inside = np.s_[6:-6, 22:-6]
    assert np.median(same[inside]) > 0.98
    assert np.median(unrelated[inside]) < 0.9


def test_the_checks_of_the_matcher_give_their_reasons() -> None:
    noise = np.random.default_rng(0).integers(0, 256, (2, 40, 90), dtype=np.uint8)
    matcher = SemiGlobalMatcher(num_disparities=16, left_right=LeftRightCheck())
    assert (matcher.compute(*noise).reason == Reason.LEFT_RIGHT).mean() > 0.2
    matcher = SemiGlobalMatcher(num_disparities=16, ambiguity=AmbiguityTest(lead=0.5))
    assert (matcher.compute(*noise).reason == Reason.AMBIGUOUS).mean() > 0.5
    bare = noise[0].copy()
    bare[:, 30:60] = 90
    reason = SemiGlobalMatcher(num_disparities=16).compute(bare, bare).reason
    assert (reason[:, 35:55] == Reason.LOW_TEXTURE).all()


def noise(shape: tuple[int, int], seed: int = 0) -> EightBit:
    return np.random.default_rng(seed).integers(0, 256, shape, dtype=np.uint8)


WEIGHTS = ("correlation", "census", "gradient")


@settings(max_examples=20)
@given(
    rows=st.integers(6, 12),
    cols=st.integers(6, 20),
    radius=st.integers(1, 4),
    first=st.integers(-24, 24),
    count=st.integers(1, 20),
    flat=st.booleans(),
    seed=st.integers(0, 99),
    alone=st.sampled_from([None, *WEIGHTS]),
)
def test_the_cost_is_that_of_the_formula(rows, cols, radius, first, count, flat, seed, alone):
    left, right = noise((rows, cols), seed), noise((rows, cols), seed + 1)
    if flat:
        left[:, : cols // 2] = 7
        right[rows // 2 :] = 200
    cost = MatchingCost()
    if alone:
        heaviest = Bounds.of(MatchingCost.model_fields[alone]).high
        cost = MatchingCost(**dict.fromkeys(WEIGHTS, 0) | {alone: heaviest})
    found = matching_cost(
        left, right, window_size=2 * radius + 1, min_disparity=first, num_disparities=count, settings=cost
    )
    expected = cost_reference(left, right, radius, first, count, int(OUT_OF_FRAME_SHARE * cost.highest), cost)
    assert np.abs(found[:, :, :count] - expected).max() < 0.51
    assert (found[:, :, count:] == NOT_TRIED).all()


def test_weights_that_are_all_nothing_or_more_than_eight_bits_hold_and_penalties_out_of_order_are_refused() -> None:
    with pytest.raises(ValueError, match="penalty_large 50"):
        SemiGlobal(penalty_large=50)
    with pytest.raises(SettingsError, match="correlation, census and gradient add up to 0; allowed are 1 to 250"):
        MatchingCost(**dict.fromkeys(WEIGHTS, 0))
    assert MatchingCost(gradient=50).highest == 250


def in_strips(volume: Array, untried: int) -> Array:
    """Return a volume with lags that are not tried after its own, up to whole strips of sixteen."""
    return np.pad(volume, ((0, 0), (0, 0), (0, -volume.shape[2] % 16)), constant_values=untried)


SHAPES = {"rows": st.integers(1, 7), "cols": st.integers(1, 8), "lags": st.integers(1, 35), "seed": st.integers(0, 99)}


@settings(max_examples=25)
@given(**SHAPES)
def test_the_paths_follow_the_recurrence(rows: int, cols: int, lags: int, seed: int) -> None:
    rng = np.random.default_rng(seed)
    costs = rng.integers(0, 251, (rows, cols, lags), dtype=np.uint8)
    guide = rng.integers(0, 256, (rows, cols), dtype=np.uint8)
    small, at_edges, most = np.sort(rng.integers(1, 251, 3)).tolist()
    penalties = SemiGlobal(
        penalty_small=small, penalty_at_edges=at_edges, penalty_large=12 * most, edge_contrast=rng.integers(1, 256)
    )
    found = optimise(in_strips(costs, NOT_TRIED), guide, penalties)
    np.testing.assert_array_equal(found[:, :, :lags], optimise_reference(costs, guide, penalties))
    assert (found.argmin(axis=2) < lags).all()


@given(smallest=st.integers(-20, 20), few=st.booleans(), **SHAPES)
def test_the_cheapest_lags_are_those_of_the_formula(rows, cols, lags, seed, smallest, few):
    rng = np.random.default_rng(seed)
    sums = rng.integers(0, 3 if few else 52_000, (rows, cols, lags)).astype(np.uint16)
    found = cheapest_lags(in_strips(sums, 60_000), smallest, lags)
    without = cheapest_lags(in_strips(sums, 60_000), smallest, lags, runner_up=False)
    assert without.runner_up.size == 0
    np.testing.assert_array_equal(without.lag, found.lag)
    for ours, plain in zip(found, cheapest_lags_reference(sums, smallest), strict=True):
        np.testing.assert_array_equal(ours, plain)


def test_the_sums_do_not_depend_on_how_often_progress_is_told(monkeypatch: pytest.MonkeyPatch) -> None:
    costs = np.random.default_rng(0).integers(0, 251, (7, 9, 16), dtype=np.uint8)
    guide = noise((7, 9))
    whole = optimise(costs, guide, SemiGlobal())
    monkeypatch.setattr("stereolag.stereo.semi_global.optimisation.CELLS_PER_REPORT", 3 * 9 * 16)
    told: list[float] = []
    np.testing.assert_array_equal(optimise(costs, guide, SemiGlobal(), told.append), whole)
    assert told == [1 / 7, 3 / 7, 5 / 7, 1.0]


def test_the_highest_costs_and_penalties_fit_sixteen_bits() -> None:
    costs, guide = np.full((4, 5, 16), 250, np.uint8), np.zeros((4, 5), np.uint8)
    costs[::2, ::2, 1] = 0
    penalties = SemiGlobal(penalty_small=250, penalty_large=3000, penalty_at_edges=3000)
    np.testing.assert_array_equal(optimise(costs, guide, penalties), optimise_reference(costs, guide, penalties))


def test_the_valley_lies_towards_the_lower_flank() -> None:
    before, lowest, after = np.array([30, 10, 90, 20, -1]), np.full(5, 10), np.array([30, 90, 10, 40, 50])
    offset = valley_offset(before, lowest, after)
    assert offset[0] == 0 and offset[1] == -0.5 and offset[2] == 0.5 and -0.5 < offset[3] < 0 and offset[4] == 0
    np.testing.assert_array_equal(valley_offset(after[:4], lowest[:4], before[:4]), -offset[:4])
    assert not valley_offset(lowest, lowest, lowest).any()


def test_disparity_and_score_are_those_of_the_formulas_with_the_ends_as_given() -> None:
    rng = np.random.default_rng(0)
    lag, reason = rng.integers(0, 9, (6, 40)).astype(np.int16), rng.integers(0, 2, (6, 40)).astype(np.uint8)
    lowest = rng.integers(0, 900, lag.shape).astype(np.int32)
    around = np.stack([lowest + rng.integers(0, 9, lag.shape), lowest, lowest + rng.integers(0, 9, lag.shape)])
    offset = rng.random(lag.shape).astype(np.float32)
    found = CheapestLags(lag, around.astype(np.int32), lowest, lag)
    disparity, score = np.empty_like(offset), np.empty_like(offset)
    place_valleys(found, reason, (0, 8), -3, 800, 0, 6, offset, disparity, score)
    at_end = (lag == 0) | (lag == 8)
    expected = np.where(reason == Reason.MEASURED, lag - 3 + np.where(at_end, offset, valley_offset(*around)), np.nan)
    np.testing.assert_allclose(disparity, expected, rtol=1e-6)
    np.testing.assert_array_equal(score, np.clip(1 - lowest / 800, 0, 1).astype(np.float32))


@pytest.mark.parametrize("disparity", [-7, -1, 0, 1, 12])
def test_the_peaks_at_an_end_are_those_of_the_formula(disparity: int) -> None:
    rng = np.random.default_rng(disparity + 9)
    left = rng.integers(-128, 128, (16, 36)).astype(np.int16)
    right = (np.roll(left, -disparity, axis=1) // 2 + rng.integers(-40, 40, left.shape)).astype(np.int16)
    where = rng.random((12, 32)) < 0.5
    ours, plain = ((np.zeros(where.shape, np.bool_), np.zeros(where.shape, np.float32)) for _ in range(2))
    fit_ends(left, right, disparity, where, 0, 12, *ours)
    fit_ends_reference(left, right, disparity, where, *plain)
    assert plain[0].any() and not plain[0].all()
    np.testing.assert_array_equal(ours[0], plain[0])
    np.testing.assert_allclose(ours[1], plain[1], atol=1e-5)
