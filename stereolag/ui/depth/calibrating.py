"""The calibration of a visitor's own camera: from files, or two numbers typed in."""

from __future__ import annotations

from typing import TypeAlias

import streamlit as st

from stereolag.calibration import Calibration
from stereolag.reading import read_calibration
from stereolag.ui.uploads import CALIBRATION_TYPES, Upload, upload_together

Calibrated: TypeAlias = Upload[Calibration]

UNITS = {"m": 1.0, "cm": 0.01, "mm": 0.001}


def ask_calibration(key: str) -> Calibrated | None:
    """Ask for the calibration of the camera; None while there is none: depth is then relative."""
    with st.expander("Calibration (optional): for depth in metres, and to rectify"):
        columns = st.columns([2, 1, 1], gap="medium")
        with columns[0]:
            unit = st.session_state.get(f"{key}.unit", "m")
            given = upload_together(
                "Calibration files",
                lambda contents: read_calibration(*contents, length_unit_m=UNITS[unit]),
                key=f"{key}.calibration",
                types=CALIBRATION_TYPES,
                note="Middlebury calib.txt, KITTI calib*.txt, YAML or JSON of OpenCV, YAML of ROS, or JSON with "
                "focal_px and baseline_m. With both cameras’ matrices and distortion the pair is rectified.",
                variant=unit,
            )
            st.segmented_control(
                "Lengths in OpenCV’s files are in",
                [*UNITS],
                default="m",
                required=True,
                key=f"{key}.unit",
                persist_state="session",
                help="They do not name their unit: it is that of the chessboard’s squares.",
            )
        focal = columns[1].number_input(
            "Focal length, px",
            min_value=1.0,
            value=None,
            key=f"{key}.focal",
            persist_state="session",
            placeholder="from the file" if given else "not known",
            disabled=given is not None,
        )
        baseline = columns[2].number_input(
            "Baseline, m",
            min_value=0.0001,
            value=None,
            format="%.4f",
            key=f"{key}.baseline",
            persist_state="session",
            placeholder="from the file" if given else "not known",
            disabled=given is not None,
            help="The distance between the two cameras.",
        )
    if given is not None or focal is None or baseline is None:
        return given
    return Upload(f"{focal} {baseline}", Calibration(focal, baseline))
