"""Comparison of all methods: maps side by side, true or estimated errors, and a table of all pairs of a set."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import partial

import numpy as np
import pandas as pd
import streamlit as st

from stereolag.assess.judging import (
    MIN_MEASURED_SHARE,
    Criterion,
    Judgement,
    TuningPair,
    Unjudged,
    estimate_reference,
    judges_itself,
    measured_reference,
    widest_range,
)
from stereolag.core.arrays import FloatMap
from stereolag.core.jobs import Estimate, Progress, part
from stereolag.core.typography import duration, percent
from stereolag.figures.legends import hexadecimal, strip_legend, word_legend
from stereolag.figures.maps import (
    ALL_AGREE,
    ALL_DIFFER,
    BELOW_TO_ABOVE,
    MAX_DIFFERENCE_PX,
    SOME_AGREE,
    agreement_picture,
    difference_picture,
    error_legend,
    error_over_coverage,
    error_png,
)
from stereolag.io.results import metrics_csv
from stereolag.pair import Pair, Preparation, prepare
from stereolag.pair_sources import PairSet
from stereolag.stereo.evaluation import CoverageCurve, Evaluation, consensus, error_against_coverage, evaluate
from stereolag.stereo.matcher import DisparityMap, StereoMatcher
from stereolag.ui import prose
from stereolag.ui.depth.inputs import preparation_of_sets, set_of
from stereolag.ui.depth.maps import map_legends, map_picture, photograph, truth_picture
from stereolag.ui.depth.sentences import (
    UNJUDGED,
    agreement_in_words,
    coverage_curves_in_words,
    difference_in_words,
    errors_in_words,
)
from stereolag.ui.depth.view import LEFT, DepthView, known_truth
from stereolag.ui.downloads import download_button
from stereolag.ui.elements import (
    PERCENT_FORMAT,
    PIXELS_FORMAT,
    SECONDS_FORMAT,
    asked_for,
    in_columns,
    show_chart,
    show_picture,
)
from stereolag.ui.linked_pictures import Picture, Reading, linked_pictures
from stereolag.ui.navigation import fragment
from stereolag.ui.results import computed, computed_before, computed_in_turn, computed_or_refused, kept_for

COMPARISON, SCOREBOARD, ESTIMATES = "depth.comparison", "depth.scoreboard", "depth.estimates"
ALL_PAIRS = "depth.all_pairs"
BYTES_PER_PIXEL = 40
"""Memory per pixel while a pair is decoded, rectified and scaled down."""
REFERENCE = "reference"
"""The task, in the store of results, of computing the reference of estimates with the accurate preset."""

MAX_ERROR_PX = 2.0
"""Largest error that does not count as wrong in the curves of error against coverage, px."""
BEST_CELL_STYLE = "background-color: rgba(76, 175, 105, 0.28); font-weight: 600"

COUNTED, LEFT_OUT = "count as wrong", "are left out"
PIXELS_BY_SUFFIX = {"": "All pixels", " (non-occluded)": "Seen by both cameras"}
"""The pixels that a row of the metrics table covers, by the suffix of its name."""

MEANINGS = {
    "Density": "Share of the pixels with ground truth that have a disparity.",
    "EPE": "End-point error: mean absolute error of the pixels that have a disparity.",
    "D1-all": "Off by more than 3 px and more than 5 %, or missing: KITTI’s figure.",
}


@dataclass(frozen=True, eq=False)
class Accuracy:
    """The figures of one map against the ground truth, by row of the metrics table, and its error against coverage."""

    figures: Mapping[str, Evaluation]
    curve: CoverageCurve


@fragment
def show_comparison(view: DepthView) -> None:
    """Show all maps in one colour range, the difference of two of them, and where the methods agree."""
    maps = view.maps
    pictures = [
        photograph(LEFT, view.pair.left),
        *(map_picture(view, name) for name in view.results),
        *truth_picture(view),
    ]
    legends = list(map_legends(view))
    if len(maps) > 1:
        pictures.append(_difference(maps))
        legends.append(strip_legend("difference, px", -MAX_DIFFERENCE_PX, MAX_DIFFERENCE_PX, BELOW_TO_ABOVE))
    if len(view.results) > 1:
        pictures.append(_agreement(view))
        partly = {"some agree": SOME_AGREE} if len(view.results) > 2 else {}
        legend = {"all agree to 1 px": ALL_AGREE, **partly, "none agree": ALL_DIFFER}
        legends.append(word_legend("agreement", [hexadecimal(colour) for colour in legend.values()], [*legend]))
    linked_pictures(pictures, key=COMPARISON, colours=view.colours, legends=legends)


def _difference(maps: dict[str, FloatMap]) -> Picture:
    """Ask for two of the maps, and return the first minus the second."""
    names = list(maps)
    with st.container(horizontal=True, vertical_alignment="center"):
        prose.markdown("Difference of", width="content")
        first = st.selectbox("Of", names, key=f"{COMPARISON}.first", label_visibility="collapsed", width=170)
        prose.markdown("minus", width="content")
        second = st.selectbox(
            "Minus", names, index=len(names) - 1, key=f"{COMPARISON}.second", label_visibility="collapsed", width=170
        )
    difference = maps[first] - maps[second]
    return Picture(
        f"{first} − {second}",
        difference_picture(difference),
        (Reading(difference, unit="px", digits=2),),
        alternative=partial(difference_in_words, difference),
    )


def _agreement(view: DepthView) -> Picture:
    """Return a picture of the number of methods that agree at each pixel, and say how often agreement is right."""
    maps, truth = [result.disparity for result in view.results.values()], view.pair.truth
    count = len(maps)
    agreeing = consensus(maps)
    agreed = agreeing == count
    wrong = None
    if truth is not None and (agreed & np.isfinite(truth)).any():
        judged = np.where(agreed, maps[0], np.nan), *maps
        wrong = [evaluate(disparity, truth).bad_measured[1.0] for disparity in judged]
    prose.markdown(agreement_in_words(count, agreed, wrong, strong=True))
    words = ("no disparity", "one method alone, or all differ", *(f"{n} of {count} agree" for n in range(2, count + 1)))
    return Picture(
        "Agreement",
        agreement_picture(agreeing, count, view.pair.left),
        (Reading(agreeing, words=words),),
        alternative=partial(agreement_in_words, count, agreed),
    )


@fragment
def show_scoreboard(view: DepthView) -> None:
    """Show the accuracy of every method; without ground truth, an estimate of it."""
    truth = known_truth(view.pair)
    if truth is None:
        _show_estimates(view)
        return
    accuracies = {name: _accuracy(view, name, truth) for name in view.results}
    _show_figures(view, {row: figures for one in accuracies.values() for row, figures in one.figures.items()})
    prose.markdown("### Where they are wrong")
    _show_errors(view.results, truth, "the ground truth", SCOREBOARD)
    prose.caption("Grey: no disparity." if np.isfinite(truth).all() else "Grey: no disparity. Black: no ground truth.")
    prose.markdown("### Do they know where they are wrong?")
    curves = {name: accuracy.curve for name, accuracy in accuracies.items()}
    show_chart(error_over_coverage(curves, MAX_ERROR_PX), f"{SCOREBOARD}.curves", coverage_curves_in_words(curves))
    prose.caption(
        "Each line starts with the surest matches alone and then keeps more and more. If it climbs to the right, the "
        "method knows where it is wrong: a higher minimum score would keep the good matches. A method without a score "
        "is a single point."
    )


def evaluations(pair: Pair, results: Mapping[str, DisparityMap]) -> dict[str, Evaluation]:
    """Return the figures of every method against the ground truth, by row of the metrics table.

    They cover all pixels and, if known, the non-occluded ones. Without ground truth, the result is empty.
    """
    truth, visible = pair.truth, pair.visible
    if truth is None:
        return {}
    known = visible is not None and (visible & np.isfinite(truth)).any()
    masks = dict(zip(PIXELS_BY_SUFFIX, (None, visible) if known else (None,), strict=False))
    return {
        f"{name}{suffix}": evaluate(result.disparity, truth, mask=mask)
        for name, result in results.items()
        for suffix, mask in masks.items()
    }


def _accuracy(view: DepthView, name: str, truth: FloatMap) -> Accuracy:
    """Return the accuracy of a map; from memory if it was computed before."""
    result = view.results[name]

    return computed(
        "judgement",
        lambda _: Accuracy(
            evaluations(view.pair, {name: result}),
            error_against_coverage(result.disparity, truth, result.score, threshold=MAX_ERROR_PX),
        ),
        **view.kept(name),
        label="Comparing the map with the ground truth …",
    )


def _show_figures(view: DepthView, figures: Mapping[str, Evaluation]) -> None:
    """Show the figures of every method, and offer them as a file."""
    with st.container(horizontal=True, horizontal_alignment="distribute", vertical_alignment="bottom"):
        missing = st.segmented_control(
            "Pixels without a disparity",
            [COUNTED, LEFT_OUT],
            default=COUNTED,
            required=True,
            key=f"{SCOREBOARD}.missing",
            help="A method can look good by matching only where it is easy. If pixels without a disparity count as "
            "wrong, it gains nothing by that; if they are left out, the figures show how far to trust the others.",
        )
        download_button(
            "Figures as CSV",
            metrics_csv(figures),
            "metrics.csv",
            "text/csv",
            key=f"{SCOREBOARD}.csv",
            icon=":material/download:",
        )
    for suffix, pixels in PIXELS_BY_SUFFIX.items():
        judged = {name: figures[f"{name}{suffix}"] for name in view.results if f"{name}{suffix}" in figures}
        if judged:
            first = next(iter(judged.values()))
            prose.markdown(f"**{pixels}** · {first.truth_pixels:,} with ground truth")
            table = pd.DataFrame.from_dict(
                {name: _cells(evaluation, missing == LEFT_OUT) for name, evaluation in judged.items()}, orient="index"
            ).style
            if len(judged) > 1:
                table.highlight_max(subset=["Density"], props=BEST_CELL_STYLE).highlight_min(
                    subset=table.columns[1:], props=BEST_CELL_STYLE
                )
            meanings = MEANINGS | {f"Bad-{px:g}": f"Pixels off by more than {px:g} px." for px in first.bad}
            columns = {
                name: st.column_config.NumberColumn(
                    format=PIXELS_FORMAT if name == "EPE" else PERCENT_FORMAT, help=meaning
                )
                for name, meaning in meanings.items()
            }
            st.dataframe(
                table,
                column_config={"_index": "Method", **columns},
                key=f"{SCOREBOARD}.{pixels}",
                alt=f"{pixels}: density, mean error and shares of wrong pixels of each method.",
            )


def _cells(evaluation: Evaluation, measured_only: bool) -> dict[str, float]:
    bad = evaluation.bad_measured if measured_only else evaluation.bad
    figures = {
        "Density": 100 * evaluation.density,
        "EPE": evaluation.epe,
        **{f"Bad-{threshold:g}": share for threshold, share in bad.items()},
    }
    return figures if measured_only else figures | {"D1-all": evaluation.d1_all}


def _show_errors(results: Mapping[str, DisparityMap], reference: FloatMap, against: str, key: str) -> None:
    """Show where each map differs from the ground truth or a reference, with the legend of the colours."""
    for name, result in in_columns(results.items(), gap="small"):
        prose.markdown(f"**{name}**")
        show_picture(
            error_png(result.disparity, reference), f"{name}. {errors_in_words(result.disparity, reference, against)}"
        )
    show_chart(error_legend(), f"{key}.legend", "Colours of the errors: blue at 0 px, red from 4 px on.")


def _show_estimates(view: DepthView) -> None:
    """Show the estimated bad-2 of every method, and where its map differs from the reference."""
    pair, searched = view.pair, _searched(view)
    reference = computed_or_refused(
        REFERENCE,
        lambda progress: measured_reference(pair.left, pair.right, search_range=searched, progress=progress),
        estimate_reference(searched, pair.left.shape, pair.left.dtype),
        **kept_for(pair, repr(searched)),
        label="Computing the reference with the accurate preset …",
    )
    if reference is None:
        return
    measured = float(np.isfinite(reference).mean())
    if measured < MIN_MEASURED_SHARE:
        prose.info(UNJUDGED[Unjudged.TOO_LITTLE_MEASURED], icon=":material/balance:")
        return
    prose.markdown(
        "There is no ground truth, so these figures are **estimates**: every method is compared with the accurate "
        f"preset, on the {percent(measured)} of the pixels that it measured. They rank the methods; pixels hidden from "
        "one camera are not judged, so the true share of wrong pixels is higher.",
        width=760,
    )
    bad = _estimated_bad(view, reference)
    if len(bad) < len(view.results):
        prose.caption("Semi-global is not in the table: the accurate preset is Semi-global, and would judge itself.")
    if not bad:
        return
    figures = {"Estimated bad-2": bad, "Coverage": {name: 100 * view.results[name].coverage for name in bad}}
    st.dataframe(
        pd.DataFrame(figures).sort_values("Estimated bad-2"),
        column_config={
            "_index": st.column_config.TextColumn("Method"),
            "Estimated bad-2": st.column_config.NumberColumn(
                format=PERCENT_FORMAT,
                help="Of the pixels that the accurate preset measured, the share where the method differs from it by "
                "more than 2 px or has no disparity.",
            ),
            "Coverage": st.column_config.NumberColumn(
                format=PERCENT_FORMAT, help="Share of all pixels whose disparity was measured, not filled in."
            ),
        },
        width=520,
        key=f"{ESTIMATES}.table",
        alt="Estimated bad-2 and coverage of each method, best first.",
    )
    prose.markdown("### Where they differ from it")
    _show_errors({name: view.results[name] for name in bad}, reference, "the accurate preset", ESTIMATES)
    prose.caption("Grey: no disparity. Black: not judged.")


def estimates_in_memory(view: DepthView) -> dict[str, float]:
    """Return the estimated bad-2 of every method, %, if the reference is in memory; otherwise an empty dict."""
    reference = computed_before(REFERENCE, **kept_for(view.pair, repr(_searched(view))))
    if not isinstance(reference, np.ndarray) or float(np.isfinite(reference).mean()) < MIN_MEASURED_SHARE:
        return {}
    return _estimated_bad(view, reference)


def _estimated_bad(view: DepthView, reference: FloatMap) -> dict[str, float]:
    """Return the estimated bad-2 of every method except the reference's own, %."""
    return {
        name: Judgement.of(result.disparity, reference).bad
        for name, result in view.results.items()
        if not judges_itself(result.settings)
    }


def _searched(view: DepthView) -> tuple[int, int] | None:
    return widest_range(result.settings for result in view.results.values())


# All pairs of a set


@dataclass(frozen=True)
class Table:
    """{pair of a set: {column: figure}}, and a sentence about each pair that failed."""

    figures: dict[str, dict[str, float]]
    problems: Sequence[str]


@fragment
def show_all_pairs(view: DepthView) -> None:
    """Offer to compute every pair of the set with the settings in use, and show the table."""
    pairs, preparation = set_of(view.pair.id), preparation_of_sets()
    if pairs is None:
        prose.info(
            "This part needs several pairs: choose “Files at once, or a ZIP” under your own files, and add a ZIP, or "
            "many files whose names tell left from right.",
            icon=":material/stacks:",
        )
        return
    shape, dtype, count = view.pair.left.shape, view.pair.left.dtype, len(pairs)
    matchers = [result.settings for result in view.results.values()]
    settings = " ".join([str(preparation), *(f"{type(one).__name__} {one.model_dump_json()}" for one in matchers)])
    costs = [
        *(matcher.estimate(shape, dtype) for matcher in matchers),
        estimate_reference(widest_range(matchers), shape, dtype),
    ]
    seconds, request = count * sum(cost.seconds for cost in costs), f"{pairs.digest} {settings}"
    if not asked_for(
        request,
        f"Compute all {count} pairs",
        ALL_PAIRS,
        type="primary",
        icon=":material/stacks:",
        help=f"{' and '.join(view.results)} with the settings in use: about {duration(seconds)}.",
    ):
        return
    table = computed_in_turn(
        "all pairs",
        lambda progress: table_of(pairs, matchers, preparation, progress),
        Estimate(max(cost.memory for cost in costs) + BYTES_PER_PIXEL * shape[0] * shape[1], seconds),
        inputs=pairs.digest,
        settings=settings,
        shared=False,
        label=f"{count} pairs …",
    )
    if table is not None:
        _show_table(table)


def table_of(pairs: PairSet, matchers: Sequence[StereoMatcher], preparation: Preparation, progress: Progress) -> Table:
    """Return the figures of all matchers on every pair of a set, read one at a time; for a pair that fails, why."""
    figures: dict[str, dict[str, float]] = {}
    problems = []
    for number in range(len(pairs)):
        try:
            pair = prepare(pairs.pair(number), preparation)
            figures[f"{number + 1}: {pairs.name(number)}"] = _figures(
                pair, matchers, part(progress, number, len(pairs))
            )
        except ValueError as error:
            problems.append(str(error))
        progress((number + 1) / len(pairs))
    return Table(figures, problems)


def _figures(pair: Pair, matchers: Sequence[StereoMatcher], progress: Progress) -> dict[str, float]:
    """Return the cells of a row: bad-2 of every method, then coverage, then time.

    Bad-2 is relative to the ground truth, or estimated without one; NaN if nothing can judge the method.
    """
    count, searched = len(matchers) + 1, widest_range(matchers)
    judge = TuningPair.of(
        pair.left, pair.right, known_truth(pair), search_range=searched, progress=part(progress, 0, count)
    )
    known = judge.criterion is Criterion.TRUE_BAD_2
    true, estimated, coverage, took = {}, {}, {}, {}
    for number, matcher in enumerate(matchers, 1):
        result = matcher.compute(pair.left, pair.right, progress=part(progress, number, count))
        bad = math.nan if judge.unjudged(matcher) else Judgement.of(result.disparity, judge.reference).bad
        true[f"{matcher.title}: bad-2, %"] = bad if known else math.nan
        estimated[f"{matcher.title}: estimated bad-2, %"] = math.nan if known else bad
        coverage[f"{matcher.title}: coverage, %"] = 100 * result.coverage
        took[f"{matcher.title}: took"] = result.elapsed_s
    return true | estimated | coverage | took


def _show_table(table: Table) -> None:
    """Show the table, with the mean of every column below."""
    if table.figures:
        frame = pd.DataFrame.from_dict(table.figures, orient="index")
        if len(table.figures) > 1:
            frame.loc["Mean"] = frame.mean()
        frame = frame.dropna(axis="columns", how="all")
        columns = {
            name: st.column_config.NumberColumn(
                name.removesuffix(", %"), format=PERCENT_FORMAT if name.endswith("%") else SECONDS_FORMAT
            )
            for name in frame.columns
        }
        st.dataframe(
            frame,
            column_config={"_index": "Pair", **columns},
            key=f"{ALL_PAIRS}.table",
            alt=f"Figures of every method on {len(table.figures)} pairs.",
        )
        prose.caption(
            "Bad-2: the share of the pixels with ground truth that are off by more than 2 px or missing. Estimated "
            "bad-2: the same against the accurate preset, for pairs without ground truth. Every pair is computed with "
            "the settings in use, without the input doctor’s remedies."
        )
    for problem in table.problems:
        prose.warning(problem)
