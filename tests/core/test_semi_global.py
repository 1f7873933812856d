"""Semi-global matching: costs, paths and selection against plain formulas, and the matcher."""

from __future__ import annotations

from functools import partial
from typing import Annotated, NamedTuple

import cv2
import numpy as np
import numpy.typing as npt
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from pydantic import Field

from stereolag.core.inputs import as_eight_bit
from stereolag.core.jobs import silent
from stereolag.core.settings import Bounds, SettingsError
from stereolag.stereo.finishing.checks import AmbiguityTest, LeftRightCheck
from stereolag.stereo.matcher import Reason
from stereolag.stereo.semi_global import cost_volume
from stereolag.stereo.semi_global import matcher as semi_global
from stereolag.stereo.semi_global.cost_terms import MOST, TERMS, MatchingCost, TermWeight, census, census_reference
from stereolag.stereo.semi_global.cost_volume import UNSEEN, cost_reference, matching_cost
from stereolag.stereo.semi_global.matcher import SemiGlobalMatcher, VolumeQuery, match_semi_global, strips
from stereolag.stereo.semi_global.paths import SemiGlobal, optimise, path_sums, path_sums_reference
from stereolag.stereo.semi_global.selection import cheapest_lags, cheapest_lags_reference, valley_offset

Picture = npt.NDArray[np.uint8]


def texture(height: int, width: int, seed: int = 0) -> npt.NDArray[np.float64]:
    """Return a smooth random texture that wraps around its sides."""
    rng = np.random.default_rng(seed)
    spectrum = np.fft.fft2(rng.normal(size=(height, width)))
    fy, fx = np.fft.fftfreq(height)[:, None], np.fft.fftfreq(width)
    plain = np.fft.ifft2(spectrum * np.exp(-40 * (fx**2 + fy**2))).real
    return np.asarray(128 + 40 * plain / plain.std())


def moved(image: npt.NDArray[np.float64], disparity: float) -> Picture:
    """Return the image moved left by any fraction of a pixel, as 8-bit levels."""
    turn = np.exp(2j * np.pi * np.fft.fftfreq(image.shape[1]) * disparity)
    return np.clip(np.rint(np.fft.ifft(np.fft.fft(image, axis=1) * turn, axis=1).real), 0, 255).astype(np.uint8)


class Matched(NamedTuple):
    """Disparities of every pixel: rounded to whole px, with the fraction, and from the right view."""

    whole: npt.NDArray[np.int64]
    disparity: npt.NDArray[np.float64]
    from_right: npt.NDArray[np.int64]


def query(left: Picture, right: Picture, first: int = 0, count: int = 16) -> VolumeQuery:
    return VolumeQuery(left, right, 9, first, count, MatchingCost(), SemiGlobal())


def matched(left: Picture, right: Picture, first: int = 0, count: int = 16) -> Matched:
    found = match_semi_global(query(left, right, first, count), silent)
    whole = found.lag.astype(int) + first
    return Matched(whole, whole + found.offset, found.right_lag.astype(int) + first)


@pytest.mark.parametrize(("shift", "first"), [(0, -8), (5, 0), (-6, -12), (11, 3)])
def test_a_whole_shift_is_found_everywhere(shift: int, first: int) -> None:
    image = texture(48, 96)
    found = matched(moved(image, 0), moved(image, shift), first)
    inside = (slice(None), slice(20, -20))
    assert (found.whole[inside] == shift).all()
    assert (found.from_right[inside] == shift).all()
    assert abs(found.disparity[inside].mean() - shift) < 0.02


@pytest.mark.parametrize("fraction", [0.1, 0.25, 0.4, 0.5, 0.6, 0.75, 0.9])
def test_the_mean_error_between_the_lags_is_small(fraction: float) -> None:
    image = texture(100, 200)
    found = matched(moved(image, 0), moved(image, 6 + fraction))
    assert abs(found.disparity[10:-10, 25:-25].mean() - (6 + fraction)) < 0.05


def test_swapping_mirrored_images_gives_the_mirrored_map() -> None:
    image = texture(40, 90)
    left, right = moved(image, 0), moved(image, 4.3)
    found, other = matched(left, right), matched(right[:, ::-1].copy(), left[:, ::-1].copy())
    assert abs(found.disparity[:, 25:-25].mean() - other.disparity[:, 25:-25].mean()) < 0.03


def test_a_square_before_a_wall_and_what_it_hides() -> None:
    rng = np.random.default_rng(1)
    wall = cv2.GaussianBlur(rng.integers(0, 256, (80, 150), dtype=np.uint8), (0, 0), 1)
    square = cv2.GaussianBlur(rng.integers(0, 256, (30, 30), dtype=np.uint8), (0, 0), 1)
    left, right = wall[:, :120].copy(), wall[:, 3:123].copy()
    left[25:55, 50:80], right[25:55, 40:70] = square, square
    found = matched(left, right)
    assert (found.whole[30:50, 55:75] == 10).mean() > 0.98
    assert (found.whole[:15, 10:] == 3).mean() > 0.98


def test_strips_cover_every_row_once_and_see_beyond() -> None:
    for height in (1, 100, 5000):
        pieces = list(strips(height, 4 * 2**20))
        assert [row for piece in pieces for row in range(piece.first, piece.end)] == list(range(height))
        assert all(piece.bottom - piece.top <= semi_global.MOST_BYTES / (4 * 2**20) for piece in pieces)


def test_strips_give_nearly_what_the_whole_gives(monkeypatch: pytest.MonkeyPatch) -> None:
    image = texture(120, 100)
    left, right = moved(image, 0), moved(image, 5.3)
    whole = matched(left, right)
    monkeypatch.setattr(semi_global, "MOST_BYTES", 100 * 16 * 3 * 80)
    assert len(list(strips(120, 100 * 16 * 3))) > 2
    parts = matched(left, right)
    assert (parts.whole == whole.whole).mean() > 0.99
    assert np.abs(parts.disparity - whole.disparity)[parts.whole == whole.whole].mean() < 0.01


def test_progress_only_grows_and_ends_at_one() -> None:
    image = texture(30, 60)
    told: list[float] = []
    match_semi_global(query(moved(image, 0), moved(image, 2)), told.append)
    assert told == sorted(told) and told[-1] == 1


@pytest.mark.parametrize("size", [4, 10, 254])
def test_a_window_without_a_middle_is_refused(size: int) -> None:
    with pytest.raises(SettingsError, match=f"window_size is {size}; allowed are odd sizes"):
        SemiGlobalMatcher(window_size=size)


def test_weights_that_are_all_nothing_are_refused() -> None:
    *others, last = MatchingCost.weights()
    with pytest.raises(
        SettingsError, match=f"{', '.join(others)} and {last} add up to 0; allowed are 1 to 250 together"
    ):
        MatchingCost(**dict.fromkeys(MatchingCost.weights(), 0))


WEIGHTS = [(100, 100, 40), (100, 0, 0), (0, 100, 0), (0, 0, 50), (3, 0, 0)]


@pytest.mark.parametrize("weights", WEIGHTS)
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


def test_the_same_share_of_the_weights_scores_alike() -> None:
    left, right = moved(texture(40, 90), 0), moved(texture(40, 90), 4)
    half, whole = (
        SemiGlobalMatcher(
            num_disparities=16,
            cost=MatchingCost(correlation=50 * k, census=50 * k, gradient=20 * k),
            optimisation=SemiGlobal(penalty_small=12 * k, penalty_large=200 * k, penalty_at_edges=40 * k),
        )
        .compute(left, right)
        .score
        for k in (1, 2)
    )
    np.testing.assert_allclose(half, whole, atol=0.01)


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


def test_a_window_larger_than_the_images_is_named() -> None:
    with pytest.raises(ValueError, match="window_size is 9 px and the images are 40 × 8"):
        SemiGlobalMatcher().compute(*np.zeros((2, 8, 40), np.uint8))


def noise(shape: tuple[int, int], seed: int = 0) -> Picture:
    return np.random.default_rng(seed).integers(0, 256, shape, dtype=np.uint8)


def expected(
    left: Picture, right: Picture, radius: int, first: int, count: int, cost: MatchingCost
) -> npt.NDArray[np.float64]:
    return cost_reference(left, right, radius, first, count, int(UNSEEN * cost.highest), cost)


@settings(max_examples=12)
@given(
    rows=st.integers(6, 12),
    cols=st.integers(6, 20),
    radius=st.integers(1, 4),
    first=st.integers(-24, 24),
    count=st.integers(1, 20),
    flat=st.booleans(),
    seed=st.integers(0, 99),
)
def test_the_cost_is_that_of_the_formula(
    rows: int, cols: int, radius: int, first: int, count: int, flat: bool, seed: int
) -> None:
    left, right = noise((rows, cols), seed), noise((rows, cols), seed + 1)
    if flat:
        left[:, : cols // 2] = 7
        right[rows // 2 :] = 200
    cost = MatchingCost()
    found = matching_cost(
        left, right, window_size=2 * radius + 1, min_disparity=first, num_disparities=count, settings=cost
    )
    assert np.abs(found - expected(left, right, radius, first, count, cost)).max() < 0.51


@pytest.mark.parametrize("term", MatchingCost.weights())
def test_each_term_alone(term: str) -> None:
    left, right = noise((9, 15)), noise((9, 15), 1)
    heaviest = Bounds.of(MatchingCost.model_fields[term]).high
    cost = MatchingCost(**dict.fromkeys(MatchingCost.weights(), 0) | {term: heaviest})
    found = matching_cost(left, right, window_size=5, min_disparity=0, num_disparities=6, settings=cost)
    assert np.abs(found - expected(left, right, 2, 0, 6, cost)).max() < 0.51


@pytest.mark.parametrize("shift", [-3, 0, 5])
def test_the_true_lag_costs_least_whatever_the_exposure(shift: int) -> None:
    scene = noise((40, 80))
    left, right = scene[:, 10:60], scene[:, 10 + shift : 60 + shift]
    darker = (right * 0.6 + 20).astype(np.uint8)
    for other in (right, darker):
        found = matching_cost(left, other, window_size=9, min_disparity=-4, num_disparities=12, settings=MatchingCost())
        inside = found[8:-8, 14:-14]
        assert (inside.argmin(axis=2) == shift + 4).mean() > 0.99


def test_the_census_is_that_of_the_formula_and_ignores_exposure() -> None:
    image = noise((11, 17))
    np.testing.assert_array_equal(census(image), census_reference(image))
    np.testing.assert_array_equal(census(image // 2), census((image // 2) + 9))


def test_eight_bits_are_left_as_they_are_and_others_share_one_scale() -> None:
    image = noise((8, 9))
    assert as_eight_bit(image, image)[0] is image
    deep = image.astype(np.uint16) * 100 + 3000
    left, right = as_eight_bit(deep, deep // 2)
    assert left.dtype == right.dtype == np.uint8
    assert left.max() == 255 and right.min() == 0 and right.max() < 140


@pytest.mark.parametrize("dtype", [np.uint16, np.float32, np.float64])
def test_a_flat_pair_of_any_type_survives(dtype: type) -> None:
    flat = np.full((8, 9), 3, dtype)
    assert not as_eight_bit(flat, flat)[0].any()


def test_every_term_has_its_weight_in_the_settings_and_no_weight_is_without_a_term() -> None:
    assert [term.weight for term in TERMS] == MatchingCost.weights()


def test_weights_that_eight_bits_cannot_hold_are_refused() -> None:
    class WithOneMore(MatchingCost):
        brightness: Annotated[int, TermWeight()] = Field(default=0, ge=0, le=50)

    assert WithOneMore(brightness=10).highest == MOST
    with pytest.raises(SettingsError, match="and brightness add up to 251; allowed are 1 to 250 together"):
        WithOneMore(brightness=11)


def test_the_loop_over_the_terms_gives_the_same_without_being_compiled(monkeypatch: pytest.MonkeyPatch) -> None:
    left, right = np.random.default_rng(0).integers(0, 256, (2, 12, 20), dtype=np.uint8)
    cost = partial(matching_cost, left, right, window_size=5, min_disparity=-2, num_disparities=8)
    compiled = cost(settings=MatchingCost())
    monkeypatch.setattr(cost_volume, "cost_rows", cost_volume.cost_rows.py_func)  # type: ignore[attr-defined]
    np.testing.assert_array_equal(cost(settings=MatchingCost()), compiled)


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
