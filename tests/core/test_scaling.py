"""A pair made smaller: the same scene, the same settings, the same disparities."""

from __future__ import annotations

from typing import Annotated

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from pydantic import Field

from stereolag.core.settings import Applies, Pixels, Settings, scaled_settings
from stereolag.geometry.rectification import as_deep, scaled_disparity, scaled_image
from stereolag.stereo.matcher import StereoMatcher
from stereolag.stereo.methods import METHODS, PresetName, preset
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


class Smoothed(Settings):
    """Settings with a length that has an effect only together with another setting."""

    smoothed: bool = Field(default=False, title="Smoothed", description="Whether it is.")
    radius: Annotated[int, Pixels(), Applies(lambda settings: settings.smoothed, "needs smoothed")] = Field(
        default=8, title="Radius", description="How far, px.", ge=1, le=99
    )


def test_a_length_without_effect_stays_as_it_was() -> None:
    assert scaled_settings(Smoothed(), 0.5) == Smoothed()
    assert scaled_settings(Smoothed(smoothed=True), 0.5) == Smoothed(smoothed=True, radius=4)


@given(st.sampled_from(METHODS), st.floats(0.2, 1))
def test_every_method_stays_valid_at_every_size(kind: type[StereoMatcher], factor: float) -> None:
    matcher = kind()
    assert scaled_settings(matcher, 1.0) == matcher
    assert type(scaled_settings(matcher, factor)) is type(matcher)


def test_settings_for_larger_images_stay_allowed_and_search_all_they_did() -> None:
    large = scaled_settings(StereoSGBM(num_disparities=64, block_size=21, speckle_window_size=400), 4)
    assert (large.num_disparities, large.block_size, large.speckle_window_size) == (256, 51, 5000)
    with pytest.raises(ValueError, match="num_disparities is 2048"):
        scaled_settings(StereoSGBM(num_disparities=512), 4)


@pytest.mark.parametrize("name", ["report", "fast", "accurate"])
@pytest.mark.parametrize("factor", [2, 3, 4, 6.25])
def test_a_preset_is_allowed_on_larger_images_and_comes_back(name: PresetName, factor: float) -> None:
    small = preset(name, 112)
    large = scaled_settings(small, factor)
    assert large.search_range() in (None, (0, 112 * factor), (0, -(-112 * factor // 1)))
    if isinstance(large, CorrelationMatcher) and large.left_right is not None:
        assert large.step == 1
    back = scaled_settings(large, 1 / factor)
    assert back.search_range() == small.search_range()


@pytest.mark.parametrize("bits", [8, 10, 12, 14, 16])
@pytest.mark.parametrize("deep_is_left", [True, False])
def test_8_bits_beside_16_become_one_range(bits: int, deep_is_left: bool) -> None:
    shallow = np.random.default_rng(0).integers(20, 230, (40, 60, 3), dtype=np.uint8)
    deep = np.rint(shallow / 255 * (2**bits - 1)).astype(np.uint16)
    found = as_deep(deep, shallow) if deep_is_left else as_deep(shallow, deep)
    assert [image.dtype for image in found] == [np.uint16, np.uint16]
    # One grey level of a camera with this many bits is the tolerance.
    assert np.abs(found[0].astype(float) - found[1]).max() <= 65535 / (2**bits - 1)


@pytest.mark.parametrize("kind", [np.uint8, np.uint16, np.float32])
def test_images_of_one_type_stay_as_they_are(kind: type) -> None:
    pair = np.ones((3, 4), kind), np.zeros((3, 4), kind)
    assert all(one is other for one, other in zip(as_deep(*pair), pair, strict=True))
