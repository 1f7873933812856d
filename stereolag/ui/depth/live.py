"""Maps computed between two runs of the page: of the frames of a live camera, and while a slider is moved.

A frozen frame of the camera becomes the visitor's own pair. While a slider is dragged, its map is computed from smaller
images; once it is released, at full size.
"""

from __future__ import annotations

import math
import threading
import time
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import partial
from typing import Any, NamedTuple

import numpy as np
import streamlit as st

from stereolag import Calibration, DisparityMap, evaluate, rectify
from stereolag.assess.layout import Layout, views
from stereolag.core.inputs import Image, as_stereo_pair
from stereolag.core.settings import scaled_settings
from stereolag.geometry.rectification import calibration_for
from stereolag.pair import Pair, PairId, resized
from stereolag.sequences import StereoFrame
from stereolag.stereo.matcher import StereoMatcher
from stereolag.stereo.methods import METHODS
from stereolag.ui import prose
from stereolag.ui.components import component, packed_item
from stereolag.ui.controls import persistent
from stereolag.ui.depth.maps import (
    COLUMNS,
    KEY,
    SENT,
    choose_maps,
    computation,
    coverage_figures,
    error_figures,
    live_picture,
    map_ahead,
    map_legends,
    show_controls,
    show_presets,
    shown_methods,
)
from stereolag.ui.depth.sentences import CAMERAS, LIVE_CAMERA_WORDS
from stereolag.ui.depth.view import HANDED, PAIR, coloured_view
from stereolag.ui.elements import Number
from stereolag.ui.linked_pictures import Picture, Reading, linked_pictures, packed
from stereolag.ui.matcher_controls import DEFAULT_DISPARITIES, control_state, matcher_with_moved_slider
from stereolag.ui.navigation import CONTROLS_WIDTH, bench, fragment
from stereolag.ui.results import computed_at_once, kept_for, remembered
from stereolag.ui.streamlit_inside import in_this_session
from stereolag.ui.streams import Message, Stream, address_of, close_stream, connected, frame, open_stream
from stereolag.ui.uploads import OWN

CAMERA = "depth.camera"
WIDTHS = {"320 px": 320, "480 px": 480, "640 px": 640, "Full": 100_000}
"""Largest width to which the browser scales a view, px."""


class Camera(NamedTuple):
    """The arrangement of a camera's views (a key of `CAMERAS`), whether the right one is first, and their width, px."""

    arrangement: str
    crossed: bool
    width: int

    def views(self, picture: Image) -> tuple[Image, Image]:
        """Return both views in a picture that the browser sent."""
        # The browser puts the pictures of two cameras, or of one moved by hand, side by side.
        layout = Layout.BESIDE if self.arrangement in ("two", "moved") else Layout(self.arrangement)
        return views(picture, layout, crossed=self.crossed)


def ask_camera(key: str) -> Camera:
    """Ask for the arrangement and the width of the views; `key` is the prefix of the controls' keys."""
    arrangement, crossed = ask_arrangement(key, [*CAMERAS])
    width = st.segmented_control(
        "Width of a view", [*WIDTHS], default="640 px", required=True, **persistent(f"{key}.width")
    )
    return Camera(arrangement, crossed, WIDTHS[width])


def ask_arrangement(key: str, arrangements: Sequence[str]) -> tuple[str, bool]:
    """Ask for one of some keys of `CAMERAS`, and whether the right view comes first."""
    arrangement = st.selectbox(
        "Camera",
        arrangements,
        format_func=CAMERAS.__getitem__,
        **persistent(f"{key}.arrangement"),
        width=CONTROLS_WIDTH,
    )
    return arrangement, st.toggle("The right view comes first", **persistent(f"{key}.crossed"))


def ask_layout(key: str) -> Layout | None:
    """Ask for the layout of both views in one picture; None: detected from the picture."""
    layouts: dict[Layout | None, str] = {
        None: "Detect from the picture",
        **{layout: layout.value.capitalize().replace("-", " ") for layout in Layout},
    }
    chosen: Layout | None = st.selectbox(
        "Both views", [*layouts], format_func=layouts.__getitem__, **persistent(f"{key}.layout"), width=260
    )
    return chosen


def stereo_camera(stream: Stream, camera: Camera, *, key: str, record: bool = False, **callbacks: Any) -> None:
    """Draw the component of a stereo camera, which sends its frames to a stream: all frames, or only recorded ones."""
    component("stereo_camera")(
        key=key,
        data={
            **connected(stream, LIVE_CAMERA_WORDS),
            "arrangement": camera.arrangement,
            "width": camera.width,
            "crossed": camera.crossed,
            "record": record,
        },
        **callbacks,
    )


@dataclass(frozen=True)
class LiveCamera:
    """A live camera in place of a pair, and its calibration, if known."""

    calibration: Calibration | None


@fragment
def show_live(live: LiveCamera) -> None:
    """Draw the camera, the controls, and the maps of its latest frame; a moved control acts on the next frame."""
    if st.session_state.get(HANDED) is not None:  # a frozen frame, which is the pair from now on
        st.rerun()
    close_stream("sliders")  # of the pair shown before the camera
    stream = open_stream("depth", Frame)
    pair: Pair = stream.kept.get("pair") or _placeholder()
    states = {method: control_state(method, pair) for method in METHODS}
    matchers = [matcher for method in shown_methods() if (matcher := states[method].matcher) is not None]
    controls, result_place = bench()
    with controls:
        camera = ask_camera(CAMERA)
        show_presets(pair)
        show_controls(states)
    with result_place:
        with st.container(horizontal=True, vertical_alignment="center"):
            choose_maps()
            colours = st.container(width="content")
        stream.answer = partial(answer, stream.kept, matchers, camera, live.calibration)
        stereo_camera(
            stream,
            camera,
            key=CAMERA,
            on_shape_change=lambda: None,
            on_frozen_change=lambda: _freeze(stream, live.calibration),
        )
        results = {result.settings.title: result for result in stream.kept.get("results", ())}
        if not results:
            prose.caption(LIVE_CAMERA_WORDS["about"])
            return
        with colours:
            view = coloured_view(pair, results)
        linked_pictures(
            [live_picture(view, name) for name in results],
            key=KEY,
            columns=COLUMNS,
            colours=view.colours,
            legends=map_legends(view),
        )


def _placeholder() -> Pair:
    """Return a black pair for the controls until the first frame arrives."""
    black = _black(480, 640)
    return Pair(black, black, PairId("live"), num_disparities=DEFAULT_DISPARITIES)


def _black(rows: int, cols: int) -> Image:
    """Return a black image that takes no memory: all its pixels are one byte."""
    return np.broadcast_to(np.uint8(0), (rows, cols))


_matching = threading.Lock()
"""Held while a frame is matched, which takes all cores: two frames at once would both be answered later."""


class Frame(Message):
    """A picture with both views, and whether to freeze it instead of matching it."""

    parts: tuple[bytes]
    freeze: bool = False


def answer(
    kept: dict[str, Any],
    matchers: Sequence[StereoMatcher],
    camera: Camera,
    calibration: Calibration | None,
    message: Frame,
) -> bytes:
    """Return the packed maps of a frame, or a message that it is frozen.

    Parameters
    ----------
    kept
        Receives the latest pair and its maps, which the page shows when it is drawn again, or the frozen pair.
    matchers
        The matchers of the methods shown.
    camera
        The arrangement of both views in a frame.
    calibration
        The calibration of the camera, for images of any size; with a rig, each frame is rectified.
    message
        The frame.
    """
    left, right = camera.views(frame(message.parts[0], grey=not message.freeze))
    if message.freeze:
        kept["frozen"] = left, right
        return packed_item({"frozen": time.monotonic()}).data
    rows, cols = left.shape[:2]
    if calibration is not None and calibration.rig is not None:
        left, right, calibration = rectify(left, right, calibration)
    elif calibration is not None:
        calibration = calibration_for(calibration, cols, rows)
    with _matching:
        results = [matcher.compute(left, right) for matcher in matchers]
    # Each visitor's last frame stays in memory, without the right view and the scores, which the page does not show.
    kept["pair"] = replace(_placeholder(), left=left.copy(), right=_black(*left.shape[:2]), calibration=calibration)
    kept["results"] = [result.without_scores() for result in results]
    parts = [_packed_map(result) for result in results]
    return packed_item({"shape": [rows, cols, len(parts)], "digest": "live"}, parts).data


def _packed_map(result: DisparityMap) -> bytes:
    title = result.settings.title
    return packed(
        Picture(title, None, (Reading(result.disparity, unit="px", digits=1),)),
        {"kind": "preview", "name": KEY, "title": title, "live": True},
    ).data


def _freeze(stream: Stream, calibration: Calibration | None) -> None:
    """Make the frame that was frozen the visitor's own pair."""
    left, right = stream.kept.pop("frozen", (None, None))
    if left is None or right is None:
        return
    if calibration is not None and calibration.rig is None:
        calibration = calibration_for(calibration, left.shape[1], left.shape[0])
    transfer(
        StereoFrame(left, right),
        f"frozen {time.time_ns()}",
        f"a frame of the camera, frozen at {time.strftime('%H:%M:%S')}",
        calibration,
    )


def transfer(
    frame: StereoFrame,
    digest: str,
    description: str,
    calibration: Calibration | None,
    search: tuple[int, int | None] = (0, None),
) -> None:
    """Hand a frame over to the depth page as its pair; the page must not have asked for a pair yet in this run."""
    st.session_state[HANDED] = Pair(
        *as_stereo_pair(frame.left, frame.right),
        PairId(digest),
        truth=frame.truth,
        calibration=calibration,
        min_disparity=search[0],
        num_disparities=search[1],
        description=description,
    )
    st.session_state[PAIR] = OWN


# A slider that is moved

PREVIEWED_PIXELS = 80_000
"""Images are reduced to about this many pixels while a slider is dragged."""


class MovedSlider(Message):
    """A slider's CSS class and value; whether the map is wanted at full size, since it is not being dragged."""

    slider: str
    value: int | float
    whole: bool


def follow_sliders(pair: Pair) -> None:
    """Show the map as soon as a slider is moved; the run of the page then brings the same map and everything else."""
    component("sliders")(
        key="depth.sliders",
        data=address_of(open_stream("sliders", MovedSlider, in_this_session(partial(moved_map, pair)), brief=True)),
    )


def moved_map(pair: Pair, moved: MovedSlider) -> bytes:
    """Return the packed map of a method whose slider is moved; without the map if it cannot be computed at once."""
    header: dict[str, Any] = {"name": KEY}
    with suppress(ValueError):  # the page says why there is no map
        matcher = matcher_with_moved_slider(pair, moved.slider, moved.value)
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
    small_id = replace(pair.id, size=f"{pair.id.size} dragged 1/{divisor}")
    small = remembered(
        "smaller pair", lambda: replace(resized(pair, divisor), id=small_id), **kept_for(pair, str(divisor))
    )
    result = computed_at_once(**computation(small, scaled_settings(matcher, 1 / divisor)))
    if result is None:
        return packed_item(header).data
    disparity = result.disparity * divisor
    preview = Number("Preview", f"1/{divisor} size", "The map itself is computed when the slider is released.")
    errors = () if small.truth is None else error_figures(evaluate(disparity, small.truth * divisor))
    header["figures"] = [figure._asdict() for figure in (preview, *coverage_figures(result), *errors)]
    return packed_item(header, [packed(Picture(matcher.title, None, (Reading(disparity, digits=1),))).data]).data
