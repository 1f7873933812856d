"""How the windows overlap: the neighbours around the chosen pixel, and the map values there."""

from __future__ import annotations

import streamlit as st

from stereolag.assess.explaining import MatchExplanation
from stereolag.core.typography import typeset
from stereolag.figures.overlap import WindowGrid, overlap_figure, window_grid
from stereolag.stereo.windows.matcher import CorrelationMatcher
from stereolag.ui import prose
from stereolag.ui.depth.view import DepthView
from stereolag.ui.sentences import percent

KEY = "depth.inspection.overlap"


def show_overlap(view: DepthView, matcher: CorrelationMatcher, seen: MatchExplanation) -> None:
    """Show the explained window among its neighbours, and the number of map values there."""
    height, width = view.pair.left.shape[:2]
    grid = window_grid((height, width), seen.window, matcher.step)
    prose.markdown("### How the windows overlap")
    figure, words = st.columns([1.3, 1], gap="medium", vertical_alignment="center")
    said = typeset(overlap_in_words(grid, matcher.overlap))
    with figure:
        st.plotly_chart(overlap_figure(view.pair.left, grid), key=KEY, config={"displayModeBar": False}, alt=said)
    with words:
        prose.markdown(said)


def overlap_in_words(grid: WindowGrid, asked: float) -> str:
    """Return the text beside the figure; `asked` is the overlap in the settings, 0..1."""
    overlap = f"{percent(asked)} overlap"
    if percent(asked) != percent(grid.overlap):
        overlap += f" ({percent(grid.overlap)} in whole pixels)"
    values = "1 value" if grid.values == 1 else f"{grid.values:,} values"
    said = (
        f"{grid.middle.height} px windows, {overlap}: one every {grid.step} px, so {values} in this cut. "
        "Each dot is the centre of a window and becomes one value of the map."
    )
    if grid.every > 1:
        said += f" Only every {_ordinal(grid.every)} window and dot is drawn."
    return said


def _ordinal(number: int) -> str:
    return {2: "second", 3: "third"}.get(number, f"{number}th")
