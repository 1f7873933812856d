from __future__ import annotations

import subprocess
import sys

import cv2
import numpy as np
import numpy.typing as npt
import pytest

from stereolag.figures.legends import FAR_TO_NEAR, disparity_range
from stereolag.figures.maps import image_into_map
from stereolag.figures.pictures import NO_ANSWER, VIRIDIS, as_rgb, coloured, fitted, png
from stereolag.figures.recordings import (
    CLOSE_UP_SAMPLES,
    POINTS,
    aligned,
    close_up,
    correlation_curve,
    liveliest_start,
    waveforms,
)
from stereolag.figures.templates import framed, match_close_up, score_map_png
from stereolag.signals import signal_lag
from stereolag.signals.overlaps import overlap_slices
from stereolag.templates import TemplateMatch
from tests.app.uploads import noise, texture


def decoded(data: bytes) -> npt.NDArray[np.uint8]:
    picture = cv2.imdecode(np.frombuffer(data, np.uint8), cv2.IMREAD_COLOR)
    assert picture is not None
    return np.asarray(cv2.cvtColor(picture, cv2.COLOR_BGR2RGB), dtype=np.uint8)


def test_near_is_bright_and_no_answer_grey() -> None:
    disparity = np.array([[0, 5, 10, 99, -99, np.nan]], dtype=np.float32)
    far, between, near, nearer, farther, nothing = coloured(disparity, 0, 10, FAR_TO_NEAR)[0]
    assert far.tolist() == farther.tolist() == VIRIDIS[0].tolist()
    assert near.tolist() == nearer.tolist() == VIRIDIS[-1].tolist()
    assert between.tolist() in VIRIDIS.tolist()
    assert tuple(nothing) == NO_ANSWER


def test_the_grey_of_no_answer_is_none_of_the_colours() -> None:
    assert np.abs(VIRIDIS.astype(int) - NO_ANSWER).sum(axis=1).min() > 40


def test_infinite_values_are_no_answer_either() -> None:
    assert (coloured(np.array([[np.inf, -np.inf]]), 0, 1) == NO_ANSWER).all()


def test_the_range_of_colours_holds_still_under_small_changes() -> None:
    truth = np.linspace(5, 61, 1_000, dtype=np.float32).reshape(10, 100)
    assert disparity_range([truth]) == (4.0, 64.0)
    assert disparity_range([truth + 0.2]) == (4.0, 64.0)
    assert disparity_range([truth, np.full((3, 3), np.nan, dtype=np.float32)]) == (4.0, 64.0)


@pytest.mark.parametrize("value", [np.nan, 7.0, -8.0])
def test_a_map_of_one_value_or_none_has_a_range_too(value: float) -> None:
    low, high = disparity_range([np.full((4, 4), value, dtype=np.float32)])
    assert low < high


def test_an_image_turns_into_its_map() -> None:
    image = texture(4, 10)
    shown = decoded(image_into_map(image, np.zeros((4, 10), dtype=np.float32), 0, 1))
    assert np.array_equal(shown[:, :4], image[:, :4])
    assert (shown[:, 4:] == VIRIDIS[0]).all()


@pytest.mark.parametrize("dtype", [np.uint8, np.uint16, np.float32, np.float64])
def test_every_type_of_picture_is_shown(dtype: type) -> None:
    image = (texture(5, 7)[:, :, 0] * np.float64(1 if dtype is np.uint8 else 1.5)).astype(dtype)
    assert as_rgb(image).shape == (5, 7, 3)
    assert decoded(png(as_rgb(image))).shape == (5, 7, 3)


def test_transparent_parts_are_grey_and_wide_pictures_fitted() -> None:
    image = np.dstack((texture(20, 40), np.zeros((20, 40), dtype=np.uint8)))
    assert (as_rgb(image) == 128).all()
    assert fitted(image, 10).shape == (5, 10, 3)
    assert fitted(image, 100).shape == (20, 40, 3)


def test_a_frame_leaves_the_rest_and_the_input_alone() -> None:
    picture = texture(60, 80)
    before = picture.copy()
    shown = decoded(framed(picture, [TemplateMatch(20, 30, 10, 12, 1.0)]))
    assert np.array_equal(picture, before)
    assert np.array_equal(shown[:10], picture[:10])
    assert np.array_equal(shown[21:29, 31:41], picture[21:29, 31:41])
    assert not np.array_equal(shown, picture)


@pytest.mark.parametrize(("row", "col"), [(0, 0), (50, 68), (25, 30)])
def test_a_close_up_stays_within_the_picture(row: int, col: int) -> None:
    shown = decoded(match_close_up(texture(60, 80), TemplateMatch(row, col, 10, 12, 1.0)))
    assert shown.shape == (480, 640, 3)


def test_a_close_up_of_a_tall_sliver_is_no_larger_than_any_other() -> None:
    shown = decoded(match_close_up(texture(2_000, 7), TemplateMatch(0, 0, 1_900, 7, 1.0)))
    assert max(shown.shape) == 640


def test_a_peak_one_place_wide_is_seen_in_a_reduced_score_map() -> None:
    scores = np.zeros((1_000, 2_100), dtype=np.float32)
    scores[511, 1_234] = 1
    scores[600:700, 600:700] = np.nan
    shown = decoded(score_map_png(scores, []))
    assert shown.shape == (334, 700, 3)
    assert shown[170, 411].tolist() == VIRIDIS[-1].tolist()
    assert tuple(shown[220, 220]) == NO_ANSWER


@pytest.mark.parametrize("count", [10, POINTS, 50_000])
def test_a_line_holds_as_many_points_as_are_seen(count: int) -> None:
    figure = waveforms(noise(count), noise(count, 1), 8_000)
    assert [len(trace.x) for trace in figure.data] == 2 * [min(count, POINTS)]
    assert all(trace.y.dtype == np.float32 for trace in figure.data)


@pytest.mark.parametrize("lag", [-300, 0, 300])
def test_the_lag_is_undone(lag: int) -> None:
    sound = noise(2_000)
    first, second = sound[max(0, lag) :][:1_500], sound[max(0, -lag) :][:1_500]
    over = aligned(first, second, lag, 1.0)
    assert over.data[1].x[0] - over.data[0].x[0] == -lag
    shared, also = overlap_slices(first.size, second.size, lag)
    assert np.array_equal(first[shared], second[also])
    for position in (shared.start, liveliest_start(first, shared), shared.stop - 1):
        near = close_up(first, second, lag, position)
        assert 1 <= len(near.data[0].y) <= CLOSE_UP_SAMPLES
        assert np.allclose(near.data[0].y, near.data[1].y, atol=0.2)  # each in units of its own standard deviation


def test_the_liveliest_place_is_where_it_is_loud() -> None:
    quiet = 0.01 * noise(5_000)
    quiet[3_000:3_200] *= 100
    assert abs(liveliest_start(quiet, slice(0, 5_000)) - 3_000) < 20


@pytest.mark.parametrize("method", ["fft", "sampled"])
def test_the_peak_is_marked_where_it_is(method: str) -> None:
    sound = noise(6_000)
    result = signal_lag(sound[:-123], sound[123:], method=method, seed=0)  # type: ignore[arg-type]
    *_, curve, peak = correlation_curve(result, "what it counts").data
    assert peak.x == (result.lag,)
    assert peak.y[0] == pytest.approx(max(curve.y))


def test_neither_the_library_nor_the_figures_bring_in_streamlit() -> None:
    code = (
        "import sys, pkgutil, importlib, stereolag.figures as figures\n"
        "for module in pkgutil.iter_modules(figures.__path__, 'stereolag.figures.'):\n"
        "    importlib.import_module(module.name)\n"
        "sys.exit('streamlit' in sys.modules)"
    )
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0
