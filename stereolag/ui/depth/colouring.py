"""The colours of all maps of the depth page: one range and one palette, in which near is bright unless inverted.

Also the switch for the outlines of the left image over all maps.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import streamlit as st

from stereolag.core.arrays import FloatMap
from stereolag.figures.colour_ranges import disparity_range, searched_range
from stereolag.figures.disparity import PALETTES
from stereolag.figures.edges import edge_path
from stereolag.figures.pictures import thinned
from stereolag.stereo.matcher import DisparityMap
from stereolag.ui import prose
from stereolag.ui.depth.view import DepthView
from stereolag.ui.first_settings import DISPARITIES_AT_FIRST
from stereolag.ui.keys import COLOURS
from stereolag.ui.pairs import StereoPair
from stereolag.ui.persistence import persistent
from stereolag.ui.results import remembered
from stereolag.ui.sentences import beyond_the_colours

PALETTE, INVERTED = f"{COLOURS}.palette", f"{COLOURS}.inverted"
OUTLINED = f"{COLOURS}.outlined"
FIRST_PALETTE = "viridis"
MOST_BEYOND = 0.02
"""Share of a map beyond the colours above which the page says so."""


def coloured_alike(pair: StereoPair, results: Mapping[str, DisparityMap]) -> DepthView:
    """Ask for the colours and return the view of all maps in them.

    The range is the one searched by all maps shown together, until the visitor sets another; without a map, the
    initial range of the pair.
    """
    key = range_key(pair)
    first, count = pair.min_disparity, pair.num_disparities or DISPARITIES_AT_FIRST
    searched = searched_range(results.values()) if results else (float(first), float(first + count))
    low, high = st.session_state.get(key) or searched
    palette = st.session_state.get(PALETTE, FIRST_PALETTE)
    inverted = st.session_state.get(INVERTED, False)
    outlined = st.session_state.get(OUTLINED, False)
    colours = st.popover("Colours", icon=":material/palette:", key=f"{COLOURS}.opened", on_change="rerun")
    if colours.open:  # drawing hidden controls would cost time in every run
        with colours:
            _ask_range(key, pair, results, (low, high))
            palette = st.segmented_control(
                "Palette",
                [*PALETTES],
                default=FIRST_PALETTE,
                format_func=str.capitalize,
                required=True,
                **persistent(PALETTE),
            )
            inverted = st.toggle(
                "Invert: far is bright",
                **persistent(INVERTED),
                help="Near things are dark, as in the source report’s maps. The report’s preset switches this on.",
            )
            outlined = st.toggle(
                "Outlines of the left image",
                **persistent(OUTLINED),
                help="Draws the edges of the left image over every map: where a depth edge lies beside its outline, "
                "the window has smeared it.",
            )
    colours_of = PALETTES[palette]
    if inverted:
        colours_of = colours_of[::-1]
    return DepthView(pair, results, low, max(high, low + 1), colours_of, _outlines(pair) if outlined else "")


def offer_fit(view: DepthView) -> None:
    """Name the maps with more than `MOST_BEYOND` outside the colours, and offer to fit the range to them."""
    beyond = {name: _share_beyond(view, name) for name in view.results}
    beyond = {name: share for name, share in beyond.items() if share > MOST_BEYOND}
    if not beyond:
        return
    with st.container(horizontal=True, vertical_alignment="center", gap="small"):
        prose.markdown(f":orange[:material/palette:] {beyond_the_colours(beyond)}", width="content")
        fit = (range_key(view.pair), view.pair, view.results)
        st.button("Fit the colours", key=f"{COLOURS}.fit_beyond", on_click=_fit, args=fit)


def set_inverted(inverted: bool) -> None:
    """Set whether far things are bright, instead of near ones; the switch must not have been drawn yet."""
    st.session_state[INVERTED] = inverted


def _outlines(pair: StereoPair) -> str:
    """Return the outlines of the left image; from memory if they were drawn before."""
    return remembered("outlines", lambda: edge_path(pair.left), inputs=pair.digest, settings="", shared=pair.shared)


def _ask_range(key: str, pair: StereoPair, results: Mapping[str, DisparityMap], shown: tuple[float, float]) -> None:
    """Ask for the ends of the colour range, and offer to fit it or to let it follow the search."""
    low, high = shown
    with st.container(horizontal=True, gap="small"):
        for end, value in (("far", low), ("near", high)):
            box = f"{key}.{end}"
            st.session_state[box] = float(value)
            st.number_input(
                f"{end.capitalize()} end, px",
                step=1.0,
                format="%g",
                key=box,
                width=130,
                on_change=_set_range,
                args=(key,),
            )
    with st.container(horizontal=True, gap="small"):
        st.button(
            "Fit to the maps",
            on_click=_fit,
            args=(key, pair, results),
            key=f"{COLOURS}.fit",
            disabled=not results,
        )
        st.button(
            "Follow the search",
            on_click=st.session_state.pop,
            args=(key, None),
            key=f"{COLOURS}.follow",
            disabled=key not in st.session_state,
            help="The colours then span the disparities that are searched.",
        )


def _set_range(key: str) -> None:
    low, high = st.session_state[f"{key}.far"], st.session_state[f"{key}.near"]
    st.session_state[key] = min(low, high), max(low, high)


def _fit(key: str, pair: StereoPair, results: Mapping[str, DisparityMap]) -> None:
    """Set the range to cover every map shown and the truth, except the outermost 1 % at either end of each."""
    maps: list[FloatMap] = [one.disparity for one in results.values()]
    ranges = [disparity_range([one]) for one in (maps if pair.truth is None else [*maps, pair.truth])]
    st.session_state[key] = min(low for low, _ in ranges), max(high for _, high in ranges)


def _share_beyond(view: DepthView, name: str) -> float:
    """Return the share of a map's disparities beyond the colours, 0..1."""
    result = view.results[name]

    def share() -> float:
        values = thinned(result.disparity)
        known = np.isfinite(values)
        outside = (values < view.low - 1) | (values > view.high + 1)
        return float((outside & known).sum()) / max(1.0, float(known.sum()))

    return remembered(
        "share beyond the colours",
        share,
        inputs=view.pair.digest,
        settings=f"{name} {result.settings.model_dump_json()} {view.low} {view.high}",
        shared=view.pair.shared,
    )


def range_key(pair: StereoPair) -> str:
    """Return the key of the visitor's range for a pair; while it is unset, the range follows the search."""
    return f"{COLOURS}.range.{pair.digest}"
