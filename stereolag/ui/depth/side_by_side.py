"""The default view of the depth page: the images, and the maps of two methods beside each other."""

from __future__ import annotations

import hashlib

import streamlit as st

from stereolag.figures.disparity import disparity_legend, disparity_png
from stereolag.figures.pictures import fitted, jpeg
from stereolag.stereo.matcher import StereoMatcher
from stereolag.stereo.result import DisparityMap
from stereolag.ui.depth.judging import judged, settings_of
from stereolag.ui.depth.view import DepthView
from stereolag.ui.images import show_jpeg, show_png
from stereolag.ui.numbers import Number, show_numbers
from stereolag.ui.pairs import Disparity, StereoPair
from stereolag.ui.results import computed_in_turn, remembered
from stereolag.ui.wording import duration, percent


def measured(pair: StereoPair, matcher: StereoMatcher | None, label: str) -> DisparityMap | None:
    """Return the disparity map of one method; None, and why, where it cannot be had, or not yet."""
    if matcher is None:
        return None
    try:
        return computed_in_turn(
            lambda progress: matcher.compute(pair.left, pair.right, progress=progress),
            matcher.estimate(pair.left.shape, pair.left.dtype),
            inputs=pair.digest,
            settings=matcher.model_dump_json(),
            shared=pair.shared,
            label=label,
        )
    except ValueError as error:
        st.error(str(error))
        return None


def show_map(view: DepthView, name: str) -> None:
    """Show the map of one method and what can be said of it in numbers."""
    if name not in view.results:
        return
    result = view.results[name]
    show_png(_coloured(view, result.disparity, settings_of(result)))
    numbers = [
        Number("Took", duration(result.elapsed_s), "The computation alone, when it was first done."),
        Number("Coverage", percent(result.coverage), "Share of the pixels that have an answer."),
    ]
    if view.pair.truth is not None:
        figures = judged(view.pair, result, view.pair.truth)
        numbers += [
            Number("Bad-2", f"{figures.bad[2.0]:.1f} %", "Pixels that are off by more than 2 px, or missing."),
            Number("EPE", f"{figures.epe:.2f} px", "Mean error of the pixels that have an answer."),
        ]
    show_numbers(numbers)


def show_images(view: DepthView) -> None:
    """Show one of the pictures that went in, or the truth in the colours of the maps, above the legend."""
    pair = view.pair
    views = ["Left", "Right"] + ["Truth"] * (pair.truth is not None)
    chosen = st.session_state.get("depth.view", "Left")
    if chosen == "Truth" and pair.truth is not None:
        show_png(_coloured(view, pair.truth, chosen))
    else:
        show_jpeg(
            remembered(
                lambda: jpeg(fitted(pair.right if chosen == "Right" else pair.left)),
                inputs=pair.digest,
                settings=chosen,
                shared=pair.shared,
                name="photograph",
            )
        )
    st.segmented_control("View", views, default="Left", required=True, key="depth.view", label_visibility="collapsed")
    st.html(disparity_legend(view.low, view.high, view.palette))


def _coloured(view: DepthView, disparity: Disparity, name: str) -> bytes:
    """Return a map of the view in its colours, from memory where it was coloured so before."""
    colours = hashlib.sha256(view.palette.tobytes()).hexdigest()
    return remembered(
        lambda: disparity_png(disparity, view.low, view.high, view.palette),
        inputs=view.pair.digest,
        settings=f"{name} {view.low} {view.high} {colours}",
        shared=view.pair.shared,
        name="coloured map",
    )
