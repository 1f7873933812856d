"""Heavy computations, which take turns in the background, and their end when the visitor leaves.

Meanwhile the page stays responsive, shows the progress and offers to cancel.
"""

from __future__ import annotations

import functools
import threading
import time
from collections.abc import Callable, Iterator
from concurrent.futures import CancelledError, ThreadPoolExecutor
from contextlib import contextmanager
from dataclasses import dataclass, field
from queue import SimpleQueue
from typing import Any, Generic, TypeVar

import streamlit as st

from stereolag.core.jobs import Estimate, limits
from stereolag.core.typography import typeset
from stereolag.loops import memory
from stereolag.loops.bands import available_cores
from stereolag.ui import prose
from stereolag.ui import streamlit_inside as inside

T = TypeVar("T")


class Job(Generic[T]):
    """A heavy computation in its own thread, which starts when its turn comes.

    Parameters
    ----------
    work
        Takes this job, reports progress and the best result so far to it, checks `cancelled` now and then, and returns
        the result. It must not call Streamlit, which has no session in that thread.
    estimate
        Estimated time and memory.

    Attributes
    ----------
    progress
        Fraction done, 0..1.
    so_far
        Best result so far; None until there is one.
    cancelled
        Whether the job has been asked to stop.
    """

    def __init__(self, work: Callable[[Job[T]], T], estimate: Estimate) -> None:
        self.progress = 0.0
        self.so_far: T | None = None
        self.cancelled = False

        def work_in_turn() -> T:
            with limiter().admitted(self, estimate.memory, lambda: self.cancelled):
                return work(self)

        executor = ThreadPoolExecutor(max_workers=1)
        self._future = executor.submit(work_in_turn)
        executor.shutdown(wait=False)

    @property
    def ahead(self) -> int:
        """Return the number of jobs ahead of this one; 0 once it is running."""
        return limiter().ahead(self)

    @property
    def running(self) -> bool:
        """Return whether the job is waiting or running."""
        return not self._future.done()

    def cancel(self) -> None:
        """Ask the job to stop soon."""
        self.cancelled = True

    def result(self) -> T:
        """Wait for the result and return it; raise the error of the work, or CancelledError if it was cancelled."""
        return self._future.result()

    def report(self, fraction: float) -> None:
        """Record the progress."""
        self.progress = fraction

    def report_or_end(self, fraction: float) -> None:
        """Record the progress, or raise CancelledError if the job was cancelled, which ends the work."""
        if self.cancelled:
            raise CancelledError
        self.report(fraction)

    def found(self, so_far: T) -> None:
        """Record the best result so far."""
        self.so_far = so_far


HEAVY_BYTES = 256 * 10**6
"""Memory from which a job waits for its turn, bytes."""

HEAVY_S = 2.0
"""Time from which a job waits for its turn, s."""

POLL_INTERVAL_S = 0.2
"""Interval at which a waiting job checks whether it was cancelled, s."""


def is_heavy(estimate: Estimate) -> bool:
    """Return whether a job has to wait for its turn."""
    return estimate.memory >= HEAVY_BYTES or estimate.seconds >= HEAVY_S


@dataclass(eq=False)
class Limiter:
    """Admits jobs, or streams, in order of arrival, as memory and places allow.

    Attributes
    ----------
    max_memory
        Limit for all admitted jobs together, bytes; a job on its own is always admitted.
    max_jobs
        Number of jobs that may be admitted at a time.
    """

    max_memory: int
    max_jobs: int
    _admitted: dict[object, int] = field(default_factory=dict)
    _waiting: dict[object, int] = field(default_factory=dict)
    _changed: threading.Condition = field(default_factory=threading.Condition)

    def admit(self, job: object, memory: int = 0) -> bool:
        """Return whether a job that needs `memory` bytes is admitted; if not, queue it."""
        with self._changed:
            if job not in self._admitted:
                self._waiting.setdefault(job, memory)
                if not self._fits(job, memory):
                    return False
                self._admitted[job] = self._waiting.pop(job)
                self._changed.notify_all()
            return True

    def release(self, job: object) -> None:
        """Remove a job, whether it was admitted or is waiting."""
        with self._changed:
            self._waiting.pop(job, None)
            self._admitted.pop(job, None)
            self._changed.notify_all()

    def holds(self, job: object) -> bool:
        """Return whether a job is admitted."""
        return job in self._admitted

    def turn(self, job: object) -> int:
        """Return the position of a job in the queue, from 1; 0 if it is not waiting."""
        with self._changed:
            return [*self._waiting].index(job) + 1 if job in self._waiting else 0

    def ahead(self, job: object) -> int:
        """Return the number of jobs ahead of a waiting one, including those admitted; 0 if it is not waiting."""
        turn = self.turn(job)
        return len(self._admitted) + turn - 1 if turn else 0

    @contextmanager
    def admitted(self, job: object, memory: int, cancelled: Callable[[], bool] = lambda: False) -> Iterator[None]:
        """Wait for the turn of a job that needs `memory` bytes, and release it at the end.

        Raises
        ------
        CancelledError
            `cancelled`, which is polled while waiting, returned True before the job's turn came.
        """
        try:
            with self._changed:
                while not self.admit(job, memory):
                    if cancelled():
                        raise CancelledError
                    self._changed.wait(POLL_INTERVAL_S)
            yield
        finally:
            self.release(job)

    def _fits(self, job: object, memory: int) -> bool:
        is_next = next(iter(self._waiting)) is job
        places_suffice = len(self._admitted) < self.max_jobs
        memory_suffices = sum(self._admitted.values()) + memory <= self.max_memory
        return is_next and (not self._admitted or (places_suffice and memory_suffices))


@functools.cache
def limiter() -> Limiter:
    """Return the limiter of this process: one heavy job per two cores."""
    return Limiter(limits().job_memory, max(1, available_cores() // 2))


CLEANUP_DELAY_S = 2.0
"""Delay between the final end of a session and the release of its memory, together with that of others, s."""


@dataclass(eq=False)
class Visit:
    """The current jobs of one visitor, by the place on the page that shows them."""

    jobs: dict[str, tuple[str, Job[Any]]] = field(default_factory=dict)

    def end(self) -> None:
        """Cancel all jobs, and have the memory released later."""
        for _, job in self.jobs.values():
            job.cancel()
        _departures().put(time.monotonic())


@st.cache_resource(scope="session", show_spinner=False, on_release=Visit.end)
def this_visit() -> Visit:
    """Return the visit of the current session; it ends when the visitor leaves."""
    return Visit()


@functools.cache
def _departures() -> SimpleQueue[float]:
    """Return the queue of the times at which visitors left, which a thread consumes."""
    departures: SimpleQueue[float] = SimpleQueue()
    threading.Thread(target=_give_memory_back_after, args=(departures,), daemon=True).start()
    return departures


def _give_memory_back_after(departures: SimpleQueue[float]) -> None:
    """Release memory once ended sessions can no longer be resumed, once for all that end in the meantime."""
    while True:
        last = departures.get()
        while not departures.empty():
            last = departures.get()
        wait_s = st.get_option("server.disconnectedSessionTTL") + CLEANUP_DELAY_S
        time.sleep(max(0.0, last + wait_s - time.monotonic()))
        give_memory_back()


def give_memory_back() -> None:
    """Drop the remains of ended sessions, and return freed memory to the system."""
    inside.forget_ended_sessions()
    memory.release_memory()
    inside.freeze_imports()
    memory.ask_allocator("malloc_trim", 0)


REFRESH_INTERVAL_S = 0.4
"""Interval at which the page refreshes the progress of a job, s."""


def watch(job: Job[Any], show: Callable[[], None], *, until_cancelled: bool = False) -> None:
    """Redraw a part of the page with `show` while a job is running, and rerun the whole page once it has ended.

    If the job has already ended, the part is drawn once. With `until_cancelled`, a cancelled job counts as ended.
    """

    def running() -> bool:
        return job.running and not (until_cancelled and job.cancelled)

    ran_at_first = running()

    def refresh() -> None:
        if ran_at_first and not running():
            st.rerun(scope="app")
        show()

    st.fragment(refresh, run_every=REFRESH_INTERVAL_S if ran_at_first else None)()


def show_busy(
    job: Job[Any], label: str, *, key: str, done: float | None = None, ending: str = "Ends the computation."
) -> None:
    """Show a job's place in the queue or its progress, with a button to end it.

    Parameters
    ----------
    job
        The job, waiting or running.
    label
        Text of the progress bar.
    key
        Key of the button.
    done
        Fraction done, 0..1; that of the job if None.
    ending
        Help of the button: the effect of ending the job.
    """
    with st.container(horizontal=True, vertical_alignment="center"):
        if job.ahead:
            prose.info(
                f"You are number {job.ahead + 1} in the queue: large computations take turns here. Yours will start by "
                "itself.",
                icon=":material/groups:",
            )
        else:
            st.progress(min(max(job.progress if done is None else done, 0.0), 1.0), typeset(label))
        st.button(
            "Ending …" if job.cancelled else "Cancel",
            key=key,
            on_click=job.cancel,
            disabled=job.cancelled,
            icon=":material/stop_circle:",
            help=ending,
        )
