"""Take it away: every file is on offer, holds what it says, and settings come back in."""

from __future__ import annotations

import io
import os
import subprocess
import sys
import zipfile
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from streamlit.testing.v1 import AppTest

from stereolag import CorrelationMatcher, SearchArea, StereoBM, read_disparity, read_image
from stereolag.export import settings_json
from stereolag.export.maps import VERTEX
from stereolag.geometry.calibration import Calibration
from stereolag.stereo.matcher import StereoMatcher
from stereolag.ui.depth.exports import archive, files
from stereolag.ui.depth.view import DepthView
from stereolag.ui.pairs import StereoPair
from tests.app import keys

PROJECT = Path(__file__).resolve().parents[2]
BLOCK = StereoBM(num_disparities=16, block_size=9)
CORRELATION = CorrelationMatcher(window_size=9, overlap=0.9, search=SearchArea.rectified(12))


def small_pair(dtype: type = np.uint8) -> StereoPair:
    scene = np.random.default_rng(0).integers(0, 255, (60, 105)).astype(dtype)
    truth = np.full((60, 100), 5, dtype=np.float32)
    return StereoPair(scene[:, :-5], scene[:, 5:], truth, 16, "Noise.", "noise", False)


def view_of(pair: StereoPair, *matchers: StereoMatcher) -> DepthView:
    results = {type(matcher).__name__: matcher.compute(pair.left, pair.right) for matcher in matchers}
    return DepthView(pair, results, 0.0, 16.0)


def section() -> None:
    import streamlit as st

    from stereolag import StereoBM
    from stereolag.ui.depth.address import take_over
    from stereolag.ui.depth.exports import show_downloads
    from stereolag.ui.depth.view import DepthView
    from stereolag.ui.matcher_controls import ask_matcher

    pair = st.session_state["pair"]
    take_over(pair)
    matcher = ask_matcher(StereoBM, pair) or StereoBM()
    show_downloads(DepthView(pair, {"StereoBM": matcher.compute(pair.left, pair.right)}, 0, 16))
    st.session_state["matcher"] = matcher


def opened(pair: StereoPair) -> AppTest:
    app = AppTest.from_function(section, default_timeout=60)
    app.session_state["pair"] = pair
    app.session_state["depth.take.opened"] = True
    app.session_state[keys.BLOCK] = 9
    return app.run()


@pytest.mark.parametrize("matcher", [BLOCK, CORRELATION])
@pytest.mark.parametrize("dtype", [np.uint8, np.uint16, np.float32])
def test_the_zip_reproduces_the_result_in_a_fresh_process(matcher: StereoMatcher, dtype: type, tmp_path: Path) -> None:
    view = view_of(small_pair(dtype), matcher)
    result = view.results[type(matcher).__name__]
    with zipfile.ZipFile(io.BytesIO(archive(files(view, type(matcher).__name__)))) as whole:
        whole.extractall(tmp_path)
    for name in ("disparity.pfm", "disparity.npy"):
        np.testing.assert_array_equal(read_disparity(tmp_path / name), result.disparity)
    assert (tmp_path / "opencv.yml").exists() == isinstance(matcher, StereoBM)
    assert read_image(tmp_path / "disparity_coloured.png").shape[1] >= 100
    done = subprocess.run(
        [sys.executable, str(tmp_path / "reproduce.py")],
        env=os.environ | {"PYTHONPATH": str(PROJECT)},
        capture_output=True,
        text=True,
    )
    assert done.returncode == 0, done.stderr
    np.testing.assert_array_equal(np.load(tmp_path / "disparity.npy"), result.disparity)


def test_metrics_are_of_every_method_and_apart_without_occlusion() -> None:
    pair = replace(small_pair(), visible=np.ones((60, 100), dtype=np.bool_))
    metrics = next(file for file in files(view_of(pair, CORRELATION, BLOCK), "StereoBM") if file.name == "metrics.csv")
    lines = str(metrics.make()).splitlines()
    assert [line.split(",")[0].strip('"') for line in lines] == [
        "method",
        "CorrelationMatcher",
        "CorrelationMatcher (non-occluded)",
        "StereoBM",
        "StereoBM (non-occluded)",
    ]


def test_what_cannot_be_had_says_why_and_is_left_out_of_the_zip() -> None:
    pair = replace(small_pair(), truth=None)
    backwards = StereoBM(num_disparities=16, block_size=9, min_disparity=-16)
    view = view_of(replace(pair, left=pair.right, right=pair.left), backwards)
    refusals = {file.name: file.refusal for file in files(view, "StereoBM") if file.refusal}
    assert refusals.keys() == {"disparity_kitti.png", "cloud.ply", "metrics.csv"}
    with zipfile.ZipFile(io.BytesIO(archive(files(view, "StereoBM")))) as whole:
        assert not refusals.keys() & set(whole.namelist())


def test_nothing_is_offered_until_it_is_opened() -> None:
    app = AppTest.from_function(section, default_timeout=60)
    app.session_state["pair"] = small_pair()
    assert not app.run().get("download_button")


def test_every_file_has_a_button_and_those_that_cannot_be_had_are_disabled() -> None:
    app = opened(small_pair())
    assert not app.exception
    buttons = {button.proto.label: button.proto.disabled for button in app.get("download_button")}
    assert buttons == {
        "All in one ZIP": False,
        "PFM": False,
        "NPY": False,
        "KITTI PNG": False,
        "Coloured PNG": False,
        "Valid mask": False,
        "Point cloud PLY": True,
        "Metrics CSV": False,
        "Settings JSON": False,
        "OpenCV YAML": False,
        "Python script": False,
        "Left PNG": False,
        "Right PNG": False,
    }


def test_settings_are_loaded_again_and_the_controls_can_be_moved_from_there() -> None:
    pair = small_pair()
    app = opened(pair)
    app.session_state[keys.BLOCK_MORE] = True
    settings = StereoBM(min_disparity=-70, num_disparities=32, block_size=7, speckle_window_size=70, speckle_range=9)
    app.file_uploader[0].upload("settings.json", settings_json(settings).encode(), "application/json").run()
    assert not app.exception
    assert app.session_state["matcher"] == settings
    assert (
        app.slider(key=keys.setting("bm", "min_disparity", pair.searched)).min == -70
    )  # farther than the page goes of itself
    app.slider(key=keys.BLOCK_UNIQUENESS).set_value(40).run()
    assert app.session_state["matcher"].uniqueness_ratio == 40
    assert app.session_state["matcher"].speckle_window_size == 70


def test_a_settings_file_that_is_none_is_answered_with_a_sentence() -> None:
    app = opened(small_pair())
    app.file_uploader[0].upload("settings.json", b"{}", "application/json").run()
    assert not app.exception
    assert "settings file" in app.error[0].value


def test_a_point_cloud_is_in_metres_once_there_is_a_calibration() -> None:
    pair = replace(small_pair(), calibration=Calibration(100.0, 0.1))
    cloud = next(file for file in files(view_of(pair, CORRELATION), "CorrelationMatcher") if file.name == "cloud.ply")
    assert not cloud.refusal
    head, _, data = bytes(cloud.make()).partition(b"end_header\n")  # type: ignore[arg-type]
    points = np.frombuffer(data, VERTEX)
    assert f"element vertex {len(points)}".encode() in head
    assert np.median(points["position"][:, 2]) == pytest.approx(100 * 0.1 / 5, rel=0.02)
