"""Controls built from the fields of a settings class, and settings built from controls."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Mapping
from typing import Any, TypeVar

import streamlit as st
from pydantic.fields import FieldInfo

from stereolag.core.settings import Settings
from stereolag.core.settings.fields import Bounds, Number, choices
from stereolag.core.typography import typeset
from stereolag.ui.keys import exact_key
from stereolag.ui.persistence import drawn_anew, persistent
from stereolag.ui.states import show_refused

T = TypeVar("T")

NOT_ADOPTED = object()


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
    drawn: bool = True,
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
    drawn
        False if the control is folded away: it is not drawn, to save time, and keeps its value.
    """
    field = settings.model_fields[name]
    found = st.session_state.get(_adopted_key(key), NOT_ADOPTED)
    adopted = found is not NOT_ADOPTED
    at_first = found if adopted else field.default if value is None else value
    if not drawn:
        kept = st.session_state.get(key, at_first)
        return kept if adopted else _within(field, kept, low, high)
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


EXACT_WIDTH = 76
"""Width of the box beside a slider, px; too narrow for step buttons."""


def _slider_and_box(widget: dict[str, Any], allowed: Bounds) -> Any:
    """Draw a slider and a box that shows its value and accepts any other value the field allows."""
    key, exact = widget["key"], exact_key(widget["key"])
    with st.container(horizontal=True, gap="small", vertical_alignment="bottom"):
        value = st.slider(**widget)
        if drawn_anew(exact) or st.session_state.get(exact) != value:  # assigning it makes the browser redraw it
            st.session_state[exact] = value
        if (before := st.session_state.get(_drawn_key(key))) != value:
            st.session_state[_drawn_key(key)] = value
            _replaced(key)[before] = time.monotonic()
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


def _take_exact(key: str) -> None:
    """Set a slider to the value typed beside it, which may be outside its range or between its steps.

    If the slider has just moved, the box value was not typed: the browser has not drawn the new value yet.
    """
    typed = st.session_state[exact_key(key)]
    moved = st.session_state[key] != st.session_state.get(_drawn_key(key))
    late = time.monotonic() - _replaced(key).get(typed, -math.inf) < LATE_S
    if not moved and not late:
        adopt_value(key, typed)


def _replaced(key: str) -> dict[Any, float]:
    """Return the times at which values drawn in a box were last replaced, by value."""
    times: dict[Any, float] = st.session_state.setdefault(f"{exact_key(key)}.replaced", {})
    return times


def _drawn_key(key: str) -> str:
    return f"{key}.drawn"


def _within(field: FieldInfo, value: Any, low: Number | None, high: Number | None) -> Any:
    """Return a value clamped to the bounds its control would have."""
    if isinstance(value, bool) or not isinstance(value, int | float):
        return value
    return Bounds.of(field).narrowed(low, high).nearest(value)


def adopt_value(key: str, value: Any) -> None:
    """Set a control not yet drawn in this run; its bounds widen if needed to include the value."""
    st.session_state[key] = st.session_state[_adopted_key(key)] = value


def last_valid(make: Callable[[], T], key: str) -> T | None:
    """Return the result of `make`; if it refuses the settings, show why and return the last valid ones."""
    try:
        settings = make()
    except ValueError as error:
        show_refused(error)
        return st.session_state.get(key)
    st.session_state[key] = settings
    return settings


def _adopted_key(key: str) -> str:
    return f"{key}.adopted"
