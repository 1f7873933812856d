"""Control values that outlive the part of the page in which the control is drawn."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from typing import Any

import streamlit as st

KEY = "persistence"
PAGE = f"{KEY}.page"
"""Session-state key of the page that ran last."""
BEFORE = f"{KEY}.before"
"""Session-state key of the page that ran before this run."""
ENDED = f"{KEY}.ended"
"""Session-state key of {page or fragment: number of its completed runs}."""
WITHIN = f"{KEY}.within"
"""Session-state key of {fragment: the run of its container in which it was drawn}."""
DRAWN = f"{KEY}.drawn"
"""Session-state key of {key of a control: the run that drew it last}."""

ANY_PAGE = "page"

Run = tuple[tuple[str, int], ...]
"""The page and the nested fragments of a run, each with its run number; an interrupted run has the same number as the
next one."""

_current: ContextVar[Run] = ContextVar("run", default=())


@contextmanager
def run_of_page(title: str) -> Iterator[None]:
    """Count a run of a page; the page is drawn inside the ``with`` block."""
    state = st.session_state
    state[BEFORE] = state.get(PAGE, title)
    if state[BEFORE] != title:
        _ended()[ANY_PAGE] += 1  # this run does not directly follow the last run of this page
    state[PAGE] = title
    with _counted(ANY_PAGE, ()):
        yield


def from_another_page() -> bool:
    """Return whether the previous run was of another page."""
    return bool(st.session_state.get(BEFORE) != st.session_state.get(PAGE))


@contextmanager
def run_of_part(name: str) -> Iterator[None]:
    """Count a run of a fragment; the fragment is drawn inside the ``with`` block."""
    within: dict[str, Run] = st.session_state.setdefault(WITHIN, {})
    within[name] = _current.get() or within.get(name, ())
    with _counted(name, within[name]):
        yield


@contextmanager
def _counted(name: str, outer: Run) -> Iterator[None]:
    number = _ended()[name]
    token = _current.set((*outer, (name, number)))
    try:
        yield
    finally:
        _current.reset(token)
    _ended()[name] = number + 1


def _ended() -> Counter[str]:
    counts: Counter[str] = st.session_state.setdefault(ENDED, Counter())
    return counts


def persistent(key: str) -> dict[str, Any]:
    """Return the arguments for a control whose value outlives it: its key, and how long the value is kept."""
    if drawn_anew(key) and key in st.session_state:
        st.session_state[key] = st.session_state[key]
    return {"key": key, "persist_state": "session"}


def drawn_anew(key: str) -> bool:
    """Return whether a control about to be drawn was drawn before, but not in the previous run.

    Its value must then be assigned again, even unchanged. Streamlit does not send back a value that came from the
    browser; but a browser that sent it before it learned that the control was gone has forgotten it since, and would
    show the initial value.
    """
    run = _current.get()
    drawn: dict[str, Run] = st.session_state.setdefault(DRAWN, {})
    before = drawn.get(key, run)
    drawn[key] = run
    return len(run) != len(before) or any(
        name != old or number > last + 1 for (name, number), (old, last) in zip(run, before, strict=True)
    )
