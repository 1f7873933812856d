"""Results that were computed already: kept for all visitors (of the examples) or for one (of uploads), and bounded."""

from __future__ import annotations

import hashlib
import threading
from collections import OrderedDict
from collections.abc import Callable
from typing import Any, TypeVar

import numpy as np
import streamlit as st

from stereolag.progress import Progress
from stereolag.ui.progress import shown_progress

T = TypeVar("T")

SHARED_BYTES = 512 * 2**20
OWN_BYTES = 192 * 2**20


class RecentResults:
    """The results used last, as many as fit into `max_bytes`; the newest stays whatever its size."""

    def __init__(self, max_bytes: int) -> None:
        self._max_bytes = max_bytes
        self._results: OrderedDict[str, Any] = OrderedDict()
        self._lock = threading.Lock()

    def get(self, key: str) -> Any:
        """Return the result kept under `key`, or None."""
        with self._lock:
            if key in self._results:
                self._results.move_to_end(key)
            return self._results.get(key)

    def put(self, key: str, result: Any) -> None:
        """Keep a result, and forget those that were not used for longest."""
        with self._lock:
            self._results[key] = result
            while len(self._results) > 1 and sum(map(_bytes_of, self._results.values())) > self._max_bytes:
                self._results.popitem(last=False)


@st.cache_resource(show_spinner=False)
def _shared_results() -> RecentResults:
    return RecentResults(SHARED_BYTES)


@st.cache_resource(scope="session", show_spinner=False)
def _own_results() -> RecentResults:
    return RecentResults(OWN_BYTES)


def computed(compute: Callable[[Progress], T], *, inputs: str, settings: str, shared: bool, label: str) -> T:
    """Return what `compute` gives for these inputs and settings, from memory where it was computed before.

    Parameters
    ----------
    compute
        Takes a progress callback.
    inputs
        Digest of all that goes in: never the arrays themselves, whose hashing by Streamlit only samples them.
    settings
        Everything else that the result depends on, as JSON.
    shared
        Whether the inputs are the examples, which every visitor may share.
    label
        What is shown meanwhile; it also tells different computations on the same inputs apart.
    """
    # There whether or not anything is computed: else all that follows would change its place, and be drawn anew.
    place = st.empty()
    key = hashlib.sha256("\0".join((label, inputs, settings)).encode()).hexdigest()
    results = _shared_results() if shared else _own_results()
    result: T | None = results.get(key)
    if result is None:
        with place.container(), shown_progress(label) as progress:
            result = compute(progress)
        place.empty()
        results.put(key, result)
    return result


def _bytes_of(result: Any) -> int:
    """Return the memory of a file, or of the arrays that a result holds as attributes."""
    if isinstance(result, bytes):
        return len(result)
    return sum(value.nbytes for value in vars(result).values() if isinstance(value, np.ndarray))
