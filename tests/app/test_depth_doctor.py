"""The input doctor's panel: its sentences and its buttons."""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from ailing_pairs import ILLS, REMEDIES, barrel
from streamlit.testing.v1 import AppTest

from stereolag.assess.diagnosis import FindingCode
from stereolag.assess.remedies import Remedy
from stereolag.pair import Pair, PairId, example_pair
from stereolag.samples import stereo_pairs
from stereolag.ui.depth.doctor import CALIBRATE, HEALTHY
from stereolag.ui.navigation import PAGES
from tests.app import keys

pytestmark = pytest.mark.usefixtures("small_pairs")


def panel() -> None:
    import streamlit as st

    from stereolag.figures.legends import Colours
    from stereolag.stereo.opencv import StereoBM
    from stereolag.ui.controls import ask_matcher
    from stereolag.ui.depth.doctor import show_doctor, with_chosen_remedies
    from stereolag.ui.depth.maps import DepthView

    pair = with_chosen_remedies(st.session_state["pair"])
    matcher = ask_matcher(StereoBM, pair)
    if matcher is not None:
        show_doctor(DepthView(pair, {"StereoBM": matcher.compute(pair.left, pair.right)}, Colours(0, 64)))
    st.session_state["shown"] = pair


def changed(name: str, **images: Any) -> Pair:
    example = example_pair(stereo_pairs()["cube"])
    given = {"left": example.left, "right": example.right} | images
    return Pair(
        given["left"],
        given["right"],
        PairId(name),
        truth=example.truth,
        visible=example.visible,
        calibration=example.calibration,
        num_disparities=64,
        description="A test.",
    )


def opened(pair: Pair) -> AppTest:
    app = AppTest.from_function(panel, default_timeout=60)
    app.session_state["pair"] = pair
    return app.run()


def ill_cube(code: FindingCode) -> Pair:
    cube = example_pair(stereo_pairs()["cube"])
    left, right = ILLS[code](cube.left, cube.right)
    return changed(code, left=left, right=right)


def healthy(app: AppTest) -> bool:
    """Return whether the panel is the one green line with its details folded away."""
    return [box.label for box in app.expander if "Input doctor" in box.label] == [HEALTHY]


def test_a_good_pair_is_one_green_line() -> None:
    app = opened(changed("cube"))
    assert not app.exception
    assert healthy(app)
    assert not app.warning


@pytest.mark.parametrize(("code", "remedy"), REMEDIES.items())
def test_each_problem_is_fixed_by_a_click_and_comes_back_with_undo(code: FindingCode, remedy: Remedy) -> None:
    pair = ill_cube(code)
    app = opened(pair)
    assert app.warning[0].value.startswith("**Input doctor:**")
    app.button(key=f"depth.doctor.{remedy}").click().run()
    assert not app.exception
    mended = app.session_state["shown"]
    assert mended.id.remedies == (remedy,)
    assert mended.digest != pair.digest
    assert mended.id.untreated == pair.id.untreated
    assert remedy not in [button.key.rpartition(".")[2] for button in app.button if "undo" not in button.key]
    app.button(key=f"depth.doctor.undo.{remedy}").click().run()
    assert app.session_state["shown"] is pair
    assert app.warning


def test_bent_rows_are_rectified_by_a_click_and_come_back_with_undo(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delitem(PAGES, CALIBRATE, raising=False)  # an app of one function has no other page to link to
    cube = example_pair(stereo_pairs()["cube"])
    pair = changed("bent", left=barrel(cube.left, -0.3), right=barrel(cube.right, -0.3))
    app = opened(pair)
    assert any("Rows bend" in text.value and "Calibrate" in text.value for text in app.markdown)
    app.button(key="depth.doctor.rectify").click().run()
    assert not app.exception
    mended = app.session_state["shown"]
    assert mended.truth is None
    assert mended.visible is None
    assert mended.calibration is None
    assert any("depth is relative" in text.value and "left out" in text.value for text in app.markdown)
    assert not any("Rows bend" in text.value for text in app.markdown)
    app.button(key="depth.doctor.undo.rectify").click().run()
    assert app.session_state["shown"] is pair


def test_a_picture_given_twice_is_said() -> None:
    cube = example_pair(stereo_pairs()["cube"])
    app = opened(changed("twice", left=cube.left, right=cube.left))
    assert not app.exception
    assert any("show the same view" in text.value for text in app.markdown)


def test_swapping_a_swapped_pair_undoes_it() -> None:
    pair = ill_cube(FindingCode.SWAPPED)
    app = opened(pair)
    app.session_state["depth.remedies"] = {pair.id.untreated: (Remedy.SWAP_SIDES, Remedy.ALIGN_ROWS, Remedy.ALIGN_ROWS)}
    app.run()
    assert not app.exception  # the same remedy applied twice has two undo buttons
    buttons = [button.key for button in app.button if "undo" in button.key]
    assert len(buttons) == len(set(buttons)) == len(app.session_state["shown"].remedies)
    for key in reversed(buttons):
        app.button(key=key).click().run()
    assert app.session_state["shown"] is pair


def test_what_no_longer_holds_is_dropped_and_said() -> None:
    app = opened(ill_cube(FindingCode.SWAPPED))
    app.button(key="depth.doctor.swap_sides").click().run()
    mended = app.session_state["shown"]
    assert mended.truth is None
    assert mended.visible is None
    assert mended.calibration is not None
    assert any("The ground truth belongs to the other image" in text.value for text in app.markdown)

    app = opened(ill_cube(FindingCode.ROTATION))
    app.button(key="depth.doctor.level").click().run()
    mended = app.session_state["shown"]
    assert mended.truth is not None
    assert mended.calibration is None
    assert any("depth is relative" in text.value for text in app.markdown)


def test_the_range_is_set_in_the_controls() -> None:
    app = opened(changed("cube"))
    app.slider(key=keys.setting("bm", "num_disparities", "cube")).set_value(16).run()
    assert any("too small a range" in text.value for text in app.markdown)
    app.button(key="depth.doctor.set_range").click().run()
    assert app.slider(key=keys.setting("bm", "num_disparities", "cube")).value == 64
    assert healthy(app)


def test_a_remedy_that_cannot_be_applied_is_answered_with_a_sentence() -> None:
    noise = np.random.default_rng(1).integers(0, 255, (2, 200, 300), dtype=np.uint8)
    app = AppTest.from_function(panel, default_timeout=60)
    app.session_state["pair"] = Pair(noise[0], noise[1], PairId("noise"))
    app.session_state["depth.remedies"] = {"noise": ("align_rows",)}
    app.run()
    assert not app.exception
    assert "features were matched" in app.error[0].value


def test_the_reports_preset_says_what_lies_outside_its_reach(open_page: Callable[..., AppTest]) -> None:
    app = open_page("pages/3_Depth_maps.py", {"pairs.size": "1/2"})
    assert not app.warning
    app.button(key=keys.preset_key("report")).click().run()
    end = time.monotonic() + 60
    while not app.warning and time.monotonic() < end:  # its map waits for its turn
        time.sleep(0.2)
        app.run()
    assert not app.exception
    assert app.warning[0].value.startswith("**Input doctor:**")
    assert any("Search 32 disparities from 0" in button.label for button in app.button)
