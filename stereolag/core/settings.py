"""Settings: immutable, validated in one place, described by their own fields.

One declaration gives the validation, the control on a page, the flag of a command and the JSON. An error is one
sentence that names the setting, its value and the allowed values.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping, Sized
from dataclasses import dataclass, replace
from difflib import get_close_matches
from types import NoneType
from typing import Any, Literal, NamedTuple, Self, TypeVar, get_args, get_origin

from annotated_types import Ge, Gt, Le, Lt, MultipleOf
from pydantic import BaseModel, ConfigDict, ValidationError, ValidationInfo, model_validator
from pydantic.fields import FieldInfo

from stereolag.core.typography import enumeration

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
class SliderRange:
    """Marks the part of the allowed range that a slider offers; None: up to the bound of the setting."""

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


MIN_STEP = 1e-9
"""Step above an open lower bound, unless the field declares an upper bound too."""


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
        declared = {type(bound): bound for bound in field.metadata}
        extra: dict[str, Any] = field.json_schema_extra if isinstance(field.json_schema_extra, dict) else {}
        step = kind(declared[MultipleOf].multiple_of if MultipleOf in declared else extra.get("step", 1))
        low = high = None
        if Ge in declared:
            low = kind(declared[Ge].ge)
        elif Gt in declared:
            # Without an upper bound, a whole step may be far too much: 0.001 samples a second.
            low = kind(declared[Gt].gt) + (step if kind is int or {Le, Lt} & declared.keys() else MIN_STEP)
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
        """Return the value moved into the bounds by whole steps; the lower bound if that is not possible."""
        if self.high is not None and value > self.high:
            value = _tidy(value + _whole_steps(self.high - value, self.step) * self.step)
        if self.low is not None and value < self.low:
            value = _tidy(value - _whole_steps(value - self.low, self.step) * self.step)
        fits = self.low is None or self.high is None or self.low <= value <= self.high
        return value if fits or self.low is None else self.low


def marker(field: FieldInfo, kind: type[T]) -> T | None:
    """Return a field's marker of the given kind, None if it has none."""
    return next((entry for entry in field.metadata if isinstance(entry, kind)), None)


def odd(size: int, info: ValidationInfo) -> int:
    """Return a size if it is odd: for the field of a window whose middle is a pixel."""
    if size % 2 == 0:
        raise ValueError(f"{info.field_name} is {size}; allowed are odd sizes, so that a pixel is the middle.")
    return size


def multiple_of(field: FieldInfo) -> int:
    """Return the number of which a field of whole numbers allows multiples; 1 if it declares none."""
    declared: Any = marker(field, MultipleOf)
    return int(declared.multiple_of) if declared else 1


def base_type(field: FieldInfo) -> Any:
    """Return the type of a field, for an optional one without None."""
    return next((kind for kind in get_args(field.annotation) if kind is not NoneType), field.annotation)


def choices(field: FieldInfo) -> tuple[str, ...]:
    """Return the options of a field that is a choice of strings; empty for other fields."""
    return get_args(field.annotation) if get_origin(field.annotation) is Literal else ()


KIND = "kind"
"""The field that distinguishes settings of several kinds."""


def nested(field: FieldInfo) -> tuple[type[BaseModel], ...]:
    """Return the settings classes allowed as a field's value; empty for a field without nested settings."""
    kinds = (field.annotation, *get_args(field.annotation))
    return tuple(kind for kind in kinds if isinstance(kind, type) and issubclass(kind, BaseModel))


def title_of(kind: type[BaseModel], name: str) -> str:
    """Return the title of a setting on a page; a name with dots reaches into nested settings."""
    field = next(field for full, field in _names(kind) if full == name)
    return field.title or name.rpartition(".")[2]


def _whole_steps(span: Number, step: Number) -> int:
    return math.floor(span / step + 1e-9)


def _tidy(value: Number) -> Number:
    """Return a float without the rounding error of binary fractions; an int unchanged."""
    return round(value, 9)


MAX_SHOWN_CHARACTERS = 60
"""Characters of a refused value that an error repeats, at most."""


class Problem(NamedTuple):
    """A problem with one setting: its name, with dots if it is nested, and a sentence."""

    name: str
    sentence: str

    def renamed(self, name: str) -> Problem:
        """Return the problem with another name of the setting, which also replaces one at the start of the sentence."""
        begins = bool(self.name) and self.sentence.startswith(self.name)
        return Problem(name, name + self.sentence.removeprefix(self.name) if begins else self.sentence)


class SettingsError(ValueError):
    """Refused settings: the message is one sentence about the first of the `problems`."""

    def __init__(self, problems: tuple[Problem, ...]) -> None:
        super().__init__(problems[0].sentence)
        self.problems = problems


def problems_of(kind: type[BaseModel], error: ValidationError) -> Iterator[Problem]:
    """Yield the errors found by pydantic, each as a name and a sentence of our own."""
    for found in error.errors():
        path, field = _path_of(kind, found["loc"])
        name = ".".join(path)
        context = found.get("ctx", {})
        cause = context.get("error")
        match found["type"]:
            case "value_error" if isinstance(cause, SettingsError):
                yield from (inner.renamed(".".join(filter(None, (name, inner.name)))) for inner in cause.problems)
            case "value_error":
                yield Problem(name, str(cause))
            case "extra_forbidden":
                yield Problem(name, unknown_setting(kind, name))
            case "union_tag_not_found":
                yield Problem(name, "{}.{} is missing.".format(name, context["discriminator"].strip("'")))
            case "union_tag_invalid":
                tag = "{}.{}".format(name, context["discriminator"].strip("'"))
                yield Problem(name, f"{tag} is {_shortened(context['tag'])}; allowed are {context['expected_tags']}.")
            case "missing":
                yield Problem(name, f"{name} is missing.")
            case _ if field is not None:
                yield Problem(name, f"{name} is {_shortened(found['input'])}; allowed {allowed_values(field)}.")
            case _:
                yield Problem(name, f"{name or kind.__name__} is {_shortened(found['input'])}: {found['msg']}.")


def _path_of(kind: type[BaseModel], place: tuple[int | str, ...]) -> tuple[list[str], FieldInfo | None]:
    """Return the names on the path to an error, without the tags of unions, and the field of the last name."""
    path: list[str] = []
    field: FieldInfo | None = None
    kinds: tuple[type[BaseModel], ...] = (kind,)
    for number, part in enumerate(map(str, place)):
        owner = next((kind for kind in kinds if part in kind.model_fields), None)
        if owner is not None:
            field = owner.model_fields[part]
            kinds = nested(field)
            path.append(part)
        elif number == len(place) - 1:  # an unknown name
            path.append(part)
            field = None
    return path, field


def allowed_values(field: FieldInfo) -> str:
    """Return the allowed values of a field, as the end of a sentence."""
    options, kind, inner = choices(field), base_type(field), nested(field)
    if options:
        return f"are {enumeration([repr(option) for option in options])}"
    if inner:
        return f"are settings of {enumeration([settings.__name__ for settings in inner])}"
    if kind is bool:
        return "are True and False"
    if kind not in (int, float):
        return f"is {getattr(kind, '__name__', kind)}"
    bounds = {type(bound): bound for bound in field.metadata}
    multiple = multiple_of(field)
    numbers = f"multiples of {multiple}" if multiple > 1 else "whole numbers" if kind is int else "numbers"
    low = f" from {bounds[Ge].ge:g}" if Ge in bounds else f" above {bounds[Gt].gt:g}" if Gt in bounds else ""
    high = f" to {bounds[Le].le:g}" if Le in bounds else f" below {bounds[Lt].lt:g}" if Lt in bounds else ""
    return f"are {numbers}{low}{high}" + (" or None" if NoneType in get_args(field.annotation) else "")


def _shortened(value: object) -> str:
    """Return a value as Python writes it; only its type and length if that is long."""
    if isinstance(value, int) and abs(value) > 10**MAX_SHOWN_CHARACTERS:
        return f"a number of more than {MAX_SHOWN_CHARACTERS} digits"
    if isinstance(value, dict | list | tuple) or len(text := repr(value)) > MAX_SHOWN_CHARACTERS:
        return f"a {type(value).__name__}" + (f" of {len(value)}" if isinstance(value, Sized) else "")
    return text


def unknown_setting(kind: type[BaseModel], name: str, spelling: Callable[[str], str] = str) -> str:
    """Return a sentence about an unknown name, with the one that is probably meant or else all of them.

    `spelling` turns names into the form that the reader uses.
    """
    known = dict(_names(kind))
    plain = _plain(name.rpartition(".")[2])
    meant = [full for full in known if _plain(full.rpartition(".")[2]) == plain]
    meant = meant or get_close_matches(name, known, n=1, cutoff=0.7)
    hint = (
        f"did you mean {spelling(meant[0])}?"
        if meant
        else f"it has {enumeration([*map(spelling, kind.model_fields)])}."
    )
    return f"{getattr(kind, 'title', kind.__name__)} has no setting {spelling(name)!r}; {hint}"


def _names(kind: type[BaseModel], path: str = "") -> Iterator[tuple[str, FieldInfo]]:
    """Yield every setting by its full name, outer ones first."""
    for name, field in kind.model_fields.items():
        yield f"{path}{name}", field
    for name, field in kind.model_fields.items():
        for inner in nested(field):
            yield from _names(inner, f"{path}{name}.")


def _plain(name: str) -> str:
    """Return a name in a spelling in which OpenCV's ``numDisparities`` equals our ``num_disparities``."""
    return name.replace("_", "").lower()


S = TypeVar("S", bound="Settings")


class Settings(BaseModel):
    """Immutable, validated settings.

    Each field declares its title, description, bounds and step, and its markers :class:`Pixels`, :class:`OfThePair`,
    :class:`SliderRange`, :class:`FitsImage` and :class:`Applies`, so that one declaration gives the validation, the
    control on a page, the flag of a command and the JSON.

    Raises
    ------
    SettingsError
        A ``ValueError`` of one sentence that names the setting, its value and the allowed values.
    """

    model_config = ConfigDict(frozen=True, extra="forbid", validate_default=True, defer_build=True)

    def __init__(self, **values: Any) -> None:
        try:
            super().__init__(**values)
        except ValidationError as error:
            raise SettingsError(tuple(problems_of(type(self), error))) from None

    @classmethod
    def model_validate(cls, obj: Any, **options: Any) -> Self:
        """Return the settings described by a document of nested dictionaries; raises as the constructor does."""
        try:
            return super().model_validate(obj, **options)
        except ValidationError as error:
            raise SettingsError(tuple(problems_of(cls, error))) from None

    @classmethod
    def obstacle(cls, name: str, values: Any) -> str | None:
        """Return why a setting has no effect with these values of the others ("needs ..."); None if it has one."""
        rule = marker(cls.model_fields[name], Applies)
        return None if rule is None or rule.condition(values) else rule.reason

    def after_scaling(self, document: dict[str, Any]) -> dict[str, Any]:
        """Return the document of these settings scaled to another image size, with its values consistent again."""
        return document

    @model_validator(mode="after")
    def _nothing_is_ignored(self) -> Self:
        for name, field in type(self).model_fields.items():
            rule, value = marker(field, Applies), getattr(self, name)
            if rule is None or value is None or value is False or value == field.default or value in rule.otherwise:
                continue
            if not rule.condition(self):
                given = "" if isinstance(value, bool | Settings) else f" is {value!r} and"
                raise SettingsError((Problem(name, f"{name}{given} {rule.reason}."),))
        return self


def setting(settings: Settings, name: str) -> Any:
    """Return the value of a setting; a name with dots reaches into nested settings.

    Raises
    ------
    ValueError
        A name that does not exist.
    """
    value: Any = settings
    for part in name.split("."):
        if not isinstance(value, Settings) or part not in type(value).model_fields:
            raise ValueError(unknown_setting(type(settings), name))
        value = getattr(value, part)
    return value


def changed(settings: S, changes: Mapping[str, object]) -> S:
    """Return settings with some values changed and everything validated again.

    Parameters
    ----------
    settings
        The settings to change.
    changes
        {name: value}; a name with dots reaches into nested settings: "search.vertical".

    Raises
    ------
    ValueError
        A name that does not exist or a value that is not allowed.
    """
    document = settings.model_dump()
    for name, value in changes.items():
        setting(settings, name)
        *path, last = name.split(".")
        inner = document
        for key in path:
            inner = inner[key]
        inner[last] = value
    return type(settings).model_validate(document)


def scaled_settings(settings: S, factor: float) -> S:
    """Return settings whose windows and search area cover the same part of images at `factor` times their size.

    Sizes are rounded to values that their field allows, the number of disparities upwards so that the search stays
    complete. Sizes above the allowed maximum are reduced to it, except those of the search.

    Raises
    ------
    ValueError
        A factor so small that the settings become inconsistent, or a search larger than allowed.
    """
    return type(settings).model_validate(_scaled(settings, factor))


def _scaled(settings: Settings, factor: float) -> dict[str, Any]:
    document: dict[str, Any] = {}
    for name, field in type(settings).model_fields.items():
        value, length = getattr(settings, name), marker(field, Pixels)
        if isinstance(value, Settings):
            document[name] = _scaled(value, factor)
        elif length is not None and value and settings.obstacle(name, settings) is None:
            document[name] = _rounded(value, value * factor**length.power, field, rounded_up=length.rounded_up)
        else:
            document[name] = value
    return settings.after_scaling(document)


def _rounded(value: int, wanted: float, field: FieldInfo, *, rounded_up: bool) -> int:
    """Return the allowed whole number nearest to `wanted`, in whole steps from the allowed `value`; never 0."""
    if rounded_up:
        multiple = multiple_of(field)
        return max(multiple, int(-(-wanted // multiple)) * multiple)
    bounds = Bounds.of(field)
    step = int(bounds.step) if marker(field, FitsImage) else 1
    rounded = value - step * round((value - wanted) / step)
    return int(replace(bounds, step=step).nearest(rounded)) or (1 if value > 0 else -1)
