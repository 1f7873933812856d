"""The bundled pairs, and the sizes at which a pair can be matched."""

from __future__ import annotations

import streamlit as st

from stereolag import samples
from stereolag.io.calibrations import read_calibration
from stereolag.io.disparities import read_disparity
from stereolag.io.images import read_image
from stereolag.pair import Pair, PairId

SIZES = {"Automatic": None, "Full": 1, "1/2": 2, "1/4": 4}
"""The sizes at which a pair can be matched, each with the divisor of its sides; None = chosen to suit the pair."""


@st.cache_resource(show_spinner="Loading the example …")
def example_pair(name: str) -> Pair:
    """Return one of the bundled pairs."""
    example = samples.stereo_pairs()[name]
    return Pair(
        read_image(example.left),
        read_image(example.right),
        PairId(f"pair {name}"),
        truth=read_disparity(example.disparity),
        visible=read_image(example.occlusion) == 0,
        calibration=read_calibration(example.calibration),
        num_disparities=example.num_disparities,
        description=example.description,
        shared=True,
    )
