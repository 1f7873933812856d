"""Scored places of a template: the best that do not overlap, and the peaks of a score map."""

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

BAND_PLACES = 2**19
"""Places of a score map that one thread searches for peaks: enough to be worth it, and the copies stay small."""

SORTED_AT_ONCE = 256
"""Peaks that are sorted at a time, best first: mostly enough for all that are wanted."""

_LOWEST = np.float32(-2.0)
"""Below every score."""


@dataclass(frozen=True)
class Places:
    """Scored positions of a template.

    Parameters
    ----------
    rows, cols, scores
        One per position of the template's top-left pixel; no score is NaN.
    shape
        Height and width of the template, px.
    poses
        Scale and rotation at each position, of the top-left pixel of the upright box around the template; None if the
        template is only searched as given.
    """

    rows: Indices
    cols: Indices
    scores: Plane
    shape: tuple[int, int]
    poses: list[tuple[float, float]] | None = None

    def best(
        self, count: int, *, share: float = 0.0, taken: Sequence[int] = (), among: Indices | None = None
    ) -> list[int]:
        """Return the indices of up to `count` positions, best first, without those that overlap a better one.

        Parameters
        ----------
        count
            Number of positions.
        share
            Largest overlap of two rectangles, as a share of the smaller.
        taken
            Positions that nothing may overlap either.
        among
            Positions to choose from; all by default. Of equal scores the first wins.
        """
        return list(islice(self.in_order(share=share, taken=taken, among=among), count))

    def in_order(self, *, share: float = 0.0, taken: Sequence[int] = (), among: Indices | None = None) -> Iterator[int]:
        """Yield the positions of :meth:`best`, without limit."""
        found: list[int] = []
        for batch in self._sorted(np.arange(len(self.rows)) if among is None else among):
            for other in (*taken, *found):
                batch = self._apart(other, batch, share)
            while batch.size:
                found.append(int(batch[0]))
                yield found[-1]
                batch = self._apart(found[-1], batch[1:], share)

    def _sorted(self, positions: Indices) -> Iterator[Indices]:
        """Yield positions best first in batches; the many after the first batch are sorted only when needed."""
        scores = -self.scores[positions]
        first = np.ones(len(positions), dtype=bool)
        if len(positions) > SORTED_AT_ONCE:
            first = scores <= np.partition(scores, SORTED_AT_ONCE)[SORTED_AT_ONCE]
        for part in (first, ~first):
            order = positions[part][np.argsort(scores[part], kind="stable")]
            for start in range(0, len(order), SORTED_AT_ONCE):
                yield order[start : start + SORTED_AT_ONCE]

    def moved(self, down: int, right: int) -> Places:
        """Return positions found in a part of an image as positions in the image; the part begins at (down, right)."""
        return Places(self.rows + down, self.cols + right, self.scores, self.shape)

    def corner(self, index: int) -> tuple[int, int]:
        """Return the row and column of the top-left pixel at a position."""
        return int(self.rows[index]), int(self.cols[index])

    def pose(self, index: int) -> tuple[float, float]:
        """Return the scale and rotation at a position."""
        return (1.0, 0.0) if self.poses is None else self.poses[index]

    def box(self, index: int) -> tuple[int, int]:
        """Return height and width, px, of the upright box at a position."""
        return warped_shape(self.shape, *self.pose(index))

    @cached_property
    def _boxes(self) -> npt.NDArray[np.float64]:
        """Centre, height and width of the template at each position, along its own sides."""
        places, sides = np.column_stack([self.rows, self.cols]), np.broadcast_to(self.shape, (len(self.rows), 2))
        if self.poses is None:
            return np.column_stack([places + sides / 2, sides])
        boxes = np.array([self.box(index) for index in range(len(places))]).reshape(-1, 2)
        return np.column_stack([places + boxes / 2, sides * np.array(self.poses).reshape(-1, 2)[:, :1]])

    def _apart(self, reference: int, positions: Indices, share: float) -> Indices:
        """Return the positions that overlap a reference by no more than that share of the smaller rectangle.

        As if all were rotated like the reference.
        """
        (row, col, height, width), (rows, cols, heights, widths) = self._boxes[reference], self._boxes[positions].T
        turn = math.radians(self.pose(reference)[1])
        down, right = rows - row, cols - col
        along, across = right * math.cos(turn) - down * math.sin(turn), right * math.sin(turn) + down * math.cos(turn)
        tall = np.minimum((heights + height) / 2 - np.abs(across), np.minimum(heights, height))
        wide = np.minimum((widths + width) / 2 - np.abs(along), np.minimum(widths, width))
        smaller = np.minimum(heights * widths, height * width)
        return np.asarray(positions[np.maximum(tall, 0) * np.maximum(wide, 0) <= share * smaller])


NOWHERE = Places(np.zeros(0, np.intp), np.zeros(0, np.intp), np.zeros(0), (0, 0))


def peaks(score_map: ScoreMap, shape: tuple[int, int]) -> Places:
    """Return the local maxima of the map of a template of that shape: no neighbour scores higher.

    The slopes of a peak are left out, so that they do not become matches just outside the half that it suppresses.
    NaN is never a peak.
    """
    band_rows = -(-BAND_PLACES // score_map.shape[1])

    def band(first: int) -> Indices:
        marks = np.empty(score_map[first : first + band_rows].shape, dtype=np.bool_)
        mark_peaks(score_map, first, np.empty(score_map.shape[1] + 2, dtype=np.float32), marks)
        return np.asarray(np.flatnonzero(marks) + first * score_map.shape[1])

    found = in_threads([partial(band, first) for first in range(0, len(score_map), band_rows)])
    rows, cols = np.divmod(np.concatenate(found), score_map.shape[1])
    return Places(rows, cols, score_map[rows, cols], shape)


@compiled(fastmath={"contract"}, counted=False)
def mark_peaks(scores: Array, first: int, highest: Array, marks: Array) -> None:
    """Mark the local maxima in some rows of a score map; NaN is never one, nor higher than a neighbour.

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
        for at in range(cols):  # NaN loses each of these comparisons
            best = line[at] if line[at] > _LOWEST else _LOWEST
            best = above[at] if above[at] > best else best
            here[at] = below[at] if below[at] > best else best
        marked = marks[row - first]
        for at in range(cols):
            marked[at] = (line[at] >= highest[at]) & (line[at] >= here[at]) & (line[at] >= right[at])


def peaks_near(image: Image, pattern: Pattern, row: int, col: int, reach: tuple[int, int]) -> Places:
    """Return the peaks among the positions in the image up to `reach` px (down, across) from (row, col)."""
    (height, width), (top, left) = pattern.shape, (max(0, row - reach[0]), max(0, col - reach[1]))
    around = np.ascontiguousarray(image[top : row + height + reach[0], left : col + width + reach[1]])
    if not pattern.fits(around):
        return NOWHERE
    return peaks(fft_score_map(around, pattern, silent), pattern.shape).moved(top, left)


def positions_near(image: Image, pattern: Pattern, row: int, col: int, reach: int) -> tuple[Indices, Indices]:
    """Return the rows and columns of all positions in the image within `reach` px of (row, col)."""
    rows, cols = (
        np.arange(max(0, at - reach), min(length - side, at + reach) + 1)
        for at, length, side in zip((row, col), image.shape, pattern.shape, strict=False)
    )
    return np.repeat(rows, cols.size), np.tile(cols, rows.size)
