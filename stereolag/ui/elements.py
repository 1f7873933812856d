"""The row of numbers under a result."""

from __future__ import annotations

import base64
import time
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from typing import NamedTuple

import streamlit as st

from stereolag.progress import Progress
from stereolag.typography import NO_BREAK, typeset

PERCENT, PIXELS, SECONDS = (
    f"{number}{NO_BREAK}{unit}" for number, unit in (("%.1f", "%%"), ("%.2f", "px"), ("%.3f", "s"))
)
"""Formats of the columns of tables."""


class Number(NamedTuple):
    """A number with its unit, what it is called, and what it means."""

    label: str
    value: str
    meaning: str


def show_numbers(numbers: Iterable[Number]) -> None:
    """Show numbers side by side, on as many lines as the window needs."""
    with st.container(horizontal=True, gap="small"):
        for label, value, meaning in numbers:
            st.metric(label, typeset(value), help=typeset(meaning), width="content")


def show_png(data: bytes, alt: str, caption: str | None = None, *, stretch: bool = True) -> None:
    """Show a PNG as wide as there is room, or in its own size; `alt` says what it shows to who cannot see it.

    It travels within the page's message: as a file of its own the browser would have to ask for it, one round trip
    later, and in vain where the next position of a slider has already replaced it.
    """
    _show(data, "image/png", alt, caption, stretch=stretch)


def show_jpeg(data: bytes, alt: str) -> None:
    """Show a JPEG as wide as there is room, as :func:`show_png` does."""
    _show(data, "image/jpeg", alt, None, stretch=True)


def _show(data: bytes, media_type: str, alt: str, caption: str | None, *, stretch: bool) -> None:
    address = f"data:{media_type};base64," + base64.b64encode(data).decode("ascii")
    st.image(address, caption and typeset(caption), width="stretch" if stretch else "content", alt=alt and typeset(alt))


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
