"""Panels in which recordings are slid, disturbed, turned and laid out by hand.

The interactive counterparts of Figs. 1.1, 1.3b, A.2 and C.1 to C.3 of the report. All but the disturbed recordings run
in the browser; those are mixed and measured here whenever a slider moves.
"""

from __future__ import annotations

import json
from dataclasses import asdict
from functools import cache, lru_cache
from typing import Any, Final, cast

import streamlit as st

from stereolag import samples
from stereolag.core.arrays import Vector
from stereolag.core.searches import LagSearch
from stereolag.core.settings import Bounds
from stereolag.figures.recordings import band_of_chance
from stereolag.signals import SignalLag, by_hand, phasors, signal_lag
from stereolag.ui import prose
from stereolag.ui.components import component
from stereolag.ui.inputs import RecordingPair, example_recordings
from stereolag.ui.lag import COLOURS
from stereolag.ui.lag.result import show_curve
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
    excerpt_slid_in_words,
    own_in_words,
)
from stereolag.ui.navigation import fragment
from stereolag.ui.results import remembered

_sliding, _disturbances, _phasors, _plan = map(component, ("sliding", "disturbances", "phasors", "plan"))

# Slide it


def slide_it(pair: RecordingPair, result: SignalLag, search: LagSearch) -> None:
    """Show an excerpt of the recordings to slide by hand, beside the correlation of the whole recordings."""
    by_hand_place, curve = st.columns([2, 1], gap="medium")
    with by_hand_place:
        slide_by_hand(pair, result)
    with curve:
        show_curve(pair, result, search)
        prose.markdown(IN_A_SENTENCE)


def slide_by_hand(pair: RecordingPair, result: SignalLag, *, small: bool = False) -> None:
    """Show an excerpt of the recordings, if they overlap enough, and the examples that can be slid by hand.

    A small one is low, without the other examples, and explains nothing.
    """
    own = remembered(
        "excerpt",
        lambda: _excerpt(pair, result),
        inputs=pair.digest,
        settings=f"{result.lag} {result.verdict}",
        shared=pair.shared,
    )
    examples = json.loads(own) + ([] if small else _slides())
    _sliding(
        key="lag.sliding",
        data={"examples": examples, "colours": COLOURS, "words": SLIDING_WORDS, "small": small},
    )


def _excerpt(pair: RecordingPair, result: SignalLag) -> bytes:
    """Return the excerpt of the recordings as JSON, in a list that is empty if they overlap too little."""
    found = by_hand.excerpt(pair.signal_1, pair.signal_2, result.lag)
    return json.dumps([described_slide(found, **excerpt_slid_in_words(found, result))] if found else []).encode()


@cache
def _slides() -> list[dict[str, Any]]:
    slides = by_hand.seven_numbers(), by_hand.tone(), by_hand.noise(), by_hand.loud_stretch()
    return [described_slide(slide, **SLIDING_EXAMPLES[slide.name]) for slide in slides]


def described_slide(slide: by_hand.Slide, **said: Any) -> dict[str, Any]:
    """Return an example as data for the browser, together with its texts, `said`."""
    return {
        "name": slide.name,
        "cut": slide.cut.round(4).tolist(),
        "recording": slide.recording.round(4).tolist(),
        "lag": slide.lag,
        "step": slide.step,
        "whole": bool((slide.recording == slide.recording.round()).all()),
        **said,
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


def fool_it(pair: RecordingPair, result: SignalLag, search: LagSearch) -> None:
    """Show the sliders that disturb a sound, whatever was measured."""
    show_disturbances(key="lag.fooling")


@fragment
def show_disturbances(*, key: str) -> None:
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


def show_phasors(pair: RecordingPair, result: SignalLag, search: LagSearch) -> None:
    """Show the arrows of the examples, and of the visitor's own recordings if a lag was found."""
    prose.markdown(PHASOR_INTRODUCTION)
    _phasors(
        key="lag.phasors",
        data={
            "examples": [*_own_phasors(pair, result), *_example_phasors()],
            "colours": COLOURS,
            "words": PHASOR_WORDS,
        },
    )


def _own_phasors(pair: RecordingPair, result: SignalLag) -> list[dict[str, Any]]:
    if pair.shared or result.verdict == "nothing":
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


def show_plan(pair: RecordingPair, result: SignalLag, search: LagSearch) -> None:
    """Show the source positions that give the measured lag, if it is sure."""
    prose.markdown(PLAN_INTRODUCTION)
    measured = result.time_s * search.speed if result.verdict == "sure" and result.lag else None
    _plan(
        key="lag.plan",
        data={"difference": measured, "example": EXAMPLE_M, "speed": search.speed, "colours": COLOURS},
    )
