"""Rows of a picture, shared out over the cores."""

from __future__ import annotations

import os
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor, as_completed
from functools import cache

from stereolag.progress import Progress, silent


def available_cores() -> int:
    """Return how many cores this process may use."""
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


@cache
def _pool() -> ThreadPoolExecutor:
    """Return the one pool that every caller shares: two callers at once take turns instead of crowding the cores."""
    return ThreadPoolExecutor(available_cores(), thread_name_prefix="bands")


def row_bands(rows: int, most_rows: int) -> list[tuple[int, int]]:
    """Return (first, end) of bands of nearly equal height, at most `most_rows`, and equally many for each core."""
    cores = available_cores()
    rounds = -(-rows // (max(1, most_rows) * cores))
    count = min(rows, rounds * cores)
    return [(rows * band // count, rows * (band + 1) // count) for band in range(count)]


def over_bands(
    work: Callable[[int, int], None], rows: int, *, most_rows: int | None = None, progress: Progress = silent
) -> None:
    """Call ``work(first, end)`` for every band of rows, on all cores, and return when all are done.

    Parameters
    ----------
    work
        Must release the interpreter lock (compiled code does) and write only what belongs to its own rows.
    rows
        How many rows there are.
    most_rows
        The tallest band allowed: progress is told once a band. By default one band a core.
    progress
        Called from the calling thread with the fraction of bands done.
    """
    futures = [_pool().submit(work, first, end) for first, end in row_bands(rows, most_rows or rows)]
    try:
        for done, future in enumerate(as_completed(futures), start=1):
            future.result()
            progress(done / len(futures))
    finally:
        for future in futures:
            future.cancel()
