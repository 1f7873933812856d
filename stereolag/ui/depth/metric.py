"""From disparity to metres on the depth page: the pair's calibration, or one known distance."""

from __future__ import annotations

import math
from dataclasses import dataclass

import streamlit as st

from stereolag.calibration import Calibration
from stereolag.distances import DISPARITY_ERROR, typical_error
from stereolag.figures.linked_pictures import DepthScale
from stereolag.ui.depth.view import DepthView
from stereolag.ui.pairs import StereoPair


@dataclass(frozen=True)
class KnownDistance:
    """A pixel whose distance, metres, the visitor knows, and the calibration that follows from it."""

    row: int
    col: int
    metres: float
    calibration: Calibration


def known_distance(pair: StereoPair) -> KnownDistance | None:
    """Return the distance that the visitor gave for this pair in this session."""
    known: KnownDistance | None = st.session_state.get(_key(pair))
    return known


def keep_known_distance(pair: StereoPair, known: KnownDistance | None) -> None:
    """Keep a known distance for this pair, or forget it."""
    st.session_state[_key(pair)] = known


def calibration_of(pair: StereoPair) -> Calibration | None:
    """Return what makes metres of the pair's disparities: the known distance if one was given, else its calibration."""
    known = known_distance(pair)
    return known.calibration if known else pair.calibration


def disparity_error(view: DepthView, name: str) -> float:
    """Return how far off the disparities of a method typically are, px: measured where the truth is known."""
    if view.pair.truth is None:
        return DISPARITY_ERROR
    error = typical_error(view.results[name].disparity, view.pair.truth)
    return DISPARITY_ERROR if math.isnan(error) else error


def depth_scale(pair: StereoPair, error: float) -> DepthScale | None:
    """Return what the browser needs to show depths; None without a calibration."""
    calibration = calibration_of(pair)
    if calibration is None:
        return None
    return DepthScale(calibration.focal_px * calibration.baseline_m, calibration.doffs_px, error)


def _key(pair: StereoPair) -> str:
    return f"depth.known.{pair.digest}"
