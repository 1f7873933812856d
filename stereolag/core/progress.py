"""Progress reports of long jobs."""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import TypeAlias

Progress: TypeAlias = Callable[[float], None]
"""Called with the fraction done, 0..1, at least ten times a second by a long job."""


def silent(fraction: float) -> None:
    """Ignore the progress; the default if nobody listens."""


def part(progress: Progress, number: int, count: int) -> Progress:
    """Return the progress of one of several equal parts of a job, the first being number 0."""
    return lambda done: progress((number + done) / count)


class Pulse:
    """A progress callback that can repeat its last fraction during a long step, so that the listener can cancel it."""

    def __init__(self, progress: Progress) -> None:
        self._progress = progress
        self._done, self._told = 0.0, time.monotonic()

    def __call__(self, done: float) -> None:
        """Report a new fraction."""
        self._done, self._told = done, time.monotonic()
        self._progress(done)

    def again(self) -> None:
        """Report the last fraction again, at most twenty times a second."""
        if time.monotonic() - self._told > 0.05:
            self(self._done)
