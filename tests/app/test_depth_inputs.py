"""The pair that is matched: the changes made to a visitor's files, and the sentences about them."""

from __future__ import annotations

import json
from typing import Any

import numpy as np
import pytest
import straight_and_raw
from streamlit.testing.v1 import AppTest

from stereolag.core.typography import typeset
from tests.app import keys, uploads
from tests.app.depth_view import LEFT, RIGHT, given, own_files, shown
from tests.app.pages import captions

pytestmark = pytest.mark.usefixtures("small_pairs")
ONE_VISITOR = True


TRUTH = np.full((120, 200), 5 * 256, dtype=np.uint16)
RIG = {
    "M1": [[180, 0, 99.5], [0, 180, 59.5], [0, 0, 1]],
    "D1": [-0.1, 0.01, 0, 0, 0],
    "M2": [[180, 0, 99.5], [0, 180, 59.5], [0, 0, 1]],
    "D2": [-0.1, 0.01, 0, 0, 0],
    "R": [[1, 0, 0], [0, 1, 0], [0, 0, 1]],
    "T": [-100, 0, 0],
    "image_width": 200,
    "image_height": 120,
}
MIDDLEBURY = """cam0=[400 0 200; 0 400 120; 0 0 1]
cam1=[400 0 210; 0 400 120; 0 0 1]
doffs=10
baseline=193.001
width=400
height=240
ndisp=64
"""


def inputs() -> None:
    import streamlit as st

    from stereolag.stereo.opencv import StereoBM
    from stereolag.stereo.windows.matcher import CorrelationMatcher
    from stereolag.ui.depth.inputs import choose_pair
    from stereolag.ui.matcher_controls import ask_matcher, matcher_as_set

    pair = choose_pair()
    shown = [ask_matcher(matcher_as_set(method, pair)) for method in (StereoBM, CorrelationMatcher)]
    st.session_state["shown"] = pair, *shown


def own(**files: tuple[str, bytes]) -> AppTest:
    pair = {"left": ("l.png", uploads.png(LEFT)), "right": ("r.png", uploads.png(RIGHT))}
    return given(own_files(inputs), **(pair | files))


def name(app: AppTest) -> str:
    """Return the name of the pair beside the heading."""
    assert not app.exception
    return next(text.value for text in app.markdown if text.value.startswith("**"))


def test_the_name_beside_the_heading_is_that_of_the_pair_whose_maps_are_shown() -> None:
    app = AppTest.from_function(inputs, default_timeout=60).run()
    app.button_group(key="pairs").set_value("square").run()
    square = name(app)
    app.button_group(key="pairs").set_value("own").run()
    assert name(app) == square
    given(app, left=("l.png", uploads.png(LEFT)))
    assert name(app) == square
    given(app, right=("r.png", uploads.png(RIGHT)))
    assert name(app) == "**Your own pair**"
    app.run()
    assert name(app) == "**Your own pair**"
    app.file_uploader(key="pairs.right").set_value([]).run()
    assert name(app) == square
    given(app, right=("r.png", uploads.png(RIGHT)))
    assert name(app) == "**Your own pair**"


def test_files_that_are_refused_are_not_called_an_example() -> None:
    app = given(own_files(inputs), left=("l.png", b"nothing"))
    assert app.error
    assert name(app) == "**Your own pair**"


@pytest.mark.parametrize("width", [400, 401])
def test_a_side_by_side_picture_is_split_and_an_odd_width_said(width: int) -> None:
    beside = np.concatenate([LEFT, LEFT[:, : width - 400], RIGHT], axis=1)
    app = given(own_files(inputs, "beside"), beside=("both.png", uploads.png(beside)))
    np.testing.assert_array_equal(shown(app).left, LEFT)
    np.testing.assert_array_equal(shown(app).right, RIGHT)
    assert "split down the middle" in captions(app)
    assert (typeset("its width of 401 px is odd") in captions(app).lower()) == (width == 401)


def test_both_views_in_the_left_image_need_no_right_one() -> None:
    straight = straight_and_raw.straight_pair()
    app = given(own_files(inputs), left=("both.png", uploads.png(np.concatenate(straight, axis=0))))
    np.testing.assert_array_equal(shown(app).right, straight[1])
    assert "split into upper and lower half" in captions(app)


STRAIGHT, UNDO = straight_and_raw.straight_pair(), "pairs.rectifying.undo"


def with_both_cameras(pictures: tuple[np.ndarray, np.ndarray], **more: np.ndarray) -> AppTest:
    entries = straight_and_raw.ENTRIES | more
    file = json.dumps({name: np.asarray(value).tolist() for name, value in entries.items()}).encode()
    left, right = (("p.png", uploads.png(picture)) for picture in pictures)
    return own(left=left, right=right, calibration=("both.json", file))


def test_a_rectified_pair_is_left_so_with_the_calibration_of_both_cameras_and_that_can_be_undone() -> None:
    app = with_both_cameras(STRAIGHT)
    np.testing.assert_array_equal(shown(app).left, STRAIGHT[0])
    calibration = shown(app).calibration
    assert calibration is not None
    assert calibration.rig is None
    assert calibration.baseline_m == pytest.approx(np.linalg.norm(straight_and_raw.T))
    assert "The pair is rectified already: rows differ by 0.0" in captions(app)
    app.button(key=UNDO).click().run()
    assert not np.array_equal(shown(app).left, STRAIGHT[0])
    assert "undistorted and rectified with its calibration, as you said: rows differ by " in captions(app)
    app.button(key=UNDO).click().run()
    np.testing.assert_array_equal(shown(app).left, STRAIGHT[0])


def test_the_frame_is_asked_where_the_file_does_not_say_how_it_was_rectified() -> None:
    raw = straight_and_raw.raw_pair()
    app = with_both_cameras(raw)
    at_first = shown(app)
    app.slider(key="pairs.alpha").set_value(1.0).run()
    assert shown(app).id != at_first.id
    told = with_both_cameras(raw, **straight_and_raw.RECTIFYING)
    assert all(slider.key != "pairs.alpha" for slider in told.slider)


def test_files_of_a_calibration_are_read_together_and_told_apart_by_their_names() -> None:
    def camera(number: int) -> bytes:
        parts = {"mtx": straight_and_raw.ENTRIES[f"M{number}"], "dist": straight_and_raw.ENTRIES[f"D{number}"]}
        return json.dumps({name: np.asarray(part).tolist() for name, part in parts.items()}).encode()

    pose = json.dumps({"R": straight_and_raw.R.tolist(), "T": straight_and_raw.T.tolist()}).encode()
    files = [
        (name, data, "application/json")
        for name, data in {"right.json": camera(2), "left.json": camera(1), "pose.json": pose}.items()
    ]
    app = own(left=("l.png", uploads.png(STRAIGHT[0])), right=("r.png", uploads.png(STRAIGHT[1])))
    app.file_uploader(key="pairs.calibration").set_value(files[:2]).run()
    assert "lacks rotation (R), translation (T); give the file that holds it" in app.error[0].value
    app.file_uploader(key="pairs.calibration").set_value(files).run()
    assert not app.error
    known = app.session_state["pairs.calibration.state"].kept.upload.content
    np.testing.assert_array_equal(known.rig.left_matrix, straight_and_raw.M1)


RANGE = "search.rectified.num_disparities"


def disparities(app: AppTest) -> int:
    assert not app.exception
    matcher = app.session_state["shown"][2]
    return int(matcher.search.num_disparities)


def set_range(app: AppTest, count: int) -> None:
    slider = next(one for one in app.slider if one.key and RANGE in one.key)
    slider.set_value(count).run()
    assert disparities(app) == count


@pytest.mark.parametrize(
    ("key", "file", "moved"),
    [
        ("calibration", ("calib.txt", MIDDLEBURY.encode()), True),
        ("calibration", ("rig.json", json.dumps(RIG).encode()), False),
        ("calibration", ("plain.json", b'{"focal_px": 300, "baseline_m": 0.2, "num_disparities": 24}'), False),
        ("truth", ("t.png", uploads.png(TRUTH)), True),
    ],
    ids=["calib.txt", "rig", "plain", "truth"],
)
def test_what_is_added_later_leaves_the_range_in_use(key: str, file: tuple[str, bytes], moved: bool) -> None:
    app = own()
    if moved:
        set_range(app, 112)
    before = disparities(app)
    given(app, **{key: file})
    assert disparities(app) == before
    app.button_group(key="pairs.size").set_value("1/2").run()
    assert disparities(app) == before // 2
    app.button_group(key="pairs.size").set_value("Full").run()
    assert disparities(app) == before


def test_a_baseline_beyond_belief_is_doubted_and_the_unit_asked_for() -> None:
    in_millimetres = RIG | {"T": (1000 * straight_and_raw.T).tolist()}
    app = own(calibration=("rig.json", json.dumps(in_millimetres).encode()))
    assert any(typeset("in millimetres, the baseline is 0.12 m") in one.value for one in app.warning)
    unit = app.segmented_control(key="pairs.unit")
    assert unit.label.startswith("Which unit are its lengths in?")
    unit.set_value("mm").run()
    assert typeset("baseline 0.12 m, 64 disparities reach from") in captions(app)
    assert not any("millimetres" in one.value for one in app.warning)


def test_two_typed_numbers_are_a_calibration() -> None:
    app = own()
    assert shown(app).calibration is None
    app.number_input(key="pairs.focal").set_value(700.0)
    app.number_input(key="pairs.baseline").set_value(0.12).run()
    calibration = shown(app).calibration
    assert calibration is not None
    assert (calibration.focal_px, calibration.baseline_m) == (700, 0.12)


def test_size_changes_the_settings_too_and_they_are_as_before_unless_moved_at_another_size() -> None:
    def at(size: str) -> tuple[Any, ...]:
        app.button_group(key="pairs.size").set_value(size).run()
        assert not app.exception
        pair, block_matcher, correlation = app.session_state["shown"]
        return pair, block_matcher, correlation

    app = own(calibration=("calib.txt", MIDDLEBURY.encode()))
    app.slider(key=keys.WINDOW).set_value(30).run()
    first = app.session_state["shown"][1:]
    pair, block_matcher, correlation = at("1/2")
    assert (pair.left.shape, pair.num_disparities) == ((60, 100, 3), 16)
    assert (correlation.window_size, correlation.search.num_disparities) == (15, 16)
    assert block_matcher.num_disparities == 16
    assert "Shown at 1/2 of its size: 100 × 60 of 200 × 120 pixels." in captions(app)
    for size in ("1/4", "1/2", "Full"):
        pair, *settings = at(size)
    assert (pair.left.shape, *settings) == (LEFT.shape, *first)
    at("1/2")
    app.slider(key=keys.WINDOW).set_value(19).run()
    _, block_matcher, correlation = at("Full")
    assert (block_matcher, correlation.window_size) == (first[0], 38)
