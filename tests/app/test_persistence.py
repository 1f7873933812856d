"""A control has the value of the last move, even if the browser sent another before learning of it."""

import pytest
import streamlit as st
from pydantic import Field
from streamlit.testing.v1 import AppTest

from stereolag.core.settings import Settings
from stereolag.ui import controls
from stereolag.ui.controls import control, persistent, run_of_page
from stereolag.ui.navigation import fragment, show_parts
from tests.app.pages import PROJECT, page_of


class Example(Settings):
    size: int = Field(default=3, title="Size", ge=1, le=9)


@fragment
def inner() -> None:
    st.toggle("Third", **persistent("third"))


@fragment
def part() -> None:
    if st.toggle("Drawn", value=True, key="drawn"):
        st.toggle("First", **persistent("first"))
        control(Example, "size", key="size")
        inner()


def page_with_parts() -> None:
    with run_of_page("A page" if st.toggle("Here", value=True, key="here") else "Another page"):
        if st.session_state["here"]:
            st.toggle("Second", **persistent("second"))
            part()


@pytest.fixture
def app() -> AppTest:
    return page_of(page_with_parts)


def told(app: AppTest) -> dict[str, bool]:
    """Return whether the server sends a value to each control of the last run."""
    found = {one.key: one.proto.set_value for one in (*app.toggle, *app.slider, *app.number_input)}
    return {key: value for key, value in found.items() if key not in {"drawn", "here", None}}


CONTROLS = ("first", "second", "third", "size", "size.exact")


@pytest.mark.parametrize("gone", ["drawn", "here"])
def test_a_browser_that_sent_a_value_before_it_lost_the_control_is_told_it(app: AppTest, gone: str) -> None:
    for key in ("first", "second", "third"):
        app.toggle(key=key).set_value(True)
    app.slider(key="size").set_value(7).run()
    known = app._tree.get_widget_states()  # AppTest has no public API for a browser that lags behind
    app.toggle(key=gone).set_value(False).run()
    assert not {"first", "size"} & {one.key for one in (*app.toggle, *app.slider)}
    app._run(known)
    assert [app.session_state[key] for key in CONTROLS] == [True, True, True, 7, 7]
    again, stayed = told(app), {"second"} if gone == "drawn" else set()
    assert all(again[key] for key in CONTROLS if key not in stayed)


def test_a_control_that_stays_keeps_what_it_was_moved_to_meanwhile(app: AppTest) -> None:
    for value in (4, 5):
        app.slider(key="size").set_value(value).run()
        app.toggle(key="first").set_value(value == 5).run()
        assert not any(told(app).values()), told(app)


def test_a_box_that_the_browser_has_not_drawn_anew_yet_does_not_move_its_slider_back(app: AppTest) -> None:
    def values() -> tuple[int, int]:
        return app.slider(key="size").value, app.number_input(key="size.exact").value

    assert values() == (3, 3)
    app.slider(key="size").set_value(5).run()
    app.slider(key="size").set_value(7)
    app.number_input(key="size.exact").set_value(3).run()  # sent with the slider's second step
    assert values() == (7, 7)
    app.number_input(key="size.exact").set_value(5).run()  # sent with another change
    assert values() == (7, 7)
    app.number_input(key="size.exact").set_value(9).run()
    assert values() == (9, 9)


def test_a_value_can_be_typed_again(app: AppTest, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(controls, "STALE_VALUE_S", 0.0)
    for value in (5, 3, 5):
        app.number_input(key="size.exact").set_value(value).run()
        assert app.slider(key="size").value == value


@fragment
def result_in_parts() -> None:
    if st.toggle("Computed", value=True, key="computed"):
        show_parts("part", {"One": lambda: None, "Two": lambda: st.text("Two is open")})


def test_a_tab_clicked_while_its_result_is_computed_again_is_open_afterwards() -> None:
    app = page_of(result_in_parts)
    app.toggle(key="computed").set_value(False)
    clicked = app._tree.get_widget_states()  # AppTest cannot click on a tab
    clicked.widgets.add(id=app.main.children[0].children[1].proto.id, string_value="Two")
    app._run(clicked)
    app.toggle(key="computed").set_value(True).run()
    assert [one.value for one in app.text] == ["Two is open"]


def test_every_control_that_persists_does_it_so() -> None:
    scripts = [PROJECT / "app.py", *(PROJECT / "pages").glob("*.py"), *(PROJECT / "stereolag").rglob("*.py")]
    assert [one.name for one in scripts if "persist_state" in one.read_text(encoding="utf-8")] == ["controls.py"]
