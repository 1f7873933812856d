"""Texts of the disturbance panel: sliders, examples and verdicts."""

from __future__ import annotations

from typing import Any, Final

from stereolag.signals.by_hand import LONGEST_PERIOD, MOST_DRIFT

SLIDERS: Final[tuple[dict[str, Any], ...]] = (
    {"name": "noise", "title": "Noise", "low": -30, "high": 30, "step": 1, "unit": "dB", "signed": True},
    {"name": "repetition", "title": "Repetition", "low": 0, "high": 100, "step": 10, "unit": "%"},
    {"name": "period", "title": "Period", "low": 20, "high": LONGEST_PERIOD, "step": 20, "unit": "samples"},
    {"name": "echo", "title": "Echo", "low": 0, "high": 150, "step": 5, "unit": "%"},
    {"name": "drift", "title": "Drift", "low": 0, "high": MOST_DRIFT, "step": 1, "unit": "samples"},
)

START: Final[dict[str, float]] = {"noise": -10, "repetition": 0, "period": 400, "echo": 0, "drift": 0}

EXAMPLES: Final[tuple[dict[str, Any], ...]] = (
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

WORDS: Final[dict[str, Any]] = {
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
