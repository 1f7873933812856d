"""The base class of all settings: immutable, validated in one place, described by its own fields."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Self, TypeVar

from annotated_types import Ge, Le, MultipleOf
from pydantic import BaseModel, ConfigDict, ValidationError, model_validator
from pydantic.fields import FieldInfo

from stereolag.core.settings.fields import Applies, Bounds, FitsImage, Pixels, marker
from stereolag.core.settings.refusals import Problem, SettingsError, problems_of, unknown_setting

S = TypeVar("S", bound="Settings")


class Settings(BaseModel):
    """Immutable, validated settings.

    Each field declares its title, description, bounds and step, and its markers :class:`Pixels`, :class:`OfThePair`,
    :class:`Usual`, :class:`FitsImage` and :class:`Applies`, so that one declaration gives the validation, the control
    on a page, the flag of a command and the JSON.

    Raises
    ------
    SettingsError
        A ``ValueError`` of one sentence that names the setting, its value and the allowed values.
    """

    model_config = ConfigDict(frozen=True, extra="forbid", validate_default=True)

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
        holder = document
        for key in path:
            holder = holder[key]
        holder[last] = value
    return type(settings).model_validate(document)


def scaled_settings(settings: S, factor: float) -> S:
    """Return settings whose windows and search area cover the same part of images at `factor` times their size.

    Sizes are rounded to values that their field allows, the number of disparities upwards, so that nothing drops out
    of the search. Sizes above the allowed maximum are reduced to it, except in the search.

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
        declared = marker(field, MultipleOf)
        multiple = int(declared.multiple_of) if declared else 1  # type: ignore[call-overload]
        return max(multiple, int(-(-wanted // multiple)) * multiple)
    step = int(Bounds.of(field).step) if marker(field, FitsImage) else 1
    rounded = value - step * round((value - wanted) / step)
    least, most = marker(field, Ge), marker(field, Le)
    low = int(least.ge) if least else rounded  # type: ignore[call-overload]
    high = int(most.le) if most else rounded  # type: ignore[call-overload]
    if rounded > high:
        rounded = value + step * ((high - value) // step)
    return max(rounded, low) or (1 if value > 0 else -1)
