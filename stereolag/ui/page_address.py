"""What is chosen and set on a page as the address of the page: a link opens the page as it was."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Generic, NamedTuple, TypeVar

import streamlit as st
from streamlit.runtime.scriptrunner import get_script_run_ctx

from stereolag.reading.sources import quoted
from stereolag.settings import Settings
from stereolag.ui import prose
from stereolag.ui.addresses import parameters_of, recalled_settings
from stereolag.ui.choices import OWN
from stereolag.ui.controls import adopt_value
from stereolag.ui.persistence import from_another_page

InputsT = TypeVar("InputsT")
SettingsT = TypeVar("SettingsT", bound=Settings)


class Choice(NamedTuple):
    """Something to choose on a page: the key it is kept under, and what an address may choose, first what holds."""

    key: str
    allowed: list[str]


def example_choice(key: str, examples: Mapping[str, object]) -> Choice:
    """Return the choice of an example; files of the visitor's own are none, for an address does not hold them."""
    return Choice(key, [name for name in examples if name != OWN])


def new_parameters(written: str) -> dict[str, str] | None:
    """Return the parameters of a new address, which are to be chosen and set; None where it is not new.

    A link that was opened is new where it names something; a step through the browser's history also where it names
    nothing: then all is as at first. Not new are what the page wrote itself, what a browser sends that has not heard of
    it yet, and the bare address of a link between the pages, after which all stays as it was. That one stays in the
    history, below what the page then writes, and cannot be told from the page's first: once such a link has led to a
    page that was set, a step back to a bare address changes nothing there, until the page writes a bare one itself.

    Parameters
    ----------
    written
        The key under which :func:`write_parameters` keeps what it wrote.
    """
    state, found, stepped = st.session_state, st.query_params.to_dict(), _stepped()
    seen, last = state.get(_seen_key(written)), state.get(written)
    state[_seen_key(written)] = found
    if last and not found and not stepped and from_another_page():
        state[_bare_key(written)] = True
    if found == last:
        return None
    if stepped:
        return found if found or not state.get(_bare_key(written)) else None
    return found if found and found != seen else None


def _stepped() -> bool:
    """Return whether a step back or forward in the browser led to this run."""
    return bool(getattr(get_script_run_ctx(), "is_history_navigation", False))


def choose_named(found: dict[str, str], choices: Mapping[str, Choice]) -> None:
    """Choose what a new address names, which is taken out of it; of all others what holds at first.

    Files of the visitor's own, which no address names, stay chosen until one names an example. The choices must not be
    drawn yet.
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
    """Keep the parameters that name settings until the page has its inputs, in this run or in one after it."""
    st.session_state[_kept_key(written)] = parameters


def kept_settings(written: str) -> dict[str, str] | None:
    """Return the parameters that name settings, once; None where there is nothing to be set."""
    kept: dict[str, str] | None = st.session_state.pop(_kept_key(written), None)
    return kept


def chosen(choices: Mapping[str, Choice]) -> dict[str, str]:
    """Return as parameters what is chosen, as far as it is not as at first."""
    values = {name: st.session_state.get(choice.key) for name, choice in choices.items()}
    return {name: value for name, value in values.items() if value in choices[name].allowed[1:]}


def write_parameters(written: str, parameters: dict[str, str]) -> None:
    """Put parameters into the address, in place of all others."""
    st.session_state[written] = parameters
    if not parameters:
        st.session_state[_bare_key(written)] = False
    if (found := st.query_params.to_dict()) != parameters:
        st.session_state[_seen_key(written)] = found
        st.query_params.from_dict(parameters)


def warn_ignored(name: str, value: str, allowed: Sequence[str]) -> None:
    """Say that a parameter is not what it may be."""
    prose.warning(f"{name} = {quoted(value)} in the address is ignored: allowed are {', '.join(allowed)}.")


@dataclass(frozen=True)
class SettingsAddress(Generic[InputsT, SettingsT]):
    """The address of a page with one choice of inputs and one settings object.

    Attributes
    ----------
    written
        The key under which the page keeps what it wrote.
    choices
        Returns the choices by their names in the address.
    first
        Returns the settings that hold for some inputs at first; refused are values that these inputs do not allow.
    key
        Returns the key of the control of a setting, by its name, for some inputs.
    check
        Raises :class:`~stereolag.settings.SettingsError` where settings do not suit the inputs.
    """

    written: str
    choices: Callable[[], Mapping[str, Choice]]
    first: Callable[[InputsT], SettingsT]
    key: Callable[[str, InputsT], str]
    check: Callable[[SettingsT, InputsT], None] = lambda settings, inputs: None

    def recalled(self, ask: Callable[[], InputsT]) -> InputsT:
        """Return the inputs that `ask` asks for, both they and the settings chosen as a new address says.

        The controls of the settings must not be drawn yet.
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
        """Put what is chosen and set into the address, as far as it is not as at first."""
        write_parameters(self.written, chosen(self.choices()) | parameters_of(settings, self.first(inputs)))


def _seen_key(written: str) -> str:
    """Return the key of the address with which the browser asked for this page last."""
    return f"{written}.seen"


def _bare_key(written: str) -> str:
    """Return the key of whether the history may hold a bare address at which the page was not as at first."""
    return f"{written}.bare"


def _kept_key(written: str) -> str:
    return f"{written}.settings"
