"""The choice of a page's inputs: one of the examples, or the visitor's own files."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Protocol, TypeVar

import streamlit as st

from stereolag.core.jobs import limits
from stereolag.ui import prose
from stereolag.ui.controls import persistent
from stereolag.ui.uploads import expect_uploads, refused, still_missing

T = TypeVar("T")

OWN = "own"

GONE = (
    "The files you had here are gone: the server was restarted, or this page was disconnected for too long. "
    "Add them again."
)


class Example(Protocol):
    """The interface of every bundled example."""

    @property
    def title(self) -> str:
        """Return the heading."""


def choose(examples: Mapping[str, Example], *, key: str) -> str:
    """Return the name of the chosen example, or ``OWN``."""
    first_run = f"{key}.gone" not in st.session_state
    chosen = st.segmented_control(
        "Inputs",
        [*examples, OWN],
        default=next(iter(examples)),
        format_func=lambda name: "Your own files" if name == OWN else examples[name].title,
        required=True,
        **persistent(key),
        label_visibility="collapsed",
    )
    if first_run:
        # Only a browser that remembers an earlier session starts with its own files selected.
        st.session_state[f"{key}.gone"] = chosen == OWN
    if chosen != OWN:
        st.session_state[f"{key}.example"] = chosen
    return str(chosen)


def no_files_yet(key: str) -> None:
    """Record that a visitor sent to "own files" has uploaded none yet, so that none are reported as gone."""
    st.session_state[f"{key}.gone"] = False


def own_or_example(
    chosen: str,
    ask: Callable[[], T | None],
    load: Callable[[str], T],
    examples: Mapping[str, Example],
    *,
    key: str,
    awaited: str,
) -> T:
    """Return the chosen inputs; stop the page here if the visitor's own files were refused.

    Parameters
    ----------
    chosen
        Return value of :func:`choose`.
    ask
        Asks for the visitor's own files; returns None while some are missing.
    load
        Loads an example by its name.
    examples, key
        The arguments given to :func:`choose`.
    awaited
        Subject and verb of the notice shown until the visitor's files are there: "both images are".
    """
    if chosen != OWN:
        return load(chosen)
    expect_uploads()
    own = ask()
    if own is not None:
        st.session_state[f"{key}.gone"] = False
        return own
    if refused():
        # Do not show results of an example below a refused file.
        st.stop()
    if st.session_state[f"{key}.gone"]:
        prose.warning(GONE, icon=":material/cloud_off:")
    name: str = st.session_state.get(f"{key}.example", next(iter(examples)))
    show_awaited(awaited, examples[name].title)
    return load(name)


def show_awaited(awaited: str, example: str) -> None:
    """Say which files are missing and which example is shown instead; `awaited` is as in `own_or_example`."""
    missing = still_missing()
    said = f"Still missing: {', '.join(missing)}. Until then" if missing else f"Until {awaited} here,"
    prose.info(f"{said} the page shows the example “{example}”.", icon=":material/upload_file:")


def show_limits(largest: str) -> None:
    """Show the size limits of files, and that files stay in the visitor's session."""
    prose.caption(f"{largest} Your files stay in this session: nothing is written to disk or shown to anyone else.")


def image_limits() -> str:
    """Return a sentence about the size limits of an image file."""
    return f"Images may have {st.get_option('server.maxUploadSize')} MB and {limits().max_megapixels} megapixels."
