"""A template followed from frame to frame of a camera: searched near its last place first, everywhere when lost.

The template stays as it was cut, apart from its size and angle, so that it does not drift. Every frame is judged by
itself, like any place: :mod:`stereolag.templates.identity`.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import lru_cache, partial
from itertools import islice
from typing import Literal, NamedTuple, TypeAlias

import numpy as np

from stereolag.core.inputs import Image
from stereolag.core.jobs import silent
from stereolag.core.searches import TemplateQuery
from stereolag.templates.exact_pixels import exact_positions
from stereolag.templates.hidden_parts import hidden_places
from stereolag.templates.identity import Identity, identity
from stereolag.templates.patterns import Pattern, in_grey, pattern_of, reduced, warped, without_rim
from stereolag.templates.places import NOWHERE, Places, peaks, peaks_near
from stereolag.templates.poses import Pose, PoseRange
from stereolag.templates.score_maps import fft_score_map
from stereolag.templates.verdict import MAX_BELOW_BEST, reliable

State: TypeAlias = Literal["found", "partly_seen", "look_alikes", "lost"]
"""All of the template is visible; a part is, near its last place; several places show it equally well; none does."""

REDUCED_SIDE_PX = 48
"""Side of the template, the root of its area, in the reduced frame in which places are judged: larger ones take more
time and hardly judge better."""

COARSE_SIDE_PX = 20
"""The same in the smaller frame that is searched when the template is lost."""

MIN_REACH_PX = 12
"""Distance from the last place, in the reduced frame, that is searched first; for a larger template, its side."""

MARGIN_PX = 8
"""Margin around all places near the last one, which may be half outside the part that is searched."""

MAX_COMPARED = 3
"""Places compared with the template in a frame, best first."""

TRACKING_TOLERANCE_PX = 0.03
"""The alignment of a place ends once a step moves no corner by more: the next frame is aligned anew."""

REFUTED_FRAMES = 8
"""Frames for which a place that was not the lost template is not compared again, while it and its score stay."""

MAX_MOVE = 0.5
"""Largest move of the template in a frame, in its sides, while only a part is visible or a look-alike is near."""

MAX_MOVE_DIFFERING = 0.25
"""The same while it differs in some blocks, as under a reflection: farther away, a sibling that covers it does too."""

LOG_SIZE_STEP = 0.01
"""Step of the logarithm of the size in which the template is warped."""

ANGLE_STEP = 1.0
"""Step of the angle in which the template is warped, degrees."""

MIN_SIZE, MAX_SIZE = 0.3, 3.0
"""Sizes between which the template is followed, over its own."""


@dataclass(frozen=True)
class Followed:
    """The place of a template in a frame.

    Parameters
    ----------
    state
        See :data:`State`.
    place
        Its centre, size and angle in the frame; None if it is lost, or may be at several places.
    score
        Correlation there, or else at the best place; None if no place was compared.
    near
        Whether only the surroundings of its last place were searched.
    """

    state: State
    place: Pose | None
    score: float | None
    near: bool


class Follower:
    """A template that is followed through frames.

    Parameters
    ----------
    template
        (height, width, channels), as cut from a frame.
    row, col
        Its centre in that frame, px.

    Raises
    ------
    ValueError
        A constant template.
    """

    def __init__(self, template: Image, row: float, col: float) -> None:
        self._template = pattern_of(template, np.ones(template.shape[:2]))
        self._posed = lru_cache(32)(partial(_posed, self._template))
        self._last = Pose(row, col, 1.0, 0.0, 1.0)
        self._frames_lost = 0
        self._refuted: list[_Refuted] = []

    def follow(self, frame: Image, query: TemplateQuery) -> Followed:
        """Return the place of the template in the next frame.

        Parameters
        ----------
        frame
            (rows, cols, channels), of the template's channels and dtype.
        query
            "sampled" compares exact pixels, the other methods all places. A lost template is also searched at the sizes
            and angles asked for, one of them in each frame.
        """
        followed = self._by_pixels(frame, query) if query.method == "sampled" else self._by_scores(frame, query)
        self._frames_lost = self._frames_lost + 1 if followed.place is None else 0
        self._refuted = [
            place._replace(frames_left=place.frames_left - 1)
            for place in self._refuted
            if self._frames_lost and place.frames_left > 1
        ]
        self._last = followed.place or self._last
        return followed

    def _by_pixels(self, frame: Image, query: TemplateQuery) -> Followed:
        if not self._template.fits(frame):
            return Followed("lost", None, None, near=False)
        places, _ = exact_positions(frame, self._template, query.min_score, None, silent)
        view = _View(frame, self._template, (1.0, 0.0), self._refuted)
        return view.judged(places, query.min_score, None if self._frames_lost else self._last)

    def _by_scores(self, frame: Image, query: TemplateQuery) -> Followed:
        pose = self._last.scale, self._last.rotation
        near = None if self._frames_lost else self._view(frame, pose, self._last)
        if near is not None:
            followed = _search_near(near, self._last, query.min_score)
            if followed.place is not None:
                return followed
        if self._frames_lost % 2:  # it may come back as it was cut, or at another of the sizes and angles asked for
            others = _searched_poses(query, self._template.shape)
            pose = others[self._frames_lost // 2 % len(others)]
        view = self._view(frame, pose)
        return Followed("lost", None, None, near=False) if view is None else _search_everywhere(view, query.min_score)

    def _view(self, frame: Image, pose: tuple[float, float], last: Pose | None = None) -> _View | None:
        """Return the frame, reduced, with the template of that size and angle; None if it does not fit.

        With a last place, only the part around it: to reduce the whole frame takes as long as to search there.
        """
        size = min(max(pose[0], MIN_SIZE), MAX_SIZE)
        scale = math.exp(LOG_SIZE_STEP * round(math.log(size) / LOG_SIZE_STEP))
        rotation = ANGLE_STEP * round(pose[1] / ANGLE_STEP)
        factor = max(1.0, scale * math.sqrt(math.prod(self._template.shape)) / REDUCED_SIDE_PX)
        pattern = self._posed(scale / factor, rotation)
        if pattern is None:
            return None
        top = left = 0
        if last is not None:
            half = factor * (_reach(pattern) + max(pattern.shape) + MARGIN_PX)
            top, left = (max(0, math.floor(at - half)) for at in (last.row, last.col))
            frame = frame[top : math.ceil(last.row + half), left : math.ceil(last.col + half)]
        image = reduced(frame, factor) if factor > 1 else frame
        if not pattern.fits(image):
            return None
        down, across = (before / after for before, after in zip(frame.shape[:2], image.shape[:2], strict=True))
        return _View(image, pattern, (scale, rotation), self._refuted, (top, left), down, across)


def _posed(template: Pattern, scale: float, rotation: float) -> Pattern | None:
    """Return a template resized and rotated; if upright, without its rim of lower weight, so that all weights are 1."""
    if (scale, rotation) == (1.0, 0.0):
        return template
    pattern = warped(template, scale, rotation)
    if pattern is None or rotation:
        return pattern
    return without_rim(pattern, int((pattern.weights < 1).any()))


def _searched_poses(query: TemplateQuery, shape: tuple[int, int]) -> list[tuple[float, float]]:
    """Return the template's own size and angle, and the others asked for."""
    scales, rotations = query.arguments["scales"], query.arguments["rotations"]
    asked = PoseRange(scales or (1.0, 1.0), rotations or (0.0, 0.0)).grid(shape)
    return list(dict.fromkeys([(1.0, 0.0), *asked]))


class _Compared(NamedTuple):
    """A place in an image that was compared with the template."""

    row: int
    col: int
    shown: Identity


class _Refuted(NamedTuple):
    """A place in an image that did not show the lost template at that pose, and the frames for which it is skipped."""

    pose: tuple[float, float]
    row: int
    col: int
    score: float
    frames_left: int


class _View:
    """A frame at the resolution at which it is searched, and the template at the size and angle it has there.

    Parameters
    ----------
    image
        The frame, or a part of it, reduced.
    pattern, pose
        The template in the image, and its size and angle in the frame.
    refuted
        The places of the last frames that are not the lost template; those of this frame are added.
    origin, down, across
        Pixel of the frame at the top left of the image; and frame pixels per image pixel.
    """

    def __init__(
        self,
        image: Image,
        pattern: Pattern,
        pose: tuple[float, float],
        refuted: list[_Refuted],
        origin: tuple[int, int] = (0, 0),
        down: float = 1.0,
        across: float = 1.0,
    ) -> None:
        self.image = image
        self.pattern = pattern
        self._pose = pose
        self._refuted = refuted
        self._top, self._left = origin
        self._down, self._across = down, across
        self._compared: list[_Compared] = []

    def corner(self, place: Pose) -> tuple[int, int]:
        """Return the top-left pixel, in the image, of the template centred at a place of the frame."""
        (height, width), row, col = self.pattern.shape, place.row - self._top, place.col - self._left
        return round(row / self._down - height / 2), round(col / self._across - width / 2)

    def judged(self, places: Places, min_score: float, last: Pose | None) -> Followed:
        """Return the state and place of the template from the best of some places in the image.

        Parameters
        ----------
        places
            The places.
        min_score
            Least score of a place.
        last
            Place in the frame before; None if the template was not visible there: then all of it must be visible.
        """
        enough = np.flatnonzero(places.scores >= min_score)
        compared: list[_Compared] = []
        scores: list[float] = []
        best: float | None = None
        for index in islice(places.in_order(share=0.5, among=enough), MAX_COMPARED):
            row, col, score = *places.corner(index), float(places.scores[index])
            best = score if best is None else best
            if any(before.shown.is_template for before in compared) and score < best - MAX_BELOW_BEST:
                break
            if last is None and self._is_refuted(row, col, score):
                continue
            scores.append(score)
            compared.append(self._compare(row, col))
            if last is None and not compared[-1].shown.is_template:
                self._refuted.append(_Refuted(self._pose, row, col, score, REFUTED_FRAMES))
        whole = [number for number, place in enumerate(compared) if place.shown.is_template]
        close = [number for number, place in enumerate(compared) if self._is_close(place, last, MAX_MOVE)]
        found = reliable([(number, compared[number].shown) for number in whole], 1)
        on_path = [number for number in close if number in whole or self._is_partly_seen(compared[number], last)]
        state: State = "look_alikes" if whole else "partly_seen" if on_path else "lost"
        if found and (found[0] in close or not set(close) & set(whole)):
            state, on_path = "found", found
        place = self._pose_of(compared[on_path[0]], scores[on_path[0]]) if on_path else None
        return Followed(state, place, place.score if place else best, near=last is not None)

    def _is_refuted(self, row: int, col: int, score: float) -> bool:
        """Return whether a place was refuted in one of the last frames, and has hardly changed."""
        return any(
            refuted.pose == self._pose
            and max(abs(refuted.row - row), abs(refuted.col - col)) <= 1
            and abs(refuted.score - score) <= 0.02
            for refuted in self._refuted
        )

    def _compare(self, row: int, col: int) -> _Compared:
        """Return the comparison of a place with the template, or of one at most a pixel away if there was one."""
        for before in self._compared:
            if abs(before.row - row) <= 1 and abs(before.col - col) <= 1:
                return before
        shown = identity(self.image, self.pattern, row, col, refine_pose=True, tolerance_px=TRACKING_TOLERANCE_PX)
        self._compared.append(_Compared(row, col, shown))
        return self._compared[-1]

    def _is_close(self, place: _Compared, last: Pose | None, sides: float) -> bool:
        """Return whether a place is within `sides` sides of the template of the last one."""
        if last is None:
            return False
        row, col = self.corner(last)
        return math.hypot(place.row - row, place.col - col) <= sides * max(self.pattern.shape)

    def _is_partly_seen(self, place: _Compared, last: Pose | None) -> bool:
        """Return whether a place close to the last shows enough of the template."""
        shown = place.shown
        if shown.kind != "differs":
            return shown.kind == "partly_covered"
        enough = shown.explained >= 0.9 and np.array(shown.blocks).mean() >= 0.85
        return bool(enough) and self._is_close(place, last, MAX_MOVE_DIFFERING)

    def _pose_of(self, place: _Compared, score: float) -> Pose:
        """Return the pose of the template in the frame; size and angle change only if all of it is visible."""
        down, right, log_size, angle = place.shown.motion
        height, width = self.pattern.shape
        scale, rotation = self._pose
        if place.shown.is_template:
            scale, rotation = scale * math.exp(log_size), rotation - math.degrees(angle)
        return Pose(
            self._top + (place.row + height / 2 + down) * self._down,
            self._left + (place.col + width / 2 + right) * self._across,
            scale,
            rotation,
            score,
        )


def _search_near(view: _View, last: Pose, min_score: float) -> Followed:
    """Search for the template near its last place, and if it is not there, for its visible part."""
    (height, width), (row, col) = view.pattern.shape, view.corner(last)
    reach = _reach(view.pattern)
    followed = view.judged(peaks_near(view.image, view.pattern, row, col, (reach, reach)), min_score, last)
    if followed.place is not None:
        return followed
    top, left = max(0, row - reach), max(0, col - reach)
    window = view.image[top : row + height + reach, left : col + width + reach]
    hidden = hidden_places(window, view.pattern, silent) if window.size else NOWHERE
    return view.judged(hidden.moved(top, left), min_score, last)


def _reach(pattern: Pattern) -> int:
    """Return the distance from the last place that is searched first, px."""
    return max(MIN_REACH_PX, *pattern.shape)


def _search_everywhere(view: _View, min_score: float) -> Followed:
    """Search for the template in the whole frame: reduced and in grey first, then around the best places."""
    image, pattern = view.image, view.pattern
    factor = max(1.0, math.sqrt(math.prod(pattern.shape)) / COARSE_SIDE_PX)
    grey_image, grey = in_grey(image, pattern)
    coarse = reduced(grey_image, factor)
    small = _posed(grey, 1 / factor, 0.0)
    if small is None or not small.fits(coarse):
        return Followed("lost", None, None, near=False)
    found = peaks(fft_score_map(coarse, small, silent), small.shape)
    down, across = image.shape[0] / coarse.shape[0], image.shape[1] / coarse.shape[1]
    refined, reach = [], math.ceil(factor / 2) + 1
    for index in found.best(MAX_COMPARED, share=0.5):
        row = round((found.rows[index] + small.shape[0] / 2) * down - pattern.shape[0] / 2)
        col = round((found.cols[index] + small.shape[1] / 2) * across - pattern.shape[1] / 2)
        places = peaks_near(image, pattern, row, col, (reach, reach))
        refined += [(places.rows[best], places.cols[best], places.scores[best]) for best in places.best(1)]
    rows, cols, scores = np.array(refined).reshape(-1, 3).T
    places = Places(rows.astype(np.intp), cols.astype(np.intp), scores, pattern.shape)
    return view.judged(places, min_score, None)
