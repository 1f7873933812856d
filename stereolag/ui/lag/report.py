"""Report on a lag: its verdict, its numbers and its curve."""

from __future__ import annotations

import streamlit as st

from stereolag.core.searches import LagSearch
from stereolag.figures import recordings as figures
from stereolag.signals import SignalLag
from stereolag.ui import prose
from stereolag.ui.announcements import announce
from stereolag.ui.elements import Number, show_numbers
from stereolag.ui.lag.alternatives import curve_in_words, drift_in_words
from stereolag.ui.lag.sentences import RIBBON_EXPLAINED, verdict_explained, verdict_in_words
from stereolag.ui.recordings import RecordingPair
from stereolag.ui.searches import CURVES
from stereolag.ui.sentences import duration

FAIR, PLAIN = "Fair to short overlaps", "Plain Pearson"


def show_verdict(result: SignalLag, search: LagSearch) -> None:
    """Show the verdict and the lag in words and numbers; metres only if the lag is sure."""
    prose.header(verdict_in_words(result), anchor=False)
    announce(verdict_in_words(result))
    for sentence in verdict_explained(result, search.sampling_rate, search.speed):
        prose.markdown(sentence)
    show_numbers((*(_sure(result) if result.verdict == "sure" else _doubtful(result)), *_always(result)))


def _sure(result: SignalLag) -> tuple[Number, ...]:
    return (
        Number("Lag, samples", f"{result.lag:,}", f"With its fraction: {result.lag_subsample:,.2f}."),
        Number("Time", f"{result.time_s:.4g} s", "Lag ÷ sampling rate; positive where sensor 2 hears it later."),
        Number(
            "Path difference",
            f"{result.distance_m:,.2f} m",
            "Time × speed of the wave. The sensors are this far apart if the source is in line with them, otherwise "
            "farther.",
        ),
    )


def _doubtful(result: SignalLag) -> tuple[Number, ...]:
    return (Number("Highest point, samples", f"{result.lag:,}", "Where the curve is highest: not a lag to rely on."),)


def _always(result: SignalLag) -> tuple[Number, ...]:
    numbers = [
        Number("Score", f"{result.score:.3f}", "Pearson’s correlation where both overlap: 1 is perfect agreement."),
    ]
    if result.judgement is not None:
        numbers.append(
            Number(
                "Above chance",
                f"{result.judgement.evidence:.1f} σ",
                "Agreement of the whitened recordings, in standard deviations of chance. For this many lags, "
                f"{result.judgement.needed:.1f} σ are needed.",
            )
        )
    return (*numbers, Number("Took", duration(result.elapsed_s), "Time of the computation alone, when first run."))


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
    drift = result.judgement.drift if result.judgement else None
    if drift is None:
        return
    with st.expander("Lag over time", expanded=drift.shows):
        over_time = figures.lag_over_time(drift, search.sampling_rate)
        st.plotly_chart(over_time, key="lag_over_time", alt=drift_in_words(drift))
        prose.caption(
            f"Each dot is one block of the recordings. The line rises by {drift.ppm:+.1f} ± {drift.error_ppm:.1g} ppm: "
            + ("the clocks of the recorders differ." if drift.shows else "the clocks agree within the error.")
        )
