"""The map of a slider that is moved, before the page runs: smaller while it is dragged, whole once it is released."""

from __future__ import annotations

import math
from contextlib import suppress
from dataclasses import replace
from functools import partial
from typing import Any

import streamlit as st

from stereolag.core.settings import scaled_settings
from stereolag.pair import Pair, resized
from stereolag.stereo.evaluation import evaluate
from stereolag.stereo.matcher import StereoMatcher
from stereolag.ui.components import component, packed_item
from stereolag.ui.controls import matcher_moved
from stereolag.ui.depth.maps import KEY, SENT, computation, errors, kept_for, map_ahead, shares
from stereolag.ui.elements import Number
from stereolag.ui.linked_pictures import Picture, Reading, packed
from stereolag.ui.results import computed_at_once, remembered
from stereolag.ui.streamlit_inside import in_this_session
from stereolag.ui.streams import Message, address_of, open_stream

PREVIEWED_PIXELS = 80_000
"""Images are reduced to about this many pixels while a slider is dragged."""


class MovedSlider(Message):
    """A slider's class and value; whether the whole map is asked for, as it is not being dragged."""

    slider: str
    value: int | float
    whole: bool


_sliders = component("sliders")


def follow_sliders(pair: Pair) -> None:
    """Show the map of a slider as soon as it is moved; the run of the page brings the same map, and all else."""
    answer = in_this_session(partial(moved_map, pair))
    _sliders(key="depth.sliders", data=address_of(open_stream("sliders", MovedSlider, answer, brief=True)))


def moved_map(pair: Pair, moved: MovedSlider) -> bytes:
    """Return the map of a method with one of its sliders moved, as an item; without the map if it takes long."""
    header: dict[str, Any] = {"name": KEY}
    with suppress(ValueError):  # the page tells why there is no map
        matcher = matcher_moved(pair, moved.slider, moved.value)
        if matcher is not None:
            header["title"] = matcher.title
            if not moved.whole:
                return _reduced_map(pair, matcher, header)
            pack = map_ahead(pair, matcher)
            if pack is not None:
                st.session_state.setdefault(SENT, {})[matcher.title] = pack.digest
                return packed_item({**header, "digest": pack.digest, "whole": True}, [pack.data]).data
    return packed_item(header).data


def _reduced_map(pair: Pair, matcher: StereoMatcher, header: dict[str, Any]) -> bytes:
    divisor = max(2, math.isqrt(math.prod(pair.left.shape[:2]) // PREVIEWED_PIXELS))
    small = remembered("smaller pair", partial(_smaller, pair, divisor), **kept_for(pair, str(divisor)))
    result = computed_at_once(**computation(small, scaled_settings(matcher, 1 / divisor)))
    if result is None:
        return packed_item(header).data
    disparity = result.disparity * divisor
    of = Number("Preview", f"1/{divisor} size", "The map itself is computed when the slider is released.")
    judged = () if small.truth is None else errors(evaluate(disparity, small.truth * divisor))
    header["figures"] = [one._asdict() for one in (of, *shares(result), *judged)]
    return packed_item(header, [packed(Picture(matcher.title, None, (Reading(disparity, digits=1),))).data]).data


def _smaller(pair: Pair, divisor: int) -> Pair:
    return replace(resized(pair, divisor), id=replace(pair.id, size=f"{pair.id.size} dragged 1/{divisor}"))
