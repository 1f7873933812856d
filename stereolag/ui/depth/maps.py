"""The maps of the depth page: computed, judged, and shown side by side beside their controls."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping
from contextlib import nullcontext, suppress
from functools import partial
from typing import Any

import numpy as np
import streamlit as st

from stereolag import DisparityMap, Evaluation, Reason, evaluate, preset
from stereolag.assess.explaining import blank_reasons
from stereolag.core.arrays import ReasonMap
from stereolag.core.inputs import Image
from stereolag.core.typography import duration, percent
from stereolag.figures.legends import Legend, disparity_legends
from stereolag.figures.pictures import as_rgb, coloured, png
from stereolag.figures.verdicts import REASON_WORDS
from stereolag.geometry.scene import TYPICAL_DISPARITY_ERROR_PX, typical_error
from stereolag.pair import Pair
from stereolag.stereo.matcher import StereoMatcher
from stereolag.stereo.methods import METHODS, PRESETS, PresetName
from stereolag.ui.controls import persistent
from stereolag.ui.depth.sentences import map_in_words, photograph_in_words
from stereolag.ui.depth.view import INVERTED, LEFT, RIGHT, TRUTH, DepthView, Pixel, settings_key
from stereolag.ui.elements import Number as Figure
from stereolag.ui.elements import announce, in_columns, refusals_shown, show_picture, show_refused
from stereolag.ui.linked_pictures import (
    DepthScale,
    PackedPicture,
    Picture,
    Reading,
    linked_pictures,
    packed,
    send_picture,
)
from stereolag.ui.matcher_controls import (
    DISPARITIES_AT_FIRST,
    AsSet,
    ask_matcher,
    default_settings,
    matchers_in_use,
    preset_key,
    set_controls,
)
from stereolag.ui.results import computed, computed_at_once, computed_before, computed_in_turn, kept_for, remembered
from stereolag.ui.streamlit_inside import Container, give_head_start

SHOWN = "depth.maps"
TAB = "depth.tab"
KEY = "depth.bench"
SENT = f"{KEY}.sent"

COLUMNS = 2
"""Maps side by side if there is room."""

SHOWN_AT_FIRST = [method.short_name for method in METHODS[:COLUMNS]]

WITH_A_DISPARITY = {Reason.MEASURED: "", Reason.FILLED: REASON_WORDS[Reason.FILLED]}
REASON_READINGS = tuple(WITH_A_DISPARITY.get(reason, f"no disparity: {REASON_WORDS[reason]}") for reason in Reason)
"""The text under a map for each reason."""


# The methods, and their maps


def map_task(matcher: StereoMatcher) -> str:
    """Return the name of the task of computing a map, for the store of results."""
    return f"map {matcher.short_name}"


def shown_methods() -> list[type[StereoMatcher]]:
    """Return the methods whose maps are shown, in the order of the list of methods."""
    names = st.session_state.get(SHOWN, SHOWN_AT_FIRST)
    return [method for method in METHODS if method.short_name in names]


def choose_maps() -> None:
    """Ask which methods' maps are shown."""
    st.pills(
        "Maps",
        [method.short_name for method in METHODS],
        selection_mode="multi",
        default=SHOWN_AT_FIRST,
        format_func={method.short_name: method.title for method in METHODS}.__getitem__,
        **persistent(SHOWN),
        label_visibility="collapsed",
        wrap=True,
    )


def show_method(method: type[StereoMatcher], *, instead: bool = False) -> None:
    """Add the map of a method to those shown, beside the others or, if `instead`, in place of the first.

    To be called before the choice of maps is drawn: in a callback, or above it.
    """
    shown = [one.short_name for one in shown_methods()]
    if method.short_name not in shown:
        st.session_state[SHOWN] = [*shown[instead:], method.short_name]


def measured(pair: Pair, matcher: StereoMatcher | None, waiting: Container | None = None) -> dict[str, DisparityMap]:
    """Return the map of one method under its title; show why and return nothing if it cannot be computed.

    While a heavy job runs, that is the map of the previous settings, and `waiting` shows the progress.
    """
    if matcher is None:
        return {}
    last, result = f"{KEY}.last.{matcher.short_name}", None
    with refusals_shown(f"{matcher.title}: {{}}"):
        with waiting or nullcontext():
            result = computed_in_turn(**computation(pair, matcher), label=f"{matcher.title} …")
        if result is not None:
            st.session_state[last] = kept_for(pair, matcher.model_dump_json())
        elif (before := st.session_state.get(last)) and before["inputs"] == pair.digest:
            result = computed_before(map_task(matcher), **before)
    return {} if result is None else {matcher.title: result}


def computation(pair: Pair, matcher: StereoMatcher) -> dict[str, Any]:
    """Return the arguments with which :mod:`stereolag.ui.results` computes the map of a method, or has it."""
    return {
        "task": map_task(matcher),
        "compute": lambda progress: matcher.compute(pair.left, pair.right, progress=progress),
        "estimate": matcher.estimate(pair.left.shape, pair.left.dtype),
        **kept_for(pair, matcher.model_dump_json()),
    }


def send_ahead(pair: Pair, matchers: Iterable[StereoMatcher | None]) -> dict[str, PackedPicture]:
    """Send the maps that are available at once before anything else is drawn, and return them by title.

    The browser replaces each previous map as soon as the new one arrives; text and numbers follow.
    """
    # Before anything is computed: Streamlit sends what it has at once, and then nothing for 5 ms.
    ahead = st.container(key="depth-ahead", gap=None)
    packs = {}
    for matcher in filter(None, matchers):
        with suppress(ValueError):  # shown in place of the map
            if (pack := map_ahead(pair, matcher)) is not None:
                packs[matcher.title] = pack
    with ahead:
        for title, pack in packs.items():
            send_picture(pack, title, key=KEY)
    digests = {title: pack.digest for title, pack in packs.items()}
    if digests.items() - st.session_state.get(SENT, {}).items():
        give_head_start()
    st.session_state[SENT] = digests
    return packs


def send_images(pair: Pair) -> None:
    """Send the two images, to be called outside the fragment of the maps: there they stay as controls move."""
    with st.container(key="depth-images", gap=None):
        for picture in _thumbnails(pair):
            send_picture(_packed(pair, picture, None), picture.title, key=KEY)


def map_ahead(pair: Pair, matcher: StereoMatcher) -> PackedPicture | None:
    """Return the map of a method as the browser takes it, unless somebody would have to wait for it."""
    result = computed_at_once(**computation(pair, matcher))
    return result and _packed(pair, Picture(matcher.title, None, _readings(result, digits=1)), result)


def show_beside(view: DepthView, matchers: Mapping[str, StereoMatcher]) -> None:
    """Show the maps of a few settings side by side, if nobody has to wait for them."""
    low, high, palette = view.colours.low, view.colours.high, view.colours.palette
    for title, matcher in in_columns(matchers.items(), gap="small"):
        result = computed_at_once(**computation(view.pair, matcher))
        if result is not None:
            show_picture(png(coloured(result.disparity, low, high, palette)), title, title)


def _packed(pair: Pair, picture: Picture, result: DisparityMap | None) -> PackedPicture:
    """Return a picture packed for the browser; from memory if it was packed before."""
    shows = picture.title if result is None else settings_key(result)
    return remembered("packed picture", partial(packed, picture), **kept_for(pair, shows))


def show_maps(view: DepthView, sent: Mapping[str, PackedPicture]) -> None:
    """Show the maps of the view with their numbers under one crosshair, and the images as thumbnails.

    Pictures already `sent` are not sent again, nor are the images (:func:`send_images`).
    """
    figures = {name: _figures(view, name) for name in view.results}
    images = _thumbnails(view.pair)
    linked_pictures(
        [
            *(map_picture(view, name, of_map) for name, of_map in figures.items()),
            *images,
            *truth_picture(view, small=True),
        ],
        key=KEY,
        columns=COLUMNS,
        colours=view.colours,
        legends=map_legends(view),
        pack=lambda picture: _packed(view.pair, picture, view.results.get(picture.title)),
        sent={**sent, **{one.title: _packed(view.pair, one, None) for one in images}},
    )
    numbers = {name: ", ".join(f"{one.label} {one.value}" for one in of_map[1:]) for name, of_map in figures.items()}
    announce(" ".join(f"{name}: {of_map}." for name, of_map in numbers.items()))


def _figures(view: DepthView, name: str) -> tuple[Figure, ...]:
    """Return the numbers of a map; the first is the time it took."""
    result, truth = view.results[name], view.pair.truth
    took = Figure("Computed in", duration(result.elapsed_s), "Time of the computation alone, when first run.")
    before = Figure("Of", "the settings before", "The map of these settings is not computed yet.")
    figures = took, *shares(result), *([before] if name in view.late else [])
    if truth is None:
        return figures
    judged: Evaluation = remembered("evaluation", lambda: evaluate(result.disparity, truth), **view.kept(name))
    return *figures, *errors(judged)


def shares(result: DisparityMap) -> tuple[Figure, ...]:
    """Return which shares of a map have a disparity."""
    coverage = Figure("Coverage", percent(result.coverage), "Share of the pixels whose disparity was measured.")
    filled = np.count_nonzero(result.filled)
    if not filled:
        return (coverage,)
    return coverage, Figure(
        "Filled", percent(int(filled) / result.reason.size), "Share whose disparity is that of the surroundings."
    )


def errors(judged: Evaluation) -> tuple[Figure, Figure]:
    """Return how far a map is off."""
    return (
        Figure("Bad-2", f"{judged.bad[2.0]:.1f} %", "Pixels off by more than 2 px or without a disparity."),
        Figure("EPE", f"{judged.epe:.2f} px", "Mean error of the pixels that have a disparity."),
    )


# The pictures


def photograph(title: str, image: Image, *, small: bool = False) -> Picture:
    """Return one of the two images."""
    return Picture(
        title, as_rgb(image), photograph=True, thumbnail=small, alternative=partial(photograph_in_words, image)
    )


def _thumbnails(pair: Pair) -> tuple[Picture, Picture]:
    """Return the two images, small."""
    return photograph(LEFT, pair.left, small=True), photograph(RIGHT, pair.right, small=True)


def map_picture(
    view: DepthView, name: str, figures: tuple[Figure, ...] = (), *, reason: ReasonMap | None = None
) -> Picture:
    """Return the map of a method with readings of disparity, depth and score, and the reason for a blank pixel.

    With figures, it has the numbers of the whole map in place of scores and hundredths: a third of the data is sent.
    """
    result, depth = view.results[name], partial(_depth_scale, view, name)
    said = partial(remembered, "map in words", partial(map_in_words, result.disparity), **view.kept(name))
    if figures:
        return Picture(name, None, _readings(result, depth, digits=1), figures, alternative=said)
    readings = *_readings(result, depth, reason=reason), Reading(result.score, label="score", digits=2)
    return Picture(name, None, readings, alternative=said)


def live_picture(view: DepthView, name: str) -> Picture:
    """Return the map of a method of a pair that will be another one in a moment: nothing about it is remembered."""
    return Picture(name, None, _readings(view.results[name], partial(_depth_scale, view, name), digits=1))


def _readings(
    result: DisparityMap,
    depth: Callable[[], DepthScale | None] = lambda: None,
    *,
    reason: ReasonMap | None = None,
    digits: int = 2,
) -> tuple[Reading, Reading]:
    return (
        Reading(result.disparity, unit="px", digits=digits, depth=depth),
        Reading(result.reason if reason is None else reason, words=REASON_READINGS),
    )


def truth_picture(view: DepthView, *, small: bool = False) -> list[Picture]:
    """Return the ground truth, or nothing if it is unknown."""
    truth = view.pair.truth
    if truth is None:
        return []
    reading = Reading(truth, unit="px", digits=2, depth=partial(_depth_scale, view, TRUTH))
    return [Picture(TRUTH, None, (reading,), thumbnail=small, alternative=partial(map_in_words, truth))]


def map_legends(view: DepthView) -> tuple[Legend, ...]:
    """Return the legends of the maps of a pair."""
    colours = view.colours
    return disparity_legends(colours.low, colours.high, colours.palette, view.calibration)


def disparity_error(view: DepthView, name: str) -> float:
    """Return the typical error of a method's disparities, px; measured if the ground truth is known, whose own is 0."""
    truth = view.pair.truth
    if name == TRUTH or truth is None:
        return 0.0 if name == TRUTH else TYPICAL_DISPARITY_ERROR_PX
    disparity = view.results[name].disparity
    error: float = remembered("typical error", lambda: typical_error(disparity, truth), **view.kept(name))
    return TYPICAL_DISPARITY_ERROR_PX if math.isnan(error) else error


def _depth_scale(view: DepthView, name: str) -> DepthScale | None:
    """Return the numbers that the browser needs to show depths; None without a calibration."""
    calibration = view.calibration
    if calibration is None:
        return None
    factor = calibration.focal_px * calibration.baseline_m
    return DepthScale(factor, calibration.doffs_px, disparity_error(view, name))


def choose_map(view: DepthView, label: str, key: str) -> str:
    """Ask for one of the methods whose maps are there, and return its name."""
    names = [*view.results]
    chosen = st.segmented_control(label, names, default=names[0], required=True, key=key)
    return chosen if chosen in names else names[0]


# The values at one pixel


def disparity_in_words(view: DepthView, name: str, pixel: Pixel, *, score: bool = False) -> str:
    """Return the disparity of a method or of the ground truth at a pixel, with its score or not; or why it has none."""
    disparity = float(view.maps[name][pixel])
    if name == TRUTH:
        return "unknown" if math.isnan(disparity) else f"{disparity:.2f} px"
    result = view.results[name]
    if math.isnan(disparity):
        return f"none: {REASON_WORDS[Reason(reasons_of(view, name)[pixel])]}"
    said = f"{disparity:.2f} px{', filled in' if result.reason[pixel] == Reason.FILLED else ''}"
    return f"{said}, score {result.score[pixel]:.3f}" if score and np.isfinite(result.score[pixel]) else said


def reasons_of(view: DepthView, name: str) -> ReasonMap:
    """Return the reason for every pixel of one map; OpenCV's reasons are found by matching again."""
    result = view.results[name]
    if result.settings.gives_reasons:
        return result.reason
    return computed(
        "reasons",
        lambda progress: blank_reasons(result, view.pair.left, view.pair.right, progress=progress),
        **view.kept(name),
        label=f"Finding the reasons of {name} …",
    )


# The controls beside them


def show_controls(as_set: Mapping[type[StereoMatcher], AsSet]) -> None:
    """Draw the controls of one method at a time, chosen by a row of tabs; show the refusals of the others.

    Selecting a method also shows its map, so that moving its controls has a visible effect.
    """
    by_name = {method.short_name: method for method in METHODS}
    tab = st.segmented_control(
        "Settings of",
        [*by_name],
        default=next(iter(by_name)),
        required=True,
        format_func=lambda name: by_name[name].title,
        **persistent(TAB),
        label_visibility="collapsed",
        on_change=lambda: show_method(by_name[st.session_state[TAB]]),
    )
    for method, found in as_set.items():
        if method.short_name == tab:
            ask_matcher(found)
        elif found.refusal is not None:
            show_refused(found.refusal)


def show_presets(pair: Pair) -> None:
    """Draw a button for each preset, and one that resets all methods to their initial settings."""
    with st.container(horizontal=True, gap="xxsmall", vertical_alignment="center"):
        for name, one in PRESETS.items():
            st.button(one.title, key=preset_key(name), help=one.meaning, on_click=partial(_set_preset, name, pair))
        st.button(
            "Reset",
            key=preset_key("reset"),
            icon=":material/restart_alt:",
            help="Sets all methods back to their initial settings.",
            type="tertiary",
            on_click=partial(_reset, pair),
        )


def _set_preset(name: PresetName, pair: Pair) -> None:
    """Show a preset in its own colours, over the range of the method whose settings are shown."""
    tab = st.session_state.get(TAB, METHODS[0].short_name)
    searched = [matcher.search_range() for matcher in matchers_in_use() if matcher.short_name == tab]
    # A square search area reaches equally far to both sides, which makes no range for a strip.
    strips = [one for one in searched if one is not None and one[0] + one[1] - 1 != -one[0]]
    first, count = strips[0] if strips else (pair.min_disparity, pair.num_disparities or DISPARITIES_AT_FIRST)
    matcher = preset(name, count, first)
    set_controls(matcher, pair)
    show_method(type(matcher), instead=True)
    st.session_state.update({INVERTED: name == "report", TAB: matcher.short_name})


def _reset(pair: Pair) -> None:
    st.session_state.update({SHOWN: SHOWN_AT_FIRST, TAB: METHODS[0].short_name, INVERTED: False})
    for method in METHODS:
        set_controls(default_settings(method, pair), pair)
