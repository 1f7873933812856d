"""The presets, and a reset to the initial settings."""

from __future__ import annotations

from functools import partial

import streamlit as st

from stereolag.stereo.methods import METHODS, PRESETS, PresetName, preset
from stereolag.ui.depth.colouring import set_inverted
from stereolag.ui.depth.maps import SHOWN_AT_FIRST, show_method
from stereolag.ui.first_settings import DISPARITIES_AT_FIRST, first_settings
from stereolag.ui.keys import SHOWN, TAB, preset_key
from stereolag.ui.matcher_controls import matchers_in_use, set_controls
from stereolag.ui.pairs import StereoPair


def show_presets(pair: StereoPair) -> None:
    """Draw a button for each preset, and one that resets all methods to their initial settings."""
    with st.container(horizontal=True, gap="xxsmall", vertical_alignment="center"):
        for name, one in PRESETS.items():
            st.button(one.title, key=preset_key(name), help=one.meaning, on_click=partial(_set_preset, name, pair))
        st.button(
            "Reset",
            key=preset_key("reset"),
            icon=":material/restart_alt:",
            help="Sets all methods back to their initial settings.",
            type="tertiary",
            on_click=partial(_reset, pair),
        )


def _set_preset(name: PresetName, pair: StereoPair) -> None:
    """Show a preset in its own colours, over the range of the method whose settings are shown."""
    tab = st.session_state.get(TAB, METHODS[0].short_name)
    searched = [matcher.search_range() for matcher in matchers_in_use() if matcher.short_name == tab]
    # A square search area reaches equally far to both sides, which makes no range for a strip.
    strips = [one for one in searched if one is not None and one[0] + one[1] - 1 != -one[0]]
    first, count = strips[0] if strips else (pair.min_disparity, pair.num_disparities or DISPARITIES_AT_FIRST)
    matcher = preset(name, count, first)
    set_controls(matcher, pair)
    show_method(type(matcher), instead=True)
    set_inverted(name == "report")
    st.session_state[TAB] = matcher.short_name


def _reset(pair: StereoPair) -> None:
    st.session_state[SHOWN] = SHOWN_AT_FIRST
    st.session_state[TAB] = METHODS[0].short_name
    set_inverted(False)
    for kind in METHODS:
        set_controls(first_settings(kind, pair), pair)
