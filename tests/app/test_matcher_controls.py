"""The settings in use before the controls are drawn equal the values that the controls then show."""

from typing import Any

import pytest
import streamlit as st
from pydantic import Field
from streamlit.testing.v1 import AppTest

from stereolag.core.settings import MIN_STEP, Bounds, Settings
from stereolag.samples import stereo_pairs
from stereolag.stereo.methods import METHODS, PRESETS
from stereolag.ui.controls import class_of
from stereolag.ui.depth.inputs import choose_pair
from stereolag.ui.depth.maps import show_controls, show_presets
from stereolag.ui.matcher_controls import control_state, matcher_with_moved_slider, matchers_in_use
from tests.app import keys
from tests.app.pages import page_of
from tests.app.reading import controls


def page() -> None:
    pair = choose_pair()
    states = {method: control_state(method, pair) for method in METHODS}
    show_presets(pair)
    show_controls(states)
    st.session_state["met"] = matchers_in_use(), [control_state(method, pair).matcher for method in METHODS]
    if drag := st.session_state.pop("drag", None):
        st.session_state["dragged"] = matcher_with_moved_slider(pair, *drag)


def opened(pair: str) -> AppTest:
    unfolded = {keys.more(method.short_name): True for method in METHODS}
    return page_of(page, {"pairs": pair, "depth.head": True, **unfolded})


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
def test_any_control_changes_the_settings_of_its_method_alone_and_a_slider_does_while_dragged(method):
    app = opened("cube")
    app.button_group(key=keys.TAB).set_value(method).run()
    at_first = app.session_state["met"][1]
    mine = [kind.short_name for kind in METHODS].index(method)
    settings = [key for key in controls(app) if key.startswith(f"depth.{method}.")]
    assert len(settings) > 5
    for key in settings:
        before, is_slider = controls(app)[key].value, controls(app)[key].type == "slider"
        for value in other_values(controls(app)[key]):
            controls(app)[key].set_value(value).run()
            agree(app)
            moved = app.session_state["met"][1]
            changed = [one != other for one, other in zip(at_first, moved, strict=True)]
            if is_slider and any(changed):
                app.session_state["drag"] = class_of(key), value
            controls(app)[key].set_value(before).run()
            if any(changed):
                break
        if is_slider:
            assert app.session_state["dragged"] == moved[mine], key
        assert changed == [number == mine for number in range(len(METHODS))], key
        assert app.session_state["met"][1] == at_first, key


@pytest.mark.parametrize("method", [method.short_name for method in METHODS])
def test_at_the_ends_of_every_slider_also_of_a_smaller_picture(method: str) -> None:
    app = opened("road")
    app.button_group(key=keys.TAB).set_value(method).run()
    for end in ("max", "min"):
        for key in [slider.key for slider in app.slider]:
            slider = app.slider(key=key)
            if not slider.disabled:
                slider.set_value(getattr(slider, end)).run()
                agree(app)
        app.segmented_control(key="pairs.size").set_value("1/4" if end == "max" else "Full").run()
        agree(app)


# The values that a control offers are those that its field allows


class Example(Settings):
    odd: int = Field(7, ge=2, le=12, json_schema_extra={"step": 2})
    sixteens: int = Field(64, ge=1, le=100, multiple_of=16)
    share: float = Field(0.95, ge=0, lt=1, json_schema_extra={"step": 0.05})
    open_end: float = Field(1.0, gt=0)
    perhaps: int | None = Field(None, ge=0)


def bounds_of(name: str) -> Bounds:
    return Bounds.of(Example.model_fields[name])


def test_sliders_move_in_whole_steps_through_the_default_within_bounds_that_are_never_widened() -> None:
    assert bounds_of("odd").through(7) == Bounds(3, 11, 2)
    assert bounds_of("sixteens").through(64) == Bounds(16, 96, 16)
    assert bounds_of("share").through(0.95) == Bounds(0.0, 0.95, 0.05)
    assert bounds_of("open_end") == Bounds(MIN_STEP, None, 1.0)
    assert bounds_of("perhaps") == Bounds(0, None, 1)
    assert bounds_of("odd").narrowed(5, 20) == Bounds(5, 12, 2)
    assert bounds_of("open_end").narrowed(None, 9.0) == Bounds(MIN_STEP, 9.0, 1.0)


@pytest.mark.parametrize(
    ("low", "high", "value", "nearest"),
    [(5, 99, 21, 21), (5, 6, 21, 5), (5, 3, 21, 5), (3, 8, 20, 8), (16, 40, 64, 32), (5, 99, 1, 5)],
)
def test_a_value_moves_by_whole_steps_into_narrower_bounds(low: int, high: int, value: int, nearest: int) -> None:
    steps = {21: 2, 20: 1, 64: 16, 1: 2}
    assert Bounds(low, high, steps[value]).nearest(value) == nearest
