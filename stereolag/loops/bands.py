"""Work divided among the cores, as jobs or as bands of the rows of an image."""

from __future__ import annotations

import os
import threading
from collections.abc import Callable, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, ThreadPoolExecutor, wait
from functools import cache, partial
from itertools import islice
from typing import TypeVar

from stereolag.core.jobs import Progress, silent

Result = TypeVar("Result")

_PREFIX = "bands"
"""Of the names of threads whose own jobs run in them."""


def available_cores() -> int:
    """Return how many cores this process may use."""
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


@cache
def _pool() -> ThreadPoolExecutor:
    """Return the one pool that all callers share: two callers at once take turns, job by job.

    It is kept: a new thread starts on the core of the one that starts it, and both share it for milliseconds.
    """
    return ThreadPoolExecutor(available_cores(), thread_name_prefix=_PREFIX)


if hasattr(os, "register_at_fork"):  # a forked process has none of the pool's threads
    os.register_at_fork(after_in_child=_pool.cache_clear)


def lone_threads(name: str) -> ThreadPoolExecutor:
    """Return threads, one per core, each of which runs the jobs of its work alone.

    For work of many equal pieces: handed to each other's cores, their jobs would wait, and their data leave the caches.
    """
    return ThreadPoolExecutor(available_cores(), thread_name_prefix=f"{_PREFIX}-{name}")


def in_threads(jobs: Sequence[Callable[[], Result]], progress: Progress = silent) -> list[Result]:
    """Run jobs on all cores, and return their results in order; a job's own jobs run in its thread.

    Parameters
    ----------
    jobs
        They gain by other cores if they release the interpreter lock, as compiled code does.
    progress
        Called from the calling thread with the fraction done, once per job and at least ten times a second. If it or a
        job raises, jobs that have not started never do.
    """
    if threading.current_thread().name.startswith(_PREFIX) or (len(jobs) < 2 and progress is silent):
        results = []
        for number, job in enumerate(jobs, 1):
            results.append(job())
            progress(number / len(jobs))
        return results
    if progress is silent:
        return _shared(jobs)
    waiting = iter(jobs)
    futures: list[Future[Result]] = []
    running: set[Future[Result]] = set()
    done = 0
    try:
        while done < len(jobs):
            # Submit no more than the cores can run at once, so that jobs of another caller can come in between.
            more = [_pool().submit(job) for job in islice(waiting, available_cores() - len(running))]
            futures += more
            finished, running = wait(running.union(more), 0.1, FIRST_COMPLETED)
            for future in finished:
                future.result()
                done += 1
                progress(done / len(jobs))
            if not finished:
                progress(done / len(jobs))
        return [future.result() for future in futures]
    finally:
        for future in running:
            future.cancel()
        wait(running)


def _shared(jobs: Sequence[Callable[[], Result]]) -> list[Result]:
    """Run the jobs in the pool and, to wait for no thread to wake up, those that it has not begun in this thread."""
    futures = [_pool().submit(job) for job in jobs[1:]]
    try:
        return [
            jobs[0](),
            *(job() if one.cancel() else one.result() for job, one in zip(jobs[1:], futures, strict=True)),
        ]
    finally:
        for future in futures:
            future.cancel()
        wait(futures)


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
        Largest height of a band, which is to take less than a tenth of a second. By default one band per core.
    progress
        Called from the calling thread with the fraction done: after each band, or at the end if no core has two.
    """
    bands = [partial(work, *band) for band in row_bands(rows, most_rows or rows)]
    if len(bands) > available_cores():
        in_threads(bands, progress)
    else:
        in_threads(bands)
        progress(1.0)


SMALL = 30_000
"""Pixels up to which the calling thread does all rows: to hand some of them on takes as long."""


def over_image(work: Callable[[int, int], None], shape: tuple[int, ...]) -> None:
    """Call ``work(first, end)`` for bands of rows of an image (rows, cols), as :func:`over_bands` does."""
    if shape[0] * shape[1] <= SMALL:
        work(0, shape[0])
    else:
        over_bands(work, shape[0])
