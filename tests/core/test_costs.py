"""The matching cost, checked against its formula."""

from __future__ import annotations

from functools import partial
from typing import Annotated

import numpy as np
import numpy.typing as npt
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from pydantic import Field

from stereolag.core.inputs import as_eight_bit
from stereolag.core.settings import Bounds, SettingsError
from stereolag.stereo.semi_global import cost_volume
from stereolag.stereo.semi_global.cost_terms import MOST, TERMS, MatchingCost, TermWeight, census, census_reference
from stereolag.stereo.semi_global.cost_volume import UNSEEN, cost_reference, matching_cost

Picture = npt.NDArray[np.uint8]


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
