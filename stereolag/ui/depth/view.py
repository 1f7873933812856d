"""The view of one pair on the depth page: its maps and the colours they share; the session-state keys of the page."""

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
from stereolag.ui.matcher_controls import DEFAULT_DISPARITIES
from stereolag.ui.results import kept_for, remembered

Pixel = tuple[int, int]

# Session-state keys

PAIR = "pairs"
HANDED = f"{PAIR}.handed_over"
"""Key of the pair that another page or the live camera handed over in place of files."""
SIZE = f"{PAIR}.size"
FOLD = "depth.head"
FOLD_NEXT = f"{FOLD}.next"
PART = "depth.part"
COLOURS = "depth.colours"

LEFT, RIGHT, TRUTH = "Left image", "Right image", "Ground truth"
PALETTE, INVERTED, OUTLINED = (f"{COLOURS}.{name}" for name in ("palette", "inverted", "outlined"))
DEFAULT_PALETTE = "viridis"
MAX_SHARE_OUTSIDE = 0.02
"""Largest share of a map that may lie outside the colour range before the page offers to fit the range."""


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
        {title of a method: its map}, in the order shown; the method's settings are ``result.settings``.
    colours
        The colour range of all maps, the palette, and the outlines drawn over the maps.
    outdated
        Titles of the maps whose settings have changed since: the new map is still being computed.
    """

    pair: Pair
    results: Mapping[str, DisparityMap]
    colours: Colours
    outdated: Set[str] = frozenset()

    @property
    def maps(self) -> dict[str, FloatMap]:
        """Return the disparities of every method and the ground truth if there is one, by title."""
        return {
            **{name: result.disparity for name, result in self.results.items()},
            **({} if self.pair.truth is None else {TRUTH: self.pair.truth}),
        }

    @property
    def known_distance(self) -> KnownDistance | None:
        """Return the distance that the visitor entered for this pair in this session."""
        return st.session_state.get(known_key(self.pair.digest))

    @property
    def calibration(self) -> Calibration | None:
        """Return the calibration in use: derived from the known distance if one was entered, else the pair's own."""
        return self.known_distance.calibration if self.known_distance else self.pair.calibration

    def kept(self, name: str, more: str = "") -> dict[str, Any]:
        """Return the arguments of :func:`.kept_for` for a result about one map, which may depend on `more`."""
        return kept_for(self.pair, f"{settings_key(self.results[name])} {more}")


def settings_key(result: DisparityMap) -> str:
    """Return the cache key of a map: the name of its method and the settings."""
    return f"{type(result.settings).__name__} {result.settings.model_dump_json()}"


def known_truth(pair: Pair) -> FloatMap | None:
    """Return the ground truth of a pair; None if it is unknown at every pixel."""
    return pair.truth if pair.truth is not None and np.isfinite(pair.truth).any() else None


# The colours


def coloured_view(pair: Pair, results: Mapping[str, DisparityMap]) -> DepthView:
    """Ask for the colours that all maps share, and return the view of the pair with them.

    Until the visitor sets a colour range, it spans the disparities that the maps searched; without a map, the initial
    range of the pair.
    """
    first, count = pair.min_disparity, pair.num_disparities or DEFAULT_DISPARITIES
    searched = searched_range(results.values()) if results else (float(first), float(first + count))
    low, high = st.session_state.get(range_key(pair.digest)) or searched
    view = DepthView(pair, results, Colours(low, max(high, low + 1)))
    popover = st.popover("Colours", icon=":material/palette:", key=f"{COLOURS}.opened", on_change="rerun")
    if popover.open:  # drawing hidden controls would cost time in every run
        with popover:
            _ask_colours(view, (low, high))
    outlined, direction = st.session_state.get(OUTLINED), -1 if st.session_state.get(INVERTED) else 1
    outlines = remembered("outlines", partial(edge_path, pair.left), **kept_for(pair)) if outlined else ""
    palette = PALETTES[st.session_state.get(PALETTE, DEFAULT_PALETTE)][::direction]
    return replace(view, colours=replace(view.colours, palette=palette, outlines=outlines))


def _ask_colours(view: DepthView, shown: tuple[float, float]) -> None:
    """Draw the controls of the colour range, the palette and the outlines."""
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
        default=DEFAULT_PALETTE,
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
        help="Draws the edges of the left image over every map. A depth edge that lies beside its outline was "
        "smeared by the window.",
    )


def range_key(digest: str) -> str:
    """Return the key of the colour range that the visitor set for a pair; while it is unset, the search sets it."""
    return f"{COLOURS}.range.{digest}"


def _set_range(key: str) -> None:
    st.session_state[key] = tuple(sorted(st.session_state[f"{key}.{end}"] for end in ("far", "near")))


def _fit_range(key: str, maps: Mapping[str, FloatMap]) -> None:
    """Set the range to cover every map shown and the truth, except the lowest and highest 1 % of each."""
    ends = [disparity_range([disparity]) for disparity in maps.values()]
    st.session_state[key] = min(low for low, _ in ends), max(high for _, high in ends)


def offer_fit(view: DepthView) -> None:
    """Name the maps that lie partly outside the colour range, and offer to fit the range to them."""
    low, high = view.colours.low, view.colours.high

    def share_outside(result: DisparityMap) -> float:
        values = thinned(result.disparity)
        outside = int(np.count_nonzero((values < low - 1) | (values > high + 1)))
        return outside / max(1, int(np.count_nonzero(np.isfinite(values))))

    shares = {
        name: remembered("share outside", partial(share_outside, result), **view.kept(name, f"{low} {high}"))
        for name, result in view.results.items()
    }
    listed = " and ".join(
        f"**{percent(share)}** of {name}" for name, share in shares.items() if share > MAX_SHARE_OUTSIDE
    )
    if listed:
        with st.container(horizontal=True, vertical_alignment="center", gap="small"):
            prose.markdown(f":orange[:material/palette:] Outside the colour range: {listed}.", width="content")
            st.button(
                "Fit the colours",
                key=f"{COLOURS}.fit_beyond",
                on_click=_fit_range,
                args=(range_key(view.pair.digest), view.maps),
            )
