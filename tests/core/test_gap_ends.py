"""Gaps filled along their rows, from the surfaces at their two ends."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
from hypothesis import given, settings
from hypothesis import strategies as st

from stereolag.stereo.finishing.filling import fill_between_ends_reference, filled_from_ends

FloatMap = npt.NDArray[np.float32]
NAN = np.float32(np.nan)


@settings(max_examples=40, deadline=None)
@given(st.integers(0, 999), st.floats(0, 0.9), st.integers(1, 9))
def test_rows_are_filled_as_by_the_formula(seed: int, gaps: float, length: int) -> None:
    rng = np.random.default_rng(seed)
    disparity = (rng.normal(0, 2, (30, 60)) + rng.uniform(-0.1, 0.1) * np.arange(60)).astype(np.float32)
    disparity[np.repeat(rng.random((30, 60)) < gaps / length, length, axis=1)[:, :60]] = np.nan
    disparity[: rng.integers(0, 30), : rng.integers(0, 12)] = np.nan
    np.testing.assert_allclose(filled_from_ends(disparity), fill_between_ends_reference(disparity), rtol=0, atol=1e-4)


def test_one_noisy_pixel_at_the_end_of_a_gap_makes_no_stripe() -> None:
    road = np.repeat(np.linspace(4, 20, 40, dtype=np.float32)[:, None], 100, axis=1)
    noisy = road + np.random.default_rng(0).normal(0, 0.5, road.shape).astype(np.float32)
    noisy[:, 30:70] = np.nan
    filled = filled_from_ends(noisy)[5:-5, 30:70]
    # Noise decides which end is used, but the mean of 42 pixels has little, and the slope of the road cancels in it.
    assert np.abs(filled - road[5:-5, 30:70]).max() < 0.35


def test_a_gap_takes_the_farther_surface() -> None:
    disparity = np.full((20, 40), 5, np.float32)
    disparity[:, 20:] = 12
    disparity[:, 10:20] = np.nan
    np.testing.assert_array_equal(filled_from_ends(disparity)[:, 10:20], 5)


def test_a_wall_goes_on_beyond_what_the_right_camera_sees() -> None:
    y, x = np.indices((60, 120), np.float32)
    wall = 20 - 0.06 * x + 0.02 * y
    seen = np.where(x < 30, NAN, wall).astype(np.float32)
    np.testing.assert_allclose(filled_from_ends(seen)[:, :30], wall[:, :30], atol=0.04)


def test_a_wall_that_recedes_goes_no_farther_than_what_was_measured() -> None:
    x = np.indices((60, 120), np.float32)[1]
    seen = np.where(x < 60, NAN, 0.05 * (x - 58)).astype(np.float32)
    filled = filled_from_ends(seen)
    assert filled.min() == np.nanmin(seen)
    assert np.isfinite(filled).all()


def test_a_ragged_wall_goes_on_level() -> None:
    x = np.indices((60, 120), np.float32)[1]
    seen = np.where((x < 30) | (np.random.default_rng(0).random(x.shape) < 0.3), NAN, 20 - 0.06 * x)
    seen[:, 30] = 18.2
    filled = filled_from_ends(seen.astype(np.float32))[:, :30]
    assert (np.ptp(filled, axis=1) == 0).all()
    assert (np.abs(filled - 18.05) < 0.2).all()


def test_a_row_without_a_value_stays_empty() -> None:
    disparity = np.full((3, 9), NAN)
    disparity[1, 4] = 7
    filled = filled_from_ends(disparity)
    assert np.isnan(filled[[0, 2]]).all()
    np.testing.assert_array_equal(filled[1], 7)
