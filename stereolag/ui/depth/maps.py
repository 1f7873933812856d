"""The maps of the depth page: computed, judged, coloured, and shown beside each other with their numbers."""

from __future__ import annotations

import hashlib
from collections.abc import Sequence

import streamlit as st
from streamlit.delta_generator import DeltaGenerator

from stereolag.arrays import FloatMap, ReasonMap
from stereolag.figures.disparity import disparity_legend, disparity_png
from stereolag.figures.linked_pictures import Legend, Picture, Reading, hexadecimal, strip_legend, word_legend
from stereolag.figures.pictures import NO_ANSWER, as_rgb, coloured, fitted, jpeg
from stereolag.stereo.evaluation import Evaluation, evaluate
from stereolag.stereo.matcher import DisparityMap, StereoMatcher
from stereolag.stereo.methods import METHODS
from stereolag.stereo.reasons import Reason
from stereolag.ui import keys
from stereolag.ui.depth.address import methods_at_first
from stereolag.ui.depth.calibrating import depth_scale, disparity_error
from stereolag.ui.depth.view import DepthView
from stereolag.ui.elements import Number, show_jpeg, show_numbers, show_png
from stereolag.ui.pairs import StereoPair
from stereolag.ui.results import computed_in_turn, remembered
from stereolag.ui.sentences import REASON_WORDS, duration, percent

LEFT, TRUTH = "Left image", "Ground truth"


def map_task(matcher: StereoMatcher) -> str:
    """Return the name of the task of computing a map, for the store of results."""
    return f"map {matcher.short_name}"


def choose_methods(columns: Sequence[DeltaGenerator]) -> list[type[StereoMatcher]]:
    """Ask which two methods are shown side by side, one above each column; never one and the same twice."""
    by_name = {method.short_name: method for method in METHODS}
    chosen: list[str] = []
    for column, (key, first) in zip(columns, methods_at_first().items(), strict=True):
        offered = [name for name in by_name if name not in chosen]
        if st.session_state.get(key) not in offered:
            st.session_state[key] = first if first in offered else offered[0]
        chosen.append(
            column.selectbox(
                "Method",
                offered,
                format_func=lambda name: by_name[name].title,
                key=key,
                persist_state="session",
                label_visibility="collapsed",
            )
        )
    return [by_name[name] for name in chosen]


def measured(pair: StereoPair, matcher: StereoMatcher | None) -> dict[str, DisparityMap]:
    """Return the map of one method under its title; nothing, and say why, where it cannot be had, or not yet."""
    if matcher is None:
        return {}
    try:
        result = computed_in_turn(
            map_task(matcher),
            lambda progress: matcher.compute(pair.left, pair.right, progress=progress),
            matcher.estimate(pair.left.shape, pair.left.dtype),
            inputs=pair.digest,
            settings=matcher.model_dump_json(),
            shared=pair.shared,
            label=f"{matcher.title} …",
        )
    except ValueError as error:
        st.error(str(error))
        return {}
    return {} if result is None else {matcher.title: result}


def show_map(view: DepthView, name: str) -> None:
    """Show the map of one method and what can be said of it in numbers."""
    if name not in view.results:
        return
    result = view.results[name]
    show_png(_coloured(view, result.disparity, settings_key(result)))
    numbers = [
        Number("Took", duration(result.elapsed_s), "The computation alone, when it was first done."),
        Number("Coverage", percent(result.coverage), "Share of the pixels that have a disparity."),
    ]
    if view.pair.truth is not None:
        figures = judged(view.pair, result, view.pair.truth)
        numbers += [
            Number("Bad-2", f"{figures.bad[2.0]:.1f} %", "Pixels that are off by more than 2 px, or have none."),
            Number("EPE", f"{figures.epe:.2f} px", "Mean error of the pixels that have a disparity."),
        ]
    show_numbers(numbers)


def show_images(view: DepthView) -> None:
    """Show one of the images that went in, or the ground truth in the colours of the maps, above the legend."""
    pair = view.pair
    views = ["Left", "Right"] + ["Ground truth"] * (pair.truth is not None)
    chosen = st.session_state.get(keys.VIEW, "Left")
    if chosen == "Ground truth" and pair.truth is not None:
        show_png(_coloured(view, pair.truth, chosen))
    else:
        show_jpeg(
            remembered(
                "photograph",
                lambda: jpeg(fitted(pair.right if chosen == "Right" else pair.left)),
                inputs=pair.digest,
                settings=chosen,
                shared=pair.shared,
            )
        )
    st.segmented_control("View", views, default="Left", required=True, key=keys.VIEW, label_visibility="collapsed")
    st.html(disparity_legend(view.low, view.high, view.palette))


def _coloured(view: DepthView, disparity: FloatMap, name: str) -> bytes:
    """Return a map of the view in its colours, from memory where it was coloured so before."""
    colours = hashlib.sha256(view.palette.tobytes()).hexdigest()
    return remembered(
        "coloured map",
        lambda: disparity_png(disparity, view.low, view.high, view.palette),
        inputs=view.pair.digest,
        settings=f"{name} {view.low} {view.high} {colours}",
        shared=view.pair.shared,
    )


def judged(pair: StereoPair, result: DisparityMap, truth: FloatMap) -> Evaluation:
    """Return the figures of a map over all pixels with truth; from memory where they were worked out before."""
    return remembered(
        "evaluation",
        lambda: evaluate(result.disparity, truth),
        inputs=pair.digest,
        settings=settings_key(result),
        shared=pair.shared,
    )


def settings_key(result: DisparityMap) -> str:
    """Return what tells the maps of one pair apart: which matcher made it, and with which settings."""
    return f"{type(result.settings).__name__} {result.settings.model_dump_json()}"


def left_picture(view: DepthView) -> Picture:
    """Return the left image."""
    return Picture(LEFT, as_rgb(view.pair.left), photograph=True)


def map_picture(view: DepthView, name: str, reason: ReasonMap | None = None) -> Picture:
    """Return the map of a method; under it disparity, depth, score, and the reason where there is none."""
    result = view.results[name]
    words = [_said(cause) for cause in Reason]
    return Picture(
        name,
        coloured(result.disparity, view.low, view.high, view.palette),
        (
            Reading(result.disparity, unit="px", digits=2, depth=depth_scale(view.pair, disparity_error(view, name))),
            Reading(result.reason if reason is None else reason, words=tuple(words)),
            Reading(result.score, label="score", digits=2),
        ),
    )


def truth_picture(view: DepthView) -> list[Picture]:
    """Return the ground truth, or nothing where it is not known."""
    truth = view.pair.truth
    if truth is None:
        return []
    reading = Reading(truth, unit="px", digits=2, depth=depth_scale(view.pair, 0.0))
    return [Picture(TRUTH, coloured(truth, view.low, view.high, view.palette), (reading,))]


def map_legends(view: DepthView) -> tuple[Legend, ...]:
    """Return what the colours of the maps mean."""
    return (
        strip_legend("disparity, px, far to near", view.low, view.high, view.palette),
        word_legend("", [hexadecimal(NO_ANSWER)], ["no disparity"]),
    )


def _said(reason: Reason) -> str:
    """Return a reason as it stands under a map; nothing for what was simply measured."""
    if reason is Reason.MEASURED:
        return ""
    return REASON_WORDS[reason] if reason is Reason.FILLED else f"no disparity: {REASON_WORDS[reason]}"
