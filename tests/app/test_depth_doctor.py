"""The input doctor's panel: its sentences and its buttons."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from types import MappingProxyType

import numpy as np
import pytest
import streamlit as st
from ailing_pairs import ILLS, REMEDIES, barrel
from streamlit.testing.v1 import AppTest

from stereolag.assess.findings import FindingCode, Remedy
from stereolag.figures.legends import Colours
from stereolag.pair import Pair, PairId, Preparation, resized
from stereolag.pair_sources import example_pair
from stereolag.samples import stereo_pairs
from stereolag.stereo.opencv import StereoBM
from stereolag.ui.depth.preparing import HEALTHY, chosen_remedies, prepared, show_doctor
from stereolag.ui.depth.view import DepthView
from stereolag.ui.matcher_controls import ask_matcher, control_state
from tests.app import keys
from tests.app.pages import DEPTH, finished, open_page, page_of


def panel() -> None:
    pair = st.session_state["pair"]
    pair = prepared(pair, Preparation(remedies=chosen_remedies(pair.id.untreated)))
    matcher = ask_matcher(control_state(StereoBM, pair))
    if matcher is not None:
        view = DepthView(pair, {"StereoBM": matcher.compute(pair.left, pair.right)}, Colours(0, 64))
        show_doctor(view, st.container())
    st.session_state["shown"] = pair


def cube(ill: str = "", given: Callable[..., tuple[np.ndarray, np.ndarray]] | None = None) -> Pair:
    """Return the cube at half its size as a visitor's own pair, made ill in this way."""
    whole = resized(example_pair(stereo_pairs()["cube"]), 2)
    left, right = given(whole.left, whole.right) if given else (whole.left, whole.right)
    return replace(whole, left=left, right=right, id=PairId(ill or "cube"), shared=False)


def opened(pair: Pair, remedies: Mapping[str, Sequence[str]] = MappingProxyType({})) -> AppTest:
    return page_of(panel, {"pair": pair, "depth.remedies": dict(remedies)})


def healthy(app: AppTest) -> bool:
    """Return whether the panel is the one green line with its details folded away."""
    return [box.proto.popover.label for box in app.get("popover")] == [HEALTHY]


# Which fault has which remedy, and what a remedy loses, is tested in tests/core.
@pytest.mark.parametrize("code", [FindingCode.EXPOSURE, FindingCode.BENT_ROWS])
def test_a_problem_is_fixed_by_a_click_and_comes_back_with_undo(code, monkeypatch):
    monkeypatch.setattr(st, "page_link", lambda *page, **shown: None)  # an app of one function has no other page
    remedy = REMEDIES.get(code, Remedy.RECTIFY)
    pair = cube(code, ILLS.get(code, lambda *views: (barrel(views[0], -0.3), barrel(views[1], -0.3))))
    app = opened(pair)
    assert app.warning[0].value.startswith("**Input doctor:**")
    app.button(key=f"depth.doctor.{remedy}").click().run()
    mended = app.session_state["shown"]
    assert mended.id.remedies == (remedy,)
    assert mended.digest != pair.digest
    assert mended.id.untreated == pair.id.untreated
    assert remedy not in [button.key.rpartition(".")[2] for button in app.button if "undo" not in button.key]
    said = " ".join(text.value for text in app.markdown)
    assert mended.remedies[0].sentence in said
    assert ("left out" in said) == (mended.truth is None)
    app.button(key=f"depth.doctor.undo.{remedy}").click().run()
    assert app.session_state["shown"] is pair
    assert app.warning


def test_the_same_remedy_twice_has_two_buttons_of_its_own() -> None:
    pair = cube("swapped", ILLS[FindingCode.SWAPPED])
    app = opened(pair)
    app.button(key="depth.doctor.swap_sides").click().run()
    assert app.session_state["shown"].id.remedies == (Remedy.SWAP_SIDES,)
    app.session_state["depth.remedies"] = {pair.id.untreated: (Remedy.SWAP_SIDES, Remedy.ALIGN_ROWS, Remedy.ALIGN_ROWS)}
    app.run()
    buttons = [button.key for button in app.button if "undo" in button.key]
    assert len(buttons) == len(set(buttons)) == len(app.session_state["shown"].remedies)
    for key in reversed(buttons):
        app.button(key=key).click().run()
    assert app.session_state["shown"] is pair


def test_the_range_is_set_in_the_controls() -> None:
    app = opened(cube())
    assert healthy(app)
    assert not app.warning
    app.slider(key=keys.setting("bm", "num_disparities", "cube")).set_value(16).run()
    assert any("too small a range" in text.value for text in app.markdown)
    app.button(key="depth.doctor.set_range").click().run()
    assert app.slider(key=keys.setting("bm", "num_disparities", "cube")).value == 32
    assert healthy(app)


def test_a_remedy_that_cannot_be_applied_is_answered_with_a_sentence() -> None:
    noise = np.random.default_rng(1).integers(0, 255, (2, 200, 300), dtype=np.uint8)
    app = opened(Pair(noise[0], noise[1], PairId("noise")), {"noise": ("align_rows",)})
    assert "features were matched" in app.error[0].value


def test_the_reports_preset_says_what_lies_outside_its_reach() -> None:
    app = open_page(DEPTH, {"pairs.size": "1/2"})
    assert not app.warning
    app.button(key=keys.preset_key("report")).click().run()
    assert finished(app).warning[0].value.startswith("**Input doctor:**")
    assert any("Search 32 disparities from 0" in button.label for button in app.button)
