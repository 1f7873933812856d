"""``stereolag sequence``: in this process and as a program."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

import pytest
from small_drives import write_folders

from stereolag import StereoSGBM, write_matcher
from stereolag.commands.sequence import CANCELLED, DAMAGED, DONE, REFUSED, USAGE, main

PROJECT = Path(__file__).resolve().parents[2]
RANGE = ["--num-disparities", "16"]


@pytest.fixture
def sides(tmp_path: Path) -> list[str]:
    return [str(folder) for folder in write_folders(tmp_path / "drive", [4, 5, 6])[:2]]


def test_maps_a_table_and_a_video(sides: list[str], tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out, video = tmp_path / "out", tmp_path / "drive.mp4"
    calibration = tmp_path / "calibration.json"
    calibration.write_text('{"focal_px": 100, "baseline_m": 0.5}')
    flags = ["--compare", "bm", "--calibration", str(calibration), "--truth", str(tmp_path / "drive" / "truth")]
    code = main([*sides, "--out", str(out), *RANGE, *flags, "--video", str(video), "--json"])
    said = json.loads(capsys.readouterr().out)
    assert code == DONE and (said["matched"], said["total"], said["damaged"]) == (3, 3, {})
    assert len(list(out.glob("fast/*.png"))) == len(list(out.glob("bm/*.png"))) == 3
    assert video.stat().st_size > 1000
    first = (out / "frames.csv").read_text().splitlines()[1].split(",")
    assert float(first[7]) == pytest.approx(50 / 4, rel=0.1) and float(first[9]) < 1


def test_settings_of_the_page_and_going_on(
    sides: list[str], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    settings, out = tmp_path / "settings.json", tmp_path / "out"
    write_matcher(settings, StereoSGBM(num_disparities=16))
    command = [*sides, "--out", str(out), "--settings", str(settings)]
    assert main(command) == DONE
    assert "3 of 3 frames matched" in capsys.readouterr().out
    assert main(command) == DONE
    assert "3 were finished before" in capsys.readouterr().out
    assert main([*sides, "--out", str(out), *RANGE]) == REFUSED
    assert "made with other settings" in capsys.readouterr().err
    assert main([*sides, "--out", str(out), *RANGE, "--again"]) == DONE


@pytest.mark.parametrize(
    ("flags", "sentence"),
    [
        (["--preset", "best"], "preset is 'best'; allowed are report, fast, accurate."),
        (["--compare", "nothing"], "compare names 'nothing'; allowed are"),
        (["--num-disparities", "0"], "num_disparities"),
        (["--frame-rate", "-1"], "frame_rate is -1.0 Hz"),
        (["--video", "drive.avi"], "a video is written as '.mp4'"),
        (["--settings", "/nowhere/settings.json"], "No such file"),
        (["--scheduler", "nonsense://x"], "There is no Dask scheduler"),
    ],
)
def test_what_is_refused_is_told_in_one_line(
    sides: list[str], tmp_path: Path, flags: list[str], sentence: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main([*sides, "--out", str(tmp_path / "out"), *RANGE, *flags]) == REFUSED
    captured = capsys.readouterr()
    assert sentence in captured.err and captured.err.count("\n") == 1 and not captured.out


def test_damaged_frames_have_an_exit_code_of_their_own(
    sides: list[str], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (Path(sides[0]) / "001.png").write_bytes(b"no picture")
    assert main([*sides, "--out", str(tmp_path / "out"), *RANGE]) == DAMAGED
    captured = capsys.readouterr()
    assert captured.err.startswith("001: ") and "1 are damaged" in captured.out


def test_stopping_has_one_too(
    sides: list[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def stopped(*_: object, **__: object) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr("stereolag.sequences.run_sequence", stopped)
    assert main([*sides, "--out", str(tmp_path / "out")]) == CANCELLED
    assert "goes on where it was" in capsys.readouterr().err


def test_wrong_flags_are_wrong_usage(capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as ended:
        main(["left"])
    assert ended.value.code == USAGE


def test_as_a_program(sides: list[str], tmp_path: Path) -> None:
    command = [sys.executable, "-m", "stereolag.commands.sequence", *sides, "--out", str(tmp_path / "out"), *RANGE]
    ran = subprocess.run([*command, "--json"], cwd=PROJECT, capture_output=True, text=True, check=False)
    assert ran.returncode == DONE and json.loads(ran.stdout)["matched"] == 3 and ran.stderr == ""
