"""The headline of a result, read aloud by screen readers when it changes."""

from __future__ import annotations

from pathlib import Path

import streamlit as st

from stereolag.typography import typeset

KEY = "announced"

_region = st.components.v2.component(
    "stereolag.announcement", js=Path(__file__).with_suffix(".js").read_text(encoding="utf-8")
)


def announce(headline: str) -> None:
    """Have a headline, plain or Markdown, read aloud politely, once it has rested for a moment.

    Once a page: it is the one live region for results. What is refused or failed is announced by Streamlit itself.
    """
    _region(key=KEY, data=typeset(headline.replace("**", "")))
