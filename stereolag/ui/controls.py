"""Controls built from the fields of a settings class, and settings built from controls."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Mapping
from typing import Any, TypeVar

import streamlit as st

from stereolag.core.settings import Settings
from stereolag.core.settings.fields import Bounds, Number, choices
from stereolag.core.typography import typeset
from stereolag.ui.keys import exact_key
from stereolag.ui.persistence import drawn_anew, persistent
from stereolag.ui.states import show_refused

T = TypeVar("T")


def control(
    settings: type[Settings],
    name: str,
    *,
    key: str,
    value: Any = None,
    low: Number | None = None,
    high: Number | None = None,
    names: Mapping[str, str] | None = None,
    when_empty: str | None = None,
    beside: str = "",
    disabled: bool = False,
) -> Any:
    """Draw the control of one field and return its value.

    A number with both bounds gets a slider and a box for an exact value; a number with fewer bounds, or one that may be
    left empty, gets a number box. A choice is a row of buttons, a boolean a switch.

    Parameters
    ----------
    settings, name
        The settings class and its field, which provide the label, help, bounds and step.
    key
        Widget key; its value survives a visit to another page.
    value
        Initial value; the field's default unless given.
    low, high
        Narrower bounds, if the field allows more than these inputs can use.
    names
        Display names of the choices.
    when_empty
        Meaning of an empty number box.
    beside
        Another name of the field, shown beside its title.
    disabled
        Whether the control is inactive, because changing it would have no effect.
    """
    field = settings.model_fields[name]
    adopted = key in _adopted()
    at_first = _adopted()[key] if adopted else field.default if value is None else value
    title = field.title or name
    widget: dict[str, Any] = {
        "label": f"{title} `{beside}`" if beside else title,
        "help": typeset(field.description or ""),
        "disabled": disabled,
        **persistent(key),
    }
    if isinstance(at_first, bool):
        return st.toggle(value=at_first, **widget)
    options = choices(field)
    if options:
        named = (names or {}).get
        return st.segmented_control(
            options=options, default=at_first, format_func=lambda choice: named(choice, choice), required=True, **widget
        )
    bounds = Bounds.of(field).narrowed(low, high)
    if when_empty is not None or at_first is None or bounds.low is None or bounds.high is None:
        widget |= {"min_value": bounds.low, "max_value": bounds.high, "step": bounds.step, "value": at_first}
        number_format = "%g" if isinstance(bounds.step, float) else "%d"
        return st.number_input(format=number_format, placeholder=when_empty, **widget)
    if adopted:
        bounds = Bounds(min(bounds.low, at_first), max(bounds.high, at_first), bounds.step)
    at_first = bounds.nearest(at_first)
    bounds = bounds.through(at_first)
    if bounds.high == bounds.low:
        # A slider needs two distinct ends. A separate key leaves the value set for other inputs untouched.
        bounds = Bounds(at_first, at_first + bounds.step, bounds.step)
        widget |= {"key": f"{key}.only", "disabled": True}
    widget |= {"min_value": bounds.low, "max_value": bounds.high, "step": bounds.step, "value": at_first}
    return _slider_and_box(widget, Bounds.of(field))


def kept_value(
    settings: type[Settings], name: str, key: str, value: Any, low: Number | None = None, high: Number | None = None
) -> Any:
    """Return the value that :func:`control` would return with the same arguments, without drawing it."""
    adopted = _adopted()
    if key in adopted:
        return st.session_state.get(key, adopted[key])
    field = settings.model_fields[name]
    kept = st.session_state.get(key, field.default if value is None else value)
    if isinstance(kept, bool) or not isinstance(kept, int | float):
        return kept
    return Bounds.of(field).narrowed(low, high).nearest(kept)


EXACT_WIDTH = 76
"""Width of the box beside a slider, px; too narrow for step buttons."""


def _slider_and_box(widget: dict[str, Any], allowed: Bounds) -> Any:
    """Draw a slider and a box that shows its value and accepts any other value the field allows."""
    key, exact = widget["key"], exact_key(widget["key"])
    with st.container(horizontal=True, gap="small", vertical_alignment="bottom"):
        value = st.slider(**widget)
        if drawn_anew(exact) or st.session_state.get(exact) != value:  # assigning it makes the browser redraw it
            st.session_state[exact] = value
        box = _boxes().setdefault(key, _Box())
        if box.value != value:
            box.replaced[box.value] = time.monotonic()
            box.value = value
        st.number_input(
            widget["label"],
            min_value=allowed.low,
            max_value=allowed.high,
            step=0.01 if isinstance(value, float) else 1,
            format="%g" if isinstance(value, float) else "%d",
            key=exact,
            disabled=widget["disabled"],
            label_visibility="collapsed",
            width=EXACT_WIDTH,
            on_change=_take_exact,
            args=(key,),
        )
    return value


LATE_S = 2.0
"""How long after a box was set to a new value the browser may still send the previous one, s."""


class _Box:
    """The box beside a slider: the value drawn in it last, and the times at which earlier ones were replaced."""

    def __init__(self) -> None:
        self.value: Any = None
        self.replaced: dict[Any, float] = {}


def _boxes() -> dict[str, _Box]:
    """Return the boxes by the keys of their sliders; in one entry, since Streamlit walks over all in every run."""
    boxes: dict[str, _Box] = st.session_state.setdefault("controls.boxes", {})
    return boxes


def _take_exact(key: str) -> None:
    """Set a slider to the value typed beside it, which may be outside its range or between its steps.

    If the slider has just moved, the box value was not typed: the browser has not drawn the new value yet.
    """
    typed, box = st.session_state[exact_key(key)], _boxes()[key]
    moved = st.session_state[key] != box.value
    late = time.monotonic() - box.replaced.get(typed, -math.inf) < LATE_S
    if not moved and not late:
        adopt_value(key, typed)


def adopt_value(key: str, value: Any) -> None:
    """Set a control not yet drawn in this run; its bounds widen if needed to include the value."""
    st.session_state[key] = _adopted()[key] = value


def last_valid(make: Callable[[], T], key: str) -> T | None:
    """Return the result of `make`; if it refuses the settings, show why and return the last valid ones."""
    try:
        settings = make()
    except ValueError as error:
        show_refused(error)
        return st.session_state.get(key)
    st.session_state[key] = settings
    return settings


def _adopted() -> dict[str, Any]:
    """Return the values that controls were set to, by key; in one entry, as the boxes are."""
    adopted: dict[str, Any] = st.session_state.setdefault("controls.adopted", {})
    return adopted
