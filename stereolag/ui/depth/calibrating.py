"""The calibration of a visitor's own camera, from files or typed in, and the rectification of pairs with it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import TypeVar

import streamlit as st

from stereolag.geometry.calibration import Calibration
from stereolag.io.calibrations import read_calibration
from stereolag.io.guard import guarded
from stereolag.pair import Pair, Preparation, Rows, prepare
from stereolag.ui import prose
from stereolag.ui.calibrate import use_kept_calibration
from stereolag.ui.controls import persistent
from stereolag.ui.elements import show_refused
from stereolag.ui.results import computed
from stereolag.ui.uploads import CALIBRATION_TYPES, Upload, upload_together

T = TypeVar("T")

UNITS = {"m": 1.0, "cm": 0.01, "mm": 0.001}


def ask_calibration(key: str) -> Upload[Calibration] | None:
    """Ask for the calibration of the camera; None if there is none, and depth is then relative."""
    with st.expander("Calibration (optional): for depth in metres, and to rectify"):
        columns = st.columns([2, 1, 1], gap="medium")
        with columns[0]:
            unit = st.session_state.get(f"{key}.unit", "m")
            given = upload_together(
                "Calibration files",
                lambda contents: guarded(read_calibration)(*contents, length_unit_m=UNITS[unit]),
                key=f"{key}.calibration",
                types=CALIBRATION_TYPES,
                note="All files of one calibration, together or one by one. OpenCV’s YAML, XML or JSON, NPZ, ROS, "
                "Kalibr, Middlebury, KITTI, stereodemo, or JSON with focal_px and baseline_m. With both cameras’ "
                "matrices and distortion the pair is rectified.",
                variant=unit,
            )
            st.segmented_control(
                "Lengths without a unit are in",
                [*UNITS],
                default="m",
                required=True,
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
        return given
    if focal is None or baseline is None:
        return use_kept_calibration()
    return Upload(f"{focal} {baseline}", Calibration(focal, baseline))


ROWS = {Rows.DECIDE: "Decide from the rows", Rows.RAW: "Raw", Rows.RECTIFIED: "Rectified already"}


def rows_key(key: str) -> str:
    """Return the key of the control for raw or rectified images; `key` is the prefix of the page's keys."""
    return f"{key}.pictures_are"


def alpha_key(key: str) -> str:
    """Return the key of the control for the frame; `key` is the prefix of the page's keys."""
    return f"{key}.alpha"


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
                **persistent(alpha_key(key)),
                width=220,
                help="The calibration does not include the rectification (R1, R2, P1, P2). 0 crops to valid pixels, "
                "1 keeps all pixels, with black around them. For images that are rectified already: the value they "
                "were rectified with, as metres depend on it.",
            )


def chosen_preparation(key: str, divisor: int | None = 1) -> Preparation:
    """Return how the visitor wants pairs to be prepared, without remedies; `key` is the prefix of the page's keys."""
    state = st.session_state
    return Preparation(divisor, Rows(state.get(rows_key(key), Rows.DECIDE)), state.get(alpha_key(key), 0.0))


def prepared(pair: Pair, preparation: Preparation) -> Pair:
    """Return the pair ready for matching, from memory as far as possible; show the errors of steps that are not."""
    return prepare(pair, preparation, memo=_remembered_step, refused=show_refused)


STEPS = {
    "resized pair": "Resizing …",
    "rectified pair": "Rectifying the pair …",
    "row evidence": "Comparing the rows …",
    "remedy": "Correcting the pair …",
}


def _remembered_step(step: str, make: Callable[[], T], pair: Pair, settings: str) -> T:
    return computed(
        step,
        lambda progress: make(),
        inputs=pair.digest,
        settings=settings,
        shared=pair.shared,
        label=STEPS[step],
    )


def show_decision(pair: Pair, key: str, subject: str = "The pair") -> None:
    """Show whether the pair was rectified and why, with a button that undoes it."""
    decision = pair.rectification
    if decision is None:
        return
    undo = ("Undo", Rows.RECTIFIED) if decision.done else ("Rectify it all the same", Rows.RAW)
    label, rows = (ROWS[Rows.DECIDE], Rows.DECIDE) if decision.chosen else undo
    with st.container(horizontal=True, vertical_alignment="center", gap="small"):
        prose.caption(f":material/straighten: {decision.in_words(subject)}", width="content")
        st.button(label, key=f"{key}.rectifying.undo", type="tertiary", on_click=partial(_choose, key, rows))


def _choose(key: str, rows: Rows) -> None:
    st.session_state[rows_key(key)] = rows


@dataclass(frozen=True)
class KnownDistance:
    """A pixel, its distance as entered by the visitor, metres, and the calibration derived from it."""

    row: int
    col: int
    metres: float
    calibration: Calibration


def known_distance(pair: Pair) -> KnownDistance | None:
    """Return the distance that the visitor entered for this pair in this session."""
    known: KnownDistance | None = st.session_state.get(_key(pair))
    return known


def keep_known_distance(pair: Pair, known: KnownDistance | None) -> None:
    """Keep a known distance for this pair, or forget it."""
    st.session_state[_key(pair)] = known


def calibration_of(pair: Pair) -> Calibration | None:
    """Return the calibration in use: derived from the known distance if one was entered, else the pair's own."""
    known = known_distance(pair)
    return known.calibration if known else pair.calibration


def _key(pair: Pair) -> str:
    return f"depth.known.{pair.digest}"
