"""One pair as the depth page shows it: its maps, and the colours that they share; the keys of the page's choices."""

from __future__ import annotations

from collections.abc import Mapping, Set
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import numpy as np
import streamlit as st

from stereolag import Calibration, DisparityMap
from stereolag.core.arrays import FloatMap
from stereolag.core.typography import percent
from stereolag.figures.legends import PALETTES, Colours, searched_range
from stereolag.figures.pictures import disparity_range, edge_path, thinned
from stereolag.pair import Pair
from stereolag.ui import prose
from stereolag.ui.controls import persistent
from stereolag.ui.matcher_controls import DISPARITIES_AT_FIRST
from stereolag.ui.results import kept_for, remembered

Pixel = tuple[int, int]

# The keys of what is chosen on the page

PAIR = "pairs"
HANDED = f"{PAIR}.handed_over"
"""Key of the pair handed over by another page in place of files."""
SIZE = f"{PAIR}.size"
FOLD = "depth.head"
FOLD_NEXT = f"{FOLD}.next"
PART = "depth.part"
COLOURS = "depth.colours"

LEFT, RIGHT, TRUTH = "Left image", "Right image", "Ground truth"
PALETTE, INVERTED, OUTLINED = (f"{COLOURS}.{name}" for name in ("palette", "inverted", "outlined"))
FIRST_PALETTE = "viridis"
MOST_BEYOND = 0.02
"""Share of a map beyond the colours above which the page says so."""


@dataclass(frozen=True)
class KnownDistance:
    """A pixel, its distance as entered by the visitor, metres, and the calibration derived from it."""

    row: int
    col: int
    metres: float
    calibration: Calibration


def known_key(digest: str) -> str:
    """Return the session-state key of the :class:`KnownDistance` of a pair."""
    return f"depth.known.{digest}"


@dataclass(frozen=True, eq=False)
class DepthView:
    """One pair, the map of each method, and the colours that all maps share.

    Attributes
    ----------
    pair
        The images, with truth, mask and calibration if known.
    results
        {name of the method as the page shows it: its map}, in the order shown; its settings are ``result.settings``.
    colours
        The locked colour range, the palette, and the outlines over the maps.
    late
        Names of the maps whose settings have changed since: the new map is still being computed.
    """

    pair: Pair
    results: Mapping[str, DisparityMap]
    colours: Colours
    late: Set[str] = frozenset()

    @property
    def maps(self) -> dict[str, FloatMap]:
        """Return the disparities of every method and the ground truth if there is one, by name."""
        truth = {} if self.pair.truth is None else {TRUTH: self.pair.truth}
        return {name: result.disparity for name, result in self.results.items()} | truth

    @property
    def known_distance(self) -> KnownDistance | None:
        """Return the distance that the visitor entered for this pair in this session."""
        return st.session_state.get(known_key(self.pair.digest))

    @property
    def calibration(self) -> Calibration | None:
        """Return the calibration in use: derived from the known distance if one was entered, else the pair's own."""
        return self.known_distance.calibration if self.known_distance else self.pair.calibration

    def kept(self, name: str, more: str = "") -> dict[str, Any]:
        """Return what identifies a result about one map, as :func:`.kept_for` does; `more` is what else it needs."""
        return kept_for(self.pair, f"{settings_key(self.results[name])} {more}")


def settings_key(result: DisparityMap) -> str:
    """Return the cache key of a map: its matcher and that matcher's settings."""
    return f"{type(result.settings).__name__} {result.settings.model_dump_json()}"


def known_truth(pair: Pair) -> FloatMap | None:
    """Return the ground truth of a pair; None if it is not known for any pixel."""
    return pair.truth if pair.truth is not None and np.isfinite(pair.truth).any() else None


# The colours


def coloured_alike(pair: Pair, results: Mapping[str, DisparityMap]) -> DepthView:
    """Ask for the colours and return the view of all maps in them.

    The range is the one searched by all maps shown together, until the visitor sets another; without a map, the
    initial range of the pair.
    """
    first, count = pair.min_disparity, pair.num_disparities or DISPARITIES_AT_FIRST
    searched = searched_range(results.values()) if results else (float(first), float(first + count))
    low, high = st.session_state.get(range_key(pair.digest)) or searched
    view = DepthView(pair, results, Colours(low, max(high, low + 1)))
    popover = st.popover("Colours", icon=":material/palette:", key=f"{COLOURS}.opened", on_change="rerun")
    if popover.open:  # drawing hidden controls would cost time in every run
        with popover:
            _ask_colours(view, (low, high))
    outlined, direction = st.session_state.get(OUTLINED), -1 if st.session_state.get(INVERTED) else 1
    outlines = remembered("outlines", partial(edge_path, pair.left), **kept_for(pair)) if outlined else ""
    palette = PALETTES[st.session_state.get(PALETTE, FIRST_PALETTE)][::direction]
    return replace(view, colours=replace(view.colours, palette=palette, outlines=outlines))


def _ask_colours(view: DepthView, shown: tuple[float, float]) -> None:
    """Ask for the ends of the colour range, or to fit it or let it follow the search, for palette and outlines."""
    key = range_key(view.pair.digest)
    with st.container(horizontal=True, gap="small"):
        for end, value in zip(("far", "near"), shown, strict=True):
            st.session_state[f"{key}.{end}"] = float(value)
            st.number_input(
                f"{end.capitalize()} end, px",
                step=1.0,
                format="%g",
                key=f"{key}.{end}",
                width=130,
                on_change=_set_range,
                args=(key,),
            )
    with st.container(horizontal=True, gap="small"):
        st.button(
            "Fit to the maps",
            on_click=_fit_range,
            args=(key, view.maps),
            key=f"{COLOURS}.fit",
            disabled=not view.results,
        )
        st.button(
            "Follow the search",
            on_click=st.session_state.pop,
            args=(key, None),
            key=f"{COLOURS}.follow",
            disabled=key not in st.session_state,
            help="The colours then span the disparities that are searched.",
        )
    st.segmented_control(
        "Palette",
        [*PALETTES],
        default=FIRST_PALETTE,
        format_func=str.capitalize,
        required=True,
        **persistent(PALETTE),
    )
    st.toggle(
        "Invert: far is bright",
        **persistent(INVERTED),
        help="Near things are dark, as in the source report’s maps. The report’s preset switches this on.",
    )
    st.toggle(
        "Outlines of the left image",
        **persistent(OUTLINED),
        help="Draws the edges of the left image over every map: where a depth edge lies beside its outline, "
        "the window has smeared it.",
    )


def range_key(digest: str) -> str:
    """Return the key of the visitor's range for a pair; while it is unset, the range follows the search."""
    return f"{COLOURS}.range.{digest}"


def _set_range(key: str) -> None:
    st.session_state[key] = tuple(sorted(st.session_state[f"{key}.{end}"] for end in ("far", "near")))


def _fit_range(key: str, maps: Mapping[str, FloatMap]) -> None:
    """Set the range to cover every map shown and the truth, except the outermost 1 % at either end of each."""
    ends = [disparity_range([one]) for one in maps.values()]
    st.session_state[key] = min(low for low, _ in ends), max(high for _, high in ends)


def offer_fit(view: DepthView) -> None:
    """Name the maps with more than `MOST_BEYOND` outside the colours, and offer to fit the range to them."""
    low, high = view.colours.low, view.colours.high

    def beyond(result: DisparityMap) -> float:
        values = thinned(result.disparity)
        outside = int(np.count_nonzero((values < low - 1) | (values > high + 1)))
        return outside / max(1, int(np.count_nonzero(np.isfinite(values))))

    shares = {
        name: remembered("share beyond the colours", partial(beyond, result), **view.kept(name, f"{low} {high}"))
        for name, result in view.results.items()
    }
    shares = {name: share for name, share in shares.items() if share > MOST_BEYOND}
    if shares:
        with st.container(horizontal=True, vertical_alignment="center", gap="small"):
            said = " and ".join(f"**{percent(share)}** of {name}" for name, share in shares.items())
            prose.markdown(f":orange[:material/palette:] {said} is beyond the colour range.", width="content")
            st.button(
                "Fit the colours",
                key=f"{COLOURS}.fit_beyond",
                on_click=_fit_range,
                args=(range_key(view.pair.digest), view.maps),
            )
