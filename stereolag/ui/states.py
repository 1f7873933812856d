"""Messages shown in place of a result: refused, failed, waiting or being computed, cancelled."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import streamlit as st

from stereolag.core.typography import typeset
from stereolag.ui import prose
from stereolag.ui.jobs import Job, waiting_in_words


def show_refused(reason: object) -> None:
    """Show why an input or setting is refused: a sentence that names the value and what is allowed."""
    prose.error(str(reason), icon=":material/block:")


def show_failed(number: str) -> None:
    """Show that something failed unexpectedly; the log has the details under the same number."""
    prose.error(
        "Something failed unexpectedly; your files and settings are kept. If it happens again, give the number "
        f"**{number}** to whoever runs this app: it marks the details in their log.",
        icon=":material/bug_report:",
    )


def show_out_of_memory(number: str) -> None:
    """Show that memory ran out; the log has the details under the same number."""
    prose.error(
        f"There is not enough memory left for this now (number **{number}** in the log). Your files and settings are "
        "kept: try again later, or with smaller files.",
        icon=":material/memory:",
    )


def show_busy(
    job: Job[Any], label: str, *, key: str, done: float | None = None, ending: str = "Ends the computation."
) -> None:
    """Show a job's place in the queue or its progress, with a button to end it.

    Parameters
    ----------
    job
        The job, waiting or being computed.
    label
        Text of the progress bar.
    key
        Key of the button.
    done
        Fraction done, 0..1; that of the job if None.
    ending
        Help of the button, which says what ending the job does.
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
    """Show that a job was ended, with a button that restarts or resumes it."""
    with st.container(horizontal=True, vertical_alignment="center"):
        prose.caption(said, width="content")
        st.button(again, key=key, on_click=begin, args=args, icon=":material/replay:")
