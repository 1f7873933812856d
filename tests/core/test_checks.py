"""The checks of finished matches."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from pairs import shifted_pair

from stereolag.core.inputs import flat_energy, local_deviation
from stereolag.stereo.finishing.checks import (
    TextureTest,
    ambiguous,
    least_texture,
    left_right_disagree,
    left_right_disagree_reference,
    rejected,
)
from stereolag.stereo.matcher import Reason
from stereolag.stereo.windows.matcher import CorrelationMatcher
from stereolag.stereo.windows.search import SearchArea


def test_agreeing_displacements_pass_and_what_leaves_the_frame_does_not() -> None:
    dx = np.full((3, 10), -4, np.int16)
    disagree = left_right_disagree(dx, dx, 0)
    assert disagree[:, :4].all()
    assert not disagree[:, 4:].any()


def test_a_right_pixel_without_a_match_disagrees() -> None:
    dx = np.zeros((2, 5), np.int16)
    right = dx.copy()
    right[0, 2] = -32768
    expected = np.zeros((2, 5), bool)
    expected[0, 2] = True
    np.testing.assert_array_equal(left_right_disagree(dx, right, 16), expected)


@given(st.integers(0, 99), st.integers(0, 3))
def test_the_check_is_that_of_the_definition(seed: int, tolerance: int) -> None:
    rng = np.random.default_rng(seed)
    dx, right = rng.integers(-5, 6, (2, 4, 9)).astype(np.int16)
    found = left_right_disagree(dx, right, tolerance)
    np.testing.assert_array_equal(found, left_right_disagree_reference(dx, right, tolerance))
    for y in range(4):
        for x in range(9):
            there = x + int(dx[y, x])
            agrees = 0 <= there < 9 and abs(int(right[y, there]) - int(dx[y, x])) <= tolerance
            assert found[y, x] == (not agrees)


def test_a_hidden_strip_fails_the_check() -> None:
    left = np.zeros((1, 20), np.int16)
    left[:, 10:15] = -4  # a near object 5 px wide; the 4 px left of it are hidden from the right camera
    right = np.zeros((1, 20), np.int16)
    right[:, 6:11] = -4
    np.testing.assert_array_equal(np.flatnonzero(left_right_disagree(left, right, 1)), [6, 7, 8, 9])


def test_the_margin_is_what_the_next_best_must_cost_more() -> None:
    lowest, runner_up = np.array([100, 100, 100, 100]), np.array([129, 130, 131, -1])
    np.testing.assert_array_equal(ambiguous(lowest, runner_up, 30), [True, False, False, False])


def test_the_first_reason_stays_and_the_arguments_are_left_alone() -> None:
    disparity = np.array([[1, np.nan, 3]], np.float32)
    reason = np.array([[Reason.MEASURED, Reason.OUT_OF_FRAME, Reason.MEASURED]], np.uint8)
    lost, why = rejected(disparity, reason, np.array([[True, True, False]]), Reason.LEFT_RIGHT)
    np.testing.assert_array_equal(lost, np.array([[np.nan, np.nan, 3]], np.float32))
    np.testing.assert_array_equal(why, [[Reason.LEFT_RIGHT, Reason.OUT_OF_FRAME, Reason.MEASURED]])
    assert disparity[0, 0] == 1 and reason[0, 0] == Reason.MEASURED
    assert lost.dtype == np.float32 and why.dtype == np.uint8


@pytest.mark.parametrize("dtype", [np.uint8, np.uint16, np.float32, np.float64])
@pytest.mark.parametrize("size", [3, 4, 9])
def test_the_local_deviation_is_that_of_the_window_and_a_flat_one_has_none(dtype: type, size: int) -> None:
    image = (np.random.default_rng(0).random((30, 40)) * 200).astype(dtype)
    image[5:25, 5:25] = image[0, 0]
    before, after = size // 2, size - 1 - size // 2
    framed = np.pad(image.astype(np.float64), (before, after), mode="reflect")
    plain = np.lib.stride_tricks.sliding_window_view(framed, (size, size)).std(axis=(2, 3))
    found = local_deviation(image, size)
    np.testing.assert_allclose(found, plain, atol=1e-9)
    assert not found[10:20, 10:20].any()


def test_a_large_offset_hides_no_deviation() -> None:
    faint = np.random.default_rng(0).normal(0, 0.01, (30, 40))
    np.testing.assert_allclose(local_deviation(faint + 1e6, 5), local_deviation(faint, 5), rtol=1e-5)
    assert not local_deviation(np.full((9, 9), 1e6 + 1 / 3), 5).any()


@pytest.mark.parametrize(("dtype", "unit"), [(np.uint8, 1), (np.uint16, 257), (np.float32, 1 / 255)])
def test_the_least_texture_is_in_the_units_of_the_images(dtype: type, unit: float) -> None:
    image = (np.array([[0, 255]]) * unit).astype(dtype)
    assert least_texture(TextureTest(least=2.0), image, image) == pytest.approx(2 * unit, rel=1e-5)
    assert 0 < least_texture(None, image, image) < 1e-5 * unit


@pytest.mark.parametrize(("dtype", "scale"), [(np.uint16, 1), (np.uint16, 4), (np.uint16, 16), (np.float32, 12)])
@pytest.mark.parametrize("hot", [False, True])
def test_neither_empty_bits_nor_a_hot_pixel_take_the_texture_away(dtype: type, scale: int, hot: bool) -> None:
    """Cameras of 10 and 12 bits leave the upper bits of 16 empty; a pixel that is always white is not texture."""
    faint = np.linspace(0, 0.3, 160)
    left, right = (np.rint(128 + (image - 128.0) * faint).astype(np.uint8) for image in shifted_pair(90, 160, 0, -9))
    left[:8], right[:8] = 255, 0
    matcher = CorrelationMatcher(search=SearchArea.centred(24), texture=TextureTest(least=8.0))
    plain = matcher.compute(left, right).reason == Reason.LOW_TEXTURE
    one, other = (image.astype(dtype) * dtype(scale) for image in (left, right))
    if hot:
        one[40, 80] = 65535
    assert 0.2 < plain.mean() < 0.8
    same = plain == (matcher.compute(one, other).reason == Reason.LOW_TEXTURE)
    assert same.mean() > (0.95 if hot else 0.98)


@given(st.integers(2, 12), st.integers(0, 255))
def test_no_window_of_whole_numbers_that_varies_is_flat(side: int, level: int) -> None:
    window = np.full((side, side), level)
    assert window.var() * window.size <= flat_energy(window.size, 255, exact=True)
    window[0, 0] += 1 if level < 255 else -1
    assert window.var() * window.size > flat_energy(window.size, 255, exact=True)


@given(st.integers(0, 99))
def test_only_measured_pixels_are_rejected(seed: int) -> None:
    rng = np.random.default_rng(seed)
    disparity = rng.normal(size=(5, 7)).astype(np.float32)
    reason = rng.integers(0, 3, (5, 7)).astype(np.uint8)
    where = rng.random((5, 7)) < 0.5
    lost = where & (reason == Reason.MEASURED)
    kept, why = rejected(disparity, reason, where, Reason.SPECKLE)
    np.testing.assert_array_equal(kept, np.where(lost, np.nan, disparity))
    np.testing.assert_array_equal(why, np.where(lost, Reason.SPECKLE, reason))
