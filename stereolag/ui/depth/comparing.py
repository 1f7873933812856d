"""Every method compared: side by side, with the ground truth, or with an estimate where there is none."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np
import pandas as pd
import streamlit as st
from pandas.io.formats.style import Styler

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
from stereolag.figures.legends import Legend, hexadecimal, strip_legend, word_legend
from stereolag.figures.maps import (
    ALL_AGREE,
    ALL_DIFFER,
    BELOW_TO_ABOVE,
    LARGEST_DIFFERENCE,
    SOME_AGREE,
    agreement_picture,
    difference_picture,
    error_legend,
    error_over_coverage,
    error_png,
)
from stereolag.io.results import metrics_csv
from stereolag.pair import Pair
from stereolag.stereo.evaluation import CoverageCurve, Evaluation, consensus, error_against_coverage, evaluate
from stereolag.stereo.matcher import DisparityMap
from stereolag.ui import prose
from stereolag.ui.depth.maps import (
    TRUTH,
    DepthView,
    known_truth,
    left_picture,
    map_legends,
    map_picture,
    settings_key,
    truth_picture,
)
from stereolag.ui.depth.sentences import (
    ERROR_COLOURS_IN_WORDS,
    JUDGE_LEFT_OUT,
    UNJUDGED,
    coverage_curves_in_words,
    difference_in_words,
    errors_in_words,
    estimates_in_words,
)
from stereolag.ui.elements import PERCENT, PIXELS, show_png
from stereolag.ui.linked_pictures import linked_pictures
from stereolag.ui.navigation import fragment
from stereolag.ui.packing import Picture, Reading
from stereolag.ui.private_files import download_button
from stereolag.ui.results import computed, computed_before, computed_in_turn
from stereolag.ui.sentences import percent
from stereolag.ui.states import show_refused

COMPARISON = "depth.comparison"


@fragment
def show_comparison(view: DepthView) -> None:
    """Show all maps in one colour range, the difference of two of them, and where the methods agree."""
    maps = {name: result.disparity for name, result in view.results.items()}
    if view.pair.truth is not None:
        maps[TRUTH] = view.pair.truth
    pictures = [left_picture(view), *(map_picture(view, name) for name in view.results), *truth_picture(view)]
    legends = list(map_legends(view))
    if len(maps) > 1:
        pictures.append(_difference(maps, legends))
    if len(view.results) > 1:
        pictures.append(_agreement(view, legends))
    linked_pictures(pictures, key=COMPARISON, colours=view.colours, legends=legends)


def _difference(maps: dict[str, FloatMap], legends: list[Legend]) -> Picture:
    """Ask for two of the maps and return the first minus the second."""
    names = list(maps)
    with st.container(horizontal=True, vertical_alignment="center"):
        prose.markdown("Difference of", width="content")
        first = st.selectbox("Of", names, key=f"{COMPARISON}.first", label_visibility="collapsed", width=170)
        prose.markdown("minus", width="content")
        second = st.selectbox(
            "Minus", names, index=len(names) - 1, key=f"{COMPARISON}.second", label_visibility="collapsed", width=170
        )
    difference = maps[first] - maps[second]
    legends.append(strip_legend("difference, px", -LARGEST_DIFFERENCE, LARGEST_DIFFERENCE, BELOW_TO_ABOVE))
    return Picture(
        f"{first} − {second}",
        difference_picture(difference),
        (Reading(difference, unit="px", digits=2),),
        alternative=partial(difference_in_words, difference),
    )


def _agreement(view: DepthView, legends: list[Legend]) -> Picture:
    """Return the number of methods that agree to 1 px at each pixel, and say how far agreement can be trusted."""
    maps = [result.disparity for result in view.results.values()]
    count = len(maps)
    agreeing = consensus(maps)
    agreed = agreeing == count
    everyone = "Both methods" if count == 2 else f"All {count} methods"
    said = f"{everyone} agree to 1 px on **{percent(float(agreed.mean()))}** of the pixels."
    truth = view.pair.truth
    if truth is not None and (agreed & np.isfinite(truth)).any():
        wrong = evaluate(np.where(agreed, maps[0], np.nan), truth).bad_measured[1.0]
        alone = [evaluate(one, truth).bad_measured[1.0] for one in maps]
        said += (
            f" There, **{wrong:.1f} %** are wrong by more than 1 px; of all the pixels each method measured, "
            f"{min(alone):.1f} to {max(alone):.1f} %. Methods that work differently seldom make the same errors."
        )
    prose.markdown(said)
    some = [] if count == 2 else [(SOME_AGREE, "some agree")]
    entries = [(ALL_AGREE, "all agree to 1 px"), *some, (ALL_DIFFER, "none agree")]
    colours, meanings = zip(*entries, strict=True)
    legends.append(word_legend("agreement", [hexadecimal(colour) for colour in colours], meanings))
    words = ("no disparity", "one method alone, or all differ", *(f"{n} of {count} agree" for n in range(2, count + 1)))
    return Picture(
        "Agreement",
        agreement_picture(agreeing, count, view.pair.left),
        (Reading(agreeing, words=words),),
        alternative=lambda: f"{everyone} agree to 1 px on {percent(float(agreed.mean()))} of the pixels",
    )


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
class Accuracy:
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


def _evaluations_of(pair: Pair, result: DisparityMap, truth: FloatMap) -> dict[str, Evaluation]:
    """Return the figures of one map over all pixels and, if known, the visible ones."""
    found = {ALL: evaluate(result.disparity, truth)}
    if pair.visible is not None and (pair.visible & np.isfinite(truth)).any():
        found[VISIBLE] = evaluate(result.disparity, truth, mask=pair.visible)
    return found


def _judged(view: DepthView, result: DisparityMap, truth: FloatMap) -> Accuracy:
    """Return the figures of a map; from memory if they were computed before."""

    def judge(_: object) -> Accuracy:
        curve = error_against_coverage(result.disparity, truth, result.score, threshold=THRESHOLD_PX)
        return Accuracy(_evaluations_of(view.pair, result, truth), curve)

    return computed(
        "judgement",
        judge,
        inputs=view.pair.digest,
        settings=settings_key(result),
        shared=view.pair.shared,
        label="Judging all pixels and the surest …",
    )


def _show_tables(judgements: Mapping[str, Accuracy]) -> None:
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


ESTIMATES = "depth.estimates"
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
    st.plotly_chart(
        error_legend(), key=f"{ESTIMATES}.legend", config={"displayModeBar": False}, alt=ERROR_COLOURS_IN_WORDS
    )
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
        key=f"{ESTIMATES}.table",
        alt="Estimated bad-2 and coverage of each method, best first.",
    )
