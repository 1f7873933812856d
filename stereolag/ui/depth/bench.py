"""The frame of the depth page: a head of one line, and controls beside maps that stay in view."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import streamlit as st
from streamlit.delta_generator import DeltaGenerator

from stereolag.ui.keys import FOLD

STYLE = Path(__file__).with_name("bench.css")
CONTROLS_WIDTH = 320
"""Px."""

INTRODUCTION = (
    "Near things shift more between the two cameras than far ones. Cut the left image into small windows and slide each"
    " along the right image: the lag of the best match is its disparity, large for near things and small for far ones."
)


@contextmanager
def head(title: str, pair: str) -> Iterator[None]:
    """Draw the heading beside a line that names the pair and unfolds to the choice of it, which goes inside."""
    st.html(STYLE)
    with st.container(horizontal=True, vertical_alignment="center", gap="medium", key="depth-head"):
        st.title(title, anchor=False, width="content")
        with st.expander(
            f"**{pair}** · choose a pair or bring your own",
            key=FOLD,
            icon=":material/photo_library:",
            on_change="rerun",
        ):
            st.markdown(INTRODUCTION, width=760)
            yield


def bench() -> tuple[DeltaGenerator, DeltaGenerator]:
    """Return where the controls go, and beside it where the maps go."""
    both = st.container(horizontal=True, gap="medium", vertical_alignment="top", key="depth-bench")
    controls = both.container(width=CONTROLS_WIDTH, gap="xsmall", key="depth-bench-controls")
    return controls, both.container(key="depth-bench-maps")
