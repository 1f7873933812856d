"""Long recordings searched in bands over every lag: the lag and the verdict of one transform of the whole."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy import signal as scipy_signal

from benchmarks.verdict import coloured, common, drifting, noise, tones, unrelated
from stereolag.io.recordings import read_signal
from stereolag.signals import SignalLag, signal_lag
from stereolag.signals.correlation import weighted_pearson_reference
from stereolag.signals.search import CentredRecording, _Bound, band_energies, band_products, band_signals, cell_size


@pytest.fixture
def both_ways(monkeypatch: pytest.MonkeyPatch) -> Callable[..., tuple[SignalLag, SignalLag]]:
    """Return a function that measures a lag from the whole, and as if the recordings were long."""
    monkeypatch.setattr("stereolag.signals.search.LAGS_OF_A_BAND", 20_000)

    def measured(one: Any, other: Any, **given: Any) -> tuple[SignalLag, SignalLag]:
        results = []
        for longest in (2**40, 0):
            monkeypatch.setattr("stereolag.signals.lag.LONGEST_WHOLE", longest)
            results.append(signal_lag(one, other, **given))
        return results[0], results[1]

    return measured


def check(whole: SignalLag, bands: SignalLag) -> None:
    assert whole.judgement is not None and bands.judgement is not None
    assert bands.lag == whole.lag
    assert (bands.verdict, bands.judgement.reason) == (whole.verdict, whole.judgement.reason)
    # Distant rivals are searched for only in a few places.
    assert bands.rivals[:8] == whole.rivals[:8]
    assert bands.score == pytest.approx(whole.score, abs=1e-9)
    assert bands.lag_subsample == pytest.approx(whole.lag_subsample, abs=1e-3)
    assert bands.peak_ratio <= whole.peak_ratio + 1e-9
    assert bands.lags is not None and bands.correlation is not None
    assert np.all(np.diff(bands.lags) > 0)
    assert bands.correlation.max() == pytest.approx(bands.correlation[bands.lags == bands.lag][0])


@pytest.mark.parametrize("colour", [0.0, 0.8, -0.9, 0.98])
@pytest.mark.parametrize("size", [40_000, 120_000])
def test_a_sound_in_noise_as_loud(size: int, colour: float, both_ways: Any) -> None:
    for seed in range(3):
        lag = int(np.random.default_rng(seed).integers(-3 * size // 4, 3 * size // 4))
        whole, bands = both_ways(*common(size, lag, seed, colour=colour))
        check(whole, bands)
        assert (bands.lag, bands.verdict) == (lag, "sure")


def test_nothing_in_the_low_bands(both_ways: Any) -> None:
    one, other = common(100_000, -1234, 7, colour=0.0)
    high = scipy_signal.butter(8, 0.8, "high", output="sos")
    check(*both_ways(*(scipy_signal.sosfilt(high, signal) for signal in (one, other))))


def test_a_hum_that_is_louder_and_has_another_lag(both_ways: Any) -> None:
    one, other = common(100_000, 1234, 7)
    hum = np.sin(np.arange(100_000) * 2 * np.pi * 50 / 44_100)
    check(*both_ways(one + 8 * hum, other + 8 * np.roll(hum, 300)))


def test_a_clip_a_quiet_half_an_offset_and_a_largest_lag(both_ways: Any) -> None:
    one, other = common(100_000, 1234, 7)
    check(*both_ways(one[20_000:23_000], other))
    check(*both_ways(other, one[20_000:23_000]))
    quiet = np.where(np.arange(one.size) < 50_000, one, 0.01 * one)
    check(*both_ways(quiet, other + 1000.0))
    check(*both_ways(one, other, max_lag=40_000))


@pytest.mark.parametrize("noise_level", [0.0, 0.1])
def test_a_tone_has_the_tooth_nearest_to_zero(noise_level: float, both_ways: Any) -> None:
    whole, bands = both_ways(*tones(100_000, 0.0123, noise_level, 1))
    check(whole, bands)
    assert bands.verdict == "ambiguous"


def test_what_repeats_drifts_or_wanders(both_ways: Any) -> None:
    once = np.tile(noise(5000, np.random.default_rng(0)), 20)
    check(*both_ways(once, once + noise(once.size, np.random.default_rng(1))))
    check(*both_ways(*drifting(60_000, 700, 50, 0.5, 3)))
    check(*both_ways(*unrelated("random walks", 100_000, 1)))


def test_the_opposite_is_seen(both_ways: Any) -> None:
    one, other = common(100_000, 100, 1)
    for result in both_ways(one, -other):
        assert (result.verdict, result.judgement.opposite_lag) == ("nothing", 100)


def test_nothing_in_common_is_nothing(both_ways: Any) -> None:
    for seed in range(4):
        _, bands = both_ways(*unrelated("noise and noise", 60_000, seed))
        assert bands.verdict == "nothing"


def test_real_recordings(both_ways: Any, data_dir: Path) -> None:
    pair = [read_signal(data_dir / "signals" / "report" / f"sensor{number}Data.txt") for number in (1, 2)]
    whole, bands = both_ways(*pair)
    check(whole, bands)
    assert bands.lag == 50_082
    for path in sorted((data_dir / "signals" / "respeaker").glob("*.wav")):
        channels = read_signal(path).channels
        for other in channels[1:]:
            check(*both_ways(channels[0], other))


@pytest.mark.parametrize("step", [8, 64])
def test_bands_hold_the_energy_and_their_products_the_correlation(step: int) -> None:
    sound = coloured(100_000, 0.5, np.random.default_rng(0))
    one, other = (CentredRecording(part) for part in (sound[3 * step :], sound[: -3 * step]))
    assert band_energies(one, step).sum() == pytest.approx(one.energy, rel=1e-4)
    bands = range(step // 2)
    signals = [band_signals(recording, bands, step) for recording in (one, other)]
    assert signals[0].shape == (step // 2, -(-one.size // step))
    curve = sum(band_products(first, second) for first, second in zip(*signals, strict=True))
    zero = signals[0].shape[1] - 1
    assert np.argmax(curve.real) == zero + 3
    assert curve[zero + 3].real == pytest.approx(one.energy, rel=0.01)


def test_no_correlation_is_above_its_bound(monkeypatch: pytest.MonkeyPatch) -> None:
    one, other = common(3000, 200, 0)
    given = [signal - signal.mean() for signal in (one, other)]
    bound = _Bound(*(CentredRecording(signal) for signal in given), 2999, 8)
    parts = [band_signals(CentredRecording(signal), range(4), 8) for signal in given]
    for band, first, second in zip(range(4), *parts, strict=True):
        bound.add(band, first, second)
    lags = np.arange(-1500, 1501)
    cells = lags // 8 - bound.first
    measured = weighted_pearson_reference(*given, lags)
    # The bound is a little low at the ends of blocks, and for lags between two lags of a band.
    assert np.all(np.abs(measured) <= 1.2 * bound.weighted()[cells] + 0.02)


def test_whoever_hears_the_progress_can_end_it_anywhere(both_ways: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("stereolag.core.jobs.time.monotonic", iter(range(10**6)).__next__)
    told: list[float] = []
    whole, bands = both_ways(*common(60_000, 700, 0), progress=told.append)
    check(whole, bands)
    assert told == sorted(told[: told.index(1.0) + 1]) + sorted(told[told.index(1.0) + 1 :])
    assert told.count(0.8) > 3  # while it is judged

    def end(done: float) -> None:
        if done >= 0.8:
            raise InterruptedError

    with pytest.raises(InterruptedError):
        both_ways(*common(60_000, 700, 0), progress=lambda done: end(done % 1.0))


def test_cells_are_powers_of_two() -> None:
    assert [cell_size(size, size) for size in (10**6, 12_000_000, 12_000_001, 158_760_000)] == [8, 8, 16, 128]
