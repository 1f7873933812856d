"""Rows of an image, divided among the cores."""

from __future__ import annotations

import os
from collections.abc import Callable
from concurrent.futures import FIRST_COMPLETED, ThreadPoolExecutor, wait
from functools import cache
from itertools import islice

from stereolag.core.jobs import Progress, silent


def available_cores() -> int:
    """Return how many cores this process may use."""
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


@cache
def _pool() -> ThreadPoolExecutor:
    """Return the one pool that all callers share: two callers at once take turns, band by band."""
    return ThreadPoolExecutor(available_cores(), thread_name_prefix="bands")


def row_bands(rows: int, most_rows: int) -> list[tuple[int, int]]:
    """Return (first, end) of bands of nearly equal height, at most `most_rows`, and the same number for each core."""
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
        Must release the interpreter lock (compiled code does) and write only to its own rows.
    rows
        Number of rows.
    most_rows
        Largest height of a band; progress is reported once per band. By default one band per core.
    progress
        Called from the calling thread with the fraction of bands done.
    """
    bands = row_bands(rows, most_rows or rows)
    waiting = iter(bands)
    pool, done = _pool(), 0
    # Submit no more than the cores can run at once, so that bands of another caller can come in between.
    running = {pool.submit(work, *band) for band in islice(waiting, available_cores())}
    try:
        while running:
            finished, running = wait(running, return_when=FIRST_COMPLETED)
            for future in finished:
                future.result()
                running |= {pool.submit(work, *band) for band in islice(waiting, 1)}
                done += 1
                progress(done / len(bands))
    finally:
        for future in running:
            future.cancel()


SMALL = 30_000
"""Pixels up to which the calling thread does all rows: to hand some of them on takes as long."""


def over_image(work: Callable[[int, int], None], shape: tuple[int, ...]) -> None:
    """Call ``work(first, end)`` for bands of rows of an image (rows, cols), as :func:`over_bands` does."""
    if shape[0] * shape[1] <= SMALL:
        work(0, shape[0])
    else:
        over_bands(work, shape[0])
