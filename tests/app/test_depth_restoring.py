"""Restoring a downloaded result from one file, and stepping through many pairs with the same settings."""

import io
import json
import zipfile
from typing import Any

import cv2
import numpy as np
import pytest
import streamlit as st
from streamlit.testing.v1 import AppTest

from stereolag import SemiGlobalMatcher, StereoBM, StereoSGBM, read_image
from stereolag.io.disparities import pfm
from stereolag.io.images import image_png
from stereolag.io.settings import settings_json
from stereolag.pair import Preparation
from stereolag.pair_sources import read_bundle
from stereolag.stereo.matcher import DisparityMap, StereoMatcher
from stereolag.stereo.methods import METHODS
from stereolag.ui.depth.comparing import show_all_pairs, table_of
from stereolag.ui.depth.downloads import Download, archive, pair_files
from stereolag.ui.depth.inputs import choose_pair
from stereolag.ui.depth.maps import compute_map, shown_methods
from stereolag.ui.depth.tuning import JudgedPairs
from stereolag.ui.depth.view import DepthView, coloured_view
from stereolag.ui.matcher_controls import ask_matcher, control_state
from tests.app import keys
from tests.app.depth_view import LEFT, RIGHT, SCENE, own_files, pair_of, part_on_a_set, shown
from tests.app.pages import uploaded
from tests.app.reading import captions
from tests.app.uploads import pngs
from tests.archives import zipped


def page() -> None:
    pair = choose_pair()
    matchers = {method: ask_matcher(control_state(method, pair)) for method in METHODS}
    results: dict[str, DisparityMap] = {}
    for method in shown_methods():
        results |= compute_map(pair, matchers[method])
    view = coloured_view(pair, results)
    st.session_state["shown"] = pair, [*matchers.values()], view
    st.session_state["taken"] = archive(Download(view, next(iter(results))), pair_files)


def stepping(files: dict[str, bytes]) -> AppTest:
    return uploaded(own_files(page, "several"), "pairs", several=("pairs.zip", zipped(files)))


def settings(app: AppTest) -> dict[type[StereoMatcher], StereoMatcher]:
    return {type(matcher): matcher for matcher in app.session_state["shown"][1]}


def session_zip(**changes: Any) -> bytes:
    files = {
        "left.png": image_png(LEFT),
        "right.png": image_png(RIGHT),
        "truth.pfm": pfm(np.full((120, 200), 5.0, np.float32)),
        "camera.json": b'{"focal_px": 400.5, "baseline_m": 0.25}',
    }
    methods = StereoBM(num_disparities=32, block_size=13, min_disparity=-4), StereoSGBM(num_disparities=16, mode="hh")
    document = {
        "pair": {
            "files": dict(zip(("left", "right", "truth", "calibration"), files, strict=True)),
            "description": "A desk. ![x](http://e.org)",
            "history": ["It was rectified.", "<b>bold</b>"],
        },
        "methods": [json.loads(settings_json(one)) for one in methods],
        "shown": ["bm", "sgbm"],
        "size": "Full",
        "colours": {"low": -3.0, "high": 21.5, "palette": "turbo", "inverted": True},
    } | changes
    for entry in document["methods"]:
        entry.pop("stereolag", None)
    return zipped(files | {"session.json": json.dumps(document).encode()})


@pytest.mark.parametrize("box", ["left", "several"])
def test_a_session_opens_the_page_as_it_was(box: str) -> None:
    app = own_files(page, "several" if box == "several" else "files")
    uploaded(app, "pairs", **{box: ("stereolag-session.zip", session_zip())})
    pair = shown(app)
    assert np.array_equal([pair.left, pair.right], [LEFT, RIGHT])
    assert (pair.truth == 5).all()
    assert (pair.calibration.focal_px, pair.calibration.baseline_m) == (400.5, 0.25)
    found = settings(app)
    assert found[StereoBM] == StereoBM(num_disparities=32, block_size=13, min_disparity=-4)
    assert found[StereoSGBM] == StereoSGBM(num_disparities=16, mode="hh")
    view = app.session_state["shown"][2]
    assert (view.colours.low, view.colours.high) == (-3.0, 21.5)
    assert [*view.results] == ["StereoBM", "StereoSGBM"]
    said = " ".join(caption.value for caption in app.caption)
    assert "A desk. x" in said
    assert "It was rectified. bbold/b" in said
    # The settings are applied only once: later changes stay.
    app.slider(key=keys.setting("bm", "block_size")).set_value(21).run()
    assert settings(app)[StereoBM].block_size == 21


def test_what_is_taken_away_comes_back_from_a_reduced_preview_too() -> None:
    large = cv2.resize(SCENE, (820, 480), interpolation=cv2.INTER_CUBIC)
    app = uploaded(own_files(page), "pairs", **pngs(left=large[:, :-20], right=large[:, 20:]))
    app.button_group(key="pairs.size").set_value("1/2").run()
    app.slider(key=keys.BLOCK).set_value(13).run()
    before, pair = settings(app), shown(app)
    assert pair.left.shape == (240, 400, 3)
    data = app.session_state["taken"]
    again = uploaded(own_files(page), "pairs", left=("session.zip", data))
    np.testing.assert_array_equal(shown(again).left, pair.left)
    assert settings(again)[StereoBM].block_size == 13
    assert settings(again)[SemiGlobalMatcher] == before[SemiGlobalMatcher]
    with zipfile.ZipFile(io.BytesIO(data)) as whole:
        assert read_image(whole.read("left.png")).shape == (480, 800, 3)


def test_what_a_session_does_not_say_is_as_at_first() -> None:
    app = uploaded(own_files(page), "pairs", left=("s.zip", session_zip(methods=[], shown="x", size=3, colours=[])))
    assert settings(app)[StereoBM].block_size == StereoBM().block_size
    assert shown(app).left.shape == (120, 200, 3)


def test_pairs_are_stepped_through_with_the_settings_held() -> None:
    app = stepping(pair_of(1, 5) | pair_of(2, 9) | pair_of(10, 7))
    assert (shown(app).truth == 5).all()
    assert "“set/left1.png” is the left image, “set/right1.png” the right one." in captions(app)
    assert app.selectbox(key="pairs.step").options == ["1 of 3: 1", "2 of 3: 2", "3 of 3: 10"]
    app.slider(key=keys.BLOCK).set_value(13)
    app.slider(key=keys.setting("bm", "num_disparities", shown(app).id.searched)).set_value(32).run()
    app.button(key="pairs.step.1").click().run()
    assert (shown(app).truth == 9).all()
    assert (settings(app)[StereoBM].block_size, settings(app)[StereoBM].num_disparities) == (13, 32)
    app.selectbox(key="pairs.step").set_value(2).run()
    assert (shown(app).truth == 7).all()
    assert settings(app)[StereoBM].num_disparities == 32
    assert app.button(key="pairs.step.1").disabled


def test_a_pair_that_cannot_be_read_can_be_stepped_over() -> None:
    app = stepping(pair_of(1, 5) | pair_of(2, 9) | {"set/left1.png": b"nothing"})
    assert "Pair 1: This is not an image" in app.error[0].value
    app.button(key="pairs.step.1").click().run()
    assert (shown(app).truth == 9).all()


def test_a_table_tells_how_the_settings_do_on_every_pair() -> None:
    files = pair_of(1, 5) | pair_of(2, 9) | {"set/left3.png": b"nothing", "set/right3.png": b"nothing"}
    del files["set/disp2.pfm"]
    matchers = [StereoBM(num_disparities=16, block_size=9), StereoSGBM(num_disparities=16)]
    told: list[float] = []
    table = table_of(read_bundle([("pairs.zip", zipped(files))]), matchers, Preparation(), told.append)
    assert [*table.figures] == ["1: 1", "2: 2"]
    for row, known in zip(table.figures.values(), (True, False), strict=True):
        for name in ("StereoBM", "StereoSGBM"):
            bad, estimated = row[f"{name}: bad-2, %"], row[f"{name}: estimated bad-2, %"]
            assert (bad if known else estimated) < 45
            assert np.isnan(estimated if known else bad)
            assert 50 < row[f"{name}: coverage, %"] <= 100
            assert row[f"{name}: took"] > 0
    assert "This is not an image" in table.problems[0]
    assert np.diff(told).min() > -1e-9
    assert told[-1] == 1


def judge(view: DepthView) -> None:
    judged = JudgedPairs.of(view.pair)
    st.session_state["judged"] = [float(pair.truth.max()) for pair in judged], judged.sentence


def test_settings_are_judged_on_all_pairs_the_one_that_is_looked_at_first() -> None:
    app = part_on_a_set(judge)
    assert app.session_state["judged"][1] == ""
    files = pair_of(1, 5) | pair_of(2, 9) | pair_of(3, 7)
    uploaded(app, "pairs", several=("pairs.zip", zipped(files)))
    assert app.session_state["judged"] == ([5, 9, 7], "Settings are judged on **all 3 pairs together**, by the mean. ")
    app.button(key="pairs.step.1").click().run()
    assert app.session_state["judged"][0] == [9, 5, 7]


def test_the_table_is_computed_when_asked_for_and_again_for_other_settings() -> None:
    app = part_on_a_set(show_all_pairs)
    assert "needs several pairs" in app.info[-1].value
    uploaded(app, "pairs", several=("pairs.zip", zipped(pair_of(1, 5) | pair_of(2, 9))))
    assert not app.dataframe
    app.button(key="depth.all_pairs.start").click().run()
    table = app.dataframe[0].value
    assert [*table.index] == ["1: 1", "2: 2", "Mean"]
    assert table.loc["Mean", "StereoBM: bad-2, %"] < 40
    app.session_state["block"] = 15
    assert not app.run().dataframe
