"""A sentence for the visitor where the app itself fails, and the traceback for whoever runs it."""

from __future__ import annotations

import functools
import logging
import secrets
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import ParamSpec, TypeVar

import streamlit as st

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
