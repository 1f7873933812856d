"""A long drive run by the command: its time and memory, and resuming after an interruption."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from itertools import cycle, islice
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import psutil

from benchmarks.sequences import DRIVE, NUM_DISPARITIES
from stereolag.loops.bands import available_cores

CONSOLE = "import sys; from stereolag.commands import main; sys.exit(main())"
PRESET = "fast"
SHORT = 120
"""Number of frames of a short run."""

ENDED_AFTER = 40
"""Number of frames after which a short run is ended by a signal, and again after as many more."""

POLL_S = 0.25
"""Interval at which memory is measured, s."""


def long_drive_table(frames: int) -> tuple[str, dict[str, Any]]:
    """Return the results of a run over this many frames, of one interrupted twice, and of one that loses a worker."""
    with TemporaryDirectory() as name:
        folder = Path(name)
        sides = repeated_drive(folder / "drive", frames)
        whole, memory = watched(sides, folder / "whole", "--video", str(folder / "drive.mp4"))
        few = repeated_drive(folder / "short", SHORT)
        ended = interrupted(few, folder / "ended")
        lost = with_a_worker_killed(few, folder / "cluster")
        first = {name: data for name, data in contents(folder / "whole").items() if int(Path(name).stem) < SHORT}
        same = first == contents(folder / "ended") == contents(folder / "cluster")
    third = max(1, len(memory) // 3)
    peaks = [max(memory[:third]), max(memory[third:-third], default=0.0), max(memory[-third:])]
    by_thirds = ", ".join(f"{one:.0f}" for one in peaks)
    rows = [
        f"{frames} frames | {whole['elapsed_s']:.0f} s, {whole['frames_per_second']:.1f} a second | ≤ 60 s | 45 s",
        f"peak memory | {max(memory):.0f} MB; by thirds {by_thirds} MB | ≤ 1 GB, flat | ",
        f"{SHORT} frames: SIGINT after {ended['sigint']}, SIGKILL after {ended['sigkill']} | "
        f"{ended['matched']} were left to match, {ended['redone']} were matched again | none again | ",
        f"{SHORT} frames on a Dask cluster: one of two workers killed after {lost['killed_after']} | "
        f"{lost['matched']} matched, {lost['damaged']} lost | none lost | ",
    ]
    lines = [
        "| | | must | aim |",
        "|---|---|---|---|",
        *(f"| {row} |" for row in rows),
        "",
        f"`stereolag sequence`, {PRESET} preset, the first with a video; KITTI's 51 grey pairs of 1226 × 370 px over "
        f"and over, {NUM_DISPARITIES} disparities, {available_cores()} cores, load {os.getloadavg()[0]:.1f}. "
        f"The maps of all three runs are {'the same to the bit' if same else 'NOT THE SAME'}.",
    ]
    figures = {"seconds": whole["elapsed_s"], "frames_per_second": whole["frames_per_second"]}
    figures |= {"peak_mb": max(memory), "peak_mb_by_thirds": peaks, "same_to_the_bit": same}
    return "\n".join(lines), figures | {"ended": ended, "worker_killed": lost}


def repeated_drive(folder: Path, frames: int) -> tuple[Path, Path]:
    """Return two folders with this many frames, links that repeat the drive's own."""
    sides = folder / "left", folder / "right"
    for side in sides:
        side.mkdir(parents=True)
        for number, path in enumerate(islice(cycle(sorted((DRIVE / side.name).iterdir())), frames)):
            (side / f"{number:06d}{path.suffix}").symlink_to(path)
    return sides


def begun(sides: tuple[Path, Path], out: Path, *flags: str) -> subprocess.Popen[str]:
    """Start the command."""
    command = [sys.executable, "-c", CONSOLE, "sequence", *map(str, sides), "--out", str(out), "--json"]
    command += ["--trust", "--preset", PRESET, "--num-disparities", str(NUM_DISPARITIES), *flags]
    return subprocess.Popen(command, stdout=subprocess.PIPE, text=True)


def finished(process: subprocess.Popen[str]) -> dict[str, Any]:
    """Wait for the command to end, and return its line of JSON."""
    said, _ = process.communicate()
    if process.returncode:
        raise RuntimeError(f"the command ended with {process.returncode}")
    return dict(json.loads(said))


def watched(sides: tuple[Path, Path], out: Path, *flags: str) -> tuple[dict[str, Any], list[float]]:
    """Run the command; return its output, and samples of the memory of it and its children, MB."""
    process, memory = begun(sides, out, *flags), list[float]()
    first = psutil.Process(process.pid)
    while process.poll() is None:
        with suppress(psutil.NoSuchProcess):
            tree = [first, *first.children(recursive=True)]
            memory.append(sum(one.memory_info().rss for one in tree) / 1e6)
        time.sleep(POLL_S)
    return finished(process), memory


def contents(out: Path) -> dict[str, bytes]:
    """Return the maps in a folder."""
    return {path.name: path.read_bytes() for path in out.glob(f"{PRESET}/*.png")}


def written(out: Path) -> dict[str, int]:
    """Return the modification time of each map in a folder."""
    return {path.name: path.stat().st_mtime_ns for path in out.glob(f"{PRESET}/*.png")}


def ended_by(process: subprocess.Popen[str], ending: signal.Signals, out: Path, count: int) -> int:
    """Send a signal to the command once this many frames are done; return the number of frames in its table."""
    wait_for(lambda: len(written(out)) >= count)
    process.send_signal(ending)
    process.communicate()
    return len((out / "frames.csv").read_text(encoding="utf-8").splitlines()) - 1


def interrupted(sides: tuple[Path, Path], out: Path) -> dict[str, Any]:
    """Return the result of a run ended by SIGINT, resumed, ended by SIGKILL, and resumed."""
    after_sigint = ended_by(begun(sides, out), signal.SIGINT, out, ENDED_AFTER)
    after_sigkill = ended_by(begun(sides, out), signal.SIGKILL, out, 2 * ENDED_AFTER)
    before = written(out)
    last = finished(begun(sides, out))
    after = written(out)
    known = sorted(before)[:after_sigkill]
    return {
        "sigint": after_sigint,
        "sigkill": after_sigkill,
        "matched": last["matched"],
        "finished_before": last["finished_before"],
        "redone": sum(before[name] != after[name] for name in known),
    }


def with_a_worker_killed(sides: tuple[Path, Path], out: Path) -> dict[str, Any]:
    """Return the result of a run on a scheduler and two workers, one of which was killed midway."""
    with cluster() as (address, workers):
        process = begun(sides, out, "--scheduler", address)
        wait_for(lambda: len(written(out)) >= ENDED_AFTER)
        workers[0].kill()
        count = len(written(out))
        told = finished(process)
    return {"killed_after": count, "matched": told["matched"], "damaged": len(told["damaged"])}


@contextmanager
def cluster() -> Iterator[tuple[str, list[subprocess.Popen[bytes]]]]:
    """Start a Dask scheduler and two workers without a nanny, each in its own process."""
    with TemporaryDirectory() as name:
        noted = Path(name) / "scheduler.json"
        dask, common = [sys.executable, "-m", "dask"], ["--scheduler-file", str(noted), "--no-dashboard"]
        started = [quiet([*dask, "scheduler", "--host", "127.0.0.1", "--port", "0", *common])]
        try:
            wait_for(noted.is_file)
            worker = [*dask, "worker", *common, "--nthreads", "1", "--no-nanny", "--local-directory", name]
            started += [quiet(worker) for _ in range(2)]
            yield json.loads(noted.read_text(encoding="utf-8"))["address"], started[1:]
        finally:
            for process in started:
                process.kill()
                process.wait()


def quiet(command: list[str]) -> subprocess.Popen[bytes]:
    """Start a process and discard its output."""
    return subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)


def wait_for(ready: Callable[[], bool], patience_s: float = 300) -> None:
    """Wait until a condition is true.

    Raises
    ------
    TimeoutError
        It is not true in time.
    """
    end = time.monotonic() + patience_s
    while not ready():
        if time.monotonic() > end:
            raise TimeoutError("nothing happened")
        time.sleep(0.02)
