"""Interactive panels of the lag page: recordings slid or disturbed, their cross-spectrum, and a plan of the sensors.

They are the interactive counterparts of Figs. 1.1, 1.3b, A.2 and C.1 to C.3 of the report. All run in the browser,
except that the disturbed recordings are mixed and measured here whenever a slider moves.
"""

from __future__ import annotations

import json
from dataclasses import asdict
from functools import cache, lru_cache
from typing import Any, Final, cast

import numpy as np
import streamlit as st

from stereolag import samples
from stereolag.core.arrays import Vector
from stereolag.core.searches import LagSearch
from stereolag.core.settings import Bounds
from stereolag.figures import recordings as figures
from stereolag.signals import SignalLag, by_hand, phasors, signal_lag
from stereolag.ui import prose
from stereolag.ui.components import component
from stereolag.ui.lag.inputs import RecordingPair, example_recordings
from stereolag.ui.lag.parts import show_curve
from stereolag.ui.lag.sentences import (
    COLOURS,
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
from stereolag.ui.results import kept_for, remembered

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
    """Show an excerpt of the recordings, if they overlap enough, and the examples, to slide by hand.

    The small version is low and has neither examples nor explanations.
    """
    excerpt = remembered(
        "excerpt",
        lambda: _excerpt(pair, result),
        **kept_for(pair, f"{result.lag} {result.verdict}"),
    )
    component("sliding")(
        key="lag.sliding",
        data={
            "examples": json.loads(excerpt) + ([] if small else _slides()),
            "colours": COLOURS,
            "words": SLIDING_WORDS,
            "small": small,
        },
    )


def _excerpt(pair: RecordingPair, result: SignalLag) -> bytes:
    """Return the excerpt of the recordings as JSON, in a list that is empty if they overlap too little."""
    slide = by_hand.excerpt(pair.signal_1, pair.signal_2, result.lag)
    return json.dumps([described_slide(slide, **excerpt_slid_in_words(slide, result))] if slide else []).encode()


@cache
def _slides() -> list[dict[str, Any]]:
    return [
        described_slide(slide, **SLIDING_EXAMPLES[slide.name])
        for slide in (by_hand.seven_numbers(), by_hand.tone(), by_hand.noise(), by_hand.loud_stretch())
    ]


def described_slide(slide: by_hand.Slide, **texts: Any) -> dict[str, Any]:
    """Return an example as data for the browser, together with its texts."""
    return {
        "name": slide.name,
        "cut": slide.cut.round(4).tolist(),
        "recording": slide.recording.round(4).tolist(),
        "lag": slide.lag,
        "step": slide.step,
        "whole": bool((slide.recording == slide.recording.round()).all()),
        **texts,
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

SHOWN_SAMPLES: Final = slice(3000, 3240)
"""Samples of recording 1 that are shown, above those of recording 2 that line up with them."""


@fragment
def fool_it(pair: RecordingPair, result: SignalLag, search: LagSearch) -> None:
    """Show sliders that disturb a built-in sound, and their effect on the peak.

    The lag is measured again whenever a slider moves.
    """
    key = "lag.fooling"
    try:
        settings = by_hand.Disturbances.model_validate(dict(st.session_state.get(key) or {}).get("settings") or {})
    except ValueError:
        settings = by_hand.Disturbances()
    component("disturbances")(
        key=key,
        data={
            "sliders": SLIDERS,
            "start": by_hand.Disturbances().model_dump(),
            "examples": DISTURBANCE_EXAMPLES,
            "colours": COLOURS,
            "words": DISTURBANCE_WORDS,
            "lag": by_hand.LAG,
            **disturbance_data(settings),
        },
        on_settings_change=lambda: None,
    )


@lru_cache(maxsize=64)
def disturbance_data(settings: by_hand.Disturbances) -> dict[str, Any]:
    """Return the drawing of recordings disturbed in this way, the verdict on their lag, and its texts."""
    first, second = by_hand.disturbed(settings)
    result = signal_lag(first, second, max_lag=by_hand.MAX_LAG)
    assert result.correlation is not None
    shown_2 = slice(SHOWN_SAMPLES.start + result.lag, SHOWN_SAMPLES.stop + result.lag)
    return {
        "settings": settings.model_dump(),
        "said": disturbed_in_words(settings, result),
        "recordings": [
            (part / np.abs(part).max()).round(4).tolist() for part in (first[SHOWN_SAMPLES], second[shown_2])
        ],
        "curve": result.correlation.round(5).tolist(),
        "ribbon": figures.band_of_chance(result),
        "peak": result.lag,
        "rivals": result.rivals,
        "verdict": result.verdict,
        "evidence": result.judgement.evidence,
        "needed": result.judgement.needed,
        "agreement": figures.agreement_on_scale(result.judgement),
    }


# Arrows of the cross-spectrum


def show_phasors(pair: RecordingPair, result: SignalLag, search: LagSearch) -> None:
    """Show the cross-spectra of the examples, and of the visitor's own recordings if a lag was found."""
    prose.markdown(PHASOR_INTRODUCTION)
    component("phasors")(
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
    excerpt = phasors.common_stretch("own", pair.signal_1, pair.signal_2, result.lag)
    return [described_phasors(excerpt, **own_in_words(excerpt))] if excerpt else []


@cache
def _example_phasors() -> list[dict[str, Any]]:
    pairs = ((name, example_recordings(name), example.lag) for name, example in samples.recordings().items())
    excerpts = (phasors.common_stretch(name, pair.signal_1, pair.signal_2, lag) for name, pair, lag in pairs)
    return [
        described_phasors(one, **PHASOR_EXAMPLES[one.name])
        for one in (phasors.knock(), *filter(None, excerpts), phasors.tone(), phasors.noise())
    ]


def described_phasors(arrows: phasors.Phasors, **texts: Any) -> dict[str, Any]:
    """Return an example as data for the browser, together with its texts."""
    described = {
        "name": arrows.name,
        "magnitude_1": _significant(arrows.magnitude_1),
        "magnitude_2": _significant(arrows.magnitude_2),
        "turns": arrows.turns.round(6).tolist(),
        "size": phasors.SIZE,
        "longest": phasors.LONGEST_LAG,
        "offset": arrows.offset,
        "step": arrows.step,
        "excerpt": arrows.offset != 0 or arrows.step > 1,
        "measured": {name: _measured(arrows, whiten=name == "whitened") for name in ("plain", "whitened")},
        **texts,
    }
    return described | {"try": f"{excerpt_in_words(arrows)} {texts['try']}"} if described["excerpt"] else described


def _measured(arrows: phasors.Phasors, *, whiten: bool) -> dict[str, Any]:
    """Return the lengths of the arrows, the horizontal end of their chain at each lag, and the bounds of all chains.

    `perfect` is the length of the chain with all arrows in line; `peaks` are indices of lags, the smallest lag first.
    """
    tips = phasors.chains(arrows, whiten=whiten)
    heights = tips[:, -1].real
    lengths = arrows.lengths(whiten=whiten)
    ends = np.append(tips, [0, lengths.sum()])
    return {
        "lengths": _significant(lengths),
        "values": _significant(heights),
        "perfect": float(lengths.sum()),
        "peaks": phasors.peaks(heights),
        "bounds": [ends.real.min(), ends.real.max(), ends.imag.min(), ends.imag.max()],
    }


def _significant(values: Vector) -> list[float]:
    """Return each value to six significant digits, so that no nonzero value becomes 0."""
    return [float(f"{value:.6g}") for value in values]


# From lag to metres

MIN_EXAMPLE_SPACING_M = 100.0
"""Smallest sensor spacing on the plan if no path difference was measured, m."""


def show_plan(pair: RecordingPair, result: SignalLag, search: LagSearch) -> None:
    """Show a plan of the sensors, with the source positions that give the measured lag, if that is reliable."""
    prose.markdown(PLAN_INTRODUCTION)
    component("plan")(
        key="lag.plan",
        data={
            "difference": result.time_s * search.speed if result.verdict == "sure" and result.lag else None,
            "example": MIN_EXAMPLE_SPACING_M,
            "speed": search.speed,
            "colours": COLOURS,
        },
    )
