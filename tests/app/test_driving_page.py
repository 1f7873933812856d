from __future__ import annotations

import csv
import io
import time
from collections.abc import Callable
from functools import cache
from types import SimpleNamespace
from typing import Any

import av
import cv2
import moving_drives
import numpy as np
import pytest
from streamlit.testing.v1 import AppTest

from stereolag.figures.pictures import coloured
from stereolag.io.disparities import read_disparity
from stereolag.io.images import image_png, read_image
from stereolag.samples import stereo_pairs
from stereolag.ui.driving import inputs, work
from stereolag.ui.driving.inputs import EXAMPLE, ONE, TWO
from stereolag.ui.driving.work import LINES, _table
from stereolag.ui.sentences import MOTION_IN_WORDS
from tests.app import uploads
from tests.app.driving import archive, finished, opened, page, player, work_of, zipped_frames

COUNT = 4
ROWS, COLS = 120, 200

pytestmark = pytest.mark.usefixtures("short_drive")


@cache
def road() -> dict[str, np.ndarray]:
    example = stereo_pairs()["road"]
    return {side: read_image(getattr(example, side))[200 : 200 + ROWS] for side in ("left", "right")}


def drive(*, damaged: int | None = None, count: int = COUNT) -> bytes:
    """Return a ZIP of frames cut from the road, each a little farther to the right."""
    starts = range(0, 4 * count, 4)
    frames = {side: [uploads.png(whole[:, one : one + COLS]) for one in starts] for side, whole in road().items()}
    if damaged is not None:
        frames["right"][damaged] = frames["right"][damaged][: len(frames["right"][damaged]) // 2]
    return zipped_frames(frames)


def methods(app: AppTest, chosen: list[str]) -> AppTest:
    """Choose the methods whose maps are computed."""
    return next(one for one in app.get("button_group") if one.key == "driving.methods").set_value(chosen).run()


@pytest.mark.usefixtures("healthy_frames")
def test_a_drive_is_computed_played_and_told_of() -> None:
    app = finished(opened(drive()))
    assert not app.error
    shown = player(app)
    assert (shown["frames"], shown["computed"], shown["done"]) == (COUNT, COUNT, True)
    assert shown["titles"] == ["Left image", "Convolution, fast", "StereoBM"]
    charts = {chart["name"]: chart["series"] for chart in shown["charts"]}
    assert charts.keys() >= {"Coverage", "Computing time", "Nearest obstacle", "Flicker"}
    fast, bm = (np.array(one["values"], float) for one in charts["Coverage"])
    assert (fast > bm).all()
    assert shown["legends"][0]["words"] == ["FAR", "NEAR"]
    assert any(f"{COUNT} of {COUNT} frames" in one.value for one in app.caption)
    video = b"".join(work_of(app).video.pieces)
    with av.open(io.BytesIO(video), "r") as container:
        assert sum(1 for _ in container.decode(video=0)) == COUNT
        assert container.streams.video[0].width == 3 * COLS
    table = _table(work_of(app))
    assert len([*csv.DictReader(io.StringIO(table))]) == 2 * COUNT
    assert {one.label for one in app.get("download_button")} == {"Video (MP4)", "Maps (ZIP)", "Table (CSV)"}


def test_it_opens_on_the_example_which_the_next_visitor_sees_at_once() -> None:
    app = finished(page(EXAMPLE))
    assert not app.error
    (example,) = inputs.drives().values()
    shown = player(app)
    assert shown["computed"] == shown["frames"] == len(example)
    assert not any(shown["problems"])
    fast, bm = next(chart["series"] for chart in shown["charts"] if chart["name"] == "Wrong by over 2 px")
    assert np.mean(fast["values"]) < 0.3 * np.mean(bm["values"])
    assert shown["legends"][0]["title"] == "disparity, px, and distance"
    assert work_of(page(EXAMPLE)) is work_of(app)


@pytest.mark.usefixtures("healthy_frames")
def test_the_truth_is_shown_beside_the_maps() -> None:
    app = page(EXAMPLE)
    methods(app, ["bm"])
    next(one for one in app.toggle if one.label == "True disparity").set_value(True).run()
    app = finished(app)
    assert player(app)["titles"] == ["Left image", "StereoBM", "True disparity"]
    low, high = work_of(app).kept.colours or (0, 0)
    (example,) = inputs.drives().values()
    truth = read_disparity(example.disparity[0])
    with av.open(io.BytesIO(b"".join(work_of(app).video.pieces)), "r") as container:
        first = next(container.decode(video=0)).to_ndarray(format="rgb24").astype(float)
    width = truth.shape[1] // 2 * 2
    shown = first[:, 2 * width :]
    expected = coloured(truth, low, high).astype(float)[:, :width]
    assert np.abs(shown - expected).mean() < 8  # of 255: the compression changes the colours this much


@pytest.mark.usefixtures("healthy_frames")
def test_other_methods_ranges_and_steadiness_are_computed_anew() -> None:
    app = finished(opened(drive(count=2)))
    before = player(app)["name"]
    app = finished(methods(app, ["bm"]))
    shown = player(app)
    assert shown["titles"] == ["Left image", "StereoBM"]
    assert shown["name"] != before
    count = next(box for box in app.number_input if box.label == "Disparities searched")
    count.set_value(32).run()
    app = finished(app)
    assert player(app)["name"] not in (before, shown["name"])
    before = player(app)["name"]
    next(one for one in app.toggle if one.label == "Steady").set_value(True).run()
    assert player(finished(app))["name"] != before
    app = methods(app, [])
    assert [one.value for one in app.info] == ["Choose a method, and its maps are computed."]


@pytest.mark.usefixtures("healthy_frames")
def test_a_damaged_frame_is_said_and_the_others_go_on() -> None:
    app = finished(opened(drive(damaged=2, count=4)))
    shown = player(app)
    assert [bool(problem) for problem in shown["problems"]] == [number == 2 for number in range(4)]
    assert shown["computed"] == 4
    assert any("1 of them damaged" in one.value for one in app.caption)


CANCELLED = 16


def test_the_example_is_called_off_while_own_frames_are_awaited_and_goes_on_for_who_returns(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    def unending(*given: Any, cancelled: Callable[[], bool], **more: Any) -> SimpleNamespace:
        while not cancelled():
            time.sleep(0.01)
        return SimpleNamespace(cancelled=True)

    monkeypatch.setattr(work, "run_sequence", unending)
    monkeypatch.setattr(work, "_examples", {})  # which the tests above have computed
    app = page(EXAMPLE)
    begun = work_of(app).job
    app.button_group(key="driving.origin").set_value(ONE).run()
    assert begun.cancelled
    app.button_group(key="driving.origin").set_value(EXAMPLE).run()
    again = work_of(app).job
    assert again is not begun
    assert not again.cancelled
    again.cancel()


@pytest.mark.usefixtures("healthy_frames")
def test_what_is_cancelled_stays_and_can_go_on() -> None:
    app = opened(drive(count=CANCELLED))
    end = time.monotonic() + 60
    while not work_of(app).kept.records:
        assert time.monotonic() < end
        time.sleep(0.01)
    start = time.monotonic()
    work_of(app).job.cancel()
    while work_of(app).job.running:
        assert time.monotonic() - start < 5
        time.sleep(0.01)
    app.run()
    shown = player(app)
    assert shown["done"]
    if shown["computed"] == CANCELLED:
        pytest.skip("it was done before it could be called off")
    assert 0 < shown["computed"] < CANCELLED
    next(button for button in app.button if button.label == "Go on").click().run()
    app = finished(app)
    assert player(app)["computed"] == CANCELLED
    assert player(app)["name"] != shown["name"]


@pytest.mark.parametrize(("data", "said"), [(b"PK\x03\x04nothing", "ZIP"), (b"no video at all" * 9, "video")])
def test_what_is_no_sequence_is_refused_in_a_sentence(data: bytes, said: str) -> None:
    app = opened(data)
    assert not app.exception
    assert said in app.error[0].value
    names = [one.proto.component_name for one in app.get("bidi_component")]
    assert "stereolag.player" not in names  # not even for the example shown until a file is given


def test_one_of_two_videos_is_refused_before_the_other_is_there() -> None:
    app = page(TWO)
    app.file_uploader(key="driving.left").set_value(("report.pdf", b"%PDF-1.7", "application/pdf")).run()
    assert "“report.pdf”: This is not a video" in app.error[0].value


def test_what_is_wrong_is_said_and_cameras_above_each_other_are_matched_after_a_click() -> None:
    example = stereo_pairs()["cube"]
    cube = [cv2.resize(read_image(one), None, fx=0.5, fy=0.5) for one in (example.left, example.right)]
    above = [np.ascontiguousarray(np.rot90(one, -1)) for one in cube]
    app = finished(opened(archive((above[0], above[1]), count=1)))
    assert any("cameras stand above each other" in one.value for one in app.markdown)
    assert {row["findings"] for row in csv.DictReader(io.StringIO(_table(work_of(app))))} == {"above_each_other"}
    app.button(key="driving.turn").click().run()
    app = finished(app)
    assert not app.warning
    rows = [*csv.DictReader(io.StringIO(_table(work_of(app))))]
    assert {row["findings"] for row in rows} == {""}
    assert min(float(row["coverage"]) for row in rows) > 0.6
    assert player(app)["height"] == above[0].shape[0]
    app.button(key="driving.turn.undo").click().run()
    assert any("cameras stand above each other" in one.value for one in app.markdown)


def with_motion(app: AppTest, how: str) -> AppTest:
    next(one for one in app.get("button_group") if one.key == "driving.motion").set_value(how).run()
    return finished(app)


@pytest.mark.usefixtures("healthy_frames")
def test_motion_without_a_calibration_is_the_flow_alone_and_with_one_tells_speeds() -> None:
    app = opened(moving_drives.archive(2))
    assert not any("need metres" in one.value for one in app.caption)
    app = with_motion(app, "colours")
    shown = player(app)
    assert shown["titles"] == ["Left image", "Convolution, fast", "StereoBM", "Optical flow"]
    assert any("need metres: give a calibration" in one.value for one in app.caption)
    wheel = shown["legends"][-1]
    assert wheel["picture"].startswith("data:image/png;base64,") and "rim" in wheel["words"][0]
    app.number_input(key="driving.focal").set_value(moving_drives.CAMERA.focal_px)
    app.number_input(key="driving.baseline").set_value(moving_drives.CAMERA.baseline_m).run()
    next(box for box in app.number_input if box.label == "Frames a second").set_value(2 * moving_drives.RATE).run()
    app = with_motion(app, "arrows")
    shown = player(app)
    assert shown["titles"][-1] == "Optical flow" and all(not legend["picture"] for legend in shown["legends"])
    speeds = own_speeds(shown)
    assert speeds["colour"] == LINES[2]["colour"] and speeds["values"][0] is None
    assert speeds["values"][1:] == pytest.approx([2 * moving_drives.OWN_KMH], rel=0.05)


def own_speeds(shown: dict[str, Any]) -> dict[str, Any]:
    (speeds,) = next(chart["series"] for chart in shown["charts"] if chart["name"] == "Own speed")
    return dict(speeds)


@pytest.mark.usefixtures("healthy_frames")
def test_a_cut_and_a_repeated_frame_are_said_in_place_of_a_motion() -> None:
    first, random = moving_drives.frame(0), np.random.default_rng(0)
    noise = random.integers(0, 256, (2, moving_drives.ROWS, moving_drives.COLS)).astype(np.uint8)
    cut = [cv2.GaussianBlur(one, (5, 5), 0) for one in noise]
    frames = {
        side: [image_png(image) for image in (getattr(first, side), getattr(first, side), other)]
        for side, other in zip(("left", "right"), cut, strict=True)
    }
    app = with_motion(opened(zipped_frames(frames)), "colours")
    assert player(app)["problems"] == ["", MOTION_IN_WORDS["identical"], MOTION_IN_WORDS["unrelated"]]
