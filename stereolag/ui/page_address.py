"""What is chosen and set on a page as the address of the page: a link opens the page as it was."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Generic, NamedTuple, TypeVar

import streamlit as st

from stereolag.reading.sources import quoted
from stereolag.settings import Settings
from stereolag.ui import prose
from stereolag.ui.addresses import parameters_of, recalled_settings
from stereolag.ui.choices import OWN
from stereolag.ui.controls import adopt_value

InputsT = TypeVar("InputsT")
SettingsT = TypeVar("SettingsT", bound=Settings)


class Choice(NamedTuple):
    """Something to choose on a page: the key it is kept under, and what an address may choose, first what holds."""

    key: str
    allowed: list[str]


def example_choice(key: str, examples: Mapping[str, object]) -> Choice:
    """Return the choice of an example; files of the visitor's own are none, for an address does not hold them."""
    return Choice(key, [name for name in examples if name != OWN])


def recalled_choices(written: str, choices: Mapping[str, Choice]) -> dict[str, str]:
    """Choose what a new address names; return its other parameters. The choices must not be drawn yet.

    An address is new when it is not what this page wrote last: a link that was opened, or a step back.

    Parameters
    ----------
    written
        The key under which :func:`write_parameters` keeps what it wrote.
    choices
        By their names in the address.
    """
    found = st.query_params.to_dict()
    if not found or found == st.session_state.get(written):
        return {}
    for name, choice in choices.items():
        value = found.pop(name, None)
        if value in choice.allowed:
            st.session_state[choice.key] = value
        elif value is not None:
            warn_ignored(name, value, choice.allowed)
    return found


def chosen(choices: Mapping[str, Choice]) -> dict[str, str]:
    """Return as parameters what is chosen, as far as it is not as at first."""
    values = {name: st.session_state.get(choice.key) for name, choice in choices.items()}
    return {name: value for name, value in values.items() if value in choices[name].allowed[1:]}


def write_parameters(written: str, parameters: dict[str, str]) -> None:
    """Put parameters into the address, in place of all others."""
    st.session_state[written] = parameters
    if st.query_params.to_dict() != parameters:
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
        named = recalled_choices(self.written, self.choices())
        inputs = ask()
        if named:
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
