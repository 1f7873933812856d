"""What a visitor sees while something is computed."""

from __future__ import annotations

import time
from collections.abc import Iterator
from contextlib import contextmanager

import streamlit as st

from stereolag.progress import Progress

PATIENCE_S = 0.5
"""What takes less is shown when it is done; a bar that flashes by only disturbs."""

BETWEEN_UPDATES_S = 0.1


@contextmanager
def shown_progress(label: str) -> Iterator[Progress]:
    """Show that something is being computed, and how far it is; gives the callback that long jobs take."""
    place = st.empty()
    last_update = time.monotonic() + PATIENCE_S - BETWEEN_UPDATES_S

    def show(fraction: float) -> None:
        nonlocal last_update
        now = time.monotonic()
        if now - last_update >= BETWEEN_UPDATES_S:
            last_update = now
            place.progress(min(max(fraction, 0.0), 1.0))

    with st.spinner(label, show_time=True):
        yield show
    place.empty()
