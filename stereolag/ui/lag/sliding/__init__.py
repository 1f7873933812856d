"""Slide a cut of one recording over the other by hand, and watch the products add up.

The interactive counterpart of Figs. 1.1, 1.3b and A.2 of the report. Everything
runs in the browser (the scripts beside this file); nothing is sent back.
"""

from __future__ import annotations

from functools import cache
from pathlib import Path
from typing import Any

import streamlit as st

from stereolag import samples
from stereolag.figures.pictures import CORRELATION, PEAK, SENSOR_1, SENSOR_2
from stereolag.signals.by_hand import (
    Slide,
    excerpt,
    loud_stretch,
    noise,
    seven_numbers,
    tone,
)
from stereolag.ui.lag.sliding.words import EXAMPLES, WORDS
from stereolag.ui.linked_pictures import source
from stereolag.ui.recordings import example_recordings

HERE = Path(__file__).parent

COAST_START, COAST_STEP = 5191, 6
"""A place with one clear peak; six samples are averaged into one to show waves rather than slopes."""

_panel = st.components.v2.component(
    "stereolag.sliding",
    html=source("sliding.html", folder=HERE),
    css=source("sliding.css", folder=HERE),
    js=source("shown.js", "numbers.js")
    + source("drawing.js", "panel.js", "products.js", "strips.js", "sliding.js", folder=HERE),
)


def slide_it_yourself(*, key: str) -> None:
    """Show the examples that can be slid by hand.

    Parameters
    ----------
    key
        Key of the component.
    """
    _panel(
        key=key,
        data={
            "examples": _described_examples(),
            "colours": {"sensor-1": SENSOR_1, "sensor-2": SENSOR_2, "curve": CORRELATION, "peak": PEAK},
            "words": WORDS,
        },
    )


@cache
def _described_examples() -> list[dict[str, Any]]:
    coast = example_recordings("coast")
    lag = samples.recordings()["coast"].lag
    slides = (
        seven_numbers(),
        excerpt(coast.signal_1, coast.signal_2, lag, start=COAST_START, step=COAST_STEP),
        tone(),
        noise(),
        loud_stretch(),
    )
    return [described(slide) for slide in slides]


def described(slide: Slide) -> dict[str, Any]:
    """Return an example as data for the browser."""
    return {
        "name": slide.name,
        "cut": slide.cut.round(4).tolist(),
        "recording": slide.recording.round(4).tolist(),
        "lag": slide.lag,
        "step": slide.step,
        "whole": bool((slide.recording == slide.recording.round()).all()),
        **EXAMPLES[slide.name],
    }
