"""The depth page with a live camera: maps of the running picture beside the controls, and a frozen frame as a pair."""

from __future__ import annotations

import threading
import time
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np
import streamlit as st

from stereolag.assess.layout import Layout, views
from stereolag.core.inputs import Image
from stereolag.geometry.calibration import Calibration
from stereolag.geometry.rectification import calibration_for, rectify
from stereolag.pair import Pair, PairId
from stereolag.stereo.matcher import DisparityMap, StereoMatcher
from stereolag.stereo.methods import METHODS
from stereolag.ui import keys, prose
from stereolag.ui.components import component, packed_item
from stereolag.ui.controls import DISPARITIES_AT_FIRST, matcher_as_set, persistent
from stereolag.ui.depth.maps import (
    COLUMNS,
    KEY,
    choose_maps,
    coloured_alike,
    live_picture,
    map_legends,
    show_controls,
    show_presets,
    shown_methods,
)
from stereolag.ui.depth.sentences import CAMERAS, LIVE_CAMERA_WORDS
from stereolag.ui.linked_pictures import Picture, Reading, linked_pictures, packed
from stereolag.ui.navigation import bench, fragment
from stereolag.ui.streams import Message, Stream, close_stream, connected, frame, open_stream
from stereolag.ui.uploads import OWN

CAMERA = "depth.camera"
WIDTHS = {"320 px": 320, "480 px": 480, "640 px": 640, "Full": 100_000}
FIRST_WIDTH = "640 px"


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
        "Width of a view", [*WIDTHS], default=FIRST_WIDTH, required=True, **persistent(f"{key}.width")
    )
    return Camera(arrangement, crossed, WIDTHS[width])


def ask_arrangement(key: str, arrangements: Sequence[str]) -> tuple[str, bool]:
    """Ask which of some of `CAMERAS` there is, and whether the right view comes first."""
    arrangement = st.selectbox(
        "Camera", arrangements, format_func=CAMERAS.__getitem__, **persistent(f"{key}.arrangement")
    )
    return arrangement, st.toggle("The right view comes first", **persistent(f"{key}.crossed"))


_stereo_camera = component("stereo_camera")


def stereo_camera(stream: Stream, camera: Camera, *, key: str, record: bool = False, **callbacks: Any) -> None:
    """Draw the component of a stereo camera, which sends its frames to a stream: all of them, or those it records."""
    data = {
        **connected(stream, LIVE_CAMERA_WORDS),
        "arrangement": camera.arrangement,
        "width": camera.width,
        "crossed": camera.crossed,
        "record": record,
    }
    _stereo_camera(key=key, data=data, **callbacks)


@dataclass(frozen=True)
class LiveCamera:
    """A live camera in place of a pair, and its calibration, if known."""

    calibration: Calibration | None


@fragment
def show_live(live: LiveCamera) -> None:
    """Draw the camera, the controls, and the maps of its latest frame; a moved control acts on the next frame."""
    if st.session_state.get(keys.HANDED) is not None:  # a frozen frame: the page goes on with it
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
        stream.answer = Answering(stream.kept, matchers, camera, calibration)
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
    blank = np.broadcast_to(np.uint8(0), (480, 640))  # takes no memory
    return Pair(blank, blank, PairId("live"), num_disparities=DISPARITIES_AT_FIRST)


_matching = threading.Lock()
"""Held while a frame is matched, which takes all cores: two at once are answered later than one after the other."""


class Frame(Message):
    """A picture with both views, and whether it is to be frozen in place of being matched."""

    parts: tuple[bytes]
    freeze: bool = False


class Answering:
    """Answers frames with the maps of some matchers.

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
    """

    def __init__(
        self,
        kept: dict[str, Any],
        matchers: Sequence[StereoMatcher],
        camera: Camera,
        calibration: Calibration | None,
    ) -> None:
        self._kept, self._matchers, self._camera, self._calibration = kept, matchers, camera, calibration

    def __call__(self, message: Frame) -> bytes:
        """Return the maps of a frame, or that it is frozen."""
        left, right = self._camera.views(frame(message.parts[0], grey=not message.freeze))
        if message.freeze:
            self._kept["frozen"] = left, right
            return packed_item({"frozen": time.monotonic()}).data
        pair = self._pair(left, right)
        with _matching:
            results = [matcher.compute(pair.left, pair.right) for matcher in self._matchers]
        # The page shows no scores, and the maps of each visitor's last frame stay in memory.
        self._kept["pair"], self._kept["results"] = pair, [one.without_scores() for one in results]
        parts = [self._map(one) for one in results]
        return packed_item({"shape": [*left.shape[:2], len(parts)], "digest": "live"}, parts).data

    def _pair(self, left: Image, right: Image) -> Pair:
        calibration = self._calibration
        if calibration is not None and calibration.rig is not None:
            left, right, calibration = rectify(left, right, calibration)
        elif calibration is not None:
            calibration = calibration_for(calibration, left.shape[1], left.shape[0])
        return replace(_stand_in(), left=left, right=right, calibration=calibration)

    def _map(self, result: DisparityMap) -> bytes:
        title = result.settings.title
        more: dict[str, Any] = {"kind": "preview", "name": KEY, "title": title, "live": True}
        return packed(Picture(title, None, (Reading(result.disparity, unit="px", digits=1),)), more).data


def _freeze(stream: Stream, calibration: Calibration | None) -> None:
    """Make the frame that was frozen the visitor's own pair."""
    left, right = stream.kept.pop("frozen", (None, None))
    if left is None or right is None:
        return
    if calibration is not None and calibration.rig is None:
        calibration = calibration_for(calibration, left.shape[1], left.shape[0])
    st.session_state[keys.HANDED] = Pair(
        left,
        right,
        PairId(f"frozen {time.time_ns()}"),
        calibration=calibration,
        description=f"a frame of the camera, frozen at {time.strftime('%H:%M:%S')}",
    )
    st.session_state[keys.PAIR] = OWN
