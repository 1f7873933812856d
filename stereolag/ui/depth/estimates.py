"""The scoreboard without ground truth: every method compared with the measurements of the accurate preset."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import pandas as pd
import streamlit as st

from stereolag.assess.judging import (
    LEAST_MEASURED,
    Judgement,
    Unjudged,
    estimate_reference,
    judges_itself,
    measured_reference,
    widest_range,
)
from stereolag.core.arrays import FloatMap
from stereolag.figures.differences import error_legend, error_png
from stereolag.stereo.matcher import DisparityMap
from stereolag.ui import prose
from stereolag.ui.depth.alternatives import ERROR_COLOURS_IN_WORDS, errors_in_words
from stereolag.ui.depth.judging import JUDGE_LEFT_OUT, UNJUDGED, estimates_in_words
from stereolag.ui.depth.view import DepthView
from stereolag.ui.elements import PERCENT, show_png
from stereolag.ui.results import computed_before, computed_in_turn
from stereolag.ui.states import show_refused

KEY = "depth.estimates"
TASK = "reference"


def show_estimates(view: DepthView) -> None:
    """Show the estimated bad-2 of every method, and where its map differs from the reference."""
    try:
        reference = _reference(view)
    except ValueError as error:
        show_refused(error)
        return
    if reference is None:
        return
    measured = float(np.isfinite(reference).mean())
    if measured < LEAST_MEASURED:
        prose.info(UNJUDGED[Unjudged.TOO_LITTLE_MEASURED], icon=":material/balance:")
        return
    prose.markdown(estimates_in_words(measured), width=760)
    judged = {name: result for name, result in view.results.items() if not judges_itself(result.settings)}
    if len(judged) < len(view.results):
        prose.caption(JUDGE_LEFT_OUT)
    if not judged:
        return
    _show_table(judged, reference)
    prose.markdown("### Where they differ from it")
    for column, (name, result) in zip(st.columns(len(judged)), judged.items(), strict=True):
        with column:
            prose.markdown(f"**{name}**")
            alt = errors_in_words(result.disparity, reference, "the accurate preset")
            show_png(error_png(result.disparity, reference), f"{name}. {alt}")
    st.plotly_chart(error_legend(), key=f"{KEY}.legend", config={"displayModeBar": False}, alt=ERROR_COLOURS_IN_WORDS)
    prose.caption("Grey: no disparity. Black: not judged.")


def estimates_so_far(view: DepthView) -> dict[str, float]:
    """Return the estimated bad-2 of every method, %, if the reference is already in memory; else nothing."""
    pair = view.pair
    searched = widest_range(result.settings for result in view.results.values())
    reference: FloatMap | None = computed_before(TASK, inputs=pair.digest, settings=repr(searched), shared=pair.shared)
    if reference is None or float(np.isfinite(reference).mean()) < LEAST_MEASURED:
        return {}
    return {
        name: Judgement.of(result.disparity, reference).bad
        for name, result in view.results.items()
        if not judges_itself(result.settings)
    }


def _reference(view: DepthView) -> FloatMap | None:
    """Return the measurements of the accurate preset over the ranges of all methods; None if not computed yet."""
    pair = view.pair
    searched = widest_range(result.settings for result in view.results.values())
    return computed_in_turn(
        TASK,
        lambda progress: measured_reference(pair.left, pair.right, search_range=searched, progress=progress),
        estimate_reference(searched, pair.left.shape, pair.left.dtype),
        inputs=pair.digest,
        settings=repr(searched),
        shared=pair.shared,
        label="The accurate preset, which judges …",
    )


def _show_table(judged: Mapping[str, DisparityMap], reference: FloatMap) -> None:
    """Show the figures, the best first."""
    rows = {
        name: {"Estimated bad-2": Judgement.of(result.disparity, reference).bad, "Coverage": 100 * result.coverage}
        for name, result in judged.items()
    }
    table = pd.DataFrame.from_dict(rows, orient="index").sort_values("Estimated bad-2")
    st.dataframe(
        table,
        column_config={
            "_index": st.column_config.TextColumn("Method"),
            "Estimated bad-2": st.column_config.NumberColumn(
                format=PERCENT,
                help="Of the pixels that the accurate preset measured, the share where the method is off by more than "
                "2 px from it, or has no disparity.",
            ),
            "Coverage": st.column_config.NumberColumn(
                format=PERCENT, help="Share of all pixels that have a disparity, measured or filled in."
            ),
        },
        width=520,
        key=f"{KEY}.table",
        alt="Estimated bad-2 and coverage of each method, best first.",
    )
