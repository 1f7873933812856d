"""Sentences of the lag page: its curve, own recordings, text alternatives of charts, and the panels."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any, Final, Literal

import numpy as np
import streamlit as st

from stereolag.core.arrays import Vector
from stereolag.core.jobs import limits
from stereolag.core.searches import LagSearch
from stereolag.core.typography import duration, enumeration, four_digits, typeset, typesets
from stereolag.figures.pictures import CORRELATION, PEAK, SENSOR_1, SENSOR_2
from stereolag.figures.recordings import band_of_chance
from stereolag.figures.verdicts import MAX_NAMED, verdict_in_words
from stereolag.io.clocks import Recording, start_difference_s
from stereolag.io.results import over_time_in_words
from stereolag.signals import SignalLag, phasors
from stereolag.signals.by_hand import ECHO_DELAY, LAG, MAX_LAG, Disturbances, Slide
from stereolag.signals.listening import Heard
from stereolag.signals.over_time import LagOverTime

ECHO_S = 0.03
"""Delay below which two sounds are heard as one, s (Haas, 1951)."""

_RIBBON = {
    "weighted": "Grey: chance level. The curve is Pearson’s correlation times √(overlap ÷ longest "
    "overlap): 0.5 over many samples counts more than 0.9 over ten. The score above is the plain one at the peak.",
    "plain": "Grey: chance level, wider toward the ends, where few samples overlap. The curve is "
    "plain Pearson even there: over two or three samples it swings to ±1, which means nothing.",
    "phat": "Grey: chance level. Every frequency counts the same, whatever its loudness: the peak is "
    "the share of them that agrees on the lag, so it is lower than the score.",
    "changing": "Red: every lag from the lowest to the highest. A lag that changes spreads the peak over them, so it "
    "can sink below chance level (grey). The ring marks the middle of the longest stretch.",
    "within": "Grey: chance level. The peak stays below it in this curve; the evidence comes from other weightings of "
    "the frequencies.",
    "many peaks": "The curve’s spread is that of its many peaks, not of chance, so no chance level is drawn.",
    "loud moments": "Loud moments or slow swings raise this curve far above its own spread without a common sound, so "
    "no chance level is drawn.",
}


def ribbon_in_words(result: SignalLag, curve: Literal["weighted", "plain", "phat"]) -> str:
    """Return what the grey ribbon behind a curve means, and why the peak is below it or the ribbon is missing."""
    if result.over_time is not None and result.over_time.changes:
        return _RIBBON["changing"]
    band = band_of_chance(result)
    if band is None:
        return _RIBBON["loud moments" if result.verdict == "nothing" else "many peaks"]
    return _RIBBON[curve if result.verdict != "sure" or _peak(result) > band[1] else "within"]


def _peak(result: SignalLag) -> float:
    assert result.lags is not None and result.correlation is not None
    return float(result.correlation[np.searchsorted(result.lags, result.lag)])


def heard_in_words(result: SignalLag) -> str:
    """Return a description of both recordings played together, before and after the lag is undone."""
    if result.verdict != "sure":
        return f"No lag is reliable here. The best-fitting lag, {result.lag:,} samples, is undone."
    if result.lag == 0:
        return "The lag is 0: there is nothing to undo."
    if abs(result.time_s) < ECHO_S:
        return f"Only a lag above about {ECHO_S:g} s is heard as an echo. A shorter one colours the sound."
    return "As recorded, each sound comes twice, like an echo. With the lag undone it comes once."


def own_facts(recordings: Sequence[Recording], channels: Sequence[int], counts: Sequence[int]) -> str:
    """Return one line of facts for each recording, as Markdown.

    Parameters
    ----------
    recordings
        One channel each, at a common rate if their files state any.
    channels, counts
        Number of each channel in its file, from 1, and the highest number in the file.
    """
    stated = next((one.sampling_rate for one in recordings if one.sampling_rate), None)
    lines = [
        f"Sensor {number}: " + ", ".join(_facts(one, channel, count, stated)) + "."
        for number, (one, channel, count) in enumerate(zip(recordings, channels, counts, strict=True), start=1)
    ]
    apart = start_difference_s(*recordings)
    if apart:
        lines.append(f"By their clocks, the recording of sensor 2 begins {duration(apart)} after that of sensor 1.")
    return "  \n".join(lines)


def _facts(recording: Recording, channel: int, count: int, stated: float | None) -> list[str]:
    samples, rate = recording.channels.shape[1], recording.sampling_rate
    assumed = f"{stated or LagSearch().sampling_rate:,.10g} Hz assumed"
    facts = (
        f"{four_digits(samples / rate)} s" if rate else "",
        f"{samples:,} samples",
        f"{rate:,.10g} Hz" if rate else "",
        f"resampled from {recording.resampled_from:,.10g} Hz" if recording.resampled_from else "",
        "" if rate else f"no rate in the file: {assumed}{', as in the other' if stated else ' unless set below'}",
        f"channel {channel} of {count}" if count > 1 else "",
    )
    return [*filter(None, facts), *recording.remarks]


def upload_limits() -> str:
    """Return a sentence about the size limits of a file."""
    samples, rate = limits().max_samples, LagSearch().sampling_rate
    return (
        f"At most {st.get_option('server.maxUploadSize')} MB and {samples / 1e6:,.0f} million samples per file, over "
        f"all channels: {samples / rate / 60:,.0f} minutes of one channel at {rate:,.10g} Hz."
    )


@typesets
def waveforms_in_words(signal_1: Vector, signal_2: Vector, sampling_rate: float) -> str:
    """Return a description of the two recordings before alignment."""
    lengths = [
        f"{duration(signal.size / sampling_rate)} of sensor {name}" for signal, name in ((signal_1, 1), (signal_2, 2))
    ]
    return f"Loudness over time: {lengths[0]} above {lengths[1]}."


@typesets
def aligned_in_words(result: SignalLag) -> str:
    """Return a description of both recordings on one plot, and how well they match with the lag undone."""
    if result.over_time is not None and result.over_time.changes:
        return "Both recordings on one plot, the second on the clock of the first."
    if (lag := result.judgement.opposite_lag) is not None:
        return f"Both recordings on one plot, the second moved back by {lag:,} samples: it mirrors the first."
    return (
        f"Both recordings on one plot, the second moved back by {result.lag:,} samples: where they overlap, "
        f"their correlation is {result.score:.3f}."
    )


@typesets
def close_up_in_words(lag: int, start: int) -> str:
    """Return a description of the close-up of samples from `start` on, `lag` samples apart."""
    return f"200 samples of both recordings from sample {start:,} on, the second moved back by {lag:,} samples."


@typesets
def blocks_in_words(over_time: LagOverTime, sampling_rate: float) -> str:
    """Return a description of the lag over time."""
    change = over_time_in_words(over_time, sampling_rate) if over_time.changes else "it does not change measurably"
    return f"Lag of {over_time.blocks} blocks over time: {change}."


@typesets
def run_times_in_words(seconds: Vector) -> str:
    """Return the range and the median of the run times."""
    shortest, median, longest = (duration(float(time)) for time in np.percentile(seconds, (0, 50, 100)))
    return f"Times of {seconds.size} runs: {shortest} to {longest}, median {median}."


def drift_in_words(over_time: LagOverTime) -> str:
    """Return the rate at which the lag grows, apart from steps."""
    where = "Between the steps the" if over_time.steps else "The"
    rate = f"{over_time.ppm:+,.1f} ± {max(over_time.error_ppm, 0.1):.1g} ppm"
    meaning = "the clocks run apart" if over_time.drifts else "no drift to speak of"
    return f"Each dot is one block of the recordings. {where} lag grows by {rate}: {meaning}."


# Panels

COLOURS: Final = f"--sensor-1: {SENSOR_1}; --sensor-2: {SENSOR_2}; --curve: {CORRELATION}; --peak: {PEAK}"
"""The colours of all panels of the page, as custom properties of their styles."""

IN_A_SENTENCE = """
Slide one recording along the other, multiply, add up: where the sum peaks, the two agree. That is their **lag**.

- **Why the peak stands where it does.** There, every sample meets itself and the products add up, while anywhere
  else ups meet downs and cancel.
- **Why a tone has many peaks.** It meets itself again after every period, so all those lags fit equally well.
- **Why noise has none.** Two unrelated recordings agree in sign half the time at every lag, so the products cancel,
  and the highest point is chance.
"""

PLAN_INTRODUCTION: Final = (
    "A lag measures how much longer one path is than the other. Every source on one **hyperbola** has the same "
    "path difference, so the sensors are that far apart only if the source is in line with them; otherwise they "
    "are farther apart. Dashed: every place where the source of your recordings can be."
)

SLIDING_WORDS: Final[dict[str, Any]] = {
    "choice": "Examples",
    "each": "place",
    "option": "Normalise",
    "meaning": "Divide by how loud both are: only the shape counts, and 1 is a perfect match",
    "recording": "Recording 2, with the snippet laid over it",
    "cut": "Snippet of recording 1: drag it",
    "axis": "lag, samples: where the snippet begins",
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
    "tone": {
        "title": "Pure tone",
        "try": "A tone that repeats every 20 samples. Drag the snippet along and count the places where it fits.",
        "said": {
            "plain": "Many equal peaks, 20 samples apart: a tone fits again after every period, so the lag stays "
            "ambiguous.",
            "normalised": "Still many peaks, all at 1: no method can tell one period from the next.",
        },
    },
    "noise": {
        "title": "Unrelated noise",
        "try": "The snippet comes from somewhere else: it is nowhere in recording 2. Does any place stand out?",
        "said": {
            "plain": "No peak comes near a perfect match: nothing is shared, so ups and downs cancel everywhere. The "
            "highest point is chance.",
            "normalised": "Nothing near 1. Among 201 places, one reaches 0.45 by chance.",
        },
    },
    "loud": {
        "title": "Loud stretch",
        "try": "The snippet fits at lag 90, but recording 2 gets loud later on. Play, then switch Normalise on.",
        "said": {
            "plain": "The loud stretch wins, though the snippet does not fit there: big samples make big sums. Now "
            "switch Normalise on.",
            "normalised": "Divided by loudness, only the shape counts: the true place, lag 90, reaches 1 and wins.",
        },
    },
}

# Sentences on the peak of an excerpt: whether it is at the lag of the whole recordings.
_EXCERPT_PEAKS = {
    "plain": {
        True: "The peak is at {lag:,} samples, as over the whole recordings: there ups meet ups, and every product "
        "counts.",
        False: "In this stretch the peak is at {lag:,} samples; over the whole recordings it is at {whole:,}.",
    },
    "normalised": {
        True: "Divided by loudness, the peak at {lag:,} samples reaches {score:.2f}; nothing else exceeds {rival:.2f}.",
        False: "Divided by loudness, the peak is at {lag:,} samples and reaches {score:.2f}; over the whole recordings "
        "it is at {whole:,}.",
    },
}


def excerpt_slid_in_words(slide: Slide, result: SignalLag) -> dict[str, Any]:
    """Return the texts for an excerpt of the recordings measured."""
    scores, sums = slide.scores, np.correlate(slide.recording, slide.cut, mode="valid")
    lessons = {}
    for name, heights in (("plain", sums), ("normalised", scores)):
        lag = slide.lag + slide.step * int(np.argmax(heights))
        lesson = _EXCERPT_PEAKS[name][abs(lag - result.lag) <= slide.step]
        lessons[name] = typeset(lesson.format(lag=lag, whole=result.lag, score=scores.max(), rival=slide.rival))
    means = "" if slide.step == 1 else f", each the mean of {slide.step} samples"
    return {
        "title": "These recordings",
        "try": f"{slide.cut.size} points of sensor 1{means}, over the recording of sensor 2. Drag them to where they "
        "fit, and watch the products.",
        "said": lessons,
    }


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
        "try": "Turn Noise up: the peak sinks into the grey band and the verdict changes. Then press Other noise a few "
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

DISTURBANCE_WORDS: Final[dict[str, str]] = {
    "choice": "Begin with",
    "recordings": "240 samples of both, shifted by the lag found",
    "curve": "Correlation, weighted by overlap, at every lag",
    "close": "The peak, up close",
    "agreement": "Evidence, in standard deviations of chance",
    "axis": "lag, samples (▲ the true one)",
    "chance": "chance",
    "convinces": "needed",
}

DISTURBED_VERDICTS: Final = {
    "clear": "Sure: recording 2 lags by {lag:,} samples.",
    "drift": "Sure, with drift: the lag goes from {start:,.1f} to {end:,.1f} samples.",
    "steps": "Sure, with steps: the lag jumps.",
    "wrong": "Fooled: sure of {lag:,} samples, but the true lag is {true:,}.",
    "repeats": "Cannot tell: it repeats every {spacing:,.0f} samples.",
    "rivals": "Cannot tell: {rivals}.",
    "chance": "Nothing in common found: the highest point is at chance level.",
    "too_little": "Not sure of anything in common: so few samples agree that chance could line them up.",
    "opposite_sign": "Nothing in common found, but the opposite sign fits.",
}

DISTURBED_LESSONS: Final = {
    "clear": "The peak is at {lag:,} because there the sound lines up with itself and the products add up. At "
    "any other lag positive and negative products cancel.",
    "drift": "Each part of the recording has its own lag, so one tall peak becomes a low, broad one. "
    "Measured block by block, the lags form a straight line; along it, the recordings agree.",
    "steps": "Part of a recording is missing, so the lag differs before and after it.",
    "wrong": "Another copy of the sound, an echo or a repetition, made the higher peak. A correlation finds the "
    "copy that fits best; it cannot know which one came directly.",
    "repeats": "Shifted by one period, the sound matches itself again, so every tooth fits as well as the next. A "
    "tone is nothing but repetition, so it has many peaks.",
    "rivals": "The sound is there more than once, as an echo or a repetition, and each copy makes an equally "
    "good peak.",
    "chance": "Noise never lines up: at every lag its products cancel, apart from chance. One of {searched:,} lags "
    "must be the highest; it means nothing, and with other noise it is elsewhere.",
    "too_little": "Products cancel at every lag, apart from chance; one of {searched:,} lags must be the highest.",
    "opposite_sign": "Where every product is negative, the polarity of one microphone is reversed.",
}


def disturbed_in_words(settings: Disturbances, result: SignalLag) -> dict[str, str]:
    """Return the verdict on disturbed recordings, its kind, its numbers, and its lesson."""
    judgement, lag, rivals = result.judgement, result.lag, result.rivals
    wrong = result.verdict == "sure" and abs(lag - LAG) > settings.drift / 2 + 2
    reason = "wrong" if wrong else judgement.reason
    over_time = judgement.over_time
    numbers = {
        "lag": lag,
        "true": LAG,
        "spacing": judgement.spacing,
        "rivals": (
            f"at least {len(rivals)} other lags fit as well"
            if len(rivals) >= MAX_NAMED
            else f"{enumeration([f'{one:,}' for one in sorted((lag, *rivals))])} samples fit equally well"
        ),
        "where": "In the middle" if reason in {"drift", "steps"} else "Highest at",
        "start": over_time and over_time.start,
        "end": over_time and over_time.end,
        "searched": 2 * MAX_LAG + 1,
        "evidence": judgement.evidence,
        "needed": judgement.needed,
    }
    texts = {
        "verdict": DISTURBED_VERDICTS[reason],
        "numbers": "{where} {lag:,}, true lag {true:,} · evidence {evidence:,.1f} ({needed:,.1f} needed)",
        "said": " ".join((DISTURBED_LESSONS[reason], *_disturbed_notes(settings, result))),
    }
    return {"kind": "fooled" if wrong else result.verdict} | {
        place: typeset(text.format(**numbers)) for place, text in texts.items()
    }


def _disturbed_notes(settings: Disturbances, result: SignalLag) -> Iterator[str]:
    """Yield notes on the curve: why it has no chance level, or the echo or teeth above it around a sure peak."""
    assert result.correlation is not None
    band = band_of_chance(result)
    if band is None:
        yield _RIBBON["loud moments" if result.verdict == "nothing" else "many peaks"]
    elif result.verdict == "sure" and result.lag == LAG:
        heights, chance = result.correlation[MAX_LAG:], band[1]
        if settings.echo and heights[LAG + ECHO_DELAY] > chance:
            yield f"The smaller peak {ECHO_DELAY:,} samples later is the echo."
        if settings.repetition and heights[[LAG - settings.period, LAG + settings.period]].min() > chance:
            yield f"The repeating part makes the teeth every {settings.period:,} samples; the rest settles the lag."


PHASOR_INTRODUCTION: Final = (
    "The cross-spectrum of two recordings has one arrow for each frequency. A shift in time turns each arrow in "
    "proportion to its frequency: twice the frequency, twice the angle. The slider turns all of them back by its lag. "
    "At the true lag they all point the same way, and nothing cancels."
)

PHASOR_WORDS: Final[dict[str, Any]] = {
    "choice": "Examples",
    "each": "lag",
    "option": "Whiten",
    "meaning": "Divide every arrow by its length: PHAT, the phase transform",
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
    "frequency": "frequency, turns per sample",
    "in_line": "all arrows in line",
    "lag": "Lag",
    "there": "in the recordings",
    "plain": "correlation",
    "whitened": "correlation, all frequencies equal",
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


def excerpt_in_words(found: phasors.Phasors) -> str:
    """Return where the two stretches begin in their recordings, and the lag that remains between them."""
    means = "" if found.step == 1 else f", each the mean of {found.step} samples of the recording"
    later = "later" if found.offset >= 0 else "earlier"
    return (
        f"{phasors.LENGTH} samples{means}. Those of recording 2 begin {abs(found.offset):,} samples {later}, so that a "
        f"lag of {phasors.LAG} remains."
    )


def own_in_words(found: phasors.Phasors) -> dict[str, Any]:
    """Return the texts for the visitor's own recordings."""
    return {
        "title": "Your recordings",
        "try": "The loudest stretch of your recordings, up close.",
        "said": {name: _peak_in_words(found, whiten=name == "whitened") for name in ("plain", "whitened")},
    }


def _peak_in_words(found: phasors.Phasors, *, whiten: bool) -> str:
    lags, heights = phasors.correlation(found, whiten=whiten)
    peak = lags[phasors.peaks(heights)[0]]
    at = typeset(f"{peak:g}")
    if abs(peak - phasors.LAG) <= 0.5:
        return f"The chain reaches furthest at lag {at}, as in the whole recordings."
    return f"In this short stretch the chain reaches furthest at lag {at}, not at 4 as in the whole recordings."


# Microphones heard live


LISTENING_WORDS: Final[dict[str, Any]] = {
    "start": "Listen",
    "off": "Two microphones, or one with two channels: nothing is recorded or sent before you start.",
    "freeze": "Freeze these 2 s",
    "frozen": "Frozen, see below: freeze again",
    "sensors": ["Sensor 1", "Sensor 2"],
    "same": "Channel 2 of the same device",
    "samples": "samples",
    "apart": "Sensor spacing",
}

_HEARD: Final = {
    "silent": "It is quiet: clap your hands.",
    "one silent": "Only sensor {other} hears something: sensor {silent} is silent.",
    "alike": "One channel only: both have the same samples, so they come from one microphone. Choose a second device "
    "for sensor 2.",
    "few": "Listening …",
    "moved": "The source is moving: the lag was {before:,.0f} samples and is {now:,.0f} now.",
}

# What two devices add, by whether the lag changes.
_TWO_CLOCKS = {
    False: "Two devices start at different moments, so the lag includes their delays and gives no distance.",
    True: "Two devices have two clocks, and these run apart.",
}


@typesets
def heard_now_in_words(heard: Heard, devices: int) -> str:
    """Return which sensor hears the sound later, or why that is unknown, for two channels of one or two devices."""
    result = heard.result
    if result is None:
        if len(heard.silent) == 1:
            (silent,) = heard.silent
            return _HEARD["one silent"].format(silent=silent, other=3 - silent)
        return _HEARD["alike" if heard.identical else "silent" if heard.silent else "few"]
    verdict = verdict_in_words(result).replace("**", "")
    if result.verdict != "sure":
        return verdict
    over_time = result.over_time if result.over_time is not None and result.over_time.changes else None
    if devices == 1:
        return verdict if over_time is None else _HEARD["moved"].format(before=over_time.start, now=heard.lag_now)
    if over_time is None:
        sensor = 2 if heard.lag_now >= 0 else 1
        verdict = f"Sensor {sensor} hears it {abs(heard.lag_now):,.1f} samples later."
    return f"{verdict} {_TWO_CLOCKS[over_time is not None]}"
