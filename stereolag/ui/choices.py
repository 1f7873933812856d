"""Which inputs a page works on: one of the examples, or files of the visitor's own."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Protocol, TypeVar

import streamlit as st

from stereolag.limits import limits
from stereolag.ui import prose
from stereolag.ui.persistence import persistent
from stereolag.ui.uploads import expect_uploads, refused, still_missing

T = TypeVar("T")

OWN = "own"

GONE = (
    "The files you had here are gone: the server was started again, or this page was away from it for too long. "
    "Add them once more."
)


class Example(Protocol):
    """What every bundled example has."""

    @property
    def title(self) -> str:
        """Return the heading."""


def choose(examples: Mapping[str, Example], *, key: str) -> str:
    """Return the name of the example chosen, or ``OWN``."""
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
        # Only a browser that knew an earlier session begins with files of its own.
        st.session_state[f"{key}.gone"] = chosen == OWN
    if chosen != OWN:
        st.session_state[f"{key}.example"] = chosen
    return str(chosen)


def no_files_yet(key: str) -> None:
    """Take note that whoever is led to files of their own has given none yet: none are gone."""
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
    """Return the inputs chosen; the page ends here where those of the visitor were refused.

    Parameters
    ----------
    chosen
        As :func:`choose` returned it.
    ask
        Asks for the visitor's own files; returns None while they are not there.
    load
        Loads an example by its name.
    examples, key
        As :func:`choose` took them.
    awaited
        What is said to be missing until the visitor's files are there: "both images are".
    """
    if chosen != OWN:
        return load(chosen)
    expect_uploads()
    own = ask()
    if own is not None:
        st.session_state[f"{key}.gone"] = False
        return own
    if refused():
        # What an example gives must not stand below a file that was refused.
        st.stop()
    if st.session_state[f"{key}.gone"]:
        prose.warning(GONE, icon=":material/cloud_off:")
    name: str = st.session_state.get(f"{key}.example", next(iter(examples)))
    show_awaited(awaited, examples[name].title)
    return load(name)


def show_awaited(awaited: str, example: str) -> None:
    """Show which files are missing, and that an example stands in for them; `awaited` as own_or_example takes it."""
    missing = still_missing()
    said = f"Still missing: {', '.join(missing)}. Until then" if missing else f"Until {awaited} here,"
    prose.info(f"{said} the page shows the example “{example}”.", icon=":material/upload_file:")


def show_limits(largest: str) -> None:
    """Show how large files may be, and that they stay with their visitor."""
    prose.caption(f"{largest} Your files stay in this session: nothing is written to disk or shown to anyone else.")


def image_limits() -> str:
    """Return how large the file of an image may be."""
    return f"Images may have {st.get_option('server.maxUploadSize')} MB and {limits().max_megapixels} megapixels."
