"""The recordings of the benchmarks: a lag is judged by all of their truth (which `test_signals_recordings` holds)."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

from benchmarks import verdict
from benchmarks.recordings import Piece, Trial, trial


def test_a_lag_is_right_where_it_occurs_in_both_recordings() -> None:
    """By a clock 1 % faster from 100 on; 400 samples are missing in recording 2 from the middle on."""
    given = Trial([np.zeros(1000), np.zeros(1000)], 100.0, (100.0,), ppm=1e4, steps=((500.0, -295.0),), tolerance=1.0)
    assert given.lines() == [[Piece(0.0, 500.0, 100.0, 105.0), Piece(500.0, 999.0, -295.0, pytest.approx(-290.01))]]
    assert [
        lag for lag in (98.9, 99.0, 106.0, 106.1, -100.0, -296.1, -296.0, -289.1, -289.0) if given.is_right(lag)
    ] == [
        99.0,
        106.0,
        -296.0,
        -289.1,
    ]
    assert given.is_right_over_time(lambda seconds: (100.5 if seconds < 5 else -299.5) + seconds)
    assert not given.is_right_over_time(lambda seconds: 100 + seconds)
    assert given.is_right_drift(10_200) and not given.is_right_drift(10_300)
    # Of 1,000 samples lagging by 995, only the first five are in recording 2: the growth after them is not heard.
    late = Trial([np.zeros(1000), np.zeros(1000)], 100.0, (995.0,), ppm=1e4, tolerance=0.0)
    assert late.is_right(995.03) and not late.is_right(995.05)


def test_a_sure_answer_names_the_direct_sound_beside_its_echo() -> None:
    given = Trial([np.zeros(900)] * 2, 1.0, (3.0, 700.0), "any", named=(3.0,))
    assert given.is_right(700.0) and given.names_all((700, 4)) and not given.names_all((700,))


@pytest.mark.parametrize(
    ("kind", "said", "away", "named", "counted"),
    [
        ("rooms", "sure", 0, (), "right"),
        ("rooms", "sure", 500, (), "wrong"),
        ("rooms", "ambiguous", 500, (), ""),
        ("tones", "sure", 0, (), "wrong"),
        ("one hum", "sure", 0, (), "wrong"),
        ("louder echo", "sure", 0, ("direct",), "right"),
        ("louder echo", "sure", 0, (), "wrong"),
    ],
)
def test_sure_is_wrong_of_another_lag_of_none_and_without_those_to_be_named(
    kind: str, said: str, away: float, named: tuple[str, ...], counted: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    given = trial(kind, 0)
    lag = (given.lags or (0.0,))[-1] + away
    arrivals = [(given.lags[0], 12.0)] if named else []
    found = SimpleNamespace(verdict=said, lag_subsample=lag, rivals=(), arrivals=arrivals, drift_ppm=0.0)
    monkeypatch.setattr(verdict, "signal_lag", lambda *_, **__: found)
    (one,) = verdict.judged_trials([kind], [0], "fft", 1)
    assert (one.right, one.wrong) == (counted == "right", counted == "wrong")
    table, _ = verdict.recordings_table([kind], trials=1)
    assert (f"- {kind}, seed 0: sure of {lag:.2f}" in table) == (counted == "wrong")
