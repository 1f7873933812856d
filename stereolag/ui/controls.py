"""Controls built from the fields of a settings class; their values outlive the part of the page that draws them."""

from __future__ import annotations

import math
import re
import time
from collections import Counter, defaultdict
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from contextvars import ContextVar
from dataclasses import dataclass, field
from typing import Any, TypeVar

import streamlit as st

from stereolag.core.settings import Bounds, Number, Settings, choices
from stereolag.core.typography import typeset
from stereolag.stereo.matcher import StereoMatcher
from stereolag.ui.elements import refusals_shown

# Their keys


def class_of(key: str) -> str:
    """Return the CSS class that Streamlit gives to the element with this key."""
    return "st-key-" + re.sub(r"[^\w-]", "-", key, flags=re.ASCII)


def exact_key(key: str) -> str:
    """Return the key of the number box for an exact value beside a slider."""
    return f"{key}.exact"


# The runs that draw them

ANY_PAGE = "page"

Run = tuple[tuple[str, int], ...]
"""The page and the nested fragments of a run, each with its run number; an interrupted run shares its number with the
next one."""

_current: ContextVar[Run] = ContextVar("run", default=())


@dataclass
class _Box:
    """The number box beside a slider: its last drawn value, and the times at which earlier ones were replaced."""

    value: Any = None
    replaced: dict[Any, float] = field(default_factory=dict)


class _Memory:
    """The state of the controls of one visitor.

    Attributes
    ----------
    page, page_before
        The page that ran last, and the one before this run.
    ended
        Number of completed runs of each fragment, and of any page.
    within
        The run in whose container a fragment was drawn.
    drawn
        The run that drew a control last, by its key.
    boxes, adopted
        The boxes beside sliders, and the values that controls were set to, by key.
    matchers
        The last valid settings of each method, by its short name.
    opened
        The short names of the methods whose controls were ever drawn.
    untouched
        The settings of methods that are not shown, with the values they depend on; dropped when a control is set.
    """

    def __init__(self) -> None:
        self.page = self.page_before = ""
        self.ended: Counter[str] = Counter()
        self.within: dict[str, Run] = {}
        self.drawn: dict[str, Run] = {}
        self.boxes: defaultdict[str, _Box] = defaultdict(_Box)
        self.adopted: dict[str, Any] = {}
        self.matchers: dict[str, StereoMatcher] = {}
        self.opened: set[str] = set()
        self.untouched: dict[str, tuple[Any, ...]] = {}


_remembered: ContextVar[_Memory | None] = ContextVar("memory", default=None)


def visitor_memory() -> _Memory:
    """Return the state of this visitor's controls, kept in one entry, since Streamlit visits all entries in every run.

    Within a counted run it is looked up only once, because every control needs it several times.
    """
    return _remembered.get() or st.session_state.setdefault("controls", _Memory())


@contextmanager
def run_of_page(title: str) -> Iterator[None]:
    """Count a run of a page; the page is drawn inside the ``with`` block."""
    memory = visitor_memory()
    memory.page_before = memory.page or title
    if memory.page_before != title:
        memory.ended[ANY_PAGE] += 1  # this run does not directly follow the last run of this page
    memory.page = title
    with _counted(ANY_PAGE, ()):
        yield


def from_another_page() -> bool:
    """Return whether the previous run was of another page."""
    return visitor_memory().page_before != visitor_memory().page


@contextmanager
def run_of_part(name: str) -> Iterator[None]:
    """Count a run of a fragment; the fragment is drawn inside the ``with`` block."""
    within = visitor_memory().within
    within[name] = _current.get() or within.get(name, ())
    with _counted(name, within[name]):
        yield


@contextmanager
def _counted(name: str, outer: Run) -> Iterator[None]:
    memory = visitor_memory()
    number = memory.ended[name]
    run, remembered = _current.set((*outer, (name, number))), _remembered.set(memory)
    try:
        yield
    finally:
        _current.reset(run)
        _remembered.reset(remembered)
    memory.ended[name] = number + 1


def persistent(key: str) -> dict[str, Any]:
    """Return the arguments for a control whose value outlives it: its key, and the lifetime of the value."""
    if drawn_anew(key) and key in st.session_state:
        st.session_state[key] = st.session_state[key]
    return {"key": key, "persist_state": "session"}


def drawn_anew(key: str) -> bool:
    """Return whether a control about to be drawn was drawn before, but not in the previous run.

    Its value must then be assigned again, even if unchanged. Streamlit does not send a value back to the browser that
    it came from; but a browser that sent it before learning that the control was gone has forgotten it since, and
    would show the initial value.
    """
    run, drawn = _current.get(), visitor_memory().drawn
    before = drawn.get(key, run)
    drawn[key] = run
    return len(run) != len(before) or any(
        name != old or number > last + 1 for (name, number), (old, last) in zip(run, before, strict=True)
    )


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
        Alternative name of the field, shown beside its title.
    disabled
        Whether the control is disabled because it would have no effect.
    """
    info = settings.model_fields[name]
    adopted = key in visitor_memory().adopted
    initial = visitor_memory().adopted[key] if adopted else info.default if value is None else value
    title = info.title or name
    widget: dict[str, Any] = {
        "label": f"{title} `{beside}`" if beside else title,
        "help": typeset(info.description or ""),
        "disabled": disabled,
        **persistent(key),
    }
    if isinstance(initial, bool):
        return st.toggle(value=initial, **widget)
    options = choices(info)
    if options:
        return st.segmented_control(
            options=options,
            default=initial,
            format_func=lambda choice: (names or {}).get(choice, choice),
            required=True,
            **widget,
        )
    bounds = Bounds.of(info).narrowed(low, high)
    if when_empty is not None or initial is None or bounds.low is None or bounds.high is None:
        widget |= {"min_value": bounds.low, "max_value": bounds.high, "step": bounds.step, "value": initial}
        return st.number_input(
            format="%g" if isinstance(bounds.step, float) else "%d", placeholder=when_empty, **widget
        )
    if adopted:
        bounds = Bounds(min(bounds.low, initial), max(bounds.high, initial), bounds.step)
    initial = bounds.nearest(initial)
    bounds = bounds.through(initial)
    if bounds.high == bounds.low:
        # A slider needs two distinct ends. A separate key leaves the value set for other inputs untouched.
        bounds = Bounds(initial, initial + bounds.step, bounds.step)
        widget |= {"key": f"{key}.only", "disabled": True}
    widget |= {"min_value": bounds.low, "max_value": bounds.high, "step": bounds.step, "value": initial}
    return _slider_and_box(widget, Bounds.of(info))


def kept_value(
    settings: type[Settings], name: str, key: str, value: Any, low: Number | None = None, high: Number | None = None
) -> Any:
    """Return the value that :func:`control` would return with the same arguments, without drawing it."""
    adopted = visitor_memory().adopted
    if key in adopted:
        return st.session_state.get(key, adopted[key])
    info = settings.model_fields[name]
    kept = st.session_state.get(key, info.default if value is None else value)
    if isinstance(kept, bool) or not isinstance(kept, int | float):
        return kept
    return Bounds.of(info).narrowed(low, high).nearest(kept)


def _slider_and_box(widget: dict[str, Any], allowed: Bounds) -> Any:
    """Draw a slider and a box that shows its value and accepts any other value the field allows."""
    key, exact = widget["key"], exact_key(widget["key"])
    value = st.slider(**widget)
    if drawn_anew(exact) or st.session_state.get(exact) != value:  # assigning it makes the browser redraw it
        st.session_state[exact] = value
    box = visitor_memory().boxes[key]
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
        on_change=_take_exact,
        args=(key,),
    )
    return value


STALE_VALUE_S = 2.0
"""Time after which a box set to a new value no longer receives the previous one from the browser, s."""


def _take_exact(key: str) -> None:
    """Set a slider to the value typed in its box, which may be outside its range or between its steps.

    If the slider has just moved, the value of the box was not typed: the browser has not drawn the new one yet.
    """
    typed, box = st.session_state[exact_key(key)], visitor_memory().boxes[key]
    moved = st.session_state[key] != box.value
    stale = time.monotonic() - box.replaced.get(typed, -math.inf) < STALE_VALUE_S
    if not moved and not stale:
        adopt_value(key, typed)


def adopt_value(key: str, value: Any) -> None:
    """Set a control not yet drawn in this run; its bounds are widened to include the value if necessary."""
    memory = visitor_memory()
    st.session_state[key] = memory.adopted[key] = value
    memory.untouched.clear()


def adopt_values(settings: Settings, key: Callable[[str], str]) -> None:
    """Set the controls of all fields to these settings; `key` returns the key of a field's control."""
    for name in type(settings).model_fields:
        adopt_value(key(name), getattr(settings, name))


def last_valid(make: Callable[[], T], key: str, sentence: str = "{}") -> T | None:
    """Return the result of `make`; if that fails, show why, within `sentence`, and return the last valid one."""
    with refusals_shown(sentence):
        st.session_state[key] = make()
    return st.session_state.get(key)
