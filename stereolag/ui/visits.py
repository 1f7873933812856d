"""Cleanup after a visitor has left: cancel their jobs, and give their memory back."""

from __future__ import annotations

import ctypes
import sys
import threading
import time
from contextlib import suppress
from typing import Any

import streamlit as st

from stereolag import streamlit_inside as inside
from stereolag.ui.jobs import Job

AFTERWARDS_S = 2.0
"""How long after the final end of a session its memory is given back, together with that of others, s."""


class Visit:
    """The current jobs of one visitor, by the place on the page that shows them."""

    def __init__(self) -> None:
        self.jobs: dict[str, tuple[str, Job[Any]]] = {}

    def end(self) -> None:
        """Cancel all jobs, and give the memory back later."""
        for _, job in self.jobs.values():
            job.cancel()
        _give_memory_back_later()


@st.cache_resource(scope="session", show_spinner=False, on_release=Visit.end)
def this_visit() -> Visit:
    """Return the visit of the current session; it ends when the visitor leaves."""
    return Visit()


class _Timer:
    """Gives memory back once no ended session can be resumed any more, and not too often."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._running = False
        self._last_end = 0.0

    def start(self, wait_s: float) -> None:
        """Give memory back in `wait_s` seconds; if that is already scheduled, keep its time and do it once more."""
        with self._lock:
            self._last_end = time.monotonic()
            if not self._running:
                self._running = True
                self._call_in(wait_s, wait_s)

    def _call_in(self, seconds: float, wait_s: float) -> None:
        timer = threading.Timer(seconds, self._ring, (wait_s,))
        timer.daemon = True
        timer.start()

    def _ring(self, wait_s: float) -> None:
        _give_memory_back()
        with self._lock:
            left_s = self._last_end + wait_s - time.monotonic()
            self._running = left_s > 0
            if self._running:  # others have left meanwhile
                self._call_in(left_s, wait_s)


_timer = _Timer()


def _give_memory_back_later() -> None:
    _timer.start(st.get_option("server.disconnectedSessionTTL") + AFTERWARDS_S)


def _give_memory_back() -> None:
    inside.forget_ended_sessions()
    inside.freeze_imports()
    if sys.platform == "linux":
        with suppress(AttributeError):  # only glibc retains freed memory, and has this call to release it
            ctypes.CDLL(None).malloc_trim(0)
