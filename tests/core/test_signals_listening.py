"""The lag of two channels while they are heard: found, followed when the source moves, and silence is no lag."""

import numpy as np
import pytest
from scipy import ndimage

from benchmarks.verdict import drifting
from stereolag.core.arrays import Array
from stereolag.signals.listening import Listening

RATE = 16_000
PIECE = RATE // 5


def heard(lags: Array, *, noise: float = 0.3, seed: int = 1) -> Array:
    """Return (2, N) samples of one sound, in channel 2 later by the lag of each sample, in noise of each channel."""
    random = np.random.default_rng(seed)
    sound = random.standard_normal(lags.size + 200)
    places = 100 + np.arange(lags.size)
    both = np.stack([sound[places], sound[places - lags]]) + noise * random.standard_normal((2, lags.size))
    return (3000 * both).clip(-32_768, 32_767).astype(np.int16)


def test_a_lag_is_found_and_followed_when_the_source_moves() -> None:
    both = heard(np.repeat([37, -21], 3 * RATE))
    listening = Listening(RATE)
    found = []
    for start in range(0, both.shape[1], PIECE):
        listening.add(both[:, start : start + PIECE])
        one = listening.measured(speed=333.0, max_lag=400)
        found.append(one.lag_now)
        assert one.result is not None and one.silent == ()
    assert listening.samples.shape == (2, 2 * RATE)
    np.testing.assert_allclose(found[:15], 37, atol=0.1)
    # While the seconds kept hold little of the new lag, the old one may stand; any other is never called sure.
    assert all(np.isnan(lag) or min(abs(lag - 37), abs(lag + 21)) < 0.1 for lag in found)
    np.testing.assert_allclose(found[19:], -21, atol=0.1)  # four pieces, 0.8 s later


@pytest.mark.parametrize("ppm", [-5000, 5600])
@pytest.mark.parametrize("seed", [2, 12])
def test_a_walking_source_is_where_it_is_at_the_last_sample(ppm: int, seed: int) -> None:
    # Of half the bandwidth, so that its peak under a lag that changes is smeared over hundreds of samples.
    lags = np.round(100 + ppm * 1e-6 * np.arange(2 * RATE)).astype(int)
    both = ndimage.uniform_filter1d(heard(lags, seed=seed).astype(float), 3, axis=1)
    listening = Listening(RATE)
    listening.add(both.astype(np.int16))
    assert listening.measured(speed=333.0).lag_now == pytest.approx(lags[-1], abs=2)


def test_two_clocks_are_told_from_one() -> None:
    listening = Listening(RATE)
    listening.add((1000 * np.stack(drifting(2 * RATE, 40, 150, 0.2, 3))[:, : 2 * RATE]).astype(np.int16))
    one = listening.measured(speed=333.0)
    assert one.result.judgement.reason == "drift"
    assert one.result.drift_ppm == pytest.approx(150, abs=15)
    assert one.lag_now == pytest.approx(one.result.lag_at(2.0), abs=0.5)


def test_silence_one_channel_alone_and_unrelated_noise_are_no_lag() -> None:
    listening = Listening(RATE)
    assert listening.measured(speed=333.0).silent == (1, 2)
    both = heard(np.full(PIECE, 5))
    quiet = both // 3000
    for piece, silent, alike in (
        (quiet, (1, 2), False),
        (np.stack([both[0], quiet[0]]), (2,), False),
        (np.stack([both[0], both[0]]), (), True),
        (np.stack([both[0], heard(np.full(PIECE, 5), seed=2)[1]]), (), False),
    ):
        listening = Listening(RATE)
        listening.add(piece.astype(np.int16))
        one = listening.measured(speed=333.0)
        assert (one.silent, one.identical) == (silent, alike)
        assert np.isnan(one.lag_now)
