from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

from stereolag.core.jobs import Estimate
from stereolag.core.typography import typeset
from stereolag.signals import SignalLag
from stereolag.ui.lag.sentences import lag_in_words
from stereolag.ui.results import RecentResults, SharedRoom, computed, computed_at_once
from stereolag.ui.sentences import duration


def of_bytes(count: int) -> SimpleNamespace:
    return SimpleNamespace(array=np.zeros(count, dtype=np.uint8))


def test_results_used_longest_ago_are_forgotten_first() -> None:
    results = RecentResults(max_bytes=300)
    for name in "abc":
        results.put(name, of_bytes(100))
    assert results.get("a") is not None
    results.put("d", of_bytes(100))
    assert [results.get(name) is not None for name in "abcd"] == [True, False, True, True]


def test_the_newest_result_is_kept_whatever_its_size() -> None:
    results = RecentResults(max_bytes=10)
    results.put("small", of_bytes(5))
    results.put("large", of_bytes(500))
    assert results.get("small") is None
    assert results.get("large") is not None


def test_the_size_is_that_of_what_is_kept() -> None:
    results = RecentResults(max_bytes=300)
    for name, count in {"a": 100, "b": 150, "c": 20}.items():
        results.put(name, of_bytes(count))
    results.put("b", of_bytes(50))
    assert results.size == 170
    results.put("d", of_bytes(200))
    assert results.size == 270  # without "a"


def test_more_visitors_have_less_room_each() -> None:
    room = SharedRoom(max_bytes=400, most_each=300)
    visitors = [room.results() for _ in range(4)]
    for visitor in visitors:
        for name in "abc":
            visitor.put(name, of_bytes(100))
            room.tidy()
    assert sum(visitor.size for visitor in visitors) <= 400
    assert all(visitor.get("c") is not None for visitor in visitors)


def test_who_has_left_takes_no_room() -> None:
    room = SharedRoom(max_bytes=400, most_each=300)
    gone = room.results()
    gone.put("a", of_bytes(300))
    del gone
    results = room.results()
    for name in "abc":
        results.put(name, of_bytes(100))
        room.tidy()
    assert results.size == 300


def test_what_was_computed_is_not_computed_again() -> None:
    calls = []

    def compute(progress: object) -> SimpleNamespace:
        calls.append(progress)
        return of_bytes(1)

    for settings in ("one", "two", "one"):
        computed("counting", compute, inputs="inputs", settings=settings, shared=True, label="Computing …")
    assert len(calls) == 2


def test_only_what_is_short_is_computed_at_once() -> None:
    def at_once(seconds: float) -> SimpleNamespace | None:
        return computed_at_once(
            "pausing",
            lambda progress: of_bytes(1),
            Estimate(1, seconds),
            inputs="inputs",
            settings="",
            shared=True,
        )

    assert at_once(seconds=2.0) is None
    made = at_once(seconds=0.1)
    assert made is not None
    assert at_once(seconds=2.0) is made  # in memory


def test_a_refusal_is_not_kept() -> None:
    def refuse(progress: object) -> SimpleNamespace:
        raise ValueError("no")

    for _ in range(2):
        with pytest.raises(ValueError, match="no"):
            computed("refusing", refuse, inputs="inputs", settings="", shared=True, label="Computing …")


@pytest.mark.parametrize(
    ("lag", "said"),
    [
        (50_082, "Sensor 2 hears it **1.136 s** after sensor 1: its path is **378.17 m** longer."),
        (-50_082, "Sensor 1 hears it **1.136 s** after sensor 2: its path is **378.17 m** longer."),
        (0, "Both sensors hear it **at the same time**: neither is nearer to it."),
    ],
)
def test_the_sentence_names_the_later_sensor(lag: int, said: str) -> None:
    time_s = lag / 44_100
    result = SignalLag(lag, lag, time_s, abs(time_s) * 333, 1.0, 1.0, 1, None, None, None, 0.0)
    assert lag_in_words(result) == said


def test_durations_have_the_unit_that_suits_them() -> None:
    assert [duration(seconds) for seconds in (0.0171, 0.9, 1.28, 111)] == [
        *map(typeset, ("17 ms", "900 ms", "1.28 s", "111.00 s"))
    ]
