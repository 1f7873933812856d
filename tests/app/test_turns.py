"""A heavy computation on a page: it waits for its turn, reports its progress, and can be cancelled."""

from __future__ import annotations

import threading
import time
from collections.abc import Iterator

import pytest
from streamlit.testing.v1 import AppTest

from stereolag.core.jobs import Estimate
from stereolag.ui import results as jobs
from stereolag.ui.results import HEAVY_MEMORY, Job, Limiter

pytestmark = pytest.mark.usefixtures("empty_caches")


def page() -> None:
    import streamlit as st

    from stereolag.core.jobs import Estimate
    from stereolag.ui.results import computed_in_turn

    gate, number = st.session_state["gate"], st.session_state["number"]

    def compute(progress):
        progress(0.25)
        while not gate.wait(0.005):
            progress(0.25)
        return f"result {number}".encode()

    result = computed_in_turn(
        "counting",
        compute,
        Estimate(st.session_state["memory"], 0.0),
        inputs=st.session_state["inputs"],
        settings=str(number),
        shared=True,
        label="Counting …",
    )
    st.markdown("nothing yet" if result is None else result.decode())


@pytest.fixture(autouse=True)
def limiter(monkeypatch: pytest.MonkeyPatch) -> None:
    limiter = Limiter(2 * HEAVY_MEMORY, 1)
    monkeypatch.setattr(jobs, "limiter", lambda: limiter)


@pytest.fixture
def gate() -> Iterator[threading.Event]:
    """Return an event that lets all computations end."""
    gate = threading.Event()
    yield gate
    gate.set()


def opened(gate: threading.Event, inputs: str, memory: int = HEAVY_MEMORY, number: int = 1) -> AppTest:
    app = AppTest.from_function(page, default_timeout=60)
    for name, value in {"gate": gate, "inputs": inputs, "memory": memory, "number": number}.items():
        app.session_state[name] = value
    return app.run()


def finished(app: AppTest) -> AppTest:
    end = time.monotonic() + 20
    while app.markdown[0].value == "nothing yet":
        assert time.monotonic() < end
        app.run()
    return app


def test_a_heavy_job_does_not_hold_the_page(gate: threading.Event) -> None:
    app = opened(gate, "first")
    assert app.markdown[0].value == "nothing yet"
    assert app.button(key="results.cancel.counting")
    gate.set()
    assert finished(app).markdown[0].value == "result 1"
    assert not app.button


@pytest.fixture
def somebody_else(gate: threading.Event) -> Job[bool]:
    """Return a running heavy job of another visitor."""
    begun = threading.Event()

    def work(_: Job[bool]) -> bool:
        begun.set()
        return gate.wait()

    job = Job(work, Estimate(HEAVY_MEMORY, 10.0))
    assert begun.wait(20)
    return job


def test_who_comes_second_is_told_the_place_in_the_queue(gate: threading.Event, somebody_else: Job[bool]) -> None:
    app = opened(gate, "mine").run()
    assert "number 2" in app.info[0].value
    gate.set()
    assert somebody_else.result()
    assert finished(app).markdown[0].value == "result 1"


def test_a_light_job_does_not_wait(gate: threading.Event, somebody_else: Job[bool]) -> None:
    free = threading.Event()
    free.set()
    assert opened(free, "mine", memory=HEAVY_MEMORY - 1).markdown[0].value == "result 1"
    assert somebody_else.running


def test_a_job_is_cancelled_and_computed_again(gate: threading.Event) -> None:
    app = opened(gate, "first")
    app.button(key="results.cancel.counting").click().run()
    assert app.caption[0].value == "Cancelled."
    gate.set()
    app.run()
    assert app.caption[0].value == "Cancelled."
    app.button(key="results.again.counting").click().run()
    assert finished(app).markdown[0].value == "result 1"


def test_other_settings_call_the_job_before_off(gate: threading.Event) -> None:
    app = opened(gate, "first")
    free = threading.Event()
    free.set()
    app.session_state["number"] = 2
    app.session_state["gate"] = free
    app.run()
    # The previous job would run for as long as its gate is closed, and the new one would wait for it.
    assert finished(app).markdown[0].value == "result 2"


def test_what_is_too_much_does_not_wait_to_be_refused(gate: threading.Event) -> None:
    gate.set()
    app = opened(gate, "first", memory=2**60)
    assert app.markdown[0].value == "result 1"  # called directly: the job itself reports that it is too much
