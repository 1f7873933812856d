"""The frame of every page: its title, the links to the other pages, and the layout of controls beside a result."""

from __future__ import annotations

import functools
import logging
import secrets
import sys
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import ParamSpec, TypeVar

import streamlit as st

from stereolag.core.jobs import set_defaults
from stereolag.io.guard import start_guard
from stereolag.ui import prose
from stereolag.ui import streamlit_inside as inside
from stereolag.ui.background_jobs import this_visit
from stereolag.ui.controls import drawn_anew, run_of_page, run_of_part
from stereolag.warming import warm

P = ParamSpec("P")
R = TypeVar("R")

HOME_ICON = Path(__file__).with_name("icon.svg")
ICONS = Path(__file__).with_name("icons")
"""Browser-tab icons, named after the page titles; the home page uses `HOME_ICON`."""

STYLE = Path(__file__).with_name("page.css")

DEPTH_PAGE = "pages/3_Depth_maps.py"
PAGES = {
    "app.py": ("Home", ":material/home:"),
    "pages/1_Sensor_lag.py": ("Sensor lag", ":material/graphic_eq:"),
    "pages/2_Rocketman_search.py": ("Rocketman search", ":material/search:"),
    DEPTH_PAGE: ("Depth maps", ":material/layers:"),
    "pages/4_Calibrate.py": ("Calibrate", ":material/grid_on:"),
    "pages/5_Driving.py": ("Driving", ":material/directions_car:"),
}


@contextmanager
def page(title: str) -> Iterator[None]:
    """Draw the frame of a page: browser title and links.

    The content of the page, which begins with :func:`head`, goes inside the ``with`` block; if that fails, a message is
    shown.
    """
    icon = ICONS / f"{title.lower().replace(' ', '_')}.svg"
    st.set_page_config(page_title=f"{title} · stereolag", page_icon=icon if icon.exists() else HOME_ICON, layout="wide")
    this_visit()
    st.html(f"<style>{inside.PAGE_STYLE}{STYLE.read_text(encoding='utf-8')}</style>")
    with st.container(horizontal=True, gap="small", vertical_alignment="center", key="page-links"):
        for path, (label, symbol) in PAGES.items():
            st.page_link(path, label=label, icon=symbol)
    if not _prepare_process.cache_info().currsize:
        with st.spinner("Starting …"):
            _prepare_process()
    inside.run_again_when_reconnected()
    with run_of_page(title), failures_answered():
        yield


@contextmanager
def head(title: str) -> Iterator[inside.Container]:
    """Draw the first line of a page: its title, and the choice of inputs drawn inside the ``with`` block."""
    line = st.container(horizontal=True, vertical_alignment="top", gap="medium", key="page-head")
    with line:
        st.title(title, anchor=False, width="content")
        yield line


def show_try_first(sentence: str) -> None:
    """Show the one thing a first-time visitor should try."""
    prose.markdown(f":primary[:material/touch_app: **Try first:**] {sentence}", width="content")


CONTROLS_WIDTH = 320
"""Width of the column of controls, px."""

HALF_WIDTH = (CONTROLS_WIDTH - 16) // 2
"""Width of a control that shares its line with another, px."""

FOLD_WIDTH = 320
"""Width of a closed fold in the first line of a page, px."""


def bench() -> tuple[inside.Container, inside.Container]:
    """Return the containers for the controls and, beside them, for the result; on a phone the result comes first."""
    both = st.container(horizontal=True, gap="medium", vertical_alignment="top", key="bench")
    return both.container(width=CONTROLS_WIDTH, gap="xsmall", key="bench-controls"), both.container(key="bench-result")


def show_parts(key: str, parts: Mapping[str, Callable[P, None]], *args: P.args, **kwargs: P.kwargs) -> None:
    """Show the parts of a result as tabs; each is drawn by its function only while it is open.

    The open one outlives the tabs, which are gone while a result is computed or another page is shown.
    """
    state, kept = st.session_state, f"{key}.kept"
    if drawn_anew(key) and kept in state:
        state[key] = state[kept]
    tabs = st.tabs([*parts], key=key, on_change=lambda: state.update({kept: state[key]}))
    for tab, show in zip(tabs, parts.values(), strict=True):
        if tab.open:
            with tab:
                show(*args, **kwargs)


@functools.cache
def _prepare_process() -> None:
    """Prepare the process to serve pages; runs once per process."""
    # Limits of one job on a shared server; whoever runs the server can override them.
    set_defaults(job_memory_mb=2048, max_megasamples=30, max_frames=6000, max_video_s=600)
    start_guard()
    warm()
    inside.keep_uploads_in_memory()
    inside.freeze_imports()
    # A thread that matches images takes the interpreter lock a dozen times, and waits one interval each time while
    # other visitors' scripts run: with 20 visitors, maps took seconds at Python's 5 ms, tenths of a second at 1 ms.
    sys.setswitchinterval(0.001)


_log = logging.getLogger("stereolag")


@contextmanager
def failures_answered() -> Iterator[None]:
    """Answer an unexpected error with a sentence and a number; the log has the traceback under the same number."""
    number = secrets.token_hex(4)
    try:
        yield
    except MemoryError:
        _log.exception("The server ran out of memory (number %s).", number)
        prose.error(
            f"There is not enough memory left for this now (number **{number}** in the log). Your files and settings "
            "are kept: try again later, or with smaller files.",
            icon=":material/memory:",
        )
    except Exception:  # never show server internals to a visitor
        _log.exception("A page failed (number %s).", number)
        prose.error(
            "Something failed unexpectedly; your files and settings are kept. If it happens again, give the number "
            f"**{number}** to whoever runs this app: it marks the details in their log.",
            icon=":material/bug_report:",
        )


def fragment(function: Callable[P, R]) -> Callable[P, R | None]:
    """Turn a function into an ``st.fragment``, which reruns independently, and answer its failures."""

    @functools.wraps(function)
    def answered(*args: P.args, **kwargs: P.kwargs) -> R | None:
        with run_of_part(f"{function.__module__}.{function.__qualname__}"), failures_answered():
            return function(*args, **kwargs)
        return None

    return st.fragment(answered)
