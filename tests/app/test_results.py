"""Results in bounded memory, and the heavy jobs that compute them: in turn, with progress, until cancelled."""

import threading
from collections.abc import Callable, Iterator
from concurrent.futures import CancelledError
from types import SimpleNamespace

import numpy as np
import pytest
import streamlit as st
from streamlit.testing.v1 import AppTest

from stereolag.core.jobs import Estimate, Progress
from stereolag.core.typography import duration, typeset
from stereolag.ui import background_jobs, results
from stereolag.ui.background_jobs import HEAVY_BYTES, Job
from tests.app.pages import page_of, until


def of_bytes(count: int) -> SimpleNamespace:
    return SimpleNamespace(array=np.zeros(count, dtype=np.uint8))


def filled(store: results.RecentResults, **counts: int) -> results.RecentResults:
    for name, count in counts.items():
        store.put(name, of_bytes(count))
    return store


def test_results_used_longest_ago_are_forgotten_first_and_never_the_newest() -> None:
    store = filled(results.RecentResults(max_bytes=300), a=100, b=100, c=100)
    assert store.get("a") is not None
    filled(store, d=100)
    assert [store.get(name) is not None for name in "abcd"] == [True, False, True, True]
    filled(store, large=500)
    assert [store.get(name) is not None for name in ("a", "large")] == [False, True]


def test_more_visitors_have_less_room_each_and_who_has_left_takes_none() -> None:
    room = results.SharedRoom(max_bytes=400, max_each=300)
    visitors = [room.results() for _ in range(4)]
    for visitor in visitors:
        filled(visitor, a=100, b=100, c=100)
    assert sum(visitor.size for visitor in visitors) <= 400
    assert all(visitor.get("c") is not None for visitor in visitors)
    del visitors, visitor
    assert filled(room.results(), a=100, b=100, c=100).size == 300


def test_what_was_computed_is_kept_and_a_refusal_is_not() -> None:
    calls = []

    def compute(settings: str) -> None:
        def work(progress: object) -> SimpleNamespace:
            calls.append(settings)
            if settings == "bad":
                raise ValueError("no")
            return of_bytes(1)

        results.computed("counting", work, inputs="inputs", settings=settings, shared=True, label="Computing …")

    for settings in ("one", "two", "one"):
        compute(settings)
    for _ in range(2):
        with pytest.raises(ValueError, match="no"):
            compute("bad")
    assert calls == ["one", "two", "bad", "bad"]


def test_only_what_is_short_is_computed_at_once() -> None:
    def at_once(seconds: float) -> SimpleNamespace | None:
        given = {"inputs": "inputs", "settings": "", "shared": True}
        return results.computed_at_once("pausing", lambda progress: of_bytes(1), Estimate(1, seconds), **given)

    assert at_once(seconds=2.0) is None
    made = at_once(seconds=0.1)
    assert at_once(seconds=2.0) is made is not None  # in memory


def test_durations_have_the_unit_that_suits_them() -> None:
    said = {0.0171: "17 ms", 0.9: "900 ms", 1.28: "1.28 s", 111: "111.00 s"}
    assert {seconds: duration(seconds) for seconds in said} == {one: typeset(text) for one, text in said.items()}


# Jobs

MEMORY = 100


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
def limit(monkeypatch: pytest.MonkeyPatch) -> Callable[..., None]:
    """Return a function that sets the number of jobs computed at once, and the memory of all."""

    def set_to(at_once: int, memory: int = MEMORY) -> None:
        limiter = background_jobs.Limiter(memory, at_once)
        monkeypatch.setattr(background_jobs, "limiter", lambda: limiter)

    return set_to


@pytest.mark.parametrize(("called_off", "computed"), [("", "abc"), ("a", "abc"), ("b", "ac")])
def test_jobs_are_computed_in_the_order_in_which_they_came_but_for_those_called_off(limit, called_off, computed):
    limit(1)
    begun: list[str] = []
    works = {name: Work(name, 60, begun) for name in "abc"}
    assert [work.job.ahead for work in works.values()] == [0, 1, 2]
    for name in called_off:
        gone = works.pop(name).job
        gone.cancel()
        with pytest.raises(CancelledError):
            gone.result()
    for name, work in works.items():
        until(lambda name=name: name in begun)
        work.end.set()
        assert work.job.result() == name
    assert "".join(begun) == computed


@pytest.mark.parametrize(("memory", "together"), [((60, 60), 1), ((60, 40), 2), ((1, 1, 1), 2), ((300, 20), 1)])
def test_memory_and_cores_bound_what_is_computed_at_once(limit, memory, together):
    limit(2)
    begun: list[str] = []
    works = [Work(name, size, begun) for name, size in zip("abc", memory, strict=False)]
    assert sum(work.job.ahead == 0 for work in works) == together
    for work in works:
        work.end.set()
    assert len({work.job.result() for work in works}) == len(memory)


def test_a_job_that_fails_gives_its_turn_back(limit: Callable[..., None]) -> None:
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
    assert not background_jobs.is_heavy(Estimate(HEAVY_BYTES - 1, background_jobs.HEAVY_S / 2))
    assert background_jobs.is_heavy(Estimate(HEAVY_BYTES, 0.0))
    assert background_jobs.is_heavy(Estimate(0, background_jobs.HEAVY_S))


# A job on a page


def page() -> None:
    gate, number = st.session_state["gate"], st.session_state["number"]

    def compute(progress: Progress) -> bytes:
        progress(0.25)
        while not gate.wait(0.005):
            progress(0.25)
        return f"result {number}".encode()

    given = {"inputs": "inputs", "settings": str(number), "shared": True, "label": "Counting …"}
    result = results.computed_in_turn("counting", compute, Estimate(st.session_state["memory"], 0.0), **given)
    st.markdown("nothing yet" if result is None else result.decode())


@pytest.fixture
def gate(limit: Callable[..., None], empty_caches: None) -> Iterator[threading.Event]:
    """Return an event that lets all computations end."""
    limit(1, 2 * HEAVY_BYTES)
    gate = threading.Event()
    yield gate
    gate.set()


def opened(gate: threading.Event, memory: int = HEAVY_BYTES) -> AppTest:
    return page_of(page, {"gate": gate, "memory": memory, "number": 1})


def open_gate() -> threading.Event:
    gate = threading.Event()
    gate.set()
    return gate


def answer(app: AppTest) -> str:
    until(lambda: app.run().markdown[0].value != "nothing yet")
    return str(app.markdown[0].value)


@pytest.fixture
def somebody_else(gate: threading.Event) -> Job[bool]:
    """Return a running heavy job of another visitor."""
    begun = threading.Event()

    def work(_: Job[bool]) -> bool:
        begun.set()
        return gate.wait()

    job = Job(work, Estimate(HEAVY_BYTES, 10.0))
    begun.wait()
    return job


def test_who_comes_second_is_told_the_place_in_the_queue_unless_the_job_is_light(gate, somebody_else):
    assert opened(open_gate(), memory=HEAVY_BYTES - 1).markdown[0].value == "result 1"
    st.cache_resource.clear()
    app = opened(gate).run()
    assert somebody_else.running
    assert "number 2" in app.info[0].value
    gate.set()
    assert somebody_else.result()
    assert answer(app) == "result 1"


def test_a_job_is_cancelled_and_computed_again(gate: threading.Event) -> None:
    app = opened(gate)
    app.button(key="results.cancel.counting").click().run()
    assert app.caption[0].value == "Cancelled."
    gate.set()
    assert app.run().caption[0].value == "Cancelled."
    app.button(key="results.again.counting").click().run()
    assert answer(app) == "result 1"
    assert not app.button


def test_other_settings_call_the_job_before_off(gate: threading.Event) -> None:
    app = opened(gate)
    app.session_state["number"], app.session_state["gate"] = 2, open_gate()
    app.run()
    # The previous job would run for as long as its gate is closed, and the new one would wait for it.
    assert answer(app) == "result 2"


def test_what_is_too_much_does_not_wait_to_be_refused(gate: threading.Event) -> None:
    gate.set()
    assert (
        opened(gate, memory=2**60).markdown[0].value == "result 1"
    )  # called directly: the job itself reports that it is too much
