"""The state of a page in its address: a link reopens the page with its choices and settings.

Streamlit's own ``bind="query-params"`` was tried and falls short (`tests/app/test_streamlit_inside.py` fails once it no
longer does):

- a parameter is named after its control's key, which here includes the method and, for settings of the pair, the pair:
  links would be long and would not fit another pair, and existing links could not be read;
- a control in a closed fold or on another tab loses its parameter, so links copied then lack it;
- a value between two steps is accepted, one outside the bounds is dropped silently, and contradictory settings go
  unnoticed.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Generic, NamedTuple, TypeVar

import streamlit as st

from stereolag.core.settings import KIND, Settings, SettingsError
from stereolag.io.sources import escape, quote
from stereolag.ui import prose
from stereolag.ui import streamlit_inside as inside
from stereolag.ui.controls import from_another_page
from stereolag.ui.uploads import OWN

SettingsT = TypeVar("SettingsT", bound=Settings)

NONE = "none"
"""Parameter value for None."""

ON = "on"
"""Parameter value for an optional stage that is switched on, with default settings unless they are given too."""


def parameters_of(settings: Settings, initial: Settings) -> dict[str, str]:
    """Return the settings that differ from the initial ones, by name; names of nested settings are dotted."""
    parameters: dict[str, str] = {}
    for name in type(settings).model_fields:
        value, initial_value = getattr(settings, name), getattr(initial, name)
        if value == initial_value:
            continue
        if not isinstance(value, Settings):
            parameters[name] = _text_of(value)
            continue
        if type(value) is not type(initial_value):
            parameters |= {f"{name}.{KIND}": getattr(value, KIND)} if KIND in type(value).model_fields else {name: ON}
            initial_value = type(value)()
        parameters |= {f"{name}.{inner}": text for inner, text in parameters_of(value, initial_value).items()}
    return parameters


def recalled_settings(
    parameters: Mapping[str, str],
    initial: SettingsT,
    *,
    prefix: str = "",
    check: Callable[[SettingsT], None] = lambda settings: None,
) -> tuple[SettingsT, list[str]]:
    """Return the settings that :func:`parameters_of` wrote, and one sentence per reason for ignoring parameters.

    Unknown and invalid parameters are ignored.

    Parameters
    ----------
    parameters
        Parameters of an address; untrusted.
    initial
        Settings to use for everything the parameters do not mention.
    prefix
        Prefix of the parameter names in the address, used in the sentences about them.
    check
        Raises :class:`~stereolag.core.settings.SettingsError` for settings that are valid but not allowed here.
    """
    remaining = dict(parameters)
    ignored: list[str] = []
    while remaining:
        try:
            settings = type(initial).model_validate(_document(remaining, initial))
            check(settings)
            return settings, ignored
        except SettingsError as error:
            refused = _refused(error, remaining)
        for reason in dict.fromkeys(refused.values()):
            names = [name for name, why in refused.items() if why == reason]
            listed = " and ".join(f"{quote(prefix + name)} = {quote(remaining[name])}" for name in names)
            ignored.append(f"{listed} {'is' if len(names) == 1 else 'are'} ignored: {reason}")
        remaining = {name: text for name, text in remaining.items() if name not in refused}
    return initial, ignored


def _text_of(value: Any) -> str:
    if value is None:
        return NONE
    if isinstance(value, list | tuple):
        return ",".join(map(_text_of, value))
    return str(value).lower() if isinstance(value, bool) else str(value)


def _document(parameters: Mapping[str, str], initial: Settings) -> dict[str, Any]:
    """Return the initial settings as nested dictionaries, overwritten by the parameters."""
    document = initial.model_dump(mode="json")
    # Apply switches and kinds before the settings nested in them: a new kind discards all earlier nested values.
    for name in sorted(parameters, key=lambda name: (name.count("."), name.rpartition(".")[2] != KIND)):
        *parents, last = name.split(".")
        group = document
        for parent in parents:
            inner = group.get(parent)
            if not isinstance(inner, dict):
                inner = group[parent] = {}
            group = inner
        if last == KIND:
            group.clear()
        group[last] = _value_of(parameters[name])
    return document


def _value_of(text: str) -> Any:
    """Return the value of a parameter; commas separate several values."""
    return text.split(",") if "," in text else {NONE: None, ON: {}}.get(text, text)


def _refused(error: SettingsError, parameters: Mapping[str, str]) -> dict[str, str]:
    """Return the parameters to blame, each with the reason; all of them if no single one is at fault."""
    refused: dict[str, str] = {}
    for name, sentence in error.problems:
        parts = set(name.split(".")) - {""}
        blamed = [one for one in parameters if parts and parts <= {part for part in one.split(".") if part != KIND}]
        blamed = blamed or [one for one in parameters if parts & {one.split(".")[0]}]
        refused |= dict.fromkeys(blamed, escape(sentence))
    return refused or dict.fromkeys(parameters, escape(str(error)))


InputsT = TypeVar("InputsT")


class Choice(NamedTuple):
    """A choice on a page: its session-state key, and the values an address may select, the initial one first."""

    key: str
    allowed: list[str]


def example_choice(key: str, examples: Mapping[str, object], *others: str) -> Choice:
    """Return the choice between the examples, own files and `others`.

    An address cannot include own files, but names them so that their settings are not applied to an example.
    """
    return Choice(key, [*examples, OWN, *others])


def new_parameters(key: str) -> dict[str, str] | None:
    """Return the parameters of a new address, which are to be applied; None if the address is not new.

    An opened link is new if it has parameters. A step through the browser's history is new even without parameters:
    the page then returns to its initial state. Not new are an address that the page wrote itself, the previous address
    sent by a browser that has not received the written one yet, and the bare address of a link between pages, which
    keeps the state of the page. That bare address stays in the history below the one the page writes next, and looks
    like the page's first address. So once such a link has led to a page with changed settings, a step back to a bare
    address changes nothing there until the page itself writes a bare one.

    Parameters
    ----------
    key
        Session-state key of the parameters last written by :func:`write_parameters`. The same key followed by ``.seen``
        holds the address with which the browser last requested this page; by ``.bare``, whether a bare address in the
        history stands for another state than the initial one; by ``.settings``, the parameters not applied yet.
    """
    state, found, stepped = st.session_state, st.query_params.to_dict(), inside.is_history_step()
    requested_before, written = state.get(f"{key}.seen"), state.get(key)
    state[f"{key}.seen"] = {**found}  # a copy: the caller removes the parameters it applies
    if written and not found and not stepped and from_another_page():
        state[f"{key}.bare"] = True
    if found == written:
        return None
    if stepped:
        return found if found or not state.get(f"{key}.bare") else None
    return found if found and found != requested_before else None


def write_parameters(key: str, parameters: dict[str, str]) -> None:
    """Write parameters into the address, replacing all others, and record them under `key`."""
    st.session_state[key] = parameters
    if not parameters:
        st.session_state[f"{key}.bare"] = False
    if (found := st.query_params.to_dict()) != parameters:
        st.session_state[f"{key}.seen"] = found
        st.query_params.from_dict(parameters)


def warn_ignored(name: str, value: str, allowed: Sequence[str]) -> None:
    """Warn that a parameter is ignored because its value is not allowed."""
    prose.warning(f"{name} = {quote(value)} in the address is ignored: allowed are {', '.join(allowed)}.")


@dataclass(frozen=True)
class Address(Generic[InputsT]):
    """The address of a page: its choices, and the settings that differ from the initial ones.

    Attributes
    ----------
    key
        Session-state key of the parameters that the page wrote last.
    choices
        Returns the choices by their names in the address.
    initial
        Returns the initial settings for the given inputs, by the prefix of their parameters.
    set_controls
        Takes settings and the inputs, and sets the controls to these settings.
    check
        Raises :class:`~stereolag.core.settings.SettingsError` for values that the inputs do not allow.
    """

    key: str
    choices: Callable[[], Mapping[str, Choice]]
    initial: Callable[[InputsT], Mapping[str, Settings]]
    set_controls: Callable[[Any, InputsT], None]
    check: Callable[[Any, InputsT], None] = lambda settings, inputs: None

    def recall_choices(self) -> dict[str, str] | None:
        """Apply the choices that a new address names, and reset the others to their initial values.

        Call it before the choices are drawn. Return the other parameters, which are kept until
        :meth:`recall_settings` takes them, in this run or a later one; None if the address is not new.
        """
        found = new_parameters(self.key)
        if found is None:
            return None
        for name, choice in self.choices().items():
            value = found.pop(name, None)
            if value in choice.allowed:
                st.session_state[choice.key] = value
                continue
            if st.session_state.get(choice.key) in choice.allowed:
                st.session_state[choice.key] = choice.allowed[0]
            if value is not None:
                warn_ignored(name, value, choice.allowed)
        st.session_state[f"{self.key}.settings"] = found
        return found

    def recall_settings(self, inputs: InputsT) -> None:
        """Set the controls to the settings of a new address, or to their initial values where it gives none.

        Call it before the controls are drawn.
        """
        found: dict[str, str] | None = st.session_state.pop(f"{self.key}.settings", None)
        if found is None:
            return
        groups = self.initial(inputs)
        for prefix, initial in groups.items():
            longer_prefixes = tuple(one for one in groups if one != prefix and one.startswith(prefix))
            own = [name for name in found if name.startswith(prefix) and not name.startswith(longer_prefixes)]
            recalled, ignored = recalled_settings(
                {name.removeprefix(prefix): found[name] for name in own},
                initial,
                prefix=prefix,
                check=lambda settings: self.check(settings, inputs),
            )
            self.set_controls(recalled, inputs)
            for sentence in ignored:
                prose.warning(f"In the address, {sentence}")

    def recalled(self, ask: Callable[[], InputsT]) -> InputsT:
        """Apply the choices and settings of a new address, and return the inputs from `ask`."""
        self.recall_choices()
        inputs = ask()
        self.recall_settings(inputs)
        return inputs

    def write(self, inputs: InputsT, settings: Mapping[str, Settings], **more: str) -> None:
        """Write the choices and settings that differ from their initial ones, and `more`; settings come by prefix."""
        initial = self.initial(inputs)
        parameters = self._changed_choices() | more
        for prefix, now in settings.items():
            parameters |= {prefix + name: text for name, text in parameters_of(now, initial[prefix]).items()}
        write_parameters(self.key, parameters)

    def write_choices(self) -> None:
        """Write only the choices, while there are no inputs yet."""
        write_parameters(self.key, self._changed_choices())

    def _changed_choices(self) -> dict[str, str]:
        """Return the choices that differ from their initial values, as parameters."""
        return {
            name: value
            for name, choice in self.choices().items()
            if (value := st.session_state.get(choice.key)) in choice.allowed[1:]
        }
