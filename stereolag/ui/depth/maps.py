"""The maps of the depth page: computed, judged, and shown side by side with their numbers."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable, Mapping
from contextlib import nullcontext
from functools import partial
from typing import Any

import streamlit as st
from streamlit.delta_generator import DeltaGenerator

from stereolag.core.arrays import FloatMap, ReasonMap
from stereolag.figures.legends import Legend, disparity_legends
from stereolag.figures.linked_pictures import DepthScale, Figure, PackedPicture, Picture, Reading, no_depth, packed
from stereolag.figures.pictures import as_rgb
from stereolag.stereo.evaluation import Evaluation, evaluate
from stereolag.stereo.matcher import DisparityMap, StereoMatcher
from stereolag.stereo.methods import METHODS
from stereolag.stereo.reasons import Reason
from stereolag.ui import keys
from stereolag.ui.announcements import announce
from stereolag.ui.depth.alternatives import map_in_words, photograph_in_words
from stereolag.ui.depth.calibrating import calibration_of, depth_scale, disparity_error
from stereolag.ui.depth.view import DepthView
from stereolag.ui.linked_pictures import linked_pictures, send_picture
from stereolag.ui.matcher_controls import matcher_as_set
from stereolag.ui.pairs import StereoPair
from stereolag.ui.persistence import persistent
from stereolag.ui.results import computed_at_once, computed_before, computed_in_turn, remembered
from stereolag.ui.sentences import REASON_WORDS, duration, percent
from stereolag.ui.states import show_refused

LEFT, RIGHT, TRUTH = "Left image", "Right image", "Ground truth"
KEY = "depth.bench"
SENT = f"{KEY}.sent"

HEAD_START_S = 0.03
"""Time a browser needs to draw a map; it would process anything that arrives sooner before it shows the map."""

COLUMNS = 2
"""Maps side by side if there is room."""


def map_task(matcher: StereoMatcher) -> str:
    """Return the name of the task of computing a map, for the store of results."""
    return f"map {matcher.short_name}"


def shown_methods() -> list[type[StereoMatcher]]:
    """Return the methods whose maps are shown, in the order of the list of methods."""
    names = st.session_state.get(keys.SHOWN, SHOWN_AT_FIRST)
    return [method for method in METHODS if method.short_name in names]


SHOWN_AT_FIRST = [method.short_name for method in METHODS[:COLUMNS]]


def choose_maps() -> None:
    """Ask which methods' maps are shown."""
    st.pills(
        "Maps",
        [method.short_name for method in METHODS],
        selection_mode="multi",
        default=SHOWN_AT_FIRST,
        format_func={method.short_name: method.title for method in METHODS}.__getitem__,
        **persistent(keys.SHOWN),
        label_visibility="collapsed",
    )


def show_method(method: type[StereoMatcher], *, instead: bool = False) -> None:
    """Add the map of a method to those shown, beside the others or, if `instead`, in place of the first.

    To be called before the choice of maps is drawn: in a callback, or above it.
    """
    shown = [one.short_name for one in shown_methods()]
    if method.short_name not in shown:
        st.session_state[keys.SHOWN] = [*shown[instead:], method.short_name]


def measured(
    pair: StereoPair, matcher: StereoMatcher | None, waiting: DeltaGenerator | None = None
) -> dict[str, DisparityMap]:
    """Return the map of one method under its title; show why and return nothing if it cannot be computed.

    While a heavy job runs, that is the map of the previous settings, and `waiting` shows the progress.
    """
    if matcher is None:
        return {}
    try:
        with waiting or nullcontext():
            result = computed_in_turn(**_computation(pair, matcher), label=f"{matcher.title} …")
    except ValueError as error:
        show_refused(f"{matcher.title}: {error}")
        return {}
    last = f"{KEY}.last.{matcher.short_name}"
    if result is not None:
        st.session_state[last] = pair.digest, matcher.model_dump_json()
        return {matcher.title: result}
    digest, settings = st.session_state.get(last, ("", ""))
    if digest == pair.digest:
        result = computed_before(map_task(matcher), inputs=digest, settings=settings, shared=pair.shared)
    return {} if result is None else {matcher.title: result}


def _computation(pair: StereoPair, matcher: StereoMatcher) -> dict[str, Any]:
    return {
        "task": map_task(matcher),
        "compute": lambda progress: matcher.compute(pair.left, pair.right, progress=progress),
        "estimate": matcher.estimate(pair.left.shape, pair.left.dtype),
        "inputs": pair.digest,
        "settings": matcher.model_dump_json(),
        "shared": pair.shared,
    }


def send_ahead(pair: StereoPair, matchers: Iterable[StereoMatcher | None]) -> dict[str, PackedPicture]:
    """Send the maps that are available at once before anything else is drawn, and return them by title.

    The browser replaces each previous map as soon as the new one arrives; text and numbers follow.
    """
    packs = {}
    for matcher in matchers:
        try:
            result = matcher and computed_at_once(**_computation(pair, matcher))
        except ValueError:  # shown in place of the map
            continue
        if result:
            picture = Picture(result.settings.title, None, _readings(result, digits=1))
            packs[picture.title] = _packed(pair, picture, result)
    with st.container(key="depth-ahead", gap=None):
        for title, pack in packs.items():
            send_picture(pack, title, key=KEY)
    digests = [pack.digest for pack in packs.values()]
    if st.session_state.get(SENT) != digests:
        st.session_state[SENT] = digests
        time.sleep(HEAD_START_S)
    return packs


def show_maps(view: DepthView, sent: Mapping[str, PackedPicture]) -> None:
    """Show the maps of the view with their numbers under one crosshair, and the images as thumbnails.

    Pictures already `sent` are not sent again.
    """
    pictures = [_map_with_figures(view, name) for name in view.results]
    pictures += [left_picture(view, small=True), right_picture(view, small=True), *truth_picture(view, small=True)]
    linked_pictures(
        pictures,
        key=KEY,
        columns=COLUMNS,
        colours=view.colours,
        legends=map_legends(view),
        pack=lambda picture: _packed(view.pair, picture, view.results.get(picture.title)),
        sent=sent,
    )
    announce(" ".join(_said_of(view, name) for name in view.results))


def _said_of(view: DepthView, name: str) -> str:
    """Return a sentence with the numbers of a map, except the time it took."""
    return f"{name}: {', '.join(f'{one.label} {one.value}' for one in _figures(view, name)[1:])}."


def _packed(pair: StereoPair, picture: Picture, result: DisparityMap | None) -> PackedPicture:
    """Return a picture packed for the browser; from memory if it was packed before."""
    return remembered(
        "packed picture",
        partial(packed, picture),
        inputs=pair.digest,
        settings=picture.title if result is None else settings_key(result),
        shared=pair.shared,
    )


def _figures(view: DepthView, name: str) -> tuple[Figure, ...]:
    """Return the numbers of a map."""
    result = view.results[name]
    figures: tuple[Figure, ...] = (
        Figure("Took", duration(result.elapsed_s), "Time of the computation alone, when first run."),
        Figure("Coverage", percent(result.coverage), "Share of the pixels that have a disparity."),
    )
    if result.settings != matcher_as_set(type(result.settings), view.pair):
        figures = *figures, Figure("Of", "the settings before", "The map of these settings is not computed yet.")
    if view.pair.truth is None:
        return figures
    judgement = judged(view.pair, result, view.pair.truth)
    return (
        *figures,
        Figure("Bad-2", f"{judgement.bad[2.0]:.1f} %", "Pixels off by more than 2 px or without a disparity."),
        Figure("EPE", f"{judgement.epe:.2f} px", "Mean error of the pixels that have a disparity."),
    )


def judged(pair: StereoPair, result: DisparityMap, truth: FloatMap) -> Evaluation:
    """Return the figures of a map over all pixels with truth; from memory if they were computed before."""
    return remembered(
        "evaluation",
        lambda: evaluate(result.disparity, truth),
        inputs=pair.digest,
        settings=settings_key(result),
        shared=pair.shared,
    )


def settings_key(result: DisparityMap) -> str:
    """Return the cache key of a map: its matcher and that matcher's settings."""
    return f"{type(result.settings).__name__} {result.settings.model_dump_json()}"


def left_picture(view: DepthView, *, small: bool = False) -> Picture:
    """Return the left image."""
    left = view.pair.left
    return Picture(LEFT, as_rgb(left), photograph=True, thumbnail=small, alternative=partial(photograph_in_words, left))


def right_picture(view: DepthView, *, small: bool = False) -> Picture:
    """Return the right image."""
    right = view.pair.right
    return Picture(
        RIGHT, as_rgb(right), photograph=True, thumbnail=small, alternative=partial(photograph_in_words, right)
    )


def map_picture(view: DepthView, name: str, reason: ReasonMap | None = None) -> Picture:
    """Return the map of a method with readings of disparity, depth and score, and the reason for a blank pixel."""
    result = view.results[name]
    score = Reading(result.score, label="score", digits=2)
    readings = *_readings(result, partial(_depth, view, name), reason=reason), score
    return Picture(name, None, readings, alternative=partial(map_in_words, result.disparity))


def _map_with_figures(view: DepthView, name: str) -> Picture:
    """Return the map of a method with its numbers; without scores and to 0.1 px, only a third of the data is sent."""
    result = view.results[name]
    readings = _readings(result, partial(_depth, view, name), digits=1)
    said = partial(map_in_words, result.disparity)
    return Picture(name, None, readings, partial(_figures, view, name), alternative=said)


def _depth(view: DepthView, name: str) -> DepthScale | None:
    return depth_scale(view.pair, disparity_error(view, name))


def _readings(
    result: DisparityMap,
    depth: Callable[[], DepthScale | None] = no_depth,
    *,
    reason: ReasonMap | None = None,
    digits: int = 2,
) -> tuple[Reading, Reading]:
    return (
        Reading(result.disparity, unit="px", digits=digits, depth=depth),
        Reading(result.reason if reason is None else reason, words=tuple(_said(cause) for cause in Reason)),
    )


def truth_picture(view: DepthView, *, small: bool = False) -> list[Picture]:
    """Return the ground truth, or nothing if it is unknown."""
    truth = view.pair.truth
    if truth is None:
        return []
    reading = Reading(truth, unit="px", digits=2, depth=lambda: depth_scale(view.pair, 0.0))
    return [Picture(TRUTH, None, (reading,), thumbnail=small, alternative=partial(map_in_words, truth))]


def map_legends(view: DepthView) -> tuple[Legend, ...]:
    """Return the legends of the maps of a pair."""
    return disparity_legends(view.low, view.high, view.palette, calibration_of(view.pair))


def _said(reason: Reason) -> str:
    """Return the text for a reason under a map; "" for a measured pixel."""
    if reason is Reason.MEASURED:
        return ""
    return REASON_WORDS[reason] if reason is Reason.FILLED else f"no disparity: {REASON_WORDS[reason]}"
