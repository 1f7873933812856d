"""Settings as URL parameters: short, readable, and validated when read back."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any, NamedTuple, TypeVar

from stereolag.core.settings import Settings, SettingsError
from stereolag.io.sources import harmless, quoted

SettingsT = TypeVar("SettingsT", bound=Settings)

NOTHING, ON = "none", "on"
"""Parameter values for None, and for an optional stage switched on; its settings are the defaults unless given too."""

KIND = "kind"
"""The discriminator field of settings that come in several kinds."""


class Recalled(NamedTuple):
    """Settings read from an address, and one sentence per reason why some parameters were ignored."""

    settings: Any
    ignored: list[str]


def parameters_of(settings: Settings, first: Settings) -> dict[str, str]:
    """Return the settings that differ from `first`, by name; names of nested settings are dotted."""
    found: dict[str, str] = {}
    for name in type(settings).model_fields:
        value, usual = getattr(settings, name), getattr(first, name)
        if value == usual:
            continue
        if not isinstance(value, Settings):
            found[name] = _written(value)
            continue
        if type(value) is not type(usual):
            has_kind = KIND in type(value).model_fields
            found |= {f"{name}.{KIND}": getattr(value, KIND)} if has_kind else {name: ON}
            usual = type(value)()
        found |= {f"{name}.{inner}": text for inner, text in parameters_of(value, usual).items()}
    return found


def recalled_settings(
    parameters: Mapping[str, str],
    first: SettingsT,
    *,
    prefix: str = "",
    check: Callable[[SettingsT], None] = lambda settings: None,
) -> Recalled:
    """Return the settings that :func:`parameters_of` wrote; unknown or invalid parameters are ignored.

    Parameters
    ----------
    parameters
        Parameters of an address; untrusted.
    first
        Settings to use for everything the parameters do not mention.
    prefix
        Prefix of the parameter names in the address, used in the sentences about them.
    check
        Raises :class:`~stereolag.core.settings.SettingsError` for settings that are valid but not allowed here.
    """
    wanted = dict(parameters)
    ignored: list[str] = []
    while wanted:
        try:
            settings = type(first).model_validate(_document(wanted, first))
            check(settings)
            return Recalled(settings, ignored)
        except SettingsError as error:
            refused = _refused(error, wanted)
        for reason in dict.fromkeys(refused.values()):
            alike = [name for name, why in refused.items() if why == reason]
            said = " and ".join(f"{quoted(prefix + name)} = {quoted(wanted[name])}" for name in alike)
            ignored.append(f"{said} {'is' if len(alike) == 1 else 'are'} ignored: {reason}")
        wanted = {name: text for name, text in wanted.items() if name not in refused}
    return Recalled(first, ignored)


def _written(value: Any) -> str:
    if value is None:
        return NOTHING
    if isinstance(value, list | tuple):
        return ",".join(map(_written, value))
    return str(value).lower() if isinstance(value, bool) else str(value)


def _document(parameters: Mapping[str, str], first: Settings) -> dict[str, Any]:
    """Return `first` as nested dictionaries, overwritten by the parameters."""
    document = first.model_dump(mode="json")
    # Apply switches and kinds before the settings nested in them: a new kind discards all earlier nested values.
    for name in sorted(parameters, key=lambda name: (name.count("."), name.rpartition(".")[2] != KIND)):
        *within, last = name.split(".")
        place = document
        for part in within:
            inner = place.get(part)
            if not isinstance(inner, dict):
                inner = place[part] = {}
            place = inner
        if last == KIND:
            place.clear()
        place[last] = _read(parameters[name])
    return document


def _read(text: str) -> Any:
    """Return the value of a parameter; commas separate several values."""
    return text.split(",") if "," in text else {NOTHING: None, ON: {}}.get(text, text)


def _refused(error: SettingsError, parameters: Mapping[str, str]) -> dict[str, str]:
    """Return the parameters to blame, each with the reason; all of them if no single one is at fault."""
    refused: dict[str, str] = {}
    for name, sentence in error.problems:
        parts = set(name.split(".")) - {""}
        blamed = [one for one in parameters if parts and parts <= {part for part in one.split(".") if part != KIND}]
        blamed = blamed or [one for one in parameters if parts & {one.split(".")[0]}]
        refused |= dict.fromkeys(blamed, harmless(sentence))
    return refused or dict.fromkeys(parameters, harmless(str(error)))
