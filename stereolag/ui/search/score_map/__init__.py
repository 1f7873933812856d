"""The score map, with scores read under the pointer; a click shows the place in the search by hand."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import streamlit as st

from stereolag.figures.templates import score_map_png
from stereolag.templates import TemplateMatch
from stereolag.templates.by_hand import ScoreMap
from stereolag.ui.linked_pictures import source
from stereolag.ui.packing import packed_score_map
from stereolag.ui.search.by_hand import HERE as BY_HAND
from stereolag.ui.search.by_hand import NAME

HERE = Path(__file__).parent

WORDS = {
    "hint": "Hover to read a score; click to compare that place below.",
    "reading": "Row {row}, column {col}: score {score}",
    "flat": "Row {row}, column {col}: flat, no score",
    "stage": "Score map. Arrow keys move the cursor, with Shift by ten; Enter compares that place.",
}

_panel = st.components.v2.component(
    "stereolag.score_map",
    html=source("score_map.html", folder=HERE),
    css=source("score_map.css", folder=HERE),
    js=source("shown.js", "numbers.js") + source("unpacking.js", folder=BY_HAND) + source("score_map.js", folder=HERE),
)


def packed(score_map: ScoreMap, matches: Sequence[TemplateMatch]) -> bytes:
    """Pack the score of every place, NaN if undefined, for :func:`show_score_map`; matches are ringed."""
    return packed_score_map(score_map_png(score_map, matches), score_map, name=NAME, words=WORDS)


def show_score_map(data: bytes) -> None:
    """Show the score map packed by :func:`packed`."""
    _panel(key="template.score_map", data=data)
