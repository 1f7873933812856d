"""Image pair prepared for window matching, shared by both engines, so that they differ only in the products."""

from __future__ import annotations

from typing import NamedTuple

import cv2
import numpy as np

from stereolag.core.arrays import Array
from stereolag.core.inputs import Image, flat_energy
from stereolag.loops.vector_lanes import LANES
from stereolag.stereo.windows.scores import WindowResults, Windows, as_scores, describe_windows
from stereolag.stereo.windows.search import LagRange, WindowMatches, WindowQuery, lag_table, strips_of

LARGEST_EXACT_WINDOW = 181
"""px; 181² products of uint8 still fit in a signed 32-bit sum."""

NO_RIGHT_MATCH = -32768


class Comparable(NamedTuple):
    """Both images in the type in which their products are summed."""

    left: Array
    right: Array
    exact: bool
    """Whether all sums are exact whole numbers."""
    floor: float
    """Energy up to which a window is flat, for both engines."""


class PreparedPair:
    """Data of a pair computed before any windows are compared, and room for the results.

    Parameters
    ----------
    query
        The pair, its windows and the lags.

    Raises
    ------
    ValueError
        Images that are not grey or differ in size or dtype, a window larger than they are, or a step below 1.
    """

    def __init__(self, query: WindowQuery) -> None:
        _check(query)
        window = query.window_size
        self.window, self.step, self.score, self.circular = window, query.step, query.score, query.circular
        self.height, self.width = query.left.shape
        self.rows, self.cols = query.grid
        self.left, self.plain_right, self.exact, self.floor = comparable(query.left, query.right, window, query.score)
        self.sums_dtype = np.int32 if self.left.dtype == np.uint8 else np.float64
        self.left_norm, self.right_norm = (window * _spread(one) / 2 or 1.0 for one in (self.left, self.plain_right))
        self.share = 0.0 if query.score == "ncc" else 1 / window**2
        inside = query.lags.within(self.height - window, self.width - window)
        self.lags = query.lags if query.circular else inside
        if self.lags is not None:
            self.right = self.plain_right if query.circular else framed(self.plain_right, self.lags)
            self.table = lag_table(self.lags, self.right.shape[1], wrapped=query.circular)
            self.right_row = max(0, -self.lags.dy_first) + self.lags.dy_first
            self.right_col = max(0, -self.lags.dx_first) + self.lags.dx_first
        self.found = self._room(query.runner_up, query.right_matches and self.lags is not None)
        seen = (self.rows, self.width - window + 1) if query.right_matches else (0, 0)
        self.right_dx = np.full(seen, NO_RIGHT_MATCH, np.int16)
        self.texture = np.empty((self.rows, self.cols), np.float32)

    def _room(self, runner_up: bool, right_matches: bool) -> WindowResults:
        shape = (self.rows, self.cols)
        vertical = self.lags is not None and self.lags.rows > 1
        return WindowResults(
            dy=np.zeros(shape if vertical or (self.lags and self.lags.dy_first) else (0, 0), np.int16),
            dx=np.zeros(shape, np.int16),
            around=np.zeros((9 if vertical else 3, *shape), np.int32),
            runner_up=np.zeros(shape if runner_up else (0, 0), np.int32),
            right_key=np.zeros((self.rows, self.right.shape[1]) if right_matches else (0, 0), np.int32),
        )

    def left_windows(self, first: int, end: int) -> Windows:
        """Return the left windows of rows `first` to `end` of the grid, and record their texture."""
        # A right window compares the unnormalised scores of several left windows, which need one unit.
        norm = self.left_norm if self.score == "cross" and self.right_dx.size else 0.0
        windows = self._nothing_yet(end - first, self.cols)
        self._describe(self.left, self.step, first, norm, windows, self.texture[first:end])
        return windows

    def right_windows(self, first: int, end: int) -> Windows:
        """Return the right windows that the lags of these grid rows meet; out of the frame they have no norm.

        They are one px apart. Row 0 is the one that the first row of left windows meets at the first lag; columns are
        those of the framed right image. For a circular correlation they are at the places of the left ones.
        """
        assert self.lags is not None
        # Scores without the norm of the right window only need it to be in the frame.
        norm = self.right_norm if self.score in ("cross", "phase") and not self.circular else 0.0
        nothing = np.empty((0, 0), np.float32)
        if self.circular:
            windows = self._nothing_yet(end - first, self.cols)
            self._describe(self.plain_right, self.step, first, norm, windows, nothing)
            return windows
        rows = (end - first - 1) * self.step + self.lags.rows
        begin = first * self.step + self.lags.dy_first
        top, bottom = max(0, begin), min(self.height - self.window + 1, begin + rows)
        windows = self._nothing_yet(rows, self.right.shape[1])
        if bottom > top:
            x = max(0, -self.lags.dx_first)
            inside = slice(top - begin, bottom - begin), slice(x, x + self.width - self.window + 1)
            self._describe(self.plain_right, 1, top, norm, Windows(*(part[inside] for part in windows)), nothing)
        return windows

    def _nothing_yet(self, rows: int, cols: int) -> Windows:
        return Windows(np.zeros((rows, cols), self.sums_dtype), np.full((rows, cols), np.nan, np.float32))

    def _describe(self, image: Array, step: int, first: int, norm: float, windows: Windows, texture: Array) -> None:
        describe_windows(image, self.window, step, first, self.share, norm, self.floor, *windows, texture)

    def rescale(self, first: int, end: int, left_inverse: Array) -> None:
        """Convert the integers stored for rows `first` to `end` of the grid into scores, in place."""
        for kept in (*self.found.around, *self.found.runner_up[None, : self.rows]):
            if kept.size:
                as_scores(kept[first:end], kept[first:end].view(np.float32), left_inverse, self.score_norm)

    @property
    def score_norm(self) -> float:
        """Return the norm of a right window by which scores are multiplied again, 0 for none."""
        return self.right_norm if self.score == "cross" else 0.0

    def matches(self) -> WindowMatches:
        """Return the matches found."""
        around = self.found.around.view(np.float32).reshape(-1, 3, self.rows, self.cols)
        nowhere = np.broadcast_to(np.int16(0), self.texture.shape)
        return WindowMatches(
            dy=self.found.dy if self.found.dy.size else nowhere,
            dx=self.found.dx,
            score=around[len(around) // 2, 1],
            around=around,
            texture=self.texture,
            runner_up=self.found.runner_up.view(np.float32) if self.found.runner_up.size else None,
            right_dx=self.right_dx if self.right_dx.size else None,
        )


def _check(query: WindowQuery) -> None:
    left, right = query.left, query.right
    if left.ndim != 2 or left.shape != right.shape or left.dtype != right.dtype:
        raise ValueError(
            f"left is {left.shape} {left.dtype} and right {right.shape} {right.dtype}; "
            "both must be grey images of one size and type."
        )
    if not 1 <= query.window_size <= min(left.shape):
        raise ValueError(
            f"A window of {query.window_size} px does not fit an image of {left.shape[1]} × {left.shape[0]} pixels; "
            f"allowed are 1 to {min(left.shape)}."
        )
    if query.step < 1:
        raise ValueError(f"The step is {query.step} px; it must be at least 1.")


def comparable(left: Image, right: Image, window: int, score: str) -> Comparable:
    """Return both images as uint8, or as float64 about their mean, with the energy of a flat window."""
    if left.dtype == np.uint8 and window <= LARGEST_EXACT_WINDOW:
        return Comparable(
            np.ascontiguousarray(left), np.ascontiguousarray(right), True, flat_energy(window**2, 255, exact=True)
        )
    # One mean for both images, so that each is shifted by the same amount. "ncc" keeps the mean.
    mean = 0.0 if score == "ncc" else float(np.rint((left.mean(dtype=float) + right.mean(dtype=float)) / 2))
    if score != "ncc" and np.issubdtype(left.dtype, np.floating):
        mean = float((left.mean(dtype=float) + right.mean(dtype=float)) / 2)
    left, right = left.astype(np.float64) - mean, right.astype(np.float64) - mean
    brightest = max(float(np.abs(left).max()), float(np.abs(right).max()))
    whole_numbers = mean == np.rint(mean) and brightest > 1
    exact = whole_numbers and bool((left == np.rint(left)).all() and (right == np.rint(right)).all())
    exact = exact and window**2 * brightest**2 < 2**46
    return Comparable(left, right, exact, flat_energy(window**2, brightest, exact=exact))


def _spread(image: Array) -> float:
    return float(image.max()) - float(image.min())


def framed(image: Array, lags: LagRange) -> Array:
    """Return the image padded with zeros, so that every lag of every pixel can be read."""
    return cv2.copyMakeBorder(
        image,
        top=max(0, -lags.dy_first),
        bottom=max(0, lags.dy_last),
        left=max(0, -lags.dx_first),
        right=max(0, lags.dx_first + strips_of(lags) * LANES),
        borderType=cv2.BORDER_CONSTANT,
    )
