"""Result of the lag page: the verdict, its numbers, the curve, both recordings together, and the files to take away."""

from __future__ import annotations

import json
from functools import partial

import streamlit as st

from stereolag.core.searches import LagSearch
from stereolag.figures import recordings as figures
from stereolag.io.programs import lag_command, lag_script
from stereolag.io.recordings import aligned_wav, check_aligned_wav
from stereolag.io.results import curve_csv, lag_json
from stereolag.io.sources import npy
from stereolag.signals import SignalLag
from stereolag.signals.lag import aligned_length, mix
from stereolag.ui import prose
from stereolag.ui.downloads import File, take_away, too_large
from stereolag.ui.elements import Number, announce, show_numbers
from stereolag.ui.inputs import LONGEST_S, RecordingPair, player
from stereolag.ui.lag.sentences import (
    RIBBON_EXPLAINED,
    curve_in_words,
    drift_in_words,
    heard_in_words,
    verdict_explained,
    verdict_in_words,
)
from stereolag.ui.results import remembered
from stereolag.ui.sentences import CURVES, duration

FAIR, PLAIN = "Fair to short overlaps", "Plain Pearson"

KEY = "lag.take"
NAMES = ("recording_1.npy", "recording_2.npy")

CURVE_LAGS = 1_000_000
"""Most lags in a curve file: a spreadsheet has at most 1,048,576 rows."""

BYTES_OF_A_SAMPLE, BYTES_OF_A_LAG = 32, 256
"""Memory while the ZIP is made: the recordings, both aligned, and the curve as numbers and text."""

BYTES_OF_ALIGNED = 10
"""Memory per stereo sample while the WAV is written."""


def show_verdict(result: SignalLag, search: LagSearch) -> None:
    """Show the verdict and the lag in words and numbers; metres only if the lag is sure."""
    prose.header(verdict_in_words(result), anchor=False)
    announce(verdict_in_words(result))
    for sentence in verdict_explained(result, search.sampling_rate, search.speed):
        prose.markdown(sentence)
    numbers = [
        Number("Lag, samples", f"{result.lag:,}", f"With its fraction: {result.lag_subsample:,.2f}."),
        Number("Time", f"{result.time_s:.4g} s", "Lag ÷ sampling rate; positive where sensor 2 hears it later."),
        Number(
            "Path difference",
            f"{result.distance_m:,.2f} m",
            "Time × speed of the wave. The sensors are this far apart if the source is in line with them, otherwise "
            "farther.",
        ),
    ]
    if result.verdict != "sure":
        doubtful = "Where the curve is highest: not a lag to rely on."
        numbers = [Number("Highest point, samples", f"{result.lag:,}", doubtful)]
    agreement = "Pearson’s correlation where both overlap: 1 is perfect agreement."
    numbers.append(Number("Score", f"{result.score:.3f}", agreement))
    if result.judgement is not None:
        evidence = (
            "Agreement of the whitened recordings, in standard deviations of chance. For this many lags, "
            f"{result.judgement.needed:.1f} σ are needed."
        )
        numbers.append(Number("Above chance", f"{result.judgement.evidence:.1f} σ", evidence))
    took = Number("Took", duration(result.elapsed_s), "Time of the computation alone, when first run.")
    show_numbers((*numbers, took))


def show_curve(pair: RecordingPair, result: SignalLag, search: LagSearch) -> None:
    """Show the correlation curve with the range expected by chance."""
    prose.markdown("### Where the recordings agree")
    sizes, title = None, CURVES[search.method]
    if search.method in ("fft", "direct"):
        curve = st.segmented_control(
            "Curve", (FAIR, PLAIN), default=FAIR, required=True, key="lag.curve", label_visibility="collapsed"
        )
        if curve == PLAIN:
            sizes, title = (pair.signal_1.size, pair.signal_2.size), "Pearson’s correlation"
    curve_drawn = figures.correlation_curve(result, title, sizes=sizes)
    st.plotly_chart(curve_drawn, key="correlation", alt=curve_in_words(result))
    if result.lags is not None:
        prose.caption(RIBBON_EXPLAINED["phat" if search.method == "phat" else "plain" if sizes else "fair"])


def show_drift(result: SignalLag, search: LagSearch) -> None:
    """Show the lag of each block over time, if it could be measured."""
    drift = result.judgement.over_time if result.judgement else None
    if drift is None:
        return
    with st.expander("Lag over time", expanded=drift.shows):
        over_time = figures.lag_over_time(drift, search.sampling_rate)
        st.plotly_chart(over_time, key="lag_over_time", alt=drift_in_words(drift))
        prose.caption(
            f"Each dot is one block of the recordings. The line rises by {drift.ppm:+.1f} ± {drift.error_ppm:.1g} ppm: "
            + ("the clocks of the recorders differ." if drift.shows else "the clocks agree within the error.")
        )


def show_lag_files(pair: RecordingPair, result: SignalLag, search: LagSearch) -> None:
    """Play both recordings together, and offer the files of a lag."""
    both = st.expander("Hear both together", icon=":material/hearing:", key="lag.both", on_change="rerun")
    if both.open:
        with both:
            _hear_both(pair, result, search.sampling_rate)
    memory = BYTES_OF_A_SAMPLE * (pair.signal_1.size + pair.signal_2.size)
    memory += BYTES_OF_A_LAG * min(CURVE_LAGS, 0 if result.lags is None else len(result.lags))
    files, command = partial(lag_files, pair, result, search), lag_command(search, *NAMES)
    take_away(files, memory, command, "measure this lag again", own=not pair.shared, key=KEY)


def lag_files(pair: RecordingPair, result: SignalLag, search: LagSearch) -> list[File]:
    """Return the files of a lag, in the order they are offered."""
    rate, first, second = search.sampling_rate, pair.signal_1, pair.signal_2
    votes = result.lags is None
    many = result.lags is not None and len(result.lags) > CURVE_LAGS
    which = f"the {CURVE_LAGS:,} lags around the one found" if many else "every lag"
    if result.lags is not None and result.lags[-1] - result.lags[0] >= len(result.lags):
        which = "the highest lag of each stretch, as drawn"
    return [
        File(
            "Votes CSV" if votes else "Curve CSV",
            "votes.csv" if votes else "curve.csv",
            partial(curve_csv, result, rate, CURVE_LAGS),
            "Lags in samples and in seconds, and their votes."
            if votes
            else f"Lag in samples, time in seconds and correlation, of {which}.",
        ),
        File(
            "Result JSON",
            "lag.json",
            partial(lag_json, result, search),
            "The figures and settings, with the names of stereolag lag --json.",
        ),
        File(
            "Aligned WAV",
            "aligned.wav",
            partial(aligned_wav, first, second, result.lag, rate),
            "Both recordings in stereo, sensor 1 left, the lag undone. Nothing is cut off. 32-bit floats.",
            _wav_refusal(pair, result, rate),
        ),
        File("Python script", "reproduce.py", partial(lag_script, search, *NAMES), "Measures this lag again."),
        File("", NAMES[0], partial(npy, first), "The samples of sensor 1 as they were compared."),
        File("", NAMES[1], partial(npy, second), "The samples of sensor 2 as they were compared."),
    ]


def _wav_refusal(pair: RecordingPair, result: SignalLag, sampling_rate: float) -> str:
    try:
        check_aligned_wav(pair.signal_1.size, pair.signal_2.size, result.lag, sampling_rate)
    except ValueError as error:
        return str(error)
    return too_large(BYTES_OF_ALIGNED * aligned_length(pair.signal_1.size, pair.signal_2.size, result.lag))


def _hear_both(pair: RecordingPair, result: SignalLag, sampling_rate: float) -> None:
    most = round(LONGEST_S * sampling_rate)
    heard = (("as recorded", 0), ("the lag undone", result.lag))
    for column, (name, lag) in zip(st.columns(2, gap="medium"), heard, strict=True):
        with column:
            sound = remembered(
                "both together",
                partial(mix, pair.signal_1, pair.signal_2, lag, most),
                inputs=pair.digest,
                settings=json.dumps([lag, most]),
                shared=pair.shared,
            )
            player(sound, sampling_rate, f"both, {name}")
    said = heard_in_words(result)
    if aligned_length(pair.signal_1.size, pair.signal_2.size, result.lag) > most:
        said += f" Only {LONGEST_S} s are played, from where both recordings have begun."
    prose.caption(said)
