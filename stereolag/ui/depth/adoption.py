"""Settings that a part of the depth page found, handed over to its controls."""

from __future__ import annotations

import streamlit as st

from stereolag.export import settings_json
from stereolag.reading import read_matcher
from stereolag.stereo.matcher import StereoMatcher
from stereolag.ui.matcher_controls import set_controls
from stereolag.ui.pairs import StereoPair

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
