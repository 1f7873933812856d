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
from stereolag.ui.elements import Number, announce, in_columns, refusals_shown, show_picture, show_refused
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
    DEFAULT_DISPARITIES,
    ControlState,
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

DEFAULT_SHOWN = [method.short_name for method in METHODS[:COLUMNS]]

REASON_READINGS = tuple(
    {Reason.MEASURED: "", Reason.FILLED: REASON_WORDS[Reason.FILLED]}.get(
        reason, f"no disparity: {REASON_WORDS[reason]}"
    )
    for reason in Reason
)
"""The text below a map for the pixel under the pointer, by :class:`Reason`."""


# The methods, and their maps


def map_task(matcher: StereoMatcher) -> str:
    """Return the task under which :mod:`stereolag.ui.results` keeps the map of a method."""
    return f"map {matcher.short_name}"


def shown_methods() -> list[type[StereoMatcher]]:
    """Return the methods whose maps are shown, in the order of `METHODS`."""
    names = st.session_state.get(SHOWN, DEFAULT_SHOWN)
    return [method for method in METHODS if method.short_name in names]


def choose_maps() -> None:
    """Ask which methods' maps are shown."""
    st.pills(
        "Maps",
        [method.short_name for method in METHODS],
        selection_mode="multi",
        default=DEFAULT_SHOWN,
        format_func={method.short_name: method.title for method in METHODS}.__getitem__,
        **persistent(SHOWN),
        label_visibility="collapsed",
        wrap=True,
    )


def show_method(method: type[StereoMatcher], *, instead: bool = False) -> None:
    """Add the map of a method to those shown, beside the others or, if `instead`, in place of the first.

    Call it before :func:`choose_maps` draws its control: in a callback, or above it.
    """
    shown = [other.short_name for other in shown_methods()]
    if method.short_name not in shown:
        st.session_state[SHOWN] = [*shown[instead:], method.short_name]


def compute_map(pair: Pair, matcher: StereoMatcher | None, waiting: Container | None = None) -> dict[str, DisparityMap]:
    """Return {title of the method: its map}; if it cannot be computed, show why and return an empty dict.

    While a heavy job runs, the map is that of the previous settings, and `waiting` shows the progress.
    """
    if matcher is None:
        return {}
    last, result = f"{KEY}.last.{matcher.short_name}", None
    with refusals_shown(f"{matcher.title}: {{}}"):
        with waiting or nullcontext():
            result = computed_in_turn(**computation(pair, matcher), label=f"{matcher.title} …")
        if result is not None:
            st.session_state[last] = kept_for(pair, matcher.model_dump_json())
        elif (previous := st.session_state.get(last)) and previous["inputs"] == pair.digest:
            result = computed_before(map_task(matcher), **previous)
    return {} if result is None else {matcher.title: result}


def computation(pair: Pair, matcher: StereoMatcher) -> dict[str, Any]:
    """Return the arguments with which :mod:`stereolag.ui.results` computes the map of a method or finds it."""
    return {
        "task": map_task(matcher),
        "compute": lambda progress: matcher.compute(pair.left, pair.right, progress=progress),
        "estimate": matcher.estimate(pair.left.shape, pair.left.dtype),
        **kept_for(pair, matcher.model_dump_json()),
    }


def send_ahead(pair: Pair, matchers: Iterable[StereoMatcher | None]) -> dict[str, PackedPicture]:
    """Send the maps that can be computed at once, before anything else is drawn, and return them by title.

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
    """Send the two images; outside the fragment of the maps, so that they are not sent again as controls move."""
    with st.container(key="depth-images", gap=None):
        for picture in _thumbnails(pair):
            send_picture(_packed(pair, picture, None), picture.title, key=KEY)


def map_ahead(pair: Pair, matcher: StereoMatcher) -> PackedPicture | None:
    """Return the map of a method packed for the browser; None if it cannot be computed at once."""
    result = computed_at_once(**computation(pair, matcher))
    return result and _packed(pair, Picture(matcher.title, None, _readings(result, digits=1)), result)


def show_side_by_side(view: DepthView, matchers: Mapping[str, StereoMatcher]) -> None:
    """Show the maps of a few settings side by side, without those that cannot be computed at once."""
    low, high, palette = view.colours.low, view.colours.high, view.colours.palette
    for title, matcher in in_columns(matchers.items(), gap="small"):
        result = computed_at_once(**computation(view.pair, matcher))
        if result is not None:
            show_picture(png(coloured(result.disparity, low, high, palette)), title, title)


def _packed(pair: Pair, picture: Picture, result: DisparityMap | None) -> PackedPicture:
    """Return a picture packed for the browser; from memory if it was packed before."""
    content = picture.title if result is None else settings_key(result)
    return remembered("packed picture", partial(packed, picture), **kept_for(pair, content))


def show_maps(view: DepthView, sent: Mapping[str, PackedPicture]) -> None:
    """Show the maps of the view with their figures, and the images as thumbnails, all under one crosshair.

    Maps already `sent` are not sent again, nor are the images (:func:`send_images`).
    """
    figures = {name: _figures(view, name) for name in view.results}
    images = _thumbnails(view.pair)
    linked_pictures(
        [
            *(map_picture(view, name, map_figures) for name, map_figures in figures.items()),
            *images,
            *truth_picture(view, small=True),
        ],
        key=KEY,
        columns=COLUMNS,
        colours=view.colours,
        legends=map_legends(view),
        pack=lambda picture: _packed(view.pair, picture, view.results.get(picture.title)),
        sent={**sent, **{image.title: _packed(view.pair, image, None) for image in images}},
    )
    texts = {name: ", ".join(f"{one.label} {one.value}" for one in listed[1:]) for name, listed in figures.items()}
    announce(" ".join(f"{name}: {text}." for name, text in texts.items()))


def _figures(view: DepthView, name: str) -> tuple[Number, ...]:
    """Return the figures of a map; the first is the time it took."""
    result, truth = view.results[name], view.pair.truth
    took = Number("Computed in", duration(result.elapsed_s), "Time of the computation alone, when first run.")
    outdated = Number("Of", "the previous settings", "The map of the current settings is not computed yet.")
    figures = took, *coverage_figures(result), *([outdated] if name in view.outdated else [])
    if truth is None:
        return figures
    return *figures, *error_figures(
        remembered("evaluation", lambda: evaluate(result.disparity, truth), **view.kept(name))
    )


def coverage_figures(result: DisparityMap) -> tuple[Number, ...]:
    """Return the shares of a map that were measured and, if any, filled in."""
    coverage = Number("Coverage", percent(result.coverage), "Share of the pixels whose disparity was measured.")
    filled = np.count_nonzero(result.filled)
    if not filled:
        return (coverage,)
    return coverage, Number(
        "Filled", percent(int(filled) / result.reason.size), "Share whose disparity is that of the surroundings."
    )


def error_figures(evaluation: Evaluation) -> tuple[Number, Number]:
    """Return the errors of a map against the ground truth."""
    return (
        Number("Bad-2", f"{evaluation.bad[2.0]:.1f} %", "Pixels off by more than 2 px or without a disparity."),
        Number("EPE", f"{evaluation.epe:.2f} px", "Mean error of the pixels that have a disparity."),
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
    view: DepthView, name: str, figures: tuple[Number, ...] = (), *, reason: ReasonMap | None = None
) -> Picture:
    """Return the map of a method with readings of disparity, depth and score, and the reason for a blank pixel.

    With the figures of the whole map, it has no scores, and disparities to a tenth: a third of the data is sent.
    """
    result, depth = view.results[name], partial(_depth_scale, view, name)
    description = partial(remembered, "map in words", partial(map_in_words, result.disparity), **view.kept(name))
    if figures:
        return Picture(name, None, _readings(result, depth, digits=1), figures, alternative=description)
    readings = *_readings(result, depth, reason=reason), Reading(result.score, label="score", digits=2)
    return Picture(name, None, readings, alternative=description)


def live_picture(view: DepthView, name: str) -> Picture:
    """Return the map of a method on a live frame: nothing about it is remembered, since the next frame replaces it."""
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
    """Return the ground truth as the only picture of a list; an empty list if it is unknown."""
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
    """Return the typical error of the disparities of a map, px: measured if there is ground truth, whose own is 0."""
    truth = view.pair.truth
    if name == TRUTH or truth is None:
        return 0.0 if name == TRUTH else TYPICAL_DISPARITY_ERROR_PX
    error: float = remembered(
        "typical error", lambda: typical_error(view.results[name].disparity, truth), **view.kept(name)
    )
    return TYPICAL_DISPARITY_ERROR_PX if math.isnan(error) else error


def _depth_scale(view: DepthView, name: str) -> DepthScale | None:
    """Return the numbers that the browser needs to show depths; None without a calibration."""
    calibration = view.calibration
    if calibration is None:
        return None
    return DepthScale(calibration.focal_px * calibration.baseline_m, calibration.doffs_px, disparity_error(view, name))


def choose_map(view: DepthView, label: str, key: str) -> str:
    """Ask for one of the maps of the view, and return its name."""
    names = [*view.results]
    chosen = st.segmented_control(label, names, default=names[0], required=True, key=key)
    return chosen if chosen in names else names[0]


# The values at one pixel


def disparity_in_words(view: DepthView, name: str, pixel: Pixel, *, score: bool = False) -> str:
    """Return the disparity of a method or of the ground truth at a pixel, or why it has none; on request, the score."""
    disparity = float(view.maps[name][pixel])
    if name == TRUTH:
        return "unknown" if math.isnan(disparity) else f"{disparity:.2f} px"
    result = view.results[name]
    if math.isnan(disparity):
        return f"none: {REASON_WORDS[Reason(reasons_of(view, name)[pixel])]}"
    text = f"{disparity:.2f} px{', filled in' if result.reason[pixel] == Reason.FILLED else ''}"
    return f"{text}, score {result.score[pixel]:.3f}" if score and np.isfinite(result.score[pixel]) else text


def reasons_of(view: DepthView, name: str) -> ReasonMap:
    """Return the reason for every pixel of one map; those of OpenCV's methods are found by matching again."""
    result = view.results[name]
    if result.settings.gives_reasons:
        return result.reason
    return computed(
        "reasons",
        lambda progress: blank_reasons(result, view.pair.left, view.pair.right, progress=progress),
        **view.kept(name),
        label=f"Finding the reasons for blank pixels of {name} …",
    )


# The controls beside them


def show_controls(states: Mapping[type[StereoMatcher], ControlState]) -> None:
    """Draw the controls of one method at a time, chosen by a row of tabs; of the others, show refused settings.

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
    for method, state in states.items():
        if method.short_name == tab:
            ask_matcher(state)
        elif state.refusal is not None:
            show_refused(state.refusal)


def show_presets(pair: Pair) -> None:
    """Draw a button for each preset, and one that resets all methods to their default settings."""
    with st.container(horizontal=True, gap="xxsmall", vertical_alignment="center"):
        for name, offered in PRESETS.items():
            st.button(
                offered.title, key=preset_key(name), help=offered.meaning, on_click=partial(_set_preset, name, pair)
            )
        st.button(
            "Reset",
            key=preset_key("reset"),
            icon=":material/restart_alt:",
            help="Resets all methods to their initial settings.",
            type="tertiary",
            on_click=partial(_reset, pair),
        )


def _set_preset(name: PresetName, pair: Pair) -> None:
    """Show the map of a preset, searched over the range of the method whose settings are shown."""
    tab = st.session_state.get(TAB, METHODS[0].short_name)
    searched = [matcher.search_range() for matcher in matchers_in_use() if matcher.short_name == tab]
    # A centred search area reaches equally far to both sides, which is not a range for a one-sided search.
    one_sided = [reach for reach in searched if reach is not None and reach[0] + reach[1] - 1 != -reach[0]]
    first, count = one_sided[0] if one_sided else (pair.min_disparity, pair.num_disparities or DEFAULT_DISPARITIES)
    matcher = preset(name, count, first)
    set_controls(matcher, pair)
    show_method(type(matcher), instead=True)
    st.session_state.update({INVERTED: name == "report", TAB: matcher.short_name})


def _reset(pair: Pair) -> None:
    st.session_state.update({SHOWN: DEFAULT_SHOWN, TAB: METHODS[0].short_name, INVERTED: False})
    for method in METHODS:
        set_controls(default_settings(method, pair), pair)
