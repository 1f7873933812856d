"""The job over all frames: written once, resumed, cancelled, with constant memory; and its video."""

import io
import json
import math
import shutil
import threading
import time
from concurrent.futures import Future
from dataclasses import replace
from itertools import pairwise
from pathlib import Path

import av
import numpy as np
import pytest
from small_drives import COLS, DISPARITIES, ROWS, Counting, archive, contents, matched, numbered, rows_of, write_folders

from stereolag import Calibration, StereoBM, StereoSGBM, preset, read_disparity
from stereolag.assess.findings import Finding, FindingCode
from stereolag.core.inputs import Image
from stereolag.core.jobs import Progress
from stereolag.io.images import image_png
from stereolag.sequences import (
    SequenceMemory,
    SequenceState,
    SequenceVideo,
    StereoSequence,
    diagnose_sequence,
    open_sequence,
    run_sequence,
)
from stereolag.sequences.frames import FrameMap, FrameTask, MatchedFrame, read_back
from stereolag.sequences.running import in_order
from stereolag.sequences.sources import FrameReader, StereoFrame
from stereolag.sequences.video import VideoPieces, VideoWriter, panels, whole_video
from stereolag.stereo.matcher import PixelMatches

FAST = preset("fast", num_disparities=16)
BOTH = {"fast": FAST, "bm": StereoBM(num_disparities=16, block_size=9)}
CALIBRATION = Calibration(focal_px=100.0, baseline_m=0.5)


class Slow(StereoBM):
    """A matcher that takes ten seconds and reports its progress."""

    def match(self, left: Image, right: Image, progress: Progress) -> PixelMatches:
        for step in range(200):
            time.sleep(0.05)
            progress(step / 200)
        return super().match(left, right, progress)


@pytest.fixture(autouse=True)
def nothing_matched() -> None:
    matched.clear()


@pytest.fixture
def drive(tmp_path: Path) -> StereoSequence:
    left, right, truth = write_folders(tmp_path / "drive")
    return open_sequence(left, right, truth=truth)


def test_a_drive_is_searched_over_the_range_of_all_its_frames_and_a_black_one_has_none(tmp_path: Path) -> None:
    left, right, _ = write_folders(tmp_path, disparities=(4, 9, 6))
    examined = diagnose_sequence(open_sequence(left, right))
    assert examined is not None and examined.disparities == pytest.approx((4, 9), abs=0.5)
    for side in (left, right):
        (side / "001.png").write_bytes(image_png(np.zeros((ROWS, COLS), np.uint8)))
    examined = diagnose_sequence(open_sequence(left, right))
    assert examined is not None and examined.disparities == pytest.approx((4, 6), abs=0.5)


def untimed(out: Path) -> list[dict[str, str]]:
    return [row | {"milliseconds": ""} for row in rows_of(out)]


def test_frames_of_cameras_above_each_other_are_turned_to_be_matched_and_their_maps_turned_back(drive):
    plain, back = SequenceMemory(), SequenceMemory()
    run_sequence(drive, FAST, plain)

    def lying(number: int) -> FrameReader:
        frame = drive.frame(number)
        return lambda: StereoFrame(*frame.turned(-1))

    ill = Finding(FindingCode.EXPOSURE, False, {}), Finding(FindingCode.ROWS, False, {})
    run_sequence(replace(drive, reader=lying, turn=1, findings=ill), FAST, back)
    for key, data in plain.maps.items():
        np.testing.assert_array_equal(read_back(back.maps[key]), np.rot90(read_back(data), -1))
        assert back.records[key].coverage == plain.records[key].coverage
    assert {one.findings for one in back.records.values()} == {"exposure; rows"}
    assert {one.findings for one in plain.records.values()} == {""}


def test_every_frame_is_written_with_its_figures(drive: StereoSequence, tmp_path: Path) -> None:
    out, states = tmp_path / "out", list[SequenceState]()
    result = run_sequence(drive, BOTH, out, calibration=CALIBRATION, progress=states.append)
    assert (result.total, result.matched, result.damaged, result.cancelled) == (6, 6, {}, False)
    assert sorted(contents(out)) == [f"{method}/{n:03d}.png" for method in ("bm", "fast") for n in range(6)]
    rows = rows_of(out)
    assert [(row["number"], row["method"]) for row in rows] == [(str(n), m) for n in range(6) for m in BOTH]
    for row in rows[::2]:
        number = int(row["number"])
        frame = drive.frame(number)
        expected = FAST.compute(frame.left, frame.right)
        stored = read_disparity(out / "fast" / f"{row['name']}.png")
        assert np.allclose(stored, expected.disparity, atol=1 / 512, equal_nan=True)
        assert float(row["time_s"]) == pytest.approx(number / 10)
        assert float(row["nearest_px"]) == pytest.approx(DISPARITIES[number], abs=0.3)
        assert float(row["nearest_m"]) == pytest.approx(50 / float(row["nearest_px"]), rel=1e-3)
        assert float(row["bad_2_percent"]) < 15 and float(row["epe_px"]) < 1
        assert row["flicker_px"] == "", "every picture is another one"
    for side in ("left", "right"):
        shutil.copy(tmp_path / "drive" / side / "000.png", tmp_path / "drive" / side / "001.png")
    run_sequence(drive, FAST, tmp_path / "still")
    assert [row["flicker_px"] for row in rows_of(tmp_path / "still")[:3]] == ["", "0", ""]
    assert (states[-1].done, states[-1].total) == (6, 6) and states[-1].remaining_s == 0
    assert all(one.done <= other.done for one, other in pairwise(states))


def test_finished_frames_are_not_matched_again_and_half_a_file_is_not_finished(drive, tmp_path):
    out, methods = tmp_path / "out", {"fast": FAST, "bm": Counting(num_disparities=16, block_size=9)}

    def after_three(state: SequenceState) -> None:
        if state.done >= 3:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        run_sequence(drive, methods, out, progress=after_three)
    assert len(rows_of(out)) == 6
    matched.clear()
    result = run_sequence(drive, methods, out)
    assert (result.finished_before, result.matched, len(matched)) == (3, 3, 3)
    whole = tmp_path / "whole"
    run_sequence(drive, methods, whole)
    assert contents(out) == contents(whole) and untimed(out) == untimed(whole)
    cut, gone = out / "bm" / "002.png", out / "fast" / "004.png"
    cut.write_bytes(cut.read_bytes()[:-8])
    gone.unlink()
    result = run_sequence(drive, methods, out)
    assert (result.matched, result.finished_before) == (2, 4)
    assert contents(out) == contents(whole)
    matched.clear()
    assert run_sequence(drive, methods, out).matched == 0 and not matched
    assert run_sequence(drive, methods, out, again=True).matched == 6


def test_other_settings_are_refused_and_may_begin_again(drive: StereoSequence, tmp_path: Path) -> None:
    out, other = tmp_path / "out", preset("fast", num_disparities=32)
    run_sequence(drive, FAST, out)
    before = contents(out)
    with pytest.raises(ValueError, match="holds frames made with other settings; continue with the same, begin again"):
        run_sequence(drive, other, out)
    with pytest.raises(ValueError, match="made with other calibration"):
        run_sequence(drive, FAST, out, calibration=CALIBRATION)
    with pytest.raises(ValueError, match="made with other pictures"):  # of as many, with the same names
        run_sequence(replace(drive, reader=lambda number: drive.reader(5 - number)), FAST, out)
    assert contents(out) == before
    assert run_sequence(drive, other, out, again=True).matched == 6
    noted = json.loads((out / "sequence.json").read_text())
    assert noted["made_of"]["settings"][FAST.short_name]["settings"]["search"]["num_disparities"] == 32
    (out / "sequence.json").write_text("{")
    with pytest.raises(ValueError, match="is damaged; begin again"):
        run_sequence(drive, other, out)


def test_a_damaged_frame_is_left_out_and_tried_again_later(drive: StereoSequence, tmp_path: Path) -> None:
    picture = tmp_path / "drive" / "right" / "003.png"
    whole, out = picture.read_bytes(), tmp_path / "out"
    picture.write_bytes(whole[:300])
    result = run_sequence(drive, BOTH, out, video=tmp_path / "drive.mp4")
    assert list(result.damaged) == ["003"] and "damaged or cut short" in result.damaged["003"]
    assert result.matched == 5 and len(contents(out)) == 10
    assert [bool(row["problem"]) for row in rows_of(out)] == [row["name"] == "003" for row in rows_of(out)]
    pictures = shown(tmp_path / "drive.mp4")
    assert len(pictures) == 6 and np.ptp(pictures[3]) < 8 < np.ptp(pictures[2])
    picture.write_bytes(whole)
    result = run_sequence(drive, BOTH, out)
    assert (result.matched, result.finished_before, result.damaged) == (1, 5, {})
    assert not any(row["problem"] for row in rows_of(out))
    for path in (tmp_path / "drive" / "left").iterdir():
        path.write_bytes(b"no picture")
    result = run_sequence(drive, FAST, tmp_path / "none", video=tmp_path / "none.mp4")
    assert list(result.damaged) == list(drive.names)
    assert not (tmp_path / "none.mp4").exists() and not list(tmp_path.glob(".*"))


def shown(video: bytes | Path) -> list[np.ndarray]:
    with av.open(str(video) if isinstance(video, Path) else io.BytesIO(video)) as container:
        return [frame.to_ndarray(format="rgb24") for frame in container.decode(video=0)]


def test_it_ends_within_a_second_when_called_off_and_what_was_done_can_be_watched(drive, tmp_path):
    called, path, states = threading.Event(), tmp_path / "part.mp4", list[SequenceState]()
    threading.Timer(0.3, called.set).start()
    start = time.perf_counter()
    result = run_sequence(drive, Slow(num_disparities=16), tmp_path / "slow", cancelled=called.is_set)
    assert result.cancelled and result.matched == 0
    assert time.perf_counter() - start < 1.8

    def two_done() -> bool:
        return bool(states) and states[-1].done >= 2

    out = tmp_path / "out"
    result = run_sequence(drive, FAST, out, video=path, progress=states.append, cancelled=two_done)
    assert result.cancelled and result.matched == 2 == len(shown(path))
    assert run_sequence(drive, FAST, out, video=path).finished_before == 2
    assert len(shown(path)) == 6


def test_only_so_many_frames_are_held_at_once(tmp_path: Path) -> None:
    count, ahead, states = 60, list[int](), list[SequenceState]()
    one = open_sequence(*write_folders(tmp_path / "drive", [5])[:2])

    def reader(number: int) -> FrameReader:
        ahead.append(len(ahead) + 1 - (states[-1].done if states else 0))
        return one.reader(0)

    long = StereoSequence(tuple(map(str, range(count))), 10.0, reader)
    run_sequence(long, StereoBM(num_disparities=16, block_size=9), tmp_path / "out", progress=states.append)
    assert len(ahead) == count + 1 and max(ahead) < 12  # the first frame also tells the drive


def test_a_search_beyond_the_png_is_refused_before_anything_is_written(drive: StereoSequence, tmp_path: Path) -> None:
    out = tmp_path / "out"
    matcher = StereoBM(num_disparities=16, min_disparity=-8, block_size=9)
    with pytest.raises(ValueError, match=r"bm searches disparities from -8 to 7 px; KITTI's PNG holds 0 to 255 px"):
        run_sequence(drive, matcher, out)
    assert not out.exists()
    run_sequence(drive, matcher, out, disparity_format=".pfm")
    frame = drive.frame(0)
    stored = read_disparity(out / "bm" / "000.pfm")
    assert np.array_equal(stored, matcher.compute(frame.left, frame.right).disparity, equal_nan=True)


def test_methods_that_name_no_folder_and_colours_that_are_no_range_are_refused(drive, tmp_path):
    for name in ("", "..", "a/b", ".hidden", "x" * 80):
        with pytest.raises(ValueError, match="not a folder name"):
            run_sequence(drive, {name: FAST}, tmp_path / "out")
    for colours in ((5.0, 5.0), (9.0, 1.0), (math.nan, 1.0), (0.0, math.inf)):
        with pytest.raises(ValueError, match=r"colours are .* allowed are two finite numbers, the lower first"):
            SequenceVideo("drive.mp4", colours)


def test_the_video_shows_the_pictures_beside_the_maps(drive: StereoSequence, tmp_path: Path) -> None:
    path = tmp_path / "drive.mp4"
    run_sequence(drive, {"fast": FAST, "sgbm": StereoSGBM(num_disparities=16)}, tmp_path / "out", video=path)
    colours = json.loads((tmp_path / "out" / "sequence.json").read_text())["colours"]
    assert colours == [0.0, 12.0]
    with av.open(str(path)) as container:
        assert container.streams.video[0].average_rate == 10
    frames = shown(path)
    assert [frame.shape for frame in frames] == [(ROWS, 3 * COLS, 3)] * 6
    for number, frame in enumerate(frames):
        maps = [read_disparity(tmp_path / "out" / method / f"{number:03d}.png") for method in ("fast", "sgbm")]
        drawn = panels(drive.frame(number).left, maps, (0.0, 12.0))
        assert np.abs(frame.astype(int) - drawn).mean() < 6
    # The colours are the same throughout: nearer is brighter, frame after frame.
    brightness = [frame[20:60, COLS + 30 : 2 * COLS - 10].mean() for frame in frames]
    assert brightness == sorted(brightness)


def test_a_video_has_a_key_every_second_and_its_index_first() -> None:
    target = io.BytesIO()
    with VideoWriter(target, 15, 45) as writer:
        writer.write_blank()
        for picture in numbered(44, 97, 65):
            writer.write(picture)
    assert target.getvalue().index(b"moov") < target.getvalue().index(b"mdat")
    with av.open(io.BytesIO(target.getvalue())) as container:
        stream = container.streams.video[0]
        assert (stream.width, stream.height, stream.average_rate) == (96, 64, 15)
        assert (stream.codec_context.name, stream.codec_context.pix_fmt) == ("h264", "yuv420p")
        keys = [packet.pts * stream.time_base for packet in container.demux(stream) if packet.is_keyframe]
    assert all(other - one <= 1 for one, other in pairwise(keys)) and len(keys) >= 3


def test_every_piece_adds_a_second_that_can_be_shown_and_all_make_one_file() -> None:
    """The first piece is the header for decoders; the file has its index first."""
    rate, video = 5, VideoPieces(5)
    for number in range(13):
        video.write(np.full((64, 96, 3), 20 + 8 * number, np.uint8))
        assert video.collected == number // rate * rate
    assert len(video.pieces) == 3 and len(shown(b"".join(video.pieces))) == 2 * rate
    video.close()
    pictures, file = shown(b"".join(video.pieces)), whole_video(video.pieces)
    assert video.collected == 13
    np.testing.assert_allclose(np.diff([one.mean() for one in pictures]), 8, atol=2.5)
    assert file.index(b"moov") < file.index(b"mdat") and b"moof" not in file
    assert np.array_equal(shown(file), pictures)
    with av.open(io.BytesIO(file)) as container:
        stream = container.streams.video[0]
        assert (stream.frames, stream.average_rate) == (13, rate)


def test_a_wide_video_is_made_smaller_and_another_ending_is_refused(tmp_path: Path) -> None:
    target = io.BytesIO()
    with VideoWriter(target, 10, 2) as writer:
        writer.write(np.zeros((100, 5000, 3), np.uint8))
        writer.write(np.zeros((50, 600, 3), np.uint8))
    assert [picture.shape for picture in shown(target.getvalue())] == [(76, 3840, 3)] * 2
    with pytest.raises(ValueError, match=r"video ends in '\.avi'"):
        VideoWriter(tmp_path / "a.avi", 10, 1)


def test_memory_keeps_the_same_and_touches_no_disk(drive, tmp_path, monkeypatch):
    out = tmp_path / "out"
    run_sequence(drive, BOTH, out, video=SequenceVideo(tmp_path / "drive.mp4", (0, 16)))
    kept, film = SequenceMemory(), io.BytesIO()
    monkeypatch.setattr(Path, "open", None, raising=True)
    uploaded = open_sequence(archive())
    run_sequence(uploaded, BOTH, kept, video=SequenceVideo(film, (0, 16)))
    monkeypatch.undo()
    maps = {f"{method}/{number:03d}.png": data for (number, method), data in kept.maps.items()}
    assert maps == contents(out)
    assert film.getvalue() == (tmp_path / "drive.mp4").read_bytes()
    assert [(one.number, one.method) for one in kept.records.values()] == [(n, m) for n in range(6) for m in BOTH]
    assert run_sequence(uploaded, BOTH, kept).finished_before == 6
    pieces = VideoPieces(10.0)
    run_sequence(uploaded, BOTH, kept, video=SequenceVideo(pieces))
    pieces.close()
    assert pieces.frames == pieces.collected == len(DISPARITIES)
    assert kept.colours is not None
    assert shown(b"".join(pieces.pieces))[0].shape == (ROWS, 3 * COLS, 3)


def test_frames_on_their_way_may_become_more_than_are_allowed() -> None:
    class Shrinking:
        """A runner that takes six frames at once, and four after a worker has died."""

        max_in_flight = 6
        crashes = (ZeroDivisionError,)

        def match(self, task: FrameTask) -> None:
            pass

        def submit(self, task: FrameTask, own: object = None, before: object = None) -> Future[MatchedFrame[FrameMap]]:
            done = Future[MatchedFrame[FrameMap]]()
            if task.number == 5:
                self.max_in_flight = 4
                done.set_exception(ZeroDivisionError())
            else:
                done.set_result(MatchedFrame(task.number))
            return done

    tasks = [FrameTask(number, None, {}) for number in range(20)]  # type: ignore[arg-type]  # nobody reads them
    runner = Shrinking()
    frames = [*in_order(runner, runner.submit, tasks, lambda: None)]
    assert [frame.number for frame in frames] == list(range(20))
    assert [frame.number for frame in frames if frame.problem == "This frame crashed every worker that took it."] == [5]
