"""What is left to do when a visitor has gone: call off what was computed for them, and give their memory back."""

from __future__ import annotations

import ctypes
import gc
import threading
from typing import Any

import streamlit as st
from streamlit import runtime

from stereolag.ui.jobs import Job

AFTERWARDS_S = 2.0
"""How long after a session has ended for good its memory is given back, together with that of others."""


class Visit:
    """What is computed for one visitor at the moment, by the place on the page that shows it."""

    def __init__(self) -> None:
        self.jobs: dict[str, tuple[str, Job[Any]]] = {}

    def end(self) -> None:
        """Call everything off."""
        for _, job in self.jobs.values():
            job.cancel()
        _give_memory_back_later()


@st.cache_resource(scope="session", show_spinner=False, on_release=Visit.end)
def this_visit() -> Visit:
    """Return the visit of the session that asks; it ends when the visitor leaves."""
    return Visit()


_timer_lock = threading.Lock()
_timer: threading.Timer | None = None


def _give_memory_back_later() -> None:
    """Give memory back when the session can no longer be taken up again; once for all that end until then."""
    global _timer
    with _timer_lock:
        if _timer is not None:
            _timer.cancel()
        _timer = threading.Timer(st.get_option("server.disconnectedSessionTTL") + AFTERWARDS_S, _give_memory_back)
        _timer.daemon = True
        _timer.start()


def _give_memory_back() -> None:
    _forget_ended_sessions()
    # What was frozen at the first page held cycles of the session that opened it.
    gc.unfreeze()
    gc.collect()
    gc.freeze()
    if hasattr(ctypes.CDLL(None), "malloc_trim"):  # glibc keeps freed memory for itself otherwise
        ctypes.CDLL(None).malloc_trim(0)


def _forget_ended_sessions() -> None:
    """Drop the sessions whose time is over: Streamlit does so only when the next one ends."""
    if runtime.exists():
        runtime.get_instance()._session_mgr._session_storage._cache.expire()  # type: ignore[attr-defined]
