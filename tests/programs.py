"""Runs a program that was taken away, as whoever took it does: in a process of its own."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

PROJECT = Path(__file__).resolve().parents[1]


def printed_by(program: Path, folder: Path | None = None) -> str:
    """Run a program, in a folder if told, and return what it printed; it must end well and use nothing deprecated."""
    done = subprocess.run(
        [sys.executable, str(program)],
        cwd=folder,
        env=os.environ | {"PYTHONPATH": str(PROJECT), "PYTHONWARNINGS": "error::FutureWarning"},
        capture_output=True,
        text=True,
    )
    assert done.returncode == 0, done.stderr
    return done.stdout
