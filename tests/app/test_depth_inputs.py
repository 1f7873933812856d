"""The pair that is matched: the changes made to a visitor's files, and the sentences about them."""

import json
from typing import Any

import numpy as np
import pytest
import straight_and_raw
import streamlit as st
from streamlit.testing.v1 import AppTest

from stereolag import CorrelationMatcher, StereoBM
from stereolag.core.typography import typeset
from stereolag.ui.depth.inputs import choose_pair
from stereolag.ui.matcher_controls import ask_matcher, control_state
from tests.app import keys, uploads
from tests.app.depth_view import LEFT, RIGHT, own_files, shown
from tests.app.pages import page_of, uploaded
from tests.app.reading import captions
from tests.app.uploads import pngs

ONE_VISITOR = True

TRUTH = np.full((120, 200), 5 * 256, dtype=np.uint16)
CAMERA, LENS = [[180, 0, 99.5], [0, 180, 59.5], [0, 0, 1]], [-0.1, 0.01, 0, 0, 0]
RIG: dict[str, Any] = {"M1": CAMERA, "D1": LENS, "M2": CAMERA, "D2": LENS, "R": np.eye(3).tolist(), "T": [-100, 0, 0]}
RIG |= {"image_width": 200, "image_height": 120}
MIDDLEBURY = """cam0=[400 0 200; 0 400 120; 0 0 1]
cam1=[400 0 210; 0 400 120; 0 0 1]
doffs=10
baseline=193.001
width=400
height=240
ndisp=64
"""


def inputs() -> None:
    pair = choose_pair()
    shown = [ask_matcher(control_state(method, pair)) for method in (StereoBM, CorrelationMatcher)]
    st.session_state["shown"] = pair, *shown


PAIR = pngs(left=LEFT, right=RIGHT)


def own(**files: tuple[str, bytes]) -> AppTest:
    return uploaded(own_files(inputs), "pairs", **PAIR | files)


def as_json(**entries: Any) -> bytes:
    return json.dumps({name: np.asarray(value).tolist() for name, value in entries.items()}).encode()


def name(app: AppTest) -> str:
    """Return the name of the pair beside the heading."""
    return next(text.value for text in app.markdown if text.value.startswith("**"))


def test_the_name_beside_the_heading_is_that_of_the_pair_whose_maps_are_shown() -> None:
    app = page_of(inputs)
    app.button_group(key="pairs").set_value("square").run()
    square = name(app)
    app.button_group(key="pairs").set_value("own").run()
    assert name(app) == square
    for side, shown_then in (("left", square), ("right", "**Your own pair**")):
        uploaded(app, "pairs", **{side: PAIR[side]})
        assert name(app) == shown_then
    app.run()
    assert name(app) == "**Your own pair**"
    app.file_uploader(key="pairs.right").set_value([]).run()
    assert name(app) == square
    uploaded(app, "pairs", right=PAIR["right"])
    assert name(app) == "**Your own pair**"


def test_files_that_are_refused_are_not_called_an_example() -> None:
    app = uploaded(own_files(inputs), "pairs", left=("l.png", b"nothing"))
    assert app.error
    assert name(app) == "**Your own pair**"


@pytest.mark.parametrize("width", [400, 401])
def test_a_side_by_side_picture_is_split_and_an_odd_width_said(width: int) -> None:
    beside = np.concatenate([LEFT, LEFT[:, : width - 400], RIGHT], axis=1)
    app = uploaded(own_files(inputs, "beside"), "pairs", **pngs(beside=beside))
    assert np.array_equal([shown(app).left, shown(app).right], [LEFT, RIGHT])
    assert "split down the middle" in captions(app)
    assert (typeset("its width of 401 px is odd") in captions(app).lower()) == (width == 401)


def test_both_views_in_the_left_image_need_no_right_one() -> None:
    straight = straight_and_raw.straight_pair()
    app = uploaded(own_files(inputs), "pairs", **pngs(left=np.concatenate(straight, axis=0)))
    np.testing.assert_array_equal(shown(app).right, straight[1])
    assert "split into its upper and lower halves" in captions(app)


STRAIGHT, UNDO = straight_and_raw.straight_pair(), "pairs.rectifying.undo"


def with_both_cameras(pictures: tuple[np.ndarray, np.ndarray], **more: np.ndarray) -> AppTest:
    left, right = pictures
    both = "both.json", as_json(**straight_and_raw.ENTRIES, **more)
    return own(**pngs(left=left, right=right), calibration=both)


def test_a_rectified_pair_is_left_so_with_the_calibration_of_both_cameras_and_that_can_be_undone() -> None:
    app = with_both_cameras(STRAIGHT)
    np.testing.assert_array_equal(shown(app).left, STRAIGHT[0])
    assert "The pair is rectified already: rows differ by 0.0" in captions(app)
    app.button(key=UNDO).click().run()
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
    entries = straight_and_raw.ENTRIES
    left, right = (as_json(mtx=entries[f"M{number}"], dist=entries[f"D{number}"]) for number in (1, 2))
    named = {"right.json": right, "left.json": left, "pose.json": as_json(R=straight_and_raw.R, T=straight_and_raw.T)}
    files = [(name, data, "application/json") for name, data in named.items()]
    app = own(**pngs(left=STRAIGHT[0], right=STRAIGHT[1]))
    app.file_uploader(key="pairs.calibration").set_value(files[:2]).run()
    assert "lacks rotation (R), translation (T); give the file that holds it" in app.error[0].value
    app.file_uploader(key="pairs.calibration").set_value(files).run()
    assert not app.error
    known = app.session_state["pairs.calibration.state"].kept.upload.content
    np.testing.assert_array_equal(known.rig.left_matrix, straight_and_raw.M1)


RANGE = "search.rectified.num_disparities"


def disparities(app: AppTest) -> int:
    return int(app.session_state["shown"][2].search.num_disparities)


@pytest.mark.parametrize(
    ("key", "file", "moved"),
    [
        ("calibration", ("calib.txt", MIDDLEBURY.encode()), True),
        ("calibration", ("rig.json", as_json(**RIG)), False),
        ("calibration", ("plain.json", b'{"focal_px": 300, "baseline_m": 0.2, "num_disparities": 24}'), False),
        ("truth", ("truth.png", uploads.png(TRUTH)), True),
    ],
    ids=["calib.txt", "rig", "plain", "truth"],
)
def test_what_is_added_later_leaves_the_range_in_use(key: str, file: tuple[str, bytes], moved: bool) -> None:
    app = own()
    if moved:
        next(one for one in app.slider if one.key and RANGE in one.key).set_value(112).run()
        assert disparities(app) == 112
    before = disparities(app)
    uploaded(app, "pairs", **{key: file})
    assert disparities(app) == before
    for size, count in (("1/2", before // 2), ("Full", before)):
        app.button_group(key="pairs.size").set_value(size).run()
        assert disparities(app) == count


def test_a_baseline_beyond_belief_is_doubted_and_the_unit_asked_for() -> None:
    app = own(calibration=("rig.json", as_json(**RIG | {"T": 1000 * straight_and_raw.T})))
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
    assert (calibration.focal_px, calibration.baseline_m) == (700, 0.12)


def test_size_changes_the_settings_too_and_they_are_as_before_unless_moved_at_another_size() -> None:
    def at(size: str) -> tuple[Any, ...]:
        app.button_group(key="pairs.size").set_value(size).run()
        pair_and_matchers: tuple[Any, ...] = app.session_state["shown"]
        return pair_and_matchers

    app = own(calibration=("calib.txt", MIDDLEBURY.encode()))
    app.slider(key=keys.WINDOW).set_value(30).run()
    first = app.session_state["shown"][1:]
    pair, block_matcher, correlation = at("1/2")
    assert (correlation.window_size, correlation.search.num_disparities) == (15, pair.num_disparities)
    assert block_matcher.num_disparities == pair.num_disparities == 16
    assert "Shown at 1/2 of its size: 100 × 60 of 200 × 120 pixels." in captions(app)
    for size in ("1/4", "1/2", "Full"):
        pair, *settings = at(size)
    assert (pair.left.shape, *settings) == (LEFT.shape, *first)
    at("1/2")
    app.slider(key=keys.WINDOW).set_value(19).run()
    _, block_matcher, correlation = at("Full")
    assert (block_matcher, correlation.window_size) == (first[0], 38)
