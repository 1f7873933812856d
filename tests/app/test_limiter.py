"""Heavy jobs take turns; light ones do not wait."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable
from concurrent.futures import CancelledError

import pytest

from stereolag.core.jobs import Estimate
from stereolag.ui import results as jobs
from stereolag.ui.results import HEAVY_MEMORY, HEAVY_S, Job, Limiter, is_heavy, waiting_in_words

PATIENCE_S = 20.0
MEMORY = 100


def until(holds: Callable[[], bool]) -> None:
    end = time.monotonic() + PATIENCE_S
    while not holds():
        assert time.monotonic() < end
        time.sleep(0.002)


class Work:
    """A job that runs until its `end` event is set; `begun` records the order in which jobs start."""

    def __init__(self, name: str, memory: int, begun: list[str]) -> None:
        self.end = threading.Event()
        self._name = name
        self._begun = begun
        self.job: Job[str] = Job(self._work, Estimate(memory, 10.0))
        # Wait until it has started or is queued, so that the next job comes after it.
        until(lambda: name in begun or self.job.ahead > 0)

    def _work(self, job: Job[str]) -> str:
        self._begun.append(self._name)
        while not self.end.wait(0.002):
            job.report_or_end(0.5)
        return self._name


@pytest.fixture
def limit(monkeypatch: pytest.MonkeyPatch) -> Callable[[int], None]:
    """Return a function that sets the number of jobs computed at once."""

    def set_to(at_once: int) -> None:
        limiter = Limiter(MEMORY, at_once)
        monkeypatch.setattr(jobs, "limiter", lambda: limiter)

    return set_to


def test_jobs_are_computed_in_the_order_in_which_they_came(limit: Callable[[int], None]) -> None:
    limit(1)
    begun: list[str] = []
    works = {name: Work(name, 60, begun) for name in "abc"}
    assert [work.job.ahead for work in works.values()] == [0, 1, 2]
    assert "number 3" in waiting_in_words(works["c"].job)
    for name, work in works.items():
        until(lambda name=name: name in begun)
        work.end.set()
        assert work.job.result() == name
    assert begun == ["a", "b", "c"]


def test_one_that_waits_can_be_called_off(limit: Callable[[int], None]) -> None:
    limit(1)
    begun: list[str] = []
    first, second, third = (Work(name, 60, begun) for name in "abc")
    second.job.cancel()
    with pytest.raises(CancelledError):
        second.job.result()
    until(lambda: third.job.ahead == 1)
    first.end.set()
    third.end.set()
    assert third.job.result() == "c"
    assert begun == ["a", "c"]


def test_one_that_is_computed_can_be_called_off(limit: Callable[[int], None]) -> None:
    limit(1)
    begun: list[str] = []
    first, second = (Work(name, 60, begun) for name in "ab")
    first.job.cancel()
    with pytest.raises(CancelledError):
        first.job.result()
    second.end.set()
    assert second.job.result() == "b"


@pytest.mark.parametrize(("memory", "together"), [((60, 60), 1), ((60, 40), 2), ((20, 20), 2), ((300, 20), 1)])
def test_memory_bounds_what_is_computed_at_once(
    limit: Callable[[int], None], memory: tuple[int, int], together: int
) -> None:
    limit(2)
    begun: list[str] = []
    works = [Work(name, size, begun) for name, size in zip("ab", memory, strict=True)]
    assert sum(work.job.ahead == 0 for work in works) == together
    for work in works:
        work.end.set()
    assert {work.job.result() for work in works} == {"a", "b"}


def test_cores_bound_what_is_computed_at_once(limit: Callable[[int], None]) -> None:
    limit(2)
    begun: list[str] = []
    works = [Work(name, 1, begun) for name in "abc"]
    assert [work.job.ahead for work in works] == [0, 0, 2]
    for work in works:
        work.end.set()
        work.job.result()


def test_a_job_that_fails_gives_its_turn_back(limit: Callable[[int], None]) -> None:
    limit(1)

    def fail(_: Job[None]) -> None:
        raise ValueError("no such window")

    job: Job[None] = Job(fail, Estimate(60, 10.0))
    with pytest.raises(ValueError, match="no such window"):
        job.result()
    work = Work("next", 60, [])
    work.end.set()
    assert work.job.result() == "next"


def test_what_is_light() -> None:
    assert not is_heavy(Estimate(HEAVY_MEMORY - 1, HEAVY_S / 2))
    assert is_heavy(Estimate(HEAVY_MEMORY, 0.0))
    assert is_heavy(Estimate(0, HEAVY_S))
