"""Long computations in the background: the page stays responsive, shows their progress and can cancel them."""

from __future__ import annotations

import functools
import threading
from collections.abc import Callable, Iterator
from concurrent.futures import CancelledError, ThreadPoolExecutor
from contextlib import contextmanager
from typing import Any, Generic, TypeVar

from stereolag.core.jobs import Estimate, limits
from stereolag.loops.bands import available_cores

T = TypeVar("T")


class Job(Generic[T]):
    """A heavy computation in its own thread, which starts when its turn comes.

    Parameters
    ----------
    work
        Takes this job, reports its progress and the best result so far to it, checks `cancelled` now and then, and
        returns the result. It must not call Streamlit, which has no session in that thread.
    estimate
        Estimated time and memory.

    Attributes
    ----------
    progress
        Fraction done, 0..1.
    so_far
        Best result so far; None until there is one.
    """

    def __init__(self, work: Callable[[Job[T]], T], estimate: Estimate) -> None:
        self.progress = 0.0
        self.so_far: T | None = None
        self._cancel = threading.Event()
        self._turn = Turn(estimate.memory)
        executor = ThreadPoolExecutor(max_workers=1)
        self._future = executor.submit(self._work_in_turn, work)
        executor.shutdown(wait=False)

    def _work_in_turn(self, work: Callable[[Job[T]], T]) -> T:
        with limiter().admitted(self._turn, self._cancel.is_set):
            return work(self)

    @property
    def ahead(self) -> int:
        """Return the number of jobs ahead of this one; 0 once it is running."""
        return self._turn.ahead

    @property
    def running(self) -> bool:
        """Return whether the job is waiting or being computed."""
        return not self._future.done()

    @property
    def cancelled(self) -> bool:
        """Return whether the job has been asked to stop."""
        return self._cancel.is_set()

    def cancel(self) -> None:
        """Ask the job to stop soon."""
        self._cancel.set()

    def result(self) -> T:
        """Wait for the result and return it; raise the error of the work, or CancelledError if it was cancelled."""
        return self._future.result()

    def report(self, fraction: float) -> None:
        """Record the progress."""
        self.progress = fraction

    def report_or_end(self, fraction: float) -> None:
        """Record the progress; raise CancelledError to end the work if the job was cancelled."""
        if self.cancelled:
            raise CancelledError
        self.progress = fraction

    def found(self, so_far: T) -> None:
        """Record the best result so far."""
        self.so_far = so_far


def waiting_in_words(job: Job[Any]) -> str:
    """Return a sentence with the queue position of a waiting job."""
    return f"You are number {job.ahead + 1}: large computations take turns here. Yours begins by itself."


HEAVY_MEMORY = 256 * 10**6
HEAVY_S = 2.0
"""Jobs below both this memory, bytes, and this time, s, do not wait for a turn."""

LOOKS_S = 0.2
"""Interval at which a waiting job checks whether it was cancelled, s."""


def is_heavy(estimate: Estimate) -> bool:
    """Return whether a job has to wait for its turn."""
    return estimate.memory >= HEAVY_MEMORY or estimate.seconds >= HEAVY_S


class Turn:
    """The place of one job among those waiting or running."""

    def __init__(self, memory: int) -> None:
        self.memory = memory
        self.ahead = 0


class Limiter:
    """Admits jobs in order of arrival while memory and cores suffice for one more.

    Parameters
    ----------
    memory
        Limit for all admitted jobs together, bytes; a single job is always admitted.
    at_once
        Largest number of jobs admitted at a time.
    """

    def __init__(self, memory: int, at_once: int) -> None:
        self._memory = memory
        self._at_once = at_once
        self._admitted: list[Turn] = []
        self._waiting: list[Turn] = []
        self._changed = threading.Condition()

    @contextmanager
    def admitted(self, turn: Turn, cancelled: Callable[[], bool]) -> Iterator[None]:
        """Wait for a turn, and release it at the end.

        Parameters
        ----------
        turn
            Turn of this job; its ``ahead`` is kept up to date while waiting.
        cancelled
            Polled while waiting.

        Raises
        ------
        CancelledError
            `cancelled` returned True before it was this job's turn.
        """
        with self._changed:
            self._waiting.append(turn)
            self._count()
        try:
            with self._changed:
                while not self._fits(turn):
                    if cancelled():
                        raise CancelledError
                    self._changed.wait(LOOKS_S)
                self._waiting.remove(turn)
                self._admitted.append(turn)
                self._count()
            yield
        finally:
            with self._changed:
                (self._admitted if turn in self._admitted else self._waiting).remove(turn)
                self._count()

    def _fits(self, turn: Turn) -> bool:
        if turn is not self._waiting[0]:
            return False
        if not self._admitted:
            return True
        taken = sum(one.memory for one in self._admitted)
        return len(self._admitted) < self._at_once and taken + turn.memory <= self._memory

    def _count(self) -> None:
        for place, turn in enumerate(self._waiting):
            turn.ahead = len(self._admitted) + place
        for turn in self._admitted:
            turn.ahead = 0
        self._changed.notify_all()


@functools.cache
def limiter() -> Limiter:
    """Return the limiter of this process: one heavy job per two cores."""
    return Limiter(limits().job_memory, max(1, available_cores() // 2))
