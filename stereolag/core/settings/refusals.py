"""Errors of refused settings, in one sentence: the setting, its value, and the allowed values."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sized
from difflib import get_close_matches
from types import NoneType
from typing import Any, NamedTuple, get_args

from annotated_types import Ge, Gt, Le, Lt, MultipleOf
from pydantic import BaseModel, ValidationError
from pydantic.fields import FieldInfo

from stereolag.core.settings.fields import base_type, choices, nested

LONGEST_SHOWN = 60


class Problem(NamedTuple):
    """A problem with one setting: its name, with dots if it is nested, and a sentence."""

    name: str
    sentence: str


class SettingsError(ValueError):
    """The error of refused settings: the message is one sentence, about the first of the `problems`."""

    def __init__(self, problems: tuple[Problem, ...]) -> None:
        super().__init__(problems[0].sentence)
        self.problems = problems


def problems_of(kind: type[BaseModel], error: ValidationError) -> Iterator[Problem]:
    """Yield the errors found by pydantic, each as a name and a sentence of our own."""
    for found in error.errors():
        path, field = _followed(kind, found["loc"])
        name = ".".join(path)
        cause = found.get("ctx", {}).get("error")
        if isinstance(cause, SettingsError):
            yield from (Problem(".".join(filter(None, (name, one.name))), one.sentence) for one in cause.problems)
        elif found["type"] == "value_error":
            yield Problem(name, str(cause))
        elif found["type"] == "extra_forbidden":
            yield Problem(name, unknown_setting(kind, name))
        elif found["type"].startswith("union_tag"):
            yield Problem(name, _kind_refused(name, found))
        elif found["type"] == "missing":
            yield Problem(name, f"{name} is missing.")
        elif field is not None:
            yield Problem(name, f"{name} is {_shown(found['input'])}; allowed {allowed_values(field)}.")
        else:
            yield Problem(name, f"{name or kind.__name__} is {_shown(found['input'])}: {found['msg']}.")


def _kind_refused(name: str, found: Mapping[str, Any]) -> str:
    """Return a sentence about settings whose kind is unknown or missing."""
    context = found["ctx"]
    kind = context["discriminator"].strip("'")
    if "tag" not in context:
        return f"{name}.{kind} is missing."
    return f"{name}.{kind} is {_shown(context['tag'])}; allowed are {context['expected_tags']}."


def _followed(kind: type[BaseModel], place: tuple[int | str, ...]) -> tuple[list[str], FieldInfo | None]:
    """Return the names on the path to an error, without the tags of unions, and the field of the last name."""
    path: list[str] = []
    field: FieldInfo | None = None
    kinds: tuple[type[BaseModel], ...] = (kind,)
    for number, part in enumerate(map(str, place)):
        holder = next((one for one in kinds if part in one.model_fields), None)
        if holder is not None:
            field = holder.model_fields[part]
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
        return f"are {_listed([repr(one) for one in options])}"
    if inner:
        return f"are settings of {_listed([one.__name__ for one in inner])}"
    if kind is bool:
        return "are True and False"
    if kind not in (int, float):
        return f"is {getattr(kind, '__name__', kind)}"
    ends = {type(one): one for one in field.metadata}
    multiple = ends[MultipleOf].multiple_of if MultipleOf in ends else None
    what = f"multiples of {multiple}" if multiple else "whole numbers" if kind is int else "numbers"
    low = f" from {ends[Ge].ge:g}" if Ge in ends else f" above {ends[Gt].gt:g}" if Gt in ends else ""
    high = f" to {ends[Le].le:g}" if Le in ends else f" below {ends[Lt].lt:g}" if Lt in ends else ""
    return f"are {what}{low}{high}" + (" or None" if NoneType in get_args(field.annotation) else "")


def _shown(value: object) -> str:
    """Return a value as Python writes it, shortened, since it may come from anywhere."""
    if isinstance(value, int) and abs(value) > 10**LONGEST_SHOWN:
        return f"a number of more than {LONGEST_SHOWN} digits"
    if isinstance(value, dict | list | tuple) or len(text := repr(value)) > LONGEST_SHOWN:
        return f"a {type(value).__name__}" + (f" of {len(value)}" if isinstance(value, Sized) else "")
    return text


def _listed(words: list[str]) -> str:
    return " and ".join(filter(None, (", ".join(words[:-1]), words[-1])))


def unknown_setting(kind: type[BaseModel], name: str) -> str:
    """Return a sentence about an unknown name, with the name that is probably meant."""
    known = dict(_names(kind))
    plain = _plain(name.rpartition(".")[2])
    meant = [full for full in known if _plain(full.rpartition(".")[2]) == plain]
    meant = meant or get_close_matches(name, known, n=1, cutoff=0.7)
    return f"{kind.__name__} has no setting {name!r}" + (f"; did you mean {meant[0]}?" if meant else ".")


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
