"""Dense windowed correlation by running sums: every window of the left image against every lag."""

from __future__ import annotations

import cv2
import numpy as np
import numpy.typing as npt

from stereolag.arrays import Array
from stereolag.loops.bands import over_bands
from stereolag.loops.vector_lanes import LANES
from stereolag.progress import Progress, silent
from stereolag.stereo.windows.matches import WindowMatches, WindowQuery
from stereolag.stereo.windows.running_sums import describe_windows
from stereolag.stereo.windows.scores import as_scores
from stereolag.stereo.windows.search import LagRange, lag_table, strips_of
from stereolag.stereo.windows.tiles import Found, Windows, Workspace, as_right_dx, match_tile

LARGEST_EXACT_WINDOW = 181
"""px: 181² products of uint8 still fit a signed 32-bit sum."""
RELATIVE_FLOOR = 1e-11
"""Energy per pixel, relative to the largest pixel squared, that float64 sums cannot tell from none."""
CACHE_BYTES = 512 * 1024
"""The column sums of a tile: they stay in a core's second-level cache."""
GROUP_BYTES = 24 * 1024
"""The scores of a few windows: they stay in a core's first-level cache."""
NO_RIGHT_MATCH = -32768
BAND_WORK = 60e6
"""Pixels times lags of a band: some 50 ms."""


def match_windows(query: WindowQuery, progress: Progress = silent) -> WindowMatches:
    """Find the lag at which each window of the left image correlates best with the right image.

    The right window of a lag must lie wholly inside the right image, else the lag is no candidate; nor is one that
    leads to a flat window (``zncc``) or one without energy (``ncc``). Lags whose scores differ by less than float32
    and the number of lags can tell (2e-6 for 441 of them) are equal, and the shortest displacement among them wins;
    see :meth:`LagRange.ranked`. The time does not depend on the window's size.

    Parameters
    ----------
    query
        uint8 images have exact integer sums, others float64 ones. `right_matches` need step 1 and a search without
        vertical reach.
    progress
        Called with the fraction done.

    Raises
    ------
    ValueError
        Images that are not grey or differ in size or dtype, a window larger than they are, a step below 1, more than
        65535 lags, a score or a circular correlation that needs a spectrum, or `right_matches` where it cannot be had.
    """
    _check(query)
    matcher = _Matcher(query)
    over_bands(matcher.match_band, matcher.rows, most_rows=matcher.most_rows, progress=progress)
    return matcher.matches()


def _check(query: WindowQuery) -> None:
    left, right, lags = query.left, query.right, query.lags
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
    if query.score not in ("zncc", "ncc", "cross") or query.circular:
        raise ValueError(
            f"The score is {query.score!r}{', circular' if query.circular else ''}; "
            "allowed are 'zncc', 'ncc' and 'cross', and none of them wrapped."
        )
    if query.right_matches and (query.step > 1 or lags.dy_first != 0 or lags.dy_last != 0):
        raise ValueError(
            f"Matches of the right windows need step 1 and no vertical search; the step is {query.step} and "
            f"dy goes from {lags.dy_first} to {lags.dy_last}."
        )


class _Matcher:
    """One pair made ready: what the threads share while each matches its own band of rows."""

    def __init__(self, query: WindowQuery) -> None:
        window = query.window_size
        self.window, self.step, self.score = window, query.step, query.score
        self.height, self.image_width = query.left.shape
        self.rows, self.cols = query.grid
        self.left, self.plain_right, self.floor = _comparable(query.left, query.right, window, query.score)
        self.sums_dtype = np.int32 if self.left.dtype == np.uint8 else np.float64
        self.left_norm, self.right_norm = (window * _spread(one) / 2 or 1.0 for one in (self.left, self.plain_right))
        self.share = 0.0 if query.score == "ncc" else 1 / window**2
        self.lags = query.lags.within(self.height - window, self.image_width - window)
        self.found = self._room(query.runner_up, query.right_matches)
        self.right_dx = np.full(self.found.right_key.shape, NO_RIGHT_MATCH, np.int16)
        self.texture = np.empty((self.rows, self.cols), np.float32)
        if self.lags is not None:
            self.framed_left = cv2.copyMakeBorder(self.left, 0, 1, 0, 0, cv2.BORDER_CONSTANT)
            self.right = _framed(self.plain_right, self.lags)
            self.table = lag_table(self.lags, self.right.shape[1])

    @property
    def most_rows(self) -> int:
        """Rows of a band, so that progress comes often enough."""
        work_of_row = self.image_width * (self.lags.count if self.lags else 1) * min(self.window, 2 * self.step) / 2
        return max(1, int(BAND_WORK / work_of_row))

    def _room(self, runner_up: bool, right_matches: bool) -> Found:
        shape = (self.rows, self.cols)
        vertical = self.lags is not None and self.lags.rows > 1
        return Found(
            dy=np.zeros(shape if vertical or (self.lags and self.lags.dy_first) else (0, 0), np.int16),
            dx=np.zeros(shape, np.int16),
            around=np.empty((9 if vertical else 3, *shape), np.int32),
            runner_up=np.zeros(shape if runner_up else (0, 0), np.int32),
            right_key=np.zeros((self.rows, self.image_width - self.window + 1) if right_matches else (0, 0), np.int32),
        )

    def match_band(self, first: int, end: int) -> None:
        """Match rows `first` to `end` of the window grid."""
        left = self._left_windows(first, end)
        if self.lags is None:
            self.found.around[:, first:end] = 0
            self._rescale(first, end, left.inverse)
            return
        right = self._right_windows(first, end)
        columns = max(CACHE_BYTES // (self.table.codes.size * np.dtype(self.sums_dtype).itemsize), 4 * self.window)
        tile = max(1, (columns - self.window) // self.step + 1)
        work = self._workspace(min((tile - 1) * self.step + self.window, self.image_width))
        for col in range(0, self.cols, tile):
            match_tile(
                self.framed_left,
                self.right,
                left,
                right,
                max(0, -self.lags.dy_first) + self.lags.dy_first,
                max(0, -self.lags.dx_first) + self.lags.dx_first,
                self.table,
                self.window,
                self.step,
                self.share,
                first,
                col,
                min(tile, self.cols - col),
                self.lags.dx_first,
                work,
                self.found,
            )
        self._rescale(first, end, left.inverse)
        if self.right_dx.size:
            keys, right_dx = self.found.right_key[first:end], self.right_dx[first:end]
            as_right_dx(keys, self.table.dx, self.table.code_mask, NO_RIGHT_MATCH, right_dx)

    def _workspace(self, columns: int) -> Workspace:
        lags = self.table.codes.size
        group = max(1, GROUP_BYTES // (4 * lags))
        return Workspace(
            columns=_aligned((columns, lags), self.sums_dtype),
            window=_aligned((lags,), self.sums_dtype),
            scores=_aligned((group, lags + LANES), np.int32),
            best=_aligned((group, LANES), np.int32),
            codes=_aligned((group,), np.int32),
            right_best=_aligned((lags if self.found.right_key.size else 0,), np.int32),
        )

    def _left_windows(self, first: int, end: int) -> Windows:
        shape = end - first, self.cols
        windows = Windows(np.empty(shape, self.sums_dtype), np.empty(shape, np.float32))
        # A right window compares the plain scores of several left windows: they need one unit.
        norm = self.left_norm if self.score == "cross" and self.found.right_key.size else 0.0
        describe_windows(
            self.left, self.window, self.step, first, self.share, norm, self.floor, *windows, self.texture[first:end]
        )
        return windows

    def _right_windows(self, first: int, end: int) -> Windows:
        """Return what the lags of these rows of the grid meet, zeros where that is out of the frame."""
        assert self.lags is not None
        rows = (end - first - 1) * self.step + self.lags.rows
        begin = first * self.step + self.lags.dy_first
        top, bottom = max(0, begin), min(self.height - self.window + 1, begin + rows)
        shape = rows, self.right.shape[1]
        windows = Windows(np.zeros(shape, self.sums_dtype), np.zeros(shape, np.float32))
        if bottom > top:
            x = max(0, -self.lags.dx_first)
            inside = slice(top - begin, bottom - begin), slice(x, x + self.image_width - self.window + 1)
            norm = self.right_norm if self.score == "cross" else 0.0
            total, inverse = (field[inside] for field in windows)
            nothing = np.empty((0, 0), np.float32)
            describe_windows(
                self.plain_right, self.window, 1, top, self.share, norm, self.floor, total, inverse, nothing
            )
        return windows

    def _rescale(self, first: int, end: int, left_inverse: Array) -> None:
        """Turn what the band keeps as integers into scores, in place."""
        right_norm = self.right_norm if self.score == "cross" else 0.0
        for kept in (*self.found.around, *self.found.runner_up[None, : self.rows]):
            if kept.size:
                as_scores(kept[first:end], kept[first:end].view(np.float32), left_inverse, right_norm)

    def matches(self) -> WindowMatches:
        """Return what all bands found."""
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


def _comparable(left: Array, right: Array, window: int, score: str) -> tuple[Array, Array, float]:
    """Return both images as uint8, or as float64 about their mean, and the energy below which a window is flat."""
    if left.dtype == np.uint8 and window <= LARGEST_EXACT_WINDOW:
        return np.ascontiguousarray(left), np.ascontiguousarray(right), 0.25
    # One mean for both: what a score takes off each window is the same then for either. "ncc" keeps the mean.
    mean = 0.0 if score == "ncc" else float(np.rint((left.mean(dtype=float) + right.mean(dtype=float)) / 2))
    if score != "ncc" and np.issubdtype(left.dtype, np.floating):
        mean = float((left.mean(dtype=float) + right.mean(dtype=float)) / 2)
    left, right = left.astype(np.float64) - mean, right.astype(np.float64) - mean
    brightest = max(float(np.abs(left).max()), float(np.abs(right).max()))
    whole_numbers = mean == np.rint(mean) and brightest > 1
    exact = whole_numbers and bool((left == np.rint(left)).all() and (right == np.rint(right)).all())
    if exact and window**2 * brightest**2 < 2**46:
        return left, right, 0.25
    return left, right, RELATIVE_FLOOR * window**2 * brightest**2


def _spread(image: Array) -> float:
    return float(image.max()) - float(image.min())


def _framed(image: Array, lags: LagRange) -> Array:
    """Return the image with zeros around it, so that every lag of every pixel can be read."""
    return cv2.copyMakeBorder(
        image,
        top=max(0, -lags.dy_first),
        bottom=max(0, lags.dy_last),
        left=max(0, -lags.dx_first),
        right=max(0, lags.dx_first + strips_of(lags) * LANES),
        borderType=cv2.BORDER_CONSTANT,
    )


def _aligned(shape: tuple[int, ...], dtype: npt.DTypeLike) -> Array:
    """Return zeros that begin at a cache line, so that no strip straddles two."""
    size = int(np.prod(shape)) * np.dtype(dtype).itemsize
    memory = np.zeros(size + 64, np.uint8)
    start = -memory.ctypes.data % 64
    return memory[start : start + size].view(dtype).reshape(shape)
