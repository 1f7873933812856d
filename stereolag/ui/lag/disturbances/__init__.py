"""Disturb two recordings by noise, repetition, an echo and drift, and watch the verdict on their lag change.

Mixing, correlation and verdict all run in the browser (the scripts beside this file), by the rule of
:mod:`stereolag.signals.verdict`; nothing is sent back.
"""

from __future__ import annotations

import base64
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
import streamlit as st

from stereolag.figures.pictures import CORRELATION, PEAK, SENSOR_1, SENSOR_2
from stereolag.signals import by_hand
from stereolag.ui.lag import sliding
from stereolag.ui.lag.disturbances.words import EXAMPLES, SLIDERS, START, WORDS
from stereolag.ui.linked_pictures import source

HERE = Path(__file__).parent

ARITHMETIC = ("fourier.js", "curve.js", "whitening.js", "rivals.js", "drift.js", "verdict.js", "mixing.js")
"""Scripts that need no page, so that tests can run them on their own."""

_panel = st.components.v2.component(
    "stereolag.disturbances",
    html=source("disturbances.html", folder=HERE),
    css=source("sliding.css", folder=sliding.HERE) + source("disturbances.css", folder=HERE),
    js=source("shown.js", "numbers.js")
    + source("drawing.js", folder=sliding.HERE)
    + source(*ARITHMETIC, "plots.js", "disturbances.js", folder=HERE),
)


def fool_it(*, key: str) -> None:
    """Show the disturbance sliders and their effect on the peak.

    Parameters
    ----------
    key
        Key of the component.
    """
    _panel(
        key=key,
        data={
            "parts": described_parts(),
            "reach": by_hand.MAX_LAG,
            "sliders": SLIDERS,
            "start": START,
            "examples": EXAMPLES,
            "colours": {"sensor-1": SENSOR_1, "sensor-2": SENSOR_2, "curve": CORRELATION, "peak": PEAK},
            "words": WORDS,
        },
    )


@cache
def described_parts() -> dict[str, Any]:
    """Return the signals and constants for mixing in the browser; samples are Base64 of signed bytes."""
    parts = by_hand.ingredients()
    return {
        "fresh": _text(parts.fresh),
        "pattern": _text(parts.pattern),
        "noises": [_text(parts.noise_1), _text(parts.noise_2)],
        "unit": by_hand.UNIT,
        "softness": by_hand.SOFTNESS,
        "settling": by_hand.SETTLING,
        "before": by_hand.BEFORE,
        "samples": by_hand.SAMPLES,
        "lag": by_hand.LAG,
        "echo_delay": by_hand.ECHO_DELAY,
    }


def _text(values: npt.NDArray[np.int8]) -> str:
    return base64.b64encode(values.tobytes()).decode("ascii")
