"""The bundled examples are complete, and recordings and mazes match their description by SciPy and OpenCV alone."""

from dataclasses import fields
from functools import cache
from pathlib import Path

import cv2
import numpy as np
import pytest
import soundfile
from PIL import Image
from scipy import fft, signal

from stereolag import samples
from tools import recordings as script
from tools.maze.__main__ import make_template

LISTS = (samples.recordings, samples.mazes, samples.stereo_pairs, samples.drives)


@pytest.mark.parametrize("examples", LISTS)
def test_every_example_is_complete(examples):
    found = examples()
    assert found
    for name, example in found.items():
        assert example.name == name
        assert example.title
        assert example.description.endswith((".", "?"))
        values = [getattr(example, field.name) for field in fields(example)]
        listed = [value if isinstance(value, tuple) else (value,) for value in values]
        assert all(path.is_file() for paths in listed for path in paths if isinstance(path, Path))


def test_the_plain_examples_come_first():
    assert list(samples.recordings()) == ["coast", "harbour"]
    assert list(samples.mazes()) == ["maze", "maze_dulled"]
    assert list(samples.stereo_pairs()) == sorted(samples.stereo_pairs())


@pytest.mark.parametrize("examples", LISTS)
def test_absent_examples_are_named(examples, monkeypatch, tmp_path):
    monkeypatch.setattr(samples, "ASSETS", tmp_path / "assets")
    with pytest.raises(FileNotFoundError, match="bundled examples are not at"):
        examples()


# Recordings

SAMPLES = 176_401
RECORDINGS = samples.recordings()


@cache
def heard(name):
    example = RECORDINGS[name]
    return tuple(soundfile.read(path)[0] for path in (example.signal_1, example.signal_2))


def common_part(name):
    """Return the overlap of both recordings in time, mean-free."""
    (signal_1, signal_2), lag = heard(name), RECORDINGS[name].lag
    first = signal_1[max(-lag, 0) : SAMPLES - max(lag, 0)]
    second = signal_2[max(lag, 0) : SAMPLES - max(-lag, 0)]
    return first - first.mean(), second - second.mean()


def circular_lag(signal_1, signal_2):
    """Return the lag by the naive method: without zero padding, so that the ends of the recordings meet."""
    spectrum = fft.rfft(signal_2 - signal_2.mean()) * fft.rfft(signal_1 - signal_1.mean()).conj()
    lag = int(np.argmax(fft.irfft(spectrum, SAMPLES)))
    return lag if lag <= SAMPLES // 2 else lag - SAMPLES


@pytest.mark.parametrize("name", RECORDINGS)
def test_files_are_mono_of_the_stated_length_rate_and_level(name):
    example = RECORDINGS[name]
    for path in (example.signal_1, example.signal_2):
        information = soundfile.info(path)
        assert (information.frames, information.channels) == (SAMPLES, 1)
        assert information.samplerate == example.sampling_rate
    loudest = max(np.max(np.abs(sound)) for sound in heard(name))
    assert 20 * np.log10(loudest) == pytest.approx(-3, abs=0.1)


@pytest.mark.parametrize("name", RECORDINGS)
def test_correlation_peaks_at_the_true_lag_plain_whitened_and_normalised_by_the_overlap(name):
    sounds = [sound - sound.mean() for sound in heard(name)]
    lags, correlation = signal.correlation_lags(SAMPLES, SAMPLES), signal.correlate(*sounds[::-1], method="fft")
    assert lags[np.argmax(correlation)] == RECORDINGS[name].lag
    spectrum = fft.rfft(np.roll(correlation, 1 - SAMPLES), 2 * SAMPLES - 1)
    whitened = fft.fftshift(fft.irfft(spectrum / np.maximum(np.abs(spectrum), 1e-12), 2 * SAMPLES - 1))
    assert lags[np.argmax(whitened)] == RECORDINGS[name].lag
    energy_1, energy_2 = (np.cumsum(np.r_[0, sound**2]) for sound in sounds)
    first = energy_1[np.minimum(SAMPLES, SAMPLES - lags)] - energy_1[np.maximum(0, -lags)]
    second = energy_2[np.minimum(SAMPLES, SAMPLES + lags)] - energy_2[np.maximum(0, lags)]
    enough = SAMPLES - np.abs(lags) > SAMPLES // 40
    score = correlation[enough] / np.sqrt(first[enough] * second[enough])
    assert lags[enough][np.argmax(score)] == RECORDINGS[name].lag


@pytest.mark.parametrize(("name", "decibels"), [("coast", -50), ("harbour", 0)])
def test_each_sensor_adds_its_own_noise(name, decibels):
    first, second = common_part(name)
    pearson = np.corrcoef(first, second)[0, 1]
    # Equal noise-to-signal power r at both sensors makes the Pearson correlation 1 / (1 + r) over the whole recording.
    # The horns that only one sensor hears raise the noise of harbour's common part.
    noise = 10 * np.log10(1 / pearson - 1)
    assert noise == pytest.approx(decibels, abs=2.5)


def test_coast_does_not_repeat():
    sound = heard("coast")[0] - heard("coast")[0].mean()
    autocorrelation = signal.correlate(sound, sound, method="fft")[SAMPLES - 1 :] / (sound @ sound)
    assert np.max(np.abs(autocorrelation[int(0.05 * 44_100) :])) < 0.3


def test_harbour_has_another_gain_at_each_sensor_and_fools_simpler_ways():
    first, second = common_part("harbour")
    assert 0.3 < np.std(second) / np.std(first) < 0.6
    assert abs(circular_lag(*heard("harbour")) - RECORDINGS["harbour"].lag) > 10_000
    assert circular_lag(*heard("coast")) in (RECORDINGS["coast"].lag, RECORDINGS["coast"].lag - SAMPLES)
    loudest_1, loudest_2 = (int(np.argmax(np.abs(samples))) for samples in heard("harbour"))
    assert abs(loudest_2 - loudest_1 - RECORDINGS["harbour"].lag) > 10_000


def test_the_script_makes_them_again(monkeypatch, tmp_path):
    monkeypatch.setattr(script, "SIGNALS", tmp_path)
    script.main()
    for path in (samples.ASSETS / "signals").glob("*.flac"):
        again, _ = soundfile.read(tmp_path / path.name, dtype="int16")
        committed, _ = soundfile.read(path, dtype="int16")
        # Another FFT library may round a sample the other way.
        assert np.max(np.abs(again.astype(int) - committed)) <= 1


# Mazes

MAZES = samples.mazes()


@cache
def seen(name):
    example = MAZES[name]
    return np.array(Image.open(example.picture)), np.array(Image.open(example.template))


def packed(pixels):
    return pixels[..., :3].astype(np.uint32) @ np.array([1 << 16, 1 << 8, 1], np.uint32)


def behind_the_template(name):
    """Return the part of the picture where Rocketman stands, the template, and which pixels are his."""
    (picture, template), example = seen(name), MAZES[name]
    height, width = template.shape[:2]
    window = picture[example.row : example.row + height, example.col : example.col + width]
    return window, template[..., :3], template[..., 3] == 255


def test_rocketman_stands_on_transparent_ground_where_the_report_has_him():
    alpha = seen("maze")[1][..., 3]
    assert set(np.unique(alpha)) == {0, 255}
    assert 0.4 < np.mean(alpha == 255) < 0.8
    assert not alpha[[0, 0, -1, -1], [0, -1, 0, -1]].any()
    assert np.array_equal(np.array(make_template()), seen("maze")[1])  # the script draws him again
    assert {seen(name)[0].shape for name in MAZES} == {(1526, 2446, 3)}
    assert (MAZES["maze"].row, MAZES["maze"].col) == (528, 982)


def test_his_pixels_are_exact_in_the_first_maze_whose_decoys_share_every_colour_and_dulled_in_the_second():
    window, template, his = behind_the_template("maze")
    assert np.array_equal(window[his], template[his])
    values, counts = np.unique(packed(seen("maze")[0]), return_counts=True)
    occurrences = dict(zip(values.tolist(), counts.tolist(), strict=True))
    assert min(occurrences[colour] for colour in np.unique(packed(template)[his]).tolist()) > 20
    window, template, his = behind_the_template("maze_dulled")
    exact = np.all(window == template, axis=-1)[his]
    assert exact.mean() < 0.001
    assert window[his].std() < 0.75 * template[his].std()


def test_a_part_of_him_is_covered_in_the_second_maze():
    """Where visible, his brightness follows the template; a cover deviates from the fit by far more than the grain."""
    window, template, his = behind_the_template("maze_dulled")
    seen, wanted = (cv2.blur(pixels.mean(axis=-1), (3, 3))[his] for pixels in (window, template))
    slope, offset = np.polyfit(wanted, seen, 1)
    for _ in range(10):
        fits = np.abs(seen - slope * wanted - offset) < 18
        slope, offset = np.polyfit(wanted[fits], seen[fits], 1)
    assert 0.12 < np.mean(~fits) < 0.3
