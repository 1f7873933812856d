"""Settings for smaller or larger images: the same part of them, as far as is allowed."""

from typing import Annotated

import pytest
from hypothesis import given
from hypothesis import strategies as st
from pydantic import Field

from stereolag import CorrelationMatcher, SearchArea, StereoBM, StereoSGBM
from stereolag.core.settings import Applies, Pixels, Settings, scaled_settings
from stereolag.stereo.matcher import StereoMatcher
from stereolag.stereo.methods import METHODS, PresetName, preset


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
    assert scaled_settings(kind(), 1.0) == kind()
    assert type(scaled_settings(kind(), factor)) is kind


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
    assert scaled_settings(large, 1 / factor).search_range() == small.search_range()
