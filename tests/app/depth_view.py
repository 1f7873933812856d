"""A small real pair with its maps, a crop of a bundled example, as the parts of the depth page receive it."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace
from functools import cache
from types import MappingProxyType
from typing import Any

import numpy as np
from streamlit.testing.v1 import AppTest

from stereolag.figures.legends import Colours, disparity_range
from stereolag.geometry.calibration import Calibration
from stereolag.pair import Pair, PairId, example_pair
from stereolag.samples import stereo_pairs
from stereolag.stereo.opencv import StereoBM, StereoSGBM
from stereolag.stereo.windows.matcher import CorrelationMatcher
from stereolag.stereo.windows.search import SearchArea
from stereolag.ui.depth.maps import DepthView
from tests.app import uploads

ROWS, COLS = slice(215, 375), slice(120, 400)

SCENE = uploads.texture(120, 205)
LEFT, RIGHT = SCENE[:, :-5], SCENE[:, 5:]
"""A pair as a visitor's own."""


@cache
def small_view(*, calibrated: bool = True, truth: bool = True) -> DepthView:
    """Return a part of the puzzle cube, with or without its calibration and ground truth."""
    whole = example_pair(stereo_pairs()["cube"])
    known = whole.calibration
    assert known is not None
    assert known.cx is not None
    assert known.cy is not None
    assert whole.truth is not None
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


def _part() -> None:
    import streamlit as st

    st.session_state["show"](st.session_state["view"])


def part_of_page(
    show: Callable[[DepthView], None], view: DepthView | None = None, state: Mapping[str, Any] = MappingProxyType({})
) -> AppTest:
    """Return a part of the depth page after its first run, which must not fail; of :func:`small_view` by default."""
    app = AppTest.from_function(_part, default_timeout=120)
    app.session_state["show"], app.session_state["view"] = show, view or small_view()
    for key, value in state.items():
        app.session_state[key] = value
    app.run()
    assert not app.exception
    return app


def own_files(script: Callable[[], None], arrangement: str = "files", **state: Any) -> AppTest:
    """Return a page that chooses a pair, after its first run, with the visitor's own files asked for."""
    app = AppTest.from_function(script, default_timeout=120)
    given = {"pairs": "own", "pairs.arrangement": arrangement, "pairs.gone": False, "depth.head": True}
    for key, value in (given | state).items():
        app.session_state[key] = value
    return app.run()


def given(app: AppTest, **files: tuple[str, bytes]) -> AppTest:
    """Return the page after files were given to the boxes of the pair; each has a name and its bytes."""
    for key, (name, data) in files.items():
        app.file_uploader(key=f"pairs.{key}").upload(name, data, "application/octet-stream")
    app.run()
    assert not app.exception
    return app


def shown(app: AppTest) -> Pair:
    """Return the pair, the first of what the page has put into the session as shown."""
    assert not app.exception
    pair: Pair = app.session_state["shown"][0]
    return pair


def _part_on_a_set() -> None:
    import streamlit as st

    from stereolag import StereoBM
    from stereolag.figures.legends import Colours
    from stereolag.ui.depth.inputs import choose_pair
    from stereolag.ui.depth.maps import DepthView

    pair = choose_pair()
    matcher = StereoBM(num_disparities=16, block_size=st.session_state.get("block", 9))
    view = DepthView(pair, {matcher.title: matcher.compute(pair.left, pair.right)}, Colours(0, 16))
    st.session_state["show"](view)


def part_on_a_set(show: Callable[[DepthView], None]) -> AppTest:
    """Return a part of the depth page that asks for several pairs, and shows an example until they are there."""
    return own_files(_part_on_a_set, "several", show=show)
