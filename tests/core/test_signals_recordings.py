"""Lags of recordings of every kind that users bring: never sure and wrong, mostly sure and right."""

from __future__ import annotations

from functools import cache

import pytest

from benchmarks.recordings import KINDS
from benchmarks.verdict import Judged, judged

SEED = 7000
"""Beyond those of the tables, which `make bench` makes of many seeds."""


@cache
def outcome(kind: str) -> Judged:
    return judged(kind, SEED)


@pytest.mark.parametrize("kind", KINDS)
def test_a_lag_is_never_sure_and_wrong(kind: str) -> None:
    """Where the benchmarks' truth were wrong, nearly every lag would be."""
    assert not outcome(kind).wrong, (outcome(kind).lag, outcome(kind).truth)


def test_most_lags_are_sure_and_right() -> None:
    lags = [one for one in map(outcome, KINDS) if one.expected == "sure" and one.simple]
    assert len(lags) > len(KINDS) / 4
    assert sum(one.right for one in lags) >= 0.8 * len(lags)
