"""Calibration with a live camera, which takes a pair whenever the board is held still in a new pose it asked for."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import Any, NamedTuple, TypeAlias, cast

import cv2
import numpy as np
import streamlit as st

from stereolag.assess.layout import Layout, views
from stereolag.core.arrays import DoubleMap, EightBit
from stereolag.core.inputs import as_grey
from stereolag.geometry.board_samples import MIN_FRAME_GAP_S, Collected, Missing, board_pose, is_still
from stereolag.geometry.boards import Board, Corners, find_boards, find_in_live_frame, guess_charuco, guess_chessboard
from stereolag.geometry.camera_fits import MIN_PAIRS
from stereolag.io.sources import MAX_BYTES
from stereolag.ui.calibrate import FILES, KEY, board_in_words, matched
from stereolag.ui.components import component, packed_item
from stereolag.ui.depth.live import ask_arrangement
from stereolag.ui.depth.sentences import CAMERAS, LIVE_CAMERA_WORDS
from stereolag.ui.navigation import bench, fragment
from stereolag.ui.streams import Message, connected, frame, open_stream
from stereolag.ui.uploads import OWN, hand_in

FRAMES_TO_AGREE = 3
"""Number of successive frames that must show the same board for it to be accepted."""

MAX_RECENT_SIGHTINGS = 30
"""Number of sightings of the board kept to estimate its speed, whatever their times."""

LIVE_WORDS = {
    "start": "Start the camera",
    "off": "It takes a picture whenever the board is still. Nothing is recorded or sent before you start.",
    "finish": "Calibrate with these",
    "restart": "Start over",
    "picture": "Picture covered",
    "size": "Held close",
    "tilt": "Tilted",
    "none": "No picture taken yet",
    "one": "1 pair taken",
    "several": "{count} pairs taken",
    "shown": "Both views, with the corners of the board and the parts where it has been",
}

UNKNOWN = "Show a whole chessboard or ChArUco board, in both views."
NOT_SEEN = {
    (False, False): "The board is visible in neither view.",
    (False, True): "The board is not visible in the left view.",
    (True, False): "The board is not visible in the right view.",
}
NEXT = {
    Missing.UPPER_LEFT: "Hold the board at the upper left of the picture.",
    Missing.TOP: "Hold the board at the upper border of the picture.",
    Missing.UPPER_RIGHT: "Hold the board at the upper right of the picture.",
    Missing.LEFT: "Hold the board at the left border of the picture.",
    Missing.MIDDLE: "Hold the board in the middle of the picture.",
    Missing.RIGHT: "Hold the board at the right border of the picture.",
    Missing.LOWER_LEFT: "Hold the board at the lower left of the picture.",
    Missing.BOTTOM: "Hold the board at the lower border of the picture.",
    Missing.LOWER_RIGHT: "Hold the board at the lower right of the picture.",
    Missing.NEARER: "Hold the board nearer.",
    Missing.LEFT_NEARER: "Tilt the board: bring the side on the left nearer.",
    Missing.RIGHT_NEARER: "Tilt the board: bring the side on the right nearer.",
    Missing.TOP_NEARER: "Tilt the board: bring its upper side nearer.",
    Missing.BOTTOM_NEARER: "Tilt the board: bring its lower side nearer.",
    Missing.MORE: "A few more, each held differently.",
}


Places: TypeAlias = list[list[float]]
"""Places in a picture: column and row, as fractions of its width and height."""


class Shown(Message):
    """A small picture of both views and when it was taken, ms; or both views in full size, as image files."""

    parts: tuple[bytes] | tuple[bytes, bytes]
    at: float = 0.0


class Sighting(NamedTuple):
    """The corners of a board in both views, and when they were seen, ms."""

    at: float
    corners: tuple[Corners, Corners]


@dataclass(eq=False)
class Taking:
    """A visitor's board and the pairs taken of it so far.

    Attributes
    ----------
    board
        The board, once enough frames have shown the same one.
    guesses
        The boards that the last frames seem to show.
    recent
        The board in the last frames, as many as its speed is estimated from; empty once it leaves a view.
    collected
        The poses taken.
    files
        Both pictures of each pair, named as files to be uploaded.
    outlines
        Outlines of the board in both views of each pair.
    size
        Width and height of these pictures, px.
    full
        Whether the files together have reached the size limit of an upload.
    """

    board: Board | None = None
    guesses: list[Board] = field(default_factory=list)
    recent: list[Sighting] = field(default_factory=list)
    collected: Collected = field(default_factory=Collected)
    files: list[tuple[str, bytes]] = field(default_factory=list)
    outlines: list[list[Places]] = field(default_factory=list)
    size: tuple[int, int] | None = None
    full: bool = False

    @property
    def missing(self) -> list[Missing]:
        """Return the views still missing; none if no more pairs may be taken."""
        return [] if self.full else self.collected.missing()

    def answer(self, message: Shown) -> bytes:
        """Return the answer to a small picture, or to a pair in full size."""
        if len(message.parts) == 2:
            self._take(message.parts)
            return self._answer()
        left, right = (as_grey(view) for view in views(frame(message.parts[0]), Layout.BESIDE))
        board = self.board = self.board or self._guess(left, right)
        if board is None:
            return self._answer()
        size = left.shape[1], left.shape[0]
        first, second = find_in_live_frame(left, board), find_in_live_frame(right, board)
        corners = [[] if one is None else _fractions(one.points, size) for one in (first, second)]
        if first is None or second is None:
            self.recent = []
            return self._answer(NOT_SEEN[first is not None, second is not None], corners)
        is_still = self._is_still(Sighting(message.at, (first, second)), board, size[0])
        if not self.missing or not self.collected.is_new(board_pose(first, second, board, size)):
            return self._answer("", corners)
        return self._answer("" if is_still else "Hold it still …", corners, want=is_still)

    def _is_still(self, now: Sighting, board: Board, width: int) -> bool:
        """Record a sighting, and return whether the board has hardly moved since an earlier one."""
        before = [one for one in self.recent if now.at - one.at >= 1000 * MIN_FRAME_GAP_S]
        self.recent = [*self.recent[max(0, len(before) - 1) :][-MAX_RECENT_SIGHTINGS:], now]
        if not before:
            return False
        seconds = (now.at - before[-1].at) / 1000
        views = zip(now.corners, before[-1].corners, strict=True)
        return all(is_still(*view, board, width, seconds) for view in views)

    def _guess(self, left: EightBit, right: EightBit) -> Board | None:
        """Return the board, once the last frames have all shown the same one."""
        guess = guess_charuco([left, right]) or guess_chessboard([left, right], thorough=False)
        self.guesses = [] if guess is None else [*self.guesses, guess][-FRAMES_TO_AGREE:]
        # The size of the markers is measured anew in each frame, so it may differ.
        kinds = {replace(one, markers=one.markers and replace(one.markers, share=0.5)) for one in self.guesses}
        return guess if len(self.guesses) == FRAMES_TO_AGREE and len(kinds) == 1 else None

    def _take(self, pictures: tuple[bytes, bytes]) -> None:
        """Take both pictures of a pair, if they show the board in a new way."""
        if self.board is None or not self.missing:
            return
        found = find_boards([(frame(pictures[0]), frame(pictures[1]))], self.board)
        size = self.size or found.size
        if set(found.sizes[0]) != {size}:
            raise ValueError(
                "These pictures differ in size from those taken before: start over, or choose the previous camera."
            )
        self.full = sum(map(len, [*pictures, *(data for _, data in self.files)])) > MAX_BYTES
        if not found.both or self.full:
            return
        left, right = found.both[0]
        pose = board_pose(left, right, self.board, size)
        if not self.collected.is_new(pose):
            return
        self.size = size
        self.collected.keep(pose, left, right, size)
        number = len(self.collected.poses)
        self.files += [(f"{side}{number:02}.jpg", data) for side, data in zip(("left", "right"), pictures, strict=True)]
        hulls = (cv2.convexHull(one.points.astype(np.float32))[:, 0].astype(np.float64) for one in (left, right))
        self.outlines.append([_fractions(hull, size) for hull in hulls])

    def taken(self) -> dict[str, Any]:
        """Return the state of the pairs taken so far, for the panel."""
        missing = self.missing
        count = len(self.collected.poses)
        return {
            "said": UNKNOWN if self.board is None else NEXT[missing[0]] if missing else "Enough: calibrating …",
            "board": "" if self.board is None else board_in_words(self.board),
            "outlines": self.outlines,
            "progress": self.collected.progress(),
            "count": count,
            "ready": count >= MIN_PAIRS,
            "enough": not missing,
        }

    def _answer(self, said: str = "", corners: Sequence[Places] = (), want: bool = False) -> bytes:
        """Return an answer: what to do next, the corners in both views, and whether the pair is wanted in full size."""
        taken = self.taken()
        return packed_item(
            {
                **taken,
                "said": f"{said} {taken['said']}".strip(),
                "corners": corners,
                "wanted": want,
                "digest": "boards",
            }
        ).data


def _fractions(places: DoubleMap, size: tuple[int, int]) -> Places:
    """Return places in a picture, px, as fractions of its width and height, to four decimals."""
    return cast(Places, np.round((places + 0.5) / size, 4).tolist())


@fragment
def show_live() -> None:
    """Draw the camera; the pairs become the page's own files once there are enough, or when the visitor says so."""
    taking: Taking = st.session_state.setdefault(f"{KEY}.live", Taking())
    controls, result_place = bench()
    with controls:
        arrangement, crossed = ask_arrangement(f"{KEY}.camera", [name for name in CAMERAS if name != "moved"])
    with result_place:
        component("boards")(
            key=f"{KEY}.boards",
            data={
                **connected(open_stream(KEY, Shown, taking.answer), LIVE_CAMERA_WORDS | LIVE_WORDS),
                "arrangement": arrangement,
                "crossed": crossed,
                "taken": taking.taken(),
            },
            on_finished_change=_calibrate_with_these,
            on_restarted_change=_start_over,
        )
    if st.session_state[KEY] == OWN:
        st.rerun()


def _calibrate_with_these() -> None:
    """Make the pairs taken the page's own files."""
    taking: Taking = st.session_state[f"{KEY}.live"]
    if len(taking.collected.poses) < MIN_PAIRS:
        return
    hand_in([*taking.files], matched, f"The {len(taking.files) // 2} pairs that the camera took are in use.", key=FILES)
    st.session_state[KEY] = OWN
    if not taking.missing:
        _start_over()


def _start_over() -> None:
    st.session_state.pop(f"{KEY}.live", None)
