"""Microphones heard live: the lag of the last two seconds, and a recording that is frozen from it."""

from __future__ import annotations

import hashlib
from dataclasses import dataclass
from typing import Any, Literal, Self

import numpy as np
import streamlit as st
from pydantic import Field, model_validator

from stereolag.core.searches import LagSearch
from stereolag.io.clocks import Recording
from stereolag.signals.listening import Heard, Listening
from stereolag.ui.components import component, packed_item
from stereolag.ui.controls import control
from stereolag.ui.lag.sentences import COLOURS, LISTENING_WORDS, heard_now_in_words
from stereolag.ui.navigation import fragment
from stereolag.ui.streams import Message, Whole, connected, open_stream
from stereolag.ui.uploads import Upload

_listening = component("listening")

SETTING_WIDTH = 170
"""Width of a setting below the panel, px: its title fits into one line, and both into the width of a phone."""


class Piece(Message):
    """A piece of sound: as many samples of 16 bits of each of two channels.

    Attributes
    ----------
    rate
        Samples per second.
    devices
        Number of devices that the channels come from.
    begun
        Identifies when they were switched on.
    freeze
        Identifies the request that what is heard now be kept, if there is one.
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
            raise ValueError("Both channels must have as many samples of 16 bits.")
        return self


@dataclass(frozen=True)
class Frozen:
    """A recording of two channels as if from a file, and the speed of the wave that the visitor set, m/s."""

    file: Upload[Recording]
    speed: float


@dataclass
class Ear:
    """What is heard of one visitor's microphones.

    Attributes
    ----------
    listening
        The last seconds.
    begun
        Identifies when the microphones were switched on.
    frozen
        What was heard when the visitor asked for it to be kept, and the speed of the wave then.
    """

    listening: Listening | None = None
    begun: int | None = None
    frozen: Frozen | None = None


def listen() -> Frozen | None:
    """Draw the panel that listens, and return the two seconds that were frozen last, if any."""
    _panel()
    return ear_of_visitor().frozen


def ear_of_visitor() -> Ear:
    """Return what is heard of the microphones of this session."""
    ear: Ear = st.session_state.setdefault("lag.live.ear", Ear())
    return ear


@fragment
def _panel() -> None:
    panel = st.container()
    settings = st.container(horizontal=True, gap="small")
    with settings.container(width=SETTING_WIDTH):
        speed = control(LagSearch, "speed", key="lag.live.speed")
    with settings.container(width=SETTING_WIDTH):
        max_lag = control(LagSearch, "max_lag", key="lag.live.max", when_empty="every lag")
    ear = ear_of_visitor()
    stream = open_stream("lag", Piece, lambda piece: answer(ear, piece, speed=speed, max_lag=max_lag))
    with panel:
        found = _listening(
            key="lag.live",
            data={**connected(stream, LISTENING_WORDS), "colours": COLOURS},
            on_freeze_change=lambda: None,
        )
    if found.freeze:
        st.rerun()  # the page now has the recording that the ear keeps


def answer(ear: Ear, piece: Piece, *, speed: float, max_lag: int | None) -> bytes:
    """Add a piece of sound to what was heard, and return what the panel shows of it."""
    listening = ear.listening
    if listening is None or piece.begun != ear.begun or piece.rate != listening.sampling_rate:
        listening = Listening(piece.rate)
    listening.add(np.stack([np.frombuffer(part, "<i2") for part in piece.parts]))
    ear.listening, ear.begun = listening, piece.begun
    if piece.freeze:
        ear.frozen = Frozen(frozen(listening), speed)
    heard = listening.measured(speed=speed, max_lag=max_lag)
    shown = _shown(heard, piece.rate, speed, piece.devices)
    return packed_item(shown | ({"frozen": piece.freeze} if piece.freeze else {})).data


def _shown(heard: Heard, rate: float, speed: float, devices: int) -> dict[str, Any]:
    lag = heard.lag_now
    sure = not np.isnan(lag)
    return {
        "sure": bool(sure),
        "lag": f"{round(lag):,}".replace("-", "−") if sure else "",
        "difference": lag / rate * speed if sure else None,
        "said": heard_now_in_words(heard, devices),
    }


def frozen(listening: Listening) -> Upload[Recording]:
    """Return what is kept as a recording of two channels, as if it had been read from a file."""
    recording = Recording(np.stack(listening.signals), listening.sampling_rate)
    digest = hashlib.sha256(f"{listening.sampling_rate}".encode() + listening.samples.tobytes()).hexdigest()
    return Upload(digest, recording)
