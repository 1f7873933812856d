"""The overlap of the windows, shown below the explained match."""

from __future__ import annotations

import json
from typing import Any

import pytest
from streamlit.testing.v1 import AppTest

from stereolag.assess.explaining import Box
from stereolag.core.typography import typeset
from stereolag.figures.match import window_grid
from stereolag.ui.depth.sentences import overlap_in_words


def part() -> None:
    import streamlit as st

    from stereolag.assess.explaining import explain_match
    from stereolag.stereo.windows.matcher import CorrelationMatcher
    from stereolag.ui.depth.explaining import show_overlap
    from tests.app.depth_view import small_view

    view = small_view()
    matcher = CorrelationMatcher(window_size=st.session_state.size, overlap=st.session_state.overlap)
    show_overlap(view, matcher, explain_match(matcher, view.pair.left, view.pair.right, 80, 140))


def opened(size: int, overlap: float) -> tuple[str, dict[str, Any]]:
    app = AppTest.from_function(part, default_timeout=60)
    app.session_state.size, app.session_state.overlap = size, overlap
    app.run()
    assert not app.exception
    (chart,) = app.get("plotly_chart")
    return app.markdown[-1].value, json.loads(chart.proto.spec)


def test_the_figure_and_its_sentence_follow_the_settings() -> None:
    fine, close = opened(20, 0.9)
    assert fine.startswith(typeset("20 px windows, 90 % overlap: one every 2 px, so 289 values in this cut. "))
    coarse, apart = opened(20, 0.0)
    assert coarse.startswith(typeset("20 px windows, 0 % overlap: one every 20 px, so 9 values in this cut. "))

    def begins(chart: dict[str, Any]) -> list[float]:
        return sorted({shape["x0"] for shape in chart["layout"]["shapes"]})

    assert len(close["layout"]["shapes"]) == len(apart["layout"]["shapes"]) == 9
    assert begins(close)[1] - begins(close)[0] == 2
    assert begins(apart)[1] - begins(apart)[0] == 20


@pytest.mark.parametrize(
    ("size", "step", "asked", "says"),
    [
        (3, 1, 0.95, "3 px windows, 95 % overlap (67 % in whole pixels): one every 1 px, so 25 values"),
        (60, 1, 0.99, "Only every third window and dot is drawn."),
        (48, 1, 0.98, "Only every second window and dot is drawn."),
        (255, 1, 0.999, "Only every 11th window and dot is drawn."),
        (300, 300, 0.0, "so 1 value in this cut"),
    ],
)
def test_the_sentence_says_what_is_drawn(size: int, step: int, asked: float, says: str) -> None:
    assert typeset(says) in typeset(overlap_in_words(window_grid((300, 300), Box(0, 0, size, size), step), asked))
