"""Long recordings in blocks: the same result as one transform of the whole, in little memory."""

from __future__ import annotations

import tracemalloc
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy import signal as scipy_signal

from stereolag.core.inputs import as_signal
from stereolag.signals import estimate_lag, signal_lag
from stereolag.signals import search as blocks
from stereolag.signals.correlation import overlap_pearson, weighted_pearson_reference
from stereolag.signals.lag import algorithm
from stereolag.signals.search import CentredRecording, block_curve, block_pearson, block_products


def recording(size: int, seed: int = 0) -> np.ndarray:
    noise = np.random.default_rng(seed).normal(size=size)
    return scipy_signal.lfilter([1.0], [1.0, -0.8], noise)


@pytest.fixture
def _small_blocks(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(blocks, "SHORTEST_BLOCK", 16)
    monkeypatch.setattr(blocks, "_PIECE", 7)


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
    curve = block_curve(CentredRecording(one), CentredRecording(other), first, last)
    # In overlaps of two or three samples, rounding can decide whether they count as flat.
    np.testing.assert_allclose(curve, weighted_pearson_reference(*centred, lags), atol=1e-7)
    lag = data.draw(st.sampled_from(lags.tolist()))
    pearson = block_pearson(CentredRecording(one), CentredRecording(other), lag)
    assert pearson == pytest.approx(overlap_pearson(*centred, lag), abs=1e-7, nan_ok=True)


@pytest.mark.usefixtures("_small_blocks")
@pytest.mark.parametrize(("first", "last"), [(-30, 40), (5, 60), (-90, -3), (-399, -300), (0, 0)])
def test_products_are_scipys(first: int, last: int) -> None:
    one, other = np.round(recording(400) * 10), np.round(recording(300, 1) * 10)
    one[0] -= one.sum()
    other[0] -= other.sum()
    height = np.abs(one).max() * np.abs(other).max()
    every = scipy_signal.correlate(other, one, method="direct")
    products = block_products(CentredRecording(one), CentredRecording(other), first, last, 256) * height
    np.testing.assert_allclose(products, every[399 + first : 400 + last], atol=1e-6)


@pytest.mark.parametrize("dtype", [np.int16, np.uint8, np.float32, np.float64])
@pytest.mark.parametrize(("lag", "noise"), [(700, 0.0), (-811, 1.0), (0, 3.0)])
def test_blocks_answer_as_the_whole_does(dtype: Any, lag: int, noise: float, monkeypatch: pytest.MonkeyPatch) -> None:
    sound = 20 * recording(301_000) + 128
    first, second = sound[1000:], sound[1000 - lag : 301_000 - lag][:270_000]
    hiss = np.random.default_rng(5).normal(0, noise * np.std(sound), second.size)
    pair = [np.clip(np.round(signal), 0, 255).astype(dtype) for signal in (first, second + hiss)]
    assert algorithm(300_000, second.size, "fft", 1000) == "blocks"
    quick = signal_lag(*pair, max_lag=1000)
    monkeypatch.setattr("stereolag.signals.lag.algorithm", lambda *_: "whole")
    whole = signal_lag(*pair, max_lag=1000)
    assert quick.lag == whole.lag == lag
    assert quick.ties == whole.ties
    assert quick.score == pytest.approx(whole.score, abs=1e-12)
    assert quick.lag_subsample == pytest.approx(whole.lag_subsample, abs=1e-9)
    assert quick.peak_ratio == pytest.approx(whole.peak_ratio, rel=1e-9)
    np.testing.assert_array_equal(quick.lags, whole.lags)
    np.testing.assert_allclose(quick.correlation, whole.correlation, atol=1e-12)


def test_a_clip_is_found_in_a_long_recording_and_the_signs_turn_with_the_recordings() -> None:
    long = recording(400_000)
    clip = long[30_000:32_000]
    found, turned = signal_lag(clip, long, max_lag=35_000), signal_lag(long, clip, max_lag=35_000)
    assert (found.lag, turned.lag) == (30_000, -30_000)
    assert found.score == pytest.approx(1.0)


def test_long_recordings_are_not_copied_and_the_estimate_covers_what_they_take() -> None:
    first = (recording(3_000_000) * 1000).astype(np.int16)
    second = np.roll(first, 4321)
    tracemalloc.start()
    try:
        result = signal_lag(first, second, max_lag=5000)
        peak = tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()
    assert result.lag == 4321
    estimate = estimate_lag(3_000_000, 3_000_000, max_lag=5000).memory
    assert peak < min(estimate, 8 * first.size)


def test_progress_rises_to_one() -> None:
    told: list[float] = []
    signal_lag(recording(600_000), recording(600_000, 1), max_lag=100, progress=told.append)
    assert len(told) > 5
    assert told == sorted(told)
    assert told[-1] == 1.0


def test_recordings_that_are_flat_where_they_overlap_are_refused() -> None:
    first, second = np.zeros(400_000), np.zeros(400_000)
    first[:1000], second[-1000:] = recording(1000), recording(1000)
    with pytest.raises(ValueError, match="nothing varies where the recordings overlap within ±10 samples"):
        signal_lag(first[:1000], second, max_lag=10)
