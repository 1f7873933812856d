"""The program in the README runs as it stands there, and prints what the app shows."""

from __future__ import annotations

import re
import subprocess
import sys
from pathlib import Path

PROJECT = Path(__file__).resolve().parents[2]


def test_the_program_in_the_readme_runs_in_the_project_folder() -> None:
    blocks = re.findall(r"```python\n(.*?)```", (PROJECT / "README.md").read_text(encoding="utf-8"), re.DOTALL)
    assert len(blocks) == 1
    command = [sys.executable, "-W", "error", "-c", blocks[0]]
    ran = subprocess.run(command, cwd=PROJECT, capture_output=True, text=True, check=False)
    assert ran.stderr == ""
    lines = ran.stdout.splitlines()
    assert lines[0].startswith("50082 1.1356")
    assert lines[1].startswith("528 982 ")
    windows, accurate, block = (float(line.rpartition(" ")[2]) for line in lines if line.startswith("<DisparityMap"))
    assert 0 < accurate < windows < block < 30
    assert lines[-2] == "[]"
    assert lines[-1].startswith("{")
