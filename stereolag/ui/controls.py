"""A control made from a field of a settings class, and settings made from controls."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Mapping
from typing import Any, TypeVar

import streamlit as st
from pydantic.fields import FieldInfo

from stereolag.settings import Settings
from stereolag.settings.fields import Bounds, Number, choices
from stereolag.typography import typeset
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
    """Draw the control of one field and return what it is set to.

    A number with both bounds is a slider with a box for an exact value; with fewer, or where it may be left empty, a
    number box. A choice is a row of buttons, a yes or no a switch.

    Parameters
    ----------
    settings, name
        The settings class and its field: the label, the help, the bounds and the step come from there.
    key
        Of the widget; its value outlives a visit to another page.
    value
        What it is set to at first; the field's own default unless given.
    low, high
        Narrower bounds, where what the field allows is more than these inputs can use.
    names
        What the choices are called on the page.
    when_empty
        What an empty number box means.
    beside
        Another name of the field, shown beside its title.
    disabled
        Whether it cannot be moved now, because nothing would change.
    drawn
        False where it is folded away: then it is not drawn, which takes time, and keeps its value.
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
        # A slider needs two ends. Under a key of its own it does not disturb what is set for other inputs.
        bounds = Bounds(at_first, at_first + bounds.step, bounds.step)
        widget |= {"key": f"{key}.only", "disabled": True}
    widget |= {"min_value": bounds.low, "max_value": bounds.high, "step": bounds.step, "value": at_first}
    return _slider_and_box(widget, Bounds.of(field))


EXACT_WIDTH = 76
"""Px; of the box beside a slider, too narrow for buttons."""


def _slider_and_box(widget: dict[str, Any], allowed: Bounds) -> Any:
    """Draw a slider beside a box that shows its value and takes any other that the field allows."""
    key, exact = widget["key"], exact_key(widget["key"])
    with st.container(horizontal=True, gap="small", vertical_alignment="bottom"):
        value = st.slider(**widget)
        if drawn_anew(exact) or st.session_state.get(exact) != value:  # set anew, it is drawn anew
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
"""How long after a box was set to another value the browser may still send the one before."""


def _take_exact(key: str) -> None:
    """Set a slider to the value typed beside it, which may lie beyond its ends or between its steps.

    Beside a slider that moved, or just after, the box holds no typed value: the browser has not drawn the new one yet.
    """
    typed = st.session_state[exact_key(key)]
    moved = st.session_state[key] != st.session_state.get(_drawn_key(key))
    late = time.monotonic() - _replaced(key).get(typed, -math.inf) < LATE_S
    if not moved and not late:
        adopt_value(key, typed)


def _replaced(key: str) -> dict[Any, float]:
    """Return when each value drawn in a box was last replaced by another."""
    times: dict[Any, float] = st.session_state.setdefault(f"{exact_key(key)}.replaced", {})
    return times


def _drawn_key(key: str) -> str:
    return f"{key}.drawn"


def _within(field: FieldInfo, value: Any, low: Number | None, high: Number | None) -> Any:
    """Return a value within the bounds that its control would have."""
    if isinstance(value, bool) or not isinstance(value, int | float):
        return value
    return Bounds.of(field).narrowed(low, high).nearest(value)


def adopt_value(key: str, value: Any) -> None:
    """Set a control that is not drawn yet in this run; its bounds widen where they must to hold the value."""
    st.session_state[key] = st.session_state[_adopted_key(key)] = value


def last_valid(make: Callable[[], T], key: str) -> T | None:
    """Return what `make` makes; where the settings are refused say why, and return what was valid before."""
    try:
        settings = make()
    except ValueError as error:
        show_refused(error)
        return st.session_state.get(key)
    st.session_state[key] = settings
    return settings


def _adopted_key(key: str) -> str:
    return f"{key}.adopted"
