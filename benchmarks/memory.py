"""The memory of this process as counted by Linux, since sampling would miss its peak."""

from __future__ import annotations

import ctypes
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path

CLEAR_REFS = Path("/proc/self/clear_refs")
"""Writing to it makes Linux reset a process's peak memory."""


def peak_extra_memory(job: Callable[[], object]) -> float:
    """Return the rise of this process's resident memory to its peak while `job` runs, MB."""
    with suppress(AttributeError):  # memory that glibc has kept would not raise the peak
        ctypes.CDLL(None).malloc_trim(0)
    reset_peak()
    before = resident_mb()
    job()
    return peak_mb() - before


def resident_mb() -> float:
    """Return the resident memory of this process, MB."""
    return _status("VmRSS")


def peak_mb() -> float:
    """Return the peak of the resident memory since its reset, MB."""
    return _status("VmHWM")


def reset_peak() -> None:
    """Reset the peak to the current memory, if Linux allows that."""
    with suppress(OSError):
        CLEAR_REFS.write_text("5")


def _status(name: str) -> float:
    (line,) = (line for line in Path("/proc/self/status").read_text().splitlines() if line.startswith(f"{name}:"))
    return int(line.split()[1]) * 1024 / 1e6
