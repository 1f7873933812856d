"""A pair and a state of the depth page that come from elsewhere: another page, or a saved session."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import streamlit as st

from stereolag.core.inputs import as_stereo_pair
from stereolag.core.settings import scaled_settings
from stereolag.figures.legends import PALETTES
from stereolag.geometry.calibration import Calibration
from stereolag.io.settings import Colours, Session
from stereolag.pair import SIZES, Pair, PairId
from stereolag.sequences import StereoFrame
from stereolag.stereo.matcher import StereoMatcher
from stereolag.ui import keys, prose
from stereolag.ui.controls import matchers_in_use, set_controls
from stereolag.ui.depth.maps import FIRST_PALETTE, INVERTED, OUTLINED, PALETTE, range_key, shown_methods
from stereolag.ui.elements import show_refused
from stereolag.ui.uploads import OWN

RESTORED = "depth.restore"
"""Session-state key of a session's settings and colours that are still to be set, for its pair at its own size."""


@dataclass(frozen=True)
class PageState:
    """The state of the page: settings for the size shown, colours for the pair's own size."""

    matchers: list[StereoMatcher]
    shown: list[str]
    size: str
    colours: dict[str, Any]


def page_state(pair: Pair, factor: float) -> PageState:
    """Return the state of the page; `factor` is the number of px at the pair's own size per px shown."""
    colours: dict[str, Any] = {
        "palette": st.session_state.get(PALETTE, FIRST_PALETTE),
        "inverted": bool(st.session_state.get(INVERTED, False)),
        "outlined": bool(st.session_state.get(OUTLINED, False)),
    }
    ends = st.session_state.get(range_key(pair))
    if ends is not None:
        colours |= {end: value * factor for end, value in zip(("low", "high"), ends, strict=True)}
    shown = [method.short_name for method in shown_methods()]
    return PageState(matchers_in_use(), shown, st.session_state.get(keys.SIZE, "Automatic"), colours)


def restore(session: Session) -> None:
    """Set the page to a session whose pair is in use; none of these controls must have been drawn yet in this run."""
    saved = session.document
    st.session_state[keys.SIZE] = saved.size if saved.size in SIZES else "Automatic"
    if saved.shown:
        st.session_state[keys.SHOWN] = [*saved.shown]
        st.session_state[keys.TAB] = saved.shown[0]
    if saved.colours.palette in PALETTES:
        st.session_state[PALETTE] = saved.colours.palette
    st.session_state[INVERTED] = saved.colours.inverted
    st.session_state[OUTLINED] = saved.colours.outlined
    st.session_state[RESTORED] = session.left.shape[1], session.matchers, saved.colours


def restore_settings(pair: Pair) -> None:
    """Set the controls to the settings of the session given to :func:`restore`; none must have been drawn yet."""
    found: tuple[int, tuple[StereoMatcher, ...], Colours] | None = st.session_state.pop(RESTORED, None)
    if found is None:
        return
    width, matchers, colours = found
    factor = pair.left.shape[1] / width
    for matcher in matchers:
        try:
            set_controls(scaled_settings(matcher, factor) if factor != 1 else matcher, pair)
        except ValueError as error:
            show_refused(f"The settings of {matcher.title} could not be scaled with the images. {error}")
    if colours.low is not None and colours.high is not None:
        st.session_state[range_key(pair)] = colours.low * factor, colours.high * factor


def transfer(
    frame: StereoFrame, digest: str, description: str, calibration: Calibration | None, search: tuple[int, int] | None
) -> None:
    """Make the depth page start with this frame; its controls must not have been drawn yet in this run."""
    left, right = as_stereo_pair(frame.left, frame.right)
    st.session_state[keys.HANDED] = Pair(
        left,
        right,
        PairId(digest),
        truth=frame.truth,
        calibration=calibration,
        min_disparity=search[0] if search else 0,
        num_disparities=search[1] if search else None,
        description=description,
    )
    st.session_state[keys.PAIR] = OWN


def transferred_pair() -> Pair | None:
    """Return the pair that another page transferred, with a button to use other files; None if there is none."""
    pair: Pair | None = st.session_state.get(keys.HANDED)
    if pair is not None:
        with st.container(horizontal=True, vertical_alignment="center"):
            prose.caption(f"In use: {pair.description}", width="content")
            st.button("Use other files", key=f"{keys.HANDED}.forget", type="tertiary", on_click=_forget_transferred)
    return pair


def _forget_transferred() -> None:
    st.session_state.pop(keys.HANDED, None)
