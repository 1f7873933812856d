"""The parts of the lag page: the verdict, its curve, sound and files, and other methods."""

from __future__ import annotations

from functools import partial
from typing import get_args

import numpy as np
import streamlit as st

from stereolag.core.arrays import Vector
from stereolag.core.jobs import Estimate, Progress, limits, part
from stereolag.core.searches import LagSearch, SignalMethod
from stereolag.core.typography import duration, typeset
from stereolag.figures import recordings as figures
from stereolag.figures.verdicts import curve_in_words, verdict_explained, verdict_in_words
from stereolag.io.arrays import npy
from stereolag.io.programs import lag_command, lag_script
from stereolag.io.recordings import aligned_file, check_wav
from stereolag.io.results import curve_csv, lag_json
from stereolag.signals import SignalLag, estimate_lag, signal_lag
from stereolag.signals.alignment import align, mix
from stereolag.signals.correlation import overlap_pearson, overlap_slices
from stereolag.signals.lag import normalised
from stereolag.signals.over_time import LagOverTime
from stereolag.signals.recordings import HeldRecording
from stereolag.ui import prose
from stereolag.ui.downloads import File, refusal_of, show_player, take_away, too_large
from stereolag.ui.elements import Number, announce, asked_for, in_columns, show_numbers
from stereolag.ui.lag.inputs import RecordingPair
from stereolag.ui.lag.sentences import (
    aligned_in_words,
    blocks_in_words,
    close_up_in_words,
    drift_in_words,
    heard_in_words,
    ribbon_in_words,
    run_times_in_words,
    waveforms_in_words,
)
from stereolag.ui.results import computed_or_refused, kept_for, remembered
from stereolag.ui.sentences import CURVES, LAG_METHODS

WEIGHTED, PLAIN = "Weighted by overlap", "Not weighted"

NAMES = ("recording_1.npy", "recording_2.npy")

MAX_CURVE_LAGS = 1_000_000
"""Limit for the lags in a curve file: a spreadsheet has at most 1,048,576 rows."""

ZIP_BYTES_PER_SAMPLE = 80
"""Memory for the recordings, as numbers and as text, while the ZIP is made."""

ZIP_BYTES_PER_LAG = 256
"""Memory for the curve, as numbers and as text, while the ZIP is made."""

WAV_BYTES_PER_SAMPLE = 10
"""Memory while the aligned WAV is written."""

CSV_BYTES_PER_SAMPLE = 60
"""Memory while the aligned CSV is written."""

ALIGNED = "Recording 2 on the clock of recording 1: lag, drift and steps undone, and as long as recording 1."


def assumed(pair: RecordingPair, search: LagSearch) -> set[str]:
    """Return the settings that neither the recordings nor the visitor gave."""
    return {
        name
        for name in ("speed", "sampling_rate")
        if getattr(pair, name) is None and getattr(search, name) == LagSearch.model_fields[name].default
    }


def show_verdict(pair: RecordingPair, result: SignalLag, search: LagSearch) -> None:
    """Show the verdict and the lag in words and numbers; metres only if the lag is sure."""
    headline = verdict_in_words(result, assumed(pair, search))
    prose.header(headline, anchor=False)
    announce(headline)
    if pair.doubt:
        prose.warning(pair.doubt)
    for sentence in verdict_explained(result):
        prose.markdown(sentence)
    score, undone, judgement = result.score, "", result.judgement
    if result.over_time is not None and result.over_time.changes:
        score, undone = _aligned_score(pair, result, result.over_time), ", with drift and steps undone"
    highest = Number("Highest at", f"{result.lag:,}", "The peak of the curve, in samples: not a lag to rely on.")
    show_numbers(
        (
            *([] if result.verdict == "sure" else [highest]),
            Number(
                "Agreement",
                f"{score:.3f}",
                f"Pearson’s correlation where both overlap{undone}: 1 is perfect agreement.",
            ),
            Number(
                "Evidence",
                f"{judgement.evidence:.1f} of {judgement.needed:.1f} needed",
                "Height of the peak above chance, in standard deviations, and the height needed with so many lags.",
            ),
            Number("Computed in", duration(result.elapsed_s), "Time of the computation alone, when first run."),
        )
    )


def show_curve(pair: RecordingPair, result: SignalLag, search: LagSearch) -> None:
    """Show the correlation curve with its chance level."""
    sizes, title = None, CURVES[search.method]
    if search.method in ("fft", "direct"):
        curve = st.segmented_control(
            "Curve", (WEIGHTED, PLAIN), default=WEIGHTED, required=True, key="lag.curve", label_visibility="collapsed"
        )
        if curve == PLAIN:
            sizes, title = (pair.signal_1.size, pair.signal_2.size), "correlation (Pearson)"
    st.plotly_chart(
        figures.correlation_curve(result, title, sizes=sizes), key="correlation", alt=curve_in_words(result)
    )
    if result.lags is not None:
        explanation = ribbon_in_words(result, "phat" if search.method == "phat" else "plain" if sizes else "weighted")
        first, _, more = explanation.partition(". ")
        prose.caption(f"{first.removesuffix('.')}.", help=typeset(more) or None)


def show_over_time(pair: RecordingPair, result: SignalLag, search: LagSearch) -> None:
    """Show the lag of each block over time."""
    over_time = result.over_time
    if over_time is None:
        prose.caption("The lag was not measured block by block: that takes a reliable lag and longer recordings.")
        return
    st.plotly_chart(
        figures.lag_over_time(over_time, search.sampling_rate),
        key="lag_over_time",
        alt=blocks_in_words(over_time, search.sampling_rate),
    )
    prose.caption(drift_in_words(over_time))


def show_lined_up(pair: RecordingPair, result: SignalLag, search: LagSearch) -> None:
    """Show both recordings with the lag undone, whole and up close."""
    second, lag = lined_up(pair, result)
    left, right = st.columns(2, gap="large")
    with left:
        prose.markdown("### Shifted to line up")
        st.plotly_chart(
            figures.aligned(pair.signal_1, second, lag, search.sampling_rate),
            key="aligned",
            alt=aligned_in_words(result),
        )
    with right:
        shared, _ = overlap_slices(pair.signal_1.size, second.size, lag)
        prose.markdown(f"### Up close: {min(figures.CLOSE_UP_SAMPLES, shared.stop - shared.start)} samples of both")
        start, last_start = shared.start, shared.stop - figures.CLOSE_UP_SAMPLES
        if start < last_start:
            liveliest = figures.highest_energy_start(pair.signal_1, shared)
            start = st.slider("From sample", start, last_start, liveliest, key=f"lag.from.{pair.digest}.{result.lag}")
        st.plotly_chart(
            figures.close_up(pair.signal_1, second, lag, start), key="close_up", alt=close_up_in_words(lag, start)
        )


def listen(pair: RecordingPair, result: SignalLag, search: LagSearch) -> None:
    """Show both recordings with a player each, and play both together, before and after the lag is undone."""
    rate, first, second = search.sampling_rate, pair.signal_1, pair.signal_2
    st.plotly_chart(
        figures.waveforms(first, second, rate), key="waveforms", alt=waveforms_in_words(first, second, rate)
    )
    max_size = round(MAX_PLAYED_S * rate)
    aligned = _aligned(pair, result)
    # Long recordings are played from where both have begun.
    start = max(0, -result.lag) if aligned.size > max_size else 0
    signals = {
        "sensor 1": first,
        "sensor 2": second,
        "both, as recorded": mix(first[:max_size], second[:max_size]),
        "both, the lag undone": mix(first[start:][:max_size], aligned[start:][:max_size]),
    }
    for name, signal in in_columns(signals.items()):
        player(signal, rate, name)
    shortened = f" Only {MAX_PLAYED_S} s are played." if max(first.size, second.size) > max_size else ""
    prose.caption(f"{heard_in_words(result)}{shortened}")


PLAYABLE_RATES_HZ = (3_000, 384_000)
"""Lowest and highest sampling rate that browsers play."""

MAX_PLAYED_S = 120
"""Longest part of a recording that is played, s."""


def player(signal: Vector, sampling_rate: float, name: str) -> None:
    """Show a player for at most the first two minutes of a recording."""
    lowest, highest = PLAYABLE_RATES_HZ
    if not lowest <= sampling_rate <= highest:
        prose.caption(f"There is no player for {name}: browsers play {lowest:,} to {highest:,} samples a second.")
        return
    played = signal[: round(MAX_PLAYED_S * sampling_rate)]
    prose.caption(f"Listen to {name}" + ("" if played.size == signal.size else f" (the first {MAX_PLAYED_S} s)"))
    show_player(played, sampling_rate, name)


def lined_up(pair: RecordingPair, result: SignalLag) -> tuple[Vector, int]:
    """Return recording 2 for a plot with recording 1, and the lag by which the plot must still shift it, samples."""
    if result.over_time is not None and result.over_time.changes:
        return _aligned(pair, result), 0
    opposite = result.judgement.opposite_lag
    return pair.signal_2, result.lag if opposite is None else opposite


def _aligned_score(pair: RecordingPair, result: SignalLag, over_time: LagOverTime) -> float:
    """Return Pearson's correlation of recording 1 with recording 2 on its clock, where both have samples."""
    shared = slice(over_time.stretches[0].begin, over_time.stretches[-1].end)
    first, second = (HeldRecording(normalised(signal[shared])) for signal in (pair.signal_1, _aligned(pair, result)))
    return overlap_pearson(first, second, 0)


def _aligned(pair: RecordingPair, result: SignalLag) -> Vector:
    """Return recording 2 on the clock of recording 1, with the best-fitting lag undone if none is reliable."""
    lag = result if result.verdict == "sure" else result.lag_subsample
    return remembered(
        "aligned recording",
        lambda: np.asarray(align(pair.signal_1, pair.signal_2, lag), dtype=np.float64),
        **kept_for(pair, f"{result.lag_subsample} {result.over_time}"),
    )


def show_lag_files(pair: RecordingPair, result: SignalLag, search: LagSearch) -> None:
    """Offer the files of a lag."""
    lags = 0 if result.lags is None else min(MAX_CURVE_LAGS, len(result.lags))
    memory = ZIP_BYTES_PER_SAMPLE * (pair.signal_1.size + pair.signal_2.size) + ZIP_BYTES_PER_LAG * lags
    files, command = lag_files(pair, result, search), lag_command(search, *NAMES)
    take_away(files, memory, command, "measure this lag again", own=not pair.shared, key="lag.take")


def lag_files(pair: RecordingPair, result: SignalLag, search: LagSearch) -> list[File]:
    """Return the files of a lag, in the order they are offered."""
    rate, first, second = search.sampling_rate, pair.signal_1, pair.signal_2
    votes = result.lags is None
    too_many = result.lags is not None and len(result.lags) > MAX_CURVE_LAGS
    which = f"the {MAX_CURVE_LAGS:,} lags around the one found" if too_many else "every lag"
    if result.lags is not None and result.lags[-1] - result.lags[0] >= len(result.lags):
        which = "the best lag of each stretch, as drawn"
    refusal = "" if result.verdict == "sure" else "Only a reliable lag can be undone."
    return [
        File(
            "Votes CSV" if votes else "Curve CSV",
            "votes.csv" if votes else "curve.csv",
            partial(curve_csv, result, rate, MAX_CURVE_LAGS),
            "Lags in samples and in seconds, and their votes."
            if votes
            else f"Lag in samples, time in seconds and correlation, for {which}.",
        ),
        File(
            "Result JSON",
            "lag.json",
            partial(lag_json, result, search, assumed(pair, search)),
            "The results and settings, under the same names as in stereolag lag --json.",
        ),
        File(
            "Aligned WAV",
            "aligned.wav",
            partial(aligned_file, ".wav", first, second, result, rate),
            f"{ALIGNED} 32-bit floats.",
            refusal or refusal_of(partial(check_wav, first.size, rate)) or too_large(WAV_BYTES_PER_SAMPLE * first.size),
        ),
        File(
            "Aligned CSV",
            "aligned.csv",
            partial(aligned_file, ".csv", first, second, result, rate),
            f"{ALIGNED} Time in seconds, and the samples.",
            refusal or too_large(CSV_BYTES_PER_SAMPLE * first.size),
        ),
        File("Python script", "reproduce.py", partial(lag_script, search, *NAMES), "Measures this lag again."),
        File("", NAMES[0], partial(npy, first), "The samples of sensor 1 as they were compared."),
        File("", NAMES[1], partial(npy, second), "The samples of sensor 2 as they were compared."),
    ]


# Other methods, and run times

MAX_METHOD_S = 60.0
"""Expected time above which a method is left out of the table, s."""

RUNS = (10, 200, 50)
"""Minimum, maximum and default number of runs to time."""


def compare_methods(pair: RecordingPair, result: SignalLag, search: LagSearch) -> None:
    """Offer to run every method on the recordings, and to time many runs of the selected one."""
    for show in in_columns((_show_table, _show_run_times), gap="large"):
        show(pair, search)


def _show_table(pair: RecordingPair, search: LagSearch) -> None:
    estimates = {method: _estimate(pair, search, method) for method in get_args(SignalMethod)}
    feasible = [
        method
        for method, estimate in estimates.items()
        if estimate.seconds <= MAX_METHOD_S and estimate.memory <= limits().job_memory
    ]
    total = Estimate(
        max((estimates[method].memory for method in feasible), default=0),
        sum(estimates[method].seconds for method in feasible),
    )
    prose.markdown(f"Every method on these recordings, about {duration(total.seconds)}.")
    if not asked_for(True, "Compare the methods", f"lag.comparison.{pair.digest}", disabled=not feasible):
        return
    results = computed_or_refused(
        "lag methods",
        lambda progress: [
            _lag_by(pair, search, method, part(progress, number, len(feasible)))
            for number, method in enumerate(feasible)
        ],
        total,
        **kept_for(pair, search.model_dump_json(exclude={"method"})),
        label="Measuring …",
    )
    if results is not None:
        st.dataframe(
            _table_of_methods(dict(zip(feasible, results, strict=True)), estimates),
            hide_index=True,
            key="lag.comparison.table",
            alt="Lag, score, verdict and time of each method.",
        )


def _table_of_methods(
    results: dict[SignalMethod, SignalLag], estimates: dict[SignalMethod, Estimate]
) -> dict[str, list[str]]:
    """Return the columns of the table, formatted for display; methods without a result were left out."""
    rows = []
    for method, estimate in estimates.items():
        result = results.get(method)
        if result is None:
            rows.append((LAG_METHODS[method], "–", "–", "left out", f"about {duration(estimate.seconds)}"))
            continue
        lag = typeset(f"{result.lag:,}" if result.verdict == "sure" else f"({result.lag:,})")
        rows.append(
            (LAG_METHODS[method], lag, typeset(f"{result.score:.3f}"), result.verdict, duration(result.elapsed_s))
        )
    titles = ("Method", "Lag, samples", "Score", "Verdict", "Time")
    return {title: [row[number] for row in rows] for number, title in enumerate(titles)}


def _show_run_times(pair: RecordingPair, search: LagSearch) -> None:
    name = LAG_METHODS[search.method]
    runs = st.slider("Runs", *RUNS, step=RUNS[0], key="lag.runs")
    once = _estimate(pair, search, search.method)
    total = Estimate(once.memory, runs * once.seconds)
    label, too_much = f"Time {runs} runs of {name}", once.memory > limits().job_memory
    if not asked_for((search.method, runs), label, f"lag.run_times.{pair.digest}", disabled=too_much):
        return
    seconds = computed_or_refused(
        "lag run times",
        lambda progress: np.array(
            [_lag_by(pair, search, search.method, part(progress, run, runs)).elapsed_s for run in range(runs)]
        ),
        total,
        **kept_for(pair, f"{runs} {search.model_dump_json()}"),
        label="Measuring …",
    )
    if seconds is not None:
        st.plotly_chart(figures.run_times(seconds), key="lag.run_times.figure", alt=run_times_in_words(seconds))
        prose.caption(f"{name}: half of the runs took less than {duration(float(np.median(seconds)))}.")


def _lag_by(pair: RecordingPair, search: LagSearch, method: SignalMethod, progress: Progress) -> SignalLag:
    return signal_lag(
        pair.signal_1, pair.signal_2, **(search.model_dump() | {"method": method}), seed=0, progress=progress
    )


def _estimate(pair: RecordingPair, search: LagSearch, method: SignalMethod) -> Estimate:
    return estimate_lag(pair.signal_1.size, pair.signal_2.size, method=method, max_lag=search.max_lag)
