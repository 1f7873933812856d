"""Settings by purpose, and back to the beginning."""

from __future__ import annotations

from functools import partial

import streamlit as st

from stereolag.stereo.methods import METHODS, PRESETS, PresetName, preset
from stereolag.ui.depth.address import methods_at_first
from stereolag.ui.keys import FIRST_METHOD, preset_key
from stereolag.ui.matcher_controls import DISPARITIES_AT_FIRST, first_settings, matchers_in_use, set_controls
from stereolag.ui.pairs import StereoPair


def show_presets(pair: StereoPair) -> None:
    """Offer the settings that serve a purpose, and those with which all methods began."""
    with st.container(horizontal=True, gap="small", vertical_alignment="center"):
        st.markdown("Presets", width="content")
        for name, one in PRESETS.items():
            st.button(one.title, key=preset_key(name), help=one.meaning, on_click=partial(_set_preset, name, pair))
        st.button(
            "Reset",
            key=preset_key("reset"),
            icon=":material/restart_alt:",
            help="All settings of all methods as they were at first.",
            type="tertiary",
            on_click=partial(_reset, pair),
        )


def _set_preset(name: PresetName, pair: StereoPair) -> None:
    """Show a preset as the first method, over the range that the first method searches now."""
    shown = st.session_state.get(FIRST_METHOD, METHODS[0].short_name)
    searched = [matcher.search_range() for matcher in matchers_in_use() if matcher.short_name == shown]
    # A square reaches as far to either side: that is no range for a strip.
    strips = [one for one in searched if one is not None and one[0] + one[1] - 1 != -one[0]]
    first, count = strips[0] if strips else (0, None)
    matcher = preset(name, count or pair.num_disparities or DISPARITIES_AT_FIRST, first)
    set_controls(matcher, pair)
    st.session_state[FIRST_METHOD] = matcher.short_name


def _reset(pair: StereoPair) -> None:
    for key, method in methods_at_first().items():
        st.session_state[key] = method
    for kind in METHODS:
        set_controls(first_settings(kind, pair), pair)
