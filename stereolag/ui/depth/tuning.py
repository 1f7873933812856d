"""Better settings for a method, judged on a pair or its whole set: a sweep of two settings, or a search for the best.

Both are background jobs, which start at a click and show their progress.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator, Mapping
from concurrent.futures import CancelledError
from dataclasses import dataclass
from functools import partial, reduce
from operator import getitem
from typing import Any

import numpy as np
import pandas as pd
import streamlit as st

from stereolag.assess.judging import (
    Criterion,
    Parameter,
    Sweep,
    TuningPair,
    Unjudged,
    combinations,
    estimate_reference,
    estimate_sweep,
    judges_itself,
    parameters,
    sweep,
    widest_range,
)
from stereolag.assess.suggestion import Outcome, Suggestion, estimate_suggestion, suggest_for_all
from stereolag.core.jobs import Estimate
from stereolag.core.settings import Number, changed, title_of
from stereolag.figures.maps import sweep_bad, sweep_maps
from stereolag.pair import Pair, PairId, Preparation, prepare
from stereolag.stereo.matcher import StereoMatcher
from stereolag.ui import prose
from stereolag.ui.background_jobs import Job, show_busy, this_visit, watch
from stereolag.ui.depth.inputs import STEP, preparation_of_sets, set_of
from stereolag.ui.depth.maps import choose_map, show_side_by_side
from stereolag.ui.depth.sentences import (
    JUDGED_BY,
    UNJUDGED,
    search_so_far,
    suggestion_in_words,
    sweep_caption,
    sweep_in_words,
    value_in_words,
)
from stereolag.ui.depth.state import adopt
from stereolag.ui.depth.view import DepthView, known_truth
from stereolag.ui.elements import refusals_shown, show_refused
from stereolag.ui.navigation import fragment

SWEEP, SUGGEST = "depth.sweep", "depth.suggest"
MAX_VALUES = 10
"""Largest number of values of a setting in a sweep."""
BUDGETS_S = (10, 20, 60)
"""Times offered for a search, s."""

MAX_HELD_BYTES = 256 * 2**20
"""Largest memory of the pairs that are judged together, all of which are kept in memory."""
HELD_BYTES_PER_PIXEL = 24
"""Memory per pixel: both images in colour, their reference, and one map."""


# The pairs that settings are judged on, and jobs on them


@dataclass(frozen=True)
class JudgedPairs:
    """The pairs on which settings are judged together: first the one shown, then others of its set.

    Attributes
    ----------
    current
        The pair shown.
    others
        Functions that read the others: as many as may be in memory at once, spread evenly over the set.
    preparation
        The preparation of the others.
    sentence
        A sentence that says how many are judged; "" for a single pair.
    """

    current: Pair
    others: tuple[Callable[[], Pair], ...]
    preparation: Preparation
    sentence: str = ""

    @classmethod
    def of(cls, pair: Pair) -> JudgedPairs:
        """Return the pairs to judge on while this one is shown."""
        pairs = set_of(pair.id)
        if pairs is None:
            return cls(pair, (), preparation_of_sets())
        count, (rows, cols) = len(pairs), pair.left.shape[:2]
        held = min(count, max(1, MAX_HELD_BYTES // (HELD_BYTES_PER_PIXEL * rows * cols)))
        spread = dict.fromkeys(round((step + 0.5) * count / held - 0.5) for step in range(held))
        shown = st.session_state.get(STEP, 0)
        others = [partial(pairs.pair, index) for index in spread if index != shown][: held - 1]
        judged = 1 + len(others)
        which = f"all {count} pairs" if judged == count else f"{judged} of the {count} pairs, spread evenly,"
        return cls(
            pair,
            tuple(others),
            preparation_of_sets(),
            sentence=f"Settings are judged on **{which} together**, by the mean. ",
        )

    def __iter__(self) -> Iterator[Pair]:
        """Yield the pairs, each read when its turn comes; skip those whose files do not form a pair."""
        yield self.current
        for read in self.others:
            try:
                yield prepare(read(), self.preparation)
            except ValueError:  # the table of all pairs says why
                continue

    def tuning(self, search_range: tuple[int, int] | None, job: Job[Any]) -> Iterator[TuningPair]:
        """Yield the pairs with their truth or a reference, for a job that judges settings."""
        for pair in self:
            yield TuningPair.of(
                pair.left,
                pair.right,
                known_truth(pair),
                search_range=search_range,
                progress=lambda _: job.report_or_end(job.progress),
            )


@dataclass(frozen=True, eq=False)
class PairJob:
    """A job on a pair or on the set it belongs to.

    Attributes
    ----------
    digest
        Identifies the pair, or the set and the preparation of its pairs.
    request
        The request that started the job.
    job
        The job itself.
    shown
        The pair shown when the job began.
    place
        Position of that pair in the set: "pair 2 of 5"; "" for a single pair.
    """

    digest: str
    request: Any
    job: Job[Any]
    shown: PairId
    place: str = ""


def begin_job(pair_id: PairId, key: str, request: object, work: Callable[[Job[Any]], Any], estimate: Estimate) -> None:
    """Start the job of a part of the page in its own thread."""
    job, pairs = Job(work, estimate), set_of(pair_id)
    place = f"pair {st.session_state.get(STEP, 0) + 1} of {len(pairs)}" if pairs else ""
    this_visit().jobs[key] = pair_id.judged, job
    st.session_state[key] = PairJob(_digest(pair_id), request, job, pair_id, place)


def job_on(pair_id: PairId, key: str) -> PairJob | None:
    """Return the job of a part of the page on this pair; cancel and forget a job on other images."""
    current: PairJob | None = st.session_state.get(key)
    if current is None:
        return None
    changed_since = current.shown.files == pair_id.files and current.shown != pair_id
    if current.digest == _digest(pair_id) and not changed_since:
        return current
    _forget_job(key)
    return None


def _forget_job(key: str) -> None:
    """Cancel and forget the job of a part of the page."""
    st.session_state.pop(key).job.cancel()


def _digest(pair_id: PairId) -> str:
    """Return the key of the images judged together; for a set, it includes the preparation of the other pairs."""
    return f"{pair_id.judged} {preparation_of_sets()}" if pair_id.collection else pair_id.judged


def _judged_by(pair: Pair, matcher: StereoMatcher) -> Criterion | None:
    """Return the criterion by which settings of a method are judged on a pair; None if nothing can judge them."""
    if known_truth(pair) is not None:
        return Criterion.TRUE_BAD_2
    return None if judges_itself(matcher) else Criterion.ESTIMATED_BAD_2


def _offer_job(key: str, label: str, icon: str, current: PairJob | None, begin: Callable[[], None]) -> None:
    """Offer to begin a job unless one is running."""
    st.button(
        label,
        key=f"{key}.start",
        on_click=begin,
        type="primary",
        icon=icon,
        disabled=current is not None and current.job.running,
    )


def _follow_job(
    key: str,
    current: PairJob,
    request: object,
    text: Callable[[Any], str],
    ending: str,
    show: Callable[[Any], None],
    show_so_far: Callable[[Any], None] = lambda so_far: None,
) -> None:
    """Show the progress of a job and then its result, or why it failed if the controls still make the same request.

    Parameters
    ----------
    key, current
        The part of the page, and its job.
    request
        The request that the controls make now.
    text
        Returns the text beside the progress; takes the best result so far, or None.
    ending
        A sentence that says what is kept if the job is stopped early.
    show, show_so_far
        Show the result, and the best one so far, below the progress.
    """

    def refresh() -> None:
        if current.job.running:
            show_busy(current.job, text(current.job.so_far), key=f"{key}.cancel", ending=ending)
            show_so_far(current.job.so_far)
            return
        try:
            result = current.job.result()
        except CancelledError:  # cancelled before its turn came
            pass
        except ValueError as error:
            if request == current.request:
                show_refused(error)
        else:
            show(result)

    watch(current.job, refresh)


# Two parameters in all combinations


@dataclass(frozen=True)
class Axis:
    """A parameter and the values to try."""

    parameter: Parameter
    values: tuple[Number, ...]


@fragment
def show_sweep(view: DepthView) -> None:
    """Ask for two parameters, try all their combinations, and show them; a click on a cell adopts its settings."""
    matcher = view.results[choose_map(view, "Method", f"{SWEEP}.method")].settings
    criterion, pairs = _judged_by(view.pair, matcher), JudgedPairs.of(view.pair)
    prose.markdown(
        "Two settings in all their combinations. Click a cell, or choose it from the list, to use its settings. "
        + (UNJUDGED[Unjudged.JUDGES_ITSELF] if criterion is None else pairs.sentence + JUDGED_BY[criterion]),
        width=760,
    )
    axes = _ask_axes(matcher)
    if axes is None:
        return
    request, current = _sweep_request(matcher, axes), job_on(view.pair.id, SWEEP)
    if current is not None and current.request != request:
        if current.job.running:
            _forget_job(SWEEP)
        current = None
    _offer_job(
        SWEEP,
        f"Sweep {len(axes[0].values) * len(axes[1].values)} combinations",
        ":material/grid_on:",
        current,
        partial(_begin_sweep, pairs, matcher, axes),
    )
    if current is not None:
        elsewhere = ", not the pair in use" if current.shown.files != view.pair.id.files else ""
        _follow_job(
            SWEEP,
            current,
            request,
            text=lambda _: "Trying all combinations …",
            ending="Stops the sweep; the maps made so far are kept.",
            show=partial(_show_sweep_result, view, matcher, axes, f"{current.place}{elsewhere}"),
        )


def _ask_axes(matcher: StereoMatcher) -> tuple[Axis, Axis] | None:
    """Ask for the parameters to vary and their values; show why and return None if they cannot be used."""
    known = parameters(matcher)
    with refusals_shown():
        down = _ask_axis("Down", matcher, known, ("num_disparities", "search_size"), initial_count=5)
        across = _ask_axis("Across", matcher, known, ("window_size", "block_size"), initial_count=7)
        if down.parameter == across.parameter:
            raise ValueError("Choose two different settings: one goes down, the other across.")
        return down, across
    return None


def _ask_axis(
    label: str, matcher: StereoMatcher, known: Mapping[str, Parameter], likely: tuple[str, str], *, initial_count: int
) -> Axis:
    """Ask for a parameter, initially one of the `likely` ones, and its values."""
    names = list(known)
    likely_indices = [index for index, name in enumerate(names) if name.rpartition(".")[2] in likely]
    key = f"{SWEEP}.{type(matcher).__name__}.{label}"
    with st.container(horizontal=True, gap="medium", vertical_alignment="bottom"):
        name = st.selectbox(
            label,
            names,
            index=(likely_indices or [int(label == "Across")])[0],
            format_func=lambda name: known[name].title,
            key=key,
            width=280,
        )
        st.session_state.setdefault(
            f"{key}.{name}", ", ".join(f"{value:g}" for value in known[name].values(initial_count))
        )
        text = st.text_input(f"{known[name].title}: values", key=f"{key}.{name}", width=420)
    return Axis(known[name], _numbers(text or "", type(known[name].value)))


def _numbers(text: str, kind: type[Number]) -> tuple[Number, ...]:
    """Return the numbers in a text, ascending and without duplicates."""
    try:
        values = tuple(sorted({kind(word) for word in re.split(r"[,;\s]+", text) if word}))
    except ValueError as error:
        numbers = "whole numbers" if kind is int else "numbers"
        raise ValueError(f"{text!r} is not a list of {numbers}; write them like this: 5, 7, 10.") from error
    if not 1 <= len(values) <= MAX_VALUES:
        raise ValueError(f"{text!r} has {len(values)} values; allowed are 1 to {MAX_VALUES}.")
    return values


def _sweep_request(matcher: StereoMatcher, axes: tuple[Axis, Axis]) -> tuple[str, ...]:
    """Return what identifies a sweep: all settings but the two that every cell replaces, and the values tried."""
    others = matcher.model_dump()
    for axis in axes:
        *path, last = axis.parameter.name.split(".")
        del reduce(getitem, path, others)[last]
    return type(matcher).__name__, repr(others), repr([(axis.parameter.name, axis.values) for axis in axes])


def _begin_sweep(pairs: JudgedPairs, matcher: StereoMatcher, axes: tuple[Axis, Axis]) -> None:
    """Start a sweep in its own thread."""
    rows, cols = ((axis.parameter.name, axis.values) for axis in axes)
    searched, pair = widest_range(filter(None, combinations(matcher, rows, cols))), pairs.current
    unjudgeable = TuningPair.unjudgeable(pair.left, pair.right)
    only_maps = _judged_by(pair, matcher) is None

    def work(job: Job[Sweep]) -> Sweep:
        judged = [unjudgeable] if only_maps else list(pairs.tuning(searched, job))
        return sweep(matcher, judged, rows=rows, cols=cols, progress=job.report, cancelled=lambda: job.cancelled)

    estimate = estimate_sweep(matcher, [unjudgeable] * (1 + len(pairs.others)), rows=rows, cols=cols)
    if known_truth(pair) is None:
        reference = estimate_reference(searched, pair.left.shape, pair.left.dtype)
        estimate = Estimate(max(estimate.memory, reference.memory), estimate.seconds + reference.seconds)
    begin_job(pair.id, SWEEP, _sweep_request(matcher, axes), work, estimate)


def _show_sweep_result(
    view: DepthView, matcher: StereoMatcher, axes: tuple[Axis, Axis], pair: str, result: Sweep
) -> None:
    """Show the result of a sweep, whose maps are of `pair`, and adopt the settings of a cell that was clicked."""
    titles = axes[0].parameter.title, axes[1].parameter.title
    in_use = [axis.values.index(axis.parameter.value) for axis in axes if axis.parameter.value in axis.values]
    cell = (in_use[0], in_use[1]) if len(in_use) == 2 else None
    figures = [("maps", "Small maps", sweep_maps(result, titles, view.colours, cell))]
    if result.best:
        figures.append(("bad", "Error of each map", sweep_bad(result, titles, cell)))
    # A chart keeps its selection; a new key starts without one, so that the same cell can be clicked again.
    clicks = st.session_state.setdefault(f"{SWEEP}.clicks", 0)
    clicked: list[int] = []
    for column, (kind, title, figure) in zip(st.columns([3, 2], gap="medium"), figures, strict=False):
        event = column.plotly_chart(
            figure,
            key=f"{SWEEP}.{kind}.{clicks}",
            on_select="rerun",
            selection_mode="points",
            config={"displayModeBar": False},
            alt=f"{title}: {sweep_in_words(result, titles)}",
        )
        clicked += event.selection.point_indices[:1]
    prose.caption(sweep_caption(result.criterion, judged=result.best is not None, finished=result.finished, pair=pair))
    listed = _ask_cell(result, titles, key=f"{SWEEP}.cell.{clicks}")
    clicked += [] if listed is None else [listed]
    if clicked:
        st.session_state[f"{SWEEP}.clicks"] = clicks + 1
        row, col = divmod(int(clicked[0]), len(axes[1].values))
        values = zip(axes, (row, col), strict=True)
        with refusals_shown():
            adopt(changed(matcher, {axis.parameter.name: axis.values[index] for axis, index in values}))


def _ask_cell(result: Sweep, titles: tuple[str, str], *, key: str) -> int | None:
    """Return the index of a cell chosen from a list, best first: a chart cannot be clicked with a keyboard."""
    bad = result.bad.ravel()
    cells = [int(cell) for cell in np.argsort(bad, kind="stable") if result.shown.ravel()[cell]]

    def in_words(cell: int) -> str:
        row, col = divmod(cell, len(result.cols))
        figure = f": {bad[cell]:.1f} %" if np.isfinite(bad[cell]) else ""
        return f"{titles[0]} {result.rows[row]:g}, {titles[1]} {result.cols[col]:g}{figure}"

    return st.selectbox(
        "Use the settings of", cells, index=None, format_func=in_words, key=key, placeholder="Choose a cell", width=420
    )


# A search for better settings


@fragment
def show_suggest(view: DepthView) -> None:
    """Ask for a method and a time, search for better settings, and offer the best found."""
    pair, pairs = view.pair, JudgedPairs.of(view.pair)
    judged_by = JUDGED_BY[Criterion.ESTIMATED_BAD_2 if known_truth(pair) is None else Criterion.TRUE_BAD_2]
    prose.markdown(
        "The search range and the tolerances of the checks are kept; settings that go well together are tried in "
        f"combination, and the best are compared with yours on the whole images. {pairs.sentence}{judged_by}",
        width=760,
    )
    matcher = view.results[choose_map(view, "Method", f"{SUGGEST}.method")].settings
    budget_s = st.segmented_control(
        "Time",
        BUDGETS_S,
        default=BUDGETS_S[0],
        format_func=lambda seconds: f"{seconds} s",
        required=True,
        key=f"{SUGGEST}.budget",
    )
    current = job_on(pair.id, SUGGEST)
    if _judged_by(pair, matcher) is None:
        prose.info(UNJUDGED[Unjudged.JUDGES_ITSELF], icon=":material/balance:")
    else:
        _offer_job(
            SUGGEST,
            "Suggest settings",
            ":material/auto_fix_high:",
            current,
            partial(_begin_search, pairs, matcher, budget_s),
        )
    if current is not None:
        start = current.request

        def show(suggestion: Suggestion) -> None:
            if matcher in (start, suggestion.matcher):
                show_so_far(suggestion)
                _show_suggestion(view, suggestion)

        def show_so_far(suggestion: Suggestion | None) -> None:
            if suggestion is not None and suggestion.matcher != start:
                show_side_by_side(view, {"Your settings": start, "The best found so far": suggestion.matcher})

        _follow_job(
            SUGGEST,
            current,
            matcher,
            text=lambda best: search_so_far(best) if best else f"Judging the {start.title} settings in use …",
            ending="Stops the search; the best settings found so far are kept.",
            show=show,
            show_so_far=show_so_far,
        )


def _begin_search(pairs: JudgedPairs, matcher: StereoMatcher, budget_s: float) -> None:
    """Start a search in its own thread."""

    def work(job: Job[Suggestion]) -> Suggestion:
        return suggest_for_all(
            matcher,
            pairs.tuning(matcher.search_range(), job),
            budget_s=budget_s,
            progress=job.report,
            found=job.found,
            cancelled=lambda: job.cancelled,
        )

    pair = pairs.current
    estimate = estimate_suggestion(
        matcher, pair.left.shape, pair.left.dtype, blind=known_truth(pair) is None, budget_s=budget_s
    )
    begin_job(pair.id, SUGGEST, matcher, work, estimate)


def _show_suggestion(view: DepthView, suggestion: Suggestion) -> None:
    """Show the result of a search, and offer to use the settings if they are better."""
    if isinstance(suggestion.outcome, Unjudged):
        prose.info(suggestion_in_words(suggestion), icon=":material/balance:")
        return
    better = suggestion.outcome is Outcome.BETTER
    prose.success(
        suggestion_in_words(suggestion), icon=":material/auto_fix_high:" if better else ":material/check_circle:"
    )
    if not better:
        return
    st.dataframe(
        pd.DataFrame(
            [
                (title_of(type(suggestion.start), name), value_in_words(old), value_in_words(new))
                for name, (old, new) in suggestion.changes.items()
            ],
            columns=["Setting", "Before", "Suggested"],
        ),
        hide_index=True,
        width=640,
        key=f"{SUGGEST}.changes",
        alt="The settings that change: before, and as suggested.",
    )
    in_use = any(result.settings == suggestion.matcher for result in view.results.values())
    if st.button(
        "In use" if in_use else "Use these settings", key=f"{SUGGEST}.adopt", disabled=in_use, icon=":material/check:"
    ):
        adopt(suggestion.matcher)
