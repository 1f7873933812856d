"""The layout of the depth page: a one-line head, and controls beside maps that stay in view."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import streamlit as st
from streamlit.delta_generator import DeltaGenerator

from stereolag.stereo.methods import METHODS
from stereolag.ui import prose
from stereolag.ui.depth.maps import show_method
from stereolag.ui.keys import FOLD, FOLD_NEXT, TAB
from stereolag.ui.matcher_controls import ask_matcher
from stereolag.ui.pairs import StereoPair
from stereolag.ui.persistence import persistent

STYLE = Path(__file__).with_name("bench.css")
CONTROLS_WIDTH = 320
"""Px."""

INTRODUCTION = (
    "Near things shift more between the two cameras than far ones. Cut the left image into small windows and slide each"
    " along the right image: the lag of the best match is its disparity, large for near things and small for far ones."
)


@contextmanager
def head(title: str, *, awaited: bool) -> Iterator[DeltaGenerator]:
    """Draw the heading beside an expander; the choice of the pair is drawn inside the ``with`` block.

    The expander stays open while files are `awaited`, and closes when they are there. The container yielded,
    between the two, is for :func:`show_name` once the pair is known.
    """
    st.html(STYLE)
    if awaited or st.session_state.pop(FOLD_NEXT, False):
        st.session_state[FOLD] = awaited
    with st.container(horizontal=True, vertical_alignment="top", gap="medium", key="depth-head"):
        st.title(title, anchor=False, width="content")
        name = st.container(width="content", key="depth-head-pair")
        # Changing the label would redraw the expander and take the keyboard focus from the controls inside.
        with st.expander(
            "Choose a pair or bring your own",
            key=FOLD,
            icon=":material/photo_library:",
            on_change="rerun",
        ):
            prose.markdown(INTRODUCTION, width=760)
            yield name


def show_name(place: DeltaGenerator, pair: str) -> None:
    """Show the name of the pair whose maps are shown."""
    with place:
        prose.markdown(f"**{pair}**", width="content")


def bench() -> tuple[DeltaGenerator, DeltaGenerator]:
    """Return the containers for the controls and, beside them, for the maps."""
    both = st.container(horizontal=True, gap="medium", vertical_alignment="top", key="depth-bench")
    controls = both.container(width=CONTROLS_WIDTH, gap="xsmall", key="depth-bench-controls")
    return controls, both.container(key="depth-bench-maps")


def show_controls(pair: StereoPair) -> None:
    """Draw the controls of one method at a time, chosen by a row of tabs.

    Selecting a method also shows its map, so that moving its controls has a visible effect.
    """
    names = [kind.short_name for kind in METHODS]
    by_name = dict(zip(names, METHODS, strict=True))
    tab = st.segmented_control(
        "Settings of",
        names,
        default=names[0],
        required=True,
        format_func=lambda name: by_name[name].title,
        **persistent(TAB),
        label_visibility="collapsed",
        on_change=lambda: show_method(by_name[st.session_state[TAB]]),
    )
    for kind in METHODS:
        ask_matcher(kind, pair, drawn=kind.short_name == tab)
