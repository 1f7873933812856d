"""The memory of this process as Linux counts it: looking now and then would miss its highest."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import suppress
from pathlib import Path

CLEAR_REFS = Path("/proc/self/clear_refs")
"""Where a process tells Linux to forget how much memory it had at the most."""


def peak_extra_memory(job: Callable[[], object]) -> float:
    """Return by how many MB the resident memory of this process rises at the most while `job` runs."""
    reset_peak()
    before = resident_mb()
    job()
    return peak_mb() - before


def resident_mb() -> float:
    """Return the resident memory of this process, MB."""
    return _status("VmRSS")


def peak_mb() -> float:
    """Return its highest since it was reset, MB."""
    return _status("VmHWM")


def reset_peak() -> None:
    """Make the highest of this process that of now; where Linux does not allow it, it stays the highest ever."""
    with suppress(OSError):
        CLEAR_REFS.write_text("5")


def _status(name: str) -> float:
    (line,) = (line for line in Path("/proc/self/status").read_text().splitlines() if line.startswith(f"{name}:"))
    return int(line.split()[1]) * 1024 / 1e6
