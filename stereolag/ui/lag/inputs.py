"""The inputs of the page Sensor lag: examples, own files or live microphones, and the address of the page."""

from __future__ import annotations

import hashlib
from dataclasses import dataclass, replace
from functools import partial
from typing import Any, Literal, Self

import numpy as np
import streamlit as st
from pydantic import Field, model_validator

from stereolag import read_signal, samples
from stereolag.core.arrays import Vector
from stereolag.core.inputs import as_signal
from stereolag.core.searches import LagSearch
from stereolag.core.settings import Bounds, Problem, SettingsError
from stereolag.io.clocks import Recording, at_one_rate, duplicate_warning
from stereolag.io.formats import ACCEPTED, RECORDING_SUFFIXES
from stereolag.io.guard import guarded
from stereolag.signals.listening import Listening
from stereolag.ui.addresses import Address, example_choice
from stereolag.ui.components import component, packed_item
from stereolag.ui.controls import adopt_values, control
from stereolag.ui.lag.sentences import (
    COLOURS,
    LISTENING_WORDS,
    heard_now_in_words,
    own_facts,
    upload_limits,
)
from stereolag.ui.navigation import fragment, head, show_try_first
from stereolag.ui.results import Inputs
from stereolag.ui.streams import Message, Whole, connected, open_stream
from stereolag.ui.uploads import (
    LIVE,
    OWN,
    Upload,
    choose,
    in_fold,
    own_or_example,
    put_together,
    show_limits,
    upload_part,
)

RECORDINGS = "recordings"


@dataclass(frozen=True, eq=False)
class RecordingPair(Inputs):
    """Two recordings and their properties, None if unknown, and a sentence of doubt if they look wrong, else ""."""

    signal_1: Vector
    signal_2: Vector
    sampling_rate: float | None
    speed: float | None
    doubt: str = ""

    @property
    def longest_lag(self) -> int:
        """Return the largest lag at which the recordings can still overlap, samples."""
        return max(self.signal_1.size, self.signal_2.size) - 1


def choose_recordings() -> RecordingPair:
    """Ask which recordings to compare."""
    examples = samples.recordings()
    with head("Sensor lag"):
        chosen = choose(examples, key=RECORDINGS, live="Live")
        show_try_first(
            {
                LIVE: "clap your hands on the left, then on the right, and watch the needle.",
                OWN: "drag the snippet to where it fits; then *Fool it*.",
            }.get(chosen, "drag the snippet to where it fits; then take the harbour, or *Fool it*.")
        )
    if chosen == LIVE:
        return _live_recordings()
    return own_or_example(
        chosen, _own_recordings, example_recordings, examples, key=RECORDINGS, awaited="your recordings are"
    )


def _live_recordings() -> RecordingPair:
    """Listen to the visitor's microphones; return the frozen pair, or stop the page here while there is none."""
    _panel()
    frozen = open_stream("lag", Piece).kept.get("frozen")
    pair = None if frozen is None else _frozen_pair(*frozen)
    if pair is None:
        LAG_ADDRESS.write_choices()
        st.stop()
    return pair


def _frozen_pair(file: Upload[Recording], speed: float) -> RecordingPair | None:
    """Return a frozen recording of two channels as a pair; if one cannot be used, show why and return the last pair.

    `speed` is the wave speed set by the visitor, m/s.
    """
    digest = f"{file.digest} 1 {file.digest} 2"
    return put_together(
        lambda: replace(_pair(file, 1, file, 2, digest), speed=None if speed == LagSearch().speed else speed),
        f"{RECORDINGS}.live",
        digest,
    )


@st.cache_resource(show_spinner="Loading the example …")
def example_recordings(name: str) -> RecordingPair:
    """Return one of the bundled pairs of recordings."""
    example = samples.recordings()[name]
    signal_1, signal_2 = (read_signal(path).channels[0] for path in (example.signal_1, example.signal_2))
    return RecordingPair(
        example.description, f"recordings {name}", True, signal_1, signal_2, example.sampling_rate, example.speed
    )


@in_fold(RECORDINGS)
def _own_recordings() -> RecordingPair | None:
    """Ask for two files, or for one with several channels; return the last usable pair."""
    columns = st.columns(2, gap="medium")
    with columns[0]:
        first = _recording("Sensor 1", "file_1", note=f"{ACCEPTED}. One file with two channels is enough.")
        channel_1 = _channel(first, 0, key=f"{RECORDINGS}.channel_1")
    with columns[1]:
        second = _recording("Sensor 2", "file_2")
        both_in_one = second is None and first is not None and len(first.content.channels) > 1
        holder = first if both_in_one else second
        channel_2 = _channel(holder, 1 if both_in_one else 0, key=f"{RECORDINGS}.channel_2")
    show_limits(upload_limits())
    if first is None or holder is None:
        return put_together(None, f"{RECORDINGS}.own")
    digest = f"{first.digest} {channel_1} {holder.digest} {channel_2}"
    return put_together(lambda: _pair(first, channel_1, holder, channel_2, digest), f"{RECORDINGS}.own", digest)


def _recording(label: str, name: str, note: str = "") -> Upload[Recording] | None:
    """Ask for a file, and for one of its tracks if it has several."""
    return upload_part(
        label,
        lambda data, track: guarded(read_signal)(data, track=track),
        lambda recording: recording.tracks,
        "Track",
        key=f"{RECORDINGS}.{name}",
        types=RECORDING_SUFFIXES,
        note=note,
    )


def _channel(file: Upload[Recording] | None, initial: int, *, key: str) -> int:
    """Ask for the channel of a file that has several; return its number, from 1.

    `initial` is the index of the initially selected channel, from 0.
    """
    if file is None or len(file.content.channels) == 1:
        return 1 if file is None else file.content.numbers[0]
    names = dict(zip(file.content.numbers, file.content.names, strict=True))
    return int(
        st.selectbox(
            "Channel",
            names,
            index=initial,
            format_func=lambda number: f"{number}: {names[number]}" if names[number] else str(number),
            key=f"{key}.{file.digest}",
        )
    )


def _pair(
    first: Upload[Recording], channel_1: int, second: Upload[Recording], channel_2: int, digest: str
) -> RecordingPair:
    """Return the two channels as a pair; ValueError if they cannot be compared."""
    one, other = at_one_rate(first.content.channel(channel_1), second.content.channel(channel_2))
    highest_channels = first.content.highest_channel, second.content.highest_channel
    return RecordingPair(
        description=f"Your own recordings.  \n{own_facts((one, other), (channel_1, channel_2), highest_channels)}",
        digest=digest,
        shared=False,
        signal_1=as_signal(one.channels[0], "The recording of sensor 1"),
        signal_2=as_signal(other.channels[0], "The recording of sensor 2"),
        sampling_rate=one.sampling_rate or other.sampling_rate,
        speed=None,
        doubt=duplicate_warning(one, other),
    )


# Microphones heard live


SETTING_WIDTH = 170
"""Width of a setting below the panel, px: its title fits into one line, and both settings fit on a phone."""


class Piece(Message):
    """A piece of sound: 16-bit samples of two channels, the same number of each.

    Attributes
    ----------
    rate
        Samples per second.
    devices
        Number of devices that the channels come from.
    begun
        Identifies the moment when they were switched on.
    freeze
        Identifies the request to freeze the sound heard now, if there is one.
    """

    parts: tuple[bytes, bytes]
    rate: float = Field(ge=3_000, le=384_000)
    devices: Literal[1, 2]
    begun: Whole
    freeze: Whole | None = None

    @model_validator(mode="after")
    def _has_samples(self) -> Self:
        first, second = self.parts
        if len(first) != len(second) or len(first) % 2:
            raise ValueError("Both channels must have the same number of 16-bit samples.")
        return self


@fragment
def _panel() -> None:
    panel = st.container()
    settings = st.container(horizontal=True, gap="small")
    with settings.container(width=SETTING_WIDTH):
        speed = control(LagSearch, "speed", key="lag.live.speed")
    with settings.container(width=SETTING_WIDTH):
        max_lag = control(LagSearch, "max_lag", key="lag.live.max", when_empty="every lag")
    stream = open_stream("lag", Piece)
    stream.answer = partial(answer, stream.kept, speed=speed, max_lag=max_lag)
    with panel:
        panel_state = component("listening")(
            key="lag.live",
            data={**connected(stream, LISTENING_WORDS), "colours": COLOURS},
            on_freeze_change=lambda: None,
        )
    if panel_state.freeze:
        st.rerun()  # so that the page uses the recording that the stream has kept


def answer(kept: dict[str, Any], piece: Piece, *, speed: float, max_lag: int | None) -> bytes:
    """Add a piece of sound to the last seconds, which are kept, and return their lag for the panel."""
    listening: Listening | None = kept.get("listening")
    if listening is None or piece.begun != kept["begun"] or piece.rate != listening.sampling_rate:
        listening = Listening(piece.rate)
    listening.add(np.stack([np.frombuffer(part, "<i2") for part in piece.parts]))
    kept |= {"listening": listening, "begun": piece.begun}
    if piece.freeze:
        # A recording of two channels, as if it had been read from a file.
        recording = Recording(np.stack(listening.signals), listening.sampling_rate)
        digest = hashlib.sha256(f"{listening.sampling_rate}".encode() + listening.samples.tobytes()).hexdigest()
        kept["frozen"] = Upload(digest, recording), speed
    heard = listening.measured(speed=speed, max_lag=max_lag)
    sure = not np.isnan(heard.lag_now)
    return packed_item(
        {
            "sure": bool(sure),
            "lag": f"{round(heard.lag_now):,}".replace("-", "−") if sure else "",
            "difference": heard.lag_now / piece.rate * speed if sure else None,
            "said": heard_now_in_words(heard, piece.devices),
            **({"frozen": piece.freeze} if piece.freeze else {}),
        }
    ).data


# The address

MAX_RATE_OR_SPEED = 10**12
"""Limit for a sampling rate, samples per second, and a speed, m/s, in an address."""


def _initial_search(pair: RecordingPair) -> dict[str, LagSearch]:
    known = {"sampling_rate": pair.sampling_rate, "speed": pair.speed}
    return {"": LagSearch(**{name: value for name, value in known.items() if value is not None})}


def lag_key(name: str, pair: RecordingPair) -> str:
    """Return the key of a setting's control; each pair has its own, except for the method."""
    return "lag.method" if name == "method" else f"lag.{name}.{pair.digest}"


def _check_search(search: LagSearch, pair: RecordingPair) -> None:
    """Refuse values that the page's number boxes do not accept, and values too large for figures."""
    if search.max_lag is not None and search.max_lag > pair.longest_lag:
        sentence = f"max_lag is {search.max_lag}; allowed are whole numbers from 0 to {pair.longest_lag} or None."
        raise SettingsError((Problem("max_lag", sentence),))
    for name, value in (("sampling_rate", search.sampling_rate), ("speed", search.speed)):
        low = Bounds.of(LagSearch.model_fields[name]).low
        if low is not None and not low <= value <= MAX_RATE_OR_SPEED:
            sentence = f"{name} is {value!r}; on this page allowed are numbers from {low:g} to {MAX_RATE_OR_SPEED:,}."
            raise SettingsError((Problem(name, sentence),))


LAG_ADDRESS: Address[RecordingPair] = Address(
    "lag.address",
    lambda: {"recordings": example_choice(RECORDINGS, samples.recordings(), LIVE)},
    _initial_search,
    lambda search, pair: adopt_values(search, partial(lag_key, pair=pair)),
    _check_search,
)
