"""The colours of all maps of the depth page: one range that holds still, and one palette."""

from __future__ import annotations

from collections.abc import Mapping

import streamlit as st

from stereolag.figures.disparity import PALETTES, disparity_range
from stereolag.stereo.matcher import DisparityMap
from stereolag.ui.depth.view import DepthView
from stereolag.ui.keys import COLOURS
from stereolag.ui.pairs import StereoPair

FIRST_PALETTE = "viridis"
NEGATIVE_ROOM = 32.0
"""How far below what is there the range may begin, px."""


def coloured_alike(pair: StereoPair, results: Mapping[str, DisparityMap]) -> DepthView:
    """Ask for the colours and return the view of all maps in them.

    The range is fitted to the ground truth, or to the first maps where there is none, and then holds still for the pair
    whatever the settings do, until the visitor moves it or fits it again.
    """
    key = f"{COLOURS}.range.{pair.digest}"
    if not {key, _ends_key(key)} <= set(st.session_state):
        _fit(key, pair, results)
    low, high = st.session_state[key]
    palette = st.session_state.get(f"{COLOURS}.palette", FIRST_PALETTE)
    colours = st.popover(
        "Colours", icon=":material/palette:", width="stretch", key=f"{COLOURS}.opened", on_change="rerun"
    )
    if colours.open:  # drawing what nobody sees takes time at every move
        with colours:
            # With ends that moved with the range, it would be another slider after every move.
            lowest, highest = st.session_state[_ends_key(key)]
            low, high = st.slider(
                "Range of colours, px",
                min_value=lowest,
                max_value=highest,
                step=1.0,
                key=key,
                persist_state="session",
                help="Disparities at the ends of the colours, the same for all maps. It holds still when settings "
                "change.",
            )
            st.button("Fit to what is shown", on_click=_fit, args=(key, pair, results), key=f"{COLOURS}.fit")
            palette = st.segmented_control(
                "Palette",
                [*PALETTES],
                default=FIRST_PALETTE,
                format_func=str.capitalize,
                required=True,
                key=f"{COLOURS}.palette",
                persist_state="session",
            )
    return DepthView(pair, results, low, max(high, low + 1), PALETTES[palette])


def _fit(key: str, pair: StereoPair, results: Mapping[str, DisparityMap]) -> None:
    """Set the range to what is shown, and the ends of its slider so that they leave room around it."""
    low, high = st.session_state[key] = _fitted(pair, results)
    st.session_state[_ends_key(key)] = min(low, 0.0) - NEGATIVE_ROOM, 2 * max(high, NEGATIVE_ROOM)


def _ends_key(key: str) -> str:
    return f"{key}.ends"


def _fitted(pair: StereoPair, results: Mapping[str, DisparityMap]) -> tuple[float, float]:
    return disparity_range([pair.truth] if pair.truth is not None else [one.disparity for one in results.values()])
