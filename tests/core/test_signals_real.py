"""`signal_lag` on recordings made by others."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import soundfile

from stereolag.signals import signal_lag

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
    assert signal_lag(second, first, method=method).lag == -LAG  # type: ignore[arg-type]


def test_the_direct_search_agrees(sensors: tuple[np.ndarray, np.ndarray]) -> None:
    first, second = sensors[0][:40_000], sensors[1][45_000:85_000]
    direct, fft = (signal_lag(first, second, method=method, max_lag=6000) for method in ("direct", "fft"))  # type: ignore[arg-type]
    assert direct.lag == LAG - 45_000
    np.testing.assert_allclose(direct.correlation, fft.correlation, atol=1e-9)


@pytest.mark.parametrize("noise_db", [None, -10])
def test_twenty_votings_of_twenty_are_right(sensors: tuple[np.ndarray, np.ndarray], noise_db: float | None) -> None:
    random = np.random.default_rng(6)
    level = 0.0 if noise_db is None else 10 ** (noise_db / 20) * sensors[0].std()
    first, second = (sensor + level * random.normal(size=sensor.size) for sensor in sensors)
    for seed in range(20):
        result = signal_lag(first, second, method="sampled", seed=seed)
        assert result.lag == LAG
        assert round(result.distance_m, 2) == 378.17
    assert signal_lag(second, first, method="sampled", seed=0).lag == -LAG


@pytest.mark.parametrize("method", ["fft", "direct"])
@pytest.mark.parametrize("share", [0.72, 0.85])
def test_a_delay_past_half_the_recording_does_not_fold_back(
    sensors: tuple[np.ndarray, np.ndarray], method: str, share: float
) -> None:
    whole = sensors[0][:40_000]
    size = round(40_000 / (1 + share))
    lag = 40_000 - size
    assert lag > 0.7 * size
    result = signal_lag(whole[lag:], whole[:size], method=method)  # type: ignore[arg-type]
    assert result.lag == lag


@pytest.mark.parametrize("recording", ["a180e19_3_1b6ede00", "a180e19_3_1b85f880"])
def test_the_microphones_of_one_array_are_fractions_of_a_sample_apart(data_dir: Path, recording: str) -> None:
    channels, rate = soundfile.read(data_dir / "signals" / "respeaker" / f"{recording}.wav")
    for one, other, lag in ((0, 1, -1.95), (0, 2, -2.0), (0, 3, 0.0), (1, 2, 0.0)):
        result = signal_lag(channels[:, one], channels[:, other], sampling_rate=rate, method="phat")
        assert result.lag_subsample == pytest.approx(lag, abs=0.06)
