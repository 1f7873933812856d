"""A pair with the calibration of both its cameras, rectified."""

from __future__ import annotations

from dataclasses import replace

import streamlit as st

from stereolag.rectification import rectify
from stereolag.ui.pairs import StereoPair
from stereolag.ui.results import computed

RECTIFIED = "The pair was undistorted and rectified with its calibration."


def rectified(pair: StereoPair) -> StereoPair:
    """Return the pair with its rows aligned, if its calibration tells how; as it is, and why, if that fails."""
    if pair.calibration is None or pair.calibration.rig is None:
        return pair
    try:
        return computed(
            lambda progress: _rectified(pair),
            inputs=pair.digest,
            settings="",
            shared=pair.shared,
            label="Rectifying the pair …",
        )
    except ValueError as error:
        st.error(str(error))
        return replace(pair, calibration=None)


def _rectified(pair: StereoPair) -> StereoPair:
    assert pair.calibration is not None
    assert pair.calibration.rig is not None
    left, right, calibration = rectify(pair.left, pair.right, pair.calibration.rig)
    notes = [*pair.notes, RECTIFIED]
    if pair.truth is not None:
        notes.append("The true disparity is of the picture before that and is left out.")
    return replace(
        pair,
        left=left,
        right=right,
        truth=None,
        visible=None,
        digest=f"{pair.digest} rectified",
        calibration=calibration,
        notes=tuple(notes),
    )
