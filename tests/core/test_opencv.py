"""OpenCV's matchers behind our interface give the results of OpenCV itself."""

from __future__ import annotations

import cv2
import numpy as np
import pytest
from pairs import shifted_pair

from stereolag.core.settings import SettingsError
from stereolag.stereo import opencv as matchers
from stereolag.stereo.matcher import Reason
from stereolag.stereo.opencv import StereoBM, StereoSGBM


@pytest.mark.parametrize("min_disparity", [-8, 0, 2, 5])
def test_block_matching_equals_opencv_and_its_invalid_code_is_nan(min_disparity: int) -> None:
    left, right = shifted_pair(90, 160, 0, -9)
    theirs = cv2.StereoBM.create(32, 11)
    theirs.setMinDisparity(min_disparity)
    raw = theirs.compute(left, right)
    ours = StereoBM(num_disparities=32, block_size=11, min_disparity=min_disparity).compute(left, right)
    invalid = raw == (min_disparity - 1) * 16
    assert invalid.any()
    assert np.isnan(ours.disparity[invalid]).all()
    np.testing.assert_array_equal(ours.disparity[~invalid], raw[~invalid] / 16)
    assert set(np.unique(ours.reason)) <= {Reason.MEASURED, Reason.AMBIGUOUS, Reason.OUT_OF_FRAME}


MODES = {
    "sgbm": cv2.STEREO_SGBM_MODE_SGBM,
    "hh": cv2.STEREO_SGBM_MODE_HH,
    "sgbm_3way": cv2.STEREO_SGBM_MODE_SGBM_3WAY,
    "hh4": cv2.STEREO_SGBM_MODE_HH4,
}


@pytest.mark.parametrize("mode", MODES)
def test_semi_global_equals_opencv(mode: str) -> None:
    left, right = shifted_pair(90, 160, 0, -9)
    theirs = cv2.StereoSGBM.create(
        0,
        32,
        5,
        P1=200,
        P2=800,
        disp12MaxDiff=1,
        uniquenessRatio=10,
        speckleWindowSize=100,
        speckleRange=2,
        mode=MODES[mode],
    )
    raw = theirs.compute(left, right)
    ours = StereoSGBM(num_disparities=32, mode=mode).compute(left, right).disparity
    np.testing.assert_array_equal(np.nan_to_num(ours, nan=-1), np.where(raw < 0, -1, raw / 16))
    assert np.isfinite(ours).mean() > 0.4


def test_the_modes_are_all_of_opencv_and_its_own_is_the_first() -> None:
    names = {name for name in dir(cv2) if name.startswith("STEREO_SGBM_MODE_")}
    assert names == {f"STEREO_SGBM_MODE_{mode.upper()}" for mode in MODES}
    assert StereoSGBM().mode == "sgbm"
    with pytest.raises(SettingsError, match="mode is 'other'; allowed are 'sgbm', 'hh', 'sgbm_3way' and 'hh4'"):
        StereoSGBM(mode="other")


@pytest.mark.parametrize(
    ("matcher", "settings", "says"),
    [
        (StereoBM, {"num_disparities": 0}, "num_disparities"),
        (StereoBM, {"num_disparities": 40}, "multiples of 16"),
        (StereoBM, {"block_size": 20}, "odd"),
        (StereoSGBM, {"block_size": 4}, "odd"),
        (StereoSGBM, {"num_disparities": 0}, "num_disparities"),
        (StereoSGBM, {"p1": 800, "p2": 800}, "p2 > p1"),
    ],
)
def test_what_opencv_would_silently_change_is_refused(matcher: type[StereoBM], settings: dict, says: str) -> None:
    with pytest.raises(SettingsError, match=says):
        matcher(**settings)


@pytest.mark.parametrize("matcher", [StereoBM, StereoSGBM])
def test_images_too_narrow_for_the_search_are_refused(matcher: type[StereoBM]) -> None:
    left, right = shifted_pair(60, 60, 0, -4)
    with pytest.raises(ValueError, match="num_disparities is 64"):
        matcher(num_disparities=64).compute(left, right)


def test_minus_one_really_switches_the_left_right_check_off() -> None:
    left, right = np.random.default_rng(0).integers(0, 255, (2, 90, 160), dtype=np.uint8)

    def coverage(difference: int) -> float:
        settings = {"uniqueness_ratio": 0, "speckle_window_size": 0, "disp12_max_diff": difference}
        return StereoSGBM(num_disparities=32, **settings).compute(left, right).coverage

    assert coverage(-1) == coverage(64) > coverage(1)


@pytest.mark.parametrize("dtype", [np.uint16, np.float32])
def test_one_hot_pixel_leaves_the_other_grey_levels_apart(dtype: type, monkeypatch: pytest.MonkeyPatch) -> None:
    """Scaling from minimum to maximum used to leave StereoBM 14 grey levels in a picture with one bright pixel."""
    left, right = (image.astype(dtype) * 12 for image in shifted_pair(90, 160, 0, -9))
    left[40, 80] = 65535
    seen: list[np.ndarray] = []
    eight_bit = matchers.as_eight_bit
    monkeypatch.setattr(matchers, "as_eight_bit", lambda *pair: seen.extend(eight_bit(*pair)) or tuple(seen))
    result = StereoBM(num_disparities=16).compute(left, right)
    assert np.unique(seen[0]).size > 100
    assert abs(np.nanmedian(result.disparity) - 9) < 0.1
