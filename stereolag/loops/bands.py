"""Work divided among the cores, as jobs or as bands of rows of an image."""

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

_THREAD_PREFIX = "bands"
"""Start of the names of threads that run all jobs of their own work themselves."""


def available_cores() -> int:
    """Return the number of cores this process may use."""
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


@cache
def _pool() -> ThreadPoolExecutor:
    """Return the pool that all callers share: simultaneous callers take turns, job by job.

    The threads are kept, since a new one starts on the core of its creator, and both share it for milliseconds.
    """
    return ThreadPoolExecutor(available_cores(), thread_name_prefix=_THREAD_PREFIX)


if hasattr(os, "register_at_fork"):  # a forked process has none of the pool's threads
    os.register_at_fork(after_in_child=_pool.cache_clear)


def lone_threads(name: str) -> ThreadPoolExecutor:
    """Return threads, one per core, each of which runs all jobs of its work itself.

    For work in many equal pieces: on other cores, the jobs would wait for each other, and their data leave the caches.
    """
    return ThreadPoolExecutor(available_cores(), thread_name_prefix=f"{_THREAD_PREFIX}-{name}")


def in_threads(jobs: Sequence[Callable[[], Result]], progress: Progress = silent) -> list[Result]:
    """Run jobs on all cores, and return their results in order; a job's own jobs run in its thread.

    Parameters
    ----------
    jobs
        They profit from several cores if they release the interpreter lock, as compiled code does.
    progress
        Called from the calling thread with the fraction done, once per job and at least ten times a second. If it or a
        job raises, jobs that have not started never do.
    """
    if threading.current_thread().name.startswith(_THREAD_PREFIX) or (len(jobs) < 2 and progress is silent):
        results = []
        for number, job in enumerate(jobs, 1):
            results.append(job())
            progress(number / len(jobs))
        return results
    if progress is silent:
        return _run_in_pool(jobs)
    waiting = iter(jobs)
    futures: list[Future[Result]] = []
    running: set[Future[Result]] = set()
    done = 0
    try:
        while done < len(jobs):
            # Submit no more than the cores can run at once, so that other callers get their turn.
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


def _run_in_pool(jobs: Sequence[Callable[[], Result]]) -> list[Result]:
    """Run the jobs in the pool, and in this thread those that no thread of the pool has begun yet."""
    futures = [_pool().submit(job) for job in jobs[1:]]
    try:
        return [
            jobs[0](),
            *(job() if future.cancel() else future.result() for job, future in zip(jobs[1:], futures, strict=True)),
        ]
    finally:
        for future in futures:
            future.cancel()
        wait(futures)


def row_bands(rows: int, max_rows: int) -> list[tuple[int, int]]:
    """Return (first, end) of bands of nearly equal height, at most `max_rows`, and equally many for each core."""
    cores = available_cores()
    rounds = -(-rows // (max(1, max_rows) * cores))
    count = min(rows, rounds * cores)
    return [(rows * band // count, rows * (band + 1) // count) for band in range(count)]


def over_bands(
    work: Callable[[int, int], None], rows: int, *, max_rows: int | None = None, progress: Progress = silent
) -> None:
    """Call ``work(first, end)`` for every band of rows, on all cores, and return when all are done.

    Parameters
    ----------
    work
        Must release the interpreter lock (compiled code does) and write only to its own rows.
    rows
        Number of rows.
    max_rows
        Largest height of a band, which should take less than a tenth of a second. By default one band per core.
    progress
        Called from the calling thread with the fraction done: after each band, or at the end if no core has two.
    """
    bands = [partial(work, *band) for band in row_bands(rows, max_rows or rows)]
    if len(bands) > available_cores():
        in_threads(bands, progress)
    else:
        in_threads(bands)
        progress(1.0)


MAX_SERIAL_PIXELS = 30_000
"""Pixels up to which the calling thread does all rows, since distributing them takes as long."""


def over_image(work: Callable[[int, int], None], shape: tuple[int, ...]) -> None:
    """Call ``work(first, end)`` for bands of rows of an image (rows, cols), as :func:`over_bands` does."""
    if shape[0] * shape[1] <= MAX_SERIAL_PIXELS:
        work(0, shape[0])
    else:
        over_bands(work, shape[0])
