"""A control made from a field of a settings class, and settings made from controls."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from types import NoneType
from typing import Any, Literal, TypeVar, get_args, get_origin

import streamlit as st
from annotated_types import Ge, Gt, Le, Lt, MultipleOf
from pydantic import ValidationError
from pydantic.fields import FieldInfo

from stereolag.settings import Settings

T = TypeVar("T")
Number = int | float

NOT_ADOPTED = object()


@dataclass(frozen=True)
class Bounds:
    """What a number may be: the ends (None: open) and the step between allowed values."""

    low: Number | None
    high: Number | None
    step: Number

    @classmethod
    def of(cls, field: FieldInfo) -> Bounds:
        """Read the bounds and the step that a field declares."""
        kind: type[int] | type[float] = int if _base_type(field) is int else float
        declared = {type(one): one for one in field.metadata}
        extra: dict[str, Any] = field.json_schema_extra if isinstance(field.json_schema_extra, dict) else {}
        step = kind(declared[MultipleOf].multiple_of if MultipleOf in declared else extra.get("step", 1))
        low = high = None
        if Ge in declared:
            low = kind(declared[Ge].ge)
        elif Gt in declared:
            low = kind(declared[Gt].gt) + step
        if Le in declared:
            high = kind(declared[Le].le)
        elif Lt in declared:
            high = kind(declared[Lt].lt) - step
        return cls(low, high, step)

    def narrowed(self, low: Number | None, high: Number | None) -> Bounds:
        """Return the part of these bounds that lies between `low` and `high`."""
        return Bounds(
            max((end for end in (self.low, low) if end is not None), default=None),
            min((end for end in (self.high, high) if end is not None), default=None),
            self.step,
        )

    def through(self, value: Number) -> Bounds:
        """Return the bounds moved inwards until they lie whole steps away from `value`."""
        if self.low is None or self.high is None:
            return self
        down = max(_whole_steps(value - self.low, self.step), 0)
        up = max(_whole_steps(self.high - value, self.step), 0)
        return Bounds(_tidy(value - down * self.step), _tidy(value + up * self.step), self.step)

    def nearest(self, value: Number) -> Number:
        """Return the value moved by whole steps until it lies within; the lower end where no such step does."""
        if self.high is not None and value > self.high:
            value = _tidy(value + _whole_steps(self.high - value, self.step) * self.step)
        if self.low is not None and value < self.low:
            value = _tidy(value - _whole_steps(value - self.low, self.step) * self.step)
        fits = self.low is None or self.high is None or self.low <= value <= self.high
        return value if fits or self.low is None else self.low


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

    A number with both bounds is a slider; with fewer, or where it may be left empty, a number box. A choice is a row of
    buttons, a yes or no a switch.

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
        "help": field.description,
        "key": key,
        "persist_state": "session",
        "disabled": disabled,
    }
    if isinstance(at_first, bool):
        return st.toggle(value=at_first, **widget)
    choices = _choices(field)
    if choices:
        named = (names or {}).get
        return st.segmented_control(
            options=choices, default=at_first, format_func=lambda choice: named(choice, choice), required=True, **widget
        )
    bounds = Bounds.of(field).narrowed(low, high)
    if at_first is None or bounds.low is None or bounds.high is None:
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
    return st.slider(**widget)


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
        st.error(sentence(error))
        return st.session_state.get(key)
    st.session_state[key] = settings
    return settings


def sentence(error: ValueError) -> str:
    """Return an error as one sentence; of the several that pydantic may report, the first."""
    if not isinstance(error, ValidationError):
        return str(error)
    first = error.errors()[0]
    if first["type"] == "value_error":
        return str(first["ctx"]["error"])
    place = ".".join(str(part) for part in first["loc"])
    return f"{place} is {first['input']!r}: {first['msg'][0].lower()}{first['msg'][1:]}."


def _adopted_key(key: str) -> str:
    return f"{key}.adopted"


def _base_type(field: FieldInfo) -> Any:
    """Return the type of a field, without the None of an optional one."""
    return next((kind for kind in get_args(field.annotation) if kind is not NoneType), field.annotation)


def _choices(field: FieldInfo) -> tuple[str, ...]:
    return get_args(field.annotation) if get_origin(field.annotation) is Literal else ()


def _whole_steps(span: Number, step: Number) -> int:
    return math.floor(span / step + 1e-9)


def _tidy(value: Number) -> Number:
    """Return a float without the dust of binary fractions; an int as it is."""
    return round(value, 9)
