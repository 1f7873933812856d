"""Shared page elements: numbers, images, a progress bar, messages in place of a result, and the live region."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from functools import partial
from typing import Any, Literal, NamedTuple, TypeVar

import plotly.graph_objects as go
import streamlit as st

from stereolag.core.jobs import Progress
from stereolag.core.typography import NO_BREAK, typeset
from stereolag.figures.pictures import data_url
from stereolag.ui import prose
from stereolag.ui.components import component

T = TypeVar("T")

# Number formats of table columns.
PERCENT_FORMAT = f"%.1f{NO_BREAK}%%"
PIXELS_FORMAT = f"%.2f{NO_BREAK}px"
SECONDS_FORMAT = f"%.3f{NO_BREAK}s"


class Number(NamedTuple):
    """A number with its unit, as text, its label and its meaning."""

    label: str
    value: str
    meaning: str


def show_numbers(numbers: Iterable[Number]) -> None:
    """Show numbers in one line of text, with their meanings as its tooltip."""
    shown = [*numbers]
    prose.caption(
        " · ".join(f"{label} **{value}**" for label, value, _ in shown),
        help=typeset("\n".join(f"- **{label}**: {meaning}" for label, _, meaning in shown)),
    )


def show_note(text: str, icon: str = "") -> None:
    """Show the first sentence up to its colon, with the whole text as its tooltip, and the other sentences."""
    first, _, more = text.partition(". ")
    brief, _, details = first.partition(": ")
    prose.caption(
        " ".join(filter(None, (icon, f"{brief.removesuffix('.')}.", more))),
        help=typeset(text) if details else None,
        width="content",
    )


def show_offer(sentence: str, label: str, key: str, act: Callable[[], None], note: str | None = None) -> None:
    """Show a sentence in small print with a button beside it; `note` is the icon of a sentence shown as a note."""
    with st.container(horizontal=True, vertical_alignment="center", gap="small", width="content"):
        if note is None:
            prose.caption(sentence, width="content")
        else:
            show_note(sentence, note)
        st.button(label, key=key, type="tertiary", on_click=act)


def asked_for(request: object, label: str, key: str, **button: Any) -> bool:
    """Show a button, and return whether the last request made with it under this key was `request`.

    `button` holds further arguments of the button.
    """
    st.button(label, key=f"{key}.start", on_click=partial(st.session_state.update, {key: request}), **button)
    return bool(st.session_state.get(key) == request)


def show_remedy(sentence: str, label: str, key: str, act: Callable[[], None]) -> None:
    """Show a sentence with a button beside it that reruns the whole page; without a label there is no button."""
    with st.container(horizontal=True, vertical_alignment="center", gap="small"):
        prose.markdown(sentence, width="stretch")
        if label and st.button(label, key=key, on_click=act):
            st.rerun()


def show_chart(figure: go.Figure, key: str, alt: str) -> None:
    """Show a chart without a tool bar; `alt` describes it for screen readers."""
    st.plotly_chart(figure, key=key, config={"displayModeBar": False}, alt=typeset(alt))


def show_picture(data: bytes, alt: str, caption: str | None = None, *, stretch: bool = True) -> None:
    """Show a PNG or JPEG at full width, or at its own size; `alt` describes it for screen readers.

    It is embedded in the message to the page. A separate file would cost a round trip, and the request would fail if
    the next slider position had already replaced the file.
    """
    st.image(
        data_url(data),
        caption and typeset(caption),
        width="stretch" if stretch else "content",
        alt=alt and typeset(alt),
    )


PATIENCE_S = 0.5
"""Computations shorter than this show no progress bar, s; one that flashes by only distracts."""

UPDATE_INTERVAL_S = 0.1
"""Shortest interval between updates of a progress bar, s."""


@contextmanager
def shown_progress(label: str) -> Iterator[Progress]:
    """Show a spinner and a progress bar; yield the progress callback that long computations take."""
    last_update = time.monotonic() + PATIENCE_S - UPDATE_INTERVAL_S

    def show(fraction: float) -> None:
        nonlocal last_update
        now = time.monotonic()
        if now - last_update >= UPDATE_INTERVAL_S:
            last_update = now
            place.progress(min(max(fraction, 0.0), 1.0))

    with st.spinner(label, show_time=True):
        place = st.empty()  # below the label, and emptied before it, so that neither moves
        yield show
        place.empty()


def in_columns(items: Iterable[T], *, gap: Literal["small", "medium", "large"] = "medium") -> Iterator[T]:
    """Yield each item with its own column open: everything drawn before the next item goes into that column."""
    drawn = [*items]
    for column, item in zip(st.columns(len(drawn), gap=gap), drawn, strict=True):
        with column:
            yield item


def show_refused(reason: object) -> None:
    """Show why an input or setting is refused: a sentence that names the value and the allowed ones."""
    prose.error(str(reason), icon=":material/block:")


@contextmanager
def refusals_shown(sentence: str = "{}") -> Iterator[None]:
    """Show the text of a ValueError raised in the ``with`` block, within `sentence`, and continue after the block."""
    try:
        yield
    except ValueError as error:
        show_refused(sentence.format(error))


def announce(headline: str) -> None:
    """Announce a headline, plain or Markdown, to screen readers once it has been stable for a moment.

    Call it once per page: it is the only live region for results. Streamlit announces errors itself.
    """
    component("announcement")(key="announced", data=typeset(headline.replace("**", "")))
