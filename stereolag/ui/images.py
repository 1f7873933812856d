"""Pictures on a page."""

from __future__ import annotations

import base64

import streamlit as st


def show_png(data: bytes, caption: str | None = None, *, stretch: bool = True) -> None:
    """Show a PNG as wide as there is room, or in its own size."""
    _show(data, "image/png", caption, stretch=stretch)


def show_jpeg(data: bytes) -> None:
    """Show a JPEG as wide as there is room."""
    _show(data, "image/jpeg", None, stretch=True)


def _show(data: bytes, media_type: str, caption: str | None, *, stretch: bool) -> None:
    """Let a picture travel within the page's message.

    As a file of its own the browser would have to ask for it, one round trip later, and in vain where the next position
    of a slider has already replaced it.
    """
    address = f"data:{media_type};base64," + base64.b64encode(data).decode("ascii")
    st.image(address, caption, width="stretch" if stretch else "content")
