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
from stereolag.ui.visits import run_again_when_reconnected, this_visit
from stereolag.warming import warm

ICON = Path(__file__).with_name("icon.svg")
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
def page(title: str, introduction: str = "") -> Iterator[None]:
    """Begin a page: browser title, links, heading and a paragraph that says what the page is for.

    Its content goes inside; where that fails, the visitor is told so. A page without an introduction draws its heading
    itself.
    """
    st.set_page_config(page_title=f"{title} · stereolag", page_icon=ICON, layout="wide")
    _prepare_process()
    this_visit()
    st.html(STYLE)
    with st.container(horizontal=True, gap="medium", vertical_alignment="center", key="page-links"):
        for path, (label, icon) in PAGES.items():
            st.page_link(path, label=label, icon=icon)
    if introduction:
        st.title(title, anchor=False)
        st.markdown(introduction, width=760)
    run_again_when_reconnected()
    with failures_answered():
        yield


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
        number = _logged("The server ran out of memory")
        st.error(
            f"There is not enough memory left for this now (number **{number}** in the log). Try again later, or with "
            "smaller files."
        )
    except Exception:  # whatever it is: a visitor is not shown the insides of the server
        number = _logged("A page failed")
        st.error(
            f"Something failed here that should not have; your files and settings are kept. If it happens again, give "
            f"the number **{number}** to whoever runs this app: their log holds the details under it.",
            icon=":material/bug_report:",
        )


def fragment(function: Callable[P, R]) -> Callable[P, R | None]:
    """Make a part of a page that reruns alone (``st.fragment``) and whose failures are answered."""

    @functools.wraps(function)
    def answered(*args: P.args, **kwargs: P.kwargs) -> R | None:
        with failures_answered():
            return function(*args, **kwargs)
        return None

    return st.fragment(answered)


def _logged(what: str) -> str:
    number = secrets.token_hex(4)
    _log.exception("%s (number %s).", what, number)
    return number
