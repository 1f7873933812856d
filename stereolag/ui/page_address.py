"""The state of a page in its address: a link reopens the page with its choices and settings."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Generic, NamedTuple, TypeVar

import streamlit as st

from stereolag import streamlit_inside as inside
from stereolag.core.settings import Settings
from stereolag.io.sources import quoted
from stereolag.ui import prose
from stereolag.ui.addresses import parameters_of, recalled_settings
from stereolag.ui.choices import OWN
from stereolag.ui.controls import adopt_value
from stereolag.ui.persistence import from_another_page

InputsT = TypeVar("InputsT")
SettingsT = TypeVar("SettingsT", bound=Settings)


class Choice(NamedTuple):
    """A choice on a page: its session-state key, and the values an address may select, the initial one first."""

    key: str
    allowed: list[str]


def example_choice(key: str, examples: Mapping[str, object]) -> Choice:
    """Return the choice of an example; own files are not allowed, because an address does not include them."""
    return Choice(key, [name for name in examples if name != OWN])


def new_parameters(written: str) -> dict[str, str] | None:
    """Return the parameters of a new address, which are to be applied; None if the address is not new.

    An opened link is new if it has parameters. A step through the browser's history is new even without parameters:
    the page then returns to its initial state. Not new are an address the page wrote itself, the previous address sent
    by a browser that has not received the written one yet, and the bare address of a link between pages, which keeps
    the state of the page. That bare address stays in the history below the one the page writes next, and looks like
    the page's first address. So once such a link has led to a page with changed settings, a step back to a bare address
    changes nothing there until the page itself writes a bare one.

    Parameters
    ----------
    written
        The session-state key of the parameters last written by :func:`write_parameters`.
    """
    state, found, stepped = st.session_state, st.query_params.to_dict(), inside.is_history_step()
    seen, last = state.get(_seen_key(written)), state.get(written)
    state[_seen_key(written)] = found
    if last and not found and not stepped and from_another_page():
        state[_bare_key(written)] = True
    if found == last:
        return None
    if stepped:
        return found if found or not state.get(_bare_key(written)) else None
    return found if found and found != seen else None


def choose_named(found: dict[str, str], choices: Mapping[str, Choice]) -> None:
    """Apply the choices that a new address names, removing them from `found`; reset the others to their initial values.

    The visitor's own files, which no address can name, stay chosen until an address names an example. The choices must
    not have been drawn yet.
    """
    for name, choice in choices.items():
        value = found.pop(name, None)
        if value in choice.allowed:
            st.session_state[choice.key] = value
            continue
        if st.session_state.get(choice.key) in choice.allowed:
            st.session_state[choice.key] = choice.allowed[0]
        if value is not None:
            warn_ignored(name, value, choice.allowed)


def keep_settings(written: str, parameters: dict[str, str]) -> None:
    """Keep the parameters of settings until the page has its inputs, in this run or a later one."""
    st.session_state[_kept_key(written)] = parameters


def kept_settings(written: str) -> dict[str, str] | None:
    """Return the kept parameters of settings and forget them; None if there are none."""
    kept: dict[str, str] | None = st.session_state.pop(_kept_key(written), None)
    return kept


def chosen(choices: Mapping[str, Choice]) -> dict[str, str]:
    """Return the choices that differ from their initial values, as parameters."""
    values = {name: st.session_state.get(choice.key) for name, choice in choices.items()}
    return {name: value for name, value in values.items() if value in choices[name].allowed[1:]}


def write_parameters(written: str, parameters: dict[str, str]) -> None:
    """Write parameters into the address, replacing all others."""
    st.session_state[written] = parameters
    if not parameters:
        st.session_state[_bare_key(written)] = False
    if (found := st.query_params.to_dict()) != parameters:
        st.session_state[_seen_key(written)] = found
        st.query_params.from_dict(parameters)


def warn_ignored(name: str, value: str, allowed: Sequence[str]) -> None:
    """Warn that a parameter is ignored because its value is not allowed."""
    prose.warning(f"{name} = {quoted(value)} in the address is ignored: allowed are {', '.join(allowed)}.")


@dataclass(frozen=True)
class SettingsAddress(Generic[InputsT, SettingsT]):
    """The address of a page with one choice of inputs and one settings object.

    Attributes
    ----------
    written
        Session-state key of the parameters the page wrote last.
    choices
        Returns the choices by their names in the address.
    first
        Returns the initial settings for the given inputs.
    key
        Returns the key of the control of a setting, given its name and the inputs.
    check
        Raises :class:`~stereolag.core.settings.SettingsError` for values that the inputs do not allow.
    """

    written: str
    choices: Callable[[], Mapping[str, Choice]]
    first: Callable[[InputsT], SettingsT]
    key: Callable[[str, InputsT], str]
    check: Callable[[SettingsT, InputsT], None] = lambda settings, inputs: None

    def recalled(self, ask: Callable[[], InputsT]) -> InputsT:
        """Apply the choices and settings of a new address, and return the inputs from `ask`.

        The controls of the settings must not have been drawn yet.
        """
        found = new_parameters(self.written)
        if found is not None:
            choose_named(found, self.choices())
            keep_settings(self.written, found)
        inputs = ask()
        named = kept_settings(self.written)
        if named is not None:
            first = self.first(inputs)
            recalled = recalled_settings(named, first, check=lambda settings: self.check(settings, inputs))
            for name in type(first).model_fields:
                adopt_value(self.key(name, inputs), getattr(recalled.settings, name))
            for sentence in recalled.ignored:
                prose.warning(f"In the address, {sentence}")
        return inputs

    def write(self, settings: SettingsT, inputs: InputsT) -> None:
        """Write the choices and settings that differ from their initial values into the address."""
        write_parameters(self.written, chosen(self.choices()) | parameters_of(settings, self.first(inputs)))


def _seen_key(written: str) -> str:
    """Return the key of the address with which the browser last requested this page."""
    return f"{written}.seen"


def _bare_key(written: str) -> str:
    """Return the key of the flag for a bare address in the history at which the page was not in its initial state."""
    return f"{written}.bare"


def _kept_key(written: str) -> str:
    return f"{written}.settings"
