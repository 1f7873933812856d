"""Computed results in bounded memory, shared by all visitors (for examples) or kept for one (for uploads).

A light computation is done at once; a heavy one waits for its turn in the background (ui/background_jobs.py).
"""

from __future__ import annotations

import hashlib
import math
import threading
import weakref
from collections.abc import Callable
from dataclasses import dataclass, field
from functools import partial
from typing import Any, TypeVar, cast

import numpy as np
import streamlit as st
from cachetools import LRUCache

from stereolag.core.jobs import Estimate, Progress, limits, silent
from stereolag.pair import Pair
from stereolag.ui import prose
from stereolag.ui.background_jobs import Job, is_heavy, show_busy, this_visit, watch
from stereolag.ui.elements import PATIENCE_S, show_refused, shown_progress

T = TypeVar("T")


@dataclass(frozen=True, eq=False)
class Inputs:
    """The inputs of a page: a description, a digest, and whether they are an example, shared by all visitors."""

    description: str
    digest: str
    shared: bool


def kept_for(inputs: Inputs | Pair, settings: str = "") -> dict[str, Any]:
    """Return the arguments of :func:`computed` that identify a result: `inputs`, `settings` and `shared`."""
    return {"inputs": inputs.digest, "settings": settings, "shared": inputs.shared}


MAX_SHARED_BYTES = 512 * 2**20
"""Limit for the results of the examples, bytes."""

MAX_OWN_BYTES = 192 * 2**20
"""Limit for the results of one visitor's own files, bytes."""

MAX_ALL_OWN_BYTES = 1024 * 2**20
"""Limit for the results of all visitors' own files, bytes."""


@dataclass(eq=False)
class RecentResults:
    """The most recently used results, as many as fit into `max_bytes`; the newest is kept whatever its size.

    `on_put` is called after each new result.
    """

    max_bytes: int
    on_put: Callable[[], None] = lambda: None
    _results: LRUCache[str, Any] = field(default_factory=lambda: LRUCache(math.inf, getsizeof=_bytes_of))
    _lock: threading.Lock = field(default_factory=threading.Lock)

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
        self.shrink(self.max_bytes)
        self.on_put()

    def shrink(self, max_bytes: int) -> None:
        """Drop the least recently used results until the rest fit or only the newest remains."""
        with self._lock:
            while len(self._results) > 1 and self._results.currsize > max_bytes:
                self._results.popitem()


@dataclass(eq=False)
class SharedRoom:
    """A memory limit shared by all visitors' own results: the more visitors, the less each may keep.

    Attributes
    ----------
    max_bytes
        Limit for all visitors together, bytes; the newest result of each visitor is kept regardless.
    max_each
        Limit for one visitor, bytes.
    """

    max_bytes: int
    max_each: int
    _all: weakref.WeakSet[RecentResults] = field(default_factory=weakref.WeakSet)

    def results(self) -> RecentResults:
        """Return the store of one more visitor."""
        results = RecentResults(self.max_each, self._shrink_all)
        self._all.add(results)
        return results

    def _shrink_all(self) -> None:
        """Shrink every visitor's store to an equal share if together they exceed the limit."""
        stores = list(self._all)
        if sum(store.size for store in stores) > self.max_bytes:
            for store in stores:
                store.shrink(self.max_bytes // len(stores))


_room = SharedRoom(MAX_ALL_OWN_BYTES, MAX_OWN_BYTES)


@st.cache_resource(show_spinner=False)
def _shared_results() -> RecentResults:
    return RecentResults(MAX_SHARED_BYTES)


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
    # Always present, whether or not anything is computed: otherwise all later elements would shift and be redrawn.
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
    """Return a result from memory, or compute it if that takes no noticeable time; else return None.

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
    to cancel it, stays usable, and reruns when it is done. Each task has one job at a time: new inputs or settings
    cancel the previous one.

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
    kept: dict[str, Any] = {"inputs": inputs, "settings": settings, "shared": shared}
    refused = estimate.memory > limits().job_memory
    if job is None and (refused or not is_heavy(estimate) or computed_before(task, **kept) is not None):
        if estimate.seconds < PATIENCE_S:
            # Too short for a progress bar, which itself takes time to draw.
            return _remembered_alone(task, compute, **kept)
        return computed(task, partial(_alone, compute), **kept, label=label)
    place = st.empty()
    if job is None:
        job = Job(lambda job: compute(job.report_or_end), estimate)
        jobs[task] = key, job
    if job.cancelled:
        with place.container(horizontal=True, vertical_alignment="center"):
            prose.caption("Cancelled.", width="content")
            st.button(
                "Compute",
                key=f"results.again.{task}",
                on_click=_forget_job,
                args=(task,),
                icon=":material/replay:",
            )
        return None
    if job.running:
        with place.container():
            watch(job, partial(show_busy, job, label, key=f"results.cancel.{task}"), until_cancelled=True)
        return None
    del jobs[task]
    return cast(T, remembered(task, job.result, **kept))


@dataclass(frozen=True)
class Refusal:
    """The reason why a computation has no result; kept like a result."""

    reason: str


def attempted(compute: Callable[[Progress], T]) -> Callable[[Progress], T | Refusal]:
    """Return a computation that returns its ValueError as a result, so that it is kept and not tried again."""

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
    """Return the result of a light computation, which another thread of this visitor may be computing already."""
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
    """Return the memory of a file, text, array or number, of several results, or of a result's files and arrays."""
    if isinstance(result, bytes | str):
        return len(result)
    if isinstance(result, np.ndarray | float):
        return np.asarray(result).nbytes
    if isinstance(result, list | tuple):
        return sum(map(_bytes_of, result))
    return sum(_bytes_of(value) for value in vars(result).values() if isinstance(value, bytes | np.ndarray))
