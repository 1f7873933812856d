"""``stereolag sequence``: its files, output and exit codes, and how it resumes."""

import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import moving_drives
import numpy as np
import pytest
from commanded import Command, assert_refused
from small_drives import rows_of, write_folders

import stereolag as sl
from stereolag.core.settings import changed
from stereolag.io.calibrations import calibration_json
from stereolag.io.images import image_png

PROJECT = Path(__file__).resolve().parents[2]
RANGE = ("--num-disparities", 16)
GIVEN = (*RANGE, "--trust")
"""For what does not ask how good the frames are: looking at them takes a second."""

Sides = tuple[Path, Path]

CONSOLE = "import sys; from stereolag.commands import main; sys.exit(main())"


@pytest.fixture
def sides(tmp_path: Path) -> Sides:
    return write_folders(tmp_path / "drive", [4, 5, 6])[:2]


def test_maps_a_table_and_a_video_in_the_given_range_or_that_of_the_calibration(sides, tmp_path, ran):
    out, video = tmp_path / "out", tmp_path / "drive.mp4"
    calibration = tmp_path / "calibration.json"
    calibration.write_text('{"focal_px": 100, "baseline_m": 0.5, "num_disparities": 27}')
    beside = ("--compare", "bm", "--compare", "sgbm", "--truth", tmp_path / "drive" / "truth")
    files = ("--out", out, "--video", video, "--calibration", calibration)
    told = ran("sequence", *sides, *RANGE, *beside, *files, "--json")
    figures = told.figures
    assert (told.code, told.err) == (0, "")
    assert (figures["frames"], figures["matched"], figures["finished_before"], figures["damaged"]) == (3, 3, 0, {})
    assert (figures["methods"], figures["range_px"]) == (["fast", "bm", "sgbm"], [0, 16])
    assert figures["frames_per_second"] == pytest.approx(3 / figures["elapsed_s"])
    assert video.stat().st_size > 1000
    for row in rows_of(out):
        disparity = 4 + int(row["number"])
        assert float(row["nearest_m"]) == pytest.approx(50 / disparity, rel=0.1)
        assert float(row["epe_px"]) < 1
    known = ran("sequence", *sides, "--trust", "--calibration", calibration, "--out", tmp_path / "known", "--json")
    assert known.figures["range_px"] == [0, 27]


def test_settings_come_from_the_same_flags_as_those_of_a_pair(sides: Sides, tmp_path: Path, ran: Command) -> None:
    start, file = sl.StereoSGBM(uniqueness_ratio=3), tmp_path / "settings.json"
    sl.write_matcher(file, start)
    told = ran("sequence", *sides, "--out", tmp_path / "out", "--settings", file, *GIVEN, "--block-size", 9)
    assert (told.code, told.err) == (0, "")
    expected = changed(start.with_search_range(0, 16), {"block_size": 9})
    made_of = json.loads((tmp_path / "out" / "sequence.json").read_text())["made_of"]["settings"]
    assert {name: one["settings"] for name, one in made_of.items()} == {"sgbm": expected.model_dump(mode="json")}


def test_it_goes_on_and_refuses_other_settings(sides: Sides, tmp_path: Path, ran: Command) -> None:
    command = ("sequence", *sides, "--out", tmp_path / "out", *GIVEN)
    assert "3 of 3 frames matched" in ran(*command).out
    again = ran(*command)
    assert again.code == 0 and "0 of 3 frames matched" in again.out and "3 finished before" in again.out
    told = ran(*command, "--window-size", 9)
    assert told.code == 4 and "made with other settings" in told.err
    assert ran(*command, "--window-size", 9, "--again", "--json").figures["matched"] == 3


def test_the_frame_before_takes_part_if_asked(sides: Sides, tmp_path: Path, ran: Command) -> None:
    command = ("sequence", *sides, "--out", tmp_path / "out", "--method", "bm", *GIVEN)
    for flags, steadiness in (
        ((), None),
        (("--steadiness", "--again"), {"limit": 1.0}),
        (("--steadiness.limit", 0.5, "--again"), {"limit": 0.5}),
    ):
        assert ran(*command, *flags).code == 0
        assert json.loads((tmp_path / "out" / "sequence.json").read_text())["made_of"]["steadiness"] == steadiness
    refused = ran(*command, "--steadiness.limit", -1)
    assert refused.code == 2 and "--steadiness.limit is -1; allowed are numbers above 0 to 16" in refused.err


def test_motion_is_told_if_asked(tmp_path: Path, ran: Command) -> None:
    (tmp_path / "drive.zip").write_bytes(moving_drives.archive(3))
    for files, said in (
        (("drive.zip", "drive.zip"), "or one ZIP archive alone with both sides in it."),
        (("cut.zip",), "cut.zip: The archive is not a ZIP file, or it is damaged"),
    ):
        (tmp_path / "cut.zip").write_bytes(moving_drives.archive(3)[:2000])
        refused = ran("sequence", *(tmp_path / name for name in files), "--out", tmp_path / "none")
        assert refused.code == 4 and said in refused.err
    (tmp_path / "camera.json").write_text(calibration_json(moving_drives.CAMERA))
    out = tmp_path / "out"
    given = ("--calibration", tmp_path / "camera.json", "--num-disparities", 32, "--trust", "--motion")
    told = ran("sequence", tmp_path / "drive.zip", "--out", out, *given)
    assert (told.code, told.err) == (0, "")
    speeds = [float(row["own_speed_kmh"]) for row in rows_of(out) if row["method"] == "motion"]
    assert speeds == pytest.approx([moving_drives.OWN_KMH] * 2, rel=0.05)


def test_raw_frames_are_rectified_as_a_pair_is(rig: Path, tmp_path: Path, ran: Command) -> None:
    given = ("--trust", "--method", "bm", "--num-disparities", 32, "--calibration", rig / "rig.json", "--json", "--out")
    raw = rig / "raw" / "left", rig / "raw" / "right"
    told = ran("sequence", *raw, *given, tmp_path / "raw")
    assert told.code == 0 and told.figures["rectified_here"] is True
    pair = ran("depth", *(side / "0.png" for side in raw), *given, tmp_path / "pair")
    assert pair.figures["rectified_here"] is True
    for number in range(2):
        np.testing.assert_array_equal(
            sl.read_image(tmp_path / "raw" / "bm" / f"{number}.png"),
            sl.read_image(tmp_path / "pair" / "disparity_kitti.png"),
        )
    known = sl.read_calibration(tmp_path / "pair" / "calibration.json")
    for row in rows_of(tmp_path / "raw"):
        assert float(row["nearest_m"]) == pytest.approx(float(known.depth(float(row["nearest_px"]))), rel=1e-4)
    straight = ran("sequence", rig / "straight/left", rig / "straight/right", *given, tmp_path / "straight")
    assert straight.figures["rectified_here"] is False
    refused = ran("sequence", *raw, *given, tmp_path / "raw", "--rectify", "no")
    assert refused.code == 4 and "made with other frames" in refused.err
    refused = ran("sequence", *raw, *given, tmp_path / "new", "--truth", rig / "truth")
    assert refused.code == 4 and "belongs to them before rectification" in refused.err


@pytest.mark.parametrize(
    ("flags", "code", "sentence"),
    [
        (["--compare", "nothing"], 2, "invalid choice: 'nothing'"),
        (["--disparity-format", ".exr"], 2, "invalid choice: '.exr'"),
        (["--frame-rate", "-1"], 4, "frame_rate is -1.0 Hz"),
        (["--video", "drive.avi"], 4, "a video is written as '.mp4'"),
        (["--preset", "report"], 4, "KITTI's PNG holds 0 to 255 px"),
        (["--scheduler", "nonsense://x"], 4, "There is no Dask scheduler"),
        (None, 2, "--out"),
    ],
)
def test_what_is_refused_is_told_in_one_line(sides, tmp_path, flags, code, sentence, ran):
    more = ["--trust", *([] if flags is None else ["--out", tmp_path / "out", *flags])]
    assert_refused(ran("sequence", *sides, *more), "sequence", code, sentence)


def test_damaged_frames_have_an_exit_code_of_their_own(sides: Sides, tmp_path: Path, ran: Command) -> None:
    whole = (sides[0] / "001.png").read_bytes()
    (sides[0] / "001.png").write_bytes(b"no picture")
    command = ("sequence", *sides, "--out", tmp_path / "out", *GIVEN)
    told = ran(*command)
    assert told.code == 3
    assert told.err.startswith("stereolag sequence: 001: ") and told.err.count("\n") == 1
    assert "2 of 3 frames matched" in told.out and "; 1 damaged" in told.out
    (sides[0] / "001.png").write_bytes(whole)
    told = ran(*command, "--json")
    assert (told.code, told.figures["matched"], told.figures["finished_before"]) == (0, 1, 2)


def test_a_frame_of_two_sizes_is_damaged_for_the_doctor_too(sides: Sides, tmp_path: Path, ran: Command) -> None:
    picture = sl.read_image(sides[0] / "001.png")
    (sides[0] / "001.png").write_bytes(image_png(picture[:-9]))
    told = ran("sequence", *sides, "--out", tmp_path / "out", *RANGE, "--json")
    assert told.code == 3 and [*told.figures["damaged"]] == ["001"] and told.figures["matched"] == 2


def test_help_tells_the_codes_and_the_settings(ran: Command) -> None:
    said = " ".join(ran("sequence", "--help").out.split())
    assert "3 done, but for damaged frames" in said and "130 stopped by Ctrl-C." in said
    assert "(default: fast)" in said and "--median.radius" in said and "--scheduler ADDRESS|local" in said
    assert "--optimisation.penalty-small" in ran("sequence", "--preset", "accurate", "--help").out


def test_a_process_that_is_ended_midway_goes_on_where_it_was(tmp_path: Path, ran: Command) -> None:
    sides = write_folders(tmp_path / "drive", [4 + number % 6 for number in range(200)])[:2]
    out = tmp_path / "out"
    arguments = ("sequence", *sides, "--out", out, "--method", "bm", *GIVEN, "--json")
    # Tests run in the background may ignore Ctrl-C, and child processes inherit that.
    listening = "import signal; signal.signal(signal.SIGINT, signal.default_int_handler); "
    # A signal just after a file is opened leaves closing it to the garbage collector.
    warnings = ["-W", "error", "-W", "ignore::ResourceWarning"]
    command = [sys.executable, *warnings, "-c", listening + CONSOLE, *map(str, arguments)]

    def maps() -> dict[str, int]:
        return {path.name: path.stat().st_mtime_ns for path in out.glob("bm/*.png")}

    before: dict[str, int] = {}
    for ending, code, complaint in (
        (signal.SIGINT, 130, "stereolag sequence: Stopped; the same command continues where it stopped.\n"),
        (signal.SIGKILL, -signal.SIGKILL, ""),
    ):
        process = subprocess.Popen(command, cwd=PROJECT, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
        patience = time.monotonic() + 60
        while len(maps()) < len(before) + 10 and time.monotonic() < patience:
            time.sleep(0.005)
        os.kill(process.pid, ending)
        assert process.communicate(timeout=60) == ("", complaint)
        assert process.returncode == code
        after = maps()
        assert len(before) < len(after) < 200
        assert sum(after[name] != moment for name, moment in before.items()) <= 1
        before = after
    told = ran(*arguments)
    assert (told.code, told.err) == (0, "")
    assert told.figures["matched"] + told.figures["finished_before"] == 200
    assert 200 > told.figures["finished_before"] >= len(before) - 1 > 0
    after = maps()
    assert len(after) == 200
    assert sum(after[name] != moment for name, moment in before.items()) <= 1
    assert [row["number"] for row in rows_of(out)] == [str(number) for number in range(200)]
