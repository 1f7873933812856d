"""Pictures on a page."""

from __future__ import annotations

import base64

import streamlit as st


def show_png(data: bytes, caption: str | None = None, *, stretch: bool = True) -> None:
    """Show a PNG as wide as there is room, or in its own size.

    It travels within the page's message. As a file of its own the browser would have to ask for it, one round trip
    later, and in vain where the next position of a slider has already replaced it.
    """
    address = "data:image/png;base64," + base64.b64encode(data).decode("ascii")
    st.image(address, caption, width="stretch" if stretch else "content")
