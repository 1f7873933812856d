"""Which inputs a page works on: one of the examples, or files of the visitor's own."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Protocol

import streamlit as st

OWN = "own"


class Example(Protocol):
    """What every bundled example has."""

    @property
    def title(self) -> str:
        """Return the heading."""


def choose(examples: Mapping[str, Example], *, key: str) -> str:
    """Return the name of the example chosen, or ``OWN``."""
    chosen = st.segmented_control(
        "Inputs",
        [*examples, OWN],
        default=next(iter(examples)),
        format_func=lambda name: "Your own files" if name == OWN else examples[name].title,
        required=True,
        key=key,
        persist_state="session",
        label_visibility="collapsed",
    )
    if chosen != OWN:
        st.session_state[f"{key}.example"] = chosen
    return str(chosen)


def example_meanwhile(examples: Mapping[str, Example], what: str, *, key: str) -> str:
    """Return the example that is shown until the visitor's files are there, and say so."""
    name: str = st.session_state.get(f"{key}.example", next(iter(examples)))
    st.info(f"Until {what} here, the page shows the example “{examples[name].title}”.", icon=":material/upload_file:")
    return name
