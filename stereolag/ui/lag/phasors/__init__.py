"""Turn the arrows of a cross-spectrum back by hand until they line up, and watch how far their chain reaches.

The interactive counterpart of Figs. C.1 to C.3 of the report. Everything runs
in the browser (the scripts beside this file); nothing is sent back.
"""

from __future__ import annotations

from functools import cache
from pathlib import Path
from typing import Any

import streamlit as st

from stereolag import samples
from stereolag.core.arrays import Vector
from stereolag.figures.pictures import CORRELATION, PEAK, SENSOR_1, SENSOR_2
from stereolag.signals import SignalLag
from stereolag.signals.phasors import (
    LONGEST_LAG,
    SIZE,
    Phasors,
    common_stretch,
    knock,
    noise,
    tone,
)
from stereolag.ui import prose
from stereolag.ui.lag import sliding
from stereolag.ui.lag.phasors.words import EXAMPLES, INTRODUCTION, WORDS, excerpt_in_words, own_in_words
from stereolag.ui.linked_pictures import source
from stereolag.ui.recordings import RecordingPair, example_recordings

HERE = Path(__file__).parent

_panel = st.components.v2.component(
    "stereolag.phasors",
    html=source("phasors.html", folder=HERE),
    css=source("sliding.css", folder=sliding.HERE) + source("phasors.css", folder=HERE),
    js=source("shown.js", "numbers.js")
    + source("drawing.js", "panel.js", folder=sliding.HERE)
    + source("chain.js", "charts.js", "phasors.js", folder=HERE),
)


def show_phasors(pair: RecordingPair, result: SignalLag | None, *, key: str) -> None:
    """Show the arrows of the examples, and of the visitor's own recordings if a lag was found.

    Parameters
    ----------
    pair
        The recordings measured.
    result
        Their lag; None before the first measurement.
    key
        Key of the component.
    """
    prose.markdown(INTRODUCTION)
    _panel(
        key=key,
        data={
            "examples": [*_own(pair, result), *_described_examples()],
            "colours": {"sensor-1": SENSOR_1, "sensor-2": SENSOR_2, "curve": CORRELATION, "peak": PEAK},
            "words": WORDS,
        },
    )


def _own(pair: RecordingPair, result: SignalLag | None) -> list[dict[str, Any]]:
    if pair.shared or result is None or result.verdict == "nothing":
        return []
    found = common_stretch("own", pair.signal_1, pair.signal_2, result.lag)
    return [described(found, **own_in_words(found))] if found else []


@cache
def _described_examples() -> list[dict[str, Any]]:
    excerpts = []
    for name, example in samples.recordings().items():
        pair = example_recordings(name)
        found = common_stretch(name, pair.signal_1, pair.signal_2, example.lag)
        excerpts += [found] if found else []
    return [described(one, **EXAMPLES[one.name]) for one in (knock(), *excerpts, tone(), noise())]


def described(phasors: Phasors, **said: Any) -> dict[str, Any]:
    """Return an example as data for the browser, together with its texts, `said`."""
    told = {
        "name": phasors.name,
        "magnitude_1": _significant(phasors.magnitude_1),
        "magnitude_2": _significant(phasors.magnitude_2),
        "turns": phasors.turns.round(6).tolist(),
        "size": SIZE,
        "longest": LONGEST_LAG,
        "offset": phasors.offset,
        "step": phasors.step,
        "excerpt": phasors.offset != 0 or phasors.step > 1,
        **said,
    }
    return told | {"try": f"{excerpt_in_words(phasors)} {said['try']}"} if told["excerpt"] else told


def _significant(values: Vector) -> list[float]:
    """Return each value to six significant digits, so that no nonzero value becomes 0."""
    return [float(f"{value:.6g}") for value in values]
