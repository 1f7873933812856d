"""A template followed from frame to frame of a camera: near its last place first, in the whole picture when lost.

The template stays as it was cut, and only its size and angle are kept up with, so that nothing creeps in over time.
Every frame is judged by itself, as any place is: :mod:`stereolag.templates.identity`.
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
from stereolag.templates.patterns import Pattern, in_grey, pattern_of, reduced, warped
from stereolag.templates.places import NOWHERE, Places, peaks, peaks_near
from stereolag.templates.poses import Pose, PoseRange
from stereolag.templates.score_maps import fft_score_map
from stereolag.templates.verdict import FAR_BELOW, reliable

State: TypeAlias = Literal["found", "partly_seen", "look_alikes", "lost"]
"""All of the template is there; some of it, where it must be by now; several places show it alike; none shows it."""

SIDE, COARSE_SIDE = 48, 20
"""Side of the template, the root of its area, px, in the reduced frame in which places are judged, and in the one in
which it is looked for when lost. Larger ones take more time and hardly tell more."""

LEAST_REACH = 12
"""Distance from the last place up to which the next is looked for first, px of the reduced frame, unless the template
is larger: then its side."""

MARGIN = 8
"""Px around all places near the last, one of which may be half outside the part that is searched."""

TRIED = 3
"""Places looked at in a frame, best first."""

SETTLED = 0.03
"""Px by which the corners of a place still move at the end of its alignment: the next frame is aligned anew."""

BELIEVED, STAYING, AS_BEFORE = 8, 1, 0.02
"""Frames for which a place that was looked at and is not the lost template need not be looked at again, while it is as
many px from where it was at most, and scores no more differently than this."""

CLOSE = 0.5
"""Farthest that the template moves in a frame, in its sides, while a part only is seen or a look-alike is near."""

CLOSER, LEAST_EXPLAINED, LEAST_AGREEING = 0.25, 0.9, 0.85
"""The same where it differs in some blocks, as with a reflection in it; and how much of a place it must then explain,
and how many blocks must agree. Farther away, a sibling that covers it does that."""

RESIZED, TURNED = 0.01, 1.0
"""Steps of size, a logarithm, and of angle, degrees, in which the template is warped."""

SMALLEST, LARGEST = 0.3, 3.0
"""Sizes down and up to which the template is followed, over its own."""

MOST_WARPED = 32
"""Warped templates kept."""


@dataclass(frozen=True)
class Followed:
    """Where a template is in a frame.

    Parameters
    ----------
    state
        What is known of it.
    place
        Its middle, size and angle in the frame; None if it is lost, or may be at several places.
    score
        Correlation there, or at the place most like it; None if no place was looked at.
    near
        Whether it was looked for near its last place only.
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
        Its middle in that frame, px.

    Raises
    ------
    ValueError
        A template of one value.
    """

    def __init__(self, template: Image, row: float, col: float) -> None:
        self._template = pattern_of(template, np.ones(template.shape[:2]))
        self._drawn = lru_cache(MOST_WARPED)(partial(_drawn, self._template))
        self._last = Pose(row, col, 1.0, 0.0, 1.0)
        self._lost = 0
        self._refuted: list[_Refuted] = []

    def follow(self, frame: Image, query: TemplateQuery) -> Followed:
        """Return where the template is in the next frame.

        Parameters
        ----------
        frame
            (rows, cols, channels), of the template's channels and dtype.
        query
            "sampled" compares exact pixels, the other methods all places. A lost template is also looked for at the
            sizes and angles asked for, at one of them in each frame.
        """
        followed = self._by_pixels(frame, query) if query.method == "sampled" else self._by_scores(frame, query)
        self._lost = self._lost + 1 if followed.place is None else 0
        self._refuted = [
            one._replace(believed=one.believed - 1) for one in self._refuted if self._lost and one.believed > 1
        ]
        self._last = followed.place or self._last
        return followed

    def _by_pixels(self, frame: Image, query: TemplateQuery) -> Followed:
        places, _ = exact_positions(frame, self._template, query.min_score, None, silent)
        view = _View(frame, self._template, (1.0, 0.0), self._refuted)
        return view.judged(places, query.min_score, None if self._lost else self._last)

    def _by_scores(self, frame: Image, query: TemplateQuery) -> Followed:
        pose = self._last.scale, self._last.rotation
        near = None if self._lost else self._view(frame, pose, self._last)
        if near is not None:
            followed = _near(near, self._last, query.min_score)
            if followed.place is not None:
                return followed
        if self._lost % 2:  # it may come back as it was cut, or at another of the sizes and angles asked for
            others = _poses(query, self._template.shape)
            pose = others[self._lost // 2 % len(others)]
        view = self._view(frame, pose)
        return Followed("lost", None, None, near=False) if view is None else _anywhere(view, query.min_score)

    def _view(self, frame: Image, pose: tuple[float, float], last: Pose | None = None) -> _View | None:
        """Return the frame as small as the template of that size and angle is judged in; None if it does not fit.

        Only what is needed around the last place, if there is one: reducing all of it takes as long as searching there.
        """
        size = min(max(pose[0], SMALLEST), LARGEST)
        scale = math.exp(RESIZED * round(math.log(size) / RESIZED))
        rotation = TURNED * round(pose[1] / TURNED)
        factor = max(1.0, scale * math.sqrt(math.prod(self._template.shape)) / SIDE)
        pattern = self._drawn(scale / factor, rotation)
        if pattern is None:
            return None
        top = left = 0
        if last is not None:
            half = factor * (_reach(pattern) + max(pattern.shape) + MARGIN)
            top, left = (max(0, math.floor(at - half)) for at in (last.row, last.col))
            frame = frame[top : math.ceil(last.row + half), left : math.ceil(last.col + half)]
        image = reduced(frame, factor) if factor > 1 else frame
        if any(side > length for side, length in zip(pattern.shape, image.shape, strict=False)):
            return None
        down, across = (whole / part for whole, part in zip(frame.shape[:2], image.shape[:2], strict=True))
        return _View(image, pattern, (scale, rotation), self._refuted, (top, left), down, across)


def _drawn(template: Pattern, scale: float, rotation: float) -> Pattern | None:
    """Return a template resized and turned; upright without its rim, which counts less: then all of it does alike."""
    if (scale, rotation) == (1.0, 0.0):
        return template
    pattern = warped(template, scale, rotation)
    if pattern is None or rotation:
        return pattern
    rim = int((pattern.weights < 1).any())
    inner = slice(rim, -rim or None)
    try:
        return pattern_of(pattern.colours[inner, inner], pattern.weights[inner, inner] > 0)
    except ValueError:
        return None


def _poses(query: TemplateQuery, shape: tuple[int, int]) -> list[tuple[float, float]]:
    """Return the template's own size and angle, and the others asked for."""
    scales, rotations = query.arguments["scales"], query.arguments["rotations"]
    asked = PoseRange(scales or (1.0, 1.0), rotations or (0.0, 0.0)).grid(shape)
    return list(dict.fromkeys([(1.0, 0.0), *asked]))


class _Seen(NamedTuple):
    """A place in an image that was looked at."""

    row: int
    col: int
    shown: Identity


class _Refuted(NamedTuple):
    """A place in an image that did not show the lost template, resized and turned so, and how long to believe that."""

    pose: tuple[float, float]
    row: int
    col: int
    score: float
    believed: int


class _View:
    """A frame at the size in which it is searched, and the template at the size and angle it has there.

    Parameters
    ----------
    image
        The frame, or a part of it, reduced.
    pattern, pose
        The template in the image, and its size and angle in the frame.
    refuted
        The places of the last frames that are not the lost template; those of this one are added.
    origin, down, across
        Pixel of the frame at the top left of the image; and pixels of the frame in one of the image.
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
        self._looked_at: list[_Seen] = []

    def corner(self, place: Pose) -> tuple[int, int]:
        """Return the top-left pixel, in the image, of the template with its middle at a place of the frame."""
        (height, width), row, col = self.pattern.shape, place.row - self._top, place.col - self._left
        return round(row / self._down - height / 2), round(col / self._across - width / 2)

    def judged(self, places: Places, min_score: float, last: Pose | None) -> Followed:
        """Return what the best of some places in the image show.

        Parameters
        ----------
        places
            The places.
        min_score
            Least score of a place.
        last
            Where the template was in the frame before; None if it was not seen there: then it must be seen whole.
        """
        enough = np.flatnonzero(places.scores >= min_score)
        seen: list[_Seen] = []
        scores: list[float] = []
        best: float | None = None
        for one in islice(places.in_order(share=0.5, left=enough), TRIED):
            row, col, score = int(places.rows[one]), int(places.cols[one]), float(places.scores[one])
            best = score if best is None else best
            if any(before.shown.is_template for before in seen) and score < best - FAR_BELOW:
                break
            if last is None and self._is_refuted(row, col, score):
                continue
            scores.append(score)
            seen.append(self._look_at(row, col))
            if last is None and not seen[-1].shown.is_template:
                self._refuted.append(_Refuted(self._pose, row, col, score, BELIEVED))
        whole = [number for number, place in enumerate(seen) if place.shown.is_template]
        close = [number for number, place in enumerate(seen) if self._is_close(place, last, CLOSE)]
        found = reliable([(number, seen[number].shown) for number in whole], 1)
        on_path = [number for number in close if number in whole or self._is_partly_seen(seen[number], last)]
        state: State = "look_alikes" if whole else "partly_seen" if on_path else "lost"
        if found and (found[0] in close or not set(close) & set(whole)):
            state, on_path = "found", found
        place = self._pose_of(seen[on_path[0]], scores[on_path[0]]) if on_path else None
        return Followed(state, place, place.score if place else best, near=last is not None)

    def _is_refuted(self, row: int, col: int, score: float) -> bool:
        """Return whether a place was looked at in one of the last frames, and is as it was."""
        return any(
            one.pose == self._pose
            and max(abs(one.row - row), abs(one.col - col)) <= STAYING
            and abs(one.score - score) <= AS_BEFORE
            for one in self._refuted
        )

    def _look_at(self, row: int, col: int) -> _Seen:
        """Return what is at a place; a pixel beside one that was looked at it is the same."""
        for seen in self._looked_at:
            if abs(seen.row - row) <= 1 and abs(seen.col - col) <= 1:
                return seen
        shown = identity(self.image, self.pattern, row, col, posed=True, settled=SETTLED)
        self._looked_at.append(_Seen(row, col, shown))
        return self._looked_at[-1]

    def _is_close(self, seen: _Seen, last: Pose | None, sides: float) -> bool:
        """Return whether a place is where one that moves on from the last, by at most so many sides, can be."""
        if last is None:
            return False
        row, col = self.corner(last)
        return math.hypot(seen.row - row, seen.col - col) <= sides * max(self.pattern.shape)

    def _is_partly_seen(self, seen: _Seen, last: Pose | None) -> bool:
        """Return whether a place close to the last shows enough of the template."""
        shown = seen.shown
        if shown.kind != "differs":
            return shown.kind == "partly_covered"
        enough = shown.explained >= LEAST_EXPLAINED and np.array(shown.blocks).mean() >= LEAST_AGREEING
        return bool(enough) and self._is_close(seen, last, CLOSER)

    def _pose_of(self, seen: _Seen, score: float) -> Pose:
        """Return where in the frame the template is, to a part of a pixel; only one seen whole tells size and angle."""
        down, right, size, angle = seen.shown.moved
        height, width = self.pattern.shape
        scale, rotation = self._pose
        if seen.shown.is_template:
            scale, rotation = scale * math.exp(size), rotation - math.degrees(angle)
        return Pose(
            self._top + (seen.row + height / 2 + down) * self._down,
            self._left + (seen.col + width / 2 + right) * self._across,
            scale,
            rotation,
            score,
        )


def _near(view: _View, last: Pose, min_score: float) -> Followed:
    """Look for the template near its last place, and if it is not there for what is left of one that is covered."""
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
    """Return the distance from the last place up to which a template is looked for first, px."""
    return max(LEAST_REACH, *pattern.shape)


def _anywhere(view: _View, min_score: float) -> Followed:
    """Look for the template in the whole picture: in grey and small first, then where it may be."""
    image, pattern = view.image, view.pattern
    factor = max(1.0, math.sqrt(math.prod(pattern.shape)) / COARSE_SIDE)
    flat, grey = in_grey(image, pattern)
    little = reduced(flat, factor)
    small = _drawn(grey, 1 / factor, 0.0)
    if small is None or small.shape[0] > little.shape[0] or small.shape[1] > little.shape[1]:
        return Followed("lost", None, None, near=False)
    found = peaks(fft_score_map(little, small, silent), small.shape)
    down, across = image.shape[0] / little.shape[0], image.shape[1] / little.shape[1]
    near, reach = [], math.ceil(factor / 2) + 1
    for one in found.best(TRIED, share=0.5):
        row = round((found.rows[one] + small.shape[0] / 2) * down - pattern.shape[0] / 2)
        col = round((found.cols[one] + small.shape[1] / 2) * across - pattern.shape[1] / 2)
        places = peaks_near(image, pattern, row, col, (reach, reach))
        near += [(places.rows[best], places.cols[best], places.scores[best]) for best in places.best(1)]
    rows, cols, scores = np.array(near).reshape(-1, 3).T
    places = Places(rows.astype(np.intp), cols.astype(np.intp), scores, pattern.shape)
    return view.judged(places, min_score, None)
