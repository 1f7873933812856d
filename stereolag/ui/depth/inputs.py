"""The pair on the depth page: an example or the visitor's own files, resized, rectified and with remedies applied."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path

import cv2
import numpy as np
import streamlit as st
from streamlit.delta_generator import DeltaGenerator

from stereolag import samples
from stereolag.core.settings import scaled_settings
from stereolag.geometry.rectification import preview_divisor, scaled_disparity, scaled_image
from stereolag.pair import ChangeCode, Pair
from stereolag.stereo.matcher import StereoMatcher
from stereolag.ui import prose
from stereolag.ui.choices import OWN, choose, own_or_example
from stereolag.ui.depth.address import recall_choices, recall_settings, take_over
from stereolag.ui.depth.doctor import treated, with_remedies
from stereolag.ui.depth.own_pair import ask_own_pair
from stereolag.ui.depth.rectifying import ask_rectified, rectified, show_decision
from stereolag.ui.depth.restoring import restore_settings
from stereolag.ui.depth.several import show_steps
from stereolag.ui.depth.starting import show_start, started
from stereolag.ui.keys import FOLD, FOLD_NEXT
from stereolag.ui.matcher_controls import matchers_in_use, set_controls
from stereolag.ui.pairs import SIZES, example_pair
from stereolag.ui.persistence import persistent
from stereolag.ui.results import computed
from stereolag.ui.states import show_refused
from stereolag.ui.uploads import refused

KEY = "pairs"
TITLE = "Depth maps"
STYLE = Path(__file__).with_name("bench.css")
KEPT = f"{KEY}.kept_settings"
"""Session-state key of the images that the settings in use are for."""
SCALED_FROM = f"{KEY}.scaled_from"
"""Session-state key of {kind of settings: how they were last :class:`Scaled`}."""
OWN_PAIR_THERE = f"{KEY}.there"


INTRODUCTION = (
    "Near things shift more between the two cameras than far ones. Cut the left image into small windows and slide each"
    " along the right image: the lag of the best match is its disparity, large for near things and small for far ones."
)


@contextmanager
def head(title: str, *, awaited: bool) -> Iterator[DeltaGenerator]:
    """Draw the heading beside an expander; the choice of the pair is drawn inside the ``with`` block.

    The expander stays open while files are `awaited`, and closes when they are there. The container yielded,
    between the two, is for :func:`show_name` once the pair is known.
    """
    st.html(STYLE)
    if awaited or st.session_state.pop(FOLD_NEXT, False):
        st.session_state[FOLD] = awaited
    with st.container(horizontal=True, vertical_alignment="top", gap="medium", key="depth-head"):
        st.title(title, anchor=False, width="content")
        name = st.container(width="content", key="depth-head-pair")
        # Changing the label would redraw the expander and take the keyboard focus from the controls inside.
        with st.expander(
            "Choose a pair or bring your own",
            key=FOLD,
            icon=":material/photo_library:",
            on_change="rerun",
        ):
            prose.markdown(INTRODUCTION, width=760)
            yield name


def show_name(place: DeltaGenerator, pair: str) -> None:
    """Show the name of the pair whose maps are shown."""
    with place:
        prose.markdown(f"**{pair}**", width="content")


@dataclass(frozen=True)
class Scaled:
    """Settings scaled with the images, the original settings, and the divisor of the image sides for the latter."""

    settings: StereoMatcher
    first: StereoMatcher
    divisor: float


def choose_pair() -> Pair:
    """Ask for the pair and its size; return it ready for matching, and show the changes made to it.

    Settings from the address, or handed over by a part of the page, are set in the controls, which must therefore be
    drawn after this.
    """
    recall_choices()
    examples = samples.stereo_pairs()
    awaited = st.session_state.get(KEY) == OWN and not st.session_state.get(OWN_PAIR_THERE)
    with head(TITLE, awaited=awaited) as name_place:
        choices = st.container(horizontal=True, vertical_alignment="bottom", gap="medium")
        with choices:
            chosen = choose(examples, key=KEY)

        def ask() -> Pair | None:
            own = ask_own_pair(KEY)
            if own is not None or refused():
                show_name(name_place, "Your own pair")
            return own

        def load(name: str) -> Pair:
            show_name(name_place, examples[name].title)
            return example_pair(name)

        pair = own_or_example(chosen, ask, load, examples, key=KEY, awaited="both images are")
        st.session_state[OWN_PAIR_THERE] = not pair.shared
        with choices:
            pair = ask_size(pair, KEY)
        pair, decision = ask_rectified(pair)
        pair = started(treated(pair))
        _keep_settings(pair)
        prose.caption(pair.description)
    if st.session_state.get(FOLD_NEXT):
        st.rerun()
    shown = "" if decision is None else decision.sentence
    told = [change.sentence for change in pair.changes if change.sentence != shown and change not in pair.remedies]
    if any(told):
        prose.caption(" ".join(filter(None, told)))
    if decision is not None:
        show_decision(decision)
    show_start(pair)
    show_steps(pair)
    recall_settings(pair)
    take_over(pair)
    restore_settings(pair)
    return pair


def ask_size(pair: Pair, key: str) -> Pair:
    """Ask for the size to match at, and return the pair at that size; range, truth and calibration are scaled too."""
    rows, cols = pair.left.shape[:2]
    chosen = st.segmented_control(
        "Size",
        [*SIZES],
        default="Automatic",
        required=True,
        **persistent(f"{key}.size"),
        help="Half the size takes an eighth of the time. Search range, windows, focal length and ground truth change "
        "with the images. Automatic is full size up to a megapixel.",
    )
    divisor = SIZES[chosen] or preview_divisor(cols, rows)
    return pair if divisor == 1 else _resized(pair, divisor)


def _resized(pair: Pair, divisor: int) -> Pair:
    try:
        small = computed(
            "resized pair",
            lambda progress: at_size(pair, divisor),
            inputs=pair.digest,
            settings=str(divisor),
            shared=pair.shared,
            label="Resizing …",
        )
    except ValueError as error:
        show_refused(error)
        return pair
    # Range and calibration of the pair may be newer than the resized images in memory.
    first = pair.min_disparity // divisor
    end = None if pair.num_disparities is None else -(-(pair.min_disparity + pair.num_disparities) // divisor)
    return replace(
        small,
        full=pair,
        min_disparity=first,
        num_disparities=None if end is None else end - first,
        calibration=None if pair.calibration is None else pair.calibration.scaled(1 / divisor),
        changes=(*pair.changes, small.changes[-1]),
    )


def at_size(pair: Pair, divisor: int) -> Pair:
    """Return the pair with its sides divided by `divisor`."""
    factor = 1 / divisor
    left, right = scaled_image(pair.left, factor), scaled_image(pair.right, factor)
    size = (left.shape[1], left.shape[0])
    visible = pair.visible
    if visible is not None:
        visible = cv2.resize(visible.astype(np.uint8), size, interpolation=cv2.INTER_NEAREST_EXACT) > 0
    full = f"{pair.left.shape[1]} × {pair.left.shape[0]}"
    shown = f"Shown at 1/{divisor} of its size: {size[0]} × {size[1]} of {full} pixels."
    return pair.after(
        ChangeCode.RESIZED,
        shown,
        id=replace(pair.id, size=f"1/{divisor}"),
        left=left,
        right=right,
        truth=None if pair.truth is None else scaled_disparity(pair.truth, factor),
        visible=visible,
    )


def original(pair: Pair) -> Pair:
    """Return the pair at its own size, with all changes made to the smaller one."""
    if pair.full is None:
        return pair
    full, _ = rectified(pair.full)
    return with_remedies(full, pair.id.remedies)


def _keep_settings(pair: Pair) -> None:
    """Keep the settings in use if the images are the same at another size, or another pair of the same set.

    They are scaled to cover the same part of the images. Settings not changed since the last scaling are scaled from
    the originals: sizes are rounded only once, and are the same again at the same size.
    """
    full = pair.full or pair
    now = pair.id.chosen, full.left.shape[1] / pair.left.shape[1], pair.id.searched
    before = st.session_state.get(KEPT)
    st.session_state[KEPT] = now
    if before is None or before[0] != now[0]:
        st.session_state[SCALED_FROM] = {}
        return
    if before == now:
        return
    origins: dict[type[StereoMatcher], Scaled] = st.session_state[SCALED_FROM]
    for matcher in matchers_in_use():
        origin = origins.get(type(matcher))
        if origin is None or origin.settings != matcher:
            origin = Scaled(matcher, matcher, before[1])
        try:
            scaled = scaled_settings(origin.first, origin.divisor / now[1])
        except ValueError as error:
            show_refused(f"The settings could not be scaled with the images. {error}")
        else:
            set_controls(scaled, pair)
            origins[type(matcher)] = replace(origin, settings=scaled)
