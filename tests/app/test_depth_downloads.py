"""Take it away: every file is offered and has the promised contents, and settings can be loaded again."""

import io
import zipfile
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest
import streamlit as st
from streamlit.testing.v1 import AppTest

import stereolag as sl
from stereolag import CorrelationMatcher, SearchArea, StereoBM, read_image
from stereolag.assess.findings import Remedy
from stereolag.core.jobs import Estimate
from stereolag.figures.legends import Colours
from stereolag.geometry.calibration import Calibration, StereoRig
from stereolag.geometry.rectification import turned
from stereolag.io.depths import VERTEX
from stereolag.io.settings import settings_json
from stereolag.pair import Pair, PairId, Preparation, Rows, assemble_pair, prepare, resized
from stereolag.stereo.matcher import StereoMatcher
from stereolag.ui.depth.comparing import show_scoreboard
from stereolag.ui.depth.downloads import Download, archive, files, show_downloads
from stereolag.ui.depth.state import recall_settings
from stereolag.ui.depth.view import DepthView, KnownDistance
from stereolag.ui.downloads import File
from stereolag.ui.matcher_controls import ask_matcher, control_state
from tests.app import keys
from tests.app.depth_view import part_of_page
from tests.app.pages import page_of
from tests.programs import run_program

BLOCK = StereoBM(num_disparities=16, block_size=9)
CORRELATION = CorrelationMatcher(window_size=9, overlap=0.9, search=SearchArea.rectified(12))


def small_pair() -> Pair:
    scene = np.random.default_rng(0).integers(0, 255, (60, 105)).astype(np.uint8)
    truth = np.full((60, 100), 5, dtype=np.float32)
    return Pair(scene[:, :-5], scene[:, 5:], PairId("noise"), truth=truth, num_disparities=16)


def view_of(pair: Pair, *matchers: StereoMatcher) -> DepthView:
    results = {type(matcher).__name__: matcher.compute(pair.left, pair.right) for matcher in matchers}
    return DepthView(pair, results, Colours(0.0, 16.0))


def made(download: Download) -> dict[str, File]:
    return {file.name: file for file in files(download)}


def refusals(download: Download) -> dict[str, str]:
    return {file.name: file.refusal for file in files(download) if file.refusal}


def metrics(download: Download) -> list[str]:
    return str(made(download)["metrics.csv"].make()).splitlines()


def unpack(download: Download, folder: Path) -> None:
    with zipfile.ZipFile(io.BytesIO(archive(download))) as whole:
        whole.extractall(folder)


def section() -> None:
    pair = st.session_state["pair"]
    recall_settings(pair)
    matcher = ask_matcher(control_state(StereoBM, pair)) or StereoBM()
    show_downloads(DepthView(pair, {"StereoBM": matcher.compute(pair.left, pair.right)}, Colours(0, 16)))
    st.session_state["matcher"] = matcher


def opened(pair: Pair) -> AppTest:
    app = page_of(section, {"pair": pair, keys.BLOCK: 9})
    assert not app.get("download_button")
    app.session_state["depth.take.opened"] = True
    return app.run()


def points_of(cloud: bytes) -> np.ndarray:
    return np.frombuffer(cloud.partition(b"end_header\n")[2], VERTEX)


def test_of_images_that_were_turned_the_map_and_the_points_are_turned_back() -> None:
    pair = replace(small_pair(), turn=1)
    view = DepthView(pair, {"bm": BLOCK.compute(pair.left, pair.right)}, Colours(0.0, 16.0))
    download = Download(view, "bm")
    download.calibration = Calibration(100.0, 0.1, cx=50.0, cy=30.0, width=100, height=60)
    expected = np.rot90(view.results["bm"].disparity, -1)
    pfm, valid, left, cloud = (
        bytes(made(download)[name].make()) for name in ("disparity.pfm", "valid.png", "left.png", "cloud.ply")
    )
    np.testing.assert_array_equal(sl.read_disparity(pfm), expected)
    np.testing.assert_array_equal(read_image(valid) > 0, np.isfinite(expected))
    np.testing.assert_array_equal(read_image(left), pair.left)
    points = points_of(cloud)
    across, down = np.ptp(points["position"], axis=0)[:2]
    assert down > 1.4 * across


def test_metrics_are_of_every_method_and_apart_without_occlusion_and_files_for_opencv_of_its_own_alone() -> None:
    view = view_of(replace(small_pair(), visible=np.ones((60, 100), dtype=np.bool_)), CORRELATION, BLOCK)
    judged = [line.split(",")[0].strip('"') for line in metrics(Download(view, "StereoBM"))]
    each = [(name, f"{name} (non-occluded)") for name in ("CorrelationMatcher", "StereoBM")]
    assert judged == ["method", *each[0], *each[1]]
    assert ["opencv.yml" in made(Download(view, name)) for name in view.results] == [False, True]


def test_what_cannot_be_had_says_why_and_is_left_out_of_the_zip(tmp_path: Path) -> None:
    pair = replace(small_pair(), truth=None, shared=True)
    backwards = StereoBM(num_disparities=16, block_size=9, min_disparity=-16)
    download = Download(view_of(replace(pair, left=pair.right, right=pair.left), backwards), "StereoBM")
    refused, in_metres = refusals(download), ("cloud.ply", "depth.tif", "depth_mm.png")
    assert refused.keys() == {"disparity_kitti.png", *in_metres}
    said = "Depth in metres needs a calibration, or one point whose distance is known."
    assert {refused[name] for name in in_metres} == {said}
    unpack(download, tmp_path)
    names = {path.name for path in tmp_path.iterdir()}
    assert not refused.keys() & names
    said = (tmp_path / "README.txt").read_text("utf-8").splitlines()
    assert names == {"README.txt"} | {line.split(":")[0] for line in said if ": " in line}
    lines = (tmp_path / "metrics.csv").read_text().splitlines()
    assert lines[0].endswith("coverage,filled,elapsed_s")
    assert lines[1].startswith("StereoBM,")


def test_the_metrics_hold_the_estimates_once_there_are_any() -> None:
    tables = []

    def estimating(view: DepthView) -> None:
        tables.append(metrics(Download(view, "StereoBM")))
        show_scoreboard(view)
        tables.append(metrics(Download(view, "StereoBM")))

    part_of_page(estimating, view_of(replace(small_pair(), truth=None), BLOCK, CORRELATION))
    (before, *_), (heading, block, _) = tables
    assert "estimated" not in before
    assert heading.endswith("estimated_bad_2_percent")
    assert 0 <= float(block.split(",")[-1]) <= 100


def large_view(*matchers: StereoMatcher) -> DepthView:
    """Return a pair of 800 × 480 pixels shown at half size."""
    scene = cv2.GaussianBlur(np.random.default_rng(0).integers(0, 255, (480, 820)).astype(np.uint8), (0, 0), 2)
    truth = np.full((480, 800), 20, np.float32)
    calibration = Calibration(800.0, 0.1, width=800, height=480)
    pair = Pair(
        scene[:, :-20], scene[:, 20:], PairId("large noise"), truth=truth, calibration=calibration, num_disparities=64
    )
    view = view_of(resized(pair, 2), *matchers)
    return replace(view, colours=Colours(0.0, 32.0))


@pytest.mark.parametrize("heavy", [False, True])
def test_from_a_reduced_preview_all_is_for_the_pair_in_its_own_size(heavy, tmp_path, monkeypatch):
    monkeypatch.setattr("stereolag.ui.depth.downloads.is_heavy", lambda estimate: heavy)
    block = StereoBM(num_disparities=32, block_size=11)
    download = Download(large_view(block, CORRELATION), "StereoBM")
    full = download.pair
    assert full.left.shape == (480, 800)
    unpack(download, tmp_path)
    enlarged = "_enlarged_2x" if heavy else ""
    of_map = {"depth": (".tif", "_mm.png"), "disparity": (".pfm", ".npy", "_coloured.png")}
    assert all((tmp_path / f"{name}{enlarged}{end}").exists() for name, ends in of_map.items() for end in ends)
    assert ("enlarged, its disparities multiplied by 2" in (tmp_path / "README.txt").read_text("utf-8")) == heavy
    matcher = sl.read_matcher(tmp_path / "settings.json")
    assert (matcher.num_disparities, matcher.block_size) == (64, 23)
    np.testing.assert_array_equal(read_image(tmp_path / "left.png"), full.left)
    disparity = np.load(tmp_path / f"disparity{enlarged}.npy")
    np.testing.assert_array_equal(sl.read_disparity(tmp_path / f"disparity{enlarged}.pfm"), disparity)
    assert disparity.shape == full.left.shape
    assert np.nanmedian(disparity) == pytest.approx(20, abs=0.3)
    measured = read_image(tmp_path / "measured.png") > 0
    np.testing.assert_array_equal(measured, download.as_taken.measured)
    for name in ("valid.png", "confidence.png"):
        assert read_image(tmp_path / name).shape == full.left.shape
    np.testing.assert_allclose(sl.read_depth(tmp_path / f"depth{enlarged}.tif"), 800 * 0.1 / disparity, rtol=1e-6)
    expected = matcher.compute(full.left, full.right).disparity
    assert np.array_equal(disparity, expected, equal_nan=True) != heavy
    storage = cv2.FileStorage(str(tmp_path / "opencv.yml"), cv2.FILE_STORAGE_READ)
    assert storage.getFirstTopLevelNode().getNode("numDisparities").real() == 64
    points = points_of((tmp_path / "cloud.ply").read_bytes())
    assert np.median(points["position"][:, 2]) == pytest.approx(800 * 0.1 / 20, rel=0.02)
    for program in ("reproduce.py", "reproduce_opencv.py"):
        run_program(tmp_path / program)
        np.testing.assert_array_equal(np.load(tmp_path / "disparity.npy"), expected)
    figures = {line.split(",")[0]: line.split(",") for line in (tmp_path / "metrics.csv").read_text().splitlines()}
    assert figures["StereoBM"][1] == str(480 * 800)  # pixels with ground truth


def rectified_here(above: bool, remedies: tuple[Remedy, ...] = ()) -> Pair:
    """Return a pair of two lenses that the page rectified; `above`: the second camera stands below the first."""
    matrix, lens = np.array([[90.0, 0, 59], [0, 91, 41], [0, 0, 1]]), [-0.1, 0.02, 0, 0, 0]
    rig = StereoRig(matrix, lens, matrix, lens, np.eye(3), [-0.1, 0, 0])
    scene = cv2.GaussianBlur(np.random.default_rng(0).integers(0, 255, (80, 126)).astype(np.uint8), (0, 0), 1.5)
    left, right = scene[:, :-6], scene[:, 6:]
    if above:
        rig = rig.turned(-1, (120, 80))
        left, right = turned(left, -1), turned(right, -1)
    calibration = Calibration(90.0, 0.1, rig=rig, turn=rig.turn)
    pair = assemble_pair(left, right, None, calibration, id=PairId("raw noise"))
    return prepare(replace(pair, shared=True), Preparation(rows=Rows.RAW, alpha=0.3, remedies=remedies))


@pytest.mark.parametrize(
    ("above", "remedies", "known"),
    [(False, (), False), (True, (), False), (False, (Remedy.MATCH_EXPOSURE,), True)],
    ids=["side by side", "above each other", "treated, one distance known"],
)
def test_the_program_goes_from_the_raw_pair_in_the_zip_to_its_metres(above, remedies, known, tmp_path, monkeypatch):
    pair = rectified_here(above, remedies)
    assert pair.turn == above
    view = view_of(pair, BLOCK)
    if known:
        twice = replace(pair.calibration, baseline_m=2 * pair.calibration.baseline_m)
        monkeypatch.setattr(DepthView, "known_distance", KnownDistance(20, 40, 3.0, twice))
    download = Download(view, "StereoBM")
    unpack(download, tmp_path)
    left, calibration = read_image(tmp_path / "left.png"), sl.read_calibration(tmp_path / "calibration.json")
    np.testing.assert_array_equal(left, pair.left)
    assert calibration == download.calibration
    depth = sl.read_depth(tmp_path / "depth.tif")
    assert np.isfinite(depth).mean() > 0.3
    disparity = download.shown.disparity + calibration.doffs_px
    expected = np.where(disparity > 0, calibration.focal_px * calibration.baseline_m / disparity, np.nan)
    np.testing.assert_allclose(depth, expected, rtol=1e-6)
    depths = {name: (tmp_path / name).read_bytes() for name in ("depth.tif", "depth_mm.png")}
    for name in (*depths, "left.png", "right.png", *(() if known else ("calibration.json",))):
        (tmp_path / name).unlink()
    assert "of the pixels have a depth" in run_program(tmp_path / "reproduce.py")
    assert {name: (tmp_path / name).read_bytes() for name in depths} == depths


def test_the_depth_in_millimetres_says_how_many_pixels_are_beyond_it() -> None:
    pair = replace(small_pair(), calibration=Calibration(1e4, 0.1, width=100, height=60))
    download = Download(view_of(pair, BLOCK), "StereoBM")
    beyond = (1e4 * 0.1 / download.result.disparity > 65.5355).sum()
    assert beyond > 100
    assert f"beyond 65.535 m: {beyond:,} of the 6,000 pixels shown are." in made(download)["depth_mm.png"].meaning


def test_settings_that_the_own_size_does_not_allow_are_refused_and_the_map_is_enlarged() -> None:
    view = large_view(CORRELATION)
    wide = StereoBM(num_disparities=128, block_size=9)
    shown = replace(view.results["CorrelationMatcher"], settings=wide.model_copy(update={"num_disparities": 1024}))
    download = Download(replace(view, results={"StereoBM": shown}), "StereoBM")
    refused = refusals(download)
    assert refused.keys() >= {"settings.json", "opencv.yml", "reproduce.py", "reproduce_opencv.py"}
    assert "num_disparities is 2048" in refused["settings.json"]
    assert download.result.disparity.shape == (480, 800)


def test_settings_for_the_own_size_come_back_for_the_one_shown_and_the_controls_can_be_moved_from_there() -> None:
    pair = large_view().pair
    app = opened(pair)
    app.session_state[keys.BLOCK_MORE] = True
    settings = {"block_size": 17, "speckle_window_size": 400, "speckle_range": 9}
    saved = settings_json(StereoBM(min_disparity=-140, num_disparities=96, **settings)).encode()
    app.file_uploader[0].upload("settings.json", saved, "application/json").run()
    settings = {"block_size": 9, "speckle_window_size": 100, "speckle_range": 9}
    assert app.session_state["matcher"] == StereoBM(min_disparity=-70, num_disparities=48, **settings)
    # Smaller than the page's own smallest value.
    assert app.slider(key=keys.setting("bm", "min_disparity", pair.id.searched)).min == -70
    app.slider(key=keys.BLOCK_UNIQUENESS).set_value(40).run()
    assert app.session_state["matcher"].uniqueness_ratio == 40
    assert app.session_state["matcher"].speckle_window_size == 100


def test_a_large_map_is_computed_in_its_own_size_when_asked_for(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("stereolag.ui.depth.downloads.is_heavy", lambda estimate: True)
    app = opened(large_view().pair)
    assert "disparity_enlarged_2x.pfm" in offered(app)
    app.button(key="depth.take.compute").click().run()
    assert not app.error
    assert "disparity.pfm" in offered(app)
    assert any("was computed at that size" in caption.value for caption in app.caption)


def test_what_takes_too_much_memory_in_its_own_size_is_said(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("stereolag.ui.depth.downloads.is_heavy", lambda estimate: True)
    monkeypatch.setattr(StereoBM, "estimate", lambda self, shape, dtype=None: Estimate(10**15, 1.0))
    monkeypatch.setattr("stereolag.stereo.matcher.check_memory", lambda estimate: None)
    app = opened(large_view().pair)
    assert not [button for button in app.button if button.key == "depth.take.compute"]
    assert any("one job may take" in caption.value for caption in app.caption)


def offered(app: AppTest) -> set[str]:
    """Return the names of the files with download buttons."""
    return {button.key.removeprefix("depth.take.") for button in app.get("download_button")}


def test_every_file_has_a_button_and_those_that_cannot_be_had_are_disabled() -> None:
    app = opened(small_pair())
    buttons = {button.proto.label: button.proto.disabled for button in app.get("download_button")}
    labels = {file.label for file in files(Download(view_of(small_pair(), BLOCK), "StereoBM"))} - {""}
    assert buttons.keys() >= labels | {"All in one ZIP", "Session ZIP", "Left PNG", "Right PNG"}
    in_metres = ["Point cloud PLY", "Depth TIFF, m", "Depth PNG, mm"]
    assert [label for label, disabled in buttons.items() if disabled] == in_metres
    assert first_line(app) == ["All in one ZIP", "Python script"]
    assert any(caption.value.startswith("Depth in metres needs a calibration") for caption in app.caption)
    calibrated = opened(replace(small_pair(), calibration=Calibration(100.0, 0.1, width=100, height=60)))
    assert first_line(calibrated) == ["All in one ZIP", "Python script", *in_metres]
    assert "calibration.json" in offered(calibrated)
    assert not any(caption.value.startswith("Depth in metres takes") for caption in calibrated.caption)


def first_line(app: AppTest) -> list[str]:
    """Return the labels of the buttons that are not behind "More files"."""
    more = next(block for block in app.get("popover"))
    behind = {button.key for button in more.get("download_button")}
    return [button.proto.label for button in app.get("download_button") if button.key not in behind]
