"""The frame of every page: its title, the links to the other pages."""

from __future__ import annotations

import functools
import gc
import logging
import secrets
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import ParamSpec, TypeVar

import streamlit as st
from starlette.formparsers import MultiPartParser

from stereolag.limits import set_defaults
from stereolag.ui import prose
from stereolag.ui.persistence import run_of_page, run_of_part
from stereolag.ui.states import show_failed, show_out_of_memory
from stereolag.ui.visits import run_again_when_reconnected, this_visit
from stereolag.warming import warm

ICON = Path(__file__).with_name("icon.svg")
ICONS = Path(__file__).with_name("icons")
"""Of the pages' tabs, named as their files are; the home page has that of the app."""
STYLE = Path(__file__).with_name("page.css")

PAGES = {
    "app.py": ("Home", ":material/home:"),
    "pages/1_Sensor_lag.py": ("Sensor lag", ":material/graphic_eq:"),
    "pages/2_Rocketman_search.py": ("Rocketman search", ":material/search:"),
    "pages/3_Depth_maps.py": ("Depth maps", ":material/layers:"),
    "pages/4_Calibrate.py": ("Calibrate", ":material/grid_on:"),
    "pages/5_Driving.py": ("Driving", ":material/directions_car:"),
}


JOB_MEMORY_MB = 2048
MAX_MEGASAMPLES = 30
MAX_FRAMES = 6000
MAX_VIDEO_S = 600
"""What one job may take of a server that many share, unless whoever runs it says otherwise."""


@contextmanager
def page(title: str, introduction: str = "", try_first: str = "") -> Iterator[None]:
    """Begin a page: browser title, links, heading, a paragraph that says what it is for, and what to try first.

    Its content goes inside; where that fails, the visitor is told so. A page without an introduction draws its heading
    itself.
    """
    own = ICONS / f"{title.lower().replace(' ', '_')}.svg"
    st.set_page_config(page_title=f"{title} · stereolag", page_icon=own if own.exists() else ICON, layout="wide")
    this_visit()
    st.html(STYLE)
    with st.container(horizontal=True, gap="medium", vertical_alignment="center", key="page-links"):
        for path, (label, icon) in PAGES.items():
            st.page_link(path, label=label, icon=icon)
    if introduction:
        st.title(title, anchor=False)
        prose.markdown(introduction, width=760)
    if try_first:
        show_try_first(try_first)
    if not _prepare_process.cache_info().currsize:
        with st.spinner("Starting …"):
            _prepare_process()
    run_again_when_reconnected()
    with run_of_page(title), failures_answered():
        yield


def show_try_first(sentence: str) -> None:
    """Show the one thing that a first visitor should try."""
    prose.markdown(f":primary[:material/touch_app: **Try first:**] {sentence}", width=760)


@functools.cache
def _prepare_process() -> None:
    """Set, once per process, what a server needs that a script does not."""
    set_defaults(
        job_memory_mb=JOB_MEMORY_MB,
        max_megasamples=MAX_MEGASAMPLES,
        max_frames=MAX_FRAMES,
        max_video_s=MAX_VIDEO_S,
    )
    warm()
    # An upload above 1 MB would be put down in a temporary file on its way into memory.
    MultiPartParser.spool_max_size = st.get_option("server.maxUploadSize") * 2**20
    # With many sessions the pauses of garbage collection grow with what the imports left behind.
    gc.collect()
    gc.freeze()


P = ParamSpec("P")
R = TypeVar("R")

_log = logging.getLogger("stereolag")


@contextmanager
def failures_answered() -> Iterator[None]:
    """Answer an error of ours with a sentence and a number that also stands in the log, before the traceback."""
    try:
        yield
    except MemoryError:
        show_out_of_memory(_logged("The server ran out of memory"))
    except Exception:  # whatever it is: a visitor is not shown the insides of the server
        show_failed(_logged("A page failed"))


def fragment(function: Callable[P, R]) -> Callable[P, R | None]:
    """Make a part of a page that reruns alone (``st.fragment``) and whose failures are answered."""

    @functools.wraps(function)
    def answered(*args: P.args, **kwargs: P.kwargs) -> R | None:
        with run_of_part(f"{function.__module__}.{function.__qualname__}"), failures_answered():
            return function(*args, **kwargs)
        return None

    return st.fragment(answered)


def _logged(what: str) -> str:
    number = secrets.token_hex(4)
    _log.exception("%s (number %s).", what, number)
    return number
