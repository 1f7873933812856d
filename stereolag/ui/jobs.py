"""Long computations beside the page: it goes on answering, shows how far they are, and can call them off."""

from __future__ import annotations

import threading
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from typing import Generic, TypeVar

T = TypeVar("T")


class Job(Generic[T]):
    """A computation in a thread of its own.

    Parameters
    ----------
    work
        Takes this job, writes `progress` and `so_far` to it, asks `cancelled` now and then, and returns the result.
        It must not call Streamlit, which knows no visitor in that thread.

    Attributes
    ----------
    progress
        0..1.
    so_far
        The best result yet; None until there is one.
    """

    def __init__(self, work: Callable[[Job[T]], T]) -> None:
        self.progress = 0.0
        self.so_far: T | None = None
        self._cancel = threading.Event()
        executor = ThreadPoolExecutor(max_workers=1)
        self._future = executor.submit(work, self)
        executor.shutdown(wait=False)

    @property
    def running(self) -> bool:
        """Return whether it is still computed."""
        return not self._future.done()

    @property
    def cancelled(self) -> bool:
        """Return whether it has been asked to end."""
        return self._cancel.is_set()

    def cancel(self) -> None:
        """Ask it to end soon."""
        self._cancel.set()

    def result(self) -> T:
        """Wait for the result and return it; an error of the work is raised here."""
        return self._future.result()

    def report(self, fraction: float) -> None:
        """Take note of the progress."""
        self.progress = fraction

    def found(self, so_far: T) -> None:
        """Take note of the best result yet."""
        self.so_far = so_far
