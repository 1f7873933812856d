"""`signal_lag`: known delays, real recordings, long ones in blocks and bands; the loops behind it; refusals."""

from __future__ import annotations

import dataclasses
import tracemalloc
from collections.abc import Callable
from pathlib import Path
from typing import Any, get_args

import numpy as np
import pytest
import soundfile
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy import signal as scipy_signal

from benchmarks.verdict import coloured, common, drifting, noise, tones, unrelated
from stereolag.core.inputs import as_signal
from stereolag.io.recordings import read_signal
from stereolag.signals import SignalLag, SignalMethod, correlation, estimate_lag, signal_lag
from stereolag.signals.correlation import (
    REACH,
    ConvertedRecording,
    HeldRecording,
    block_curve,
    block_products,
    cross_spectrum,
    cross_spectrum_reference,
    find_peak,
    main_lobe,
    overlap_pearson,
    peak_ratio,
    refine_peak,
    running_sums,
    sliding_pearson,
    turn_back,
    turn_back_reference,
    turn_forth,
    turn_forth_reference,
    weighted_pearson,
    weighted_pearson_reference,
)
from stereolag.signals.lag import algorithm
from stereolag.signals.sampling import best_matches
from stereolag.signals.search import _Bound, band_energies, band_products, band_signals, cell_size

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
@pytest.mark.parametrize("lag", [0, -240, 700])
def test_a_known_lag_is_recovered(method: SignalMethod, lag: int) -> None:
    first, second = pair(1000, lag)
    kept, told = (first.copy(), second.copy()), []
    result = signal_lag(first, second, sampling_rate=1000.0, speed=340.0, method=method, seed=1, progress=told.append)
    np.testing.assert_array_equal((first, second), kept)
    assert told == sorted(told) and told[-1] == 1.0
    assert result.lag == lag
    assert result.lag_subsample == pytest.approx(lag, abs=0.1)
    assert result.score == pytest.approx(1.0)
    assert result.time_s == lag / 1000.0
    assert result.distance_m == pytest.approx(abs(lag) / 1000.0 * 340.0)
    assert result.elapsed_s > 0
    assert isinstance(result.lag, int)


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("start", [0, 250, 1800])
def test_a_short_clip_is_found_in_a_long_recording(method: SignalMethod, start: int) -> None:
    long = scene(2000)
    clip = long[start : start + 200]
    assert signal_lag(clip, long, method=method, seed=0).lag == start
    assert signal_lag(long, clip, method=method, seed=0).lag == -start


@pytest.mark.parametrize("method", METHODS)
def test_offset_and_gain_change_nothing(method: SignalMethod) -> None:
    first, second = pair(1500, -333)
    plain = signal_lag(first, second, method=method, seed=0)
    for gain, offset in ((1.0, 5 * first.std()), (1e-8, 1e-4), (1e150, 0.0), (30.0, -1e5)):
        changed = signal_lag(first, gain * second + offset, method=method, seed=0)
        assert changed.lag == plain.lag == -333
        assert changed.score == pytest.approx(plain.score, abs=1e-6)


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


@pytest.mark.parametrize("method", CURVE_METHODS)
def test_a_pulse_in_silence_is_found_however_little_overlaps(method: SignalMethod) -> None:
    first, second = np.zeros(1000), np.zeros(1000)
    first[100:108] = second[850:858] = [1, 4, 9, 5, -3, -2, 1, 0.5]
    result = signal_lag(first, second, method=method)
    assert result.lag == 750
    assert result.judgement is not None and result.judgement.reason == "too_little"  # few samples convince of nothing


@given(
    size=st.integers(300, 900),
    share=st.floats(-0.55, 0.55),
    seed=st.integers(0, 2**32 - 1),
    method=st.sampled_from(METHODS),
)
@settings(max_examples=30)
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
@settings(max_examples=30)
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
@pytest.mark.parametrize(("fraction", "band"), [(-0.45, 0.9), (0.1, 0.3), (0.3, 0.9), (0.5, 0.3)])
def test_fractions_of_a_sample_are_measured_to_a_twentieth(method: SignalMethod, fraction: float, band: float) -> None:
    frequencies = np.fft.rfftfreq(16_384)
    random = np.random.default_rng(8)
    spectrum = (random.normal(size=(2, frequencies.size)).T @ [1, 1j]) * (frequencies < band / 2)
    first = np.fft.irfft(spectrum)
    second = np.fft.irfft(spectrum * np.exp(-2j * np.pi * frequencies * (12 + fraction)))
    result = signal_lag(first[4000:12_000], second[4000:12_000], method=method, seed=0)
    assert result.lag_subsample == pytest.approx(12 + fraction, abs=0.05)
    assert abs(result.lag - result.lag_subsample) <= 0.5


def test_the_result_cannot_be_changed() -> None:
    result = signal_lag(*pair(300, 20))
    with pytest.raises(dataclasses.FrozenInstanceError):
        result.lag = 3  # type: ignore[misc]
    for array in (result.lags, result.correlation):
        assert array is not None
        with pytest.raises(ValueError, match="read-only"):
            array[0] = 1
    assert result.votes is None


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
@pytest.mark.parametrize("sizes", [(2, 2), (2, 9), (5, 3)])
def test_the_shortest_recordings_are_answered(method: SignalMethod, sizes: tuple[int, int]) -> None:
    first, second = (np.arange(size) ** 2.0 for size in sizes)
    result = signal_lag(first, second, method=method, seed=0)
    assert isinstance(result, SignalLag)
    assert -1 <= result.score <= 1


LAG = 50_082


@pytest.fixture(scope="module")
def sensors(data_dir: Path) -> tuple[np.ndarray, np.ndarray]:
    folder = data_dir / "signals" / "report"
    first, second = (np.loadtxt(folder / f"sensor{number}Data.txt", skiprows=1) for number in (1, 2))
    return first, second


@pytest.mark.parametrize("method", ["fft", "phat"])
def test_the_sensors_of_the_report(sensors: tuple[np.ndarray, np.ndarray], method: str) -> None:
    first, second = sensors
    result = signal_lag(first, second, method=method)  # type: ignore[arg-type]
    assert result.lag == LAG
    assert result.lag_subsample == pytest.approx(LAG, abs=0.05)
    assert round(result.distance_m, 2) == 378.17
    assert result.time_s == pytest.approx(1.1356463)
    assert result.score == pytest.approx(1.0)
    assert result.ties == 1
    assert result.verdict == "sure" and result.judgement is not None and result.judgement.reason == "clear"
    assert result.uncertainty < 0.015 and abs(result.drift_ppm) < 0.15
    assert signal_lag(second, first, method=method).lag == -LAG  # type: ignore[arg-type]


def test_the_microphones_of_one_array_are_fractions_of_a_sample_apart(data_dir: Path) -> None:
    channels, rate = soundfile.read(data_dir / "signals" / "respeaker" / "a180e19_3_1b6ede00.wav")
    for one, other, lag in ((0, 1, -1.95), (0, 2, -2.0), (0, 3, 0.0), (1, 2, 0.0)):
        for method in ("fft", "phat"):
            result = signal_lag(channels[:, one], channels[:, other], sampling_rate=rate, method=method)  # type: ignore[arg-type]
            assert result.verdict == "sure" and result.judgement is not None and result.judgement.reason == "clear"
        assert result.lag_subsample == pytest.approx(lag, abs=0.06)


DELAY = 3210


def voted_recordings(noise_db: float | None, seed: int = 0, size: int = 20_000) -> tuple[np.ndarray, np.ndarray]:
    random = np.random.default_rng(seed)
    whole = scipy_signal.lfilter([1.0], [1.0, -0.9], random.normal(size=size + DELAY))
    level = 0.0 if noise_db is None else 10 ** (noise_db / 20) * whole.std()
    first, second = (part + level * random.normal(size=size) for part in (whole[DELAY:], whole[:size]))
    return first, second


@pytest.mark.parametrize("noise_db", [None, -30, -10])
def test_sensor_noise_down_to_10_db_below_the_sound_is_survived(noise_db: float | None) -> None:
    first, second = voted_recordings(noise_db)
    for seed in range(3):
        assert signal_lag(first, second, method="sampled", seed=seed).lag == DELAY
        assert signal_lag(second, first, method="sampled", seed=seed).lag == -DELAY


def test_votes_are_a_histogram_with_the_winner_first() -> None:
    result, again, other = (signal_lag(*voted_recordings(-10), method="sampled", seed=seed) for seed in (0, 0, 5))
    assert result.votes is not None and result.votes == again.votes != other.votes
    assert result.lags is None and result.correlation is None
    counts = list(result.votes.values())
    assert next(iter(result.votes)) == DELAY
    assert counts == sorted(counts, reverse=True)
    rivals = [count for lag, count in result.votes.items() if abs(lag - DELAY) > 1]
    assert result.peak_ratio == counts[0] / max(rivals)
    assert all(type(lag) is int and type(count) is int for lag, count in result.votes.items())


def test_a_passage_that_repeats_is_outvoted() -> None:
    first, second = voted_recordings(-40)
    second[12_000:16_000] = second[6_000:10_000]
    assert signal_lag(first, second, method="sampled", seed=0).lag == DELAY


def test_recordings_that_have_nothing_within_max_lag_are_refused() -> None:
    first = np.zeros(5000)
    second = np.zeros(5000)
    first[:200] = second[4000:4200] = np.random.default_rng(0).normal(size=200)
    assert signal_lag(first, second, method="sampled", seed=0).lag == 4000
    with pytest.raises(ValueError, match="no sample of signal_1 is found within ±5 samples"):
        signal_lag(first, second, method="sampled", seed=0, max_lag=5)


def test_a_drift_without_sound_has_no_slices_to_look_up() -> None:
    drift = np.linspace(0.0, 1.0, 300_000)
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


def spectra(seed: int) -> tuple[np.ndarray, np.ndarray]:
    first, second = (np.random.default_rng(seed).normal(size=(2, 2, 40)).transpose(0, 2, 1)) @ [1, 1j]
    return first, second


@given(st.integers(0, 99), st.integers(1, 40), st.integers(-30, 0), st.integers(0, 9))
@settings(max_examples=30)
def test_turning_and_crossing_are_those_of_the_formula(seed: int, size: int, first: int, last: int) -> None:
    one, other = spectra(seed)
    signal, turned = one.real[:size].copy(), np.empty(40, np.complex128)
    turn_forth(signal, other, turned)
    np.testing.assert_allclose(turned, turn_forth_reference(signal, other))
    np.testing.assert_allclose(turn_back(one, other, first, last), turn_back_reference(one, other, first, last))
    plain = cross_spectrum_reference(one, other)
    np.testing.assert_allclose(cross_spectrum(one, other), plain)


@pytest.mark.parametrize("sizes", [(60, 60), (20, 75), (75, 20)])
def test_both_ways_to_the_weighted_correlation_are_the_formula(sizes: tuple[int, int]) -> None:
    random = np.random.default_rng(4)
    first, second = (signal - signal.mean() for signal in (random.normal(size=size) for size in sizes))
    second[: sizes[1] // 3] = second[0]
    lags = np.arange(1 - sizes[0], sizes[1])
    curve = np.empty(lags.size)
    sliding_pearson(first, second, int(lags[0]), curve)
    plain = weighted_pearson_reference(first, second, lags)
    np.testing.assert_allclose(curve, plain, atol=1e-9)
    products = np.correlate(second, first, "full")[sizes[0] - 1 :]
    sums = running_sums(first), running_sums(second)
    flat = tuple(float(correlation.FLAT * one[1, -1]) for one in sums)
    weighted_pearson(products, 0, sizes, flat, (0, 0, 0), sums[0], sums[1], sums[1])  # type: ignore[arg-type]
    np.testing.assert_allclose(products, plain[lags >= 0], atol=1e-9)


def peak_of(values: list[float], first_lag: int) -> tuple[int, int]:
    lags = np.arange(first_lag, first_lag + len(values))
    index, ties = find_peak(np.array(values), lags, np.ones_like)
    return int(lags[index]), ties


@pytest.mark.parametrize(
    ("values", "first_lag", "expected"),
    [
        ([0.1, 0.9, 0.2, 0.5, 0.1], -2, (-1, 1)),
        ([0.9, 0.1, 0.2, 0.9, 0.1], -2, (1, 2)),
        ([0.9, 0.1, 0.2, 0.1, 0.9], -2, (2, 2)),
        ([0.1, 0.9, 0.9 + 1e-12, 0.1], 5, (7, 1)),
        ([-0.5, 0.0, -0.2, -0.9], 0, (2, 1)),
        ([0.0, 0.0, 0.0], -1, (0, 1)),
    ],
)
def test_of_equal_peaks_the_smallest_lag_wins(values: list[float], first_lag: int, expected: tuple[int, int]) -> None:
    assert peak_of(values, first_lag) == expected


def test_the_main_lobe_goes_down_to_half_the_peak_and_on_to_the_next_minimum() -> None:
    curve = np.array([0.3, 0.1, 0.2, 0.7, 0.6, 0.8, 1.0, 0.7, 0.75, 0.4, 0.3, 0.35, 0.2])
    assert main_lobe(curve, 6) == (1, 11)
    assert peak_ratio(curve, 6) == pytest.approx(1.0 / 0.35)
    assert main_lobe(curve, 0) == (0, 2)


def test_a_peak_without_rivals_has_no_finite_ratio() -> None:
    assert refine_peak(np.array([0.7])) == 0.0  # nor a fraction
    assert peak_ratio(np.array([-0.2, -0.3, 1.0, -0.4, -0.1]), 2) == float("inf")
    assert np.isnan(peak_ratio(np.array([0.5, 1.0, 0.5]), 1))
    assert np.isnan(peak_ratio(np.array([-0.5, -0.1, -0.5]), 1))


@pytest.mark.parametrize(("band", "error"), [(1.0, 0.012), (0.95, 0.001), (0.5, 0.001), (0.1, 0.001)])
def test_a_band_limited_peak_is_found_between_the_samples(band: float, error: float) -> None:
    samples = np.arange(-REACH, REACH + 1)
    for offset in np.linspace(-0.49, 0.49, 29):
        assert refine_peak(np.sinc(band * (samples - offset))) == pytest.approx(offset, abs=error)


def recording(size: int, seed: int = 0) -> np.ndarray:
    noise = np.random.default_rng(seed).normal(size=size)
    return scipy_signal.lfilter([1.0], [1.0, -0.8], noise)


@pytest.fixture
def _small_blocks(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(correlation, "SHORTEST_BLOCK", 16)
    monkeypatch.setattr(correlation, "GRAIN", 3)
    monkeypatch.setattr(ConvertedRecording, "piece", 9)


@pytest.mark.usefixtures("_small_blocks")
@given(data=st.data())
@settings(max_examples=25)
def test_the_curve_of_blocks_is_the_plain_formula(data: st.DataObject) -> None:
    size_1, size_2 = data.draw(st.integers(2, 90)), data.draw(st.integers(2, 90))
    first = data.draw(st.integers(1 - size_1, size_2 - 1))
    last = data.draw(st.integers(first, size_2 - 1))
    both = np.random.default_rng(data.draw(st.integers(0, 99))).normal(5.0, 2.0, size_1 + size_2)
    one, other = both[:size_1], both[size_1:]
    other[size_2 // 2 :] = data.draw(st.sampled_from([other[size_2 // 2 :], np.zeros(size_2 - size_2 // 2)]))
    if np.ptp(other) == 0:
        return
    centred = [as_signal(signal, "signal") - signal.mean() for signal in (one, other)]
    lags = np.arange(first, last + 1)
    curve = block_curve(ConvertedRecording(one), ConvertedRecording(other), first, last)
    # In overlaps of two or three samples, rounding can decide whether they count as flat.
    np.testing.assert_allclose(curve, weighted_pearson_reference(*centred, lags), atol=1e-7)
    lag = data.draw(st.sampled_from(lags.tolist()))
    pearson = overlap_pearson(ConvertedRecording(one), ConvertedRecording(other), lag)
    assert pearson == pytest.approx(overlap_pearson(*map(HeldRecording, centred), lag), abs=1e-7, nan_ok=True)


@pytest.mark.usefixtures("_small_blocks")
@pytest.mark.parametrize(("first", "last"), [(-30, 40), (5, 60), (-90, -3), (-399, -300), (0, 0)])
def test_products_are_scipys(first: int, last: int) -> None:
    one, other = np.round(recording(400) * 10), np.round(recording(300, 1) * 10)
    one[0] -= one.sum()
    other[0] -= other.sum()
    height = np.abs(one).max() * np.abs(other).max()
    every = scipy_signal.correlate(other, one, method="direct")
    products = block_products(ConvertedRecording(one), ConvertedRecording(other), first, last, 256) * height
    np.testing.assert_allclose(products, every[399 + first : 400 + last], atol=1e-6)


@pytest.mark.parametrize(
    ("dtype", "lag", "noise"),
    [(np.int16, 700, 0.0), (np.uint8, -811, 1.0), (np.float32, 0, 3.0), (np.float64, -811, 1.0)],
)
def test_blocks_answer_as_the_whole_does(dtype: Any, lag: int, noise: float, monkeypatch: pytest.MonkeyPatch) -> None:
    sound = 20 * recording(301_000) + 128
    first, second = sound[1000:], sound[1000 - lag : 301_000 - lag][:270_000]
    hiss = np.random.default_rng(5).normal(0, noise * np.std(sound), second.size)
    pair = [np.clip(np.round(signal), 0, 255).astype(dtype) for signal in (first, second + hiss)]
    assert algorithm(300_000, second.size, "fft", 1000) == "blocks"
    told: list[float] = []
    quick = signal_lag(*pair, max_lag=1000, progress=told.append)
    assert len(told) > 5 and told == sorted(told) and told[-1] == 1.0
    monkeypatch.setattr("stereolag.signals.lag.algorithm", lambda *_: "whole")
    whole = signal_lag(*pair, max_lag=1000)
    assert quick.lag == whole.lag == lag
    assert quick.ties == whole.ties
    assert quick.score == pytest.approx(whole.score, abs=1e-12)
    assert quick.lag_subsample == pytest.approx(whole.lag_subsample, abs=1e-9)
    assert quick.peak_ratio == pytest.approx(whole.peak_ratio, rel=1e-9)
    np.testing.assert_array_equal(quick.lags, whole.lags)
    np.testing.assert_allclose(quick.correlation, whole.correlation, atol=1e-12)


def test_long_recordings_are_not_copied_and_the_estimate_covers_what_they_take() -> None:
    first = (recording(1_000_000) * 1000).astype(np.int16)
    second = np.roll(first, 4321)
    tracemalloc.start()
    try:
        result = signal_lag(first, second, max_lag=5000)
        peak = tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()
    assert result.lag == 4321
    estimate = estimate_lag(1_000_000, 1_000_000, max_lag=5000).memory
    assert peak < estimate < 700e6


def test_recordings_that_are_flat_where_they_overlap_are_refused() -> None:
    first, second = np.zeros(400_000), np.zeros(400_000)
    first[:1000], second[-1000:] = recording(1000), recording(1000)
    with pytest.raises(ValueError, match="nothing varies where the recordings overlap within ±10 samples"):
        signal_lag(first[:1000], second, max_lag=10)


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
    assert bands.verdict == whole.verdict
    # Distant rivals are searched for only in a few places, too few to see their spacing.
    assert whole.verdict == "ambiguous" or bands.judgement.reason == whole.judgement.reason
    assert {*bands.rivals} <= {*whole.rivals}
    assert bands.score == pytest.approx(whole.score, abs=1e-9)
    assert bands.lag_subsample == pytest.approx(whole.lag_subsample, abs=1e-3)
    assert bands.peak_ratio <= whole.peak_ratio + 1e-9
    assert bands.lags is not None and bands.correlation is not None
    assert np.all(np.diff(bands.lags) > 0)
    assert bands.correlation.max() == pytest.approx(bands.correlation[bands.lags == bands.lag][0])


@pytest.mark.parametrize(("colour", "lag"), [(0.0, 29_000), (0.8, -3_000), (-0.9, 700), (0.98, -25_000)])
def test_a_sound_in_noise_as_loud(colour: float, lag: int, both_ways: Any) -> None:
    whole, bands = both_ways(*common(40_000, lag, abs(lag), colour=colour))
    check(whole, bands)
    assert (bands.lag, bands.verdict) == (lag, "sure")


def test_nothing_in_the_low_bands(both_ways: Any) -> None:
    one, other = common(50_000, -1234, 7, colour=0.0)
    high = scipy_signal.butter(8, 0.8, "high", output="sos")
    check(*both_ways(*(scipy_signal.sosfilt(high, signal) for signal in (one, other))))


def test_a_hum_that_is_louder_and_has_another_lag(both_ways: Any) -> None:
    one, other = common(50_000, 1234, 7)
    hum = np.sin(np.arange(50_000) * 2 * np.pi * 50 / 44_100)
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
    whole, bands = both_ways(*tones(50_000, 0.0123, noise_level, 1))
    check(whole, bands)
    assert bands.verdict == "ambiguous"


def test_what_repeats_drifts_or_wanders(both_ways: Any) -> None:
    once = np.tile(noise(5000, np.random.default_rng(0)), 20)
    check(*both_ways(once, once + noise(once.size, np.random.default_rng(1))))
    check(*both_ways(*drifting(60_000, 700, 50, 0.5, 3)))
    check(*both_ways(*unrelated("random walks", 100_000, 1)))
    assert both_ways(*unrelated("noise and noise", 60_000, 0))[1].verdict == "nothing"


def test_the_opposite_is_seen(both_ways: Any) -> None:
    one, other = common(50_000, 100, 1)
    for result in both_ways(one, -other):
        assert (result.verdict, result.judgement.opposite_lag) == ("nothing", 100)


def test_real_recordings(both_ways: Any, data_dir: Path) -> None:
    pair = [read_signal(data_dir / "signals" / "report" / f"sensor{number}Data.txt") for number in (1, 2)]
    whole, bands = both_ways(*pair)
    check(whole, bands)
    assert bands.lag == 50_082
    for path in sorted((data_dir / "signals" / "respeaker").glob("*.wav")):
        check(*both_ways(*read_signal(path).channels[:2]))


@pytest.mark.parametrize("step", [8, 64])
def test_bands_hold_the_energy_and_their_products_the_correlation(step: int) -> None:
    sound = coloured(50_000, 0.5, np.random.default_rng(0))
    one, other = (ConvertedRecording(part) for part in (sound[3 * step :], sound[: -3 * step]))
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
    bound = _Bound(*(ConvertedRecording(signal) for signal in given), 2999, 8)
    parts = [band_signals(ConvertedRecording(signal), range(4), 8) for signal in given]
    for band, first, second in zip(range(4), *parts, strict=True):
        bound.total += bound.magnitudes(band, first, second)
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
