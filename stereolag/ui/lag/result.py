"""Result of the lag page: the verdict, its numbers, the curve, both recordings together, and the files to take away."""

from __future__ import annotations

from functools import partial

import numpy as np
import streamlit as st

from stereolag.core.arrays import Vector
from stereolag.core.searches import LagSearch
from stereolag.figures import recordings as figures
from stereolag.figures.verdicts import curve_in_words, verdict_explained, verdict_in_words
from stereolag.io.alignment import aligned_file, check_wav
from stereolag.io.programs import lag_command, lag_script
from stereolag.io.results import curve_csv, lag_json
from stereolag.io.sources import npy
from stereolag.signals import SignalLag
from stereolag.signals.alignment import align, mix
from stereolag.signals.correlation import HeldRecording, overlap_pearson
from stereolag.signals.lag import normalised
from stereolag.signals.over_time import LagOverTime
from stereolag.ui import prose
from stereolag.ui.downloads import File, take_away, too_large
from stereolag.ui.elements import Number, announce, show_numbers
from stereolag.ui.inputs import LONGEST_S, RecordingPair, player
from stereolag.ui.lag.sentences import (
    blocks_in_words,
    drift_in_words,
    heard_in_words,
    ribbon_in_words,
)
from stereolag.ui.results import remembered
from stereolag.ui.sentences import CURVES, duration

FAIR, PLAIN = "Fair to short overlaps", "Plain Pearson"

KEY = "lag.take"
NAMES = ("recording_1.npy", "recording_2.npy")

CURVE_LAGS = 1_000_000
"""Most lags in a curve file: a spreadsheet has at most 1,048,576 rows."""

BYTES_OF_A_SAMPLE, BYTES_OF_A_LAG = 80, 256
"""Memory while the ZIP is made: recordings and curve, as numbers and as text."""

BYTES_OF_ALIGNED, BYTES_OF_A_LINE = 10, 60
"""Memory per sample while the aligned WAV, and the CSV, are written."""

ALIGNED = "Recording 2 on the clock of recording 1, lag, drift and steps undone, as long as recording 1."


def assumed(pair: RecordingPair, search: LagSearch) -> set[str]:
    """Return the settings that neither the recordings nor the visitor gave."""
    first = LagSearch()
    return {
        name
        for name in ("speed", "sampling_rate")
        if getattr(pair, name) is None and getattr(search, name) == getattr(first, name)
    }


def show_verdict(pair: RecordingPair, result: SignalLag, search: LagSearch) -> None:
    """Show the verdict and the lag in words and numbers; metres only if the lag is sure."""
    headline = verdict_in_words(result, assumed(pair, search))
    prose.header(headline, anchor=False)
    announce(headline)
    for sentence in verdict_explained(result):
        prose.markdown(sentence)
    changes = result.over_time is not None and result.over_time.shows
    when = " In the middle of the longest stretch." if changes else ""
    numbers = [
        Number("Lag, samples", f"{result.lag:,}", f"With its fraction: {result.lag_subsample:,.2f}.{when}"),
        Number("Time", f"{result.time_s:.4g} s", "Lag ÷ sampling rate; positive where sensor 2 hears it later."),
    ]
    if not changes:
        meaning = (
            "Time × speed of the wave. The sensors are this far apart if the source is in line with them, otherwise "
            "farther."
        )
        numbers.append(Number("Path difference", f"{result.distance_m:,.2f} m", meaning))
    if result.verdict != "sure":
        doubtful = "Where the curve is highest: not a lag to rely on."
        numbers = [Number("Highest point, samples", f"{result.lag:,}", doubtful)]
    score, undone = result.score, ""
    if changes and result.over_time is not None:
        score, undone = _aligned_score(pair, result, result.over_time), ", with drift and steps undone"
    agreement = f"Pearson’s correlation where both overlap{undone}: 1 is perfect agreement."
    numbers.append(Number("Score", f"{score:.3f}", agreement))
    judgement = result.judgement
    short = f" of {judgement.needed:.1f}" if judgement.evidence < judgement.needed else ""
    meaning = f"In standard deviations of chance. For this many lags, {judgement.needed:.1f} σ are needed."
    numbers.append(Number("Evidence", f"{judgement.evidence:.1f}{short} σ", meaning))
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
        prose.caption(ribbon_in_words(result, "phat" if search.method == "phat" else "plain" if sizes else "fair"))


def show_over_time(over_time: LagOverTime, search: LagSearch) -> None:
    """Show the lag of each block over time."""
    prose.markdown("### Lag over time")
    figure = figures.lag_over_time(over_time, search.sampling_rate)
    st.plotly_chart(figure, key="lag_over_time", alt=blocks_in_words(over_time, search.sampling_rate))
    prose.caption(drift_in_words(over_time))


def lined_up(pair: RecordingPair, result: SignalLag) -> tuple[Vector, int]:
    """Return recording 2 to be drawn beside recording 1, and the whole lag still to be undone, samples."""
    if result.over_time is not None and result.over_time.shows:
        return _aligned(pair, result), 0
    opposite = result.judgement.opposite_lag
    return pair.signal_2, result.lag if opposite is None else opposite


def _aligned_score(pair: RecordingPair, result: SignalLag, over_time: LagOverTime) -> float:
    """Return Pearson's correlation of recording 1 and of recording 2 on its clock, where both have samples."""
    shared = slice(over_time.stretches[0].begin, over_time.stretches[-1].end)
    first, second = (HeldRecording(normalised(one[shared])) for one in (pair.signal_1, _aligned(pair, result)))
    return overlap_pearson(first, second, 0)


def _aligned(pair: RecordingPair, result: SignalLag) -> Vector:
    """Return recording 2 on the clock of recording 1; at its best-fitting lag if that is not sure."""
    lag = result if result.verdict == "sure" else result.lag_subsample
    return remembered(
        "aligned recording",
        lambda: np.asarray(align(pair.signal_1, pair.signal_2, lag), dtype=np.float64),
        inputs=pair.digest,
        settings=f"{result.lag_subsample} {result.over_time}",
        shared=pair.shared,
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
    refusal = "" if result.verdict == "sure" else "Only a lag that is sure can be undone."
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
            partial(lag_json, result, search, assumed(pair, search)),
            "The figures and settings, with the names of stereolag lag --json.",
        ),
        File(
            "Aligned WAV",
            "aligned.wav",
            partial(aligned_file, ".wav", first, second, result, rate),
            f"{ALIGNED} 32-bit floats.",
            refusal or _wav_refusal(pair, rate),
        ),
        File(
            "Aligned CSV",
            "aligned.csv",
            partial(aligned_file, ".csv", first, second, result, rate),
            f"{ALIGNED} Time in seconds, and the samples.",
            refusal or too_large(BYTES_OF_A_LINE * first.size),
        ),
        File("Python script", "reproduce.py", partial(lag_script, search, *NAMES), "Measures this lag again."),
        File("", NAMES[0], partial(npy, first), "The samples of sensor 1 as they were compared."),
        File("", NAMES[1], partial(npy, second), "The samples of sensor 2 as they were compared."),
    ]


def _wav_refusal(pair: RecordingPair, sampling_rate: float) -> str:
    try:
        check_wav(pair.signal_1.size, sampling_rate)
    except ValueError as error:
        return str(error)
    return too_large(BYTES_OF_ALIGNED * pair.signal_1.size)


def _hear_both(pair: RecordingPair, result: SignalLag, sampling_rate: float) -> None:
    most = round(LONGEST_S * sampling_rate)
    aligned = _aligned(pair, result)
    # Long ones are heard from where both have begun.
    begun = max(0, -result.lag) if aligned.size > most else 0
    heard = {
        "as recorded": (pair.signal_1[:most], pair.signal_2[:most]),
        "the lag undone": (pair.signal_1[begun:][:most], aligned[begun:][:most]),
    }
    for column, (name, both) in zip(st.columns(2, gap="medium"), heard.items(), strict=True):
        with column:
            player(mix(*both), sampling_rate, f"both, {name}")
    said = heard_in_words(result)
    if max(pair.signal_1.size, pair.signal_2.size) > most:
        said += f" Only {LONGEST_S} s are played."
    prose.caption(said)
