"""A plan of two sensors and a source to drag: a lag is a path difference, not a distance.

Everything runs in the browser (the scripts beside this file); nothing is sent back.
"""

from __future__ import annotations

from pathlib import Path

import streamlit as st

from stereolag.figures.pictures import CORRELATION, PEAK, SENSOR_1, SENSOR_2
from stereolag.signals import SignalLag
from stereolag.ui import prose
from stereolag.ui.lag import sliding
from stereolag.ui.linked_pictures import source

HERE = Path(__file__).parent

EXAMPLE_M = 100.0
"""Initial distance between the sensors if no path difference was measured, m."""

_panel = st.components.v2.component(
    "stereolag.plan",
    html=source("plan.html", folder=HERE),
    css=source("plan.css", folder=HERE),
    js=source("shown.js", "numbers.js")
    + source("drawing.js", folder=sliding.HERE)
    + source("geometry.js", "plan.js", folder=HERE),
)


def show_plan(result: SignalLag | None, speed: float, *, key: str) -> None:
    """Show the source positions that give the measured lag, if it is sure.

    Parameters
    ----------
    result
        Lag of the recordings; None if not measured.
    speed
        Speed of the wave, m/s.
    key
        Key of the component.
    """
    prose.markdown(
        "A lag measures how much longer one path is than the other. Every source on one **hyperbola** has the same "
        "path difference, so the sensors are that far apart only if the source is in line with them; otherwise they "
        "are farther apart. Dashed: every place where the source of your recordings can be."
    )
    measured = result.time_s * speed if result and result.verdict == "sure" and result.lag else None
    _panel(
        key=key,
        data={
            "difference": measured,
            "example": EXAMPLE_M,
            "speed": speed,
            "colours": {"sensor-1": SENSOR_1, "sensor-2": SENSOR_2, "curve": CORRELATION, "peak": PEAK},
        },
    )
