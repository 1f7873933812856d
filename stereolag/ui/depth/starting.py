"""The initial settings for the visitor's own pair: the range found for it, and the fast preset."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from functools import partial

import streamlit as st

from stereolag.pair import Pair
from stereolag.stereo.matcher import StereoMatcher
from stereolag.stereo.methods import METHODS
from stereolag.ui import prose
from stereolag.ui.depth.doctor import diagnosis_at_once
from stereolag.ui.first_settings import DISPARITIES_AT_FIRST, first_settings
from stereolag.ui.keys import FOLD_NEXT, PAIR
from stereolag.ui.matcher_controls import matchers_in_use, set_controls
from stereolag.ui.sentences import started_in_words


@dataclass(frozen=True)
class Start:
    """The initial range of a pair, px, and the initial settings of all methods, for images of this width, px.

    Attributes
    ----------
    found
        Whether the range was determined, not assumed.
    """

    min_disparity: int
    num_disparities: int
    found: bool
    settings: tuple[StereoMatcher, ...]
    width: int

    def range_at(self, width: int) -> tuple[int, int]:
        """Return the first disparity and the number of disparities at another width."""
        share = width / self.width
        return math.floor(self.min_disparity * share), math.ceil(self.num_disparities * share)


def started(pair: Pair) -> Pair:
    """Return the visitor's own pair with its initial range; for a new pair, set the controls to the initial settings.

    The range is that of its calibration, or the one the doctor found. Files added to the images later do not change
    it. The controls must not have been drawn yet.
    """
    if pair.shared:
        return pair
    start: Start | None = st.session_state.get(_key(pair))
    width = int(pair.left.shape[1])
    if start is None:
        if pair.num_disparities is None and diagnosis_at_once(pair) is None:
            return pair  # still being examined
        found = _range_of(pair)
        first, count = found or (0, DISPARITIES_AT_FIRST)
        begun = replace(pair, min_disparity=first, num_disparities=count)
        settings = tuple(first_settings(kind, begun) for kind in METHODS)
        _set_all(settings, begun)
        st.session_state[_key(pair)] = start = Start(first, count, found is not None, settings, width)
        st.session_state[FOLD_NEXT] = True
    first, count = start.range_at(width)
    return replace(pair, min_disparity=first, num_disparities=count)


def show_start(pair: Pair) -> None:
    """Show the initial settings of the pair while they are in use, and offer to undo them."""
    start: Start | None = st.session_state.get(_key(pair))
    if pair.shared or start is None or not start.found or not set(matchers_in_use()) <= set(start.settings):
        return
    with st.container(horizontal=True, vertical_alignment="center", gap="small"):
        prose.caption(
            f":material/auto_fix_high: {started_in_words(start.min_disparity, start.num_disparities)}", width="content"
        )
        st.button("Undo these settings", key="depth.start.undo", type="tertiary", on_click=partial(_undo, pair))


def _undo(pair: Pair) -> None:
    """Set the controls as for a pair about which nothing is known."""
    _set_all(tuple(kind().with_search_range(0, DISPARITIES_AT_FIRST) for kind in METHODS), pair)


def _set_all(settings: tuple[StereoMatcher, ...], pair: Pair) -> None:
    for matcher in settings:
        set_controls(matcher, pair)


def _range_of(pair: Pair) -> tuple[int, int] | None:
    """Return the first disparity and the number of disparities; None if unknown."""
    if pair.num_disparities is not None:
        return pair.min_disparity, pair.num_disparities
    diagnosis = diagnosis_at_once(pair)
    return None if diagnosis is None else diagnosis.suggested_range


def _key(pair: Pair) -> str:
    return f"{PAIR}.start.{pair.id.chosen}"
