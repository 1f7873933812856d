"""The correlation matcher recovers known shifts, gives reasons for blank pixels, and keeps its sign conventions."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest
from pairs import shifted_pair, texture
from pydantic import ValidationError

from stereolag.core.settings import Applies, Settings, SettingsError, marker
from stereolag.io.disparities import read_disparity
from stereolag.io.images import read_image
from stereolag.stereo.evaluation import evaluate
from stereolag.stereo.finishing.checks import LeftRightCheck
from stereolag.stereo.finishing.stages import MedianFilter
from stereolag.stereo.finishing.surfaces import SurfaceFilling
from stereolag.stereo.matcher import DisparityMap, Reason, StereoMatcher
from stereolag.stereo.methods import METHODS
from stereolag.stereo.opencv import StereoBM, StereoSGBM
from stereolag.stereo.semi_global.cost_terms import MatchingCost
from stereolag.stereo.semi_global.matcher import SemiGlobalMatcher
from stereolag.stereo.windows.matcher import CorrelationMatcher
from stereolag.stereo.windows.search import SearchArea

ENGINES = ("window_sums", "fft")


def interior(result: DisparityMap, margin: int = 30) -> tuple[np.ndarray, np.ndarray]:
    inside = np.s_[margin:-margin, margin:-margin]
    return result.dy[inside], result.dx[inside]


@pytest.mark.parametrize("engine", ENGINES)
@pytest.mark.parametrize("window_size", [20, 21])
@pytest.mark.parametrize("dtype", [np.uint8, np.uint16, np.float32, np.float64])
@pytest.mark.parametrize(("dy", "dx"), [(0, 7), (3, -5), (-2.25, 4.5), (1.3, -6.7)])
def test_known_shift_is_recovered(engine: str, window_size: int, dtype: type, dy: float, dx: float) -> None:
    left, right = shifted_pair(110, 130, dy, dx, dtype=dtype)
    matcher = CorrelationMatcher(
        window_size=window_size, overlap=0.75, search=SearchArea.centred(window_size + 18), engine=engine
    )
    found_dy, found_dx = interior(matcher.compute(left, right))
    assert np.isfinite(found_dx).all()
    assert abs(np.median(found_dy) - dy) <= 0.05
    assert abs(np.median(found_dx) - dx) <= 0.05
    assert np.mean(np.hypot(found_dy - dy, found_dx - dx) < 0.1) > 0.95


@pytest.mark.parametrize("engine", ENGINES)
def test_disparity_of_a_rectified_search_is_minus_dx(engine: str) -> None:
    left, right = shifted_pair(80, 160, 0, -11.5)
    result = CorrelationMatcher(window_size=15, search=SearchArea.rectified(24), engine=engine).compute(left, right)
    valid = result.valid
    np.testing.assert_array_equal(result.disparity[valid], -result.dx[valid])
    np.testing.assert_allclose(result.disparity[20:-20, 40:-20], 11.5, atol=0.1)
    assert np.all(result.dy[valid] == 0)
    np.testing.assert_allclose(result.lag[valid], np.abs(result.dx[valid]))


def test_swapped_images_flip_the_sign() -> None:
    left, right = shifted_pair(90, 110, 2, -4, dtype=np.float64)
    matcher = CorrelationMatcher(window_size=16, overlap=0.8, search=SearchArea.centred(34))
    forward, backward = interior(matcher.compute(left, right)), interior(matcher.compute(right, left))
    np.testing.assert_allclose(forward[0], -backward[0], atol=0.15)
    np.testing.assert_allclose(forward[1], -backward[1], atol=0.15)
    assert abs(np.mean(forward[0] + backward[0])) < 0.01
    assert abs(np.mean(forward[1] + backward[1])) < 0.01


@pytest.mark.parametrize("score", ["zncc", "ncc", "cross", "phase"])
@pytest.mark.parametrize("window_size", [24, 25])
def test_every_score_recovers_a_shift_by_fft(score: str, window_size: int) -> None:
    left, right = shifted_pair(100, 120, 2, -4)
    matcher = CorrelationMatcher(
        window_size=window_size, overlap=0.5, search=SearchArea.centred(window_size + 16), score=score, engine="fft"
    )
    dy, dx = interior(matcher.compute(left, right))
    assert abs(np.nanmedian(dy) - 2) < 0.3
    assert abs(np.nanmedian(dx) + 4) < 0.3


@pytest.mark.parametrize("score", ["zncc", "ncc", "cross", "phase"])
@pytest.mark.parametrize("window_size", [32, 33])
def test_unpadded_search_is_circular(score: str, window_size: int) -> None:
    tile = texture(window_size, window_size, seed=3)
    left = np.tile(tile, (3, 4))
    right = np.roll(left, (5, -7), axis=(0, 1))
    matcher = CorrelationMatcher(
        window_size=window_size, overlap=0.5, search=SearchArea.centred(window_size), score=score
    )
    result = matcher.compute(left, right)
    assert result.valid.any()
    np.testing.assert_allclose(result.dy[result.valid], 5, atol=0.05)
    np.testing.assert_allclose(result.dx[result.valid], -7, atol=0.05)


def test_identical_images_have_no_lag_though_it_is_the_first_one_searched() -> None:
    left = texture(60, 90).astype(np.uint8)
    result = CorrelationMatcher(window_size=9, search=SearchArea.rectified(16)).compute(left, left)
    # Windows one pixel to either side cover other pixels, which biases the fit a little; the lag itself is 0.
    inner = result.disparity[10:-10, 30:-10]
    np.testing.assert_allclose(inner, 0, atol=0.25)
    assert abs(inner.mean()) < 0.01
    np.testing.assert_allclose(result.score[10:-10, 30:-10], 1, atol=1e-6)


@pytest.mark.parametrize("engine", ENGINES)
def test_a_shift_beyond_the_search_is_not_invented(engine: str) -> None:
    gradient = np.add.outer(np.arange(60.0), np.arange(90.0) ** 1.5)
    matcher = CorrelationMatcher(window_size=9, search=SearchArea.centred(15), engine=engine)
    result = matcher.compute(gradient, np.roll(gradient, -6, axis=1))
    assert np.mean(result.reason[10:-10, 15:-15] == Reason.AT_SEARCH_EDGE) > 0.5


@pytest.mark.parametrize("engine", ENGINES)
@pytest.mark.parametrize("dtype", [np.uint8, np.float32])
def test_flat_windows_have_no_answer(engine: str, dtype: type) -> None:
    left, right = shifted_pair(80, 100, 0, -4, dtype=dtype)
    left, right = left.copy(), right.copy()
    left[20:60, 30:80] = 100
    right[20:60, 26:76] = 100
    result = CorrelationMatcher(window_size=11, search=SearchArea.rectified(12), engine=engine).compute(left, right)
    assert np.all(result.reason[26:54, 36:74] == Reason.LOW_TEXTURE)
    assert np.isnan(result.disparity[26:54, 36:74]).all()


def test_every_blank_pixel_has_a_reason_and_every_answer_none() -> None:
    left, right = shifted_pair(80, 100, 1, -4)
    result = CorrelationMatcher(window_size=11, overlap=0.7, search=SearchArea.centred(23)).compute(left, right)
    assert np.array_equal(result.valid, result.reason == Reason.MEASURED)
    assert np.array_equal(np.isnan(result.dx), ~result.valid)
    assert result.disparity.shape == result.reason.shape == (80, 100)
    assert result.disparity.dtype == np.float32
    assert result.settings.window_size == 11  # type: ignore[attr-defined]
    assert result.elapsed_s > 0


def test_windows_spread_over_cells_around_their_centres() -> None:
    left, right = shifted_pair(60, 80, 0, -3)
    result = CorrelationMatcher(window_size=20, overlap=0.5, search=SearchArea.rectified(8)).compute(left, right)
    valid_rows = np.flatnonzero(result.valid.any(axis=1))
    assert (valid_rows[0], valid_rows[-1]) == (5, 54)
    cells = result.score[5:55, 5:75].reshape(5, 10, 7, 10)
    assert np.array_equal(cells.min(axis=(1, 3)), cells.max(axis=(1, 3)), equal_nan=True)


@pytest.mark.parametrize("overlap", [0.0, 0.5, 0.9, 0.95, 0.999])
def test_step_is_the_unshared_part_of_a_window(overlap: float) -> None:
    expected = {0.0: 20, 0.5: 10, 0.9: 2, 0.95: 1, 0.999: 1}
    assert CorrelationMatcher(window_size=20, overlap=overlap).step == expected[overlap]


@pytest.mark.parametrize(
    ("settings", "names"),
    [
        ({"window_size": 2}, "window_size"),
        ({"overlap": 1.0}, "overlap"),
        ({"window_size": 41, "search": SearchArea.centred(40)}, "search_size"),
        ({"score": "ssd"}, "score"),
        ({"score": "phase", "engine": "window_sums"}, "engine"),
        ({"search": SearchArea.centred(20), "engine": "window_sums"}, "engine"),
        ({"blocksize": 5}, "blocksize"),
    ],
)
def test_bad_settings_are_refused_by_name(settings: dict[str, object], names: str) -> None:
    with pytest.raises(SettingsError, match=names):
        CorrelationMatcher(**settings)


CONTRADICTIONS: list[tuple[type[StereoMatcher], str, dict[str, object]]] = [
    (CorrelationMatcher, "engine", {"score": "phase", "engine": "window_sums"}),
    (CorrelationMatcher, "engine", {"search": SearchArea.centred(20), "engine": "window_sums"}),
    (CorrelationMatcher, "left_right", {"overlap": 0.5, "left_right": LeftRightCheck()}),
    (CorrelationMatcher, "left_right", {"engine": "fft", "left_right": LeftRightCheck()}),
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
    assert rule is not None
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


def test_a_result_says_in_one_line_what_it_is() -> None:
    result = CorrelationMatcher(window_size=9, search=SearchArea.rectified(16)).compute(*shifted_pair(40, 60, 0, -4))
    assert re.fullmatch(r"<DisparityMap 60 × 40, \d+\.\d% valid, by CorrelationMatcher in [\d.e-]+ s>", repr(result))


def test_a_path_in_place_of_an_image_is_answered_with_what_to_do() -> None:
    image = np.zeros((40, 60), np.uint8)
    for left, right, name in (("left.png", image, "left"), (image, Path("right.png"), "right")):
        with pytest.raises(ValueError, match=rf"{name} is a \w+; give an array, such as sl\.read_image\({name}\)"):
            CorrelationMatcher().compute(left, right)  # type: ignore[arg-type]


def test_settings_are_immutable_and_survive_json() -> None:
    matcher = CorrelationMatcher(window_size=9, search=SearchArea.rectified(32, min_disparity=-4, vertical=2))
    assert CorrelationMatcher.model_validate_json(matcher.model_dump_json()) == matcher
    with pytest.raises(ValidationError, match="frozen"):
        matcher.window_size = 5  # type: ignore[misc]


MATCHERS = [
    CorrelationMatcher(window_size=9, search=SearchArea.rectified(16)),
    StereoBM(num_disparities=16),
    StereoSGBM(),
    SemiGlobalMatcher(),
]


@pytest.mark.parametrize("matcher", MATCHERS, ids=lambda matcher: type(matcher).__name__)
@pytest.mark.parametrize(
    ("left", "right", "says"),
    [
        (np.zeros((40, 50), np.uint8), np.zeros((40, 52), np.uint8), "50 × 40 .* 52 × 40"),
        (np.zeros((40, 50), np.uint8), np.zeros((40, 50), np.float32), "uint8 .* float32"),
        (np.zeros((0, 50), np.uint8), np.zeros((0, 50), np.uint8), "no pixels"),
        (np.full((40, 50), np.nan), np.zeros((40, 50)), "2000 NaN"),
        (np.zeros((4, 5), np.uint8), np.zeros((4, 5), np.uint8), "5 × 4"),
        (np.zeros((4, 5, 7, 2)), np.zeros((4, 5, 7, 2)), "shape"),
        (np.zeros((40, 50), np.complex128), np.zeros((40, 50), np.complex128), "complex"),
    ],
)
def test_bad_images_are_refused_with_the_value(
    matcher: StereoBM, left: np.ndarray, right: np.ndarray, says: str
) -> None:
    with pytest.raises(ValueError, match=says):
        matcher.compute(left, right)


@pytest.mark.parametrize("matcher", MATCHERS, ids=lambda matcher: type(matcher).__name__)
@pytest.mark.parametrize("dtype", [np.uint8, np.uint16, np.float32])
@pytest.mark.parametrize("channels", [None, 3, 4])
def test_every_matcher_takes_the_same_images(matcher: StereoBM, dtype: type, channels: int | None) -> None:
    images = shifted_pair(70, 180, 0, -6, dtype=dtype)
    if channels:
        images = tuple(np.repeat(image[:, :, None], channels, axis=2) for image in images)
    disparity = matcher.compute(*images).disparity[20:-20, 110:-20]
    assert abs(np.nanmedian(disparity) - 6) < 0.1
    assert np.isfinite(disparity).mean() > 0.8


def test_progress_runs_to_the_end() -> None:
    seen: list[float] = []
    left, right = shifted_pair(80, 100, 0, -4)
    CorrelationMatcher(window_size=9, overlap=0.9, search=SearchArea.centred(19)).compute(
        left, right, progress=seen.append
    )
    assert seen == sorted(seen)
    assert seen[-1] == pytest.approx(1)


def test_motorcycle_is_measured_as_well_as_the_report_says(data_dir: object) -> None:
    folder = data_dir / "stereo" / "motorcycle_q"  # type: ignore[operator]
    left, right = (read_image(folder / name) for name in ("left.png", "right.png"))
    truth = read_disparity(folder / "gt.pfm")
    result = CorrelationMatcher(window_size=21, overlap=0.95, search=SearchArea.rectified(70)).compute(left, right)
    figures = evaluate(result.disparity, truth)
    assert figures.bad_measured[2.0] <= 26
    assert figures.density > 0.8
