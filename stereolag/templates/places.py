"""Scored places of a template, which of them overlap, and the peaks of a score map."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property, partial
from itertools import islice

import numpy as np
import numpy.typing as npt

from stereolag.core.arrays import Array, Indices
from stereolag.core.inputs import Image
from stereolag.core.jobs import silent
from stereolag.loops.bands import in_threads
from stereolag.loops.compilation import compiled
from stereolag.templates.patterns import Pattern, warped_shape
from stereolag.templates.score_maps import Plane, ScoreMap, fft_score_map

PLACES_AT_ONCE = 2**19
"""Places of a score map searched for peaks at a time: enough to be worth a thread, and the copies stay small."""

PEAKS_AT_ONCE = 256
"""Peaks, best first, compared with those already chosen: mostly enough for all that are wanted."""

_LOWEST = np.float32(-2.0)
"""Below every score."""


@dataclass(frozen=True)
class Places:
    """Scored positions of a template.

    Parameters
    ----------
    rows, cols, scores
        One for each position, a top-left pixel; no score is NaN.
    shape
        Height and width of the template, px.
    poses
        Scale and rotation at each position, None if the template is searched only as given. The position is then the
        top-left pixel of the upright box around it.
    """

    rows: Indices
    cols: Indices
    scores: Plane
    shape: tuple[int, int]
    poses: list[tuple[float, float]] | None = None

    def best(
        self, count: int, *, share: float = 0.0, taken: Sequence[int] = (), left: Indices | None = None
    ) -> list[int]:
        """Return the indices of up to `count` positions, best first: each removes those that overlap it.

        Parameters
        ----------
        count
            Number of positions.
        share
            Largest share of the smaller of two rectangles that may overlap.
        taken
            Positions that remove others before the first is chosen.
        left
            Positions to choose from; all by default. Of equal scores the first wins.
        """
        return list(islice(self.in_order(share=share, taken=taken, left=left), count))

    def in_order(self, *, share: float = 0.0, taken: Sequence[int] = (), left: Indices | None = None) -> Iterator[int]:
        """Yield the positions of :meth:`best`, as many as there are."""
        left = np.arange(len(self.rows)) if left is None else left
        found: list[int] = []
        for some in self._sorted(left):
            for one in (*taken, *found):
                some = self.apart(one, some, share)
            while some.size:
                found.append(int(some[0]))
                yield found[-1]
                some = self.apart(found[-1], some[1:], share)

    def _sorted(self, left: Indices) -> Iterator[Indices]:
        """Yield positions best first, some at a time; the many after the first ones are sorted only when wanted."""
        scores = -self.scores[left]
        first = np.ones(len(left), dtype=bool)
        if len(left) > PEAKS_AT_ONCE:
            first = scores <= np.partition(scores, PEAKS_AT_ONCE)[PEAKS_AT_ONCE]
        for part in (first, ~first):
            order = left[part][np.argsort(scores[part], kind="stable")]
            for start in range(0, len(order), PEAKS_AT_ONCE):
                yield order[start : start + PEAKS_AT_ONCE]

    def moved(self, down: int, right: int) -> Places:
        """Return positions found in a part of an image that begins at this pixel as positions in all of it."""
        return Places(self.rows + down, self.cols + right, self.scores, self.shape)

    def box(self, index: int) -> tuple[int, int]:
        """Return height and width, px, of the upright box at a position."""
        return self.shape if self.poses is None else warped_shape(self.shape, *self.poses[index])

    @cached_property
    def _boxes(self) -> npt.NDArray[np.float64]:
        """Centre, height and width, not upright but along the sides of the template, of each position."""
        places, sides = np.column_stack([self.rows, self.cols]), np.broadcast_to(self.shape, (len(self.rows), 2))
        if self.poses is None:
            return np.column_stack([places + sides / 2, sides])
        boxes = np.array([self.box(index) for index in range(len(places))]).reshape(-1, 2)
        return np.column_stack([places + boxes / 2, sides * np.array(self.poses).reshape(-1, 2)[:, :1]])

    def apart(self, one: int, some: Indices, share: float = 0.0) -> Indices:
        """Return those of `some` positions that share no more than that share of the smaller rectangle with one.

        As if all were rotated as that one is.
        """
        (row, col, height, width), (rows, cols, heights, widths) = self._boxes[one], self._boxes[some].T
        turn = 0.0 if self.poses is None else math.radians(self.poses[one][1])
        down, right = rows - row, cols - col
        along, across = right * math.cos(turn) - down * math.sin(turn), right * math.sin(turn) + down * math.cos(turn)
        tall = np.minimum((heights + height) / 2 - np.abs(across), np.minimum(heights, height))
        wide = np.minimum((widths + width) / 2 - np.abs(along), np.minimum(widths, width))
        smaller = np.minimum(heights * widths, height * width)
        return np.asarray(some[np.maximum(tall, 0) * np.maximum(wide, 0) <= share * smaller])


NOWHERE = Places(np.zeros(0, np.intp), np.zeros(0, np.intp), np.zeros(0), (0, 0))


def peaks(score_map: ScoreMap, shape: tuple[int, int]) -> Places:
    """Return the local maxima of the map of a template of that shape: no neighbour scores higher.

    The slopes of a peak are left out, so they do not come back as matches just outside its suppressed half.
    NaN is never a peak.
    """
    rows_at_once = -(-PLACES_AT_ONCE // score_map.shape[1])

    def band(first: int) -> Indices:
        marks = np.empty(score_map[first : first + rows_at_once].shape, dtype=np.bool_)
        mark_peaks(score_map, first, np.empty(score_map.shape[1] + 2, dtype=np.float32), marks)
        return np.asarray(np.flatnonzero(marks) + first * score_map.shape[1])

    found = in_threads([partial(band, first) for first in range(0, len(score_map), rows_at_once)])
    rows, cols = np.divmod(np.concatenate(found), score_map.shape[1])
    return Places(rows, cols, score_map[rows, cols], shape)


@compiled(fastmath={"contract"}, counted=False)
def mark_peaks(scores: Array, first: int, highest: Array, marks: Array) -> None:
    """Mark the places of some rows of a score map that no neighbour exceeds; NaN exceeds none, and is not marked.

    Parameters
    ----------
    scores
        (rows, cols) float32.
    first
        Row of the map that is the first of the marks.
    highest
        float32 memory for cols + 2 numbers.
    marks
        The result, bool.
    """
    rows, cols = scores.shape
    here, right = highest[1:], highest[2:]
    highest[0] = highest[cols + 1] = _LOWEST
    for row in range(first, first + len(marks)):
        line, above, below = scores[row], scores[max(row - 1, 0)], scores[min(row + 1, rows - 1)]
        for at in range(cols):  # the comparisons are so that NaN loses each
            best = line[at] if line[at] > _LOWEST else _LOWEST
            best = above[at] if above[at] > best else best
            here[at] = below[at] if below[at] > best else best
        marked = marks[row - first]
        for at in range(cols):
            marked[at] = (line[at] >= highest[at]) & (line[at] >= here[at]) & (line[at] >= right[at])


def peaks_near(image: Image, pattern: Pattern, row: int, col: int, reach: tuple[int, int]) -> Places:
    """Return the peaks among the positions in the image up to `reach` px down and across from one."""
    (height, width), (top, left) = pattern.shape, (max(0, row - reach[0]), max(0, col - reach[1]))
    around = np.ascontiguousarray(image[top : row + height + reach[0], left : col + width + reach[1]])
    if around.shape[0] < height or around.shape[1] < width:
        return NOWHERE
    return peaks(fft_score_map(around, pattern, silent), pattern.shape).moved(top, left)


def positions_near(image: Image, pattern: Pattern, row: int, col: int, reach: int) -> tuple[Indices, Indices]:
    """Return the rows and columns of all positions in the image within `reach` px of one."""
    rows, cols = (
        np.arange(max(0, at - reach), min(length - side, at + reach) + 1)
        for at, length, side in zip((row, col), image.shape, pattern.shape, strict=False)
    )
    return np.repeat(rows, cols.size), np.tile(cols, rows.size)
