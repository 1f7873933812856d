"""Every method compared with the ground truth: a table, error maps, and error against coverage."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
import pandas as pd
import streamlit as st
from pandas.io.formats.style import Styler

from stereolag.core.arrays import FloatMap
from stereolag.figures.differences import error_legend, error_over_coverage, error_png
from stereolag.io.tables import metrics_csv
from stereolag.stereo.evaluation import CoverageCurve, Evaluation, error_against_coverage, evaluate
from stereolag.stereo.matcher import DisparityMap
from stereolag.ui import prose
from stereolag.ui.depth.alternatives import ERROR_COLOURS_IN_WORDS, coverage_curves_in_words, errors_in_words
from stereolag.ui.depth.estimates import show_estimates
from stereolag.ui.depth.judging import known_truth
from stereolag.ui.depth.maps import settings_key
from stereolag.ui.depth.view import DepthView
from stereolag.ui.elements import PERCENT, PIXELS, show_png
from stereolag.ui.navigation import fragment
from stereolag.ui.pairs import StereoPair
from stereolag.ui.private_files import download_button
from stereolag.ui.results import computed

THRESHOLD_PX = 2.0
BEST = "background-color: rgba(76, 175, 105, 0.28); font-weight: 600"

ALL, VISIBLE = "All pixels", "Seen by both cameras"
COUNTED, LEFT_OUT = "count as wrong", "are left out"

MEANINGS = {
    "Density": "Share of the pixels with ground truth that have a disparity.",
    "EPE": "End-point error: mean absolute error of the pixels that have a disparity.",
    "D1-all": "Off by more than 3 px and more than 5 %, or missing: KITTI’s figure.",
}


@dataclass(frozen=True, eq=False)
class Judgement:
    """Figures of one map against the ground truth, for all pixels and, if known, the visible ones."""

    evaluations: Mapping[str, Evaluation]
    curve: CoverageCurve


@fragment
def show_scoreboard(view: DepthView) -> None:
    """Show the accuracy of every method; an estimate without ground truth."""
    truth = known_truth(view.pair)
    if truth is None:
        show_estimates(view)
        return
    judgements = {name: _judged(view, result, truth) for name, result in view.results.items()}
    _show_tables(judgements)
    prose.markdown("### Where they are wrong")
    for column, (name, result) in zip(st.columns(len(view.results)), view.results.items(), strict=True):
        with column:
            prose.markdown(f"**{name}**")
            alt = errors_in_words(result.disparity, truth, "the ground truth")
            show_png(error_png(result.disparity, truth), f"{name}. {alt}")
    st.plotly_chart(
        error_legend(),
        key="depth.scoreboard.legend",
        config={"displayModeBar": False},
        alt=ERROR_COLOURS_IN_WORDS,
    )
    prose.caption("Grey: no disparity." if np.isfinite(truth).all() else "Grey: no disparity. Black: no ground truth.")
    prose.markdown("### Do they know where they are wrong?")
    _show_curves({name: judgement.curve for name, judgement in judgements.items()})


def evaluations(view: DepthView) -> dict[str, Evaluation]:
    """Return the figures of every method against the ground truth, by row of the metrics table."""
    truth = view.pair.truth
    if truth is None:
        return {}
    return _by_row({name: _evaluations_of(view.pair, result, truth) for name, result in view.results.items()})


def _by_row(judged: Mapping[str, Mapping[str, Evaluation]]) -> dict[str, Evaluation]:
    return {
        name if pixels == ALL else f"{name} (non-occluded)": evaluation
        for name, evaluated in judged.items()
        for pixels, evaluation in evaluated.items()
    }


def _evaluations_of(pair: StereoPair, result: DisparityMap, truth: FloatMap) -> dict[str, Evaluation]:
    """Return the figures of one map over all pixels and, if known, the visible ones."""
    found = {ALL: evaluate(result.disparity, truth)}
    if pair.visible is not None and (pair.visible & np.isfinite(truth)).any():
        found[VISIBLE] = evaluate(result.disparity, truth, mask=pair.visible)
    return found


def _judged(view: DepthView, result: DisparityMap, truth: FloatMap) -> Judgement:
    """Return the figures of a map; from memory if they were computed before."""

    def judge(_: object) -> Judgement:
        curve = error_against_coverage(result.disparity, truth, result.score, threshold=THRESHOLD_PX)
        return Judgement(_evaluations_of(view.pair, result, truth), curve)

    return computed(
        "judgement",
        judge,
        inputs=view.pair.digest,
        settings=settings_key(result),
        shared=view.pair.shared,
        label="Judging all pixels and the surest …",
    )


def _show_tables(judgements: Mapping[str, Judgement]) -> None:
    """Show the figures of every method, and offer them as a file."""
    with st.container(horizontal=True, horizontal_alignment="distribute", vertical_alignment="bottom"):
        missing = st.segmented_control(
            "Pixels without a disparity",
            [COUNTED, LEFT_OUT],
            default=COUNTED,
            required=True,
            key="depth.scoreboard.missing",
            help="A method can look good by matching only where it is easy. Counted as wrong, a pixel without a "
            "disparity costs as much as a wrong one; left out, the figures show how far to trust the rest.",
        )
        download_button(
            "Figures as CSV",
            metrics_csv(_by_row({name: judgement.evaluations for name, judgement in judgements.items()})),
            "metrics.csv",
            "text/csv",
            key="depth.scoreboard.csv",
            icon=":material/download:",
        )
    for pixels in (ALL, VISIBLE):
        rows = {
            name: _row(judgement.evaluations[pixels], missing == LEFT_OUT)
            for name, judgement in judgements.items()
            if pixels in judgement.evaluations
        }
        if rows:
            some = next(iter(judgements.values())).evaluations[pixels]
            prose.markdown(f"**{pixels}** · {some.truth_pixels:,} with ground truth")
            st.dataframe(
                _marked(pd.DataFrame.from_dict(rows, orient="index")),
                column_config=_columns(some),
                key=f"depth.scoreboard.{pixels}",
                alt=f"{pixels}: density, mean error and shares of wrong pixels of each method.",
            )


def _row(evaluation: Evaluation, measured_only: bool) -> dict[str, float]:
    bad = evaluation.bad_measured if measured_only else evaluation.bad
    figures = {"Density": 100 * evaluation.density, "EPE": evaluation.epe}
    figures |= {f"Bad-{threshold:g}": share for threshold, share in bad.items()}
    return figures if measured_only else figures | {"D1-all": evaluation.d1_all}


def _marked(table: pd.DataFrame) -> Styler:
    """Return the table with the best value of each column marked, if there is more than one method."""

    def best(column: pd.Series[Any]) -> list[str]:
        winner = column.max() if column.name == "Density" else column.min()
        return [BEST if len(column) > 1 and value == winner else "" for value in column]

    return table.style.apply(best, axis=0)


def _columns(evaluation: Evaluation) -> dict[str, Any]:
    """Return the number formats of the columns and the help of their headings."""
    columns: dict[str, Any] = {
        "_index": st.column_config.TextColumn("Method"),
        "EPE": st.column_config.NumberColumn(format=PIXELS, help=MEANINGS["EPE"]),
    }
    meanings = {name: MEANINGS[name] for name in ("Density", "D1-all")}
    meanings |= {f"Bad-{threshold:g}": f"Pixels off by more than {threshold:g} px." for threshold in evaluation.bad}
    return columns | {
        name: st.column_config.NumberColumn(format=PERCENT, help=meaning) for name, meaning in meanings.items()
    }


def _show_curves(curves: Mapping[str, CoverageCurve]) -> None:
    """Show error against coverage."""
    st.plotly_chart(
        error_over_coverage(curves, THRESHOLD_PX),
        key="depth.scoreboard.curves",
        config={"displayModeBar": False},
        alt=coverage_curves_in_words(curves),
    )
    prose.caption(
        "Only the surest matches are kept, then more and more. If its line climbs to the right, a method knows where "
        "it is wrong: a higher minimum score would keep the good matches. A method without a score is a single point."
    )
