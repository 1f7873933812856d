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

from stereolag import samples
from stereolag.core.arrays import Vector
from stereolag.core.typography import typeset
from stereolag.figures.pictures import CORRELATION, PEAK, SENSOR_1, SENSOR_2
from stereolag.signals import SignalLag, by_hand, phasors
from stereolag.ui import prose
from stereolag.ui.components import component
from stereolag.ui.recordings import RecordingPair, example_recordings

COLOURS: Final = {"sensor-1": SENSOR_1, "sensor-2": SENSOR_2, "curve": CORRELATION, "peak": PEAK}

_sliding, _disturbances, _phasors, _plan = map(component, ("sliding", "disturbances", "phasors", "plan"))

# Slide it yourself

COAST_START, COAST_STEP = 5191, 6
"""A place with one clear peak; six samples are averaged into one to show waves rather than slopes."""

SLIDING_WORDS: Final[dict[str, Any]] = {
    "recording": "Recording 2, with the cut laid over it",
    "cut": "Cut from recording 1: drag it",
    "axis": "lag, samples: where the cut begins",
    "perfect": "perfect match",
    "lag": "Lag",
    "plain": {
        "products": "Products: up where the signs agree",
        "curve": "Sum of the products, at the places tried",
        "sum": "sum",
    },
    "normalised": {
        "products": "Products, normalised: up where the signs agree",
        "curve": "Correlation, at the places tried",
        "sum": "correlation",
    },
}

SLIDING_EXAMPLES: Final[dict[str, dict[str, Any]]] = {
    "seven": {
        "title": "Seven numbers",
        "try": "These seven numbers are hidden in recording 2. Drag them until they line up, and watch the products.",
        "said": {
            "plain": "The peak is at lag 8: there every number meets itself, every product is a square, and "
            "nothing cancels.",
            "normalised": "Same peak, at lag 8. Only a perfect match reaches 1.",
        },
    },
    "coast": {
        "title": "Coast",
        "try": "Forty points of sensor 1, each the mean of six samples, and sensor 2’s recording about a second later. "
        "Where does the cut belong?",
        "said": {
            "plain": "The peak is at 50,082 samples: there the waves line up and every product points up. "
            "Elsewhere ups and downs cancel.",
            "normalised": "The peak at 50,082 samples reaches 1: it is the same sound. Elsewhere nothing exceeds 0.3.",
        },
    },
    "tone": {
        "title": "Pure tone",
        "try": "A tone that repeats every 20 samples. Drag the cut along and count the places where it fits.",
        "said": {
            "plain": "Many equal peaks, 20 samples apart: a tone fits again after every period, so the lag stays "
            "ambiguous.",
            "normalised": "Still many peaks, all at 1: no method can tell one period from the next.",
        },
    },
    "noise": {
        "title": "Unrelated noise",
        "try": "The cut comes from somewhere else: it is nowhere in recording 2. Does any place stand out?",
        "said": {
            "plain": "No peak comes near a perfect match: nothing is shared, so ups and downs cancel everywhere. The "
            "highest point is chance.",
            "normalised": "Nothing near 1. Among 201 places, one reaches 0.45 by chance.",
        },
    },
    "loud": {
        "title": "Loud stretch",
        "try": "The cut fits at lag 90, but recording 2 gets loud later on. Play, then switch Normalise on.",
        "said": {
            "plain": "The loud stretch wins, though the cut does not fit there: big samples make big sums. Now switch "
            "Normalise on.",
            "normalised": "Divided by loudness, only the shape counts: the true place, lag 90, reaches 1 and wins.",
        },
    },
}


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

DISTURBANCE_EXAMPLES: Final[tuple[dict[str, Any], ...]] = (
    {
        "name": "clean",
        "title": "Clean",
        "try": "Sensor 2 hears the sound 640 samples after sensor 1. Move a slider and watch the peak, the grey band "
        "(chance level) and the verdict.",
        "settings": {},
    },
    {
        "name": "noise",
        "title": "Noise",
        "try": "Turn Noise up: the peak sinks into the grey band and the verdict turns. Then press Other noise a few "
        "times: where does the highest point go?",
        "settings": {"noise": 6},
    },
    {
        "name": "repetition",
        "title": "Repetition",
        "try": "Turn Repetition down, then up: teeth rise beside the peak until they cannot be told apart.",
        "settings": {"repetition": 90},
    },
    {
        "name": "tone",
        "title": "Tone",
        "try": "A tone is a sound that repeats after every period. Make the period longer: the teeth move apart.",
        "settings": {"repetition": 100, "period": 20},
    },
    {
        "name": "echo",
        "title": "Echo",
        "try": "The echo reaches sensor 2 as a second copy, 300 samples late. Make it as loud as the sound (100 %), "
        "then louder.",
        "settings": {"echo": 60},
    },
    {
        "name": "drift",
        "title": "Drift",
        "try": "Two recorders’ clocks run apart, so the lag grows during the recording. Turn Drift up and watch the "
        "peak up close.",
        "settings": {"drift": 12},
    },
)

DISTURBANCE_WORDS: Final[dict[str, Any]] = {
    "recordings": "240 samples of both, shifted by the lag found",
    "curve": "Correlation × √overlap, at every lag",
    "close": "The highest point, up close",
    "agreement": "Agreement of the whitened recordings, standard deviations",
    "axis": "lag, samples (▲ the true one)",
    "chance": "chance",
    "convinces": "needed",
    "numbers": "Highest at {lag}, true lag {true} · agreement {evidence} ({needed} needed)",
    "another": "{lag} samples fits",
    "others": "{count} other lags fit",
    "sliders": {
        "noise": "At each sensor: 0 dB is as loud as the sound",
        "repetition": "The share of the sound’s energy that repeats",
        "period": "Samples until it repeats",
        "echo": "Loudness of the late copy at sensor 2, relative to the direct sound",
        "drift": "Growth of the lag from the first sample to the last",
    },
    "verdicts": {
        "clear": "Sure: recording 2 lags by {lag} samples.",
        "drift": "Sure, with drift: the lag goes from {from} to {to} samples.",
        "wrong": "Fooled: sure of {lag} samples, but the true lag is {true}.",
        "repeats": "Cannot tell: it repeats every {spacing} samples.",
        "rivals": "Cannot tell: {rivals} as well.",
        "chance": "Nothing in common found: the highest point is at chance level.",
        "too_little": "Nothing in common found: so few samples stand out that chance could line them up.",
        "opposite_sign": "Nothing in common found, but the opposite sign fits.",
    },
    "lessons": {
        "clear": "The peak is at {lag} because there the sound lines up with itself and the products add up. At "
        "any other lag positive and negative products cancel.",
        "drift": "Each part of the recording has its own lag, so one tall peak becomes a low, broad one. "
        "Measured block by block, the lags form a straight line, which is convincing.",
        "wrong": "Another copy of the sound, an echo or a repetition, made the higher peak. A correlation finds the "
        "copy that fits best; it cannot know which one came directly.",
        "repeats": "Shifted by one period, the sound matches itself again, so every tooth fits as well as the next. A "
        "tone is nothing but repetition, so it has many peaks.",
        "rivals": "The sound is there more than once, as an echo or a repetition, and each copy makes an equally "
        "good peak.",
        "chance": "Noise never lines up: at every lag its products cancel, but for chance. One of {searched} lags "
        "must be the highest; it means nothing, and with other noise it is elsewhere.",
        "too_little": "Products cancel at every lag but for chance; one of {searched} lags must be the highest.",
        "opposite_sign": "Where every product is negative, one microphone is reversed.",
    },
    "notes": {
        "wide": "The grey band follows the curve’s own spread, which such dense teeth widen.",
        "echo": "The smaller peak {delay} samples later is the echo.",
        "teeth": "The repeating part makes the teeth every {period} samples; the rest settles the lag.",
    },
}


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

PHASOR_INTRODUCTION: Final = (
    "Two recordings have one arrow for each frequency: their cross-spectrum. A shift in time turns each arrow in "
    "proportion to its frequency: twice the frequency, twice the angle. The slider turns all of them back by its lag. "
    "At the true lag they all point the same way, and nothing cancels."
)

PHASOR_WORDS: Final[dict[str, Any]] = {
    "captions": {
        "magnitudes": ["Magnitudes", "how much of each frequency the recordings contain"],
        "phases": [
            "Phase difference",
            "by how many turns recording 2 is behind; its slope is the lag. Whole turns look alike, so each dot is "
            "drawn again above and below. The ruler’s slope is the slider’s lag.",
        ],
        "chain": [
            "Arrows, head to tail",
            "as long as the product of its two magnitudes, and turned as far as its dot is from the ruler. How far "
            "right the chain ends is the correlation.",
        ],
        "lags": ["Correlation over lag, in samples", "at the lags tried"],
    },
    "recordings": ["recording 1", "recording 2"],
    "frequency": "frequency, turns a sample",
    "in_line": "all arrows in line",
    "lag": "Lag",
    "there": "in the recordings",
    "plain": "correlation",
    "whitened": "whitened correlation",
}

PHASOR_EXAMPLES: Final[dict[str, dict[str, Any]]] = {
    "knock": {
        "title": "Knock",
        "try": "One short sound, 4 samples later in recording 2. Move the lag until the ruler runs through the dots.",
        "said": {
            "plain": "At lag 4 the ruler runs through the dots, every arrow points right, and the chain is straight. "
            "That is the peak.",
            "whitened": "The same peak at lag 4. All arrows are equal now: every frequency counts alike.",
        },
    },
    "coast": {
        "title": "Coast, up close",
        "try": "Move the lag: the peak is broad. Then whiten.",
        "said": {
            "plain": "The chain is straight at lag 4: 50,082 samples in the recordings. The peak is broad because the "
            "few long arrows are low frequencies, which turn slowly. Now whiten.",
            "whitened": "The hill became a needle at the same lag: high frequencies count as much now, and they turn "
            "fast.",
        },
    },
    "harbour": {
        "title": "Harbour, up close",
        "try": "Each sensor hears its own wind. Do the dots still lie on a line?",
        "said": {
            "plain": "Wind scatters the arrows, so the chain never gets quite straight. It still reaches furthest at "
            "lag 4: −31,234 samples in the recordings.",
            "whitened": "Still lag 4, but a shorter reach: frequencies with only wind count as much as the horns.",
        },
    },
    "tone": {
        "title": "One tone",
        "try": "A tone has one frequency, and so one arrow. How many lags turn it back?",
        "said": {
            "plain": "The arrow points right again after every full turn: a peak every 5 samples, all equal. One arrow "
            "cannot tell them apart.",
            "whitened": "Nothing changes: one arrow stays one arrow. A single peak needs many frequencies.",
        },
    },
    "noise": {
        "title": "Two noises",
        "try": "Two noises that share nothing. Does any lag line the arrows up?",
        "said": {
            "plain": "No lag lines the arrows up: the dots are not on a line, so the arrows always cancel. The "
            "highest point, 0.18, is chance.",
            "whitened": "Equal arrows do not line up either: 0.17 at most.",
        },
    },
}

_EQUAL = 1e-6

OWN_TITLE: Final = "Your recordings"
_FOUND = "The chain reaches furthest at lag {}, as in the whole recordings."
_MISSED = "In this short stretch the chain reaches furthest at lag {}, not at 4 as in the whole recordings."


def excerpt_in_words(found: phasors.Phasors) -> str:
    """Return where the stretches were cut from the two recordings, and the lag left between them."""
    means = "" if found.step == 1 else f", each the mean of {found.step} samples of the recording"
    later = "later" if found.offset >= 0 else "earlier"
    return (
        f"{phasors.LENGTH} samples{means}. Those of recording 2 begin {abs(found.offset):,} samples {later}, so that a "
        f"lag of {phasors.LAG} is left."
    )


def own_in_words(found: phasors.Phasors) -> dict[str, Any]:
    """Return the texts for the visitor's own recordings."""
    return {
        "title": OWN_TITLE,
        "try": "The loudest stretch of your recordings, up close.",
        "said": {name: _peak_in_words(found, whiten=name == "whitened") for name in ("plain", "whitened")},
    }


def _peak_in_words(found: phasors.Phasors, *, whiten: bool) -> str:
    lags, heights = phasors.correlation(found, whiten=whiten)
    peak = min(lags[heights > heights.max() - _EQUAL], key=abs)
    said = _FOUND if abs(peak - phasors.LAG) <= 0.5 else _MISSED
    return said.format(typeset(f"{peak:g}"))


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
    prose.markdown(
        "A lag measures how much longer one path is than the other. Every source on one **hyperbola** has the same "
        "path difference, so the sensors are that far apart only if the source is in line with them; otherwise they "
        "are farther apart. Dashed: every place where the source of your recordings can be."
    )
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
