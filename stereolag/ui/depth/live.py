"""Maps that do not wait for a run of the page: of a live camera's running picture, and of a slider that is moved.

A frozen frame of the camera becomes the visitor's own pair. The map of a slider is smaller while it is dragged, whole
once it is released.
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
    errors,
    live_picture,
    map_ahead,
    map_legends,
    shares,
    show_controls,
    show_presets,
    shown_methods,
)
from stereolag.ui.depth.sentences import CAMERAS, LIVE_CAMERA_WORDS
from stereolag.ui.depth.view import HANDED, PAIR, coloured_alike
from stereolag.ui.elements import Number
from stereolag.ui.linked_pictures import Picture, Reading, linked_pictures, packed
from stereolag.ui.matcher_controls import DISPARITIES_AT_FIRST, matcher_as_set, matcher_moved
from stereolag.ui.navigation import CONTROLS_WIDTH, bench, fragment
from stereolag.ui.results import computed_at_once, kept_for, remembered
from stereolag.ui.streamlit_inside import in_this_session
from stereolag.ui.streams import Message, Stream, address_of, close_stream, connected, frame, open_stream
from stereolag.ui.uploads import OWN

CAMERA = "depth.camera"
WIDTHS = {"320 px": 320, "480 px": 480, "640 px": 640, "Full": 100_000}


class Camera(NamedTuple):
    """How both views come: one of `CAMERAS`, whether the right one is first, and the largest width of each, px."""

    arrangement: str
    crossed: bool
    width: int

    def views(self, picture: Image) -> tuple[Image, Image]:
        """Return both views in a picture that the browser sent."""
        # Two cameras are sent beside each other, as both pictures of one moved by hand are.
        layout = Layout.BESIDE if self.arrangement in ("two", "moved") else Layout(self.arrangement)
        return views(picture, layout, crossed=self.crossed)


def ask_camera(key: str) -> Camera:
    """Ask how both views come from a camera or two; `key` is the prefix of the controls' keys."""
    arrangement, crossed = ask_arrangement(key, [*CAMERAS])
    width = st.segmented_control(
        "Width of a view", [*WIDTHS], default="640 px", required=True, **persistent(f"{key}.width")
    )
    return Camera(arrangement, crossed, WIDTHS[width])


def ask_arrangement(key: str, arrangements: Sequence[str]) -> tuple[str, bool]:
    """Ask which of some of `CAMERAS` there is, and whether the right view comes first."""
    arrangement = st.selectbox(
        "Camera",
        arrangements,
        format_func=CAMERAS.__getitem__,
        **persistent(f"{key}.arrangement"),
        width=CONTROLS_WIDTH,
    )
    return arrangement, st.toggle("The right view comes first", **persistent(f"{key}.crossed"))


def ask_layout(key: str) -> Layout | None:
    """Ask how both views stand in one picture; None: as it shows itself."""
    layouts: dict[Layout | None, str] = {None: "As the picture shows"}
    layouts |= {one: one.value.capitalize().replace("-", " ") for one in Layout}
    chosen: Layout | None = st.selectbox(
        "Both views", [*layouts], format_func=layouts.__getitem__, **persistent(f"{key}.layout"), width=260
    )
    return chosen


def stereo_camera(stream: Stream, camera: Camera, *, key: str, record: bool = False, **callbacks: Any) -> None:
    """Draw the component of a stereo camera, which sends its frames to a stream: all of them, or those it records."""
    data = {
        **connected(stream, LIVE_CAMERA_WORDS),
        "arrangement": camera.arrangement,
        "width": camera.width,
        "crossed": camera.crossed,
        "record": record,
    }
    component("stereo_camera")(key=key, data=data, **callbacks)


@dataclass(frozen=True)
class LiveCamera:
    """A live camera in place of a pair, and its calibration, if known."""

    calibration: Calibration | None


@fragment
def show_live(live: LiveCamera) -> None:
    """Draw the camera, the controls, and the maps of its latest frame; a moved control acts on the next frame."""
    if st.session_state.get(HANDED) is not None:  # a frozen frame: the page goes on with it
        st.rerun()
    close_stream("sliders")  # of the pair that the camera stands in for
    calibration = live.calibration
    stream = open_stream("depth", Frame)
    pair: Pair = stream.kept.get("pair") or _stand_in()
    as_set = {method: matcher_as_set(method, pair) for method in METHODS}
    matchers = [one for method in shown_methods() if (one := as_set[method].matcher) is not None]
    controls, result_place = bench()
    with controls:
        camera = ask_camera(CAMERA)
        show_presets(pair)
        show_controls(as_set)
    with result_place:
        with st.container(horizontal=True, vertical_alignment="center"):
            choose_maps()
            colours = st.container(width="content")
        stream.answer = partial(answer, stream.kept, matchers, camera, calibration)
        stereo_camera(
            stream,
            camera,
            key=CAMERA,
            on_shape_change=lambda: None,
            on_frozen_change=lambda: _freeze(stream, calibration),
        )
        results = {one.settings.title: one for one in stream.kept.get("results", ())}
        if not results:
            prose.caption(LIVE_CAMERA_WORDS["about"])
            return
        with colours:
            view = coloured_alike(pair, results)
        linked_pictures(
            [live_picture(view, name) for name in results],
            key=KEY,
            columns=COLUMNS,
            colours=view.colours,
            legends=map_legends(view),
        )


def _stand_in() -> Pair:
    """Return a pair for the controls until the first frame is there."""
    blank = _nothing(480, 640)
    return Pair(blank, blank, PairId("live"), num_disparities=DISPARITIES_AT_FIRST)


def _nothing(rows: int, cols: int) -> Image:
    """Return a black image, which takes no memory."""
    return np.broadcast_to(np.uint8(0), (rows, cols))


_matching = threading.Lock()
"""Held while a frame is matched, which takes all cores: two at once are answered later than one after the other."""


class Frame(Message):
    """A picture with both views, and whether it is to be frozen in place of being matched."""

    parts: tuple[bytes]
    freeze: bool = False


def answer(
    kept: dict[str, Any],
    matchers: Sequence[StereoMatcher],
    camera: Camera,
    calibration: Calibration | None,
    message: Frame,
) -> bytes:
    """Return the maps of a frame, or that it is frozen.

    Parameters
    ----------
    kept
        Gets the latest pair and its maps, which the page shows when it is drawn again.
    matchers
        Those of the methods shown.
    camera
        How both views stand in a frame.
    calibration
        That of the camera, at any size; with a rig, each frame is rectified.
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
    # Each visitor's last frame stays in memory: not the right view and the scores, of which the page shows nothing.
    kept["pair"] = replace(_stand_in(), left=left.copy(), right=_nothing(*left.shape[:2]), calibration=calibration)
    kept["results"] = [one.without_scores() for one in results]
    parts = [_map(one) for one in results]
    return packed_item({"shape": [rows, cols, len(parts)], "digest": "live"}, parts).data


def _map(result: DisparityMap) -> bytes:
    title = result.settings.title
    picture = Picture(title, None, (Reading(result.disparity, unit="px", digits=1),))
    return packed(picture, {"kind": "preview", "name": KEY, "title": title, "live": True}).data


def _freeze(stream: Stream, calibration: Calibration | None) -> None:
    """Make the frame that was frozen the visitor's own pair."""
    left, right = stream.kept.pop("frozen", (None, None))
    if left is None or right is None:
        return
    if calibration is not None and calibration.rig is None:
        calibration = calibration_for(calibration, left.shape[1], left.shape[0])
    said = f"a frame of the camera, frozen at {time.strftime('%H:%M:%S')}"
    transfer(StereoFrame(left, right), f"frozen {time.time_ns()}", said, calibration)


def transfer(
    frame: StereoFrame,
    digest: str,
    description: str,
    calibration: Calibration | None,
    search: tuple[int, int | None] = (0, None),
) -> None:
    """Make the depth page start with this frame; its controls must not have been drawn yet in this run."""
    pair = Pair(
        *as_stereo_pair(frame.left, frame.right),
        PairId(digest),
        truth=frame.truth,
        calibration=calibration,
        min_disparity=search[0],
        num_disparities=search[1],
        description=description,
    )
    st.session_state.update({HANDED: pair, PAIR: OWN})


# A slider that is moved

PREVIEWED_PIXELS = 80_000
"""Images are reduced to about this many pixels while a slider is dragged."""


class MovedSlider(Message):
    """A slider's class and value; whether the whole map is asked for, as it is not being dragged."""

    slider: str
    value: int | float
    whole: bool


def follow_sliders(pair: Pair) -> None:
    """Show the map of a slider as soon as it is moved; the run of the page brings the same map, and all else."""
    stream = open_stream("sliders", MovedSlider, in_this_session(partial(moved_map, pair)), brief=True)
    component("sliders")(key="depth.sliders", data=address_of(stream))


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
    named = replace(pair.id, size=f"{pair.id.size} dragged 1/{divisor}")
    small = remembered(
        "smaller pair", lambda: replace(resized(pair, divisor), id=named), **kept_for(pair, str(divisor))
    )
    result = computed_at_once(**computation(small, scaled_settings(matcher, 1 / divisor)))
    if result is None:
        return packed_item(header).data
    disparity = result.disparity * divisor
    of = Number("Preview", f"1/{divisor} size", "The map itself is computed when the slider is released.")
    judged = () if small.truth is None else errors(evaluate(disparity, small.truth * divisor))
    header["figures"] = [one._asdict() for one in (of, *shares(result), *judged)]
    return packed_item(header, [packed(Picture(matcher.title, None, (Reading(disparity, digits=1),))).data]).data
