"""Sound of audio files and videos: what other programs wrote is read, in its place in time, or refused by its name."""

import struct
import tracemalloc
from pathlib import Path

import numpy as np
import pytest
import soundfile
from scipy import signal

from benchmarks.recording_bytes import filmed, plain_wav, riff_chunk, sound, wav
from stereolag import read_signal, signal_lag
from stereolag.core.jobs import Limits
from stereolag.io import clocks, sounds, sources
from stereolag.io.clocks import Gap, Recording
from stereolag.io.formats import SOUND_FORMATS, sound_format

STEREO = np.random.default_rng(3).uniform(-0.5, 0.5, (4000, 2))
VOICE = 0.07 * signal.lfilter([1], [1, -0.9], np.random.default_rng(0).normal(size=32_768))
CODED = np.rint(VOICE * 32_768).clip(-32_768, 32_767).astype(np.int16)


LOSSLESS = ["WAV DOUBLE", "WAV FLOAT", "WAV PCM_16", "WAV PCM_U8", "FLAC PCM_24", "WAVEX PCM_32"]


@pytest.mark.parametrize("kind", [*LOSSLESS, "AIFF", "AU", "CAF", "W64", "RF64"])
@pytest.mark.parametrize("channels", [1, 2])
def test_lossless_audio_comes_back(kind: str, channels: int) -> None:
    form, _, subtype = kind.partition(" ")
    recording = read_signal(sound(form, subtype or None, samples=STEREO[:, :channels], rate=16_000))
    assert recording.sampling_rate == 16_000
    assert recording.channels.dtype == np.float64
    np.testing.assert_allclose(recording.channels, STEREO.T[:channels], atol=2**-7 if subtype == "PCM_U8" else 1e-4)
    assert recording.notes == ()


# (name of the format, FFmpeg's name of the container, codec, rate, samples that its codec adds unsaid)
WRITTEN_BY_FFMPEG = [
    ("MP4", "mp4", "aac", 16_000, 0),
    ("MP4", "ipod", "aac", 44_100, 0),
    ("MP4", "mov", "pcm_s16le", 16_000, 0),
    ("MP4", "mov", "alac", 16_000, 0),
    ("MP4", "3gp", "aac", 16_000, 0),
    ("MP4", "mp4", "libopus", 48_000, 0),
    ("Matroska", "matroska", "aac", 16_000, 0),
    ("Matroska", "matroska", "flac", 16_000, 0),
    ("Matroska", "webm", "libopus", 48_000, 0),
    ("AVI", "avi", "pcm_s16le", 16_000, 0),
    ("AVI", "avi", "libmp3lame", 16_000, 1105),
    ("AAC", "adts", "aac", 16_000, 1024),
    ("Windows Media", "asf", "wmav2", 44_100, 2009),
    ("FLV", "flv", "aac", 44_100, 1024),
    ("MPEG", "mpeg", "mp2", 48_000, 481),
    ("MPEG-TS", "mpegts", "ac3", 48_000, 256),
    ("MP3", "mp3", "libmp3lame", 16_000, 0),
    ("OGG", "ogg", "libopus", 48_000, 0),
    ("WAV", "wav", "pcm_s24le", 16_000, 0),
    ("WAV", "wav", "adpcm_ms", 16_000, 0),
    ("AIFF", "aiff", "pcm_s16be", 16_000, 0),
    ("AU", "au", "pcm_s16be", 16_000, 0),
    ("CAF", "caf", "alac", 16_000, 0),
    ("W64", "w64", "pcm_s16le", 16_000, 0),
]


@pytest.mark.parametrize(("name", "kind", "codec", "rate", "delay"), WRITTEN_BY_FFMPEG)
def test_what_ffmpeg_writes_is_read_in_its_place(name: str, kind: str, codec: str, rate: int, delay: int) -> None:
    data = filmed(kind, codec, VOICE, rate=rate)
    form = sound_format(data)
    assert form.name == name
    recording = read_signal(data)
    assert recording.sampling_rate == rate
    result = signal_lag(Recording(VOICE[np.newaxis], rate), recording)
    assert (result.lag, result.verdict) == (delay, "sure")
    assert (sounds.UNKNOWN_DELAY in recording.notes) == (not form.states_delay and codec != "pcm_s16le")


def test_telephone_sound_is_read() -> None:
    low_pass = signal.butter(8, 1000, fs=8000, output="sos")
    low = 0.3 * signal.sosfilt(low_pass, np.random.default_rng(1).normal(size=32_768))
    recording = read_signal(filmed("amr", "libopencore_amrnb", low, rate=8000))
    assert recording.sampling_rate == 8000
    assert abs(recording.channels.shape[1] - low.size) < 400
    assert np.std(recording.channels) == pytest.approx(np.std(low), rel=0.3)


def test_every_format_has_a_file_of_another_program() -> None:
    assert {name for name, *_ in WRITTEN_BY_FFMPEG} | {"AMR", "FLAC"} == {one.name for one in SOUND_FORMATS}


def test_a_track_is_chosen_by_its_number_or_name(tmp_path: Path) -> None:
    path = tmp_path / "two.mkv"
    path.write_bytes(filmed("matroska", "flac", VOICE, VOICE[::-1], languages=["eng", "deu"], picture=True))
    for source in (path, path.read_bytes()):
        first, second = read_signal(source), read_signal(source, track=2)
        assert first.tracks == second.tracks == ("1 (eng)", "2 (deu)") or first.tracks == ("1 (eng)", "2 (ger)")
        assert (first.track, second.track) == (1, 2)
        np.testing.assert_allclose(first.channels[0], VOICE, atol=1e-4)
        np.testing.assert_allclose(second.channels[0], VOICE[::-1], atol=1e-4)
        np.testing.assert_array_equal(read_signal(source, track=second.tracks[1]).channels, second.channels)
    assert "track 2 of 2" in second.remarks
    with pytest.raises(ValueError, match=r"has no track “3”; there are “1 \(eng\)”"):
        read_signal(path, track=3)
    with pytest.raises(ValueError, match="has no track “2”; there is “1”"):
        read_signal(sound("WAV"), track=2)


def test_sound_that_is_missing_from_a_video_is_silent_and_later_sound_stays_in_its_place() -> None:
    recording = read_signal(filmed("matroska", "pcm_s16le", VOICE, gap=(8192, 16_384), late=3200, picture=True))
    expected = np.concatenate((np.zeros(3200), VOICE))
    expected[3200 + 8192 : 3200 + 16_384] = 0
    np.testing.assert_allclose(recording.channels[0], expected, atol=1e-4)
    assert recording.gaps == (Gap(0, 0.2), Gap(pytest.approx(0.712), pytest.approx(0.512)))


# A WAV whose recording was interrupted.


DS64 = b"ds64" + struct.pack("<IQQQI", 28, 0, 0, 0, 0)


def interrupted(
    claimed: int, *, size: int | None = None, magic: bytes = b"RIFF", before: bytes = b"", after: bytes = b""
) -> bytes:
    order = ">" if magic == b"RIFX" else "<"
    layout = struct.pack(f"{order}HHIIHH", 1, 1, 16_000, 32_000, 2, 16)
    body = b"WAVE" + before + b"fmt " + struct.pack(f"{order}I", len(layout)) + layout
    body += b"data" + struct.pack(f"{order}I", claimed) + CODED.astype(f"{order}i2").tobytes() + after
    return magic + struct.pack(f"{order}I", len(body) if size is None else size) + body


@pytest.mark.parametrize(
    ("data", "said"),
    [
        pytest.param(interrupted(0, size=0), "states 0 bytes", id="sizes 0"),
        pytest.param(interrupted(0), "states 0 bytes", id="samples 0"),
        pytest.param(interrupted(2**32 - 1, size=2**32 - 1), "states no length", id="0xFFFFFFFF"),
        pytest.param(interrupted(2**31), "states 2,147,483,648 bytes", id="too large"),
        pytest.param(interrupted(4096), "states 4,096 bytes", id="too small"),
        pytest.param(interrupted(0, magic=b"RIFX"), "states 0 bytes", id="big-endian"),
        pytest.param(interrupted(2**32 - 1, magic=b"RF64", before=DS64), "states no length", id="RF64"),
        pytest.param(interrupted(65_536, before=b"note\3\0\0\0abc"), "states 65,536 bytes", id="chunk unpadded"),
        pytest.param(interrupted(0, after=b"\1"), "states 0 bytes", id="half a sample"),
    ],
)
@pytest.mark.parametrize("from_path", [False, True])
def test_all_samples_of_an_interrupted_wav_are_read_and_that_is_said(data, said, from_path, tmp_path):
    (tmp_path / "cut.wav").write_bytes(data)
    recording = read_signal(tmp_path / "cut.wav" if from_path else data)
    np.testing.assert_array_equal(recording.channels[0], CODED / 32_768)
    (note,) = recording.notes
    assert note.startswith("header mended: ") and said in note


@pytest.mark.parametrize(
    "data",
    [
        interrupted(2 * CODED.size),
        interrupted(2 * CODED.size, after=riff_chunk(b"LIST", b"INFOISFT\4\0\0\0abc\0")),
        interrupted(2 * CODED.size, before=riff_chunk(b"note", b"abc"), after=b"\0\0\0"),
        interrupted(2 * CODED.size, after=b"ID3\x03" + bytes(60)),
        interrupted(2 * CODED.size, after=b"TAG" + b"title".ljust(125, b"\0")),
    ],
    ids=["plain", "a chunk behind", "padding", "ID3", "ID3v1"],
)
def test_a_whole_wav_is_not_mended(data: bytes) -> None:
    recording = read_signal(data)
    np.testing.assert_array_equal(recording.channels[0], CODED / 32_768)
    assert recording.notes == ()


def test_a_flac_that_states_no_length_is_read() -> None:
    data = bytearray(sound("FLAC", samples=VOICE))
    data[21] &= 0xF0
    data[22:26] = bytes(4)
    np.testing.assert_allclose(read_signal(bytes(data)).channels[0], VOICE, atol=1e-4)


def test_audio_that_is_cut_short_says_so() -> None:
    recording = read_signal(sound("FLAC", samples=VOICE)[:-20_000])
    assert recording.notes[-1] == f"cut short: {recording.channels.shape[1]:,} of 32,768 samples are there"


def test_damage_in_the_middle_costs_its_own_sound_alone() -> None:
    data = bytearray(filmed("mp4", "aac", VOICE, rate=16_000))
    middle = len(data) // 3
    data[middle : middle + 600] = bytes(600)
    recording = read_signal(bytes(data))
    (note,) = recording.notes
    assert note.startswith("damaged in ") and note.endswith("sound is missing there")
    np.testing.assert_allclose(recording.channels[0, -8000:-1000].std(), VOICE[-8000:-1000].std(), rtol=0.1)
    assert signal_lag(VOICE[-8000:], recording.channels[0, VOICE.size - 8000 :]).lag == 0


def test_an_ogg_that_is_cut_short_is_read_as_far_as_it_goes() -> None:
    data = sound("OGG", samples=np.tile(VOICE, 4))
    assert VOICE.size < read_signal(data[: len(data) * 2 // 3]).channels.shape[1] < 4 * VOICE.size


WHAT = "The recording is"
ANEW = "; export it again, best as WAV or FLAC."
NO_FORMAT = b"RIFF\x24\0\0\0WAVEdata\4\0\0\0\0\0\0\0"
REFUSED: list[tuple[bytes, str]] = [
    (plain_wav(0), f"{WHAT} a WAV file that is of 0 channels by its header, where 1 to 64 are allowed{ANEW}"),
    (plain_wav()[:12], f"{WHAT} a WAV file that is cut short before the layout of its samples is stated{ANEW}"),
    (NO_FORMAT, f"{WHAT} a WAV file that is cut short before the layout of its samples is stated{ANEW}"),
    (plain_wav()[:36], f"{WHAT} a WAV file that is without sound: it ends before its samples, or holds none{ANEW}"),
    (
        wav((0x1234, 1, 8000, 8000, 1, 8), bytes(800)),
        f"{WHAT} a WAV file that is in the coding 0x1234, which is not decoded, or damaged{ANEW}",
    ),
    (plain_wav(data=bytes(2)), "The recording holds 1 sample; at least 2 are needed."),
    (plain_wav(data=b""), "The recording holds 0 samples; at least 2 are needed."),
    (
        sound("WAV", "FLOAT", samples=np.array([0.0, np.nan, 1.0])),
        "The recording holds 1 NaN or infinite sample; every sample must be a finite number.",
    ),
    (sound("FLAC")[:30], f"{WHAT} a FLAC file that is damaged, cut short or in an unknown coding{ANEW}"),
    (sound("AIFF", "DWVW_16"), f"{WHAT} an AIFF file that is in the coding DWVW, which is not decoded{ANEW}"),
    (filmed("mp4", "aac", VOICE)[:400], f"{WHAT} an MP4 file that is damaged, cut short or in an unknown coding{ANEW}"),
    (filmed("mp4", "aac", picture=True), f"{WHAT} an MP4 file without sound."),
    (
        filmed("matroska", "wavpack", VOICE),
        f"{WHAT} a Matroska file in the coding “wavpack”, which is not decoded{ANEW}",
    ),
]


@pytest.mark.parametrize(("data", "sentence"), REFUSED, ids=lambda given: "" if isinstance(given, bytes) else given)
def test_a_refusal_names_the_format_and_what_is_wrong(data: bytes, sentence: str) -> None:
    with pytest.raises(ValueError, match=r"\.$") as caught:
        read_signal(data)
    assert str(caught.value) == sentence


# Long recordings are streamed from their file, kept as float32, and refused beyond the memory limit.

LONG = np.random.default_rng(0).uniform(-0.5, 0.5, (40_000, 2))


@pytest.fixture
def _soon_long(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(clocks, "MAX_FLOAT64_SAMPLES", 70_000)


@pytest.mark.usefixtures("_soon_long")
@pytest.mark.parametrize("kind", ["WAV", "FLAC"])
def test_long_audio_is_held_as_float32(kind: str, tmp_path: Path) -> None:
    path = tmp_path / "sound"
    soundfile.write(path, LONG, 8000, format=kind, subtype="PCM_24")
    recording = read_signal(path)
    assert recording.channels.dtype == np.float32
    assert recording.sampling_rate == 8000
    np.testing.assert_allclose(recording.channels.T, LONG, atol=2**-22)
    np.testing.assert_array_equal(recording.channels, read_signal(path.read_bytes()).channels)
    soundfile.write(path, LONG[:30_000], 8000, format=kind, subtype="PCM_24")
    assert read_signal(path).channels.dtype == np.float64


@pytest.mark.parametrize("cut", [False, True])
def test_audio_on_disk_is_streamed_whatever_its_size(cut, tmp_path, monkeypatch):
    path = tmp_path / "sound.wav"
    soundfile.write(path, np.tile(LONG, (25, 1)), 8000, format="WAV", subtype="PCM_16")
    data = path.read_bytes()
    if cut:
        path.write_bytes(data[:40] + bytes(4) + data[44:])
    monkeypatch.setattr(sources, "MAX_BYTES", 10_000)
    monkeypatch.setattr(sounds, "BLOCK_SAMPLES", 2**16)
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
