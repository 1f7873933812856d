"""Helpers that run exported programs unmodified."""

import io
import os
import runpy
import subprocess
import sys
from contextlib import chdir, redirect_stdout
from pathlib import Path

PROJECT = Path(__file__).resolve().parents[1]


def run_program(program: Path) -> str:
    """Run a program from its grandparent folder and return its output; the imports of this process are reused."""
    with chdir(program.parent.parent), redirect_stdout(io.StringIO()) as printed:
        runpy.run_path(str(program), run_name="__main__")
    return printed.getvalue()


def run_program_alone(program: Path) -> str:
    """Run a program as :func:`run_program` does, but in its own process, which spends seconds on imports."""
    environment = os.environ | {"PYTHONPATH": str(PROJECT), "PYTHONWARNINGS": "error::FutureWarning"}
    command = [sys.executable, str(program)]
    done = subprocess.run(
        command, cwd=program.parent.parent, env=environment, capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr
    return done.stdout
