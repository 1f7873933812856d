"""A search or a sweep on a set of pairs: which pair it belongs to, and when it becomes void."""

from __future__ import annotations

from typing import Any

import pytest
from streamlit.testing.v1 import AppTest

from stereolag.core.typography import typeset
from stereolag.pair import Rows
from stereolag.ui.depth.calibrating import alpha_key, rows_key
from stereolag.ui.keys import PAIR, SIZE
from tests.app.test_depth_restoring import given, packed, pair_of


def sweeping_on_a_set() -> None:
    from stereolag import StereoBM
    from stereolag.figures.legends import Colours
    from stereolag.ui.depth.inputs import choose_pair
    from stereolag.ui.depth.maps import DepthView
    from stereolag.ui.depth.tuning import show_sweep

    pair = choose_pair()
    matcher = StereoBM(num_disparities=16, block_size=9)
    show_sweep(DepthView(pair, {matcher.title: matcher.compute(pair.left, pair.right)}, Colours(0, 16)))


def swept() -> AppTest:
    """Return the page after a sweep on the first of two pairs."""
    app = AppTest.from_function(sweeping_on_a_set, default_timeout=120)
    app.session_state["pairs"] = "own"
    app.session_state["pairs.arrangement"] = "several"
    app.session_state["depth.head"] = True
    app.run()
    given(app, "several", ("pairs.zip", packed(pair_of(1, 5) | pair_of(2, 9))))
    for box, values in zip(app.text_input, ("16", "9, 15"), strict=True):
        box.set_value(values)
    app.run().button(key="depth.sweep.start").click().run()
    app.session_state["depth.sweep"].job.result()
    app.run()
    assert not app.exception
    assert len(app.get("plotly_chart")) == 2
    return app


def said(app: AppTest) -> str:
    assert not app.exception
    return " ".join(caption.value for caption in app.caption)


def test_the_small_maps_of_a_sweep_on_a_set_say_of_which_pair_they_are() -> None:
    app = swept()
    assert typeset("Left: the maps of pair 1 of 2.") in said(app)
    app.button(key="pairs.step.1").click().run()
    assert len(app.get("plotly_chart")) == 2
    assert typeset("Left: the maps of pair 1 of 2, not of the pair in use.") in said(app)


@pytest.mark.parametrize(
    ("key", "value"),
    [(rows_key(PAIR), Rows.RECTIFIED), (alpha_key(PAIR), 0.5), (SIZE, "Full")],
    ids=["choice", "frame", "size"],
)
def test_another_preparation_of_the_set_makes_a_sweep_void(key: str, value: Any) -> None:
    app = swept()
    app.session_state[key] = value
    app.run()
    assert not app.exception
    assert not app.get("plotly_chart")


def remedied() -> None:
    from dataclasses import replace

    import streamlit as st

    from stereolag.assess.remedies import Remedy
    from stereolag.core.jobs import Estimate
    from stereolag.pair import PairId
    from stereolag.ui.depth.pair_sets import begin_job, job_on
    from tests.app.depth_view import small_view

    one = small_view().pair
    first = replace(one, id=PairId("set 0", collection="set"))
    second = replace(one, id=PairId("set 1", collection="set"))
    treated = replace(one, id=replace(first.id, remedies=(Remedy.SWAP_SIDES,)))
    if "begun" not in st.session_state:
        st.session_state["begun"] = True
        begin_job(first, "job", None, lambda job: None, Estimate(0, 0.0))
    pair = {"first": first, "second": second, "treated": treated}[st.session_state.get("pair", "first")]
    st.session_state["there"] = job_on(pair, "job") is not None


def test_a_remedy_for_the_pair_looked_at_makes_it_void_and_a_step_does_not() -> None:
    app = AppTest.from_function(remedied, default_timeout=60).run()
    for name, there in {"first": True, "second": True, "treated": False}.items():
        app.session_state["pair"] = name
        app.run()
        assert not app.exception
        assert app.session_state["there"] == there, name
