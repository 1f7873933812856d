"""All methods compared on one pair of recordings, and the run times of one method."""

from __future__ import annotations

from typing import get_args

import numpy as np
import streamlit as st

from stereolag.core.arrays import Vector
from stereolag.core.jobs import Estimate, Progress, limits, part
from stereolag.core.searches import LagSearch, SignalMethod
from stereolag.core.typography import typeset
from stereolag.figures import recordings as figures
from stereolag.signals import SignalLag, estimate_lag, signal_lag
from stereolag.ui import prose
from stereolag.ui.inputs import RecordingPair
from stereolag.ui.lag.sentences import run_times_in_words
from stereolag.ui.results import computed_or_refused
from stereolag.ui.sentences import LAG_METHODS, duration

LONGEST_S = 60.0
"""Methods expected to take longer are left out of the table."""

RUNS = (10, 200, 50)
"""Minimum, maximum and default number of runs."""


def compare_methods(pair: RecordingPair, result: SignalLag, search: LagSearch) -> None:
    """Offer to run every method on the recordings, and the selected one many times."""
    left, right = st.columns(2, gap="large")
    with left:
        _show_table(pair, search)
    with right:
        _show_run_times(pair, search)


def _show_table(pair: RecordingPair, search: LagSearch) -> None:
    estimates = {method: _estimate(pair, search, method) for method in get_args(SignalMethod)}
    fitting = [method for method, estimate in estimates.items() if _fits(estimate)]
    total = Estimate(
        max((estimates[method].memory for method in fitting), default=0),
        sum(estimates[method].seconds for method in fitting),
    )
    prose.markdown(f"Every method on these recordings, about {duration(total.seconds)}.")
    asked = f"lag.comparison.{pair.digest}"
    if st.button("Compare the methods", key=f"{asked}.button", disabled=not fitting):
        st.session_state[asked] = True
    if not st.session_state.get(asked):
        return

    def measure(progress: Progress) -> list[SignalLag]:
        parts = (part(progress, number, len(fitting)) for number in range(len(fitting)))
        return [_measured(pair, search, *each) for each in zip(fitting, parts, strict=True)]

    found = computed_or_refused(
        "lag methods",
        measure,
        total,
        inputs=pair.digest,
        settings=search.model_dump_json(exclude={"method"}),
        shared=pair.shared,
        label="Measuring …",
    )
    if found is not None:
        alt = "Lag, score, verdict and time of each method."
        lags = dict(zip(fitting, found, strict=True))
        st.dataframe(_table(lags, estimates), hide_index=True, key="lag.comparison.table", alt=alt)


def _table(lags: dict[SignalMethod, SignalLag], estimates: dict[SignalMethod, Estimate]) -> dict[str, list[str]]:
    """Return the columns of the table, formatted for display; methods without a lag were left out."""
    rows = []
    for method, estimate in estimates.items():
        result = lags.get(method)
        if result is None:
            rows.append((LAG_METHODS[method], "–", "–", "left out", typeset(f"about {duration(estimate.seconds)}")))
            continue
        lag = typeset(f"{result.lag:,}" if result.verdict == "sure" else f"({result.lag:,})")
        took = typeset(duration(result.elapsed_s))
        rows.append((LAG_METHODS[method], lag, typeset(f"{result.score:.3f}"), result.verdict, took))
    titles = ("Method", "Lag, samples", "Score", "Verdict", "Time")
    return {title: [row[number] for row in rows] for number, title in enumerate(titles)}


def _show_run_times(pair: RecordingPair, search: LagSearch) -> None:
    name = LAG_METHODS[search.method]
    fewest, most, at_first = RUNS
    runs = st.slider("Runs", fewest, most, at_first, step=fewest, key="lag.runs")
    once = _estimate(pair, search, search.method)
    total = Estimate(once.memory, runs * once.seconds)
    asked = f"lag.run_times.{pair.digest}"
    if st.button(f"Time {runs} runs of {name}", key=f"{asked}.button", disabled=once.memory > limits().job_memory):
        st.session_state[asked] = search.method, runs
    if st.session_state.get(asked) != (search.method, runs):
        return

    def measure(progress: Progress) -> Vector:
        parts = (part(progress, run, runs) for run in range(runs))
        return np.array([_measured(pair, search, search.method, one).elapsed_s for one in parts])

    seconds = computed_or_refused(
        "lag run times",
        measure,
        total,
        inputs=pair.digest,
        settings=f"{runs} {search.model_dump_json()}",
        shared=pair.shared,
        label="Measuring …",
    )
    if seconds is not None:
        st.plotly_chart(figures.run_times(seconds), key="lag.run_times.figure", alt=run_times_in_words(seconds))
        prose.caption(f"{name}: half of the runs took less than {duration(float(np.median(seconds)))}.")


def _measured(pair: RecordingPair, search: LagSearch, method: SignalMethod, progress: Progress) -> SignalLag:
    settings = search.model_dump() | {"method": method}
    return signal_lag(pair.signal_1, pair.signal_2, **settings, seed=0, progress=progress)


def _estimate(pair: RecordingPair, search: LagSearch, method: SignalMethod) -> Estimate:
    return estimate_lag(pair.signal_1.size, pair.signal_2.size, method=method, max_lag=search.max_lag)


def _fits(estimate: Estimate) -> bool:
    return estimate.seconds <= LONGEST_S and estimate.memory <= limits().job_memory
