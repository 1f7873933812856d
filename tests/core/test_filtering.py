"""Speckles removed, edges kept, gaps filled from the background."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy import ndimage

from stereolag.stereo.finishing.filling import filled_from_behind
from stereolag.stereo.finishing.stages import (
    MedianFilter,
    SpeckleFilter,
    edge_respecting_median,
    speckles,
    speckles_reference,
    weighted_median,
    weighted_median_reference,
    without_speckles,
)
from stereolag.stereo.matcher import Reason

FloatMap = npt.NDArray[np.float32]
NAN = np.float32(np.nan)


@settings(max_examples=20)
@given(
    seed=st.integers(0, 99),
    reach=st.integers(1, 2),
    spacing=st.integers(1, 3),
    channels=st.sampled_from([1, 3]),
    contrast=st.integers(1, 255),
)
def test_the_weighted_median_is_that_of_the_definition(
    seed: int, reach: int, spacing: int, channels: int, contrast: int
) -> None:
    rng = np.random.default_rng(seed)
    values = (rng.integers(-999, 999, (9, 11)) / 8).astype(np.float32)
    values[rng.random((9, 11)) < 0.3] = np.nan
    guide = rng.integers(0, 256, (9, 11, channels), dtype=np.uint8)
    radius = reach * spacing
    found = weighted_median(values, guide, radius, spacing, contrast)
    np.testing.assert_array_equal(found, weighted_median_reference(values, guide, radius, spacing, contrast))


def test_even_colour_gives_the_plain_median() -> None:
    rng = np.random.default_rng(0)
    values = (rng.integers(0, 999, (20, 300)) / 8).astype(np.float32)
    found = edge_respecting_median(values, np.zeros((20, 300), np.uint8), MedianFilter(radius=2))
    inside = (slice(2, -2), slice(2, -2))
    np.testing.assert_array_equal(found[inside], ndimage.median_filter(values, 5)[inside])


def test_an_edge_of_colour_keeps_its_disparities_apart() -> None:
    guide = np.zeros((30, 30, 3), np.uint8)
    guide[:, 15:] = 200
    disparity = np.full((30, 30), 5, np.float32)
    disparity[:, 17:] = 20  # fattened by two columns
    found = edge_respecting_median(disparity, guide, MedianFilter())
    assert (found[:, 15:] == 20).all() and (found[:, :15] == 5).all()


@pytest.mark.parametrize("channels", [1, 3])
@pytest.mark.parametrize("spread", [40.0, 900.0])
def test_rows_of_any_length_and_values_far_apart_have_the_same_median(channels: int, spread: float) -> None:
    rng = np.random.default_rng(3)
    values = (rng.integers(-256, 256, (7, 37)) * spread / 256).astype(np.float32)
    values[rng.random(values.shape) < 0.2] = np.nan
    values[2] = np.nan
    guide = rng.integers(0, 60, (*values.shape, channels), dtype=np.uint8)
    expected = weighted_median_reference(np.rint(values * 256) / np.float32(256), guide, 4, 2, 25)
    np.testing.assert_array_equal(weighted_median(values, guide, 4, 2, 25), expected)


def test_a_map_without_a_value_has_no_median() -> None:
    found = weighted_median(np.full((5, 20), NAN), np.zeros((5, 20, 1), np.uint8), 2, 1, 25)
    assert np.isnan(found).all()


@settings(max_examples=60)
@given(
    seed=st.integers(0, 99),
    rows=st.integers(1, 40),
    cols=st.integers(1, 40),
    size=st.sampled_from([1, 2, 5, 30, 200]),
    difference=st.sampled_from([0.06, 0.5, 2.0]),
    smooth=st.integers(0, 2),
)
def test_speckles_are_those_of_opencv(
    seed: int, rows: int, cols: int, size: int, difference: float, smooth: int
) -> None:
    rng = np.random.default_rng(seed)
    disparity = (ndimage.gaussian_filter(rng.normal(size=(rows, cols)), smooth) * 9).astype(np.float32)
    disparity[rng.random((rows, cols)) < 0.2] = np.nan
    found = speckles(disparity, size, difference)
    np.testing.assert_array_equal(found, speckles_reference(disparity, size, difference))


def measured(disparity: FloatMap) -> npt.NDArray[np.uint8]:
    return np.where(np.isfinite(disparity), Reason.MEASURED, Reason.LEFT_RIGHT).astype(np.uint8)


@pytest.mark.parametrize(("size", "kept"), [(12, True), (13, False)])
def test_a_surface_of_fewer_pixels_is_a_speckle(size: int, kept: bool) -> None:
    disparity = np.full((20, 20), 8, np.float32)
    disparity[5:8, 5:9] = 30
    found, reason = without_speckles(disparity, measured(disparity), SpeckleFilter(size=size))
    assert np.isfinite(found[6, 6]) == kept
    assert np.isnan(found).sum() == (0 if kept else 12) == (reason == Reason.SPECKLE).sum()


def test_a_slope_is_one_surface() -> None:
    disparity = np.tile(np.arange(20, dtype=np.float32), (20, 1))
    reason = measured(disparity)
    assert np.isfinite(without_speckles(disparity, reason, SpeckleFilter(size=400, difference=1))[0]).all()
    assert np.isnan(without_speckles(disparity, reason, SpeckleFilter(size=400, difference=0.5))[0]).all()


def test_gaps_before_speckles_keep_their_reason() -> None:
    disparity = np.full((9, 9), NAN)
    found, reason = without_speckles(disparity, measured(disparity), SpeckleFilter())
    assert np.isnan(found).all() and (reason == Reason.LEFT_RIGHT).all()


def test_a_gap_takes_the_farther_end() -> None:
    disparity = np.array([[NAN, 4, NAN, NAN, 9, NAN]], np.float32)
    filled, reason = filled_from_behind(disparity, measured(disparity))
    np.testing.assert_array_equal(filled, [[4, 4, 4, 4, 9, 9]])
    np.testing.assert_array_equal(reason == Reason.FILLED, np.isnan(disparity))


def test_an_empty_row_repeats_the_nearest_that_is_not() -> None:
    disparity = np.full((7, 3), NAN)
    disparity[2], disparity[5] = 1, 2
    filled, reason = filled_from_behind(disparity, measured(disparity))
    np.testing.assert_array_equal(filled[:, 0], [1, 1, 1, 1, 2, 2, 2])
    assert (reason[[0, 1, 3, 4, 6]] == Reason.FILLED).all() and (reason[[2, 5]] == Reason.MEASURED).all()


def test_nothing_to_fill_from_stays_empty() -> None:
    disparity = np.full((3, 3), NAN)
    filled, reason = filled_from_behind(disparity, measured(disparity))
    assert np.isnan(filled).all() and (reason == Reason.LEFT_RIGHT).all()
