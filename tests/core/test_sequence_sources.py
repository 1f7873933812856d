"""Sources of frames: folders, patterns, an archive, two videos, one side-by-side video."""

import io
import pickle
import random
from dataclasses import replace
from pathlib import Path

import numpy as np
import numpy.typing as npt
import pytest
from pairs import bundled
from small_drives import COLS, DISPARITIES, ROWS, archive, number_in, numbered, pairs_of, video, write_folders, zipped

from stereolag.assess.layout import Layout
from stereolag.core import jobs as limits_module
from stereolag.core.jobs import limits
from stereolag.io.disparities import kitti_png, pfm
from stereolag.io.images import image_png
from stereolag.io.pairing import matched_pairs
from stereolag.sequences import StereoSequence, open_sequence

EXTRAS = (("disparity", "png"), ("calib", "txt"))


def assert_holds_the_pairs(sequence: StereoSequence) -> None:
    assert len(sequence) == len(DISPARITIES)
    expected = pairs_of()
    for number in (3, 0, 5, 4):
        reader = pickle.loads(pickle.dumps(sequence.reader(number)))
        for frame in (sequence.frame(number), reader()):
            assert np.array_equal(frame.left, expected[number][0])
            assert np.array_equal(frame.right, expected[number][1])


def test_two_folders_and_two_patterns(tmp_path: Path) -> None:
    left, right, truth = write_folders(tmp_path)
    sequence = open_sequence(left, right, truth=truth)
    assert_holds_the_pairs(sequence)
    assert (sequence.names[1], sequence.frame_rate) == ("001", 10.0)
    known = sequence.frame(2).truth
    assert known is not None and np.all(known == DISPARITIES[2])
    assert len(pickle.dumps(sequence.reader(0))) < 2000
    patterns = open_sequence(f"{left}/*.png", f"{right}/00*.png", frame_rate=25)
    assert_holds_the_pairs(patterns)
    assert patterns.frame_rate == 25
    for number in (-1, 6):
        with pytest.raises(IndexError, match="allowed are 0 to 5"):
            sequence.frame(number)


def test_an_archive_as_a_path_as_bytes_and_as_a_file(tmp_path: Path) -> None:
    path = tmp_path / "drive.zip"
    path.write_bytes(archive())
    for source in (path, archive(), io.BytesIO(archive())):
        assert_holds_the_pairs(open_sequence(source))
    assert len(pickle.dumps(open_sequence(path).reader(0))) < 2000


def test_frames_are_in_their_order_and_other_names_match_by_number_or_by_place(tmp_path: Path) -> None:
    left, right, _ = write_folders(tmp_path)
    for number in range(6):
        (left / f"{number:03d}.png").rename(left / f"cam_l_{number + 7}.png")
        (right / f"{number:03d}.png").rename(right / f"cam_r_{number + 7}.png")
    sequence = open_sequence(left, right)
    assert sequence.names == tuple(f"cam_l_{number}" for number in range(7, 13))
    assert_holds_the_pairs(sequence)
    (right / "cam_r_9.png").unlink()
    lossy = open_sequence(left, right)
    np.testing.assert_array_equal(lossy.frame(5).right, sequence.frame(5).right)
    with pytest.raises(ValueError, match="right"):
        lossy.frame(2)
    for number in range(7, 13):
        (left / f"cam_l_{number}.png").rename(left / f"cam_l_{'abcdef'[number - 7]}.png")
    with pytest.raises(ValueError, match="6 left pictures and 5 right pictures, with other names"):
        open_sequence(left, right)


def test_the_truths_of_a_drive_are_read_as_they_fit_its_first_frame_and_depth_is_left_out() -> None:
    left, right, truth = bundled("cube", 0.5)
    of_eight_bits = image_png(np.rint(np.nan_to_num(truth) * 8).astype(np.uint8))
    for stored, said in ((of_eight_bits, "÷ 8 agrees best"), (pfm(3.8 / truth), "looks like depth, not disparity")):
        views = {"left/0.png": image_png(left), "right/0.png": image_png(right)}
        sequence = open_sequence(zipped(views | {"disparity/0.pfm" if said[0] == "l" else "disparity/0.png": stored}))
        assert said in sequence.notes[0]
        known = sequence.frame(0).truth
        assert (known is not None) == sequence.has_truth == (stored is of_eight_bits)
        assert known is None or np.nanmax(np.abs(known - truth)) < 0.07


def test_an_archive_of_several_cameras_may_lack_right_pictures_and_bring_the_truth() -> None:
    files = {"drive/readme.txt": b""}
    for number, pair in enumerate(pairs_of()):
        for camera in range(4):
            files[f"drive/image_0{camera}/{number}.png"] = image_png(pair[camera % 2])
        truth = np.full((ROWS, COLS), DISPARITIES[number], np.float32)
        files[f"drive/disparity/{number}.png"] = kitti_png(truth)
    for number in (0, 2):
        del files[f"drive/image_03/{number}.png"]
    sequence = open_sequence(zipped(files))
    assert sequence.names == tuple("012345")
    for number in range(6):
        if number in (0, 2):
            with pytest.raises(ValueError, match=rf"{number}\.png has no picture of the right camera"):
                sequence.frame(number)
        else:
            truth_read = sequence.frame(number).truth
            assert truth_read is not None and np.all(truth_read == DISPARITIES[number])


@pytest.mark.parametrize(
    ("left", "right"),
    [("left/left_{}.png", "right/right_{}.png"), ("{}_L.png", "{}_R.png"), ("a/im0_{}.png", "a/im1_{}.png")],
)
def test_many_names_are_matched_at_once(left: str, right: str) -> None:
    names = [side.format(number) for number in range(500) for side in (left, right)]
    truths, calibrations = ([f"{kind}/{number}.{end}" for number in range(500)] for kind, end in EXTRAS)
    names += truths + calibrations
    # Comparing every name with every other would take minutes.
    found = matched_pairs(random.Random(0).sample(names, len(names)))
    assert [(pair.left, pair.right) for pair in found] == [(left.format(n), right.format(n)) for n in range(500)]
    if "im0" not in left:  # its names have two numbers
        assert [pair.truth for pair in found] == truths
        assert [pair.calibrations for pair in found] == [(one,) for one in calibrations]


def test_two_videos_and_one_side_by_side(tmp_path: Path) -> None:
    pictures = numbered(20)
    for number, name in enumerate(("0.mp4", "1.lrv")):  # as some cameras name their MP4
        (tmp_path / name).write_bytes(video(pictures[number:], rate=25))
    two = open_sequence(tmp_path / "0.mp4", tmp_path / "1.lrv")
    other = open_sequence(tmp_path / "1.lrv", tmp_path / "0.mp4").frame(0)
    assert (number_in(other.left), number_in(other.right)) == (1, 0)
    assert (len(two), two.frame_rate) == (19, 25)  # as many as in the shorter one
    frame = pickle.loads(pickle.dumps(two.reader(11)))()
    assert (number_in(frame.left), number_in(frame.right)) == (11, 12)
    both = [np.concatenate([one, other], axis=1) for one, other in zip(pictures, pictures[::-1], strict=True)]
    beside = open_sequence(video(both), frame_rate=30)
    assert (len(beside), beside.names[3], beside.frame_rate) == (20, "000003", 30)
    frame = beside.frame(4)
    assert frame.left.shape == frame.right.shape == (64, 96, 3)
    assert (number_in(frame.left), number_in(frame.right)) == (4, 15)
    over = open_sequence(video(both), layout=Layout.HALF_OVER_UNDER).frame(4)
    assert over.left.shape == over.right.shape == (64, 192, 3)
    with pytest.raises(ValueError, match="these are two files"):
        open_sequence(tmp_path / "0.mp4", tmp_path / "1.lrv", layout=Layout.BESIDE)


def test_a_folder_is_read_as_its_archive_is_and_pictures_may_hold_both_views(tmp_path: Path) -> None:
    write_folders(tmp_path)
    assert_holds_the_pairs(open_sequence(tmp_path))
    left, right, _ = bundled("cube", 0.5)
    both = image_png(np.hstack([right, left]))
    for name in ("both/0.png", "both/more/0.png"):
        (tmp_path / name).parent.mkdir(exist_ok=True)
        (tmp_path / name).write_bytes(both)
    drives = [
        open_sequence(tmp_path / "both"),
        open_sequence(f"{tmp_path}/both/*.png"),
        open_sequence(zipped({"0.png": both})),
    ]
    assert [drive.names for drive in drives] == [("000000_0", "000001_0"), ("0",), ("0",)]
    for drive in drives:
        frame = pickle.loads(pickle.dumps(drive.reader(0)))()
        assert np.array_equal(frame.left, left) and np.array_equal(frame.right, right)
    capped = open_sequence(
        video([np.zeros((left.shape[0], 2 * left.shape[1], 3), np.uint8)] * 3 + [np.hstack([right, left])])
    )
    assert np.abs(capped.frame(3).left.astype(int) - left).mean() < 5, "by the last frame, as the first ones are black"
    assert open_sequence(tmp_path / "both", layout=Layout.OVER_UNDER).frame(0).left.shape[1] == 2 * left.shape[1]


@pytest.mark.parametrize(
    ("left", "right"),
    [
        ("{seconds:.6f}", "{later:.6f}"),
        ("{nanoseconds}", "{later_nanoseconds}"),
        ("2026-11-29_12-00-{short:06.3f}", "2026-11-29_12-00-{short_later:06.3f}"),
        ("{number:04d}_cam0", "{number:04d}_cam1"),
        ("frame{number}left640", "frame{number}right640"),
    ],
)
def test_a_dropped_picture_shifts_no_other_whether_names_hold_times_or_numbers(left, right, tmp_path):
    """As many pictures were dropped on both sides, so that pairing in order would go unnoticed."""
    files = {}
    for number, pair in enumerate(pairs_of(range(1, 21))):
        seconds = 1_764_417_600 + number / 30
        values = {"number": number, "seconds": seconds, "later": seconds + 0.004, "short": number / 30}
        nanoseconds = round(seconds * 1e9)
        values |= {
            "short_later": number / 30 + 0.004,
            "nanoseconds": nanoseconds,
            "later_nanoseconds": nanoseconds + 120,
        }
        for side, name, picture, dropped in zip(("left", "right"), (left, right), pair, (4, 11), strict=True):
            if number != dropped:
                files[f"{side}/{name.format(**values)}.png"] = image_png(picture)
    for name, data in files.items():
        (tmp_path / name).parent.mkdir(exist_ok=True)
        (tmp_path / name).write_bytes(data)
    for sequence in (open_sequence(tmp_path / "left", tmp_path / "right"), open_sequence(zipped(files))):
        assert len(sequence) == 19
        with pytest.raises(ValueError, match="has no picture of the right camera"):
            sequence.frame(10)
        for number in (0, 7, 9, 11, 18):
            frame = sequence.frame(number)
            disparity = number + 1 + (number >= 4)
            np.testing.assert_array_equal(frame.left[:, disparity:], frame.right[:, :-disparity])
        assert sequence.frame_rate == pytest.approx(30 if "seconds" in left else 10, rel=1e-3)


def test_frames_of_two_videos_are_paired_by_their_times() -> None:
    pictures = numbered(40)
    left = video(pictures[:20], rate=30)
    for right, pairs in (
        (video(pictures[:20], rate=30, dropped=(5, 6)), {3: 3, 7: 7, 19: 19}),
        (video(pictures, rate=60), {0: 0, 7: 14, 19: 38}),
        (video(pictures[::2], rate=15), {0: 0, 5: 10}),
    ):
        sequence = open_sequence(left, right)
        for number, other in pairs.items():
            frame = sequence.frame(number)
            assert number_in(frame.right) == other
            assert number_in(frame.left) == number * (2 if len(sequence) == 10 else 1)
        assert len(sequence.notes) == (len(sequence) == 10 or 38 in pairs.values())
    assert sequence.frame_rate == 15
    with pytest.raises(ValueError, match="The right video has no frame at the time of frame 5"):
        open_sequence(left, video(pictures[:20], rate=30, dropped=(5, 6))).frame(5)


def test_videos_that_begin_seconds_apart_are_paired_by_their_sound() -> None:
    pictures, world = numbered(40), np.random.default_rng(0).integers(-9000, 9000, 32_000).astype(np.int16)

    def clip(first: int, sound: npt.NDArray[np.int16] = world) -> bytes:
        return video(pictures[first : first + 25], kind="matroska", sound=sound[800 * first : 800 * (first + 25)])

    early, late = clip(2), clip(13)
    for given, when in (((early, late), "after"), ((late, early), "before")):
        sequence = open_sequence(*given)
        assert sequence.notes == (
            f"By their sound, the right video begins 1.10 s {when} the left one: frames are paired accordingly.",
        )
        frames = [sequence.frame(number) for number in (0, 13)]
        assert [number_in(frame.left) for frame in frames] == [number_in(frame.right) for frame in frames] == [13, 26]
    assert len(sequence) == 14 and sequence.frame_rate == 10
    # The last two are those of cameras that begin together, one of which records its sound 0.09 s late.
    for unlike in (clip(13, world[::-1].copy()), clip(2), video(pictures[13:38]), clip(2, world[720:])):
        assert (open_sequence(early, unlike).notes, len(open_sequence(early, unlike))) == ((), 25)


def test_frames_keep_their_times_where_some_were_dropped() -> None:
    """Speeds are divided by the time since the previous frame."""
    drive, pictures = (
        video(numbered(12), dropped=(4, 5, 9)),
        {
            f"{side}/{1_764_417_600 + n / 10:.1f}.png": image_png(one)
            for n, both in enumerate(pairs_of(range(1, 13)))
            if n not in (4, 5, 9)
            for side, one in zip(("left", "right"), both, strict=True)
        },
    )
    for sequence in (open_sequence(drive), open_sequence(drive, drive), open_sequence(zipped(pictures))):
        for rate, seconds in ((None, 1), (20, 0.5)):
            given = sequence if rate is None else replace(sequence, frame_rate=rate)
            times = [given.time_s(number) for number in range(9)]
            assert times == pytest.approx([seconds * n / 10 for n in (0, 1, 2, 3, 6, 7, 8, 10, 11)], abs=1e-6)
            assert [*map(given.intervals_before, range(1, 9))] == pytest.approx([1, 1, 1, 3, 1, 1, 2, 1], abs=1e-5)


def test_two_tracks_of_one_video_are_both_views(tmp_path: Path) -> None:
    pictures = numbered(20)
    later = open_sequence(io.BytesIO(video(pictures[:12], [None] * 5 + pictures[5:12], kind="matroska")))
    assert [number_in(view) for view in later.frame(0)[:2]] == [5, 5] and len(later) == 7
    with pytest.raises(ValueError, match=r"no moment in common: the right one begins \+0\.70 s after the left one"):
        open_sequence(video([*pictures[:5], *[None] * 7], [None] * 7 + pictures[7:12], kind="matroska"))
    path = tmp_path / "both.avi"
    path.write_bytes(video(pictures[:12], pictures[8:], codec="mjpeg", kind="avi", pixels="yuvj420p"))
    for source in (path, path.read_bytes()):
        frame = pickle.loads(pickle.dumps(open_sequence(source).reader(7)))()
        assert (number_in(frame.left), number_in(frame.right)) == (7, 15)


def test_a_damaged_or_missing_picture_concerns_its_frame_alone(tmp_path: Path) -> None:
    left, right, _ = write_folders(tmp_path)
    (left / "001.png").write_bytes((left / "001.png").read_bytes()[:200])
    (right / "004.png").unlink()
    sequence = open_sequence(left, right)
    assert len(sequence) == 6
    with pytest.raises(ValueError, match="damaged or cut short"):
        sequence.frame(1)
    with pytest.raises(ValueError, match=r"004\.png has no picture of the right camera"):
        sequence.frame(4)
    assert sequence.frame(2).left.shape == (ROWS, COLS)


def test_what_is_no_sequence_is_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    left, right, _ = write_folders(tmp_path)
    for given, rate, message in (
        ((tmp_path / "nothing", right), None, "There are no pictures at"),
        ((left,), None, "no pictures named left and right, nor any with both views"),
        ((left, right), 0, r"frame_rate is 0 Hz; allowed are 0\.01 to 1000 Hz"),
        ((b"no video at all",), None, "not a video"),
        ((zipped({"notes.txt": b"nothing"}),), None, "no pictures named left and right"),
    ):
        with pytest.raises(ValueError, match=message):
            open_sequence(*given, frame_rate=rate)
    monkeypatch.setattr(limits_module, "_defaults", {"max_frames": 5})
    limits.cache_clear()
    try:
        with pytest.raises(ValueError, match="6 frames; at most 5"):
            open_sequence(left, right)
    finally:
        limits.cache_clear()
