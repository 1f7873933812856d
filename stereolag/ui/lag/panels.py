"""Panels in which recordings are slid, disturbed, turned and laid out by hand.

The interactive counterparts of Figs. 1.1, 1.3b, A.2 and C.1 to C.3 of the report. Everything runs in the browser, the
verdict on disturbed recordings too, by the rule of :mod:`stereolag.signals.verdict`; nothing is sent back.
"""

from __future__ import annotations

import base64
from functools import cache
from typing import Any, Final

import numpy as np
import numpy.typing as npt
import streamlit as st

from stereolag import samples
from stereolag.core.arrays import Vector
from stereolag.core.searches import LagSearch
from stereolag.figures.pictures import CORRELATION, PEAK, SENSOR_1, SENSOR_2
from stereolag.signals import SignalLag, by_hand, phasors
from stereolag.ui import prose
from stereolag.ui.components import component
from stereolag.ui.inputs import RecordingPair, example_recordings
from stereolag.ui.lag.sentences import (
    DISTURBANCE_EXAMPLES,
    DISTURBANCE_WORDS,
    IN_A_SENTENCE,
    PHASOR_EXAMPLES,
    PHASOR_INTRODUCTION,
    PHASOR_WORDS,
    PLAN_INTRODUCTION,
    SLIDING_EXAMPLES,
    SLIDING_WORDS,
    excerpt_in_words,
    own_in_words,
)

COLOURS: Final = {"sensor-1": SENSOR_1, "sensor-2": SENSOR_2, "curve": CORRELATION, "peak": PEAK}

_sliding, _disturbances, _phasors, _plan = map(component, ("sliding", "disturbances", "phasors", "plan"))

# Slide it yourself

COAST_START, COAST_STEP = 5191, 6
"""A place with one clear peak; six samples are averaged into one to show waves rather than slopes."""


def slide_it_yourself(*, key: str) -> None:
    """Show the examples that can be slid by hand.

    Parameters
    ----------
    key
        Key of the component.
    """
    _sliding(
        key=key,
        data={
            "examples": _slides(),
            "colours": COLOURS,
            "words": SLIDING_WORDS,
        },
    )


@cache
def _slides() -> list[dict[str, Any]]:
    coast = example_recordings("coast")
    lag = samples.recordings()["coast"].lag
    slides = (
        by_hand.seven_numbers(),
        by_hand.excerpt(coast.signal_1, coast.signal_2, lag, start=COAST_START, step=COAST_STEP),
        by_hand.tone(),
        by_hand.noise(),
        by_hand.loud_stretch(),
    )
    return [described_slide(slide) for slide in slides]


def described_slide(slide: by_hand.Slide) -> dict[str, Any]:
    """Return an example as data for the browser."""
    return {
        "name": slide.name,
        "cut": slide.cut.round(4).tolist(),
        "recording": slide.recording.round(4).tolist(),
        "lag": slide.lag,
        "step": slide.step,
        "whole": bool((slide.recording == slide.recording.round()).all()),
        **SLIDING_EXAMPLES[slide.name],
    }


# Fool it

SLIDERS: Final[tuple[dict[str, Any], ...]] = (
    {"name": "noise", "title": "Noise", "low": -30, "high": 30, "step": 1, "unit": "dB", "signed": True},
    {"name": "repetition", "title": "Repetition", "low": 0, "high": 100, "step": 10, "unit": "%"},
    {
        "name": "period",
        "title": "Period",
        "low": 20,
        "high": by_hand.LONGEST_PERIOD,
        "step": 20,
        "unit": "samples",
    },
    {"name": "echo", "title": "Echo", "low": 0, "high": 150, "step": 5, "unit": "%"},
    {"name": "drift", "title": "Drift", "low": 0, "high": by_hand.MOST_DRIFT, "step": 1, "unit": "samples"},
)

START: Final[dict[str, float]] = {"noise": -10, "repetition": 0, "period": 400, "echo": 0, "drift": 0}


def fool_it(*, key: str) -> None:
    """Show the disturbance sliders and their effect on the peak.

    Parameters
    ----------
    key
        Key of the component.
    """
    _disturbances(
        key=key,
        data={
            "parts": described_parts(),
            "reach": by_hand.MAX_LAG,
            "sliders": SLIDERS,
            "start": START,
            "examples": DISTURBANCE_EXAMPLES,
            "colours": COLOURS,
            "words": DISTURBANCE_WORDS,
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


# Arrows that line up


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
    prose.markdown(PHASOR_INTRODUCTION)
    _phasors(
        key=key,
        data={
            "examples": [*_own_phasors(pair, result), *_example_phasors()],
            "colours": COLOURS,
            "words": PHASOR_WORDS,
        },
    )


def _own_phasors(pair: RecordingPair, result: SignalLag | None) -> list[dict[str, Any]]:
    if pair.shared or result is None or result.verdict == "nothing":
        return []
    found = phasors.common_stretch("own", pair.signal_1, pair.signal_2, result.lag)
    return [described_phasors(found, **own_in_words(found))] if found else []


@cache
def _example_phasors() -> list[dict[str, Any]]:
    excerpts = []
    for name, example in samples.recordings().items():
        pair = example_recordings(name)
        found = phasors.common_stretch(name, pair.signal_1, pair.signal_2, example.lag)
        excerpts += [found] if found else []
    return [
        described_phasors(one, **PHASOR_EXAMPLES[one.name])
        for one in (phasors.knock(), *excerpts, phasors.tone(), phasors.noise())
    ]


def described_phasors(found: phasors.Phasors, **said: Any) -> dict[str, Any]:
    """Return an example as data for the browser, together with its texts, `said`."""
    described = {
        "name": found.name,
        "magnitude_1": _significant(found.magnitude_1),
        "magnitude_2": _significant(found.magnitude_2),
        "turns": found.turns.round(6).tolist(),
        "size": phasors.SIZE,
        "longest": phasors.LONGEST_LAG,
        "offset": found.offset,
        "step": found.step,
        "excerpt": found.offset != 0 or found.step > 1,
        **said,
    }
    return described | {"try": f"{excerpt_in_words(found)} {said['try']}"} if described["excerpt"] else described


def _significant(values: Vector) -> list[float]:
    """Return each value to six significant digits, so that no nonzero value becomes 0."""
    return [float(f"{value:.6g}") for value in values]


# From lag to metres

EXAMPLE_M = 100.0
"""Initial distance between the sensors if no path difference was measured, m."""


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
    prose.markdown(PLAN_INTRODUCTION)
    measured = result.time_s * speed if result and result.verdict == "sure" and result.lag else None
    _plan(
        key=key,
        data={
            "difference": measured,
            "example": EXAMPLE_M,
            "speed": speed,
            "colours": COLOURS,
        },
    )


def see_why(pair: RecordingPair, result: SignalLag | None, search: LagSearch | None) -> None:
    """Show the panels in which recordings are slid, disturbed and turned by hand, all in the browser.

    Parameters
    ----------
    pair
        The recordings on the page.
    result, search
        Their result and its settings; None before the first measurement.
    """
    prose.header("See why", anchor="see-why")
    slide, disturb, arrows, metres = st.tabs(
        ("Slide it yourself", "Fool it", "Arrows that line up", "From lag to metres")
    )
    with slide:
        slide_it_yourself(key="lag.sliding")
    with disturb:
        fool_it(key="lag.fooling")
    with arrows:
        show_phasors(pair, result, key="lag.phasors")
    with metres:
        show_plan(result, (search or LagSearch()).speed, key="lag.plan")
    prose.markdown(IN_A_SENTENCE)
