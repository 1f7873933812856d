"""The row of numbers under a result."""

from __future__ import annotations

from collections.abc import Iterable
from typing import NamedTuple

import streamlit as st


class Number(NamedTuple):
    """A number with its unit, what it is called, and what it means."""

    label: str
    value: str
    meaning: str


def show_numbers(numbers: Iterable[Number]) -> None:
    """Show numbers side by side, on as many lines as the window needs."""
    with st.container(horizontal=True, gap="small"):
        for label, value, meaning in numbers:
            st.metric(label, value, help=meaning, width="content")
