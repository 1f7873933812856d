"""Computed results in bounded memory, the jobs that compute them, and what happens when a visitor leaves.

Results are shared by all visitors (for examples) or kept for one (for uploads). A light computation is done at once; a
heavy one waits for its turn, in the background: the page stays responsive, shows its progress and can cancel it.
"""

from __future__ import annotations

import ctypes
import functools
import hashlib
import math
import sys
import threading
import time
import weakref
from collections.abc import Callable, Iterator
from concurrent.futures import CancelledError, ThreadPoolExecutor
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field
from functools import partial
from queue import SimpleQueue
from typing import Any, Generic, TypeVar, cast

import numpy as np
import streamlit as st
from cachetools import LRUCache

from stereolag.core.jobs import Estimate, Progress, limits, silent
from stereolag.core.typography import typeset
from stereolag.loops import memory
from stereolag.loops.bands import available_cores
from stereolag.ui import prose
from stereolag.ui import streamlit_inside as inside
from stereolag.ui.elements import PATIENCE_S, show_refused, shown_progress

T = TypeVar("T")


class Job(Generic[T]):
    """A heavy computation in its own thread, which starts when its turn comes.

    Parameters
    ----------
    work
        Takes this job, reports its progress and the best result so far to it, checks `cancelled` now and then, and
        returns the result. It must not call Streamlit, which has no session in that thread.
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
        """Return whether the job is waiting or being computed."""
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
        """Record the progress; raise CancelledError to end the work if the job was cancelled."""
        if self.cancelled:
            raise CancelledError
        self.report(fraction)

    def found(self, so_far: T) -> None:
        """Record the best result so far."""
        self.so_far = so_far


HEAVY_MEMORY = 256 * 10**6
HEAVY_S = 2.0
"""Jobs below both this memory, bytes, and this time, s, do not wait for a turn."""

LOOKS_S = 0.2
"""Interval at which a waiting job checks whether it was cancelled, s."""


def is_heavy(estimate: Estimate) -> bool:
    """Return whether a job has to wait for its turn."""
    return estimate.memory >= HEAVY_MEMORY or estimate.seconds >= HEAVY_S


class Limiter:
    """Admits jobs, or streams, in order of arrival while memory and places suffice for one more.

    Parameters
    ----------
    memory
        Limit for all admitted jobs together, bytes; a single job is always admitted.
    at_once
        Largest number of jobs admitted at a time.
    """

    def __init__(self, memory: int, at_once: int) -> None:
        self._memory = memory
        self._at_once = at_once
        self._admitted: dict[object, int] = {}
        self._waiting: dict[object, int] = {}
        self._changed = threading.Condition()

    def admit(self, job: object, memory: int = 0) -> bool:
        """Return whether a job that needs `memory` bytes is admitted; if not, it waits for its turn from now on."""
        with self._changed:
            if job not in self._admitted:
                self._waiting.setdefault(job, memory)
                if not self._fits(job, memory):
                    return False
                self._admitted[job] = self._waiting.pop(job)
                self._changed.notify_all()
            return True

    def release(self, job: object) -> None:
        """Let a job go that was admitted, or waits."""
        with self._changed:
            self._waiting.pop(job, None)
            self._admitted.pop(job, None)
            self._changed.notify_all()

    def holds(self, job: object) -> bool:
        """Return whether a job is admitted."""
        return job in self._admitted

    def turn(self, job: object) -> int:
        """Return the number of a job among those that wait, from 1; 0 if it does not."""
        with self._changed:
            return [*self._waiting].index(job) + 1 if job in self._waiting else 0

    def ahead(self, job: object) -> int:
        """Return the number of jobs ahead of one that is waiting, admitted ones too; 0 if it is not."""
        turn = self.turn(job)
        return len(self._admitted) + turn - 1 if turn else 0

    @contextmanager
    def admitted(self, job: object, memory: int, cancelled: Callable[[], bool] = lambda: False) -> Iterator[None]:
        """Wait for the turn of a job that needs `memory` bytes, and release it at the end.

        Raises
        ------
        CancelledError
            `cancelled`, polled while waiting, returned True before it was this job's turn.
        """
        try:
            with self._changed:
                while not self.admit(job, memory):
                    if cancelled():
                        raise CancelledError
                    self._changed.wait(LOOKS_S)
            yield
        finally:
            self.release(job)

    def _fits(self, job: object, memory: int) -> bool:
        is_next = next(iter(self._waiting)) is job
        places_suffice = len(self._admitted) < self._at_once
        memory_suffices = sum(self._admitted.values()) + memory <= self._memory
        return is_next and (not self._admitted or (places_suffice and memory_suffices))


@functools.cache
def limiter() -> Limiter:
    """Return the limiter of this process: one heavy job per two cores."""
    return Limiter(limits().job_memory, max(1, available_cores() // 2))


AFTERWARDS_S = 2.0
"""How long after the final end of a session its memory is given back, together with that of others, s."""


@dataclass(eq=False)
class Visit:
    """The current jobs of one visitor, by the place on the page that shows them."""

    jobs: dict[str, tuple[str, Job[Any]]] = field(default_factory=dict)

    def end(self) -> None:
        """Cancel all jobs, and give the memory back later."""
        for _, job in self.jobs.values():
            job.cancel()
        _departures().put(time.monotonic())


@st.cache_resource(scope="session", show_spinner=False, on_release=Visit.end)
def this_visit() -> Visit:
    """Return the visit of the current session; it ends when the visitor leaves."""
    return Visit()


@functools.cache
def _departures() -> SimpleQueue[float]:
    """Return the queue of the times at which visitors left; a thread waits at its other end."""
    departures: SimpleQueue[float] = SimpleQueue()
    threading.Thread(target=_give_memory_back_after, args=(departures,), daemon=True).start()
    return departures


def _give_memory_back_after(departures: SimpleQueue[float]) -> None:
    """Give memory back once no ended session can be resumed any more, and once for all that ended meanwhile."""
    while True:
        last = departures.get()
        while not departures.empty():
            last = departures.get()
        wait_s = st.get_option("server.disconnectedSessionTTL") + AFTERWARDS_S
        time.sleep(max(0.0, last + wait_s - time.monotonic()))
        give_memory_back()


def give_memory_back() -> None:
    """Drop what ended sessions left, and return freed memory to the system."""
    inside.forget_ended_sessions()
    memory.give_back()
    inside.freeze_imports()
    if sys.platform == "linux":
        with suppress(AttributeError):  # only glibc retains freed memory, and has this call to release it
            ctypes.CDLL(None).malloc_trim(0)


SHARED_BYTES = 512 * 2**20
OWN_BYTES = 192 * 2**20
ALL_OWN_BYTES = 1024 * 2**20

BETWEEN_LOOKS_S = 0.4
"""Interval at which the page refreshes the progress of a job, s."""


class RecentResults:
    """The most recently used results, as many as fit into `max_bytes`; the newest stays whatever its size.

    `on_put` is called after each new one.
    """

    def __init__(self, max_bytes: int, on_put: Callable[[], None] = lambda: None) -> None:
        self._max_bytes = max_bytes
        self._on_put = on_put
        self._results: LRUCache[str, Any] = LRUCache(math.inf, getsizeof=_bytes_of)
        self._lock = threading.Lock()

    @property
    def size(self) -> int:
        """Return the memory of all results, bytes."""
        return int(self._results.currsize)

    def get(self, key: str) -> Any:
        """Return the result kept under `key`, or None."""
        with self._lock:
            return self._results.get(key)

    def put(self, key: str, result: Any) -> None:
        """Keep a result, and drop the least recently used ones that no longer fit."""
        with self._lock:
            self._results[key] = result
        self.shrink(self._max_bytes)
        self._on_put()

    def shrink(self, max_bytes: int) -> None:
        """Drop the least recently used results until the rest fit or only the newest is left."""
        with self._lock:
            while len(self._results) > 1 and self._results.currsize > max_bytes:
                self._results.popitem()


class SharedRoom:
    """A memory limit shared by all visitors' own results: the more visitors, the less each may keep.

    Parameters
    ----------
    max_bytes
        Limit for all visitors together; everybody's newest result stays all the same.
    most_each
        Limit for one visitor, bytes.
    """

    def __init__(self, max_bytes: int, most_each: int) -> None:
        self._max_bytes = max_bytes
        self._most_each = most_each
        self._all: weakref.WeakSet[RecentResults] = weakref.WeakSet()

    def results(self) -> RecentResults:
        """Return the store of one more visitor."""
        results = RecentResults(self._most_each, self._tidy)
        self._all.add(results)
        return results

    def _tidy(self) -> None:
        """Shrink everybody to an equal share if all together exceed the limit."""
        everybody = list(self._all)
        if sum(one.size for one in everybody) > self._max_bytes:
            for one in everybody:
                one.shrink(self._max_bytes // len(everybody))


_room = SharedRoom(ALL_OWN_BYTES, OWN_BYTES)


@st.cache_resource(show_spinner=False)
def _shared_results() -> RecentResults:
    return RecentResults(SHARED_BYTES)


@st.cache_resource(scope="session", show_spinner=False)
def _own_results() -> RecentResults:
    return _room.results()


def _results(shared: bool) -> RecentResults:
    return _shared_results() if shared else _own_results()


def computed(task: str, compute: Callable[[Progress], T], *, inputs: str, settings: str, shared: bool, label: str) -> T:
    """Return the result of `compute` for these inputs and settings, from memory if it was computed before.

    Parameters
    ----------
    task
        Distinguishes different computations on the same inputs.
    compute
        Takes a progress callback.
    inputs
        Digest of all inputs; never the arrays themselves, because Streamlit hashes only a sample of them.
    settings
        Everything else the result depends on, as JSON.
    shared
        Whether the inputs are an example, whose results all visitors may share.
    label
        Text shown during the computation.
    """
    # Present whether or not anything is computed: otherwise all later elements would shift and be redrawn.
    place = st.empty()

    def make() -> T:
        with place.container(key=f"working-{_key(task, inputs, settings)}"), shown_progress(label) as progress:
            result = compute(progress)
        place.empty()
        return result

    return remembered(task, make, inputs=inputs, settings=settings, shared=shared)


def remembered(task: str, make: Callable[[], T], *, inputs: str, settings: str, shared: bool) -> T:
    """Return the result of `make`, as :func:`computed` does, for work too short to show progress.

    Parameters
    ----------
    task, inputs, settings, shared
        As for :func:`computed`.
    """
    key = _key(task, inputs, settings)
    results = _results(shared)
    result: T | None = results.get(key)
    if result is None:
        result = make()
        results.put(key, result)
    return result


def computed_before(task: str, *, inputs: str, settings: str, shared: bool) -> Any:
    """Return the result of a computation if it is in memory, else None.

    Parameters
    ----------
    task, inputs, settings, shared
        As for :func:`computed`.
    """
    return _results(shared).get(_key(task, inputs, settings))


def computed_at_once(
    task: str, compute: Callable[[Progress], T], estimate: Estimate, *, inputs: str, settings: str, shared: bool
) -> T | None:
    """Return a result from memory, or compute it if nobody would notice the wait; else None.

    Parameters
    ----------
    task, compute, estimate, inputs, settings, shared
        As for :func:`computed_in_turn`.
    """
    if estimate.seconds >= PATIENCE_S or is_heavy(estimate) or estimate.memory > limits().job_memory:
        return cast(T | None, computed_before(task, inputs=inputs, settings=settings, shared=shared))
    return _remembered_alone(task, compute, inputs=inputs, settings=settings, shared=shared)


def computed_in_turn(
    task: str,
    compute: Callable[[Progress], T],
    estimate: Estimate,
    *,
    inputs: str,
    settings: str,
    shared: bool,
    label: str,
) -> T | None:
    """Return the result of :func:`computed`, or None while a heavy job is waiting or running, or if it was cancelled.

    A light job is computed at once. A heavy one takes its turn in the background: the page shows its progress, offers
    to cancel it, stays usable meanwhile, and reruns when it is done. Each task has one job at a time: new inputs or
    settings cancel the previous one.

    Parameters
    ----------
    task, compute, inputs, settings, shared, label
        As for :func:`computed`.
    estimate
        Estimated time and memory of the job.
    """
    key = _key(task, inputs, settings)
    jobs = this_visit().jobs
    before, job = jobs.get(task, (key, None))
    if job is not None and before != key:
        job.cancel()
        del jobs[task]
        job = None
    results = _results(shared)
    result: T | None = results.get(key)
    refused = estimate.memory > limits().job_memory
    if job is None and (result is not None or refused or not is_heavy(estimate)):
        if estimate.seconds < PATIENCE_S:
            # Too short for a progress display, which itself takes time to draw.
            return _remembered_alone(task, compute, inputs=inputs, settings=settings, shared=shared)
        return computed(task, partial(_alone, compute), inputs=inputs, settings=settings, shared=shared, label=label)
    place = st.empty()
    if job is None:
        job = Job(lambda job: compute(job.report_or_end), estimate)
        jobs[task] = key, job
    if job.cancelled:
        with place.container(horizontal=True, vertical_alignment="center"):
            prose.caption("Cancelled.", width="content")
            key = f"results.again.{task}"
            st.button("Compute", key=key, on_click=_forget_job, args=(task,), icon=":material/replay:")
        return None
    if job.running:
        with place.container():
            watch(job, partial(show_busy, job, label, key=f"results.cancel.{task}"), until_cancelled=True)
        return None
    del jobs[task]
    result = job.result()
    results.put(key, result)
    return result


@dataclass(frozen=True)
class Refusal:
    """The reason why a computation has no result, kept like one."""

    reason: str


def attempted(compute: Callable[[Progress], T]) -> Callable[[Progress], T | Refusal]:
    """Return a computation whose ValueError is its result, so that it is kept and not tried again."""

    def attempt(progress: Progress) -> T | Refusal:
        try:
            return compute(progress)
        except ValueError as error:
            return Refusal(str(error))

    return attempt


def computed_or_refused(
    task: str,
    compute: Callable[[Progress], T],
    estimate: Estimate,
    *,
    inputs: str,
    settings: str,
    shared: bool,
    label: str,
) -> T | None:
    """Return :func:`computed_in_turn`, or None with the reason shown if `compute` raises a ValueError.

    Parameters
    ----------
    task, compute, estimate, inputs, settings, shared, label
        As for :func:`computed_in_turn`.
    """
    result = computed_in_turn(
        task, attempted(compute), estimate, inputs=inputs, settings=settings, shared=shared, label=label
    )
    if isinstance(result, Refusal):
        show_refused(result.reason)
        return None
    return result


_cores = threading.Lock()
"""Held by a light computation, which uses all cores: two at once would each take, and report, twice the time."""


def _alone(compute: Callable[[Progress], T], progress: Progress) -> T:
    with _cores:
        return compute(progress)


def _remembered_alone(task: str, compute: Callable[[Progress], T], **kept: Any) -> T:
    """Return the result of a light computation, which another thread of this visitor may be at."""
    result: T | None = computed_before(task, **kept)
    if result is not None:
        return result
    with _cores:
        return remembered(task, lambda: compute(silent), **kept)


def _forget_job(task: str) -> None:
    this_visit().jobs.pop(task, None)


def _key(task: str, inputs: str, settings: str) -> str:
    return hashlib.sha256("\0".join((task, inputs, settings)).encode()).hexdigest()


def _bytes_of(result: Any) -> int:
    """Return the memory of a file, a text, an array, a number, several results, or a result's files and arrays."""
    if isinstance(result, bytes | str):
        return len(result)
    if isinstance(result, np.ndarray | float):
        return np.asarray(result).nbytes
    if isinstance(result, list | tuple):
        return sum(map(_bytes_of, result))
    return sum(_bytes_of(value) for value in vars(result).values() if isinstance(value, bytes | np.ndarray))


def watch(job: Job[Any], show: Callable[[], None], *, until_cancelled: bool = False) -> None:
    """Draw a part of the page by `show` now and then while a job is running, and once it has ended the whole page.

    The part is drawn once if the job has ended already. With `until_cancelled`, a job that was asked to stop has ended.
    """

    def running() -> bool:
        return job.running and not (until_cancelled and job.cancelled)

    at_first = running()

    def look() -> None:
        if at_first and not running():
            st.rerun(scope="app")
        show()

    st.fragment(look, run_every=BETWEEN_LOOKS_S if at_first else None)()


def show_busy(
    job: Job[Any], label: str, *, key: str, done: float | None = None, ending: str = "Ends the computation."
) -> None:
    """Show a job's place in the queue or its progress, with a button to end it.

    Parameters
    ----------
    job
        The job, waiting or being computed.
    label
        Text of the progress bar.
    key
        Key of the button.
    done
        Fraction done, 0..1; that of the job if None.
    ending
        Help of the button, which says what ending the job does.
    """
    with st.container(horizontal=True, vertical_alignment="center"):
        if job.ahead:
            turn = f"You are number {job.ahead + 1}"
            prose.info(f"{turn}: large computations take turns here. Yours begins by itself.", icon=":material/groups:")
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
