"""A verdict on a lag in words, with metres only if it is sure."""

from __future__ import annotations

import numpy as np

from benchmarks.verdict import coloured, common, drifting, tones, unrelated
from stereolag.signals import signal_lag
from stereolag.ui.lag.sentences import lag_in_words, verdict_explained, verdict_in_words


def test_a_sure_lag_is_said_with_its_metres() -> None:
    result = signal_lag(*common(20_000, 441, 0, colour=0.0))
    assert (
        verdict_in_words(result)
        == lag_in_words(result)
        == "Sensor 2 hears it **0.01 s** after sensor 1: its path is **3.33 m** longer."
    )
    (said,) = verdict_explained(result, 44_100.0, 333.0)
    assert said.startswith("Over 16 blocks the lag varies by ± 0.0") and said.endswith("m of path.")


def test_a_tone_repeats_and_has_no_metres() -> None:
    for frequency, period in ((0.01, "100"), (0.1234, "8.1")):
        said = verdict_in_words(signal_lag(*tones(6000, frequency, 0.0, 0)))
        assert said == f"Cannot tell: it repeats every **{period} samples**."


def test_lags_that_fit_as_well_are_listed_in_order_and_not_all_of_them() -> None:
    result = signal_lag(*tones(6000, 0.01, 0.0, 0))
    (said,) = verdict_explained(result, 44_100.0, 333.0)
    listed = sorted((result.lag, *result.rivals))[:5]
    assert said.startswith("The lags " + "; ".join(f"{lag:,}" for lag in listed) + " and 12 more fit about")


def test_one_rival_is_counted() -> None:
    random = np.random.default_rng(5)
    clip = random.normal(size=3000)
    long = np.concatenate((clip, random.normal(size=5000), clip))
    assert verdict_in_words(signal_lag(clip, long)) == "Cannot tell: **1 other lag fits** as well."


def test_nothing_in_common_has_no_metres() -> None:
    result = signal_lag(*unrelated("noise and noise", 3000, 0))
    assert verdict_in_words(result) == "Nothing in common found: the highest point is at chance level."
    assert verdict_explained(result, 44_100.0, 333.0)[0].startswith("Use a longer stretch")
    voted = signal_lag(*unrelated("noise and noise", 10_000, 0), method="sampled", seed=0)
    assert verdict_in_words(voted).startswith("Nothing in common found: ")


def test_a_reversed_microphone_is_named_with_its_lag() -> None:
    whole = coloured(6000, 0.8, np.random.default_rng(4))
    result = signal_lag(whole[1000:5000], -whole[:4000])
    assert "the opposite sign fits" in verdict_in_words(result)
    (said,) = verdict_explained(result, 44_100.0, 333.0)
    assert said.startswith("With its sign reversed, recording 2 fits at 1,000 samples: ")


def test_a_drift_is_named_in_ppm() -> None:
    result = signal_lag(*drifting(150_000, 400, 50.0, 0.0, 1), max_lag=2000)
    assert verdict_explained(result, 44_100.0, 333.0)[0].startswith("The clocks differ by **+50.0 ppm** (± ")
