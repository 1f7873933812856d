"""What a field of settings says of itself: marks, bounds, choices, and the settings within it."""

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
    """Marks a length (power 1) or an area (power 2) in the image: it scales with the image.

    What is `rounded_up` then, to the multiple that is allowed, leaves nothing out of a search.
    """

    power: int = 1
    rounded_up: bool = False


@dataclass(frozen=True)
class OfThePair:
    """Marks what the pair asks for and not taste: its control is kept for each pair apart."""


@dataclass(frozen=True)
class Usual:
    """Marks the part of what is allowed that a slider offers; None: as far as allowed."""

    low: Number | None = None
    high: Number | None = None


@dataclass(frozen=True)
class FitsImage:
    """Marks a side in px that must fit into the image."""


@dataclass(frozen=True)
class Applies:
    """Marks a setting that has an effect only beside some values of others, which are declared before it.

    Attributes
    ----------
    condition
        Takes the settings, or anything with the same attributes.
    reason
        What it needs, as the end of a sentence that begins with its name: "needs ...".
    otherwise
        Values that are no contradiction where the condition does not hold, besides None, False and the default.
    """

    condition: Callable[[Any], bool]
    reason: str
    otherwise: tuple[Any, ...] = ()


@dataclass(frozen=True)
class Bounds:
    """Which numbers a field allows: the ends (None: open) and the step between allowed values."""

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


def marker(field: FieldInfo, kind: type[T]) -> T | None:
    """Return the mark of a kind that a field carries, None where it carries none."""
    return next((one for one in field.metadata if isinstance(one, kind)), None)


def base_type(field: FieldInfo) -> Any:
    """Return the type of a field, without the None of an optional one."""
    return next((kind for kind in get_args(field.annotation) if kind is not NoneType), field.annotation)


def choices(field: FieldInfo) -> tuple[str, ...]:
    """Return the texts among which a field lets one choose; none of a field that is no choice."""
    return get_args(field.annotation) if get_origin(field.annotation) is Literal else ()


def nested(field: FieldInfo) -> tuple[type[BaseModel], ...]:
    """Return the settings classes that a field may hold; none of a field that holds no settings."""
    kinds = (field.annotation, *get_args(field.annotation))
    return tuple(kind for kind in kinds if isinstance(kind, type) and issubclass(kind, BaseModel))


def title_of(kind: type[BaseModel], name: str) -> str:
    """Return what a page calls a setting; a name with dots reaches into the settings that one holds."""
    first, _, inner = name.partition(".")
    field = kind.model_fields[first]
    if not inner:
        return field.title or first
    holder = next(one for one in nested(field) if inner.partition(".")[0] in one.model_fields)
    return title_of(holder, inner)


def _whole_steps(span: Number, step: Number) -> int:
    return math.floor(span / step + 1e-9)


def _tidy(value: Number) -> Number:
    """Return a float without the dust of binary fractions; an int as it is."""
    return round(value, 9)
