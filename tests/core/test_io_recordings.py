"""Recordings: arrays, files of other programs by name, what is no recording at all; and at other rates."""

import gzip
import io
import pickle
from functools import partial
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp
from scipy.io import savemat

from benchmarks.camera_files import npz
from benchmarks.picture_bytes import by_pillow
from benchmarks.recording_bytes import matlab, saved
from stereolag import read_signal, signal_lag
from stereolag.core.jobs import Limits
from stereolag.io import clocks
from stereolag.io.clocks import Gap, Recording
from stereolag.io.formats import ACCEPTED, RECORDING_SUFFIXES
from tests.archives import zipped

A, B = np.random.default_rng(0).normal(size=(2, 300)).round(4)
T = np.arange(300) / 200
PIXELS = np.zeros((8, 8, 3), np.uint8)


ALLOWED = f"accepted are {ACCEPTED}."


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


def matlab_4(**arrays: object) -> bytes:
    stream = io.BytesIO()
    savemat(stream, arrays, format="4")
    return stream.getvalue()


@pytest.mark.parametrize("pack", [partial(npz, packed=True), matlab, matlab_4], ids=["NPZ", "MAT", "MAT 4"])
def test_arrays_have_names_to_choose_by_and_a_clock_among_them(pack) -> None:
    data = pack(a=A, b=B)
    for track in (2, "b", "2"):
        recording = read_signal(data, track=track)
        assert (recording.tracks, recording.track, recording.sampling_rate) == (("a", "b"), 2, None)
        np.testing.assert_array_equal(recording.channels, [B])
    np.testing.assert_array_equal(read_signal(pack(y=np.stack([A, B]))).channels, [A, B])
    rates = {"fs": 200}, {"SampleRate": 200.0}, {"fs_khz": 0.2}, {"dt": 0.005}, {"dt_ms": 5.0}, {"sampleTime": 0.005}
    for clock in (*rates, {"t": T}, {"ts": T}, {"time_ms": 1000 * T}):
        recording = read_signal(pack(y=A, **clock))
        assert (recording.tracks, recording.sampling_rate) == (("y",), pytest.approx(200))
        np.testing.assert_array_equal(recording.channels, [A])
    for rate in ({"fs": np.inf}, {"dt": 1e-320}):
        assert read_signal(pack(y=A, **rate)).sampling_rate is None
    kept = np.r_[:100, 140:300]
    recording = read_signal(pack(t=T[kept], y=A[kept]))
    assert recording.gaps == (Gap(pytest.approx(99 / 200), pytest.approx(40 / 200)),)
    np.testing.assert_allclose(recording.channels[0, kept], A[kept])
    with pytest.raises(ValueError, match="has no track “c”; there are “a”, “b”"):
        read_signal(data, track="c")


def test_times_and_missing_values_stand_in_an_array_as_in_a_text() -> None:
    lost = np.where(np.arange(300) % 7 == 3, np.nan, A)
    recording = read_signal(saved(np.column_stack([T, lost])))
    assert (recording.sampling_rate, recording.numbers, recording.notes) == (200, (2,), ("times in column 1",))
    there = ~np.isnan(lost)
    np.testing.assert_allclose(recording.channels[0], np.interp(T, T[there], A[there]))


@pytest.mark.parametrize("unit", ["ms", "us", "ns"])
def test_dates_of_numpy_beside_an_array_are_its_clock(unit: str) -> None:
    dates = np.datetime64("2024-05-13T10:00:00.500", unit) + np.arange(300) * np.timedelta64(5, "ms")
    recording = read_signal(npz(index=dates.astype(f"datetime64[{unit}]"), y=A))
    assert (recording.tracks, recording.sampling_rate, recording.epoch) == (("y",), 200, "1970")
    assert recording.start_s == np.datetime64("2024-05-13T10:00:00").astype(int) + 0.5
    np.testing.assert_array_equal(recording.channels, [A])
    assert read_signal(npz(t=dates - dates[0], y=A)).sampling_rate == 200
    with pytest.raises(ValueError, match=r"holds datetime64.*allowed are integers"):
        read_signal(npz(t=dates))


@pytest.mark.parametrize("missing", [np.nan, np.datetime64("NaT", "ms")])
def test_times_that_are_all_missing_are_no_clock(missing: object) -> None:
    assert read_signal(npz(t=np.full(300, missing), y=A)).sampling_rate is None
    with pytest.raises(ValueError, match=r"\(NPZ\) has shape \(\)"):
        read_signal(npz(t=5.0, y=3.0))


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


# What is refused.

NUMBERS, SHEET, UNPACK = "export its numbers as CSV, NPY or WAV", "save the sheet as CSV", "unpack it"
PICTURE = "a recording is sound or numbers"


@pytest.mark.parametrize(
    ("data", "kind", "remedy"),
    [
        (b"MATLAB 7.3 MAT-file", "a MATLAB file of version 7.3 (HDF5)", "save it by save(file, '-v7')"),
        (b"\x89HDF\r\n\x1a\n" + bytes(90), "an HDF5 file", NUMBERS),
        (zipped({"xl/workbook.xml": b"1", "xl/sheet1.xml": b"2"}), "a workbook (XLSX, ODS)", SHEET),
        (zipped({"a.csv": b"1,2"}), "a ZIP archive", UNPACK),
        (gzip.compress(b"1,2", mtime=0), "a packed archive", UNPACK),
        (b"\xd0\xcf\x11\xe0\xa1\xb1\x1a\xe1" + bytes(90), "a file of older Excel or Word (XLS, DOC)", SHEET),
        (by_pillow("PNG", PIXELS), "a picture", PICTURE),
        (by_pillow("WEBP", PIXELS), "a picture", PICTURE),
        (b"%PDF-1.7 1 0 obj", "a PDF", NUMBERS),
        (b'{"of": {"time": 1}}', "a JSON file", NUMBERS),
        (b"[[1, 2],\n[3, 4", "a JSON file", NUMBERS),
        (b"<!DOCTYPE html><html>", "an HTML or XML file", NUMBERS),
        (pickle.dumps([A]), "a pickle of Python", "save the array by numpy.save"),
        (b"TDSm" + bytes(90), "a TDMS file of LabVIEW", NUMBERS),
        (b"0       " + b"X" * 160 + b"13.05.24" + bytes(90), "an EDF or BDF file", NUMBERS),
        (b"MThd" + bytes(90), "a MIDI file (notes, no sound)", "export it as WAV"),
        (b"wvpk" + bytes(90), "an audio file of a rare kind", "export it as WAV or FLAC"),
    ],
)
def test_a_file_of_another_kind_is_named_with_what_would_help(data: bytes, kind: str, remedy: str) -> None:
    with pytest.raises(ValueError, match=r"\.$") as caught:
        read_signal(data)
    assert str(caught.value) == f"The recording is {kind}, which is not read: {remedy}."


FINITE = "every sample must be a finite number"
UNKNOWN = "is neither a known file nor a text: it begins with the bytes"


@pytest.mark.parametrize(
    ("data", "sentence"),
    [
        (b"", "is an empty file (0 bytes)."),
        (bytes(range(1, 200)), f"{UNKNOWN} 01 02 03 04 05 06; {ALLOWED}"),
        (bytes(500), f"{UNKNOWN} 00 00 00 00 00 00; {ALLOWED}"),
        (saved(np.array([1.0, np.inf, 2.0])), f"holds 1 infinite sample; {FINITE}."),
        (saved(np.zeros((2, 3, 4))), "(NPY) has shape (2, 3, 4); allowed are (samples,) and (channels, samples)."),
        (saved(np.zeros((100, 100))), "has 100 channels; allowed are 1 to 64."),
        (saved(np.array(["a", "b"])), "(.npy) holds str32; allowed are integers and floats."),
        (saved(np.zeros(50))[:-8], "(.npy) is cut short: its header announces 50 numbers of float64."),
        (npz(a=np.array(["x"])), "(.npy) holds str32; allowed are integers and floats."),
        (matlab(s={"a": 1}), "is a MAT file without arrays of numbers; it holds “s” (struct)."),
        (matlab(z=1j * A), "(MAT) holds complex numbers; save their real part or their magnitude."),
        (matlab(a=A)[:300], "is a MAT file that is damaged or cut short; save it again."),
        (matlab_4(a=A)[:300], "is a MAT file that is damaged or cut short; save it again."),
    ],
    ids=lambda given: "" if isinstance(given, bytes) else given,
)
def test_what_no_array_can_be_read_from_is_refused_in_one_sentence(data: bytes, sentence: str) -> None:
    with pytest.raises(ValueError, match=r"\.$") as caught:
        read_signal(data)
    assert str(caught.value) == f"The recording {sentence}"


def test_page_command_and_documentation_list_the_same_formats() -> None:
    documentation = (Path(__file__).parents[2] / "docs" / "pages.md").read_text(encoding="utf-8")
    assert f"| recordings | {ACCEPTED} |" in documentation
    videos = "mp4 m4a mov mkv webm avi aac 3gp amr wma flv mpg"
    assert {*videos.split(), "npy", "npz", "mat", "csv", "txt"} <= {*RECORDING_SUFFIXES}


def test_long_arrays_and_what_float32_cannot_hold_is_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(clocks, "MAX_FLOAT64_SAMPLES", 70_000)
    path = tmp_path / "sound.npy"
    np.save(path, np.zeros((40_000, 2)))
    assert read_signal(path).channels.dtype == np.float32
    np.save(path, np.where(np.arange(80_000) == 7, 1e300, 0.0))
    with pytest.raises(ValueError, match="holds 1 infinite sample"):
        read_signal(path)


# Recordings at other rates: nothing is delayed, and the original rate is noted.


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


def test_a_recording_of_that_rate_stays_as_it_is_and_what_cannot_be_resampled_is_refused(monkeypatch):
    recording = Recording(np.ones((1, 600_000)), 8_000.0)
    assert recording.resampled(8_000.0) is recording
    assert recording.resampled_from is None
    with pytest.raises(ValueError, match="states no sampling rate, so it cannot be resampled to 8000 Hz"):
        Recording(recording.channels, None).resampled(8_000.0)
    with pytest.raises(ValueError, match=r"sampling_rate is 0.0 Hz; it must be a positive"):
        recording.resampled(0.0)
    with pytest.raises(ValueError, match=r"their ratio is \d+ : \d+, and numbers up to 100,000 are allowed"):
        recording.resampled(8_000.024)
    monkeypatch.setattr("stereolag.io.clocks.limits", lambda: Limits(max_megasamples=1))
    with pytest.raises(ValueError, match="holds 1 × 1200000 samples; at most 1,000,000"):
        recording.resampled(16_000.0)


def test_rates_without_a_simple_ratio_are_brought_together_where_that_is_exact_enough() -> None:
    recording = Recording(tones(99.987, 60)[np.newaxis], 99.987).resampled(100.0)
    assert recording.channels.shape[1] == pytest.approx(6000, abs=2)
