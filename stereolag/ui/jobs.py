"""Long computations beside the page: it goes on answering, shows how far they are, and can call them off."""

from __future__ import annotations

import threading
from collections.abc import Callable
from concurrent.futures import CancelledError, ThreadPoolExecutor
from typing import Any, Generic, TypeVar

from stereolag.estimates import Estimate
from stereolag.ui.limiter import Turn, limiter

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
    return f"You are number {job.ahead + 1}: large computations take turns here."
