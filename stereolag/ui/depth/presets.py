"""Settings by purpose, and back to the beginning."""

from __future__ import annotations

from functools import partial
from typing import NamedTuple, get_args

import streamlit as st

from stereolag.stereo.methods import METHODS
from stereolag.stereo.windows.matcher import CorrelationMatcher, Preset
from stereolag.ui.matcher_controls import set_controls
from stereolag.ui.matchers import DISPARITIES_AT_FIRST, first_settings, searched_disparities
from stereolag.ui.pairs import StereoPair

KEY = "depth.preset"


class Purpose(NamedTuple):
    """What a preset is called on the page, and what it is good for."""

    label: str
    meaning: str


PURPOSES: dict[Preset, Purpose] = {
    "report": Purpose("The report’s", "The source report’s own: windows of 20 px in a square of 40 px around each."),
    "dense": Purpose("Fast", "Every pixel by the best match of its window, checked, filled and smoothed."),
    "accurate": Purpose("Accurate", "Correlation with census and gradient, weighed along eight paths; takes longer."),
}
assert PURPOSES.keys() == set(get_args(Preset))


def show_presets(pair: StereoPair) -> None:
    """Offer the settings of the convolution that serve a purpose, and those with which all methods began."""
    with st.container(horizontal=True, gap="small", vertical_alignment="center"):
        st.markdown("Presets", width="content")
        for name, (label, meaning) in PURPOSES.items():
            st.button(label, key=f"{KEY}.{name}", help=meaning, on_click=partial(_set_preset, name, pair))
        st.button(
            "Reset",
            key=f"{KEY}.reset",
            icon=":material/restart_alt:",
            help="All settings of all methods as they were at first.",
            type="tertiary",
            on_click=partial(_reset, pair),
        )


def _set_preset(name: Preset, pair: StereoPair) -> None:
    first, count = searched_disparities() or (0, pair.num_disparities or DISPARITIES_AT_FIRST)
    set_controls(CorrelationMatcher.preset(name, count, min_disparity=first), pair)


def _reset(pair: StereoPair) -> None:
    for kind in METHODS.values():
        set_controls(first_settings(kind, pair), pair)
