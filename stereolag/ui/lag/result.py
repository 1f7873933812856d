"""Result of the lag page: the verdict, its numbers, the curve, both recordings together, and the files to take away."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial

import numpy as np
import streamlit as st

from stereolag.core.arrays import Vector
from stereolag.core.searches import LagSearch
from stereolag.core.typography import typeset
from stereolag.figures import recordings as figures
from stereolag.figures.verdicts import curve_in_words, verdict_explained, verdict_in_words
from stereolag.io.alignment import aligned_file, check_wav
from stereolag.io.programs import lag_command, lag_script
from stereolag.io.results import curve_csv, lag_json
from stereolag.io.sources import npy
from stereolag.signals import SignalLag
from stereolag.signals.alignment import align, mix
from stereolag.signals.correlation import HeldRecording, overlap_pearson, overlap_slices
from stereolag.signals.lag import normalised
from stereolag.signals.over_time import LagOverTime
from stereolag.ui import prose
from stereolag.ui.downloads import File, refusal_of, take_away, too_large
from stereolag.ui.elements import Number, announce, show_line
from stereolag.ui.inputs import LONGEST_S, RecordingPair, player
from stereolag.ui.lag.sentences import (
    aligned_in_words,
    blocks_in_words,
    close_up_in_words,
    drift_in_words,
    heard_in_words,
    ribbon_in_words,
    waveforms_in_words,
)
from stereolag.ui.results import remembered
from stereolag.ui.sentences import CURVES, duration
from stereolag.ui.streamlit_inside import Container

WEIGHTED, PLAIN = "Weighted by overlap", "Not weighted"
PLAIN_CURVE = "correlation (Pearson)"

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
    numbers = []
    if result.verdict != "sure":
        doubtful = "In samples, where the curve is highest: not a lag to rely on."
        numbers.append(Number("Highest at", f"{result.lag:,}", doubtful))
    score, undone = result.score, ""
    if changes and result.over_time is not None:
        score, undone = _aligned_score(pair, result, result.over_time), ", with drift and steps undone"
    agreement = f"Pearson’s correlation where both overlap{undone}: 1 is perfect agreement."
    numbers.append(Number("Agreement", f"{score:.3f}", agreement))
    judgement = result.judgement
    evidence = f"{judgement.evidence:.1f} of {judgement.needed:.1f} needed"
    meaning = "How far the peak stands above chance, in standard deviations, and how far it must for this many lags."
    numbers.append(Number("Evidence", evidence, meaning))
    took = Number("Computed in", duration(result.elapsed_s), "Time of the computation alone, when first run.")
    show_line((*numbers, took))


def show_curve(pair: RecordingPair, result: SignalLag, search: LagSearch) -> None:
    """Show the correlation curve with the range expected by chance."""
    sizes, title = None, CURVES[search.method]
    if search.method in ("fft", "direct"):
        curve = st.segmented_control(
            "Curve", (WEIGHTED, PLAIN), default=WEIGHTED, required=True, key="lag.curve", label_visibility="collapsed"
        )
        if curve == PLAIN:
            sizes, title = (pair.signal_1.size, pair.signal_2.size), PLAIN_CURVE
    curve_drawn = figures.correlation_curve(result, title, sizes=sizes)
    st.plotly_chart(curve_drawn, key="correlation", alt=curve_in_words(result))
    if result.lags is not None:
        said = ribbon_in_words(result, "phat" if search.method == "phat" else "plain" if sizes else "fair")
        first, _, more = said.partition(". ")
        prose.caption(f"{first.removesuffix('.')}.", help=typeset(more) or None)


def show_over_time(pair: RecordingPair, result: SignalLag, search: LagSearch) -> None:
    """Show the lag of each block over time."""
    over_time = result.over_time
    if over_time is None:
        prose.caption("The lag was not measured block by block: that takes a sure lag, and recordings that are longer.")
        return
    figure = figures.lag_over_time(over_time, search.sampling_rate)
    st.plotly_chart(figure, key="lag_over_time", alt=blocks_in_words(over_time, search.sampling_rate))
    prose.caption(drift_in_words(over_time))


def show_lined_up(pair: RecordingPair, result: SignalLag, search: LagSearch) -> None:
    """Show both recordings with the lag removed, whole and up close."""
    second, lag = lined_up(pair, result)
    left, right = st.columns(2, gap="large")
    with left:
        prose.markdown("### Shifted to line up")
        both = figures.aligned(pair.signal_1, second, lag, search.sampling_rate)
        st.plotly_chart(both, key="aligned", alt=aligned_in_words(result))
    with right:
        shared, _ = overlap_slices(pair.signal_1.size, second.size, lag)
        prose.markdown(f"### Up close: {min(figures.CLOSE_UP_SAMPLES, shared.stop - shared.start)} samples of both")
        start, highest = shared.start, shared.stop - figures.CLOSE_UP_SAMPLES
        if start < highest:
            liveliest = figures.liveliest_start(pair.signal_1, shared)
            start = st.slider("From sample", start, highest, liveliest, key=f"lag.from.{pair.digest}.{result.lag}")
        close_up = figures.close_up(pair.signal_1, second, lag, start)
        st.plotly_chart(close_up, key="close_up", alt=close_up_in_words(lag, start))


def listen(pair: RecordingPair, result: SignalLag, search: LagSearch) -> None:
    """Show both recordings with a player each, and play both together, before and after the lag is undone."""
    rate = search.sampling_rate
    waveforms = figures.waveforms(pair.signal_1, pair.signal_2, rate)
    st.plotly_chart(waveforms, key="waveforms", alt=waveforms_in_words(pair.signal_1, pair.signal_2, rate))
    columns = st.columns(4, gap="medium")
    for column, signal, name in zip(columns, (pair.signal_1, pair.signal_2), "12", strict=False):
        with column:
            player(signal, rate, f"sensor {name}")
    _hear_both(pair, result, rate, columns[2:])


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
    """Offer the files of a lag."""
    memory = BYTES_OF_A_SAMPLE * (pair.signal_1.size + pair.signal_2.size)
    memory += BYTES_OF_A_LAG * min(CURVE_LAGS, 0 if result.lags is None else len(result.lags))
    files, command = lag_files(pair, result, search), lag_command(search, *NAMES)
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
            refusal or refusal_of(partial(check_wav, first.size, rate)) or too_large(BYTES_OF_ALIGNED * first.size),
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


def _hear_both(pair: RecordingPair, result: SignalLag, sampling_rate: float, columns: Sequence[Container]) -> None:
    most = round(LONGEST_S * sampling_rate)
    aligned = _aligned(pair, result)
    # Long ones are heard from where both have begun.
    begun = max(0, -result.lag) if aligned.size > most else 0
    heard = {
        "as recorded": (pair.signal_1[:most], pair.signal_2[:most]),
        "the lag undone": (pair.signal_1[begun:][:most], aligned[begun:][:most]),
    }
    for column, (name, both) in zip(columns, heard.items(), strict=True):
        with column:
            player(mix(*both), sampling_rate, f"both, {name}")
    said = heard_in_words(result)
    if max(pair.signal_1.size, pair.signal_2.size) > most:
        said += f" Only {LONGEST_S} s are played."
    prose.caption(said)
