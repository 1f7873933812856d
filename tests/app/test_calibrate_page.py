"""The calibration page: its example, files matched by name, corrections, and downloads."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from streamlit.testing.v1 import AppTest
from streamlit.testing.v1.element_tree import NumberInput

from stereolag.geometry.boards import Board
from stereolag.geometry.calibrating import StereoCalibration
from stereolag.geometry.calibration import Calibration
from stereolag.geometry.drawn_boards import drawn_pairs
from stereolag.ui import calibrate
from stereolag.ui.depth.preparing import OWN_CALIBRATION
from stereolag.ui.depth.view import HANDED
from tests.app import uploads
from tests.app.driving import zipped_frames
from tests.app.pages import CALIBRATE, DEPTH, finished, linked, moved, open_page
from tests.app.reading import controls, labelled, numbers

ONE_VISITOR = True

SQUARE, SQUARE_MM = "calibrate.square.own", 30.0
OTHER = 12
"""A number of columns that the board does not have."""


@cache
def files() -> dict[str, bytes]:
    whole, smaller = calibrate.drawn_rig(), np.diag([0.75, 0.75, 1.0])
    left, right = smaller @ whole.left_matrix, smaller @ whole.right_matrix
    rig = replace(whole, left_matrix=left, right_matrix=right, width=336, height=252)
    pairs = drawn_pairs(rig, Board(6, 4), 4, square_m=SQUARE_MM / 1000, seed=4)
    return {
        f"{side}{number:02}.png": uploads.png(picture)
        for number, pair in enumerate(pairs, start=1)
        for side, picture in zip(("left", "right"), pair, strict=True)
    }


def given(*contents: tuple[str, bytes]) -> AppTest:
    app = moved(linked(CALIBRATE), {"calibrate": "own"})
    app.file_uploader(key="calibrate.files").set_value([(name, data, "image/png") for name, data in contents]).run()
    finished(app)
    return finished(moved(app, {SQUARE: SQUARE_MM})) if SQUARE in controls(app) else app


def own() -> AppTest:
    """Return the page with four pairs, whose board is the same to all tests, and two files that belong to none."""
    return given(*files().items(), ("left99.png", files()["left01.png"]), ("a.pdf", b"%PDF"))


def columns(app: AppTest) -> NumberInput:
    return labelled(app.number_input, "Corners across")


def said(app: AppTest) -> str:
    return " ".join(element.value for kind in (app.caption, app.info, app.warning, app.markdown) for element in kind)


def test_the_example_is_calibrated_and_held_to_the_camera_that_drew_it() -> None:
    app = finished(open_page(CALIBRATE))
    assert not app.error
    assert app.header[0].value.startswith("Calibrated from 5 of 6 pairs: 0.0")
    assert float(numbers(app)["Reprojection error"].split()[0]) < 0.1
    assert "Left out: pair 4 – it contradicts the others" in said(app)
    assert "drawn by this app" in said(app)
    assert len(app.get("plotly_chart")) == 1
    for part, kind, count in (
        ("Corners", "image", 2),
        ("Rectified", "image", 1),
        ("Where the board has been", "image", 2),
        ("Take away", "download_button", 4),
    ):
        app.session_state["calibrate.part"] = part
        assert len(app.run().get(kind)) == count, part


def test_pairs_are_matched_by_name_their_board_guessed_and_one_left_out_by_a_click() -> None:
    app = own()
    assert "Not used, as they have no partner or are not pictures: “a.pdf”, “left99.png”." in said(app)
    assert [box.value for box in app.number_input][:2] == [6, 4]
    assert "4 of 4" in app.header[0].value
    before = numbers(app)["Baseline"]
    counting = next(group for group in app.button_group if group.key and group.key.startswith("calibrate.count"))
    counting.set_value([0, 1, 3]).run()
    assert "3 of 4" in app.header[0].value
    moved(app, {SQUARE: 60.0})
    assert float(numbers(app)["Baseline"].split()[0]) == pytest.approx(2 * float(before.split()[0]), rel=0.02)
    # What was said of board and pairs outlives a visit to another page.
    app.switch_page("app.py").run()
    app = finished(app.switch_page(CALIBRATE).run())
    assert "3 of 4" in app.header[0].value
    columns(app).set_value(OTHER).run()
    app.switch_page("app.py").run()
    app.switch_page(CALIBRATE).run()
    assert columns(app).value == OTHER


def test_no_length_is_given_before_the_square_is_measured() -> None:
    app = moved(own(), {SQUARE: None})
    assert "every length follows from it" in said(app)
    assert not app.header
    assert len(app.get("image")) == 2


def test_a_board_of_another_size_is_answered_with_what_to_check() -> None:
    app = own()
    finished(columns(app).set_value(OTHER).run())
    assert "0 of 4 pairs can be used" in app.error[0].value
    assert "is that its size?" in app.error[0].value
    assert not app.header


def test_pairs_that_contradict_each_other_give_no_calibration_and_are_shown() -> None:
    rights = [files()[f"right{number:02}.png"] for number in range(1, 5)]
    mixed = files() | {f"right{number:02}.png": rights[number % 4] for number in range(1, 5)}
    app = given(*mixed.items())
    assert "contradict each other" in app.error[0].value
    assert not app.header
    assert len(app.get("image")) == 2


def test_files_that_cannot_be_used_are_refused_with_a_sentence() -> None:
    app = given(("left1.png", b"no picture"), ("right1.png", b"none"))
    assert "accepted are" in app.error[0].value
    assert not app.header


def test_pictures_in_folders_of_a_zip_without_a_board_ask_for_its_size() -> None:
    noise = {side: [uploads.png(uploads.texture(90, 120, seed))] for seed, side in enumerate(("left", "right"))}
    app = given(("pairs.zip", zipped_frames(noise)))
    assert "No chessboard or ChArUco board is seen" in app.warning[0].value
    assert not app.header


def test_a_board_that_is_not_flat_is_told_once_it_matters() -> None:
    flat = Board(3, 2).points()
    result = StereoCalibration(Calibration(500.0, 0.1), Board(3, 2), 0.02, (), 0.1, 0.1, 0.6, 0.6, 0.001, flat)
    corner_up = flat + np.outer(np.arange(6) == 0, (0, 0, 0.05))
    told, *others = calibrate.weaknesses([], replace(result, points=corner_up))
    assert told.startswith("The corners of the board are up to 1 mm off a flat, even grid")
    assert others == calibrate.weaknesses([], result)


def test_the_calibration_is_kept_for_the_depth_page_in_this_session_alone() -> None:
    app = own()
    app.session_state[HANDED] = "a frame of a drive, which the calibration must not lie behind"
    app.button(key="calibrate.use").click().run()
    assert HANDED not in app.session_state
    np.testing.assert_allclose(
        app.session_state[OWN_CALIBRATION].rig.translation, calibrate.drawn_rig().translation, atol=1e-3
    )
    app.switch_page(DEPTH).run()
    assert "the calibration you made on the page Calibrate" in said(app)
    assert not any("gone" in warning.value for warning in app.warning)
    app.button(key=f"{OWN_CALIBRATION}.remove").click().run()
    assert OWN_CALIBRATION not in app.session_state
