"""Window matching by batched FFT: every window against its own search area, many at a time.

Compared with :mod:`stereolag.stereo.windows.window_sums`, this engine pays off where windows are few (a low overlap)
and the search is large, and it is the only one for scores that need a spectrum: phase correlation, and the circular
correlation of an unpadded search. Only the products are computed differently: the code that uses them is the same, and
so is the map.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import replace

import numpy as np
import numpy.typing as npt
import scipy.fft

from stereolag.core.arrays import Array
from stereolag.core.jobs import Progress, silent
from stereolag.loops.bands import over_bands
from stereolag.loops.vector_lanes import LANES
from stereolag.stereo.windows.prepared_pair import PreparedPair, framed
from stereolag.stereo.windows.scores import (
    OFFSET,
    SCALE,
    Windows,
    as_scores,
    record_group,
    record_runners_up,
    score_products,
)
from stereolag.stereo.windows.search import MOST_LAGS, LagRange, LagTable, WindowMatches, WindowQuery

Spectrum = npt.NDArray[np.complex128]
Surface = npt.NDArray[np.float64]

BATCH_BYTES = 32 * 2**20
"""Windows are processed in batches whose padded search areas take about this much memory."""

POWERLESS = 1e-9
"""Share of a spectrum's highest magnitude up to which a frequency has no power, and so no phase."""


def match_windows_fft(query: WindowQuery, progress: Progress = silent) -> WindowMatches:
    """Match every window of the left image by FFT, as :func:`stereolag.stereo.windows.window_sums.match_windows` does.

    Sums of integers are rounded to integers, so that both agree to the bit. For other images the sums of both are
    rounded in the sixteenth digit, which changes a 32-bit score once in a million.

    Parameters
    ----------
    query
        `right_matches` is not supported.
    progress
        Called with the fraction done after every batch.

    Raises
    ------
    ValueError
        A query that :class:`stereolag.stereo.windows.prepared_pair.PreparedPair` rejects, or one for `right_matches`.
    """
    if query.right_matches:
        raise ValueError("Only window sums give the matches of the right windows.")
    pair = PreparedPair(query)
    if pair.lags is None:
        for first in range(pair.rows):
            pair.rescale(first, first + 1, pair.left_windows(first, first + 1).inverse)
        progress(1.0)
        return pair.matches()
    surfaces = _surfaces(pair, pair.lags)
    batch = max(1, BATCH_BYTES // surfaces.bytes_per_window)
    rows = max(1, batch // pair.cols)
    for first in range(0, pair.rows, rows):
        end = min(first + rows, pair.rows)
        left, right = pair.left_windows(first, end), pair.right_windows(first, end)
        for begin in range(0, left.inverse.size, batch):
            some = np.arange(begin, min(begin + batch, left.inverse.size))
            record_windows(pair, first, some, left, *surfaces.score(first, some, left, right))
            progress((first * pair.cols + int(some[-1]) + 1) / (pair.rows * pair.cols))
        pair.rescale(first, end, left.inverse)
    return pair.matches()


def record_windows(
    pair: PreparedPair,
    first: int,
    some: npt.NDArray[np.intp],
    left: Windows,
    scores: npt.NDArray[np.int32],
    best_lanes: npt.NDArray[np.int32],
) -> None:
    """Record the best lags of some windows, counted from row `first` of the grid on."""
    found, table, left_at = pair.found, pair.table, int(some[0])
    at = first * pair.cols + left_at
    score_mask, score_codes = table.code_mask, table.codes
    if np.count_nonzero(table.codes > 0) > MOST_LAGS:
        # Score and code do not fit in one integer: the best of each window is found separately, with no bits lost.
        best_lanes = _best_of_many(scores, table)
        score_mask, score_codes = 0, np.minimum(table.codes, 0)
    codes = np.empty(some.size, np.int32)
    record_group(some.size, at, left_at, left.inverse, table, best_lanes, scores, codes, found)
    if found.runner_up.size:
        record_runners_up(some.size, at, scores, codes, table.around, score_codes, score_mask, found.runner_up)


def _best_of_many(scores: npt.NDArray[np.int32], table: LagTable) -> npt.NDArray[np.int32]:
    """Return lanes with the code of each window's best lag in the first lane, as its only candidate."""
    keys = scores[:, : table.codes.size].astype(np.int64) << 32 | np.maximum(table.codes, 0)
    keys[:, table.codes < 0] = 0
    best = keys.max(axis=1)
    lanes = np.zeros((len(scores), LANES), np.int32)
    lanes[:, 0] = np.where(best >> 32 > 0, (best & table.code_mask) | (table.code_mask + 1), 0)
    return lanes


def score_surface(query: WindowQuery, top: int, left_edge: int) -> Surface:
    """Return the (lag rows, lag cols) scores of the window with the given top-left pixel, as used in its match.

    NaN = no candidate.
    """
    pair = PreparedPair(replace(query, step=1, runner_up=False, right_matches=False))
    surface = np.full((query.lags.rows, query.lags.cols), np.nan)
    if pair.lags is None:
        return surface
    left, right = pair.left_windows(top, top + 1), pair.right_windows(top, top + 1)
    kept, _ = _surfaces(pair, pair.lags).score(top, np.array([left_edge]), left, right)
    kept = kept[0, : pair.table.codes.size].reshape(pair.lags.rows, -1)[:, : pair.lags.cols]
    inverse = float(left.inverse[0, left_edge])
    if inverse > 0:
        scores = np.empty(kept.shape, np.float32)
        as_scores(kept, scores, np.full(kept.shape, inverse, np.float32), pair.score_norm)
        row, col = pair.lags.dy_first - query.lags.dy_first, pair.lags.dx_first - query.lags.dx_first
        surface[row : row + pair.lags.rows, col : col + pair.lags.cols] = scores
    return surface


def _surfaces(pair: PreparedPair, lags: LagRange) -> _Surfaces:
    if pair.circular:
        return _Circular(pair, lags)
    return _Whitened(pair, lags) if pair.score == "phase" else _Products(pair, lags)


class _Surfaces(ABC):
    """Scores of windows at every lag, stored as in :mod:`stereolag.stereo.windows.scores`."""

    def __init__(self, pair: PreparedPair, lags: LagRange) -> None:
        self.pair, self.lags = pair, lags
        if pair.circular:
            self.area = self.fft_shape = (pair.window, pair.window)
        else:
            self.area = (pair.window + lags.rows - 1, pair.window + lags.cols - 1)
            rows, cols = (scipy.fft.next_fast_len(side, real=True) for side in self.area)
            self.fft_shape = (rows, cols)
        self.bytes_per_window = 8 * 4 * self.fft_shape[0] * self.fft_shape[1]

    @abstractmethod
    def score(
        self, first: int, some: npt.NDArray[np.intp], left: Windows, right: Windows
    ) -> tuple[npt.NDArray[np.int32], npt.NDArray[np.int32]]:
        """Return the scores and the best lanes of some windows, as :func:`score_products` sets them.

        Parameters
        ----------
        first
            Row of the grid at which `left` and `right` start.
        some
            (n,) consecutive indices of the left windows.
        left, right
            Sums and norms of the windows.
        """

    def places(self, first: int, some: npt.NDArray[np.intp]) -> tuple[npt.NDArray[np.intp], npt.NDArray[np.intp]]:
        """Return the top-left pixels of some windows."""
        rows, cols = np.divmod(some, self.pair.cols)
        return (first + rows) * self.pair.step, cols * self.pair.step

    def correlated(self, windows: Array, areas: Array, *, whitened: bool) -> Surface:
        """Return the (n, lag rows, lag cols) correlation of windows with their search areas; wrapped if circular."""
        spectrum: Spectrum = scipy.fft.rfft2(windows, self.fft_shape, workers=-1).conj()
        spectrum *= scipy.fft.rfft2(areas, self.fft_shape, workers=-1)
        if whitened:
            _whiten(spectrum)
        surface: Surface = scipy.fft.irfft2(spectrum, self.fft_shape, workers=-1)
        return surface


class _Products(_Surfaces):
    """Sums of products with larger search areas, zero-padded so that nothing wraps, scored as for window sums."""

    def score(
        self, first: int, some: npt.NDArray[np.intp], left: Windows, right: Windows
    ) -> tuple[npt.NDArray[np.int32], npt.NDArray[np.int32]]:
        pair, lags, table = self.pair, self.lags, self.pair.table
        tops, lefts = self.places(first, some)
        areas = _cut(pair.right, tops + pair.right_row, lefts + pair.right_col, self.area)
        windows = _cut(pair.left, tops, lefts, (pair.window, pair.window))
        surface = self.correlated(windows, areas, whitened=False)[:, : lags.rows, : lags.cols]
        if pair.exact:
            np.rint(surface, out=surface)
        products = np.zeros((some.size, lags.rows, table.codes.size // lags.rows), pair.sums_dtype)
        products[:, :, : lags.cols] = surface
        scores = np.zeros((some.size, table.codes.size + LANES), np.int32)
        best_lanes = np.empty((some.size, LANES), np.int32)
        right_at = (tops - first * pair.step) * pair.right.shape[1] + lefts + pair.right_col

        def make_scores(begin: int, end: int) -> None:
            score_products(
                begin,
                end,
                products.reshape(some.size, -1),
                pair.share,
                int(some[0]),
                left,
                right_at,
                right,
                table,
                scores,
                best_lanes,
            )

        over_bands(make_scores, some.size)
        return scores, best_lanes


class _Whitened(_Surfaces):
    """Phase correlation: only the phase of the spectrum counts."""

    def __init__(self, pair: PreparedPair, lags: LagRange) -> None:
        super().__init__(pair, lags)
        # Padded with the mean, as an edge of the frame would have a phase.
        self.right = framed(pair.plain_right - float(np.mean(pair.left)), lags)

    def score(
        self, first: int, some: npt.NDArray[np.intp], left: Windows, right: Windows
    ) -> tuple[npt.NDArray[np.int32], npt.NDArray[np.int32]]:
        pair, lags = self.pair, self.lags
        tops, lefts = self.places(first, some)
        areas = _cut(self.right, tops + pair.right_row, lefts + pair.right_col, self.area)
        windows = _cut(pair.left, tops, lefts, (pair.window, pair.window))
        surface = self.correlated(_mean_free(windows), _mean_free(areas), whitened=True)
        in_frame = _cut(right.inverse, tops - first * pair.step, lefts + pair.right_col, (lags.rows, lags.cols)) > 0
        return to_stored_score(pair, lags, np.where(in_frame, surface[:, : lags.rows, : lags.cols], np.nan))


class _Circular(_Surfaces):
    """Scores of windows against the same place in the right image, wrapped around at the window's edges."""

    def score(
        self, first: int, some: npt.NDArray[np.intp], left: Windows, right: Windows
    ) -> tuple[npt.NDArray[np.int32], npt.NDArray[np.int32]]:
        pair, lags = self.pair, self.lags
        tops, lefts = self.places(first, some)
        order = np.ix_(
            np.arange(some.size),
            np.arange(lags.dy_first, lags.dy_last + 1) % pair.window,
            np.arange(lags.dx_first, lags.dx_last + 1) % pair.window,
        )
        windows, areas = (_cut(image, tops, lefts, self.area) for image in (pair.left, pair.right))
        if pair.score != "ncc":
            windows, areas = _mean_free(windows), _mean_free(areas)
        surface = self.correlated(windows, areas, whitened=pair.score == "phase")[order]
        inverse = right.inverse.reshape(-1)[some].astype(np.float64)
        if pair.score != "phase":
            right_norm = np.full(inverse.shape, 1 / pair.right_norm) if pair.score == "cross" else inverse
            surface *= (left.inverse.reshape(-1)[some] * right_norm)[:, None, None]
        return to_stored_score(pair, lags, np.where(inverse[:, None, None] > 0, surface, np.nan))


def to_stored_score(
    pair: PreparedPair, lags: LagRange, scores: Surface
) -> tuple[npt.NDArray[np.int32], npt.NDArray[np.int32]]:
    """Return (n, lag rows, lag cols) scores of -1..1, NaN for none, as stored integers, and the best of each lane.

    They are rounded to the nearest, so that the error of an FFT does not choose between equal scores.
    """
    codes, count = pair.table.codes, len(scores)
    kept = np.zeros((count, codes.size + LANES), np.int32)
    strips = kept[:, : codes.size].reshape(count, lags.rows, -1)
    candidate = ~np.isnan(scores)
    strips[:, :, : lags.cols] = np.rint((np.where(candidate, scores, -OFFSET) + OFFSET) * SCALE)
    keys = (kept[:, : codes.size] & ~pair.table.code_mask) | codes
    return kept, keys.reshape(count, -1, LANES).max(axis=1)


def _cut(image: Array, tops: npt.NDArray[np.intp], lefts: npt.NDArray[np.intp], shape: tuple[int, int]) -> Array:
    """Return the (n, *shape) float64 patches of `image` whose top-left pixels are given."""
    return np.lib.stride_tricks.sliding_window_view(image, shape)[tops, lefts].astype(np.float64, copy=False)


def _mean_free(patches: Array) -> Array:
    return np.asarray(patches - patches.mean(axis=(1, 2), keepdims=True))


def _whiten(spectrum: Spectrum) -> None:
    """Keep only the phase of a cross-power spectrum; frequencies without power are set to 0."""
    magnitude = np.abs(spectrum)
    floor = POWERLESS * magnitude.max(axis=(1, 2), keepdims=True)
    np.divide(spectrum, magnitude, out=spectrum, where=magnitude > floor)
    spectrum[magnitude <= floor] = 0
