"""Recordings: audio, columns of numbers and arrays, long ones, other rates; faults of bad ones, line by line."""

from __future__ import annotations

import tracemalloc
from pathlib import Path

import numpy as np
import pytest
import soundfile
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp
from recording_bytes import plain_wav, saved, sound

from stereolag.core.jobs import Limits
from stereolag.io import recordings, sources
from stereolag.io.recordings import Recording, read_signal
from stereolag.signals import signal_lag

STEREO = np.random.default_rng(3).uniform(-0.5, 0.5, (4000, 2))


@pytest.mark.parametrize(
    ("kind", "subtype"), [("WAV", "DOUBLE"), ("WAV", "PCM_16"), ("FLAC", "PCM_24"), ("AIFF", None)]
)
@pytest.mark.parametrize("channels", [1, 2])
def test_lossless_audio_comes_back(kind, subtype, channels):
    recording = read_signal(sound(kind, subtype, samples=STEREO[:, :channels], rate=16_000))
    assert recording.sampling_rate == 16_000
    assert recording.channels.dtype == np.float64
    np.testing.assert_allclose(recording.channels, STEREO.T[:channels], atol=1e-4)


@pytest.mark.parametrize("kind", ["OGG", "MP3"])
def test_lossy_audio_sounds_alike(kind):
    tone = 0.4 * np.sin(np.arange(20_000) * 0.06)
    recording = read_signal(sound(kind, samples=tone, rate=44_100))
    assert recording.sampling_rate == 44_100
    assert np.std(recording.channels[0]) == pytest.approx(np.std(tone), rel=0.05)


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("1\n2.5\n-3e2\n", [[1, 2.5, -300]]),
        ("Samples\r\n1\r\n2\r\n", [[1, 2]]),
        ("1\r2\r3", [[1, 2, 3]]),
        ("left,right\n1,2\n3,4\n", [[1, 3], [2, 4]]),
        ("1;2\n3;4", [[1, 3], [2, 4]]),
        ("1,5;2\n-3,25;4", [[1.5, -3.25], [2, 4]]),
        ("0,5 1\n1,5 2", [[0.5, 1.5], [1, 2]]),
        ("1\t2\n3\t4\n\n", [[1, 3], [2, 4]]),
        ("  1   2 \n 3  4", [[1, 3], [2, 4]]),
        ("1, 2\n3, 4", [[1, 3], [2, 4]]),
        ("# a remark\nV, V\n% another\n1,2\n// 7\n3,4 # at the end", [[1, 3], [2, 4]]),
        ("\ufeff1\n2", [[1, 2]]),
        ("Sampling rate: 44100 Hz\nSensor 1\n\n1\n2", [[1, 2]]),
        ("Spannung in µV\n1\n2".encode("latin-1"), [[1, 2]]),
        ("U\n1\n2".encode("utf-16"), [[1, 2]]),
    ],
)
def test_columns_of_numbers(text, expected):
    recording = read_signal(text if isinstance(text, bytes) else text.encode())
    assert recording.sampling_rate is None
    np.testing.assert_array_equal(recording.channels, expected)


@pytest.mark.parametrize(
    ("data", "message"),
    [
        (b"", "empty file"),
        (b"Samples\n1\n2\nhello\n3\n", "Line 4 holds “hello”; allowed are finite numbers"),
        (b"1\n2\n3\x00\n4\n", "Line 3 holds a NUL byte"),
        (b"a\r\n\r\n1\r\nnan\r\n2\r\n", "Line 4 holds nan"),
        (b"1\n-inf\n", "Line 2 holds -inf"),
        (b"1,2\n3\n", "Line 2 holds 1 numbers and the lines before it 2"),
        (b"1,2\n3,4,5\n", "Line 2 holds 3 numbers and the lines before it 2"),
        (b"1,2\n3,\n5,6\n", "Line 2 lacks a number"),
        (b"# r\n1 # ok\n\n1_000\n", "Line 4 holds “1_000”"),
        (b"![x](http://e.org)\n1\n2\n![x](http://e.org/long/long)", r"Line 4 holds “\?\?x\?\?http:”"),
        (b"word\nand more words\n", "No line of the text holds numbers alone"),
        (b"7\n", "holds 1 samples; at least 2"),
        (b",".join([b"1"] * 65) + b"\n" + b",".join([b"1"] * 65), "65 channels; allowed are 1 to 64"),
        (plain_wav(0), "without channels; accepted are WAV, FLAC"),
        (plain_wav(data=bytes(2)), "holds 1 samples; at least 2"),
        (plain_wav(data=b""), "holds 0 samples; at least 2"),
        (sound("FLAC")[:30], "damaged, cut short or without channels"),
        (sound("WAV", "FLOAT", samples=np.array([0.0, np.nan, 1.0])), "holds 1 NaN or infinite samples"),
        (saved(np.array([1.0, np.inf, np.nan])), "holds 2 NaN or infinite samples"),
        (saved(np.zeros((2, 3, 4))), r"shape \(2, 3, 4\)"),
        (saved(np.zeros((100, 100))), "100 channels"),
        (saved(np.array(["a", "b"])), "allowed are integers and floats"),
        (saved(np.zeros(50))[:-8], "cut short: its header announces 50 numbers"),
    ],
    ids=lambda given: given if isinstance(given, str) else "file",
)
def test_bad_files_are_one_clear_sentence(data, message):
    with pytest.raises(ValueError, match=message) as caught:
        read_signal(data)
    assert "\n" not in str(caught.value)
    assert len(str(caught.value)) < 200


@given(
    samples=hnp.arrays(
        np.float64,
        st.tuples(st.integers(1, 4), st.integers(5, 30)),
        elements=st.floats(allow_nan=False, allow_infinity=False),
    ),
    separator=st.sampled_from([",", ";", "\t", " "]),
    newline=st.sampled_from(["\n", "\r\n", "\r"]),
    header=st.sampled_from(["", "Samples", "# made today"]),
)
def test_any_numbers_survive_the_way_through_text(samples, separator, newline, header):
    lines = [header] * bool(header) + [separator.join(map(repr, row)) for row in samples.T.tolist()]
    np.testing.assert_array_equal(read_signal(newline.join(lines).encode()).channels, samples)


@given(
    array=hnp.arrays(
        st.sampled_from([np.int16, np.float32, np.float64, np.dtype(">f8"), np.uint8]),
        st.tuples(st.integers(1, 4), st.integers(5, 30)),
        elements=st.integers(0, 100),
    ),
    order=st.sampled_from("CF"),
    transposed=st.booleans(),
)
def test_arrays_come_with_time_as_the_longer_axis(array, order, transposed):
    stored = np.array(array.T if transposed else array, order=order)
    np.testing.assert_array_equal(read_signal(saved(stored)).channels, array)


def test_the_recordings_of_the_report(data_dir):
    recordings = [read_signal(data_dir / "signals" / "report" / f"sensor{i}Data.txt").channels for i in (1, 2)]
    assert [recording.shape for recording in recordings] == [(1, 176_401)] * 2
    np.testing.assert_array_equal(recordings[0][0, :-50_082], recordings[1][0, 50_082:])


def test_a_recording_is_an_array_of_its_samples() -> None:
    mono = read_signal(b"1\n2\n4\n3\n")
    assert np.asarray(mono).tolist() == [1, 2, 4, 3]
    assert np.asarray(mono, dtype=np.float32).dtype == np.float32
    stereo = read_signal(b"1,5\n2,6\n4,9\n")
    assert np.asarray(stereo).shape == (2, 3)
    noise = "\n".join(f"{value:.6f}" for value in np.random.default_rng(0).normal(size=400))
    later = read_signal(("\n".join(["0.5"] * 7) + "\n" + noise).encode())
    assert signal_lag(read_signal(noise.encode()), later).lag == 7
    with pytest.raises(ValueError, match="one channel at a time"):
        signal_lag(stereo, mono)


@pytest.mark.parametrize(
    ("times", "clock"),
    [
        (np.arange(400), 0),
        (np.round(np.arange(400) / 44_100, 6), 0),
        (100 - np.arange(400), None),
        (np.zeros(400), None),
        (np.arange(400) ** 2, None),
    ],
)
def test_a_column_of_times_is_told_from_signals(times: np.ndarray, clock: int | None) -> None:
    lines = (f"{time},{value:.6f}" for time, value in zip(times, STEREO[:400, 0], strict=True))
    recording = read_signal("\n".join(lines).encode())
    assert recording.clock == clock
    assert read_signal("\n".join(map(str, times)).encode()).clock is None  # alone, it is the recording


# A few damaged lines of a text are mended and counted.

VALUES = np.random.default_rng(0).normal(size=(600, 2)).round(6)


def lines(columns: int = 1, separator: str = ";") -> list[str]:
    return [separator.join(map(repr, row)) for row in VALUES[:, :columns].tolist()]


@pytest.mark.parametrize("newline", ["\n", "\r\n", "\r"])
def test_nul_bytes_behind_a_number_go_and_gaps_are_filled_and_both_are_counted(newline: str) -> None:
    text = lines(2)
    for number in (3, 99):
        text[number] += "\0\0"
    for number in (20, 21, 599):
        text[number] = text[number].split(";")[0] + ";"
    recording = read_signal(newline.join(text).encode())
    expected = VALUES.T.copy()
    before, after = VALUES[19, 1], VALUES[22, 1]
    expected[1, 20:22] = before + (after - before) * np.array([1, 2]) / 3
    expected[1, 599] = VALUES[598, 1]
    assert recording.mended_lines == 5
    np.testing.assert_allclose(recording.channels, expected, atol=1e-12)


@pytest.mark.parametrize("separator", [";", ",", "\t"])
@pytest.mark.parametrize("column", [0, 1])
def test_an_empty_field_lies_between_its_neighbours(separator: str, column: int) -> None:
    text = lines(2, separator)
    kept = text[50].split(separator)
    kept[column] = " "
    text[50] = separator.join(kept)
    recording = read_signal(("a header\n" + "\n".join(text)).encode())
    expected = VALUES.T.copy()
    expected[column, 50] = (expected[column, 49] + expected[column, 51]) / 2
    assert recording.mended_lines == 1
    np.testing.assert_allclose(recording.channels, expected, atol=1e-12)


@pytest.mark.parametrize("damage", ["nul", "field", "both"])
def test_more_are_refused(damage: str) -> None:
    text = lines(2)
    for number in range(30, 36):
        nul = damage == "nul" or (damage == "both" and number % 2)
        text[number] = text[number] + "\0" if nul else text[number].split(";")[0] + ";"
    line = 31 if damage != "both" else r"\d+"
    with pytest.raises(ValueError, match=f"Line {line} (holds a NUL byte|lacks a number); allowed are"):
        read_signal("\n".join(text).encode())


@pytest.mark.parametrize(
    ("damaged", "message"),
    [
        ("1.5\0002;3", "Line 11 holds a NUL byte"),
        ("\0", "Line 11 holds a NUL byte"),
        ("1.5;x", "Line 11 holds “x”"),
        ("1.5;nan", "Line 11 holds nan"),
        ("1.5", "Line 11 holds 1 numbers and the lines before it 2"),
        (";", "Line 11 lacks a number"),
        ("1.5;\n1.5;x", "Line 12 holds “x”"),
    ],
)
def test_what_is_not_small_damage_is_refused(damaged: str, message: str) -> None:
    text = lines(2)
    text[10] = damaged
    with pytest.raises(ValueError, match=message):
        read_signal("\n".join(text).encode())


# Long recordings are streamed from their file, kept as float32, and refused beyond the memory limit.

LONG = np.random.default_rng(0).uniform(-0.5, 0.5, (40_000, 2))


@pytest.fixture
def _soon_long(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(recordings, "LONGEST_DOUBLE", 70_000)


@pytest.mark.usefixtures("_soon_long")
@pytest.mark.parametrize("kind", ["WAV", "FLAC"])
def test_long_audio_is_held_as_float32(kind: str, tmp_path: Path) -> None:
    path = tmp_path / "sound"
    for length, held in ((40_000, np.float32), (30_000, np.float64)):
        soundfile.write(path, LONG[:length], 8000, format=kind, subtype="PCM_24")
        recording = read_signal(path)
        assert (recording.channels.dtype, recording.sampling_rate) == (held, 8000)
        np.testing.assert_allclose(recording.channels.T, LONG[:length], atol=2**-22)
        np.testing.assert_array_equal(recording.channels, read_signal(path.read_bytes()).channels)


@pytest.mark.usefixtures("_soon_long")
def test_long_arrays_too_and_what_float32_cannot_hold_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "sound.npy"
    np.save(path, LONG)
    assert read_signal(path).channels.dtype == np.float32
    np.save(path, np.where(np.arange(80_000) == 7, 1e300, 0.0))
    with pytest.raises(ValueError, match="holds 1 NaN or infinite samples"):
        read_signal(path)


def test_audio_on_disk_is_streamed_whatever_its_bytes(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = tmp_path / "sound.wav"
    soundfile.write(path, np.tile(LONG, (25, 1)), 8000, subtype="PCM_16")
    monkeypatch.setattr(sources, "MAX_BYTES", 10_000)
    monkeypatch.setattr(recordings, "BLOCK", 2**16)
    with pytest.raises(ValueError, match="larger than"):
        read_signal(path.read_bytes())
    tracemalloc.start()
    try:
        recording = read_signal(path)
        peak = tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()
    assert recording.channels.shape == (2, 1_000_000)
    assert peak < recording.channels.nbytes + 4_000_000


@pytest.mark.usefixtures("_soon_long")
def test_what_takes_more_than_a_job_may_is_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = tmp_path / "sound.wav"
    soundfile.write(path, np.zeros((18_000_000, 1), np.int16), 8000, subtype="PCM_U8")
    monkeypatch.setattr("stereolag.core.jobs.limits", lambda: Limits(job_memory_mb=64))
    with pytest.raises(ValueError, match=r"needs about 72 MB of memory, and one job may take 67 MB\.$"):
        read_signal(path)


# Recordings of different rates are resampled to one: nothing is delayed, and the original rate is noted.


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
    with pytest.raises(ValueError, match="their ratio is 44101 : 8000, and numbers up to 10,000 are allowed"):
        recording.resampled(44_101.0)
    monkeypatch.setattr("stereolag.io.recordings.limits", lambda: Limits(max_megasamples=1))
    with pytest.raises(ValueError, match="holds 1 × 1200000 samples; at most 1,000,000"):
        recording.resampled(16_000.0)
