"""The driving page: a drive is computed, played and told of, its camera is calibrated, and bad files are refused."""

import csv
import io
import json
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
import straight_and_raw
from streamlit.testing.v1 import AppTest

from stereolag import Diagnosis, read_disparity
from stereolag.figures.pictures import coloured
from stereolag.io.images import image_png, read_image
from stereolag.samples import stereo_pairs
from stereolag.ui.depth.view import HANDED
from stereolag.ui.driving import inputs, work
from stereolag.ui.driving.inputs import EXAMPLE, ONE, TWO
from stereolag.ui.driving.work import LINES, OPENED, _table
from stereolag.ui.sentences import MOTION_IN_WORDS
from tests.app import uploads
from tests.app.driving import archive, finished, opened, page, player, work_of, zipped_frames
from tests.app.pages import CALIBRATE, DRIVING, moved, until, uploaded
from tests.app.reading import captions, labelled

COUNT = 4
ROWS, COLS = 120, 200


@cache
def road() -> dict[str, np.ndarray]:
    example = stereo_pairs()["road"]
    return {side: read_image(getattr(example, side))[200 : 200 + ROWS] for side in ("left", "right")}


def table(app: AppTest) -> list[dict[str, str]]:
    return [*csv.DictReader(io.StringIO(_table(work_of(app))))]


def drive(*, damaged: int | None = None, count: int = COUNT) -> bytes:
    """Return a ZIP of frames cut from the road, each a little farther to the right."""
    starts = range(0, 4 * count, 4)
    frames = {side: [uploads.png(whole[:, one : one + COLS]) for one in starts] for side, whole in road().items()}
    if damaged is not None:
        frames["right"][damaged] = frames["right"][damaged][: len(frames["right"][damaged]) // 2]
    return zipped_frames(frames)


@pytest.mark.usefixtures("healthy_frames")
def test_a_drive_with_a_damaged_frame_is_computed_played_and_told_of() -> None:
    app = finished(opened(drive(damaged=2)))
    assert not app.error
    shown = player(app)
    assert (shown["frames"], shown["computed"], shown["done"]) == (COUNT, COUNT, True)
    assert [bool(problem) for problem in shown["problems"]] == [number == 2 for number in range(COUNT)]
    assert shown["titles"] == ["Left image", "Convolution, fast", "StereoBM"]
    charts = {chart["name"]: chart["series"] for chart in shown["charts"]}
    assert charts.keys() >= {"Coverage", "Computing time", "Nearest obstacle", "Flicker"}
    assert shown["legends"][0]["words"] == ["FAR", "NEAR"]
    assert f"{COUNT} of {COUNT} frames" in captions(app) and "1 of them damaged" in captions(app)
    assert len(table(app)) == 2 * COUNT
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
    app = moved(page(EXAMPLE), {"driving.methods": ["bm"]})
    app = finished(labelled(app.toggle, "True disparity").set_value(True).run())
    assert player(app)["titles"] == ["Left image", "StereoBM", "True disparity"]
    (example,) = inputs.drives().values()
    with av.open(io.BytesIO(b"".join(work_of(app).video.pieces)), "r") as container:
        frames = [frame.to_ndarray(format="rgb24").astype(float) for frame in container.decode(video=0)]
    assert len(frames) == len(example)
    expected = coloured(read_disparity(example.disparity[0]), *work_of(app).kept.colours).astype(float)
    width = expected.shape[1] // 2 * 2
    shown = frames[0][:, 2 * width :]
    assert np.abs(shown - expected[:, :width]).mean() < 8  # of 255: the compression changes the colours this much


@pytest.mark.usefixtures("healthy_frames")
def test_other_methods_ranges_and_steadiness_are_computed_anew() -> None:
    app = finished(opened(drive(count=2)))
    names = [player(app)["name"]]

    def computed_anew() -> None:
        finished(app)
        names.append(player(app)["name"])
        assert len({*names}) == len(names)

    moved(app, {"driving.methods": ["bm"]})
    computed_anew()
    assert player(app)["titles"] == ["Left image", "StereoBM"]
    labelled(app.number_input, "Disparities searched").set_value(32).run()
    computed_anew()
    labelled(app.toggle, "Steady").set_value(True).run()
    computed_anew()
    moved(app, {"driving.methods": []})
    assert [one.value for one in app.info] == ["Choose a method to compute its maps."]


CANCELLED = 16


def test_the_example_is_called_off_while_own_frames_are_awaited_and_goes_on_for_who_returns(monkeypatch):
    def unending(*given: Any, cancelled: Callable[[], bool], **more: Any) -> SimpleNamespace:
        while not cancelled():
            time.sleep(0.01)
        return SimpleNamespace(cancelled=True)

    monkeypatch.setattr(work, "run_sequence", unending)
    monkeypatch.setattr(work, "_examples", {})  # which the tests above have computed
    app = page(EXAMPLE)
    begun = work_of(app).job
    moved(app, {"driving.origin": ONE})
    assert begun.cancelled
    again = work_of(moved(app, {"driving.origin": EXAMPLE})).job
    assert again is not begun
    assert not again.cancelled
    again.cancel()


@pytest.mark.usefixtures("healthy_frames")
def test_what_is_cancelled_stays_and_can_go_on() -> None:
    app = opened(drive(count=CANCELLED))
    until(lambda: work_of(app).kept.records)
    work_of(app).job.cancel()
    shown = player(finished(app))
    assert shown["done"]
    if shown["computed"] == CANCELLED:
        pytest.skip("it was done before it could be called off")
    assert 0 < shown["computed"] < CANCELLED
    finished(labelled(app.button, "Resume").click().run())
    assert player(app)["computed"] == CANCELLED
    assert player(app)["name"] != shown["name"]


def test_what_is_no_sequence_and_one_of_two_videos_that_is_none_are_refused_in_a_sentence() -> None:
    app = opened(b"no video at all" * 9)
    assert "video" in app.error[0].value
    names = [one.proto.component_name for one in app.get("bidi_component")]
    assert "stereolag.player" not in names  # not even for the example shown until a file is given
    app = page(TWO)
    uploaded(app, "driving", left=("report.pdf", b"%PDF-1.7"))
    assert "“report.pdf”: This is not a video" in app.error[0].value


def test_what_is_wrong_is_said_and_cameras_above_each_other_are_matched_after_a_click() -> None:
    example = stereo_pairs()["cube"]
    cube = [cv2.resize(read_image(one), None, fx=0.5, fy=0.5) for one in (example.left, example.right)]
    above = [np.ascontiguousarray(np.rot90(one, -1)) for one in cube]
    app = finished(opened(archive((above[0], above[1]), count=1)))
    assert any("cameras stand above each other" in one.value for one in app.markdown)
    assert {row["findings"] for row in table(app)} == {"above_each_other"}
    finished(app.button(key="driving.turn").click().run())
    assert not app.warning
    assert {row["findings"] for row in table(app)} == {""}
    assert min(float(row["coverage"]) for row in table(app)) > 0.6
    assert player(app)["height"] == above[0].shape[0]
    app.button(key="driving.turn.undo").click().run()
    assert any("cameras stand above each other" in one.value for one in app.markdown)


def with_motion(app: AppTest, how: str) -> AppTest:
    return finished(moved(app, {"driving.motion": how}))


@pytest.mark.usefixtures("healthy_frames")
def test_motion_without_a_calibration_is_the_flow_alone_and_with_one_tells_speeds() -> None:
    app = opened(moving_drives.archive(2))
    assert not any("need metres" in one.value for one in app.caption)
    app = with_motion(app, "colours")
    shown = player(app)
    assert shown["titles"] == ["Left image", "Convolution, fast", "StereoBM", "Optical flow"]
    assert any("need metres: add a calibration" in one.value for one in app.caption)
    wheel = shown["legends"][-1]
    assert wheel["picture"].startswith("data:image/png;base64,") and "rim" in wheel["words"][0]
    app.number_input(key="driving.focal").set_value(moving_drives.CAMERA.focal_px)
    app.number_input(key="driving.baseline").set_value(moving_drives.CAMERA.baseline_m).run()
    labelled(app.number_input, "Frames per second").set_value(2 * moving_drives.RATE)
    app = with_motion(app, "arrows")
    shown = player(app)
    assert shown["titles"][-1] == "Optical flow" and all(not legend["picture"] for legend in shown["legends"])
    (speeds,) = next(chart["series"] for chart in shown["charts"] if chart["name"] == "Own speed")
    assert speeds["colour"] == LINES[2]["colour"] and speeds["values"][0] is None
    assert speeds["values"][1:] == pytest.approx([2 * moving_drives.OWN_KMH], rel=0.05)


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


# The camera's calibration, and the disparity range that frames need


def calibrated(app: AppTest, **entries: Any) -> AppTest:
    data = json.dumps({name: np.asarray(value).tolist() for name, value in entries.items()}).encode()
    app.file_uploader(key="driving.calibration").set_value([("calibration.json", data, "application/json")]).run()
    return finished(app)


def coverage(app: AppTest) -> float:
    chart = next(chart for chart in player(app)["charts"] if chart["name"] == "Coverage")
    return float(np.mean([one["values"] for one in chart["series"]]))


@pytest.mark.usefixtures("healthy_frames")
def test_raw_frames_are_rectified_with_the_calibration_and_that_can_be_undone() -> None:
    app = finished(opened(archive(straight_and_raw.raw_pair())))
    raw = coverage(app)
    app = calibrated(app, **straight_and_raw.ENTRIES)
    assert "Each frame was undistorted and rectified with its calibration: rows differ by 0." in captions(app)
    assert coverage(app) > raw + 0.2
    disparity = work_of(app).kept.colours
    assert disparity is not None and disparity[0] <= straight_and_raw.DISPARITY <= disparity[1]
    app.session_state[OPENED] = 1
    app.run()
    assert app.title[0].value == "Depth maps"
    handed = app.session_state[HANDED]
    assert "Frame 2" in handed.description
    straight = straight_and_raw.straight_pair()[0]
    middle = slice(60, -60), slice(60, -60)
    assert np.abs(handed.left[middle].astype(float) - straight[middle]).mean() < 3
    assert handed.calibration.rig is None
    app.switch_page(DRIVING).run()
    app.button(key="driving.rectifying.undo").click().run()
    app = finished(app)
    assert "Each frame is rectified already, as you said" in captions(app)
    assert coverage(app) == pytest.approx(raw, abs=0.05)


@pytest.mark.usefixtures("healthy_frames")
def test_a_calibration_of_another_shape_is_told_of_and_one_that_fits_leaves_rectified_frames_as_they_are() -> None:
    app = opened(archive(straight_and_raw.straight_pair()))
    calibrated(app, focal_px=500, baseline_m=0.1, width=640, height=640)
    (error,) = app.error
    assert "The calibration is for 640 × 640 pixels and the images are 320 × 240" in error.value
    assert error.value.endswith("The drive is processed without the calibration.")
    assert player(app)["computed"] == 2
    assert player(app)["legends"][0]["title"] == "disparity, px"
    app = calibrated(app, **straight_and_raw.ENTRIES)
    assert "Each frame is rectified already: rows differ by 0.0" in captions(app)
    assert not app.error
    assert player(app)["legends"][0]["title"] == "disparity, px, and distance"
    # Nothing is computed anew after a visit to another page.
    before = work_of(app)
    app.switch_page(CALIBRATE).run()
    app.switch_page(DRIVING).run()
    assert work_of(app) is before


@pytest.mark.parametrize(
    ("found", "first", "count", "warned"),
    [((300, 32), 240, 16, "up to about 332"), ((10, 240), 10, 240, ""), ((-16, 48), 0, 48, "down to about −16")],
)
def test_a_range_beyond_the_files_of_maps_is_bounded_and_told_of(monkeypatch, found, first, count, warned):
    monkeypatch.setattr(inputs, "diagnose_sequence", lambda drive: Diagnosis((), None, found))
    app = finished(opened(archive(straight_and_raw.straight_pair(seed=count), count=1)))
    smallest = labelled(app.number_input, "Smallest disparity, px")
    assert (smallest.value, labelled(app.number_input, "Disparities searched").value) == (first, count)
    assert any(warned in one.value for one in app.warning) if warned else not app.warning
    finished(smallest.set_value(200).run())
    assert labelled(app.number_input, "Disparities searched").value <= 48
    assert not any(player(app)["problems"])
