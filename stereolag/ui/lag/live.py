"""Microphones heard live: the lag of the last two seconds, and a recording that is frozen from it."""

from __future__ import annotations

import hashlib
from dataclasses import dataclass
from typing import Any

import numpy as np
import streamlit as st

from stereolag.core.searches import LagSearch
from stereolag.io.clocks import Recording
from stereolag.signals.listening import Heard, Listening
from stereolag.ui.components import component, packed_item
from stereolag.ui.controls import control
from stereolag.ui.lag import COLOURS
from stereolag.ui.lag.sentences import LISTENING_WORDS, heard_now_in_words
from stereolag.ui.navigation import HALF_WIDTH, fragment
from stereolag.ui.streams import Message, open_stream
from stereolag.ui.uploads import Upload

RATES = (3_000, 384_000)
"""Lowest and highest sampling rate of a browser's audio, samples per second."""

_listening = component("listening")


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
    begun: object = None
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
    with settings.container(width=HALF_WIDTH):
        speed = control(LagSearch, "speed", key="lag.live.speed")
    with settings.container(width=HALF_WIDTH):
        max_lag = control(LagSearch, "max_lag", key="lag.live.max", when_empty="every lag")
    ear = ear_of_visitor()
    stream = open_stream("lag", lambda message: answer(ear, message, speed=speed, max_lag=max_lag))
    address = stream.address()
    with panel:
        found = _listening(
            key="lag.live",
            data=address | {"words": address["words"] | LISTENING_WORDS, "colours": COLOURS},
            on_freeze_change=lambda: None,
        )
    if found.freeze:
        st.rerun()  # the page now has the recording that the ear keeps


def answer(ear: Ear, message: Message, *, speed: float, max_lag: int | None) -> bytes:
    """Add a piece of sound to what was heard, and return what the panel shows of it.

    Raises
    ------
    ValueError
        A message without a piece of two channels.
    """
    rate, devices, begun, freeze = (message.header.get(name) for name in ("rate", "devices", "begun", "freeze"))
    sizes = {len(part) for part in message.parts}
    if isinstance(rate, bool) or not isinstance(rate, int | float) or not RATES[0] <= rate <= RATES[1]:
        raise ValueError(f"The sampling rate is {rate!r} Hz; it must be from {RATES[0]:,} to {RATES[1]:,} Hz.")
    if len(message.parts) != 2 or len(sizes) != 1 or sizes.pop() % 2:
        raise ValueError("A piece of sound must have two channels of as many samples of 16 bits.")
    listening = ear.listening
    if listening is None or begun != ear.begun or rate != listening.sampling_rate:
        listening = Listening(rate)
    listening.add(np.stack([np.frombuffer(part, "<i2") for part in message.parts]))
    ear.listening, ear.begun = listening, begun
    if freeze:
        ear.frozen = Frozen(frozen(listening), speed)
    heard = listening.measured(speed=speed, max_lag=max_lag)
    shown = _shown(heard, rate, speed, 2 if devices == 2 else 1)
    return packed_item(shown | ({"frozen": freeze} if freeze else {})).data


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
