"""`signal_lag`: known delays, real recordings, long ones in blocks and bands; the loops behind it; refusals."""

import dataclasses
import tracemalloc
from collections.abc import Callable
from pathlib import Path
from typing import Any, get_args

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st
from scipy import signal as scipy_signal

from benchmarks.verdict import coloured, common, drifting, noise, tones, unrelated
from stereolag.core.inputs import as_signal
from stereolag.io.clocks import Recording
from stereolag.io.recordings import read_signal
from stereolag.signals import SignalLag, SignalMethod, correlation, estimate_lag, peaks, signal_lag
from stereolag.signals.lag import algorithm
from stereolag.signals.recordings import ConvertedRecording, HeldRecording, running_sums
from stereolag.signals.search import best_matches

METHODS = get_args(SignalMethod)


def scene(size: int, seed: int = 0) -> np.ndarray:
    """Return sound that never repeats: noise with more low than high frequencies, as in recordings."""
    return coloured(size, 0.8, np.random.default_rng(seed))


def pair(size: int, lag: int, seed: int = 0) -> tuple[np.ndarray, np.ndarray]:
    """Return two windows of one scene; the event is `lag` samples later in the second."""
    whole = scene(size + abs(lag), seed)
    late = whole[:size]
    early = whole[abs(lag) :]
    return (early, late) if lag >= 0 else (late, early)


@pytest.mark.parametrize("method", METHODS)
def test_progress_rises_to_the_end_and_the_recordings_are_left_alone(method: SignalMethod) -> None:
    first, second = pair(1000, 700)
    kept, told = (first.copy(), second.copy()), []
    assert signal_lag(first, second, method=method, seed=1, progress=told.append).elapsed_s > 0
    np.testing.assert_array_equal((first, second), kept)
    assert told == sorted(told) and told[-1] == 1.0


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


@given(
    size=st.integers(300, 900),
    share=st.floats(-0.7, 0.7),
    seed=st.integers(0, 2**32 - 1),
    method=st.sampled_from(METHODS),
)
def test_any_lag_is_recovered_and_swapping_only_turns_its_sign(size, share, seed, method):
    lag = round(size * share)
    recordings = pair(size, lag, seed)
    given = {"sampling_rate": 1000.0, "speed": 340.0, "method": method, "seed": seed}
    result, swapped = signal_lag(*recordings, **given), signal_lag(*recordings[::-1], **given)
    assert result.lag == lag and isinstance(result.lag, int)
    assert result.lag_subsample == pytest.approx(lag, abs=0.1)
    assert result.score == pytest.approx(1.0) == swapped.score
    assert (result.time_s, result.distance_m) == (lag / 1000, pytest.approx(abs(lag) / 1000 * 340))
    assert (swapped.lag, swapped.time_s, swapped.distance_m) == (-lag, -result.time_s, result.distance_m)
    if method != "sampled":
        np.testing.assert_array_equal(swapped.lags, -result.lags[::-1])
        np.testing.assert_allclose(swapped.correlation[::-1], result.correlation, atol=1e-9)
        assert swapped.lag_subsample == pytest.approx(-result.lag_subsample, abs=1e-6)
        assert swapped.peak_ratio == pytest.approx(result.peak_ratio, rel=1e-6)
        assert swapped.ties == result.ties


@example(sizes=(110, 64), seed=103, reach=0.5)  # halfway between two lags
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
    np.testing.assert_allclose(fft.correlation[sure[within]], expected, atol=1e-7)
    start, stop = max(0, -fft.lag), min(first.size, second.size - fft.lag)
    overlapping = first[start:stop], second[start + fft.lag : stop + fft.lag]
    assert fft.score == pytest.approx(np.corrcoef(*overlapping)[0, 1], abs=1e-9)


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
        result.lag = 3
    for array in (result.lags, result.correlation):
        with pytest.raises(ValueError, match="read-only"):
            array[0] = 1
    assert result.votes is None


def test_the_direct_search_tells_its_progress_often() -> None:
    # Two calls are about 0.03 s of summing apart.
    fractions: list[float] = []
    signal_lag(*pair(30_000, 50), method="direct", max_lag=29_999, progress=fractions.append)
    assert np.diff([0.0, *fractions]).max() < 0.25


BURSTS = np.zeros((2, 400_000))
BURSTS[0, :1000] = BURSTS[1, -1000:] = scene(1000)
DRIFT = np.linspace(0.0, 1.0, 300_000)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"signal_1": []}, "signal_1 holds 0 samples"),
        ({"signal_2": [1.0]}, "signal_2 holds 1 sample;"),
        ({"signal_1": np.ones(100)}, r"signal_1 is constant \(1"),
        ({"signal_2": [0.0, np.nan, 1.0]}, "signal_2 holds 1 NaN"),
        ({"signal_1": np.ones((3, 4))}, r"shape \(3, 4\)"),
        ({"sampling_rate": 0}, "sampling_rate is 0 .* above 0"),
        ({"sampling_rate": float("inf")}, "sampling_rate is inf"),
        ({"speed": -333.0}, "speed is -333.0 .* above 0"),
        ({"speed": float("nan")}, "speed is nan"),
        ({"method": "ncc"}, "'ncc'; allowed are 'fft', 'phat', 'sampled', 'direct'"),
        ({"max_lag": -1}, "max_lag is -1; .* 0 to 99"),
        ({"max_lag": 100}, "max_lag is 100; .* 0 to 99"),
        ({"max_lag": 2.5}, "max_lag is 2.5"),
        ({"signal_2": [5, 5, 5, 5, 9], "signal_1": [1, 2, 1], "max_lag": 1}, "nothing varies .* larger max_lag"),
        (
            {"signal_1": BURSTS[0, :1000], "signal_2": BURSTS[1], "max_lag": 10},
            "nothing varies where the recordings overlap within ±10 samples",
        ),
        (
            {"signal_1": BURSTS[0, :5000], "signal_2": BURSTS[1, -5000:], "method": "sampled", "max_lag": 5},
            "no sample of signal_1 is found within ±5 samples",
        ),
        ({"signal_1": DRIFT, "signal_2": DRIFT, "method": "sampled"}, "use the method 'fft'"),
    ],
)
def test_what_is_refused_is_named(change: dict[str, Any], message: str) -> None:
    first, second = pair(100, 5)
    with pytest.raises(ValueError, match=message):
        signal_lag(**{"signal_1": first, "signal_2": second, "seed": 0} | change)


def test_what_one_search_cannot_find_another_limit_or_method_does() -> None:
    assert signal_lag(BURSTS[0, :5000], BURSTS[1, -5000:], method="sampled", seed=0).lag == 4000
    assert signal_lag(DRIFT, DRIFT).lag == 0


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("sizes", [(2, 2), (2, 9), (5, 3)])
def test_the_shortest_recordings_are_answered(method: SignalMethod, sizes: tuple[int, int]) -> None:
    first, second = (np.arange(size) ** 2.0 for size in sizes)
    assert -1 <= signal_lag(first, second, method=method, seed=0).score <= 1


@pytest.fixture(scope="module")
def sensors(data_dir: Path) -> list[Recording]:
    return [read_signal(data_dir / "signals" / "report" / f"sensor{number}Data.txt") for number in (1, 2)]


@pytest.mark.parametrize("method", ["fft", "phat"])
def test_the_sensors_of_the_report(sensors: list[Recording], method: SignalMethod) -> None:
    result = signal_lag(*sensors, method=method)
    assert (result.lag, result.ties, result.verdict, result.judgement.reason) == (50_082, 1, "sure", "clear")
    assert result.lag_subsample == pytest.approx(50_082, abs=0.05)
    assert round(result.distance_m, 2) == 378.17
    assert result.time_s == pytest.approx(1.1356463)
    assert result.score == pytest.approx(1.0)
    assert result.uncertainty < 0.015 and abs(result.drift_ppm) < 0.15
    assert signal_lag(*sensors[::-1], method=method).lag == -50_082


def test_the_microphones_of_one_array_are_fractions_of_a_sample_apart(data_dir: Path) -> None:
    channels = read_signal(data_dir / "signals" / "respeaker" / "a180e19_3_1b6ede00.wav").channels
    for one, other, lag in ((0, 1, -1.95), (0, 2, -2.0), (0, 3, 0.0), (1, 2, 0.0)):
        results = [signal_lag(channels[one], channels[other], method=method) for method in ("fft", "phat")]
        assert [(found.verdict, found.judgement.reason) for found in results] == [("sure", "clear")] * 2
        assert results[1].lag_subsample == pytest.approx(lag, abs=0.06)


DELAY = 3210


def voted_recordings(noise_db: float) -> list[np.ndarray]:
    """Return two recordings that are 3210 samples apart, each with noise so much louder than their sound."""
    random, size = np.random.default_rng(0), 20_000
    whole = scipy_signal.lfilter([1.0], [1.0, -0.9], random.normal(size=size + DELAY))
    level = 10 ** (noise_db / 20) * whole.std()
    return [part + level * random.normal(size=size) for part in (whole[DELAY:], whole[:size])]


def test_votes_are_a_histogram_with_the_winner_first_though_noise_is_10_db_below_the_sound() -> None:
    pair = voted_recordings(-10)
    result, again, other = (signal_lag(*pair, method="sampled", seed=seed) for seed in (0, 0, 5))
    assert (other.lag, signal_lag(*pair[::-1], method="sampled", seed=0).lag) == (DELAY, -DELAY)
    assert result.votes == again.votes != other.votes
    assert result.lags is None and result.correlation is None
    counts = list(result.votes.values())
    assert next(iter(result.votes)) == result.lag == DELAY
    assert counts == sorted(counts, reverse=True)
    assert result.peak_ratio == counts[0] / max(count for lag, count in result.votes.items() if abs(lag - DELAY) > 1)
    assert all(type(lag) is int and type(count) is int for lag, count in result.votes.items())


def test_a_passage_that_repeats_is_outvoted() -> None:
    first, second = voted_recordings(-40)
    second[12_000:16_000] = second[6_000:10_000]
    assert signal_lag(first, second, method="sampled", seed=0).lag == DELAY


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


@given(st.integers(0, 99), st.integers(1, 40), st.integers(-30, 0), st.integers(0, 9))
@settings(max_examples=30)
def test_turning_and_crossing_are_those_of_the_formula(seed: int, size: int, first: int, last: int) -> None:
    one, other = np.random.default_rng(seed).normal(size=(2, 40, 2)) @ [1, 1j]
    signal, turned = one.real[:size].copy(), np.empty(40, np.complex128)
    correlation.rotate(signal, other, turned)
    np.testing.assert_allclose(turned, correlation.rotate_reference(signal, other))
    plain = correlation.rotate_back_reference(one, other, first, last)
    np.testing.assert_allclose(correlation.rotate_back(one, other, first, last), plain)
    crossed = correlation.cross_spectrum_reference(one, other)
    np.testing.assert_allclose(correlation.cross_spectrum(one, other), crossed)


@pytest.mark.parametrize("sizes", [(60, 60), (20, 75), (75, 20)])
def test_both_ways_to_the_weighted_correlation_are_the_formula(sizes: tuple[int, int]) -> None:
    random = np.random.default_rng(4)
    first, second = (signal - signal.mean() for signal in (random.normal(size=size) for size in sizes))
    second[: sizes[1] // 3] = second[0]
    lags = np.arange(1 - sizes[0], sizes[1])
    curve = np.empty(lags.size)
    correlation.sliding_pearson(first, second, int(lags[0]), curve)
    plain = correlation.weighted_pearson_reference(first, second, lags)
    np.testing.assert_allclose(curve, plain, atol=1e-9)
    products = np.correlate(second, first, "full")[sizes[0] - 1 :]
    sums = running_sums(first), running_sums(second)
    flat = tuple(float(correlation.FLAT * one[1, -1]) for one in sums)
    correlation.weighted_pearson(products, 0, sizes, flat, (0, 0, 0), sums[0], sums[1], sums[1])
    np.testing.assert_allclose(products, plain[lags >= 0], atol=1e-9)


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
    lags = np.arange(first_lag, first_lag + len(values))
    index, ties = peaks.find_peak(np.array(values), lags, np.ones_like)
    assert (lags[index], ties) == expected


def test_the_main_lobe_ends_at_the_minimum_beyond_half_the_peak_and_without_rivals_no_ratio_is_finite() -> None:
    curve = np.array([0.3, 0.1, 0.2, 0.7, 0.6, 0.8, 1.0, 0.7, 0.75, 0.4, 0.3, 0.35, 0.2])
    assert peaks.main_lobe(curve, 6) == (1, 11)
    assert peaks.peak_ratio(curve, 6) == pytest.approx(1.0 / 0.35)
    assert peaks.main_lobe(curve, 0) == (0, 2)
    assert peaks.interpolate_peak(np.array([0.7]), 0)[0] == 0.0  # nor a fraction
    assert peaks.peak_ratio(np.array([-0.2, -0.3, 1.0, -0.4, -0.1]), 2) == float("inf")
    assert np.isnan(peaks.peak_ratio(np.array([0.5, 1.0, 0.5]), 1))
    assert np.isnan(peaks.peak_ratio(np.array([-0.5, -0.1, -0.5]), 1))


@pytest.mark.parametrize(("band", "error"), [(1.0, 0.012), (0.95, 0.001), (0.5, 0.001), (0.1, 0.001)])
def test_a_band_limited_peak_is_found_between_the_samples(band: float, error: float) -> None:
    samples = np.arange(-peaks.REACH, peaks.REACH + 1)
    for offset in np.linspace(-0.49, 0.49, 29):
        place, _ = peaks.interpolate_peak(np.sinc(band * (samples - offset)), peaks.REACH)
        assert place == pytest.approx(offset, abs=error)


@pytest.fixture
def _small_blocks(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(correlation, "SHORTEST_BLOCK", 16)
    monkeypatch.setattr("stereolag.signals.recordings.GRAIN", 3)
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
    curve = correlation.block_curve(ConvertedRecording(one), ConvertedRecording(other), first, last)
    # In overlaps of two or three samples, rounding can decide whether they count as flat.
    np.testing.assert_allclose(curve, correlation.weighted_pearson_reference(*centred, lags), atol=1e-7)
    lag = data.draw(st.sampled_from(lags.tolist()))
    pearson = correlation.overlap_pearson(ConvertedRecording(one), ConvertedRecording(other), lag)
    assert pearson == pytest.approx(
        correlation.overlap_pearson(*map(HeldRecording, centred), lag), abs=1e-7, nan_ok=True
    )


@pytest.mark.parametrize(
    ("dtype", "lag", "noise"),
    [(np.int16, 700, 0.0), (np.uint8, -811, 1.0), (np.float32, 0, 3.0), (np.float64, -811, 1.0)],
)
def test_blocks_answer_as_the_whole_does(dtype: Any, lag: int, noise: float, monkeypatch: pytest.MonkeyPatch) -> None:
    sound = 20 * scene(301_000) + 128
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
    first = (scene(1_000_000) * 1000).astype(np.int16)
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


@pytest.fixture
def both_ways(monkeypatch: pytest.MonkeyPatch) -> Callable[..., tuple[SignalLag, SignalLag]]:
    """Return a function that measures a lag from the whole, and as if the recordings were long."""
    monkeypatch.setattr("stereolag.signals.search.MAX_LAGS_PER_BAND", 12_000)

    def measured(one: Any, other: Any, **given: Any) -> tuple[SignalLag, SignalLag]:
        results = []
        for longest in (2**40, 0):
            monkeypatch.setattr("stereolag.signals.lag.MAX_WHOLE_LENGTH", longest)
            results.append(signal_lag(one, other, **given))
        return results[0], results[1]

    return measured


def check(whole: SignalLag, bands: SignalLag) -> None:
    assert (bands.lag, bands.verdict) == (whole.lag, whole.verdict)
    # Distant rivals are searched for only in a few places, too few to see their spacing.
    assert whole.verdict == "ambiguous" or bands.judgement.reason == whole.judgement.reason
    assert {*bands.rivals} <= {*whole.rivals}
    assert bands.score == pytest.approx(whole.score, abs=1e-9)
    assert bands.lag_subsample == pytest.approx(whole.lag_subsample, abs=1e-3)
    assert bands.peak_ratio <= whole.peak_ratio + 1e-9
    assert np.all(np.diff(bands.lags) > 0)
    assert bands.correlation.max() == pytest.approx(bands.correlation[bands.lags == bands.lag][0])


WHITE, COLOURED = common(30_000, -1234, 7, colour=0.0), common(60_000, 1234, 7)
HIGH = scipy_signal.butter(8, 0.8, "high", output="sos")
HUM = 8 * np.sin(np.arange(60_000) * 2 * np.pi * 50 / 44_100)
ONCE = np.tile(noise(5000, np.random.default_rng(0)), 12)
IN_BANDS = {
    "nothing in the low bands": [scipy_signal.sosfilt(HIGH, one) for one in WHITE],
    "a hum that is louder and has another lag": (COLOURED[0] + HUM, COLOURED[1] + np.roll(HUM, 300)),
    "a clip": (COLOURED[0][20_000:23_000], COLOURED[1]),
    "a clip that comes second": (COLOURED[1], COLOURED[0][20_000:23_000]),
    "a quiet half and an offset": (np.repeat([1, 0.01], 30_000) * COLOURED[0], COLOURED[1] + 1000.0),
    "a largest lag": (*COLOURED, 24_000),
    "a tone": tones(50_000, 0.0123, 0.0, 1),
    "a tone in noise": tones(50_000, 0.0123, 0.1, 1),
    "what repeats": (ONCE, ONCE + noise(ONCE.size, np.random.default_rng(1))),
    "a drift": drifting(60_000, 700, 50, 0.5, 3),
    "random walks": unrelated("random walks", 100_000, 1),
}


@pytest.mark.parametrize("kind", IN_BANDS)
def test_in_bands_the_answer_is_that_of_the_whole(kind: str, both_ways: Any) -> None:
    one, other, *max_lag = IN_BANDS[kind]
    whole, bands = both_ways(one, other, max_lag=max_lag[0] if max_lag else None)
    check(whole, bands)
    assert bands.verdict == "ambiguous" or "tone" not in kind


def test_in_bands_nothing_and_the_opposite_are_seen(both_ways: Any) -> None:
    assert both_ways(*unrelated("noise and noise", 60_000, 0))[1].verdict == "nothing"
    one, other = common(50_000, 100, 1)
    for result in both_ways(one, -other):
        assert (result.verdict, result.judgement.opposite_lag) == ("nothing", 100)


def test_in_bands_real_recordings_have_their_lag(both_ways: Any, sensors: list[Recording], data_dir: Path) -> None:
    whole, bands = both_ways(*sensors)
    check(whole, bands)
    assert bands.lag == 50_082
    for path in sorted((data_dir / "signals" / "respeaker").glob("*.wav")):
        check(*both_ways(*read_signal(path).channels[:2]))


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
