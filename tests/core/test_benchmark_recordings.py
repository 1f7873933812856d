"""The recordings of the benchmarks: a lag is judged by all of their truth, and ours is never sure and wrong."""

from types import SimpleNamespace

import numpy as np
import pytest

from benchmarks import verdict
from benchmarks.recordings import KINDS, Piece, Trial, trial
from benchmarks.verdict import judged
from stereolag import signal_lag


def test_a_lag_is_right_where_it_occurs_in_both_recordings() -> None:
    """By a clock 1 % faster from 100 on; 400 samples are missing in recording 2 from the middle on."""
    given = Trial([np.zeros(1000), np.zeros(1000)], 100.0, (100.0,), ppm=1e4, steps=((500.0, -295.0),), tolerance=1.0)
    assert given.lines() == [[Piece(0.0, 500.0, 100.0, 105.0), Piece(500.0, 999.0, -295.0, pytest.approx(-290.01))]]
    assert all(map(given.is_right, (99.0, 106.0, -296.0, -289.1)))
    assert not any(map(given.is_right, (98.9, 106.1, -100.0, -296.1, -289.0)))
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


# Lags of recordings of every kind that users bring.

SEED = 7004
"""Beyond those of the tables, which tell how often a lag is sure and right; its recordings are short."""


def test_a_lag_is_never_sure_and_wrong_and_mostly_sure_and_right_with_its_drift() -> None:
    outcomes = [judged(kind, SEED) for kind in KINDS]
    assert not [(one.kind, one.lag, one.truth) for one in outcomes if one.wrong]
    assert not [one.kind for one in outcomes if one.drift_right is False or one.over_time is False]
    lags = [one for one in outcomes if one.expected == "sure" and one.simple]
    assert len(lags) > len(KINDS) / 2
    right = {one.kind for one in lags if one.right}
    assert len(right) >= 0.8 * len(lags)
    assert {"narrow bands", "random triggers", "clocks far apart"} <= right


@pytest.mark.parametrize("seed", [26, 1152])
def test_no_steps_that_are_none_line_up_two_hearts(seed: int) -> None:
    assert judged("unrelated pulses", seed).verdict != "sure"


@pytest.mark.parametrize("seed", [910005, 920056])
def test_no_drift_that_is_none_hides_an_inverted_recording(seed: int) -> None:
    assert judged("inverted polarity", seed).verdict == "nothing"


def test_calls_are_not_lined_up_with_their_next_cycle() -> None:
    """Two of the narrower lobes are a cycle apart, with about as much evidence."""
    assert judged("calls", 36).right


@pytest.mark.parametrize("seed", [940005, 940009])
def test_an_inverted_recording_whose_clock_drifts_is_told(seed: int) -> None:
    recordings = trial("drifting clocks", seed).recordings
    found = signal_lag(recordings[0], -recordings[1])
    assert (found.verdict, found.judgement.reason) == ("nothing", "opposite_sign")
