"""Runs tests repeatedly on a busy machine, and counts how often each fails.

``python -m tools.repeated --times 20 tests/browser``; unknown arguments are passed to pytest. A test that does not
wait long enough passes on an idle machine. The exit code is 1 if any test failed.
"""

from __future__ import annotations

import argparse
import os
import subprocess
import sys
import time
from collections import Counter
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from tempfile import TemporaryDirectory
from xml.etree import ElementTree

PROJECT = Path(__file__).resolve().parents[1]

BUSY_LOOP = "while True: pass"


@contextmanager
def busy_processes(number: int) -> Iterator[None]:
    """Keep a number of cores busy within the context."""
    processes = [subprocess.Popen([sys.executable, "-c", BUSY_LOOP]) for _ in range(number)]
    try:
        yield
    finally:
        for process in processes:
            process.kill()
            process.wait()


def failures_in(report: Path) -> list[str]:
    """Return the names of the failed tests in a JUnit XML report."""
    cases = ElementTree.parse(report).getroot().iter("testcase")
    return [
        f"{case.get('classname')}::{case.get('name')}"
        for case in cases
        if case.find("failure") is not None or case.find("error") is not None
    ]


def run_once(arguments: list[str], log: Path) -> list[str]:
    """Run pytest, log its output, and return the failed tests, or the run itself if it failed without a report."""
    with TemporaryDirectory() as folder:
        report = Path(folder) / "report.xml"
        command = [
            sys.executable,
            "-m",
            "pytest",
            "-q",
            "-p",
            "no:cacheprovider",
            "--force-reruns=0",
            f"--junitxml={report}",
            *arguments,
        ]
        with log.open("w", encoding="utf-8") as printed:
            ran = subprocess.run(command, cwd=PROJECT, stdout=printed, stderr=subprocess.STDOUT, check=False)
        failed = failures_in(report) if report.is_file() else []
    return failed or ([f"the run itself: exit code {ran.returncode}"] if ran.returncode else [])


def main() -> int:
    parser = argparse.ArgumentParser(prog="python -m tools.repeated", description=__doc__)
    parser.add_argument("--times", type=int, default=20, help="how often the tests run")
    parser.add_argument(
        "--busy", type=int, default=max(1, (os.cpu_count() or 1) // 2), help="how many cores are kept busy"
    )
    parser.add_argument(
        "--logs",
        type=Path,
        default=PROJECT / ".pytest_cache" / "repeated",
        help="where the output of the runs is written",
    )
    arguments, pytest_arguments = parser.parse_known_args()
    arguments.logs.mkdir(parents=True, exist_ok=True)
    counts: Counter[str] = Counter()
    with busy_processes(arguments.busy):
        for number in range(1, arguments.times + 1):
            start = time.monotonic()
            failed = run_once(pytest_arguments, arguments.logs / f"{number:02}.txt")
            counts.update(failed)
            print(
                f"run {number} of {arguments.times}: {len(failed)} failed, {time.monotonic() - start:.0f} s", flush=True
            )
    for name, count in counts.most_common():
        print(f"{count:3} of {arguments.times}  {name}")
    print(f"{len(counts)} tests failed at least once in {arguments.times} runs beside {arguments.busy} busy processes")
    return 1 if counts else 0


if __name__ == "__main__":
    sys.exit(main())
