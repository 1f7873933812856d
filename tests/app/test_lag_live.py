"""Microphones heard live on the lag page: what is said of each piece, what is refused, and what is frozen."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest
from streamlit.testing.v1 import AppTest

from benchmarks.verdict import drifting, unrelated
from stereolag.ui.lag.inputs import Piece, answer
from tests.app.pages import LAG, address, lag_found
from tests.packed import unpacked

RATE = 16_000
Sounds = npt.NDArray[np.int16]


def sounds(first: npt.ArrayLike, second: npt.ArrayLike) -> Sounds:
    both = np.stack([first, second])
    return np.asarray(8000 * both / np.abs(both).max(), dtype=np.int16)


DRIFTING = sounds(*drifting(2 * RATE, 40, 150, 0.2, 3))
STEADY = sounds(*drifting(2 * RATE, 40, 0, 0.2, 3))


def told(piece: Sounds, *, devices: int = 1, kept: dict[str, Any] | None = None, **header: Any) -> dict[str, Any]:
    """Return what the panel is told after a piece."""
    parts = tuple(one.tobytes() for one in piece)
    message = Piece.model_validate({"rate": RATE, "devices": devices, "begun": 1, "parts": parts} | header)
    return unpacked(answer({} if kept is None else kept, message, speed=340.0, max_lag=None))[0]


def test_a_sure_lag_has_metres_only_from_one_device_and_while_it_stays() -> None:
    steady = told(STEADY)
    assert (steady["sure"], steady["lag"], steady["difference"]) == (True, "40", pytest.approx(0.85, abs=0.01))
    assert "its path is 0.85\N{NO-BREAK SPACE}m longer" in steady["said"]
    assert told(DRIFTING)["said"] == "The source moves: the lag was 40 samples and is 45 now."
    assert told(STEADY[::-1])["lag"] == "−40"
    two, apart = told(STEADY, devices=2)["said"], told(DRIFTING, devices=2)["said"]
    assert two.startswith("Sensor 2 hears it 40.0 samples later. Two devices start at different moments")
    assert "at the start, 45 at the end (+1" in apart
    assert apart.endswith("Two devices have two clocks, and these run apart.")


def test_without_a_sure_lag_it_is_said_why() -> None:
    sound, silence = STEADY[0], np.zeros_like(STEADY[0])
    for piece, said in (
        (np.stack([silence, silence]), "It is quiet"),
        (np.stack([sound, silence]), "Only sensor 1 hears something: sensor 2 is silent."),
        (np.stack([sound, sound]), "One channel only"),
        (STEADY[:, :100], "Listening …"),
        (sounds(*unrelated("noise and noise", RATE, 0)), "Nothing in common found"),
    ):
        found = told(piece)
        assert found["said"].startswith(said)
        assert (found["sure"], found["lag"], found["difference"]) == (False, "", None)


def test_microphones_switched_on_anew_begin_anew() -> None:
    kept: dict[str, Any] = {}
    for begun, count in ((1, 1000), (1, 2000), (2, 1000)):
        told(STEADY[:, :1000], kept=kept, begun=begun)
        assert kept["listening"].samples.shape == (2, count)


def test_what_is_frozen_becomes_the_recordings_of_the_page(open_page: Callable[..., AppTest]) -> None:
    app = open_page(LAG, {"recordings": "live"})
    assert not app.header
    assert address(app) == {"recordings": "live"}
    kept = app.session_state["live.lag"].kept
    assert "frozen" not in told(STEADY, kept=kept)
    assert "frozen" not in kept
    assert told(STEADY, kept=kept, freeze=7)["frozen"] == 7
    told(STEADY[:, ::-1], kept=kept)  # what is heard before the page runs again is no part of it
    app.run()
    assert lag_found(app) == 40
    assert app.tabs[-1].label == "Take away"
    assert "32,000 samples, 16,000 Hz, channel 2 of 2" in "\n".join(one.value for one in app.caption).replace(
        "\xa0", " "
    )
    digest = kept["frozen"].file.digest
    assert app.number_input(key=f"lag.speed.{digest} 1 {digest} 2").value == 340
    app.number_input(key=f"lag.max_lag.{digest} 1 {digest} 2").set_value(100).run()
    assert address(app) == {"recordings": "live", "max_lag": "100"}
    told(np.zeros_like(STEADY), kept=kept, begun=2, freeze=8)
    app.run()
    assert "is constant" in app.error[0].value
    assert lag_found(app) == 40
