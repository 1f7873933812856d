"""The declaration of a settings field: markers, bounds, choices and nested settings."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from types import NoneType
from typing import Any, Literal, TypeVar, get_args, get_origin

from annotated_types import Ge, Gt, Le, Lt, MultipleOf
from pydantic import BaseModel
from pydantic.fields import FieldInfo

Number = int | float

T = TypeVar("T")


@dataclass(frozen=True)
class Pixels:
    """Marks a length (power 1) or an area (power 2) in the image, which scales with the image.

    If `rounded_up`, it is scaled up to the next allowed multiple, so that nothing drops out of a search.
    """

    power: int = 1
    rounded_up: bool = False


@dataclass(frozen=True)
class OfThePair:
    """Marks a setting that depends on the pair, not on taste: its control is kept separately for each pair."""


@dataclass(frozen=True)
class Usual:
    """Marks the part of the allowed range that a slider offers; None: up to the allowed end."""

    low: Number | None = None
    high: Number | None = None


@dataclass(frozen=True)
class FitsImage:
    """Marks a side, px, that must fit into the image."""


@dataclass(frozen=True)
class Applies:
    """Marks a setting that has an effect only with some values of others, which are declared before it.

    Attributes
    ----------
    condition
        Takes the settings, or anything with the same attributes.
    reason
        The unmet need, as the end of a sentence that begins with the setting's name: "needs ...".
    otherwise
        Values accepted even if the condition does not hold, besides None, False and the default.
    """

    condition: Callable[[Any], bool]
    reason: str
    otherwise: tuple[Any, ...] = ()


@dataclass(frozen=True)
class Bounds:
    """The numbers that a field allows: the ends (None: open) and the step between allowed values."""

    low: Number | None
    high: Number | None
    step: Number

    @classmethod
    def of(cls, field: FieldInfo) -> Bounds:
        """Read the bounds and the step that a field declares."""
        kind: type[int] | type[float] = int if base_type(field) is int else float
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
        """Return the part of these bounds between `low` and `high`."""
        return Bounds(
            max((end for end in (self.low, low) if end is not None), default=None),
            min((end for end in (self.high, high) if end is not None), default=None),
            self.step,
        )

    def through(self, value: Number) -> Bounds:
        """Return the bounds moved inwards until they are whole steps away from `value`."""
        if self.low is None or self.high is None:
            return self
        down = max(_whole_steps(value - self.low, self.step), 0)
        up = max(_whole_steps(self.high - value, self.step), 0)
        return Bounds(_tidy(value - down * self.step), _tidy(value + up * self.step), self.step)

    def nearest(self, value: Number) -> Number:
        """Return the value moved by whole steps into the bounds; the lower end if no whole step gets there."""
        if self.high is not None and value > self.high:
            value = _tidy(value + _whole_steps(self.high - value, self.step) * self.step)
        if self.low is not None and value < self.low:
            value = _tidy(value - _whole_steps(value - self.low, self.step) * self.step)
        fits = self.low is None or self.high is None or self.low <= value <= self.high
        return value if fits or self.low is None else self.low


def marker(field: FieldInfo, kind: type[T]) -> T | None:
    """Return a field's marker of the given kind, None if it has none."""
    return next((one for one in field.metadata if isinstance(one, kind)), None)


def base_type(field: FieldInfo) -> Any:
    """Return the type of a field, without the None of an optional one."""
    return next((kind for kind in get_args(field.annotation) if kind is not NoneType), field.annotation)


def choices(field: FieldInfo) -> tuple[str, ...]:
    """Return the options of a field that is a choice of texts; empty for other fields."""
    return get_args(field.annotation) if get_origin(field.annotation) is Literal else ()


def nested(field: FieldInfo) -> tuple[type[BaseModel], ...]:
    """Return the settings classes allowed as a field's value; empty for a field without nested settings."""
    kinds = (field.annotation, *get_args(field.annotation))
    return tuple(kind for kind in kinds if isinstance(kind, type) and issubclass(kind, BaseModel))


def title_of(kind: type[BaseModel], name: str) -> str:
    """Return the title of a setting on a page; a name with dots reaches into nested settings."""
    first, _, inner = name.partition(".")
    field = kind.model_fields[first]
    if not inner:
        return field.title or first
    holder = next(one for one in nested(field) if inner.partition(".")[0] in one.model_fields)
    return title_of(holder, inner)


def _whole_steps(span: Number, step: Number) -> int:
    return math.floor(span / step + 1e-9)


def _tidy(value: Number) -> Number:
    """Return a float without the rounding error of binary fractions; an int unchanged."""
    return round(value, 9)
