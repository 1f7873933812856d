"""Sentences of the lag page: verdicts, with metres only if a lag is sure, own recordings, alternatives of charts."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt
import streamlit as st

from stereolag.core.arrays import Vector
from stereolag.core.jobs import limits
from stereolag.core.searches import LagSearch
from stereolag.core.typography import typesets
from stereolag.io.recordings import Recording
from stereolag.signals import SignalLag
from stereolag.signals.drift import Drift
from stereolag.ui.sentences import duration, length

ECHO_S = 0.03
"""Seconds; sounds closer together are heard as one (Haas, 1951)."""

LEAST_SPREAD = 0.01
"""Samples; a smaller spread is reported as less than this."""


def lag_in_words(result: SignalLag) -> str:
    """Return which sensor hears the sound later, by how much, and the path difference."""
    if result.lag == 0:
        return "Both sensors hear it **at the same time**: neither is nearer to it."
    later, earlier = (2, 1) if result.lag > 0 else (1, 2)
    time, distance = f"{abs(result.time_s):.4g} s", f"{result.distance_m:,.2f} m"
    return f"Sensor {later} hears it **{time}** after sensor {earlier}: its path is **{distance}** longer."


def verdict_in_words(result: SignalLag) -> str:
    """Return the lag if it is sure, otherwise why none can be given."""
    judgement = result.judgement
    if judgement is None or judgement.verdict == "sure":
        return lag_in_words(result)
    if judgement.reason == "repeats" and judgement.spacing is not None:
        return f"Cannot tell: it repeats every **{_samples(judgement.spacing)} samples**."
    if judgement.verdict == "ambiguous":
        others = len(judgement.rivals)
        return f"Cannot tell: **{others} other {'lag fits' if others == 1 else 'lags fit'}** as well."
    return _NOTHING_WORDS[judgement.reason]


_NOTHING_WORDS = {
    "chance": "Nothing in common found: the highest point is at chance level.",
    "too_little": "Nothing in common found: so few samples stand out that chance could line them up.",
    "few_votes": "Nothing in common found: hardly two samples vote for the same lag.",
    "opposite_sign": "Nothing in common found, but **the opposite sign fits**: one microphone is reversed.",
}


def verdict_explained(result: SignalLag, sampling_rate: float, speed: float) -> list[str]:
    """Return the details of a verdict: rivals, drift, uncertainty, a reversed microphone, advice."""
    judgement = result.judgement
    if judgement is None:
        return []
    said = []
    drift = judgement.drift
    if drift is not None and judgement.reason == "drift":
        said.append(
            f"The clocks differ by **{drift.ppm:+.1f} ppm** (± {drift.error_ppm:.1g}): the lag goes from "
            f"{drift.start:,.1f} to {drift.start + drift.span:,.1f} samples, which smears the peak."
        )
    if drift is not None:
        samples = max(drift.spread, LEAST_SPREAD)
        said.append(
            f"Over {drift.blocks} blocks the lag varies by {'±' if samples == drift.spread else 'less than ±'} "
            f"{samples:.2g} samples, ± {length(samples / sampling_rate * speed)} of path."
        )
    if judgement.opposite_lag is not None:
        said.append(
            f"With its sign reversed, recording 2 fits at {judgement.opposite_lag:,} samples: swap the wires of one "
            "microphone, or negate one file."
        )
    elif judgement.verdict == "ambiguous":
        said.append(
            f"The lags {_listed(sorted((result.lag, *judgement.rivals)))} fit about equally well. A stretch that does "
            "not repeat, or a smaller largest lag, can decide."
        )
    elif judgement.verdict == "nothing":
        said.append(
            "Use a longer stretch with a distinct sound that both sensors hear, and check that both files cover it."
        )
    return said


_MOST_LISTED = 5


def _listed(lags: list[int]) -> str:
    shown = [f"{lag:,}" for lag in lags[:_MOST_LISTED]]
    more = len(lags) - len(shown)
    return "; ".join(shown) + (f" and {more} more" if more else "")


def _samples(spacing: float) -> str:
    whole = round(spacing)
    return f"{whole:,}" if abs(spacing - whole) < 0.05 or spacing >= 100 else f"{spacing:.1f}"


RIBBON_EXPLAINED = {
    "fair": "Grey: chance level. The curve is Pearson’s correlation times √(overlap ÷ longest "
    "overlap): 0.5 over many samples counts more than 0.9 over ten. The score above is the plain one at the peak.",
    "plain": "Grey: chance level, wider toward the ends, where few samples overlap. The curve is "
    "plain Pearson even there: over two or three samples it swings to ±1, which means nothing.",
    "phat": "Grey: chance level. Every frequency counts the same, whatever its loudness: the peak is "
    "the share of them that agrees on the lag, so it is lower than the score.",
}
"""Caption of the curve for each way to draw it."""


def heard_in_words(result: SignalLag) -> str:
    """Return how both recordings sound together, before and after the lag is undone."""
    if result.verdict != "sure":
        return f"No lag is sure here. The best-fitting lag, {result.lag:,} samples, is undone."
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
        Number of each channel in its file, from 1, and how many channels the file has.
    """
    stated = next((one.sampling_rate for one in recordings if one.sampling_rate), None)
    lines = [
        f"Sensor {number}: " + ", ".join(_facts(one, channel, count, stated)) + "."
        for number, (one, channel, count) in enumerate(zip(recordings, channels, counts, strict=True), start=1)
    ]
    return "  \n".join(lines)


def _facts(recording: Recording, channel: int, count: int, stated: float | None) -> list[str]:
    samples, rate = recording.channels.shape[1], recording.sampling_rate
    facts = [f"{samples:,} samples"]
    if rate:
        facts = [f"{samples / rate:,.4g} s", *facts, f"{rate:,.10g} Hz"]
    if recording.resampled_from:
        facts.append(f"resampled from {recording.resampled_from:,.10g} Hz")
    if not rate and stated:
        facts.append(f"no rate in the file: {stated:,.10g} Hz assumed, as in the other")
    elif not rate:
        default = LagSearch().sampling_rate
        facts.append(f"no rate in the file: {default:,.10g} Hz assumed unless set below")
    if count > 1:
        facts.append(f"channel {channel} of {count}")
    if recording.mended_lines:
        facts.append(f"{recording.mended_lines} damaged line{'s' * (recording.mended_lines > 1)} mended")
    return facts


def upload_limits() -> str:
    """Return how large a file may be."""
    samples, rate = limits().max_samples, LagSearch().sampling_rate
    return (
        f"At most {st.get_option('server.maxUploadSize')} MB and {samples / 1e6:,.0f} million samples per file, over "
        f"all channels: {samples / rate / 60:,.0f} minutes of one channel at {rate:,.10g} Hz."
    )


@typesets
def curve_in_words(result: SignalLag) -> str:
    """Return a description of the lag curve: where it is highest, and whether that peak stands alone."""
    if result.lags is None:
        votes = (result.votes or {}).get(result.lag, 0)
        return f"Votes for each lag: most of them, {votes:,}, are for lag {result.lag:,} samples."
    searched = f"Correlation at the lags {result.lags[0]:,} to {result.lags[-1]:,} samples"
    if result.judgement is None or result.verdict == "sure":
        return f"{searched}: one clear peak at {result.lag:,}, score {result.score:.3f}."
    if result.verdict == "ambiguous":
        return f"{searched}: highest at {result.lag:,}, and {len(result.rivals)} other peaks are about as high."
    return f"{searched}: nothing rises above chance level; the highest point is at {result.lag:,}."


@typesets
def waveforms_in_words(signal_1: Vector, signal_2: Vector, sampling_rate: float) -> str:
    """Return a description of the two recordings before alignment."""
    lengths = [
        f"{duration(signal.size / sampling_rate)} of sensor {name}" for signal, name in ((signal_1, 1), (signal_2, 2))
    ]
    return f"Loudness over time: {lengths[0]} above {lengths[1]}."


@typesets
def aligned_in_words(result: SignalLag) -> str:
    """Return how well the recordings match once the lag is undone."""
    return (
        f"Both recordings on one plot, the second moved back by {result.lag:,} samples: where they overlap, "
        f"their correlation is {result.score:.3f}."
    )


@typesets
def close_up_in_words(result: SignalLag, start: int) -> str:
    """Return a description of the close-up of the aligned samples."""
    return f"200 samples of both recordings from sample {start:,} on, the second moved back by {result.lag:,} samples."


@typesets
def drift_in_words(drift: Drift) -> str:
    """Return how the lag changes over time."""
    trend = f"rises by {drift.ppm:+.1f} ppm" if drift.shows else "does not change measurably"
    return f"Lag of {drift.blocks} blocks over time: it {trend}, {drift.start:,.1f} samples at first."


@typesets
def run_times_in_words(seconds: npt.NDArray[np.float64]) -> str:
    """Return how long the runs took."""
    shortest, median, longest = (duration(float(one)) for one in np.percentile(seconds, (0, 50, 100)))
    return f"Times of {seconds.size} runs: {shortest} to {longest}, median {median}."
