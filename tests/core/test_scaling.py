"""A pair made smaller: the same scene, the same settings, the same disparities."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from stereolag.geometry.scaling import scaled_disparity, scaled_image
from stereolag.settings import scaled_settings
from stereolag.stereo.matcher import StereoMatcher
from stereolag.stereo.methods import METHODS
from stereolag.stereo.opencv import StereoBM, StereoSGBM
from stereolag.stereo.windows.matcher import CorrelationMatcher
from stereolag.stereo.windows.search import SearchArea


@pytest.mark.parametrize("dtype", [np.uint8, np.uint16, np.float32])
@pytest.mark.parametrize("shape", [(60, 90), (60, 90, 3), (61, 91, 4)])
def test_an_image_keeps_its_type_and_its_mean(dtype: type, shape: tuple[int, ...]) -> None:
    image = np.random.default_rng(0).integers(0, 200, shape).astype(dtype)
    small = scaled_image(image, 0.5)
    assert small.dtype == dtype
    assert small.shape[:2] == (30, round(shape[1] * 0.5))
    assert small.mean() == pytest.approx(image.mean(), rel=0.02)


def test_a_disparity_shrinks_with_its_picture_and_invents_nothing() -> None:
    disparity = np.full((40, 60), np.nan)
    disparity[:20] = 10
    disparity[:, 30:] = 40
    small = scaled_disparity(disparity, 0.5)
    assert small.shape == (20, 30)
    assert set(small[np.isfinite(small)]) == {5.0, 20.0}
    assert np.isnan(small[10:, :15]).all()


@pytest.mark.parametrize("factor", [0.0, -1.0, 1.5, 0.001])
def test_a_factor_out_of_bounds_is_named(factor: float) -> None:
    with pytest.raises(ValueError, match=f"factor is {factor}"):
        scaled_image(np.zeros((20, 30), dtype=np.uint8), factor)


def test_settings_shrink_alike() -> None:
    half = scaled_settings(CorrelationMatcher(window_size=20, search=SearchArea.rectified(65, -8, 2)), 0.5)
    assert half == CorrelationMatcher(window_size=10, search=SearchArea.rectified(33, -4, 1))
    centred = scaled_settings(CorrelationMatcher(window_size=20, search=SearchArea.centred(80)), 0.5)
    assert centred == CorrelationMatcher(window_size=10, search=SearchArea.centred(40))
    block = scaled_settings(StereoBM(num_disparities=80, block_size=21, uniqueness_ratio=7), 0.5)
    assert block == StereoBM(num_disparities=48, block_size=11, uniqueness_ratio=7)
    tiny = scaled_settings(StereoSGBM(num_disparities=64, block_size=3, speckle_window_size=100), 0.1)
    assert tiny == StereoSGBM(num_disparities=16, block_size=1, speckle_window_size=1)


@given(st.sampled_from(METHODS), st.floats(0.2, 1))
def test_every_method_stays_valid_at_every_size(kind: type[StereoMatcher], factor: float) -> None:
    matcher = kind()
    assert scaled_settings(matcher, 1.0) == matcher
    assert type(scaled_settings(matcher, factor)) is type(matcher)
