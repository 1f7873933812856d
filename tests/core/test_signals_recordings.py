"""Lags of recordings of every kind that users bring: never sure and wrong, mostly sure and right."""

from __future__ import annotations

import pytest

from benchmarks.recordings import KINDS, trial
from benchmarks.verdict import judged
from stereolag import signal_lag

SEED = 7004
"""Beyond those of the tables, which tell how often a lag is sure and right; its recordings are short."""


def test_a_lag_is_never_sure_and_wrong_and_mostly_sure_and_right() -> None:
    outcomes = [judged(kind, SEED) for kind in KINDS]
    assert not [(one.kind, one.lag, one.truth) for one in outcomes if one.wrong]
    lags = [one for one in outcomes if one.expected == "sure" and one.simple]
    assert len(lags) > len(KINDS) / 2
    assert sum(one.right for one in lags) >= 0.8 * len(lags)


@pytest.mark.parametrize("seed", [910005, 920056])
def test_no_drift_that_is_none_hides_an_inverted_recording(seed: int) -> None:
    assert judged("inverted polarity", seed).verdict == "nothing"


@pytest.mark.parametrize("seed", [940005, 940009])
def test_an_inverted_recording_whose_clock_drifts_is_told(seed: int) -> None:
    recordings = trial("drifting clocks", seed).recordings
    found = signal_lag(recordings[0], -recordings[1])
    assert (found.verdict, found.judgement.reason) == ("nothing", "opposite_sign")
