"""The recordings of the benchmarks: their truth is where they agree, and a lag is judged by all of it."""

from __future__ import annotations

from collections.abc import Iterator
from types import SimpleNamespace

import numpy as np
import pytest
from scipy import fft

from benchmarks import verdict
from benchmarks.recordings import KINDS, Piece, Trial, trial

REACH = 300
"""Samples on either side of the true lag within which the recordings could agree better."""

AT_TWO_LAGS = ("common noise", "louder echo")


def errors(given: Trial) -> Iterator[float]:
    """Yield, for each piece of each true line, how far from it the recordings agree best, samples."""
    one, other = given.recordings
    for line in given.lines():
        for piece in line:
            places = np.arange(int(np.ceil(piece.first)), int(piece.last) + 1)
            lags = np.interp(places, (piece.first, piece.last), (piece.lag_first, piece.lag_last))
            here, there = one[places], np.interp(places + lags, np.arange(other.size), other)
            points = fft.next_fast_len(places.size + REACH, real=True)
            spectrum = np.conj(fft.rfft(here - here.mean(), points)) * fft.rfft(there - there.mean(), points)
            away = []
            for weighted in (spectrum, spectrum / (np.abs(spectrum) + 1e-30)):
                curve = fft.irfft(weighted, points)
                curve *= np.sign(curve[0])  # one of them may be inverted
                away.append(int(np.argmax(np.concatenate([curve[-REACH:], curve[: REACH + 1]]))) - REACH)
            yield min(away, key=abs)


@pytest.mark.parametrize("kind", KINDS)
def test_recordings_agree_best_at_their_true_lags(kind: str) -> None:
    pairs = [trial(kind, 1)]
    assert all(np.isfinite(one).all() and np.ptp(one) > 0 for pair in pairs for one in pair.recordings)
    assert all((pair.expected == "nothing") <= (not pair.lags) for pair in pairs)
    assert all(all(pair.lines()) for pair in pairs), "no overlap"
    right = [abs(error) <= pair.tolerance for pair in pairs for error in errors(pair)]
    # Near one of two true lags, the recordings may agree better at the other.
    assert not right or np.mean(right) >= (0.5 if kind in AT_TWO_LAGS else 0.9)


def test_a_pair_is_drawn_from_its_kind_and_seed() -> None:
    first, again, other = (trial("short", seed) for seed in (5, 5, 6))
    np.testing.assert_array_equal(first.recordings[0], again.recordings[0])
    assert first.lags == again.lags != other.lags


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
