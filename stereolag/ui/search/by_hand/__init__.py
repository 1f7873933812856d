"""Drag the template over the picture by hand, and watch the products of template and window.

The interactive counterpart of Figs. 1.6 and 1.9 of the report. Everything runs
in the browser (the scripts beside this file); nothing is sent back.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import streamlit as st

from stereolag.templates import TemplateMatch
from stereolag.templates.by_hand import reduced_search
from stereolag.ui import prose
from stereolag.ui.linked_pictures import source
from stereolag.ui.packing import packed_search
from stereolag.ui.pictures import PictureAndTemplate
from stereolag.ui.results import remembered
from stereolag.ui.search.by_hand.words import words_of

HERE = Path(__file__).parent

NAME = "template"
"""Name of the search in the browser: a place clicked elsewhere is sent to it."""

_panel = st.components.v2.component(
    "stereolag.template_by_hand",
    html=source("by_hand.html", folder=HERE),
    css=source("by_hand.css", folder=HERE),
    js=source("shown.js", "numbers.js") + source("unpacking.js", "scoring.js", "drawing.js", "by_hand.js", folder=HERE),
)


def search_by_hand(inputs: PictureAndTemplate, matches: Sequence[TemplateMatch]) -> None:
    """Show the picture, reduced for the browser, with the template to drag over it.

    Parameters
    ----------
    inputs
        The picture and the template.
    matches
        The matches, best first; the reduction is aligned so that the best one falls on a pixel.
    """
    near = (matches[0].row, matches[0].col) if matches else None

    def pack() -> bytes:
        search = reduced_search(inputs.picture, inputs.template, inputs.mask, near=near)
        return packed_search(search, name=NAME, words=words_of(search))

    try:
        data = remembered("search by hand", pack, inputs=inputs.digest, settings=str(near), shared=inputs.shared)
    except ValueError:
        prose.caption("Too little is left of this template when it is reduced for the browser.")
        return
    _panel(key="template.by_hand", data=data)
