"""Frames of videos by number: exactly those asked for, and none from hostile files."""

import pickle
import random
from contextlib import suppress
from pathlib import Path

import numpy as np
import pytest
from small_drives import number_in, numbered, video

from stereolag.core import jobs as limits_module
from stereolag.core.jobs import limits
from stereolag.io.videos import GuardedVideo, VideoFile

COUNT = 60


@pytest.fixture(scope="module")
def mp4() -> bytes:
    return video(numbered(COUNT))


@pytest.mark.parametrize(
    ("codec", "kind", "options"),
    [
        ("libx264", "mp4", {"bf": "3"}),
        ("libx264", "matroska", {"bf": "2"}),
        ("libvpx-vp9", "webm", {"deadline": "realtime", "cpu-used": "8"}),
        ("mjpeg", "avi", {}),
        ("wmv2", "asf", {}),
        ("huffyuv", "avi", {}),
        ("libx264", "mpegts", {"bf": "2"}),
        ("libx264", "flv", {}),
    ],
)
def test_any_frame_is_the_one_asked_for_by_seeking_as_in_turn(codec: str, kind: str, options: dict[str, str]) -> None:
    pixels = {"mjpeg": "yuvj420p", "huffyuv": "yuv422p"}.get(codec, "yuv420p")
    file = VideoFile(video(numbered(COUNT), codec=codec, kind=kind, options=options, pixels=pixels))
    assert (len(file), file.frame_rate, file.frame(0).shape) == (COUNT, 10.0, (64, 96, 3))
    in_turn = [file.frame(number) for number in range(COUNT)]
    assert [*map(number_in, in_turn)] == [*range(COUNT)]
    for number in (*random.Random(0).sample(range(COUNT), COUNT), COUNT - 1, COUNT - 1, 0):
        np.testing.assert_array_equal(file.frame(number), in_turn[number])


def test_grey_stays_grey() -> None:
    pictures = [picture[:, :, 0] for picture in numbered(4)]
    file = VideoFile(video(pictures, codec="ffv1", kind="matroska", pixels="gray"))
    assert [np.array_equal(file.frame(number), pictures[number]) for number in range(4)] == [True] * 4


def test_frames_are_turned_as_their_camera_was_held() -> None:
    """Of two cameras on one rig, one is often mounted upside down, and its file says so."""
    picture = numbered(40)[37]
    assert [
        number_in(np.rot90(VideoFile(video([picture], rotation=turn)).frame(0), -turn // 90)) for turn in (180, 90)
    ] == [37] * 2
    assert VideoFile(video([picture], rotation=90)).frame(0).shape == (96, 64, 3)
    mirrored = [VideoFile(video([picture], rotation=turn, mirrored=True)).frame(0)[:, ::-1] for turn in (0, 90)]
    assert [number_in(mirrored[0]), number_in(np.rot90(mirrored[1], -1))] == [37] * 2


def test_a_video_at_a_path_is_pickled_as_its_path(mp4: bytes, tmp_path: Path) -> None:
    path = tmp_path / "drive.mp4"
    path.write_bytes(mp4)
    file = VideoFile(path)
    assert number_in(file.frame(7)) == 7
    packed = pickle.dumps(file)
    assert len(packed) < 1000
    one, other = pickle.loads(packed), pickle.loads(packed)
    assert one is other and number_in(one.frame(30)) == 30
    assert number_in(pickle.loads(pickle.dumps(VideoFile(mp4))).frame(31)) == 31


def test_a_guarded_video_is_the_same_and_survives_the_end_of_its_worker(mp4: bytes) -> None:
    file, guarded = VideoFile(mp4), GuardedVideo(mp4)
    assert (len(guarded), guarded.frame_rate, guarded.frame(0).shape) == (COUNT, 10.0, (64, 96, 3))
    for number in (0, 1, 2, 40, 3):
        np.testing.assert_array_equal(guarded.frame(number), file.frame(number))
    guarded._guarded.close()
    assert number_in(guarded.frame(30)) == 30
    assert number_in(pickle.loads(pickle.dumps(guarded)).frame(31)) == 31
    for one in (file, guarded):
        with pytest.raises(IndexError, match="frame 60 of a video of 60; allowed are 0 to 59"):
            one.frame(COUNT)
    with pytest.raises(ValueError, match="not a video that can be read"):
        GuardedVideo(b"no video at all" * 9)


def test_a_damaged_frame_concerns_no_other() -> None:
    whole = video(numbered(12), codec="mjpeg", kind="avi", pixels="yuvj420p")
    starts = [place for place in range(len(whole)) if whole.startswith(b"\xff\xd8\xff", place)]
    assert len(starts) == 12
    broken = bytearray(whole)
    broken[starts[5] : starts[5] + 600] = bytes(600)
    file = VideoFile(bytes(broken))
    for before, after in ((4, 6), (6, 11)):
        assert number_in(file.frame(before)) == before
        with pytest.raises(ValueError, match=r"^Frame 5 of the video is damaged and cannot be decoded\.$"):
            file.frame(5)
        assert number_in(file.frame(after)) == after


def test_damage_never_shows_as_another_frame(mp4: bytes) -> None:
    random_bytes = random.Random(1)
    read = 0
    begin = mp4.index(b"mdat")
    end = begin - 4 + int.from_bytes(mp4[begin - 4 : begin], "big")  # beyond it stands the list of the frames
    for _ in range(12):
        broken = bytearray(mp4)
        for _ in range(3):
            broken[random_bytes.randrange(begin + 4, end)] ^= 0xFF
        with suppress(ValueError):
            file = VideoFile(bytes(broken))
            for number in random_bytes.sample(range(COUNT), 8):
                with suppress(ValueError):
                    assert file.frame(number).shape == (64, 96, 3)
                    read += 1
    assert read > 10


@pytest.mark.parametrize(
    ("data", "sentence"),
    [
        (b"", "empty file"),
        (b"#EXTM3U\n#EXTINF:1,\nhttp://127.0.0.1:9/a.ts\n", "not a video that can be read"),
        (b"ffconcat version 1.0\nfile /etc/passwd\n", "not a video that can be read"),
        (b"RIFF\0\0\0\0WAVEfmt ", "not a video that can be read"),
        (b"\0\0\0\x18ftypisom" + bytes(50), "damaged or cut short"),
        (b"\x1aE\xdf\xa3" + bytes(50), "damaged or cut short|no pictures"),
    ],
)
def test_what_is_no_video_is_refused_in_a_sentence(data: bytes, sentence: str) -> None:
    with pytest.raises(ValueError, match=sentence):
        VideoFile(data)


def test_a_video_cut_short_is_refused_or_keeps_its_first_frames(mp4: bytes) -> None:
    with pytest.raises(ValueError, match="damaged or cut short"):
        VideoFile(mp4[: len(mp4) // 2])  # its index is at the end
    matroska = video(numbered(COUNT), kind="matroska")
    file = VideoFile(matroska[: len(matroska) // 2])
    assert 0 < len(file) < COUNT
    assert number_in(file.frame(3)) == 3


@pytest.mark.parametrize(
    ("limit", "sentence"),
    [
        ({"max_frames": 20}, "more than 20 frames"),
        ({"max_video_s": 3}, "6 s long; at most 3 s"),
        ({"max_megapixels": 4}, "at most 4 megapixels"),
    ],
)
def test_limits_hold_before_a_frame_is_decoded(mp4, limit, sentence, monkeypatch):
    monkeypatch.setattr(limits_module, "_defaults", limit)
    limits.cache_clear()
    try:
        data = video(numbered(2, 2600, 1600), options={"preset": "ultrafast"}) if "max_megapixels" in limit else mp4
        with pytest.raises(ValueError, match=sentence):
            VideoFile(data)
    finally:
        limits.cache_clear()
