"""The program in the README runs as it stands there, and prints what the app shows."""

from __future__ import annotations

import re
import subprocess
import sys
from pathlib import Path

import pytest
from commanded import ran

import stereolag as sl
from stereolag.settings import changed

PROJECT = Path(__file__).resolve().parents[2]


def programs() -> list[str]:
    blocks = re.findall(r"```python\n(.*?)```", (PROJECT / "README.md").read_text(encoding="utf-8"), re.DOTALL)
    assert len(blocks) == 2
    return blocks


def test_the_program_in_the_readme_runs_in_the_project_folder() -> None:
    command = [sys.executable, "-W", "error", "-c", programs()[0]]
    ran = subprocess.run(command, cwd=PROJECT, capture_output=True, text=True, check=False)
    assert ran.stderr == ""
    lines = ran.stdout.splitlines()
    assert lines[0].startswith("50082 1.1356")
    assert lines[1].startswith("528 982 ")
    windows, accurate, block = (float(line.rpartition(" ")[2]) for line in lines if line.startswith("<DisparityMap"))
    assert 0 < accurate < windows < block < 30
    assert lines[-2] == "[]"
    assert lines[-1].startswith("{")


def test_the_drive_in_the_readme_is_computed(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "assets").symlink_to(PROJECT / "assets")
    monkeypatch.chdir(tmp_path)
    exec(programs()[1], {})
    assert (tmp_path / "drive.mp4").is_file()
    assert len([*(tmp_path / "maps").rglob("*.png")]) == 60


def test_the_commands_in_the_readme_run(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    readme = (PROJECT / "README.md").read_text(encoding="utf-8")
    (block,) = re.findall(r"```\n(stereolag (?!app).*?)```", readme, re.DOTALL)
    *lines, calibrating = block.splitlines()
    (tmp_path / "assets").symlink_to(PROJECT / "assets")
    monkeypatch.chdir(tmp_path)
    said = []
    for line in lines:
        told = ran(capsys, *line.split()[1:])
        assert (told.code, told.err) == (0, ""), line
        said.append(told.out)
    assert said[0].startswith("lag       50082 samples")
    assert '"row": 528, "col": 982' in said[1]
    assert "bad-2 0." in said[2]
    assert sl.read_matcher(tmp_path / "map/settings.json") == changed(sl.preset("fast"), {"median.radius": 4})
    assert said[-2].startswith("row 528, column 982, score 1.000")
    assert said[-1].startswith("60 of 60 frames matched in ")
    refused = ran(capsys, *calibrating.split()[1:])
    assert refused.err == "stereolag calibrate: pairs.zip: there is no such file or folder.\n"
