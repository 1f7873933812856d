"""Times as ratios: ours and the peer's alternate in one run, so that changes of the machine affect both."""

from __future__ import annotations

import statistics
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass

Job = Callable[[], object]


def interleaved(jobs: Mapping[str, Job], *, runs: int = 15) -> dict[str, float]:
    """Return the median seconds of every job, run in turn `runs` times after one warm-up each."""
    seconds: dict[str, list[float]] = {name: [] for name in jobs}
    for round_number in range(runs + 1):
        for name, job in jobs.items():
            start = time.perf_counter()
            job()
            if round_number:
                seconds[name].append(time.perf_counter() - start)
    return {name: statistics.median(times) for name, times in seconds.items()}


@dataclass(frozen=True)
class Row:
    """One line of a table: the task, our figure, the peer's, their ratio, and the targets."""

    task: str
    ours: float
    peer_name: str
    peer: float
    unit: str
    must: str
    aim: str
    note: str = ""

    @property
    def ratio(self) -> float:
        return self.ours / self.peer
