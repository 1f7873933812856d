"""Take it away: a lag as files, and both recordings played together before and after alignment."""

from __future__ import annotations

import json
from functools import partial

import streamlit as st

from stereolag.core.searches import LagSearch
from stereolag.io.disparities import npy
from stereolag.io.programs import lag_command, lag_script
from stereolag.io.results import aligned_wav, check_aligned_wav, curve_csv, lag_json
from stereolag.signals import SignalLag
from stereolag.signals.alignment import aligned_length, together
from stereolag.ui import prose
from stereolag.ui.downloads import File, archive, show_reproduction, show_taken, too_large
from stereolag.ui.recordings import LONGEST_S, RecordingPair, player
from stereolag.ui.results import remembered

KEY = "lag.take"
NAMES = ("recording_1.npy", "recording_2.npy")

CURVE_LAGS = 1_000_000
"""Most lags in a curve file: a spreadsheet has at most 1,048,576 rows."""

ECHO_S = 0.03
"""Seconds; sounds closer together are heard as one (Haas, 1951)."""

BYTES_OF_A_SAMPLE, BYTES_OF_A_LAG = 32, 256
"""Memory while the ZIP is made: the recordings, both aligned, and the curve as numbers and text."""

BYTES_OF_ALIGNED = 10
"""Memory per stereo sample while the WAV is written."""


def show_lag_files(pair: RecordingPair, result: SignalLag, search: LagSearch) -> None:
    """Play both recordings together, and offer the files of a lag."""
    both = st.expander("Hear both together", icon=":material/hearing:", key="lag.both", on_change="rerun")
    if both.open:
        with both:
            _hear_both(pair, result, search.sampling_rate)
    opened = st.expander("Take it away", icon=":material/download:", key=f"{KEY}.opened", on_change="rerun")
    if opened.open:
        with opened:
            memory = BYTES_OF_A_SAMPLE * (pair.signal_1.size + pair.signal_2.size)
            memory += BYTES_OF_A_LAG * min(CURVE_LAGS, 0 if result.lags is None else len(result.lags))
            command = lag_command(search, *NAMES)
            offered = lag_files(pair, result, search)
            about = f"To measure this lag again, in the folder of these files: {command}"
            show_taken(offered, partial(archive, offered, about), memory, key=KEY)
            show_reproduction(command, "measure this lag again", own=not pair.shared)


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


def heard_in_words(result: SignalLag) -> str:
    """Return how both recordings sound together, before and after the lag is undone."""
    if result.verdict != "sure":
        return f"No lag is sure here. The best-fitting lag, {result.lag:,} samples, is undone."
    if result.lag == 0:
        return "The lag is 0: there is nothing to undo."
    if abs(result.time_s) < ECHO_S:
        return f"Only a lag above about {ECHO_S:g} s is heard as an echo. A shorter one colours the sound."
    return "As recorded, each sound comes twice, like an echo. With the lag undone it comes once."


def _hear_both(pair: RecordingPair, result: SignalLag, sampling_rate: float) -> None:
    most = round(LONGEST_S * sampling_rate)
    heard = (("as recorded", 0), ("the lag undone", result.lag))
    for column, (name, lag) in zip(st.columns(2, gap="medium"), heard, strict=True):
        with column:
            sound = remembered(
                "both together",
                partial(together, pair.signal_1, pair.signal_2, lag, most),
                inputs=pair.digest,
                settings=json.dumps([lag, most]),
                shared=pair.shared,
            )
            player(sound, sampling_rate, f"both, {name}")
    said = heard_in_words(result)
    if aligned_length(pair.signal_1.size, pair.signal_2.size, result.lag) > most:
        said += f" Only {LONGEST_S} s are played, from where both recordings have begun."
    prose.caption(said)
