"""The calibration a visitor made for use on the depth page, kept for the session."""

from __future__ import annotations

import hashlib

import streamlit as st

from stereolag.geometry.calibration import Calibration
from stereolag.io.calibrations import calibration_json
from stereolag.ui import keys, prose
from stereolag.ui.choices import OWN, no_files_yet
from stereolag.ui.uploads import Upload

KEPT = "calibrate.kept"
"""Session-state key of the calibration, stored as an upload."""

DEPTH_PAGE = "pages/3_Depth_maps.py"


def keep_calibration(calibration: Calibration) -> None:
    """Keep a calibration for this session."""
    digest = hashlib.sha256(calibration_json(calibration).encode()).hexdigest()
    st.session_state[KEPT] = Upload(digest, calibration)


def kept_calibration() -> Upload[Calibration] | None:
    """Return the calibration kept in this session, or None."""
    kept: Upload[Calibration] | None = st.session_state.get(KEPT)
    return kept


def forget_calibration() -> None:
    """Stop using the kept calibration."""
    st.session_state.pop(KEPT, None)


def use_kept_calibration() -> Upload[Calibration] | None:
    """Return the kept calibration, and show that it is in use, with a button to stop using it."""
    kept = kept_calibration()
    if kept is not None:
        error = "" if kept.content.rms is None else f", {kept.content.rms:.2f} px"
        with st.container(horizontal=True, vertical_alignment="center"):
            prose.caption(f"In use: the calibration you made on the page Calibrate{error}.", width="content")
            st.button("Remove", key=f"{KEPT}.remove", type="tertiary", on_click=forget_calibration)
    return kept


def open_depth_page(calibration: Calibration) -> None:
    """Keep a calibration, and open the depth page for the visitor's own files, to which it applies."""
    keep_calibration(calibration)
    st.session_state[keys.PAIR] = OWN
    st.session_state.pop(keys.HANDED, None)
    no_files_yet(keys.PAIR)
    st.session_state[keys.FOLD] = True
    st.switch_page(DEPTH_PAGE)
