"""Long computations beside the page: it goes on answering, shows how far they are, and can call them off."""

from __future__ import annotations

import functools
import threading
from collections.abc import Callable, Iterator
from concurrent.futures import CancelledError, ThreadPoolExecutor
from contextlib import contextmanager
from typing import Any, Generic, TypeVar

from stereolag.estimates import Estimate
from stereolag.limits import limits
from stereolag.loops.bands import available_cores

T = TypeVar("T")


class Job(Generic[T]):
    """A heavy computation in a thread of its own, which begins when it is its turn.

    Parameters
    ----------
    work
        Takes this job, tells it its progress and the best result so far, asks `cancelled` now and then, and returns the
        result. It must not call Streamlit, which knows no visitor in that thread.
    estimate
        What it will take.

    Attributes
    ----------
    progress
        0..1.
    so_far
        The best result yet; None until there is one.
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
        """Return how many jobs come before this one; 0 once it is being computed."""
        return self._turn.ahead

    @property
    def running(self) -> bool:
        """Return whether it waits or is computed."""
        return not self._future.done()

    @property
    def cancelled(self) -> bool:
        """Return whether it has been asked to end."""
        return self._cancel.is_set()

    def cancel(self) -> None:
        """Ask it to end soon."""
        self._cancel.set()

    def result(self) -> T:
        """Wait for the result and return it; an error of the work is raised here, or that it was called off."""
        return self._future.result()

    def report(self, fraction: float) -> None:
        """Take note of the progress."""
        self.progress = fraction

    def report_or_end(self, fraction: float) -> None:
        """Take note of the progress; end the work here, by CancelledError, where it was called off."""
        if self.cancelled:
            raise CancelledError
        self.progress = fraction

    def found(self, so_far: T) -> None:
        """Take note of the best result yet."""
        self.so_far = so_far


def waiting_in_words(job: Job[Any]) -> str:
    """Return the place of a job that waits for its turn."""
    return f"You are number {job.ahead + 1}: large computations take turns here. Yours begins by itself."


HEAVY_MEMORY = 256 * 10**6
HEAVY_S = 2.0
"""What takes less memory and less time than this does not have to wait."""

LOOKS_S = 0.2
"""How often a waiting job looks whether it was cancelled."""


def is_heavy(estimate: Estimate) -> bool:
    """Return whether a job has to take its turn."""
    return estimate.memory >= HEAVY_MEMORY or estimate.seconds >= HEAVY_S


class Turn:
    """The place of one job among those that wait or are computed."""

    def __init__(self, memory: int) -> None:
        self.memory = memory
        self.ahead = 0


class Limiter:
    """Admits jobs in the order in which they came, as long as memory and cores suffice for one more.

    Parameters
    ----------
    memory
        Bytes that all admitted jobs together may take; one job alone is always admitted.
    at_once
        How many are admitted at the most.
    """

    def __init__(self, memory: int, at_once: int) -> None:
        self._memory = memory
        self._at_once = at_once
        self._admitted: list[Turn] = []
        self._waiting: list[Turn] = []
        self._changed = threading.Condition()

    @contextmanager
    def admitted(self, turn: Turn, cancelled: Callable[[], bool]) -> Iterator[None]:
        """Wait for a turn, and give it back at the end.

        Parameters
        ----------
        turn
            Its ``ahead`` tells meanwhile how many jobs come before this one.
        cancelled
            Asked while waiting.

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
    """Return the one limiter of this process: one heavy job for every two cores."""
    return Limiter(limits().job_memory, max(1, available_cores() // 2))
