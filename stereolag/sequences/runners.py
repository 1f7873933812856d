"""Runners that match frames: on threads of this process, or on the workers of a Dask cluster."""

from __future__ import annotations

import math
import signal
import threading
import time
from collections import Counter, deque
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import CancelledError, ThreadPoolExecutor
from contextlib import ExitStack, contextmanager
from itertools import islice
from typing import Any, Protocol

from stereolag.core.jobs import Progress
from stereolag.loops.bands import available_cores
from stereolag.sequences.matching import FrameMaps, FrameTask, MatchedFrame, encoded_frame, match_frame, matched_frame

LOCAL = "local"
"""Scheduler address for a cluster of processes on this machine that lasts as long as the job."""

LOOKS_S = 0.1
"""Interval at which the job checks for cancellation."""

_CONNECTS_S = "10s"
_COUNTS_S = 5.0


class Pending(Protocol):
    """A frame being matched somewhere."""

    def result(self, timeout: float | None = None) -> MatchedFrame:
        """Wait for the frame; raise ``TimeoutError`` if it is not ready in time."""

    def cancel(self) -> object:
        """Cancel the frame, if it has not begun."""


class Runner(Protocol):
    """Runner that matches several frames at once."""

    @property
    def at_once(self) -> int:
        """Return the largest number of frames in flight, which bounds memory however long the sequence is."""

    def submit(self, task: FrameTask) -> Pending:
        """Start a frame as soon as there is room for it."""


class PairRunner(Runner, Protocol):
    """Runner that matches frames and can steady each with the previous one."""

    def match(self, task: FrameTask) -> Any:
        """Return a promise of a frame's own maps, to be passed to :meth:`submit_steady`, usually twice."""

    def submit_steady(self, task: FrameTask, own: Any, before: Any | None) -> Pending:
        """Start a frame, given promises of its own maps and of the previous frame's."""


class SteadyRunner:
    """Runner that steadies frames on another runner, without matching any frame twice or waiting for its own maps.

    Parameters
    ----------
    runner
        The runner that does the work.
    numbers
        The numbers of the frames that will be submitted, each once.
    task
        Returns the task of any frame.
    """

    def __init__(self, runner: PairRunner, numbers: Iterable[int], task: Callable[[int], FrameTask]) -> None:
        self._runner, self._task = runner, task
        self._uses = Counter(one for number in numbers for one in (number, number - 1))
        self._promised: dict[int, Any] = {}

    @property
    def at_once(self) -> int:
        """Return the largest number of frames in flight."""
        return self._runner.at_once

    def submit(self, task: FrameTask) -> Pending:
        """Start a frame."""
        before = self._own(task.number - 1) if task.number else None
        return self._runner.submit_steady(task, self._own(task.number), before)

    def _own(self, number: int) -> Any:
        """Return the promise of a frame, and drop it after its last use."""
        self._uses[number] -= 1
        if number not in self._promised:
            self._promised[number] = self._runner.match(self._task(number))
        return self._promised[number] if self._uses[number] > 0 else self._promised.pop(number)


def in_order(runner: Runner, tasks: Iterable[FrameTask], look: Callable[[], None]) -> Iterator[MatchedFrame]:
    """Yield the frames in the order of their tasks, with no more in flight than the runner allows.

    Parameters
    ----------
    runner, tasks
        The runner and its tasks.
    look
        Called ten times a second while waiting; an exception from it ends the job.
    """
    coming = iter(tasks)
    waiting: deque[tuple[int, Pending]] = deque()
    try:
        while True:
            room = max(0, runner.at_once - len(waiting))  # the limit may fall once a worker has died
            waiting.extend((task.number, runner.submit(task)) for task in islice(coming, room))
            if not waiting:
                return
            yield _awaited(*waiting.popleft(), look)
    finally:
        for _, pending in waiting:
            pending.cancel()


def _awaited(number: int, pending: Pending, look: Callable[[], None]) -> MatchedFrame:
    while True:
        try:
            look()
            return pending.result(timeout=LOOKS_S)
        except TimeoutError:
            continue
        except BaseException:
            pending.cancel()
            raise


@contextmanager
def runner_at(scheduler: str | None) -> Iterator[PairRunner]:
    """Open the runner for a scheduler; None means threads of this process.

    Raises
    ------
    ValueError
        If Dask is not installed.
    ConnectionError
        If there is no scheduler at that address.
    """
    opened = ThreadRunner() if scheduler is None else _dask_runner(scheduler)
    with opened as runner:
        yield runner


class ThreadRunner:
    """Runner on threads of this process: while one frame is decoded or encoded, another one is matched.

    On exit, frames in flight end within a few image rows.
    """

    def __init__(self) -> None:
        # One more than there are cores, as the serial parts of a frame leave some cores idle.
        threads = available_cores() + 1
        self.at_once = threads + 2
        self._stop = threading.Event()
        self._pool = ThreadPoolExecutor(threads, thread_name_prefix="frames")

    def __enter__(self) -> ThreadRunner:
        return self

    def __exit__(self, *_: object) -> None:
        self._stop.set()
        self._pool.shutdown(wait=True, cancel_futures=True)

    def submit(self, task: FrameTask) -> Pending:
        """Start a frame as soon as a thread is free."""
        return self._pool.submit(matched_frame, task, self._stop_here)

    def match(self, task: FrameTask) -> LazyFrame:
        """Return a promise of a frame: the first thread that needs it matches it."""
        return LazyFrame(task, self._stop_here)

    def submit_steady(self, task: FrameTask, own: LazyFrame, before: LazyFrame | None) -> Pending:
        """Start a frame as soon as a thread is free."""
        return self._pool.submit(_steady_frame, task, own, before)

    def _stop_here(self, fraction: float) -> None:
        if self._stop.is_set():
            raise CancelledError


class LazyFrame:
    """A frame's own maps, computed by the first thread to ask while others wait; it cannot deadlock."""

    def __init__(self, task: FrameTask, progress: Progress) -> None:
        self._task, self._progress = task, progress
        self._lock = threading.Lock()
        self._found: FrameMaps | None = None

    def __call__(self) -> FrameMaps:
        """Return the maps, matching the frame if nobody has yet."""
        with self._lock:
            if self._found is None:
                self._found = match_frame(self._task, self._progress)
            return self._found


def _steady_frame(task: FrameTask, own: LazyFrame, before: LazyFrame | None) -> MatchedFrame:
    return encoded_frame(task, own(), None if before is None else before())


@contextmanager
def _dask_runner(scheduler: str) -> Iterator[PairRunner]:
    try:
        import distributed
    except ImportError as error:
        raise ValueError("A scheduler needs the package dask.distributed: pip install 'stereolag[cluster]'.") from error
    with ExitStack() as stack:
        address: Any = scheduler
        if scheduler == LOCAL:
            address = stack.enter_context(
                distributed.LocalCluster(  # type: ignore[no-untyped-call]
                    n_workers=available_cores(),
                    threads_per_worker=1,
                    dashboard_address=None,
                    silence_logs="ERROR",
                    preload=__name__,
                )
            )
        opening: Any = distributed.Client
        try:
            client = opening(address, timeout=_CONNECTS_S, set_as_default=False)
        except (OSError, ValueError, TypeError) as error:
            raise ConnectionError(f"There is no Dask scheduler at {scheduler!r}: {error}") from error
        stack.callback(client.close)
        yield DaskRunner(client)


def dask_setup(worker: object) -> None:
    """Make a local worker ignore Ctrl-C, which the terminal sends to all processes; Dask calls this at startup.

    The process that started the job ends it, and the workers with it.
    """
    signal.signal(signal.SIGINT, signal.SIG_IGN)


class DaskRunner:
    """Runner on a Dask cluster, whose workers read the frames themselves; frames of a dead worker go to another one.

    Parameters
    ----------
    client
        A ``distributed.Client``.
    """

    def __init__(self, client: Any) -> None:
        self._client = client
        self._looked = -math.inf
        self.at_once = 4

    def submit(self, task: FrameTask) -> Pending:
        """Send a frame to a worker."""
        self._count_workers()
        return _OnWorker(task.number, self._client.submit(matched_frame, task, pure=False))

    def match(self, task: FrameTask) -> Any:
        """Have a worker match a frame and keep the result."""
        return self._client.submit(match_frame, task, pure=False)

    def submit_steady(self, task: FrameTask, own: Any, before: Any | None) -> Pending:
        """Send a frame to the worker that has its maps."""
        self._count_workers()
        return _OnWorker(task.number, self._client.submit(encoded_frame, task, own, before, pure=False))

    def _count_workers(self) -> None:
        """Adapt the number of frames in flight to the workers, which come and go."""
        if time.monotonic() - self._looked > _COUNTS_S:
            self._looked = time.monotonic()
            workers = self._client.scheduler_info(n_workers=-1)["workers"].values()
            self.at_once = max(4, 3 * sum(worker["nthreads"] for worker in workers))


class _OnWorker:
    """A frame on a worker."""

    def __init__(self, number: int, future: Any) -> None:
        self._number, self._future = number, future

    def result(self, timeout: float | None = None) -> MatchedFrame:
        """Wait for the frame; a frame that repeatedly kills its worker counts as damaged."""
        from distributed import KilledWorker

        try:
            found: MatchedFrame = self._future.result(timeout=timeout)
        except KilledWorker:
            return MatchedFrame(self._number, problem="This frame crashed every worker that took it.")
        return found

    def cancel(self) -> object:
        """Cancel the frame."""
        return self._future.cancel()
