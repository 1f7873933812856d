"""A small real pair with its maps, a crop of a bundled example, as the parts of the depth page receive it."""

from collections.abc import Callable, Mapping
from dataclasses import replace
from functools import cache
from types import MappingProxyType
from typing import Any

import numpy as np
import streamlit as st
from streamlit.testing.v1 import AppTest

from stereolag import Calibration, CorrelationMatcher, SearchArea, StereoBM, StereoSGBM
from stereolag.figures.legends import Colours
from stereolag.figures.pictures import disparity_range
from stereolag.io.disparities import pfm
from stereolag.pair import Pair, PairId
from stereolag.pair_sources import example_pair
from stereolag.samples import stereo_pairs
from stereolag.ui.depth.inputs import choose_pair
from stereolag.ui.depth.view import DepthView
from tests.app import uploads
from tests.app.pages import page_of

ROWS, COLS = slice(215, 375), slice(120, 400)

SCENE = uploads.texture(120, 205)
LEFT, RIGHT = SCENE[:, :-5], SCENE[:, 5:]
"""A pair as a visitor's own."""


@cache
def small_view(*, calibrated: bool = True, truth: bool = True) -> DepthView:
    """Return a part of the puzzle cube, with or without its calibration and ground truth."""
    whole = example_pair(stereo_pairs()["cube"])
    known = whole.calibration
    pair = replace(
        whole,
        left=np.ascontiguousarray(whole.left[ROWS, COLS]),
        right=np.ascontiguousarray(whole.right[ROWS, COLS]),
        truth=whole.truth[ROWS, COLS] if truth else None,
        visible=None,
        id=PairId(f"small cube, calibrated: {calibrated}, truth: {truth}"),
        calibration=Calibration(known.focal_px, known.baseline_m, cx=known.cx - COLS.start, cy=known.cy - ROWS.start)
        if calibrated
        else None,
    )
    matchers = {
        "Convolution": CorrelationMatcher(window_size=15, search=SearchArea.rectified(64)),
        "StereoBM": StereoBM(num_disparities=64),
        "StereoSGBM": StereoSGBM(num_disparities=64),
    }
    results = {name: matcher.compute(pair.left, pair.right) for name, matcher in matchers.items()}
    low, high = disparity_range([result.disparity for result in results.values()])
    return DepthView(pair, results, Colours(low, high))


def part_of_page(
    show: Callable[[DepthView], None], view: DepthView | None = None, state: Mapping[str, Any] = MappingProxyType({})
) -> AppTest:
    """Return a part of the depth page, of :func:`small_view` by default; what it shows can be replaced: "view"."""
    return page_of(lambda: show(st.session_state["view"]), {"view": view or small_view(), **state})


def own_files(script: Callable[[], None], arrangement: str = "files") -> AppTest:
    """Return a page that chooses a pair, with the visitor's own files asked for."""
    return page_of(script, {"pairs": "own", "pairs.arrangement": arrangement, "pairs.gone": False, "depth.head": True})


def pair_of(number: int, shift: int) -> dict[str, bytes]:
    """Return the files of a pair of a set, with its ground truth."""
    scene = uploads.texture(120, 200 + shift, seed=number)
    return {
        f"set/left{number}.png": uploads.png(scene[:, :200]),
        f"set/right{number}.png": uploads.png(scene[:, shift:]),
        f"set/disp{number}.pfm": pfm(np.full((120, 200), shift, np.float32)),
    }


def shown(app: AppTest) -> Pair:
    """Return the pair, the first of what the page has put into the session as shown."""
    pair: Pair = app.session_state["shown"][0]
    return pair


def part_on_a_set(show: Callable[[DepthView], None]) -> AppTest:
    """Return a part of the depth page that asks for several pairs, and shows an example until they are there."""

    def part() -> None:
        pair = choose_pair()
        matcher = StereoBM(num_disparities=16, block_size=st.session_state.get("block", 9))
        show(DepthView(pair, {matcher.title: matcher.compute(pair.left, pair.right)}, Colours(0, 16)))

    return own_files(part, "several")
