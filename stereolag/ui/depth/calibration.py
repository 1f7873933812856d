"""The calibration of a stereo camera, and whether its pictures are raw, for the pages Depth maps and Driving.

It comes from files, from two numbers or from the page Calibrate.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import TypeVar

import streamlit as st

from stereolag.geometry.calibration import UNITS, Calibration
from stereolag.io.calibrations import CALIBRATION_SUFFIXES, read_calibration
from stereolag.io.guard import guarded
from stereolag.pair import Pair, Preparation, Rows, prepare
from stereolag.ui import prose
from stereolag.ui.controls import persistent
from stereolag.ui.depth.maps import FOLD, HANDED, PAIR
from stereolag.ui.elements import show_offer, show_refused
from stereolag.ui.navigation import DEPTH_PAGE
from stereolag.ui.results import computed
from stereolag.ui.streamlit_inside import Container
from stereolag.ui.uploads import OWN, no_files_yet, upload_named

T = TypeVar("T")


def ask_calibration(key: str, place: Container) -> Calibration | None:
    """Ask in a place for the calibration of the camera, and say here what it means; None: depth is then relative."""
    with place:
        columns = st.columns([2, 1, 1], gap="medium")
        with columns[0]:
            unit = st.session_state.get(f"{key}.unit")
            given = upload_named(
                "Calibration files",
                lambda files: guarded(read_calibration)(
                    *(data for _, data in files), length_unit_m=unit and UNITS[unit]
                ),
                key=f"{key}.calibration",
                types=CALIBRATION_SUFFIXES,
                note="All files of one calibration, together or one by one. OpenCV’s YAML, XML or JSON, NPZ, ROS, "
                "Kalibr, ZED, OAK, RealSense, MATLAB, Middlebury, KITTI, DrivingStereo, ORB-SLAM, VINS, Cityscapes, "
                "stereodemo, or JSON with focal_px and baseline_m. With both cameras’ matrices and distortion the pair "
                "is rectified.",
                variant=unit or "",
            )
            unknown = given is not None and unit is None and not given.content.unit_stated
            st.segmented_control(
                "Which unit are its lengths in? The file does not say." if unknown else "Lengths without a unit are in",
                [*UNITS],
                **persistent(f"{key}.unit"),
                help="Files of OpenCV and NumPy do not state it: it is the unit of the chessboard’s square size. "
                "Others state it, or are in metres by convention (ROS, Kalibr).",
            )
        focal = columns[1].number_input(
            "Focal length, px",
            min_value=1.0,
            value=None,
            **persistent(f"{key}.focal"),
            placeholder="from the file" if given else "not known",
            disabled=given is not None,
        )
        baseline = columns[2].number_input(
            "Baseline, m",
            min_value=0.0001,
            value=None,
            format="%.4f",
            **persistent(f"{key}.baseline"),
            placeholder="from the file" if given else "not known",
            disabled=given is not None,
            help="The distance between the two cameras.",
        )
    if given is not None:
        # What it means in metres, and what was assumed.
        said = " ".join((given.content.in_words(), *given.content.notes))
        if given.content.plausible:
            prose.caption(said, width="content")
        else:
            prose.warning(said)
        return given.content
    if focal is None or baseline is None:
        return _kept_calibration()
    return Calibration(focal, baseline)


KEPT = "calibrate.kept"
"""Session-state key of the calibration made on the page Calibrate."""


def take_to_depth_page(calibration: Calibration) -> None:
    """Open the depth page with a calibration, for the visitor's own files, to which it applies."""
    st.session_state.update({KEPT: calibration, PAIR: OWN, FOLD: True})
    st.session_state.pop(HANDED, None)
    no_files_yet(PAIR)
    st.switch_page(DEPTH_PAGE)


def _kept_calibration() -> Calibration | None:
    """Return the calibration made on the page Calibrate; say that it is in use, with a button to stop using it."""
    kept: Calibration | None = st.session_state.get(KEPT)
    if kept is not None:
        error = "" if kept.rms is None else f", {kept.rms:.2f} px"
        said = f"In use: the calibration you made on the page Calibrate{error}."
        show_offer(said, "Remove", f"{KEPT}.remove", partial(st.session_state.pop, KEPT, None))
    return kept


ROWS = {Rows.DECIDE: "Decide from the rows", Rows.RAW: "Raw", Rows.RECTIFIED: "Rectified already"}


def rows_key(key: str) -> str:
    """Return the key of the control for raw or rectified images; `key` is the prefix of the page's keys."""
    return f"{key}.pictures_are"


def ask_rectification(calibration: Calibration | None, key: str) -> None:
    """Ask whether the images are raw or rectified, if the calibration is that of both cameras before rectification.

    Parameters
    ----------
    calibration
        That of the pair as read.
    key
        Prefix of the keys of the controls; :func:`chosen_preparation` returns the answer.
    """
    if calibration is None or calibration.rig is None:
        return
    with st.container(horizontal=True, vertical_alignment="bottom", gap="medium"):
        st.segmented_control(
            "The images are",
            [*ROWS],
            default=Rows.DECIDE,
            format_func=ROWS.__getitem__,
            required=True,
            **persistent(rows_key(key)),
            help="The calibration describes both cameras before rectification. Raw images are undistorted and "
            "rectified with it; images that are rectified already are left as they are.",
        )
        if calibration.rig.rectification is None:
            st.slider(
                "Frame (`alpha`)",
                0.0,
                1.0,
                0.0,
                0.05,
                **persistent(f"{key}.alpha"),
                width=220,
                help="The calibration does not include the rectification (R1, R2, P1, P2). 0 crops to valid pixels, "
                "1 keeps all pixels, with black around them. For images that are rectified already: the value they "
                "were rectified with, as metres depend on it.",
            )


def chosen_preparation(key: str, divisor: int | None = 1) -> Preparation:
    """Return how the visitor wants pairs to be prepared, without remedies; `key` is the prefix of the page's keys."""
    state = st.session_state
    return Preparation(divisor, Rows(state.get(rows_key(key), Rows.DECIDE)), state.get(f"{key}.alpha", 0.0))


STEPS = {
    "resized pair": "Resizing …",
    "rectified pair": "Rectifying the pair …",
    "row evidence": "Comparing the rows …",
    "remedy": "Correcting the pair …",
}


def prepared(pair: Pair, preparation: Preparation) -> Pair:
    """Return the pair ready for matching, from memory as far as possible; show the errors of steps that are not."""

    def remembered_step(step: str, make: Callable[[], T], pair: Pair, settings: str) -> T:
        return computed(
            step,
            lambda progress: make(),
            inputs=pair.digest,
            settings=settings,
            shared=pair.shared,
            label=STEPS[step],
        )

    return prepare(pair, preparation, memo=remembered_step, refused=show_refused)


def show_decision(pair: Pair, key: str, subject: str = "The pair") -> None:
    """Show whether the pair was rectified and why, with a button that undoes it."""
    decision = pair.rectification
    if decision is None:
        return
    undo = ("Undo", Rows.RECTIFIED) if decision.done else ("Rectify it all the same", Rows.RAW)
    label, rows = (ROWS[Rows.DECIDE], Rows.DECIDE) if decision.chosen else undo
    choose = partial(st.session_state.update, {rows_key(key): rows})
    show_offer(decision.in_words(subject), label, f"{key}.rectifying.undo", choose, ":material/straighten:")
