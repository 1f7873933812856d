"""The two recordings of the lag page."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
import streamlit as st

from stereolag import samples
from stereolag.core.arrays import Vector
from stereolag.core.inputs import as_signal
from stereolag.io.guard import guarded
from stereolag.io.recordings import Recording, at_one_rate, read_signal
from stereolag.ui import prose
from stereolag.ui.choices import choose, own_or_example, show_limits
from stereolag.ui.downloads import show_player
from stereolag.ui.lag.sentences import own_facts, upload_limits
from stereolag.ui.uploads import RECORDING_TYPES, Upload, forget_together, put_together, upload

KEY = "recordings"


@dataclass(frozen=True, eq=False)
class RecordingPair:
    """Two recordings and their properties; None if unknown."""

    signal_1: Vector
    signal_2: Vector
    sampling_rate: float | None
    speed: float | None
    description: str
    digest: str
    shared: bool

    @property
    def longest_lag(self) -> int:
        """Return the largest lag at which the recordings can still overlap, samples."""
        return max(self.signal_1.size, self.signal_2.size) - 1


def choose_recordings() -> RecordingPair:
    """Ask which recordings to compare."""
    examples = samples.recordings()
    chosen = choose(examples, key=KEY)
    return own_or_example(chosen, _own_recordings, example_recordings, examples, key=KEY, awaited="your recordings are")


@st.cache_resource(show_spinner="Loading the example …")
def example_recordings(name: str) -> RecordingPair:
    """Return one of the bundled pairs of recordings."""
    example = samples.recordings()[name]
    signal_1, signal_2 = (read_signal(path).channels[0] for path in (example.signal_1, example.signal_2))
    return RecordingPair(
        signal_1, signal_2, example.sampling_rate, example.speed, example.description, f"recordings {name}", True
    )


def _own_recordings() -> RecordingPair | None:
    """Ask for two files, or for one with several channels; return the last usable pair."""
    columns = st.columns(2, gap="medium")
    with columns[0]:
        first = upload(
            "Sensor 1",
            guarded(read_signal),
            key=f"{KEY}.file_1",
            types=RECORDING_TYPES,
            note="A file of two channels is enough. Columns of numbers are channels too.",
        )
        channel_1 = _channel(first, 0, key=f"{KEY}.channel_1")
    with columns[1]:
        second = upload("Sensor 2", guarded(read_signal), key=f"{KEY}.file_2", types=RECORDING_TYPES)
        both_in_one = second is None and first is not None and len(_signals(first.content)) > 1
        holder = first if both_in_one else second
        channel_2 = _channel(holder, 1 if both_in_one else 0, key=f"{KEY}.channel_2")
    show_limits(upload_limits())
    if first is None or holder is None:
        forget_together(f"{KEY}.own")
        return None
    return put_together(lambda: _pair(first, channel_1, holder, channel_2), f"{KEY}.own")


def _signals(recording: Recording) -> list[int]:
    """Return the numbers, from 1, of all channels except the clock."""
    return [number for number in range(1, len(recording.channels) + 1) if number - 1 != recording.clock]


def _channel(file: Upload[Recording] | None, at_first: int, *, key: str) -> int:
    """Ask for the channel of a file that has several; return its number, from 1.

    `at_first` is the index of the signal that is selected initially: 0 is the first.
    """
    if file is None or len(file.content.channels) == 1:
        return 1
    clock = file.content.clock
    return int(
        st.selectbox(
            "Channel",
            range(1, len(file.content.channels) + 1),
            index=_signals(file.content)[at_first] - 1,
            format_func=lambda number: f"{number} (rises evenly: time)" if number - 1 == clock else str(number),
            key=f"{key}.{file.digest}",
        )
    )


def _pair(first: Upload[Recording], channel_1: int, second: Upload[Recording], channel_2: int) -> RecordingPair:
    """Return the two channels as a pair; ValueError if they cannot be compared."""
    digest = f"{first.digest} {channel_1} {second.digest} {channel_2}"
    one, other = _at_one_rate(first.content.channel(channel_1), second.content.channel(channel_2), digest)
    facts = own_facts((one, other), (channel_1, channel_2), (len(first.content.channels), len(second.content.channels)))
    return RecordingPair(
        as_signal(one.channels[0], "The recording of sensor 1"),
        as_signal(other.channels[0], "The recording of sensor 2"),
        one.sampling_rate or other.sampling_rate,
        None,
        f"Your own recordings.  \n{facts}",
        digest,
        False,
    )


def _at_one_rate(one: Recording, other: Recording, digest: str) -> tuple[Recording, Recording]:
    """Return both at one sampling rate; the result is kept until other recordings are chosen."""
    kept: tuple[str, tuple[Recording, Recording]] | None = st.session_state.get(f"{KEY}.resampled")
    if kept is None or kept[0] != digest:
        kept = digest, at_one_rate(one, other)
        st.session_state[f"{KEY}.resampled"] = kept
    return kept[1]


AUDIBLE_RATES = (3_000, 384_000)
"""Lowest and highest sampling rate that browsers play, samples per second."""

LONGEST_S = 120


def player(signal: npt.NDArray[np.float64], sampling_rate: float, name: str) -> None:
    """Show a player for at most the first two minutes of a recording."""
    lowest, highest = AUDIBLE_RATES
    if not lowest <= sampling_rate <= highest:
        prose.caption(f"There is no player for {name}: browsers play {lowest:,} to {highest:,} samples a second.")
        return
    heard = signal[: round(LONGEST_S * sampling_rate)]
    prose.caption(f"Listen to {name}" + ("" if heard.size == signal.size else f" (the first {LONGEST_S} s)"))
    show_player(heard, sampling_rate, name)
