"""Every stereo matcher: known shifts, reasons for blanks, signs, ranges, presets, contradictions, refusals."""

import re
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from pairs import FAR, bundled, shifted_pair, steps_pair, texture
from pydantic import ValidationError

from stereolag.core.settings import Applies, Settings, SettingsError, marker
from stereolag.io.disparities import read_disparity
from stereolag.io.images import read_image
from stereolag.samples import stereo_pairs
from stereolag.signals import signal_lag
from stereolag.stereo.evaluation import evaluate
from stereolag.stereo.finishing.stages import AmbiguityTest, LeftRightCheck, MedianFilter, SpeckleFilter, TextureTest
from stereolag.stereo.finishing.surfaces import SurfaceFilling
from stereolag.stereo.matcher import DisparityMap, Reason, StereoMatcher
from stereolag.stereo.methods import METHODS, PresetName, preset
from stereolag.stereo.opencv import StereoBM, StereoSGBM
from stereolag.stereo.semi_global.cost import MatchingCost
from stereolag.stereo.semi_global.matcher import SemiGlobalMatcher
from stereolag.stereo.windows.matcher import CorrelationMatcher
from stereolag.stereo.windows.search import SearchArea
from stereolag.templates import match_template


def interior(result: DisparityMap, margin: int = 30) -> tuple[np.ndarray, np.ndarray]:
    inside = np.s_[margin:-margin, margin:-margin]
    return result.dy[inside], result.dx[inside]


@pytest.mark.parametrize(("engine", "window_size"), [("window_sums", 20), ("fft", 21)])
@pytest.mark.parametrize(
    ("dtype", "dy", "dx"), [(np.uint8, -2.25, 4.5), (np.uint16, 3, -5), (np.float32, 0, 7), (np.float64, 1.3, -6.7)]
)
def test_known_shift_is_recovered(engine: str, window_size: int, dtype: type, dy: float, dx: float) -> None:
    left, right = shifted_pair(100, 120, dy, dx, dtype=dtype)
    matcher = CorrelationMatcher(
        window_size=window_size, overlap=0.75, search=SearchArea.centred(window_size + 18), engine=engine
    )
    found_dy, found_dx = interior(matcher.compute(left, right))
    assert np.isfinite(found_dx).all()
    assert abs(np.median(found_dy) - dy) <= 0.05
    assert abs(np.median(found_dx) - dx) <= 0.05
    assert np.mean(np.hypot(found_dy - dy, found_dx - dx) < 0.1) > 0.95


def test_a_map_holds_minus_dx_and_a_reason_for_every_blank_pixel() -> None:
    left, right = shifted_pair(80, 160, 0, -11.5)
    matcher = CorrelationMatcher(window_size=15, search=SearchArea.rectified(24))
    result = matcher.compute(left, right)
    valid = result.valid
    np.testing.assert_array_equal(valid, result.reason == Reason.MEASURED)
    np.testing.assert_array_equal(valid, np.isfinite(result.dx))
    np.testing.assert_array_equal(result.disparity[valid], -result.dx[valid])
    np.testing.assert_allclose(result.disparity[20:-20, 40:-20], 11.5, atol=0.1)
    assert np.all(result.dy[valid] == 0)
    np.testing.assert_allclose(result.lag[valid], np.abs(result.dx[valid]))
    assert result.disparity.shape == result.reason.shape == (80, 160)
    assert result.disparity.dtype == np.float32
    assert result.settings == matcher and result.elapsed_s > 0


def test_phase_correlation_recovers_a_shift_in_a_padded_search() -> None:
    left, right = shifted_pair(100, 120, 2, -4)
    phase = CorrelationMatcher(window_size=25, overlap=0.5, search=SearchArea.centred(41), score="phase")
    dy, dx = interior(phase.compute(left, right))
    assert abs(np.nanmedian(dy) - 2) < 0.3
    assert abs(np.nanmedian(dx) + 4) < 0.3


@pytest.mark.parametrize("score", ["zncc", "ncc", "cross", "phase"])
@pytest.mark.parametrize("window_size", [32, 33])
def test_unpadded_search_is_circular(score: str, window_size: int) -> None:
    tile = texture(window_size, window_size, seed=3)
    left = np.tile(tile, (3, 4))
    right = np.roll(left, (5, -7), axis=(0, 1))
    area = SearchArea.centred(window_size)
    result = CorrelationMatcher(window_size=window_size, overlap=0.5, search=area, score=score).compute(left, right)
    assert result.valid.any()
    np.testing.assert_allclose(result.dy[result.valid], 5, atol=0.05)
    np.testing.assert_allclose(result.dx[result.valid], -7, atol=0.05)


def test_a_shift_beyond_the_search_is_not_invented() -> None:
    gradient = np.add.outer(np.arange(60.0), np.arange(90.0) ** 1.5)
    matcher = CorrelationMatcher(window_size=9, search=SearchArea.centred(15))
    result = matcher.compute(gradient, np.roll(gradient, -6, axis=1))
    assert np.mean(result.reason[10:-10, 15:-15] == Reason.AT_SEARCH_EDGE) > 0.5


@pytest.mark.parametrize(("overlap", "step"), [(0.0, 20), (0.5, 10), (0.9, 2), (0.95, 1), (0.999, 1)])
def test_step_is_the_unshared_part_of_a_window(overlap: float, step: int) -> None:
    assert CorrelationMatcher(window_size=20, overlap=overlap).step == step


@pytest.mark.parametrize(
    ("matcher", "settings", "says"),
    [
        (CorrelationMatcher, {"window_size": 2}, "window_size"),
        (CorrelationMatcher, {"overlap": 1.0}, "overlap"),
        (CorrelationMatcher, {"window_size": 41, "search": SearchArea.centred(40)}, "search_size"),
        (CorrelationMatcher, {"score": "ssd"}, "score"),
        (CorrelationMatcher, {"blocksize": 5}, "blocksize"),
        (SemiGlobalMatcher, {"window_size": 4}, "window_size is 4; allowed are odd sizes"),
        (StereoBM, {"num_disparities": 0}, "num_disparities"),
        (StereoBM, {"num_disparities": 40}, "multiples of 16"),
        (StereoBM, {"block_size": 20}, "odd"),
        (StereoSGBM, {"block_size": 4}, "odd"),
        (StereoSGBM, {"num_disparities": 0}, "num_disparities"),
        (StereoSGBM, {"p1": 800, "p2": 800}, "p2 > p1"),
        (StereoSGBM, {"mode": "other"}, "mode is 'other'; allowed are 'sgbm', 'hh', 'sgbm_3way' and 'hh4'"),
    ],
)
def test_bad_settings_are_refused_by_name(matcher: type[StereoMatcher], settings: dict[str, object], says: str) -> None:
    with pytest.raises(SettingsError, match=says):
        matcher(**settings)


@pytest.mark.parametrize("matcher", [StereoBM, StereoSGBM])
def test_images_too_narrow_for_the_search_are_refused(matcher: type[StereoBM]) -> None:
    with pytest.raises(ValueError, match="num_disparities is 64"):
        matcher(num_disparities=64).compute(*shifted_pair(60, 60, 0, -4))


CONTRADICTIONS: list[tuple[type[StereoMatcher], str, dict[str, object]]] = [
    (CorrelationMatcher, "engine", {"score": "phase", "engine": "window_sums"}),
    (CorrelationMatcher, "engine", {"search": SearchArea.centred(20), "engine": "window_sums"}),
    (CorrelationMatcher, "left_right", {"overlap": 0.5, "left_right": LeftRightCheck()}),
    (CorrelationMatcher, "left_right", {"engine": "fft", "left_right": LeftRightCheck()}),
    (CorrelationMatcher, "left_right", {"score": "phase", "left_right": LeftRightCheck()}),
    (CorrelationMatcher, "left_right", {"search": SearchArea.centred(40), "left_right": LeftRightCheck()}),
    (CorrelationMatcher, "filling", {"search": SearchArea.rectified(16, vertical=1), "filling": True}),
    (CorrelationMatcher, "surfaces", {"surfaces": SurfaceFilling()}),
    (CorrelationMatcher, "median", {"search": SearchArea.centred(40), "median": MedianFilter()}),
    (StereoBM, "speckle_range", {"speckle_range": 2}),
    (StereoSGBM, "speckle_range", {"speckle_window_size": 0, "speckle_range": 3}),
    (SemiGlobalMatcher, "surfaces", {"filling": False, "surfaces": SurfaceFilling()}),
    (SemiGlobalMatcher, "cost.gradient_limit", {"cost": {"gradient": 0, "gradient_limit": 9}}),
]


@pytest.mark.parametrize(("kind", "name", "settings"), CONTRADICTIONS)
def test_no_setting_is_accepted_and_ignored(kind: type[StereoMatcher], name: str, settings: dict[str, object]) -> None:
    holder: type[Settings] = MatchingCost if name.startswith("cost.") else kind
    rule = marker(holder.model_fields[name.rpartition(".")[2]], Applies)
    with pytest.raises(SettingsError, match=re.escape(rule.reason)) as told:
        kind(**settings)
    assert [problem.name for problem in told.value.problems] == [name]


def test_every_rule_is_among_the_contradictions() -> None:
    holders = {kind.__name__: kind for kind in METHODS} | {"cost": MatchingCost}
    rules = {
        f"{owner}.{name}"
        for owner, kind in holders.items()
        for name, field in kind.model_fields.items()
        if marker(field, Applies)
    }
    tested = {name if "." in name else f"{kind.__name__}.{name}" for kind, name, _ in CONTRADICTIONS}
    assert tested == rules


MATCHERS = [
    CorrelationMatcher(window_size=9, search=SearchArea.rectified(16)),
    StereoBM(num_disparities=16),
    StereoSGBM(),
    SemiGlobalMatcher(),
]


GREY = np.zeros((40, 50), np.uint8)


@pytest.mark.parametrize("matcher", MATCHERS, ids=lambda matcher: type(matcher).__name__)
@pytest.mark.parametrize(
    ("left", "right", "says"),
    [
        (GREY, np.zeros((40, 52), np.uint8), "50 × 40 .* 52 × 40"),
        (np.full((40, 50), np.nan), np.zeros((40, 50)), "2000 NaN"),
        (np.zeros((4, 5), np.uint8), np.zeros((4, 5), np.uint8), "5 × 4"),
        ("left.png", GREY, r"left is a \w+; give an array, such as sl\.read_image\(left\)"),
        (GREY, Path("a.png"), r"right is a \w+; give an array"),
    ],
)
def test_bad_images_are_refused_with_the_value(matcher: StereoMatcher, left: Any, right: Any, says: str) -> None:
    with pytest.raises(ValueError, match=says):
        matcher.compute(left, right)


def test_motorcycle_is_measured_as_well_as_the_report_says(data_dir: object) -> None:
    folder = data_dir / "stereo" / "motorcycle_q"
    left, right = (read_image(folder / name) for name in ("left.png", "right.png"))
    truth = read_disparity(folder / "gt.pfm")
    result = CorrelationMatcher(window_size=21, overlap=0.95, search=SearchArea.rectified(70)).compute(left, right)
    figures = evaluate(result.disparity, truth)
    assert figures.bad_measured[2.0] <= 26
    assert figures.density > 0.8


PRESETS = {"report": CorrelationMatcher, "fast": CorrelationMatcher, "accurate": SemiGlobalMatcher}


@pytest.mark.parametrize("name", PRESETS)
def test_a_preset_is_a_frozen_matcher_of_its_kind_over_the_range_asked_for_and_survives_json(name: PresetName) -> None:
    matcher = preset(name, num_disparities=48, min_disparity=-8)
    assert type(matcher) is PRESETS[name]
    assert matcher.search_range() == (None if name == "report" else (-8, 48))
    assert type(matcher).model_validate_json(matcher.model_dump_json()) == matcher
    with pytest.raises(ValidationError, match="frozen"):
        matcher.window_size = 5
    report = preset("report")
    assert report == CorrelationMatcher(window_size=20, overlap=0.9, search=SearchArea.centred(20), score="zncc")
    with pytest.raises(ValueError, match="'dense'; allowed are 'report', 'fast', 'accurate'"):
        preset("dense")


@pytest.mark.parametrize("name", ["fast", "accurate"])
def test_what_is_filled_says_so_and_nothing_stays_blank(name: str) -> None:
    left, right, _ = steps_pair(noise=2.0)
    result = preset(name, num_disparities=32).compute(left, right)
    assert result.valid.all()
    assert np.array_equal(result.filled, result.reason == Reason.FILLED)
    assert set(np.unique(result.reason)) == {Reason.MEASURED, Reason.FILLED}
    # The strip left of the square is hidden from the right camera, and continues the wall rather than the square.
    assert np.median(result.disparity[40:80, 53:57]) == pytest.approx(FAR, abs=1)
    assert np.median(result.disparity[40:80, 75:115]) == pytest.approx(14, abs=0.3)
    np.testing.assert_array_equal(result.dy, 0)


def test_each_check_gives_its_own_reason() -> None:
    left, right = shifted_pair(80, 160, 0, -6)
    left, right = left.copy(), right.copy()
    left[20:50, 60:100] = right[20:50, 54:94] = 120
    stripes = (np.sin(np.arange(160) * np.pi / 4) * 100 + 128).astype(np.uint8)
    left[60:, :], right[60:, :] = stripes, np.roll(stripes, -6)
    search = SearchArea.rectified(24)
    checks = {"texture": TextureTest(least=2.0), "ambiguity": AmbiguityTest(lead=0.02), "left_right": LeftRightCheck()}
    reason = CorrelationMatcher(window_size=9, search=search, **checks).compute(left, right).reason
    assert np.all(reason[26:44, 66:94] == Reason.LOW_TEXTURE)
    assert np.mean(reason[68:76, 40:150] == Reason.AMBIGUOUS) > 0.9
    noise = np.random.default_rng(0).integers(0, 255, (2, 80, 160), dtype=np.uint8)
    unrelated = CorrelationMatcher(window_size=9, search=search, left_right=LeftRightCheck()).compute(*noise)
    assert np.mean(unrelated.reason == Reason.LEFT_RIGHT) > 0.3


def test_speckles_are_dropped_and_the_median_smooths() -> None:
    left, right = shifted_pair(80, 160, 0, -6)
    noisy = np.clip(right + np.random.default_rng(1).normal(0, 25, right.shape), 0, 255).astype(np.uint8)
    rough, clean, smooth = (
        CorrelationMatcher(window_size=5, search=SearchArea.rectified(16), **stages).compute(left, noisy)
        for stages in ({}, {"speckle": SpeckleFilter(size=40)}, {"median": MedianFilter()})
    )
    assert np.count_nonzero(clean.reason == Reason.SPECKLE) > 10
    assert np.all(np.isnan(clean.disparity) >= np.isnan(rough.disparity))
    inner = np.s_[10:-10, 30:-10]
    assert np.nanstd(smooth.disparity[inner]) < 0.7 * np.nanstd(rough.disparity[inner])


@pytest.mark.parametrize("name", ["cube", "square", "road"])
def test_accurate_beats_opencv_on_the_bundled_pairs(name: str) -> None:
    *pair, truth = bundled(name)
    count = stereo_pairs()[name].num_disparities

    def bad(matcher: StereoMatcher) -> float:
        return evaluate(matcher.compute(*pair).disparity, truth).bad[1.0]

    assert bad(preset("accurate", num_disparities=count)) < bad(StereoSGBM(num_disparities=count))
    assert bad(preset("fast", num_disparities=count)) < bad(StereoBM(num_disparities=count, block_size=15))


@pytest.mark.parametrize("name", PRESETS)
@pytest.mark.parametrize("scale", [1 / 255, 1e-30, 1e200])
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


RANGED: list[StereoMatcher] = [
    *(kind() for kind in METHODS),
    preset("fast"),
    CorrelationMatcher(search=SearchArea.rectified(40, 5, 3)),
    CorrelationMatcher(window_size=20, search=SearchArea.centred(400)),
    CorrelationMatcher(window_size=20, search=SearchArea.centred(20)),
]


@pytest.mark.parametrize("matcher", RANGED, ids=str)
def test_a_range_that_was_set_is_searched_and_nothing_else_changes(matcher: StereoMatcher) -> None:
    for first, count in ((0, 64), (-32, 48), (20, 16)):
        changed = matcher.with_search_range(first, count)
        assert changed.search_range() == (first, count)
        for name in set(type(matcher).model_fields) - {"search", "num_disparities", "min_disparity"}:
            assert getattr(changed, name) == getattr(matcher, name)
    assert matcher.with_search_range(-4000, 4096).search_range() == (-512, 1024)  # cut short to what is allowed


def test_ranges_as_they_are_and_rows_that_stay() -> None:
    for search, rows in ((SearchArea.rectified(40, 5, 3), 3), (SearchArea.centred(60, vertical=7), 7)):
        changed = CorrelationMatcher(search=search).with_search_range(0, 64)
        assert isinstance(changed, CorrelationMatcher)
        assert changed.search == SearchArea.rectified(64, 0, rows)
    assert CorrelationMatcher().search == SearchArea.rectified(64)
    assert preset("accurate", 48, -5).search_range() == (-5, 48)
    assert StereoBM(min_disparity=-16, num_disparities=32).search_range() == (-16, 32)
    assert (StereoSGBM().search_range(), StereoSGBM().mode) == ((0, 64), "sgbm")
    assert CorrelationMatcher(window_size=20, search=SearchArea.centred(40)).search_range() == (-10, 21)
    assert CorrelationMatcher(window_size=20, search=SearchArea.centred(20)).search_range() is None


def test_minus_one_really_switches_the_left_right_check_off() -> None:
    left, right = np.random.default_rng(0).integers(0, 255, (2, 90, 160), dtype=np.uint8)

    def coverage(difference: int) -> float:
        settings = {"uniqueness_ratio": 0, "speckle_window_size": 0, "disp12_max_diff": difference}
        return StereoSGBM(num_disparities=32, **settings).compute(left, right).coverage

    assert coverage(-1) == coverage(64) > coverage(1)


@pytest.mark.parametrize("name", PRESETS)
def test_matchers_answer_alike_from_many_threads(name: PresetName) -> None:
    matcher = preset(name, num_disparities=16)
    pairs = [shifted_pair(60, 100, 0, -shift, seed=shift) for shift in range(1, 9)]
    alone = [matcher.compute(*pair) for pair in pairs]
    with ThreadPoolExecutor(8) as threads:
        together = list(threads.map(lambda pair: matcher.compute(*pair), pairs))
    for one, other in zip(alone, together, strict=True):
        np.testing.assert_array_equal(one.disparity, other.disparity)
        np.testing.assert_array_equal(one.reason, other.reason)


def test_searches_answer_alike_from_many_threads() -> None:
    sound = np.random.default_rng(0).normal(size=6000)
    picture = shifted_pair(80, 100, 0, 0)[0]

    def measure(lag: int) -> tuple[int, int, int]:
        best = match_template(picture, picture[lag : lag + 20, 30:50]).matches[0]
        return signal_lag(sound[lag:], sound[: sound.size - lag]).lag, best.row, best.col

    with ThreadPoolExecutor(8) as threads:
        assert list(threads.map(measure, range(1, 25))) == [(lag, lag, 30) for lag in range(1, 25)]


def test_a_map_can_do_without_its_scores() -> None:
    image = np.random.default_rng(0).integers(0, 255, (40, 60), dtype=np.uint8)
    whole = StereoBM(num_disparities=16, block_size=9).compute(image[:, :-5], image[:, 5:])
    scored = CorrelationMatcher(window_size=7, search=SearchArea.rectified(8)).compute(image[:, :-5], image[:, 5:])
    assert np.isfinite(scored.score).any() and not np.isfinite(scored.without_scores().score).any()
    for result in (whole, scored):
        np.testing.assert_array_equal(result.without_scores().disparity, result.disparity)
