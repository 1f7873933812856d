"""Two parameters of a method tried in all combinations."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass, replace

import streamlit as st

from stereolag.figures.sweeps import ContactSheet, sweep_maps, sweep_objectives
from stereolag.progress import Progress
from stereolag.settings import Number, changed
from stereolag.stereo.matcher import StereoMatcher
from stereolag.tuning.objective import affordable_pair
from stereolag.tuning.parameters import Parameter, parameters
from stereolag.tuning.sweep import sweep
from stereolag.ui.depth.address import adopt
from stereolag.ui.depth.view import DepthView
from stereolag.ui.navigation import fragment
from stereolag.ui.results import computed_in_turn
from stereolag.ui.sentences import percent

KEY = "depth.sweep"
WANTED_KEY = f"{KEY}.wanted"
BUDGET_S = 20.0
FEWER, MORE = 5, 7
"""Values tried at first, down and across."""

MOST_VALUES = 10


@dataclass(frozen=True, eq=False)
class SweepShown:
    """A sweep that was computed: of what, at which size of the pair, and what came out."""

    key: tuple[str, ...]
    scale: float
    sheet: ContactSheet


@dataclass(frozen=True)
class Axis:
    """A parameter and the values to try."""

    parameter: Parameter
    values: tuple[Number, ...]


@fragment
def show_sweep(view: DepthView) -> None:
    """Ask for two parameters, try all their combinations, and show them; a click takes a cell's settings over."""
    st.markdown(
        "Two settings in all their combinations. A click on a cell takes its settings over. "
        + objective_in_words(view),
        width=760,
    )
    matcher = ask_method(view, key=f"{KEY}.method")
    axes = _ask_axes(matcher)
    if axes is None:
        return
    key = _key(view, matcher, axes)
    combinations = len(axes[0].values) * len(axes[1].values)
    if st.button(f"Sweep {combinations} combinations", key=f"{KEY}.start", type="primary", icon=":material/grid_on:"):
        st.session_state[WANTED_KEY] = key
    if st.session_state.get(WANTED_KEY) == key:
        _compute(view, matcher, axes, key)
    shown: SweepShown | None = st.session_state.get(KEY)
    if shown is not None and shown.key == key:
        _show(view, matcher, axes, shown)


def objective_in_words(view: DepthView) -> str:
    """Return what settings are judged by on this pair."""
    if view.pair.truth is not None:
        return (
            "The score is the share of the pixels with ground truth that are **right within 2 px**; missing ones "
            "count as wrong."
        )
    return (
        "Without ground truth the score is how well the two images **agree** through the map: the correlation of the "
        "places matched, counted only where matching back from the right image returns to the same pixel."
    )


def ask_method(view: DepthView, *, key: str) -> StereoMatcher:
    """Ask for a method; return its settings."""
    names = list(view.results)
    name = st.segmented_control("Method", names, default=names[0], required=True, key=key)
    return view.results[name].settings


def _ask_axes(matcher: StereoMatcher) -> tuple[Axis, Axis] | None:
    """Ask which parameters to vary and over what; None, and why, where that cannot be done."""
    known = parameters(matcher)
    at_first = _likeliest(known)
    try:
        down, across = (
            _ask_axis(label, matcher, known, at_first[number], (FEWER, MORE)[number])
            for number, label in enumerate(("Down", "Across"))
        )
    except ValueError as error:
        st.error(str(error))
        return None
    if down.parameter == across.parameter:
        st.error("Choose two different settings: one goes down, the other across.")
        return None
    return down, across


def _likeliest(known: Mapping[str, Parameter]) -> tuple[int, int]:
    """Return which parameters to begin with: the size of the window or block, and the number of disparities."""
    names = [name.rpartition(".")[2] for name in known]
    sizes = [number for number, name in enumerate(names) if name in ("window_size", "block_size")]
    ranges = [number for number, name in enumerate(names) if name in ("num_disparities", "search_size")]
    return (ranges or [0])[0], (sizes or [1])[0]


def _ask_axis(label: str, matcher: StereoMatcher, known: Mapping[str, Parameter], at_first: int, count: int) -> Axis:
    """Ask for one parameter and its values."""
    method = type(matcher).__name__
    with st.container(horizontal=True, gap="medium", vertical_alignment="bottom"):
        name = st.selectbox(
            label,
            list(known),
            index=at_first,
            format_func=lambda one: known[one].title,
            key=f"{KEY}.{method}.{label}",
            width=280,
        )
        key = f"{KEY}.{method}.{label}.{name}"
        st.session_state.setdefault(key, ", ".join(f"{value:g}" for value in known[name].values(count)))
        text = st.text_input(f"{known[name].title}: values", key=key, width=420)
    return Axis(known[name], _numbers(text or "", type(known[name].value)))


def _numbers(text: str, kind: type[Number]) -> tuple[Number, ...]:
    """Return the numbers of a list, ascending and each once."""
    words = [word for word in re.split(r"[,;\s]+", text) if word]
    try:
        values = tuple(sorted({kind(word) for word in words}))
    except ValueError as error:
        what = "whole numbers" if kind is int else "numbers"
        raise ValueError(f"{text!r} is no list of {what}; write them like this: 5, 7, 10.") from error
    if not 1 <= len(values) <= MOST_VALUES:
        raise ValueError(f"{text!r} holds {len(values)} values; allowed are 1 to {MOST_VALUES}.")
    return values


def _key(view: DepthView, matcher: StereoMatcher, axes: tuple[Axis, Axis]) -> tuple[str, ...]:
    """Return what a sweep depends on: not on what the two parameters are set to, which every cell sets anew."""
    others = matcher.model_dump()
    for axis in axes:
        *path, last = axis.parameter.name.split(".")
        holder = others
        for name in path:
            holder = holder[name]
        del holder[last]
    tried = [(axis.parameter.name, axis.values) for axis in axes]
    return view.pair.digest, type(matcher).__name__, repr(others), repr(tried)


def _compute(view: DepthView, matcher: StereoMatcher, axes: tuple[Axis, Axis], key: tuple[str, ...]) -> None:
    """Try all combinations and keep what comes out; of what was there before, nothing is lost if that fails."""
    pair = view.pair
    rows, cols = ((axis.parameter.name, axis.values) for axis in axes)
    trials = len(rows[1]) * len(cols[1])
    once = matcher.estimate(pair.left.shape, pair.left.dtype)

    def work(progress: Progress) -> SweepShown:
        tuning_pair = affordable_pair(matcher, pair.left, pair.right, pair.truth, trials=trials, budget_s=BUDGET_S)
        grid = sweep(matcher, tuning_pair, rows=rows, cols=cols, progress=progress)
        return SweepShown(key, tuning_pair.scale, ContactSheet.of(grid, pair.left.shape))

    try:
        shown = computed_in_turn(
            "sweep",
            work,
            replace(once, seconds=min(BUDGET_S, trials * once.seconds)),
            inputs=pair.digest,
            settings=repr(key),
            shared=pair.shared,
            label="Trying all combinations …",
        )
    except ValueError as error:
        st.error(str(error))
        shown = None
        del st.session_state[WANTED_KEY]
    if shown is not None:
        st.session_state[KEY] = shown
        del st.session_state[WANTED_KEY]


def _show(view: DepthView, matcher: StereoMatcher, axes: tuple[Axis, Axis], shown: SweepShown) -> None:
    """Show a sweep, and take over the settings of a cell that was clicked."""
    titles = axes[0].parameter.title, axes[1].parameter.title
    cell = _cell_of(axes)
    figures = (
        ("maps", sweep_maps(shown.sheet, titles, view.low, view.high, cell)),
        ("objectives", sweep_objectives(shown.sheet, titles, cell)),
    )
    clicked = None
    # A chart keeps its selection; under a new name it begins without one, and the same cell can be clicked again.
    clicks = st.session_state.setdefault(f"{KEY}.clicks", 0)
    for column, (kind, figure) in zip(st.columns([3, 2], gap="medium"), figures, strict=True):
        event = column.plotly_chart(
            figure,
            key=f"{KEY}.{kind}.{clicks}",
            on_select="rerun",
            selection_mode="points",
            config={"displayModeBar": False},
        )
        if event.selection.point_indices:
            clicked = int(event.selection.point_indices[0])
    reduced = "" if shown.scale == 1 else f" Tried on the pair at {percent(shown.scale)} of its size, to keep it short."
    st.caption(
        f"Left: the maps. Right: their score, %. Solid frame: the best. Dotted frame: the settings in use.{reduced}"
    )
    if clicked is not None:
        st.session_state[f"{KEY}.clicks"] = clicks + 1
        try:
            chosen = settings_of_cell(matcher, axes, *divmod(clicked, len(axes[1].values)))
        except ValueError as error:
            st.error(str(error))
        else:
            adopt(chosen)


def settings_of_cell(matcher: StereoMatcher, axes: tuple[Axis, Axis], row: int, col: int) -> StereoMatcher:
    """Return the settings of one cell of a sweep; ValueError where they do not fit together."""
    down, across = axes
    return changed(matcher, {down.parameter.name: down.values[row], across.parameter.name: across.values[col]})


def _cell_of(axes: tuple[Axis, Axis]) -> tuple[int, int] | None:
    """Return the cell whose settings are in use, if it is one of the grid."""
    down, across = axes
    if down.parameter.value not in down.values or across.parameter.value not in across.values:
        return None
    return down.values.index(down.parameter.value), across.values.index(across.parameter.value)
