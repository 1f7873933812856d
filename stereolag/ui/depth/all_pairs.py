"""A table by pair: how well the settings in use do on every pair of a set."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field

import pandas as pd
import streamlit as st

from stereolag.assess.judging import Criterion, Judgement, TuningPair, estimate_reference, widest_range
from stereolag.core.jobs import Estimate, Progress
from stereolag.io.sources import harmless
from stereolag.pair import Pair
from stereolag.stereo.matcher import StereoMatcher
from stereolag.ui import prose
from stereolag.ui.depth.maps import DepthView, known_truth
from stereolag.ui.depth.pair_sets import Preparation, set_of
from stereolag.ui.depth.several import PairSet
from stereolag.ui.elements import PERCENT, SECONDS
from stereolag.ui.navigation import fragment
from stereolag.ui.results import computed_in_turn
from stereolag.ui.sentences import duration

KEY = "depth.all_pairs"
WANTED = f"{KEY}.wanted"
"""Session-state key of the set and settings that the table was last requested for."""
BYTES_OF_A_PAIR = 40
"""Memory per pixel while a pair is decoded, rectified and scaled down."""

NONE_YET = (
    "This is for several pairs at once: choose “ZIP or several pairs” under your own files, and upload a ZIP, or "
    "many files whose names tell left from right."
)


@dataclass(frozen=True)
class Figures:
    """Figures of one map: the share of pixels with a disparity, seconds, and % off by more than 2 px or missing.

    Bad-2 is relative to the ground truth, or estimated without one; NaN if there is nothing to judge by.
    """

    coverage: float
    elapsed_s: float
    bad_2: float = math.nan
    estimated_bad_2: float = math.nan


@dataclass(frozen=True)
class PairRow:
    """Figures of every method, by title, on one pair; or why they could not be computed."""

    name: str
    figures: Mapping[str, Figures] = field(default_factory=dict)
    problem: str = ""


@dataclass(frozen=True)
class Table:
    """The rows of all pairs."""

    rows: tuple[PairRow, ...]


@fragment
def show_all_pairs(view: DepthView) -> None:
    """Offer to compute every pair of the set with the settings in use, and show the table."""
    pairs = set_of(view.pair)
    if pairs is None:
        prose.info(NONE_YET, icon=":material/stacks:")
        return
    matchers = [result.settings for result in view.results.values()]
    preparation = Preparation.chosen()
    settings = " ".join([str(preparation), *(f"{type(one).__name__} {one.model_dump_json()}" for one in matchers)])
    once = [matcher.estimate(view.pair.left.shape, view.pair.left.dtype) for matcher in matchers]
    count = len(pairs.pairs)
    once.append(estimate_reference(widest_range(matchers), view.pair.left.shape, view.pair.left.dtype))
    seconds = count * sum(estimate.seconds for estimate in once)
    st.button(
        f"Compute all {count} pairs",
        key=f"{KEY}.start",
        type="primary",
        icon=":material/stacks:",
        help=f"{' and '.join(view.results)} with the settings in use: about {duration(seconds)}.",
        on_click=_want,
        args=(f"{pairs.digest} {settings}",),
    )
    if st.session_state.get(WANTED) != f"{pairs.digest} {settings}":
        return
    pixels = view.pair.left.shape[0] * view.pair.left.shape[1]
    memory = max(estimate.memory for estimate in once) + BYTES_OF_A_PAIR * pixels
    table = computed_in_turn(
        "all pairs",
        lambda progress: table_of(pairs, matchers, preparation, progress),
        Estimate(memory, seconds),
        inputs=pairs.digest,
        settings=settings,
        shared=False,
        label=f"{count} pairs …",
    )
    if table is not None:
        _show(table)


def table_of(pairs: PairSet, matchers: Sequence[StereoMatcher], preparation: Preparation, progress: Progress) -> Table:
    """Compute every pair of a set with all matchers, one pair in memory at a time; a pair that fails says why."""

    def rows() -> Iterator[PairRow]:
        count = len(pairs.pairs)
        for number, files in enumerate(pairs.pairs):
            name = f"{number + 1}: {harmless(files.name)}"
            try:
                pair = preparation.prepared(pairs.pair(number))
                yield PairRow(name, dict(_figures(pair, matchers, progress, number / count, 1 / count)))
            except ValueError as error:
                yield PairRow(name, problem=str(error))
            progress((number + 1) / count)

    return Table(tuple(rows()))


def _figures(
    pair: Pair, matchers: Sequence[StereoMatcher], progress: Progress, done: float, share: float
) -> Iterator[tuple[str, Figures]]:
    part = share / (len(matchers) + 1)
    searched = widest_range(matchers)
    judge = TuningPair.of(
        pair.left, pair.right, known_truth(pair), search_range=searched, progress=_part(progress, done, part)
    )
    for number, matcher in enumerate(matchers, 1):
        result = matcher.compute(pair.left, pair.right, progress=_part(progress, done + number * part, part))
        bad = math.nan if judge.unjudged(matcher) else Judgement.of(result.disparity, judge.reference).bad
        known = judge.criterion is Criterion.TRUE_BAD_2
        yield (
            matcher.title,
            Figures(result.coverage, result.elapsed_s, *((bad, math.nan) if known else (math.nan, bad))),
        )


def _part(progress: Progress, done: float, share: float) -> Progress:
    """Return a progress callback for a share of the work."""
    return lambda fraction: progress(done + share * fraction)


def _want(wanted: str) -> None:
    st.session_state[WANTED] = wanted


def _show(table: Table) -> None:
    """Show the table, with the mean of every column below."""
    good = [row for row in table.rows if row.figures]
    frame = pd.DataFrame.from_dict({row.name: _cells(row) for row in good}, orient="index")
    if len(good) > 1:
        frame.loc["Mean"] = frame.mean()
    if good:
        frame = frame.dropna(axis="columns", how="all")
        formats = {name: PERCENT if name.endswith("%") else SECONDS for name in frame.columns}
        columns = {
            name: st.column_config.NumberColumn(name.removesuffix(", %"), format=formats[name]) for name in formats
        }
        alt = f"Figures of every method on {len(good)} pairs."
        st.dataframe(frame, column_config={"_index": "Pair", **columns}, key=f"{KEY}.table", alt=alt)
        prose.caption(
            "Bad-2: the share of the pixels with ground truth that are off by more than 2 px or missing. Estimated "
            "bad-2: against the accurate preset, for pairs without ground truth. Every pair is computed with the "
            "settings in use, without the input doctor’s remedies."
        )
    for row in table.rows:
        if row.problem:
            prose.warning(row.problem)


def _cells(row: PairRow) -> dict[str, float]:
    """Return the cells of a row: bad-2 of every method first, then coverage, then time."""
    found = row.figures.items()
    return (
        {f"{name}: bad-2, %": figures.bad_2 for name, figures in found}
        | {f"{name}: estimated bad-2, %": figures.estimated_bad_2 for name, figures in found}
        | {f"{name}: coverage, %": 100 * figures.coverage for name, figures in found}
        | {f"{name}: took": figures.elapsed_s for name, figures in found}
    )
