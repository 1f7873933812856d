"""What a page shows where there is no result: refused, failed, waiting or being computed, cancelled."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import streamlit as st

from stereolag.typography import typeset
from stereolag.ui import prose
from stereolag.ui.jobs import Job, waiting_in_words


def show_refused(reason: object) -> None:
    """Show why what was given or set cannot be used: a sentence that names the value and what is allowed."""
    prose.error(str(reason), icon=":material/block:")


def show_failed(number: str) -> None:
    """Show that something failed which should not have; the log holds the details under the same number."""
    prose.error(
        "Something failed here that should not have; your files and settings are kept. If it happens again, give the "
        f"number **{number}** to whoever runs this app: their log holds the details under it.",
        icon=":material/bug_report:",
    )


def show_out_of_memory(number: str) -> None:
    """Show that there was not enough memory; the log holds the details under the number."""
    prose.error(
        f"There is not enough memory left for this now (number **{number}** in the log). Your files and settings are "
        "kept: try again later, or with smaller files.",
        icon=":material/memory:",
    )


def show_busy(
    job: Job[Any], label: str, *, key: str, done: float | None = None, ending: str = "Ends the computation."
) -> None:
    """Show a job's place in the queue, or how far it is, and let it be ended.

    Parameters
    ----------
    job
        That waits or is computed.
    label
        What is computed.
    key
        Of the button.
    done
        0..1, where that is told elsewhere than by the job.
    ending
        What becomes of it then.
    """
    with st.container(horizontal=True, vertical_alignment="center"):
        if job.ahead:
            prose.info(waiting_in_words(job), icon=":material/groups:")
        else:
            st.progress(min(max(job.progress if done is None else done, 0.0), 1.0), typeset(label))
        st.button(
            "Ending …" if job.cancelled else "Cancel",
            key=key,
            on_click=job.cancel,
            disabled=job.cancelled,
            icon=":material/stop_circle:",
            help=ending,
        )


def show_cancelled(said: str, again: str, begin: Callable[..., None], *args: Any, key: str) -> None:
    """Show that a job was ended, with a button that begins it again or goes on with it."""
    with st.container(horizontal=True, vertical_alignment="center"):
        prose.caption(said, width="content")
        st.button(again, key=key, on_click=begin, args=args, icon=":material/replay:")
