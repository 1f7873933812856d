"""Lags of recordings of every kind that users bring: never sure and wrong, mostly sure and right."""

from __future__ import annotations

import functools

import pytest

from benchmarks.recordings import KINDS
from benchmarks.verdict import Judged, judged

SEEDS = (7000, 7001)
"""Beyond those of the tables. With one alone, the share that is sure and right is below what is promised by chance."""


@functools.cache
def outcomes(kind: str) -> list[Judged]:
    return [judged(kind, seed) for seed in SEEDS]


@pytest.mark.parametrize("kind", KINDS)
def test_a_lag_is_never_sure_and_wrong(kind: str) -> None:
    assert not [(one.seed, one.lag, one.truth) for one in outcomes(kind) if one.wrong]


def test_most_lags_are_sure_and_right() -> None:
    lags = [one for kind in KINDS for one in outcomes(kind) if one.expected == "sure" and one.simple]
    assert len(lags) > len(KINDS) / 2
    assert sum(one.right for one in lags) >= 0.8 * len(lags)
