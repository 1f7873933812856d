"""The driving page's use of the camera's calibration and of the disparity range that frames need."""

from __future__ import annotations

import json

import numpy as np
import pytest
import straight_and_raw
from streamlit.testing.v1 import AppTest

from stereolag.assess.diagnosis import Diagnosis
from stereolag.ui.depth.maps import HANDED
from stereolag.ui.driving import inputs
from stereolag.ui.driving.work import OPENED
from tests.app.driving import archive, finished, opened, player, work_of
from tests.app.pages import CALIBRATE, DRIVING, captions

pytestmark = pytest.mark.usefixtures("short_drive", "small_boards")
ONE_VISITOR = True


def with_both_cameras(app: AppTest) -> AppTest:
    entries = {name: np.asarray(value).tolist() for name, value in straight_and_raw.ENTRIES.items()}
    app.file_uploader(key="driving.calibration").set_value(
        [("both.json", json.dumps(entries).encode(), "application/json")]
    ).run()
    return finished(app)


def coverage(app: AppTest) -> float:
    chart = next(chart for chart in player(app)["charts"] if chart["name"] == "Coverage")
    return float(np.mean([one["values"] for one in chart["series"]]))


@pytest.mark.usefixtures("healthy_frames")
def test_raw_frames_are_rectified_with_the_calibration_and_that_can_be_undone() -> None:
    app = finished(opened(archive(straight_and_raw.raw_pair())))
    raw = coverage(app)
    app = with_both_cameras(app)
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
    other = {"focal_px": 500, "baseline_m": 0.1, "width": 640, "height": 640}
    app.file_uploader(key="driving.calibration").set_value(
        [("other.json", json.dumps(other).encode(), "application/json")]
    ).run()
    app = finished(app)
    (error,) = app.error
    assert "The calibration is for 640 × 640 pixels and the images are 320 × 240" in error.value
    assert error.value.endswith("The drive is processed without it.")
    assert player(app)["computed"] == 2
    assert player(app)["legends"][0]["title"] == "disparity, px"
    app = with_both_cameras(app)
    assert "Each frame is rectified already: rows differ by 0.0" in captions(app)
    assert not app.error
    assert player(app)["legends"][0]["title"] == "disparity, px, and distance"
    # Nothing is computed anew after a visit to another page, and the settings are as they were.
    next(box for box in app.number_input if box.label == "Disparities searched").set_value(96).run()
    app = finished(app)
    before = work_of(app)
    app.switch_page(CALIBRATE).run()
    app.switch_page(DRIVING).run()
    assert next(box for box in app.number_input if box.label == "Disparities searched").value == 96
    assert work_of(app) is before


@pytest.mark.parametrize(
    ("found", "first", "count", "warned"),
    [((300, 32), 240, 16, "up to about 332"), ((10, 240), 10, 240, ""), ((-16, 48), 0, 48, "down to about −16")],
)
def test_a_range_beyond_the_files_of_maps_is_bounded_and_told_of(
    monkeypatch: pytest.MonkeyPatch, found: tuple[int, int], first: int, count: int, warned: str
) -> None:
    monkeypatch.setattr(inputs, "diagnose_sequence", lambda drive: Diagnosis((), None, found))
    app = finished(opened(archive(straight_and_raw.straight_pair(seed=count), count=1)))
    boxes = {box.label: box for box in app.number_input}
    assert boxes["Smallest disparity, px"].value == first
    assert boxes["Disparities searched"].value == count
    assert any(warned in one.value for one in app.warning) if warned else not app.warning
    boxes["Smallest disparity, px"].set_value(200).run()
    app = finished(app)
    assert {box.label: box for box in app.number_input}["Disparities searched"].value <= 48
    assert not any(player(app)["problems"])
