"""A plan of two sensors and a source that can be dragged: a lag is a difference of paths, not a distance.

All happens in the browser (the scripts beside this file); nothing comes back.
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
"""How far apart the sensors stand at first where no path difference was measured."""

_panel = st.components.v2.component(
    "stereolag.plan",
    html=source("plan.html", folder=HERE),
    css=source("plan.css", folder=HERE),
    js=source("shown.js", "numbers.js")
    + source("drawing.js", folder=sliding.HERE)
    + source("geometry.js", "plan.js", folder=HERE),
)


def show_plan(result: SignalLag | None, speed: float, *, key: str) -> None:
    """Show from which places a source is heard with the lag that was measured, if it is sure.

    Parameters
    ----------
    result
        Of the recordings, None where there is none.
    speed
        Of the wave, m/s.
    key
        Of the component.
    """
    prose.markdown(
        "A lag tells how much longer one path is than the other. Every source on one **hyperbola** has the same path "
        "difference, so the sensors stand that far apart only if the source lies in line with them; anywhere else they "
        "are farther apart. Dashed: every place from which your recordings’ lag can come."
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
