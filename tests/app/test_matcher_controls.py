"""The settings in use before the controls are drawn equal the values that the controls then show."""

from __future__ import annotations

from typing import Any

import pytest
from streamlit.testing.v1 import AppTest

from stereolag.samples import stereo_pairs
from stereolag.stereo.methods import METHODS, PRESETS
from stereolag.ui.controls import class_of
from tests.app import keys
from tests.app.pages import controls


def page() -> None:
    import streamlit as st

    from stereolag.stereo.methods import METHODS
    from stereolag.ui.depth.inputs import choose_pair
    from stereolag.ui.depth.maps import show_controls, show_presets
    from stereolag.ui.matcher_controls import matcher_as_set, matcher_moved, matchers_in_use

    pair = choose_pair()
    as_set = {method: matcher_as_set(method, pair) for method in METHODS}
    show_presets(pair)
    show_controls(as_set)
    st.session_state["met"] = matchers_in_use(), [matcher_as_set(method, pair).matcher for method in METHODS]
    if drag := st.session_state.pop("drag", None):
        st.session_state["dragged"] = matcher_moved(pair, *drag)


def opened(pair: str) -> AppTest:
    app = AppTest.from_function(page, default_timeout=60)
    app.session_state["pairs"] = pair
    app.session_state["depth.head"] = True
    for method in METHODS:
        app.session_state[keys.more(method.short_name)] = True
    return app.run()


def agree(app: AppTest) -> None:
    before, drawn = app.session_state["met"]
    assert before == drawn
    assert len(drawn) == len(METHODS)


@pytest.mark.parametrize("pair", stereo_pairs())
def test_with_every_example_and_preset(pair: str) -> None:
    app = opened(pair)
    agree(app)
    for preset in PRESETS:
        app.button(key=keys.preset_key(preset)).click().run()
        agree(app)


def other_values(control: Any) -> list[Any]:
    """Return the values that a control is moved to, until one is allowed beside the other settings."""
    if control.type == "toggle":
        return [not control.value]
    if control.type == "slider":
        return [value for value in (control.max, control.min, control.value + control.step) if value != control.value]
    return [option for option in control.options if option != control.value]


@pytest.mark.parametrize("method", [method.short_name for method in METHODS])
def test_any_control_changes_the_settings_of_its_method_alone_and_a_slider_does_while_dragged(
    method: str,
) -> None:
    app = opened("cube")
    app.button_group(key=keys.TAB).set_value(method).run()
    at_first = app.session_state["met"][1]
    mine = [kind.short_name for kind in METHODS].index(method)
    settings = [key for key in controls(app) if key.startswith(f"depth.{method}.")]
    assert len(settings) > 5
    for key in settings:
        before = controls(app)[key].value
        for value in other_values(controls(app)[key]):
            controls(app)[key].set_value(value).run()
            assert not app.exception, key
            agree(app)
            moved = app.session_state["met"][1]
            changed = [one != other for one, other in zip(at_first, moved, strict=True)]
            if any(changed):
                app.session_state["drag"] = class_of(key), value
            controls(app)[key].set_value(before).run()
            if any(changed):
                break
        if controls(app)[key].type == "slider":
            assert app.session_state["dragged"] == moved[mine], key
        assert changed == [number == mine for number in range(len(METHODS))], key
        assert app.session_state["met"][1] == at_first, key


@pytest.mark.parametrize("method", [method.short_name for method in METHODS])
def test_at_the_ends_of_every_slider_also_of_a_smaller_picture(method: str) -> None:
    app = opened("road")
    app.session_state[keys.TAB] = method
    app.run()
    for end in ("max", "min"):
        for key in [slider.key for slider in app.slider]:
            slider = app.slider(key=key)
            if not slider.disabled:
                slider.set_value(getattr(slider, end)).run()
                agree(app)
        app.segmented_control(key="pairs.size").set_value("1/4" if end == "max" else "Full").run()
        agree(app)
