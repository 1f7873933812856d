"""The presets, and the later stages as combined by the matcher."""

from __future__ import annotations

import numpy as np
import pytest
from pairs import shifted_pair, texture

from stereolag.core.settings import SettingsError
from stereolag.io.disparities import read_disparity
from stereolag.io.images import read_image
from stereolag.samples import stereo_pairs
from stereolag.stereo.evaluation import evaluate
from stereolag.stereo.finishing.checks import AmbiguityTest, LeftRightCheck, TextureTest
from stereolag.stereo.finishing.stages import MedianFilter, SpeckleFilter
from stereolag.stereo.matcher import Reason, StereoMatcher
from stereolag.stereo.methods import preset
from stereolag.stereo.opencv import StereoBM, StereoSGBM
from stereolag.stereo.semi_global.matcher import SemiGlobalMatcher
from stereolag.stereo.windows.matcher import CorrelationMatcher
from stereolag.stereo.windows.search import SearchArea

PRESETS = ["report", "fast", "accurate"]


def test_the_reports_preset_is_the_reports() -> None:
    matcher = preset("report", num_disparities=64)
    assert isinstance(matcher, CorrelationMatcher)
    assert (matcher.window_size, matcher.step, matcher.score) == (20, 2, "zncc")
    assert matcher.search == SearchArea.centred(20)


@pytest.mark.parametrize("name", PRESETS)
def test_presets_survive_json(name: str) -> None:
    matcher = preset(name, num_disparities=32)
    assert type(matcher).model_validate_json(matcher.model_dump_json()) == matcher


@pytest.mark.parametrize(
    ("name", "kind"), [("report", CorrelationMatcher), ("fast", CorrelationMatcher), ("accurate", SemiGlobalMatcher)]
)
def test_a_preset_is_a_matcher_of_its_kind_over_the_range_asked_for(name: str, kind: type[StereoMatcher]) -> None:
    matcher = preset(name, num_disparities=48, min_disparity=-8)
    assert type(matcher) is kind
    assert matcher.search_range() == (None if name == "report" else (-8, 48))


def test_an_unknown_preset_is_refused_by_name() -> None:
    with pytest.raises(ValueError, match="'dense'; allowed are 'report', 'fast', 'accurate'"):
        preset("dense")


@pytest.mark.parametrize("name", ["fast", "accurate"])
@pytest.mark.parametrize("dtype", [np.uint8, np.uint16, np.float32])
@pytest.mark.parametrize("shift", [0.0, 7.0, 11.4])
def test_a_shifted_wall_is_measured(name: str, dtype: type, shift: float) -> None:
    left, right = shifted_pair(80, 140, 0, -shift, dtype=dtype)
    result = preset(name, num_disparities=16).compute(left, right)
    inner = result.disparity[10:-10, 30:-10]
    assert np.mean(result.reason[10:-10, 30:-10] == Reason.MEASURED) > 0.95
    assert abs(np.median(inner) - shift) < 0.1
    assert np.mean(np.abs(inner - shift) < 0.5) > 0.98


@pytest.mark.parametrize("name", ["fast", "accurate"])
def test_what_is_filled_says_so_and_nothing_stays_blank(name: str) -> None:
    rows, cols = 80, 160
    wall, box = texture(rows, cols, seed=1), texture(40, 50, seed=2)
    left, right = wall.copy(), np.roll(wall, -4, axis=1)
    left[20:60, 70:120], right[20:60, 58:108] = box, box
    pair = left.astype(np.uint8), right.astype(np.uint8)
    result = preset(name, num_disparities=16).compute(*pair)
    assert result.valid.all()
    assert np.array_equal(result.filled, result.reason == Reason.FILLED)
    assert set(np.unique(result.reason)) == {Reason.MEASURED, Reason.FILLED}
    # The strip left of the box is hidden from the right camera, and continues the wall rather than the box.
    hidden = result.disparity[28:52, 64:68]
    assert np.median(hidden) == pytest.approx(4, abs=1)
    assert np.median(result.disparity[28:52, 80:110]) == pytest.approx(12, abs=0.3)
    np.testing.assert_array_equal(result.dy, 0)


def test_each_check_gives_its_own_reason() -> None:
    left, right = shifted_pair(80, 160, 0, -6)
    left, right = left.copy(), right.copy()
    left[20:50, 60:100] = right[20:50, 54:94] = 120
    stripes = (np.sin(np.arange(160) * np.pi / 4) * 100 + 128).astype(np.uint8)
    left[60:, :], right[60:, :] = stripes, np.roll(stripes, -6)
    search = SearchArea.rectified(24)
    plain = CorrelationMatcher(window_size=9, search=search)
    checked = plain.model_copy(
        update={
            "texture": TextureTest(least=2.0),
            "ambiguity": AmbiguityTest(lead=0.02),
            "left_right": LeftRightCheck(),
        }
    )
    reason = CorrelationMatcher.model_validate(checked.model_dump()).compute(left, right).reason
    assert np.all(reason[26:44, 66:94] == Reason.LOW_TEXTURE)
    assert np.mean(reason[68:76, 40:150] == Reason.AMBIGUOUS) > 0.9
    noise = np.random.default_rng(0).integers(0, 255, (2, 80, 160), dtype=np.uint8)
    unrelated = CorrelationMatcher(window_size=9, search=search, left_right=LeftRightCheck()).compute(*noise)
    assert np.mean(unrelated.reason == Reason.LEFT_RIGHT) > 0.3


def test_speckles_are_dropped_and_the_median_smooths() -> None:
    left, right = shifted_pair(80, 160, 0, -6)
    noisy = np.clip(right + np.random.default_rng(1).normal(0, 25, right.shape), 0, 255).astype(np.uint8)
    search = SearchArea.rectified(16)
    rough = CorrelationMatcher(window_size=5, search=search).compute(left, noisy)
    clean = CorrelationMatcher(window_size=5, search=search, speckle=SpeckleFilter(size=40)).compute(left, noisy)
    assert np.count_nonzero(clean.reason == Reason.SPECKLE) > 10
    assert np.all(np.isnan(clean.disparity) >= np.isnan(rough.disparity))
    smooth = CorrelationMatcher(window_size=5, search=search, median=MedianFilter()).compute(left, noisy)
    inner = np.s_[10:-10, 30:-10]
    assert np.nanstd(smooth.disparity[inner]) < 0.7 * np.nanstd(rough.disparity[inner])


@pytest.mark.parametrize(
    ("settings", "says"),
    [
        ({"search": SearchArea.rectified(16, vertical=1), "filling": True}, "filling"),
        ({"search": SearchArea.rectified(16, vertical=1), "median": MedianFilter()}, "median"),
        ({"search": SearchArea.rectified(16), "overlap": 0.5, "left_right": LeftRightCheck()}, "left_right"),
        ({"search": SearchArea.rectified(16), "engine": "fft", "left_right": LeftRightCheck()}, "left_right"),
        ({"search": SearchArea.rectified(16), "score": "phase", "left_right": LeftRightCheck()}, "left_right"),
    ],
)
def test_stages_that_do_not_fit_are_refused(settings: dict[str, object], says: str) -> None:
    with pytest.raises(SettingsError, match=says):
        CorrelationMatcher(**settings)


@pytest.mark.parametrize("name", ["cube", "square", "road"])
def test_accurate_beats_opencv_on_the_bundled_pairs(name: str) -> None:
    example = stereo_pairs()[name]
    pair = read_image(example.left), read_image(example.right)
    truth, count = read_disparity(example.disparity), example.num_disparities
    bad = {
        matcher: evaluate(matcher.compute(*pair).disparity, truth).bad[1.0]
        for matcher in (
            preset("accurate", num_disparities=count),
            preset("fast", num_disparities=count),
            StereoSGBM(num_disparities=count),
            StereoBM(num_disparities=count, block_size=15),
        )
    }
    accurate, fast, semi_global, block = bad.values()
    assert accurate < semi_global
    assert fast < block


def test_progress_of_the_optimisation_runs_to_the_end() -> None:
    seen: list[float] = []
    preset("accurate", num_disparities=16).compute(*shifted_pair(60, 100, 0, -4), progress=seen.append)
    assert seen == sorted(seen)
    assert seen[-1] == 1


@pytest.mark.parametrize("name", PRESETS)
@pytest.mark.parametrize("scale", [1 / 255, 1e-30, 1e30, 1e200])
def test_floats_are_measured_in_whatever_unit_they_come(name: str, scale: float) -> None:
    left, right = shifted_pair(60, 110, 0, -5, dtype=np.float64)
    matcher = preset(name, num_disparities=16)
    plain, scaled = matcher.compute(left, right), matcher.compute(left * scale, right * scale)
    inner = np.s_[15:-15, 30:-15]
    assert np.median(scaled.disparity[inner]) == pytest.approx(5, abs=0.1)
    assert np.mean(plain.reason == scaled.reason) > 0.99


@pytest.mark.parametrize("name", PRESETS)
@pytest.mark.parametrize("dtype", [np.uint8, np.float32])
def test_a_bare_wall_is_not_measured(name: str, dtype: type) -> None:
    wall = np.full((60, 100), 90, dtype=dtype)
    result = preset(name, num_disparities=16).compute(wall, wall)
    assert not result.valid.any()
    assert np.all(result.reason[15:-15, 30:-15] == Reason.LOW_TEXTURE)
