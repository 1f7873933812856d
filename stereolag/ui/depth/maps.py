"""The maps of the depth page: computed, coloured alike, judged, and shown side by side beside their controls."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping, Set
from contextlib import nullcontext
from dataclasses import dataclass, field
from functools import partial
from typing import Any

import numpy as np
import streamlit as st

from stereolag.core.arrays import FloatMap, ReasonMap, Rgb
from stereolag.figures.legends import (
    FAR_TO_NEAR,
    PALETTES,
    Colours,
    Legend,
    disparity_legends,
    disparity_range,
    searched_range,
)
from stereolag.figures.pictures import as_rgb, edge_path, thinned
from stereolag.geometry.scene import DISPARITY_ERROR, typical_error
from stereolag.pair import Pair
from stereolag.stereo.evaluation import Evaluation, evaluate
from stereolag.stereo.matcher import DisparityMap, StereoMatcher
from stereolag.stereo.methods import METHODS, PRESETS, PresetName, preset
from stereolag.stereo.reasons import Reason
from stereolag.streamlit_inside import Container, give_head_start
from stereolag.ui import keys, prose
from stereolag.ui.announcements import announce
from stereolag.ui.depth.calibrating import calibration_of
from stereolag.ui.depth.sentences import map_in_words, photograph_in_words
from stereolag.ui.first_settings import DISPARITIES_AT_FIRST, first_settings
from stereolag.ui.keys import COLOURS, SHOWN, TAB, preset_key
from stereolag.ui.linked_pictures import linked_pictures, send_picture
from stereolag.ui.matcher_controls import AsSet, ask_matcher, matchers_in_use, set_controls
from stereolag.ui.packing import (
    DepthScale,
    Figure,
    PackedPicture,
    Picture,
    Reading,
    no_depth,
    packed,
)
from stereolag.ui.persistence import persistent
from stereolag.ui.results import computed_at_once, computed_before, computed_in_turn, remembered
from stereolag.ui.sentences import REASON_WORDS, beyond_the_colours, duration, percent
from stereolag.ui.states import show_refused


@dataclass(frozen=True, eq=False)
class DepthView:
    """One pair, the map of each method, and the colour range that all maps share.

    Attributes
    ----------
    pair
        The images, with truth, mask and calibration if known.
    results
        {name of the method as the page shows it: its map}, in the order shown; its settings are ``result.settings``.
    low, high
        The locked colour range, px of disparity.
    palette
        (256, 3) uint8 RGB from far to near.
    outlines
        Outlines of the left image over the maps, as an SVG path; "" = none.
    late
        Names of the maps whose settings have changed since: the new map is still being computed.
    """

    pair: Pair
    results: Mapping[str, DisparityMap]
    low: float
    high: float
    palette: Rgb = field(default_factory=lambda: FAR_TO_NEAR)
    outlines: str = ""
    late: Set[str] = frozenset()

    @property
    def colours(self) -> Colours:
        """Return the colours that all maps share."""
        return Colours(self.low, self.high, self.palette, self.outlines)


PALETTE, INVERTED = f"{COLOURS}.palette", f"{COLOURS}.inverted"
OUTLINED = f"{COLOURS}.outlined"
FIRST_PALETTE = "viridis"
MOST_BEYOND = 0.02
"""Share of a map beyond the colours above which the page says so."""


def coloured_alike(pair: Pair, results: Mapping[str, DisparityMap]) -> DepthView:
    """Ask for the colours and return the view of all maps in them.

    The range is the one searched by all maps shown together, until the visitor sets another; without a map, the
    initial range of the pair.
    """
    key = range_key(pair)
    first, count = pair.min_disparity, pair.num_disparities or DISPARITIES_AT_FIRST
    searched = searched_range(results.values()) if results else (float(first), float(first + count))
    low, high = st.session_state.get(key) or searched
    palette = st.session_state.get(PALETTE, FIRST_PALETTE)
    inverted = st.session_state.get(INVERTED, False)
    outlined = st.session_state.get(OUTLINED, False)
    colours = st.popover("Colours", icon=":material/palette:", key=f"{COLOURS}.opened", on_change="rerun")
    if colours.open:  # drawing hidden controls would cost time in every run
        with colours:
            _ask_range(key, pair, results, (low, high))
            palette = st.segmented_control(
                "Palette",
                [*PALETTES],
                default=FIRST_PALETTE,
                format_func=str.capitalize,
                required=True,
                **persistent(PALETTE),
            )
            inverted = st.toggle(
                "Invert: far is bright",
                **persistent(INVERTED),
                help="Near things are dark, as in the source report’s maps. The report’s preset switches this on.",
            )
            outlined = st.toggle(
                "Outlines of the left image",
                **persistent(OUTLINED),
                help="Draws the edges of the left image over every map: where a depth edge lies beside its outline, "
                "the window has smeared it.",
            )
    colours_of = PALETTES[palette]
    if inverted:
        colours_of = colours_of[::-1]
    return DepthView(pair, results, low, max(high, low + 1), colours_of, _outlines(pair) if outlined else "")


def offer_fit(view: DepthView) -> None:
    """Name the maps with more than `MOST_BEYOND` outside the colours, and offer to fit the range to them."""
    beyond = {name: _share_beyond(view, name) for name in view.results}
    beyond = {name: share for name, share in beyond.items() if share > MOST_BEYOND}
    if not beyond:
        return
    with st.container(horizontal=True, vertical_alignment="center", gap="small"):
        prose.markdown(f":orange[:material/palette:] {beyond_the_colours(beyond)}", width="content")
        fit = (range_key(view.pair), view.pair, view.results)
        st.button("Fit the colours", key=f"{COLOURS}.fit_beyond", on_click=_fit, args=fit)


def set_inverted(inverted: bool) -> None:
    """Set whether far things are bright, instead of near ones; the switch must not have been drawn yet."""
    st.session_state[INVERTED] = inverted


def _outlines(pair: Pair) -> str:
    """Return the outlines of the left image; from memory if they were drawn before."""
    return remembered("outlines", lambda: edge_path(pair.left), inputs=pair.digest, settings="", shared=pair.shared)


def _ask_range(key: str, pair: Pair, results: Mapping[str, DisparityMap], shown: tuple[float, float]) -> None:
    """Ask for the ends of the colour range, and offer to fit it or to let it follow the search."""
    low, high = shown
    with st.container(horizontal=True, gap="small"):
        for end, value in (("far", low), ("near", high)):
            box = f"{key}.{end}"
            st.session_state[box] = float(value)
            st.number_input(
                f"{end.capitalize()} end, px",
                step=1.0,
                format="%g",
                key=box,
                width=130,
                on_change=_set_range,
                args=(key,),
            )
    with st.container(horizontal=True, gap="small"):
        st.button(
            "Fit to the maps",
            on_click=_fit,
            args=(key, pair, results),
            key=f"{COLOURS}.fit",
            disabled=not results,
        )
        st.button(
            "Follow the search",
            on_click=st.session_state.pop,
            args=(key, None),
            key=f"{COLOURS}.follow",
            disabled=key not in st.session_state,
            help="The colours then span the disparities that are searched.",
        )


def _set_range(key: str) -> None:
    low, high = st.session_state[f"{key}.far"], st.session_state[f"{key}.near"]
    st.session_state[key] = min(low, high), max(low, high)


def _fit(key: str, pair: Pair, results: Mapping[str, DisparityMap]) -> None:
    """Set the range to cover every map shown and the truth, except the outermost 1 % at either end of each."""
    maps: list[FloatMap] = [one.disparity for one in results.values()]
    ranges = [disparity_range([one]) for one in (maps if pair.truth is None else [*maps, pair.truth])]
    st.session_state[key] = min(low for low, _ in ranges), max(high for _, high in ranges)


def _share_beyond(view: DepthView, name: str) -> float:
    """Return the share of a map's disparities beyond the colours, 0..1."""
    result = view.results[name]

    def share() -> float:
        values = thinned(result.disparity)
        known = np.isfinite(values)
        outside = (values < view.low - 1) | (values > view.high + 1)
        return float((outside & known).sum()) / max(1.0, float(known.sum()))

    return remembered(
        "share beyond the colours",
        share,
        inputs=view.pair.digest,
        settings=f"{name} {result.settings.model_dump_json()} {view.low} {view.high}",
        shared=view.pair.shared,
    )


def range_key(pair: Pair) -> str:
    """Return the key of the visitor's range for a pair; while it is unset, the range follows the search."""
    return f"{COLOURS}.range.{pair.digest}"


LEFT, RIGHT, TRUTH = "Left image", "Right image", "Ground truth"
KEY = "depth.bench"
SENT = f"{KEY}.sent"

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


def measured(pair: Pair, matcher: StereoMatcher | None, waiting: Container | None = None) -> dict[str, DisparityMap]:
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


def _computation(pair: Pair, matcher: StereoMatcher) -> dict[str, Any]:
    return {
        "task": map_task(matcher),
        "compute": lambda progress: matcher.compute(pair.left, pair.right, progress=progress),
        "estimate": matcher.estimate(pair.left.shape, pair.left.dtype),
        "inputs": pair.digest,
        "settings": matcher.model_dump_json(),
        "shared": pair.shared,
    }


def send_ahead(pair: Pair, matchers: Iterable[StereoMatcher | None]) -> dict[str, PackedPicture]:
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
        give_head_start()
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


def _packed(pair: Pair, picture: Picture, result: DisparityMap | None) -> PackedPicture:
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
    if name in view.late:
        figures = *figures, Figure("Of", "the settings before", "The map of these settings is not computed yet.")
    if view.pair.truth is None:
        return figures
    judgement = judged(view.pair, result, view.pair.truth)
    return (
        *figures,
        Figure("Bad-2", f"{judgement.bad[2.0]:.1f} %", "Pixels off by more than 2 px or without a disparity."),
        Figure("EPE", f"{judgement.epe:.2f} px", "Mean error of the pixels that have a disparity."),
    )


def judged(pair: Pair, result: DisparityMap, truth: FloatMap) -> Evaluation:
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


def known_truth(pair: Pair) -> FloatMap | None:
    """Return the ground truth of a pair; None if it is not known for any pixel."""
    return pair.truth if pair.truth is not None and np.isfinite(pair.truth).any() else None


def disparity_error(view: DepthView, name: str) -> float:
    """Return the typical error of a method's disparities, px; measured if the ground truth is known."""
    if view.pair.truth is None:
        return DISPARITY_ERROR
    truth, result = view.pair.truth, view.results[name]
    error = remembered(
        "typical error",
        lambda: typical_error(result.disparity, truth),
        inputs=view.pair.digest,
        settings=f"{name} {result.settings.model_dump_json()}",
        shared=view.pair.shared,
    )
    return DISPARITY_ERROR if math.isnan(error) else error


def depth_scale(pair: Pair, error: float) -> DepthScale | None:
    """Return the numbers that the browser needs to show depths; None without a calibration."""
    calibration = calibration_of(pair)
    if calibration is None:
        return None
    return DepthScale(calibration.focal_px * calibration.baseline_m, calibration.doffs_px, error)


CONTROLS_WIDTH = 320
"""Px."""


def bench() -> tuple[Container, Container]:
    """Return the containers for the controls and, beside them, for the maps."""
    both = st.container(horizontal=True, gap="medium", vertical_alignment="top", key="depth-bench")
    controls = both.container(width=CONTROLS_WIDTH, gap="xsmall", key="depth-bench-controls")
    return controls, both.container(key="depth-bench-maps")


def show_controls(pair: Pair, as_set: Mapping[type[StereoMatcher], AsSet]) -> None:
    """Draw the controls of one method at a time, chosen by a row of tabs; show the refusals of the others.

    Selecting a method also shows its map, so that moving its controls has a visible effect.
    """
    names = [kind.short_name for kind in METHODS]
    by_name = dict(zip(names, METHODS, strict=True))
    tab = st.segmented_control(
        "Settings of",
        names,
        default=names[0],
        required=True,
        format_func=lambda name: by_name[name].title,
        **persistent(TAB),
        label_visibility="collapsed",
        on_change=lambda: show_method(by_name[st.session_state[TAB]]),
    )
    for kind, found in as_set.items():
        if kind.short_name == tab:
            ask_matcher(kind, pair, found)
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
    set_inverted(name == "report")
    st.session_state[TAB] = matcher.short_name


def _reset(pair: Pair) -> None:
    st.session_state[SHOWN] = SHOWN_AT_FIRST
    st.session_state[TAB] = METHODS[0].short_name
    set_inverted(False)
    for kind in METHODS:
        set_controls(first_settings(kind, pair), pair)
