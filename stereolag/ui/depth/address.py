"""The state of the depth page in its address: a link opens the page as it was."""

from __future__ import annotations

from collections.abc import Iterable

import streamlit as st

from stereolag import samples
from stereolag.io.settings import read_matcher, settings_json
from stereolag.pair import SIZES, Pair
from stereolag.stereo.matcher import StereoMatcher
from stereolag.stereo.methods import METHODS
from stereolag.ui import keys, prose
from stereolag.ui.addresses import (
    Choice,
    choose_named,
    chosen,
    example_choice,
    keep_settings,
    kept_settings,
    new_parameters,
    parameters_of,
    recalled_settings,
    warn_ignored,
    write_parameters,
)
from stereolag.ui.controls import default_settings, set_controls
from stereolag.ui.depth.maps import SHOWN_AT_FIRST, show_method, shown_methods

WRITTEN_KEY = "depth.address"
"""Session-state key of the parameters that this page wrote last."""

MAPS = "maps"
"""The parameter that names the maps shown."""

ADOPTED = "depth.adopt"
"""Session-state key of the settings to adopt, as read by :func:`stereolag.io.settings.read_matcher`."""


def recall_choices() -> None:
    """Apply the example, size and maps that a new address names, and keep its settings for later."""
    found = new_parameters(WRITTEN_KEY)
    if found is not None:
        choose_named(found, _choices())
        _recall_maps(found.pop(MAPS, None))
        keep_settings(WRITTEN_KEY, found)


def _recall_maps(value: str | None) -> None:
    """Choose the maps that an address names; the initial ones if it names none."""
    allowed = [method.short_name for method in METHODS]
    named = [] if value is None else value.split(",")
    if named and set(named) <= set(allowed):
        st.session_state[keys.SHOWN] = [name for name in allowed if name in named]
        st.session_state[keys.TAB] = named[0]
        return
    if keys.SHOWN in st.session_state:
        st.session_state[keys.SHOWN] = [*SHOWN_AT_FIRST]
    if st.session_state.get(keys.TAB, SHOWN_AT_FIRST[0]) not in SHOWN_AT_FIRST:
        st.session_state[keys.TAB] = SHOWN_AT_FIRST[0]
    if value is not None:
        warn_ignored(MAPS, value, allowed)


def recall_settings(pair: Pair) -> None:
    """Set the controls to the settings of a new address, the rest to initial values; none must have been drawn yet."""
    parameters = kept_settings(WRITTEN_KEY)
    if parameters is None:
        return
    for kind in METHODS:
        prefix = _prefix(kind)
        named = {name.removeprefix(prefix): text for name, text in parameters.items() if _prefix_of(name) == prefix}
        recalled = recalled_settings(named, default_settings(kind, pair), prefix=prefix)
        set_controls(recalled.settings, pair)
        for sentence in recalled.ignored:
            prose.warning(f"In the address, {sentence}")


def write_address(pair: Pair, matchers: Iterable[StereoMatcher | None]) -> None:
    """Write the choices and settings that differ from their initial values into the address."""
    parameters = chosen(_choices())
    shown = [method.short_name for method in shown_methods()]
    if shown and shown != SHOWN_AT_FIRST:
        parameters[MAPS] = ",".join(shown)
    for matcher in matchers:
        if matcher is not None:
            found = parameters_of(matcher, default_settings(type(matcher), pair))
            parameters |= {_prefix(type(matcher)) + name: text for name, text in found.items()}
    write_parameters(WRITTEN_KEY, parameters)


def adopt(matcher: StereoMatcher) -> None:
    """Hand settings over to the page, and rerun it from the top so that it sets its controls to them."""
    st.session_state[ADOPTED] = settings_json(matcher)
    st.rerun(scope="app")


def take_over(pair: Pair) -> None:
    """Show the settings that were handed over, if any; no control must have been drawn yet in this run."""
    handed_over: str | None = st.session_state.pop(ADOPTED, None)
    if handed_over is not None:
        show_settings(read_matcher(handed_over.encode()), pair)


def show_settings(matcher: StereoMatcher, pair: Pair) -> None:
    """Set the controls of a method to these settings, and show its controls and its map."""
    set_controls(matcher, pair)
    st.session_state[keys.TAB] = matcher.short_name
    show_method(type(matcher))


def _choices() -> dict[str, Choice]:
    """Return the choices that an address can name, by parameter."""
    return {"pair": example_choice(keys.PAIR, samples.stereo_pairs()), "size": Choice(keys.SIZE, [*SIZES])}


def _prefix(kind: type[StereoMatcher]) -> str:
    """Return the parameter prefix of a method's settings; empty for the first method."""
    return "" if kind is METHODS[0] else f"{kind.short_name}."


def _prefix_of(name: str) -> str:
    return next((prefix for prefix in map(_prefix, METHODS) if prefix and name.startswith(prefix)), "")
