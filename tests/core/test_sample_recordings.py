"""The bundled recordings match their description; the oracle is SciPy, none of our own correlations."""

from functools import cache

import numpy as np
import pytest
import soundfile
from scipy import fft, signal

from stereolag.samples import ASSETS, recordings
from tools import recordings as script

SAMPLES = 176_401
EXAMPLES = recordings()


@cache
def load(name):
    example = EXAMPLES[name]
    return tuple(soundfile.read(path)[0] for path in (example.signal_1, example.signal_2))


def common_part(name):
    """Return the overlap of both recordings in time, mean-free."""
    (signal_1, signal_2), lag = load(name), EXAMPLES[name].lag
    first = signal_1[max(-lag, 0) : SAMPLES - max(lag, 0)]
    second = signal_2[max(lag, 0) : SAMPLES - max(-lag, 0)]
    return first - first.mean(), second - second.mean()


def linear_correlation(name):
    signal_1, signal_2 = (samples - samples.mean() for samples in load(name))
    lags = signal.correlation_lags(SAMPLES, SAMPLES)
    return lags, signal.correlate(signal_2, signal_1, method="fft")


def circular_lag(signal_1, signal_2):
    """Return the lag by the naive method: without zero padding, so that the ends of the recordings meet."""
    spectrum = fft.rfft(signal_2 - signal_2.mean()) * fft.rfft(signal_1 - signal_1.mean()).conj()
    lag = int(np.argmax(fft.irfft(spectrum, SAMPLES)))
    return lag if lag <= SAMPLES // 2 else lag - SAMPLES


@pytest.mark.parametrize("name", EXAMPLES)
def test_files_are_mono_of_the_stated_length_rate_and_level(name):
    example = EXAMPLES[name]
    for path in (example.signal_1, example.signal_2):
        information = soundfile.info(path)
        assert (information.frames, information.channels) == (SAMPLES, 1)
        assert information.samplerate == example.sampling_rate
    loudest = max(np.max(np.abs(samples)) for samples in load(name))
    assert 20 * np.log10(loudest) == pytest.approx(-3, abs=0.1)


@pytest.mark.parametrize("name", EXAMPLES)
def test_correlation_peaks_at_the_true_lag_plain_whitened_and_normalised_by_the_overlap(name):
    lags, correlation = linear_correlation(name)
    assert lags[np.argmax(correlation)] == EXAMPLES[name].lag
    spectrum = fft.rfft(np.roll(correlation, 1 - SAMPLES), 2 * SAMPLES - 1)
    whitened = fft.fftshift(fft.irfft(spectrum / np.maximum(np.abs(spectrum), 1e-12), 2 * SAMPLES - 1))
    assert lags[np.argmax(whitened)] == EXAMPLES[name].lag
    energy_1, energy_2 = (np.cumsum(np.r_[0, (samples - samples.mean()) ** 2]) for samples in load(name))
    first = energy_1[np.minimum(SAMPLES, SAMPLES - lags)] - energy_1[np.maximum(0, -lags)]
    second = energy_2[np.minimum(SAMPLES, SAMPLES + lags)] - energy_2[np.maximum(0, lags)]
    enough = SAMPLES - np.abs(lags) > SAMPLES // 40
    score = correlation[enough] / np.sqrt(first[enough] * second[enough])
    assert lags[enough][np.argmax(score)] == EXAMPLES[name].lag


@pytest.mark.parametrize(("name", "decibels"), [("coast", -50), ("harbour", 0)])
def test_each_sensor_adds_its_own_noise(name, decibels):
    first, second = common_part(name)
    pearson = np.corrcoef(first, second)[0, 1]
    # Equal noise-to-signal power r at both sensors makes the Pearson correlation 1 / (1 + r) over the whole recording.
    # The horns that only one sensor hears raise the noise of harbour's common part.
    noise = 10 * np.log10(1 / pearson - 1)
    assert noise == pytest.approx(decibels, abs=2.5)


def test_coast_does_not_repeat():
    samples = load("coast")[0]
    samples = samples - samples.mean()
    autocorrelation = signal.correlate(samples, samples, method="fft")[SAMPLES - 1 :] / (samples @ samples)
    assert np.max(np.abs(autocorrelation[int(0.05 * 44_100) :])) < 0.3


def test_harbour_has_another_gain_at_each_sensor_and_fools_simpler_ways():
    first, second = common_part("harbour")
    assert 0.3 < np.std(second) / np.std(first) < 0.6
    assert abs(circular_lag(*load("harbour")) - EXAMPLES["harbour"].lag) > 10_000
    assert circular_lag(*load("coast")) in (EXAMPLES["coast"].lag, EXAMPLES["coast"].lag - SAMPLES)
    loudest_1, loudest_2 = (int(np.argmax(np.abs(samples))) for samples in load("harbour"))
    assert abs(loudest_2 - loudest_1 - EXAMPLES["harbour"].lag) > 10_000


def test_the_script_makes_them_again(monkeypatch, tmp_path):
    monkeypatch.setattr(script, "SIGNALS", tmp_path)
    script.main()
    for path in (ASSETS / "signals").glob("*.flac"):
        again, _ = soundfile.read(tmp_path / path.name, dtype="int16")
        committed, _ = soundfile.read(path, dtype="int16")
        # Another FFT library may round a sample the other way.
        assert np.max(np.abs(again.astype(int) - committed)) <= 1
