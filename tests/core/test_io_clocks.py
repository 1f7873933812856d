"""Recordings at other rates: nothing is delayed, and the original rate is noted."""

from __future__ import annotations

import numpy as np
import pytest

from stereolag.core.jobs import Limits
from stereolag.io.clocks import Recording
from stereolag.signals import signal_lag


def tones(rate: float, seconds: float, later: float = 0.0) -> np.ndarray:
    """Return the same tones, all below 3 kHz and without a common period, at any rate."""
    random = np.random.default_rng(0)
    time = np.arange(round(rate * seconds)) / rate - later
    tones = zip(random.uniform(100, 3000, 60), random.uniform(0, 6, 60), strict=True)
    return 4.0 + sum(np.sin(2 * np.pi * frequency * time + phase) for frequency, phase in tones)


@pytest.mark.parametrize(("rate", "other"), [(48_000, 44_100), (44_100, 48_000), (16_000, 8_000), (8_000, 44_100)])
def test_the_same_sound_at_another_rate_comes_out(rate: int, other: int) -> None:
    channels = np.stack([tones(rate, 0.5), -tones(rate, 0.5)])
    resampled = Recording(channels, float(rate), mended_lines=2).resampled(float(other))
    assert (resampled.sampling_rate, resampled.resampled_from, resampled.mended_lines) == (other, rate, 2)
    expected = tones(other, 0.5)
    inside = slice(300, -300)
    for channel, sign in zip(resampled.channels, (1, -1), strict=True):
        assert abs(channel.size - expected.size) <= 1
        assert np.abs(sign * channel[: expected.size] - expected)[inside].max() < 0.02 * np.std(expected)


def test_the_lag_between_recordings_of_two_rates_is_that_of_the_event() -> None:
    first = Recording(tones(48_000, 1.0)[np.newaxis], 48_000.0).resampled(44_100.0)
    second = Recording(tones(44_100, 1.0, later=0.01)[np.newaxis], 44_100.0)
    assert signal_lag(first, second).lag == 441


def recorded(rate: float | None, later: float = 0.0) -> Recording:
    return Recording(tones(8_000, 1.0, later)[np.newaxis], rate)


def test_recordings_bring_their_rate_with_them_and_without_one_that_of_audio_is_taken() -> None:
    first, second = recorded(8_000.0), recorded(8_000.0, later=0.1)
    unknown, later = recorded(None), recorded(None, later=0.1)
    assert signal_lag(first, second).lag == 800
    assert signal_lag(first, second, sampling_rate=8_000).time_s == 0.1
    for pair in ((first, second), (first, later), (unknown, second)):
        assert signal_lag(*pair).time_s == 0.1
    for alone in ((unknown, later), (first.channels[0], second.channels[0])):
        assert signal_lag(*alone).time_s == 800 / 44_100


def test_rates_that_contradict_each_other_are_refused() -> None:
    first, second = recorded(8_000.0), recorded(8_000.0, later=0.1)
    with pytest.raises(ValueError, match=r"signal_1 has 8,000 Hz and signal_2 16,000 Hz.*at one rate"):
        signal_lag(first, recorded(16_000.0))
    for pair in ((first, second), (first, second.channels[0]), (first.channels[0], second)):
        with pytest.raises(ValueError, match=r"sampling_rate is 44,100 Hz and signal_[12] has 8,000 Hz.*samples alone"):
            signal_lag(*pair, sampling_rate=44_100.0)
    # The rate in the file may be wrong: samples alone are taken at the given rate.
    assert signal_lag(first.channels[0], second.channels[0], sampling_rate=1000).time_s == 0.8


def test_a_recording_of_that_rate_stays_as_it_is_and_what_cannot_be_resampled_is_refused(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    recording = Recording(np.ones((1, 600_000)), 8_000.0)
    assert recording.resampled(8_000.0) is recording
    assert recording.resampled_from is None
    with pytest.raises(ValueError, match="states no sampling rate, so it cannot be resampled to 8000 Hz"):
        Recording(recording.channels, None).resampled(8_000.0)
    with pytest.raises(ValueError, match=r"sampling_rate is 0.0 Hz; it must be a positive"):
        recording.resampled(0.0)
    with pytest.raises(ValueError, match=r"their ratio is \d+ : \d+, and numbers up to 100,000 are allowed"):
        recording.resampled(8_000.024)
    monkeypatch.setattr("stereolag.io.clocks.limits", lambda: Limits(max_megasamples=1))
    with pytest.raises(ValueError, match="holds 1 × 1200000 samples; at most 1,000,000"):
        recording.resampled(16_000.0)


def test_rates_without_a_simple_ratio_are_brought_together_where_that_is_exact_enough() -> None:
    recording = Recording(tones(99.987, 60)[np.newaxis], 99.987).resampled(100.0)
    assert recording.channels.shape[1] == pytest.approx(6000, abs=2)
