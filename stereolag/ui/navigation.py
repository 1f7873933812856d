"""The frame of every page: its title, the links to the other pages."""

from __future__ import annotations

import functools
import gc
from pathlib import Path

import streamlit as st

ICON = Path(__file__).with_name("icon.svg")

PAGES = {
    "app.py": ("Home", ":material/home:"),
    "pages/1_Sensor_lag.py": ("Sensor lag", ":material/graphic_eq:"),
    "pages/2_Rocketman_search.py": ("Rocketman search", ":material/search:"),
    "pages/3_Depth_maps.py": ("Depth maps", ":material/layers:"),
}


def open_page(title: str, introduction: str) -> None:
    """Begin a page: browser title, links, heading and a paragraph that says what the page is for."""
    st.set_page_config(page_title=f"{title} · stereolag", page_icon=ICON, layout="wide")
    _freeze_imports()
    with st.container(horizontal=True, gap="medium", vertical_alignment="center"):
        for path, (label, icon) in PAGES.items():
            st.page_link(path, label=label, icon=icon)
    st.title(title, anchor=False)
    st.markdown(introduction, width=760)


@functools.cache
def _freeze_imports() -> None:
    """Take what the imports left behind out of every later garbage collection: with many sessions it is the pauses."""
    gc.collect()
    gc.freeze()
