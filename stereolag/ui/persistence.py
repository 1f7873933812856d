"""The values of controls that outlive the part of a page in which they are drawn."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from typing import Any

import streamlit as st

KEY = "persistence"
PAGE = f"{KEY}.page"
"""In the session's state: the page run last."""
BEFORE = f"{KEY}.before"
"""In the session's state: the page run before this run."""
ENDED = f"{KEY}.ended"
"""In the session's state: {page or part of a page that reruns alone: how many of its runs came to their end}."""
WITHIN = f"{KEY}.within"
"""In the session's state: {part: the run of what holds it, in which it was drawn}."""
DRAWN = f"{KEY}.drawn"
"""In the session's state: {key of a control: the run that drew it last}."""

ANY_PAGE = "page"

Run = tuple[tuple[str, int], ...]
"""The page and the parts in one another that were run, each with the number of its run; a run that is broken off has
the number of the next."""

_current: ContextVar[Run] = ContextVar("run", default=())


@contextmanager
def run_of_page(title: str) -> Iterator[None]:
    """Count a run of a page, inside which it is drawn."""
    state = st.session_state
    state[BEFORE] = state.get(PAGE, title)
    if state[BEFORE] != title:
        _ended()[ANY_PAGE] += 1  # it does not follow the last run of this page
    state[PAGE] = title
    with _counted(ANY_PAGE, ()):
        yield


def from_another_page() -> bool:
    """Return whether the run before was one of another page."""
    return bool(st.session_state.get(BEFORE) != st.session_state.get(PAGE))


@contextmanager
def run_of_part(name: str) -> Iterator[None]:
    """Count a run of a part of a page that reruns alone, inside which it is drawn."""
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
    """Return the arguments of a control whose value outlives it: its key, and for how long."""
    if drawn_anew(key) and key in st.session_state:
        st.session_state[key] = st.session_state[key]
    return {"key": key, "persist_state": "session"}


def drawn_anew(key: str) -> bool:
    """Return whether a control that is about to be drawn was drawn before, but not in the run before.

    It must then be set, to whatever it is. Streamlit tells the browser no value that the browser sent along; but one
    that sent it before it heard that the control was gone forgets it then, and shows the control as it was at first.
    """
    run = _current.get()
    drawn: dict[str, Run] = st.session_state.setdefault(DRAWN, {})
    before = drawn.get(key, run)
    drawn[key] = run
    return len(run) != len(before) or any(
        name != old or number > last + 1 for (name, number), (old, last) in zip(run, before, strict=True)
    )
