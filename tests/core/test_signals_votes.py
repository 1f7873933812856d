"""Voting by random samples: its robustness to noise, gain and repetition, and its report."""

from __future__ import annotations

import numpy as np
import pytest
from scipy import signal as scipy_signal

from stereolag.signals import signal_lag
from stereolag.signals.correlation import running_sums
from stereolag.signals.sampling import best_matches

LAG = 3210


def recordings(noise_db: float | None, seed: int = 0, size: int = 20_000) -> tuple[np.ndarray, np.ndarray]:
    random = np.random.default_rng(seed)
    whole = scipy_signal.lfilter([1.0], [1.0, -0.9], random.normal(size=size + LAG))
    level = 0.0 if noise_db is None else 10 ** (noise_db / 20) * whole.std()
    first, second = (part + level * random.normal(size=size) for part in (whole[LAG:], whole[:size]))
    return first, second


@pytest.mark.parametrize("noise_db", [None, -50, -30, -20, -10])
def test_sensor_noise_down_to_10_db_below_the_sound_is_survived(noise_db: float | None) -> None:
    first, second = recordings(noise_db)
    for seed in range(20):
        assert signal_lag(first, second, method="sampled", seed=seed).lag == LAG
    for seed in range(5):
        assert signal_lag(second, first, method="sampled", seed=seed).lag == -LAG


def test_gain_and_offset_do_not_hide_the_values() -> None:
    first, second = recordings(-30)
    assert signal_lag(first, 0.05 * second + 7.0, method="sampled", seed=0).lag == LAG


def test_coarse_integers_have_many_equal_values() -> None:
    first, second = (np.round(signal * 4).astype(np.int8) for signal in recordings(None))
    assert np.unique(first).size < 100
    assert signal_lag(first, second, method="sampled", seed=0).lag == LAG


def test_votes_are_a_histogram_with_the_winner_first() -> None:
    result = signal_lag(*recordings(-10), method="sampled", seed=0)
    assert result.votes is not None
    assert result.lags is None and result.correlation is None
    counts = list(result.votes.values())
    assert next(iter(result.votes)) == LAG
    assert counts == sorted(counts, reverse=True)
    rivals = [count for lag, count in result.votes.items() if abs(lag - LAG) > 1]
    assert result.peak_ratio == counts[0] / max(rivals)
    assert all(type(lag) is int and type(count) is int for lag, count in result.votes.items())


def test_a_seed_repeats_its_votes() -> None:
    first, second = recordings(-20)
    runs = [signal_lag(first, second, method="sampled", seed=seed).votes for seed in (4, 4, 5)]
    assert runs[0] == runs[1] != runs[2]


def test_a_passage_that_repeats_is_outvoted() -> None:
    first, second = recordings(-40)
    second[12_000:16_000] = second[6_000:10_000]
    assert signal_lag(first, second, method="sampled", seed=0).lag == LAG


def test_recordings_that_have_nothing_within_max_lag_are_refused() -> None:
    first = np.zeros(5000)
    second = np.zeros(5000)
    first[:200] = second[4000:4200] = np.random.default_rng(0).normal(size=200)
    assert signal_lag(first, second, method="sampled", seed=0).lag == 4000
    with pytest.raises(ValueError, match="no sample of signal_1 is found within ±5 samples"):
        signal_lag(first, second, method="sampled", seed=0, max_lag=5)


def test_a_drift_without_sound_has_no_slices_to_look_up() -> None:
    drift = np.linspace(0.0, 1.0, 1_000_000)
    with pytest.raises(ValueError, match="use the method 'fft'"):
        signal_lag(drift, drift, method="sampled", seed=0)
    assert signal_lag(drift, drift).lag == 0


def test_the_best_match_is_that_of_the_plain_formula() -> None:
    random = np.random.default_rng(1)
    first, second = random.normal(size=400), random.normal(size=600)
    length, starts = 30, np.array([0, 100, 370])
    candidates = np.array([random.permutation(571)[:80] for _ in starts])
    slices = np.lib.stride_tricks.sliding_window_view(first, length)[starts]
    slices = slices - slices.mean(axis=1, keepdims=True)
    slices /= np.linalg.norm(slices, axis=1, keepdims=True)
    windows = np.lib.stride_tricks.sliding_window_view(second, length)
    scales = 1 / np.linalg.norm(windows - windows.mean(axis=1, keepdims=True), axis=1)
    lags, scores = best_matches(slices, starts, second, scales, candidates, 600)

    def pearson(start_1: int, start_2: int) -> float:
        return float(np.corrcoef(first[start_1 : start_1 + length], second[start_2 : start_2 + length])[0, 1])

    for start, row, lag, score in zip(starts, candidates, lags, scores, strict=True):
        best = max(pearson(start, int(place)) for place in row)
        assert score == pytest.approx(pearson(start, start + lag))
        # It may have climbed from the best candidate, but never falls below it.
        assert score >= best - 1e-9


def test_running_sums_are_cumulative_sums() -> None:
    signal = np.random.default_rng(2).normal(size=100)
    sums, squares = running_sums(signal)
    np.testing.assert_allclose(sums, np.r_[0, np.cumsum(signal)])
    np.testing.assert_allclose(squares, np.r_[0, np.cumsum(signal**2)])
