"""The calibration of a visitor's own camera: from files, or from two numbers typed in."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TypeAlias

import streamlit as st

from stereolag.geometry.calibration import Calibration
from stereolag.io.calibrations import read_calibration
from stereolag.io.guard import guarded
from stereolag.pair import Pair
from stereolag.ui.calibrate.result import use_kept_calibration
from stereolag.ui.persistence import persistent
from stereolag.ui.uploads import CALIBRATION_TYPES, Upload, upload_together

Calibrated: TypeAlias = Upload[Calibration]

UNITS = {"m": 1.0, "cm": 0.01, "mm": 0.001}


def ask_calibration(key: str) -> Calibrated | None:
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
