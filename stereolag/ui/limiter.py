"""Heavy computations take turns, so that many visitors at once neither fill the memory nor stop each other."""

from __future__ import annotations

import functools
import threading
from collections.abc import Callable, Iterator
from concurrent.futures import CancelledError
from contextlib import contextmanager

from stereolag.estimates import Estimate
from stereolag.kernels.bands import available_cores
from stereolag.limits import limits

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
        Cancelled
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
