"""A pair that another page hands over to the depth page, in place of the visitor's own files."""

from __future__ import annotations

import streamlit as st

from stereolag.core.inputs import as_stereo_pair
from stereolag.geometry.calibration import Calibration
from stereolag.pair import Pair, PairId
from stereolag.sequences import StereoFrame
from stereolag.ui import prose
from stereolag.ui.choices import OWN
from stereolag.ui.keys import HANDED, PAIR


def hand_over(
    frame: StereoFrame, digest: str, description: str, calibration: Calibration | None, search: tuple[int, int] | None
) -> None:
    """Make the depth page start with this frame; its controls must not have been drawn yet in this run."""
    left, right = as_stereo_pair(frame.left, frame.right)
    st.session_state[HANDED] = Pair(
        left,
        right,
        PairId(digest),
        truth=frame.truth,
        calibration=calibration,
        min_disparity=search[0] if search else 0,
        num_disparities=search[1] if search else None,
        description=description,
    )
    st.session_state[PAIR] = OWN


def handed_over() -> Pair | None:
    """Return the pair that was handed over and say so, with a button to use other files; None if there is none."""
    pair: Pair | None = st.session_state.get(HANDED)
    if pair is not None:
        with st.container(horizontal=True, vertical_alignment="center"):
            prose.caption(f"In use: {pair.description}", width="content")
            st.button("Use other files", key=f"{HANDED}.forget", type="tertiary", on_click=_forget)
    return pair


def _forget() -> None:
    st.session_state.pop(HANDED, None)
