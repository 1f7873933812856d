"""Long recordings: streamed from their file, kept as float32, and refused beyond the memory limit."""

from __future__ import annotations

import tracemalloc
from pathlib import Path

import numpy as np
import pytest
import soundfile

from stereolag.core.jobs import Limits
from stereolag.io import recordings, sources
from stereolag.io.recordings import read_signal

SOUND = np.random.default_rng(0).uniform(-0.5, 0.5, (40_000, 2))


@pytest.fixture
def _soon_long(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(recordings, "LONGEST_DOUBLE", 70_000)


@pytest.mark.usefixtures("_soon_long")
@pytest.mark.parametrize("kind", ["WAV", "FLAC"])
def test_long_audio_is_held_as_float32(kind: str, tmp_path: Path) -> None:
    path = tmp_path / "sound"
    soundfile.write(path, SOUND, 8000, format=kind, subtype="PCM_24")
    recording = read_signal(path)
    assert recording.channels.dtype == np.float32
    assert recording.sampling_rate == 8000
    np.testing.assert_allclose(recording.channels.T, SOUND, atol=2**-22)
    np.testing.assert_array_equal(recording.channels, read_signal(path.read_bytes()).channels)
    soundfile.write(path, SOUND[:30_000], 8000, format=kind, subtype="PCM_24")
    assert read_signal(path).channels.dtype == np.float64


@pytest.mark.usefixtures("_soon_long")
def test_long_arrays_too_and_what_float32_cannot_hold_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "sound.npy"
    np.save(path, SOUND)
    assert read_signal(path).channels.dtype == np.float32
    np.save(path, np.where(np.arange(80_000) == 7, 1e300, 0.0))
    with pytest.raises(ValueError, match="holds 1 NaN or infinite samples"):
        read_signal(path)


def test_audio_on_disk_is_streamed_whatever_its_bytes(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = tmp_path / "sound.wav"
    soundfile.write(path, np.tile(SOUND, (25, 1)), 8000, subtype="PCM_16")
    monkeypatch.setattr(sources, "MAX_BYTES", 10_000)
    monkeypatch.setattr(recordings, "_BLOCK", 2**16)
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


def test_a_damaged_file_on_disk_is_refused_as_its_bytes_are(tmp_path: Path) -> None:
    path = tmp_path / "sound.flac"
    soundfile.write(path, SOUND, 8000)
    path.write_bytes(path.read_bytes()[:300])
    for source in (path, path.read_bytes()):
        with pytest.raises(ValueError, match="damaged, cut short or without channels"):
            read_signal(source)


@pytest.mark.usefixtures("_soon_long")
def test_what_takes_more_than_a_job_may_is_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = tmp_path / "sound.wav"
    soundfile.write(path, np.zeros((18_000_000, 1), np.int16), 8000, subtype="PCM_U8")
    monkeypatch.setattr("stereolag.core.jobs.limits", lambda: Limits(job_memory_mb=64))
    with pytest.raises(ValueError, match=r"needs about 72 MB of memory, and one job may take 67 MB\.$"):
        read_signal(path)
