"""The state of the depth page in its address: a link opens the page as it was."""

from __future__ import annotations

from collections.abc import Iterable, Mapping

import streamlit as st

from stereolag import samples
from stereolag.export import settings_json
from stereolag.reading import read_matcher
from stereolag.reading.sources import quoted
from stereolag.stereo.matcher import StereoMatcher
from stereolag.stereo.methods import METHODS
from stereolag.stereo.opencv import StereoBM, StereoSGBM
from stereolag.stereo.windows.matcher import CorrelationMatcher
from stereolag.ui.addresses import parameters_of, settings_of
from stereolag.ui.choices import OWN
from stereolag.ui.depth.inputs import DIVISORS
from stereolag.ui.matcher_controls import set_controls
from stereolag.ui.matchers import first_settings
from stereolag.ui.pairs import StereoPair

WRITTEN_KEY = "depth.address"
"""In the session's state: the parameters as this page wrote them last."""

PREFIXES: dict[type[StereoMatcher], str] = {CorrelationMatcher: "", StereoBM: "bm.", StereoSGBM: "sgbm."}
"""What stands before the settings of each method."""

PAIR, SIZE = "pair", "size"


def recall_choices(key: str) -> dict[str, str]:
    """Choose the example and the size that a new address names; return its other parameters, for the settings.

    An address is new when it is not what this page wrote last: a link that was opened, or a step back.
    """
    found = st.query_params.to_dict()
    if not found or found == st.session_state.get(WRITTEN_KEY):
        return {}
    for name, allowed, place in ((PAIR, samples.stereo_pairs(), key), (SIZE, DIVISORS, f"{key}.size")):
        value = found.pop(name, None)
        if value in allowed:
            st.session_state[place] = value
        elif value is not None:
            st.warning(f"{name} = {quoted(value)} in the address is ignored: allowed are {', '.join(allowed)}.")
    return found


def recall_settings(parameters: Mapping[str, str], pair: StereoPair) -> None:
    """Set the controls, none of which must be drawn yet, to the settings that an address names."""
    if not parameters:
        return
    for kind in METHODS.values():
        prefix = PREFIXES[kind]
        named = {name.removeprefix(prefix): text for name, text in parameters.items() if _prefix(name) == prefix}
        recalled = settings_of(named, first_settings(kind, pair), prefix=prefix)
        set_controls(recalled.settings, pair)
        for sentence in recalled.ignored:
            st.warning(f"In the address, {sentence}")


def write_address(pair: StereoPair, matchers: Iterable[StereoMatcher | None], key: str = "pairs") -> None:
    """Put what is chosen and set into the address, as far as it is not as at first."""
    chosen, size = st.session_state.get(key), st.session_state.get(f"{key}.size")
    parameters: dict[str, str] = {}
    if chosen not in (None, OWN, next(iter(samples.stereo_pairs()))):
        parameters[PAIR] = chosen
    if size not in (None, next(iter(DIVISORS))):
        parameters[SIZE] = size
    for matcher in matchers:
        if matcher is not None:
            found = parameters_of(matcher, first_settings(type(matcher), pair))
            parameters |= {PREFIXES[type(matcher)] + name: text for name, text in found.items()}
    st.session_state[WRITTEN_KEY] = parameters
    if st.query_params.to_dict() != parameters:
        st.query_params.from_dict(parameters)


def _prefix(name: str) -> str:
    return next((prefix for prefix in PREFIXES.values() if prefix and name.startswith(prefix)), "")


ADOPTED = "depth.adopt"
"""In the session's state: the settings to take over, as :func:`stereolag.reading.matchers.read_matcher` reads them."""


def adopt(matcher: StereoMatcher) -> None:
    """Hand settings over to the page, which runs again from its top and sets its controls to them."""
    st.session_state[ADOPTED] = settings_json(matcher)
    st.rerun(scope="app")


def take_over(pair: StereoPair) -> None:
    """Set the controls, none of which must be drawn yet, to the settings that were handed over, if there are any."""
    handed_over: str | None = st.session_state.pop(ADOPTED, None)
    if handed_over is not None:
        set_controls(read_matcher(handed_over.encode()), pair)
