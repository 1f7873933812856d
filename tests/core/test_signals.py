"""`signal_lag`: known delays recovered by every method, the traps of correlation, and refusals."""

from __future__ import annotations

import dataclasses
from typing import Any, get_args

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy import signal as scipy_signal

from stereolag.signals import SignalLag, SignalMethod, signal_lag

METHODS = get_args(SignalMethod)
CURVE_METHODS = ("fft", "phat", "direct")


def scene(size: int, seed: int = 0) -> np.ndarray:
    """Return sound that never repeats: noise with more low than high frequencies, as in recordings."""
    noise = np.random.default_rng(seed).normal(size=size + 50)
    return scipy_signal.lfilter([1.0], [1.0, -0.8], noise)[50:]


def pair(size: int, lag: int, seed: int = 0) -> tuple[np.ndarray, np.ndarray]:
    """Return two windows of one scene; the event is `lag` samples later in the second."""
    whole = scene(size + abs(lag), seed)
    late = whole[:size]
    early = whole[abs(lag) :]
    return (early, late) if lag >= 0 else (late, early)


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("lag", [0, 1, -1, 37, -240, 700, -700])
def test_a_known_lag_is_recovered(method: SignalMethod, lag: int) -> None:
    first, second = pair(1000, lag)
    result = signal_lag(first, second, sampling_rate=1000.0, speed=340.0, method=method, seed=1)
    assert result.lag == lag
    assert result.lag_subsample == pytest.approx(lag, abs=0.1)
    assert result.score == pytest.approx(1.0)
    assert result.time_s == lag / 1000.0
    assert result.distance_m == pytest.approx(abs(lag) / 1000.0 * 340.0)
    assert result.elapsed_s > 0
    assert isinstance(result.lag, int)


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("dtype", [np.uint8, np.int8, np.int16, np.uint16, np.int64, np.float32, np.float64])
def test_every_number_type_gives_the_same_lag(method: SignalMethod, dtype: Any) -> None:
    first, second = (
        np.round(signal * 20 + 128 * np.issubdtype(dtype, np.unsignedinteger)) for signal in pair(800, 123)
    )
    limits = (np.iinfo(dtype).min, np.iinfo(dtype).max) if np.issubdtype(dtype, np.integer) else (-1e9, 1e9)
    first, second = (np.clip(signal, *limits).astype(dtype) for signal in (first, second))
    assert signal_lag(first, second, method=method, seed=0).lag == 123


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("start", [0, 250, 1800])
def test_a_short_clip_is_found_in_a_long_recording(method: SignalMethod, start: int) -> None:
    long = scene(2000)
    clip = long[start : start + 200]
    assert signal_lag(clip, long, method=method, seed=0).lag == start
    assert signal_lag(long, clip, method=method, seed=0).lag == -start


@pytest.mark.parametrize("method", ["fft", "direct", "sampled"])
def test_a_quiet_clip_is_found_beside_a_loud_passage(method: SignalMethod) -> None:
    long = scene(3000)
    clip = long[500:800].copy()
    long[1500:2500] *= 50.0
    assert signal_lag(clip, long, method=method, seed=0).lag == 500


@pytest.mark.parametrize("method", CURVE_METHODS)
@pytest.mark.parametrize("lag", [700, -900])
def test_noise_as_loud_as_the_sound_is_survived(method: SignalMethod, lag: int) -> None:
    random = np.random.default_rng(3)
    first, second = pair(4000, lag)
    noisy = [signal + signal.std() * random.normal(size=4000) for signal in (first, second)]
    result = signal_lag(*noisy, method=method)
    assert result.lag == lag
    assert result.score == pytest.approx(0.5, abs=0.06)


@pytest.mark.parametrize("method", METHODS)
def test_offset_and_gain_change_nothing(method: SignalMethod) -> None:
    first, second = pair(1500, -333)
    plain = signal_lag(first, second, method=method, seed=0)
    for gain, offset in ((1.0, 5 * first.std()), (1e-8, 1e-4), (1e150, 0.0), (30.0, -1e5)):
        changed = signal_lag(first, gain * second + offset, method=method, seed=0)
        assert changed.lag == plain.lag == -333
        assert changed.score == pytest.approx(plain.score, abs=1e-6)


@pytest.mark.parametrize("method", CURVE_METHODS)
def test_a_negated_copy_is_not_a_match(method: SignalMethod) -> None:
    first, second = pair(2000, 400)
    result = signal_lag(first, -second, method=method)
    assert result.lag != 400
    assert result.score < 0.6
    assert result.lags is not None and result.correlation is not None
    assert result.correlation[np.flatnonzero(result.lags == 400)[0]] < -0.5


@pytest.mark.parametrize("method", ["fft", "direct"])
@pytest.mark.parametrize("lag", [25, -15])
def test_of_a_periodic_pair_the_smallest_lag_wins_and_the_ties_are_counted(method: SignalMethod, lag: int) -> None:
    period = scene(80)
    repeated = np.tile(period, 30)
    result = signal_lag(repeated[:800], np.roll(repeated, lag)[:800], method=method)
    assert result.lag == lag
    # Ties occur every 80 samples to either side, while at least half of the best overlap is left.
    reach = (800 - abs(lag)) / 2
    assert result.ties == sum(
        800 - abs(other) >= reach for other in range(lag - 800, lag + 801, 80) if abs(other) < 800
    )


def test_a_periodic_clip_has_the_smallest_lag_though_others_overlap_more() -> None:
    repeated = np.tile(scene(80), 30)
    result = signal_lag(repeated[10:410], repeated, method="fft")
    assert result.lag == 10
    assert result.ties > 20
    assert signal_lag(repeated, repeated[10:410], method="fft").lag == -10


@pytest.mark.parametrize("method", METHODS)
def test_a_recording_compared_with_itself_answers_zero(method: SignalMethod) -> None:
    result = signal_lag(scene(700), scene(700), method=method, seed=0)
    assert (result.lag, result.ties, result.distance_m) == (0, 1, 0.0)
    assert result.lag_subsample == pytest.approx(0.0, abs=1e-6)


@pytest.mark.parametrize("method", CURVE_METHODS)
def test_a_pulse_in_silence_is_found_however_little_overlaps(method: SignalMethod) -> None:
    first, second = np.zeros(1000), np.zeros(1000)
    first[100:108] = second[850:858] = [1, 4, 9, 5, -3, -2, 1, 0.5]
    assert signal_lag(first, second, method=method).lag == 750


@given(
    size=st.integers(300, 900),
    share=st.floats(-0.55, 0.55),
    seed=st.integers(0, 2**32 - 1),
    method=st.sampled_from(METHODS),
)
@settings(max_examples=60)
def test_any_lag_is_recovered_and_swapping_only_turns_its_sign(
    size: int, share: float, seed: int, method: SignalMethod
) -> None:
    lag = round(size * share)
    first, second = pair(size, lag, seed)
    result = signal_lag(first, second, method=method, seed=seed)
    swapped = signal_lag(second, first, method=method, seed=seed)
    assert result.lag == lag
    assert (swapped.lag, swapped.time_s, swapped.distance_m) == (-lag, -result.time_s, result.distance_m)
    assert swapped.score == pytest.approx(result.score)
    if method != "sampled":
        assert result.lags is not None and swapped.lags is not None
        np.testing.assert_array_equal(swapped.lags, -result.lags[::-1])
        np.testing.assert_allclose(swapped.correlation[::-1], result.correlation, atol=1e-9)  # type: ignore[index]
        assert swapped.lag_subsample == pytest.approx(-result.lag_subsample, abs=1e-6)
        assert swapped.peak_ratio == pytest.approx(result.peak_ratio, rel=1e-6)
        assert swapped.ties == result.ties


@given(
    sizes=st.tuples(st.integers(12, 120), st.integers(12, 120)), seed=st.integers(0, 2**32 - 1), reach=st.floats(0, 1)
)
@settings(max_examples=80)
def test_fft_and_direct_draw_the_curve_of_scipy(sizes: tuple[int, int], seed: int, reach: float) -> None:
    random = np.random.default_rng(seed)
    first, second = random.normal(size=sizes[0]), random.normal(size=sizes[1])
    max_lag = round(reach * (max(sizes) - 1))
    fft, direct = (signal_lag(first, second, method=method, max_lag=max_lag) for method in ("fft", "direct"))
    assert fft.lag == direct.lag and fft.ties == direct.ties
    np.testing.assert_allclose(fft.correlation, direct.correlation, atol=1e-7)

    lags = scipy_signal.correlation_lags(sizes[1], sizes[0])
    within = np.abs(lags) <= max_lag
    np.testing.assert_array_equal(fft.lags, lags[within])
    ones = [np.ones(size) for size in sizes]
    overlap = scipy_signal.correlate(ones[1], ones[0], method="direct")
    products, sums_1, sums_2, squares_1, squares_2 = (
        scipy_signal.correlate(b, a, method="direct")
        for a, b in ((first, second), (first, ones[1]), (ones[0], second), (first**2, ones[1]), (ones[0], second**2))
    )
    energies = (overlap * squares_1 - sums_1**2) * (overlap * squares_2 - sums_2**2)
    # One sample has no correlation; two always give ±1, as exactly as their difference allows.
    sure = within & (overlap > 2)
    pearson = (overlap * products - sums_1 * sums_2)[sure] / np.sqrt(energies[sure])
    expected = pearson * np.sqrt(overlap[sure] / min(sizes))
    np.testing.assert_allclose(fft.correlation[sure[within]], expected, atol=1e-7)  # type: ignore[index]
    assert fft.score == pytest.approx(scipy_pearson(first, second, fft.lag), abs=1e-9)


def scipy_pearson(first: np.ndarray, second: np.ndarray, lag: int) -> float:
    start, stop = max(0, -lag), min(first.size, second.size - lag)
    return float(np.corrcoef(first[start:stop], second[start + lag : stop + lag])[0, 1])


@pytest.mark.parametrize("method", METHODS)
def test_max_lag_limits_what_is_searched(method: SignalMethod) -> None:
    first, second = pair(1000, 300)
    result = signal_lag(first, second, method=method, max_lag=300, seed=0)
    assert result.lag == 300
    assert result.lag_subsample == pytest.approx(300, abs=0.1)
    for max_lag in (0, 1, 299):
        limited = signal_lag(first, second, method=method, max_lag=max_lag, seed=0)
        assert abs(limited.lag) <= max_lag
        if limited.lags is not None:
            np.testing.assert_array_equal(limited.lags, np.arange(-max_lag, max_lag + 1))
        if limited.votes is not None:
            assert max(map(abs, limited.votes)) <= max_lag


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("fraction", [-0.45, -0.2, 0.1, 0.3, 0.5])
@pytest.mark.parametrize("band", [0.3, 0.9])
def test_fractions_of_a_sample_are_measured_to_a_twentieth(method: SignalMethod, fraction: float, band: float) -> None:
    frequencies = np.fft.rfftfreq(16_384)
    random = np.random.default_rng(8)
    spectrum = (random.normal(size=(2, frequencies.size)).T @ [1, 1j]) * (frequencies < band / 2)
    first = np.fft.irfft(spectrum)
    second = np.fft.irfft(spectrum * np.exp(-2j * np.pi * frequencies * (12 + fraction)))
    result = signal_lag(first[4000:12_000], second[4000:12_000], method=method, seed=0)
    assert result.lag_subsample == pytest.approx(12 + fraction, abs=0.05)
    assert abs(result.lag - result.lag_subsample) <= 0.5


def test_the_peak_ratio_compares_with_the_second_best_echo() -> None:
    sound = scene(3000)
    echo = sound.copy()
    echo[1000:] += 0.5 * sound[:-1000]
    result = signal_lag(sound, echo)
    assert result.lag == 0
    assert 1.5 < result.peak_ratio < 3.5
    assert np.isnan(signal_lag(sound, echo, max_lag=1).peak_ratio)


def test_the_result_cannot_be_changed() -> None:
    result = signal_lag(*pair(300, 20))
    with pytest.raises(dataclasses.FrozenInstanceError):
        result.lag = 3  # type: ignore[misc]
    for array in (result.lags, result.correlation):
        assert array is not None
        with pytest.raises(ValueError, match="read-only"):
            array[0] = 1
    assert result.votes is None


def test_inputs_stay_as_they_were() -> None:
    first, second = pair(300, 20)
    kept = first.copy(), second.copy()
    for method in METHODS:
        signal_lag(first, second, method=method, seed=0)
    np.testing.assert_array_equal((first, second), kept)


@pytest.mark.parametrize("method", METHODS)
def test_progress_rises_to_one(method: SignalMethod) -> None:
    fractions: list[float] = []
    signal_lag(*pair(500, 20), method=method, seed=0, progress=fractions.append)
    assert fractions == sorted(fractions)
    assert fractions[-1] == 1.0


def test_the_direct_search_tells_its_progress_often() -> None:
    # Two calls are about 0.03 s of summing apart.
    fractions: list[float] = []
    signal_lag(*pair(30_000, 50), method="direct", max_lag=29_999, progress=fractions.append)
    assert np.diff([0.0, *fractions]).max() < 0.25


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"signal_1": []}, "signal_1 holds 0 samples"),
        ({"signal_2": [1.0]}, "signal_2 holds 1 samples"),
        ({"signal_1": np.ones(100)}, r"signal_1 is constant \(1"),
        ({"signal_2": [0.0, np.nan, 1.0]}, "signal_2 holds 1 NaN"),
        ({"signal_1": np.ones((3, 4))}, r"shape \(3, 4\)"),
        ({"sampling_rate": 0}, "sampling_rate is 0 .* positive"),
        ({"sampling_rate": float("inf")}, "sampling_rate is inf"),
        ({"speed": -333.0}, "speed is -333.0 .* positive"),
        ({"speed": float("nan")}, "speed is nan"),
        ({"method": "ncc"}, "'ncc'; allowed are 'fft', 'phat', 'sampled', 'direct'"),
        ({"max_lag": -1}, "max_lag is -1; .* 0 to 99"),
        ({"max_lag": 100}, "max_lag is 100; .* 0 to 99"),
        ({"max_lag": 2.5}, "max_lag is 2.5"),
        ({"signal_2": [5, 5, 5, 5, 9], "signal_1": [1, 2, 1], "max_lag": 1}, "nothing varies .* larger max_lag"),
    ],
)
def test_what_is_refused_is_named(change: dict[str, Any], message: str) -> None:
    first, second = pair(100, 5)
    arguments = {"signal_1": first, "signal_2": second} | change
    with pytest.raises(ValueError, match=message):
        signal_lag(**arguments)


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("sizes", [(2, 2), (2, 9), (5, 3), (8, 8)])
def test_the_shortest_recordings_are_answered(method: SignalMethod, sizes: tuple[int, int]) -> None:
    first, second = (np.arange(size) ** 2.0 for size in sizes)
    result = signal_lag(first, second, method=method, seed=0)
    assert isinstance(result, SignalLag)
    assert -1 <= result.score <= 1
