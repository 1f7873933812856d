"""Panels in which recordings are slid, disturbed, turned and laid out by hand.

The interactive counterparts of Figs. 1.1, 1.3b, A.2 and C.1 to C.3 of the report. All but the disturbed recordings run
in the browser; those are mixed and measured here whenever a slider moves.
"""

from __future__ import annotations

from dataclasses import asdict
from functools import cache, lru_cache
from typing import Any, Final, cast

import streamlit as st

from stereolag import samples
from stereolag.core.arrays import Vector
from stereolag.core.searches import LagSearch
from stereolag.core.settings import Bounds
from stereolag.figures.pictures import CORRELATION, PEAK, SENSOR_1, SENSOR_2
from stereolag.figures.recordings import band_of_chance
from stereolag.signals import SignalLag, by_hand, phasors, signal_lag
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
    disturbed_in_words,
    excerpt_in_words,
    own_in_words,
)
from stereolag.ui.navigation import fragment

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

SLIDERS: Final = [
    {
        "name": name,
        "title": field.title,
        "meaning": field.description,
        **asdict(Bounds.of(field)),
        **cast("dict[str, str]", field.json_schema_extra),
    }
    for name, field in by_hand.Disturbances.model_fields.items()
    if field.title
]

SHOWN: Final = slice(3000, 3240)
"""The samples of recording 1 shown above those of recording 2 that line up with them."""


@fragment
def fool_it(*, key: str) -> None:
    """Show the disturbance sliders and their effect on the peak, which the library measures whenever one moves.

    Parameters
    ----------
    key
        Key of the component.
    """
    try:
        asked = by_hand.Disturbances.model_validate(dict(st.session_state.get(key) or {}).get("settings") or {})
    except ValueError:
        asked = by_hand.Disturbances()
    _disturbances(
        key=key,
        data={
            "sliders": SLIDERS,
            "start": by_hand.Disturbances().model_dump(),
            "examples": DISTURBANCE_EXAMPLES,
            "colours": COLOURS,
            "words": DISTURBANCE_WORDS,
            "lag": by_hand.LAG,
            **judged(asked),
        },
        on_settings_change=lambda: None,
    )


@lru_cache(maxsize=64)
def judged(settings: by_hand.Disturbances) -> dict[str, Any]:
    """Return the lag of recordings disturbed in this way, what is to be drawn of it and said about it."""
    first, second = by_hand.disturbed(settings)
    result = signal_lag(first, second, max_lag=by_hand.MAX_LAG)
    assert result.correlation is not None
    of_second = slice(SHOWN.start + result.lag, SHOWN.stop + result.lag)
    return {
        "settings": settings.model_dump(),
        "said": disturbed_in_words(settings, result),
        "recordings": [part.round(3).tolist() for part in (first[SHOWN], second[of_second])],
        "curve": result.correlation.round(5).tolist(),
        "ribbon": band_of_chance(result),
        "peak": result.lag,
        "rivals": result.rivals,
        "verdict": result.verdict,
        **{name: getattr(result.judgement, name) for name in ("evidence", "chance", "needed")},
    }


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
    """Show the panels in which recordings are slid, disturbed, turned and laid out by hand.

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
