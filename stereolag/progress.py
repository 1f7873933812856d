"""How a long job tells how far it is."""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import TypeAlias

Progress: TypeAlias = Callable[[float], None]
"""Called with the fraction done, 0..1, at least ten times a second by a long job."""


def silent(fraction: float) -> None:
    """Ignore the progress: what a job calls when nobody asked."""


def part(progress: Progress, number: int, count: int) -> Progress:
    """Return the progress of one of several equal parts of a job, the first being number 0."""
    return lambda done: progress((number + done) / count)


class Pulse:
    """A progress that is told again while a job reads on without a step: whoever hears it can end the job there."""

    def __init__(self, progress: Progress) -> None:
        self._progress = progress
        self._done, self._told = 0.0, time.monotonic()

    def __call__(self, done: float) -> None:
        """Tell a new fraction."""
        self._done, self._told = done, time.monotonic()
        self._progress(done)

    def again(self) -> None:
        """Tell the last fraction again, at most twenty times a second."""
        if time.monotonic() - self._told > 0.05:
            self(self._done)
