"""Two engines that find the best match of every window: running sums, and batched FFT.

The cost of running sums does not depend on the window's size. FFT pays off where windows are few (a low overlap) and
the search is large, and is required for scores that need a spectrum: phase correlation, and the circular correlation of
an unpadded search. The engines differ only in how they compute the products: preparation and scoring are shared, and
the maps are equal.
"""

from __future__ import annotations

from dataclasses import replace

import cv2
import numpy as np
import numpy.typing as npt

from stereolag.core.arrays import Array
from stereolag.core.inputs import Image, check_window, flat_energy
from stereolag.core.jobs import Progress, silent
from stereolag.loops.bands import over_bands
from stereolag.loops.memory import zeros
from stereolag.loops.vector_lanes import LANES, lanes_for
from stereolag.stereo.finishing.stages import NO_MATCH
from stereolag.stereo.windows.norms import WindowNorms, Windows, describe_windows
from stereolag.stereo.windows.scores import (
    SCORE_OFFSET,
    SCORE_SCALE,
    LeftTerms,
    TilePlace,
    WindowResults,
    Workspace,
    as_right_dx,
    as_scores,
    changing_rows,
    match_tile,
    record_group,
    record_runners_up,
    score_products,
)
from stereolag.stereo.windows.search import (
    MAX_LAGS,
    LagRange,
    LagTable,
    WindowMatches,
    WindowQuery,
    lag_table,
)

MAX_EXACT_WINDOW_PX = 181
"""Side of the largest window whose products of uint8 pixels fit in a signed 32-bit sum, px."""


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
        window = query.window_size
        if query.left.ndim != 2 or query.left.shape != query.right.shape or query.left.dtype != query.right.dtype:
            raise ValueError(
                f"left is {query.left.shape} {query.left.dtype} and right {query.right.shape} {query.right.dtype}; "
                "both must be grey images of one size and type."
            )
        self.height, self.width = query.left.shape
        check_window(window, query.left.shape)
        if query.step < 1:
            raise ValueError(f"The step is {query.step} px; it must be at least 1.")
        self.window, self.step, self.score, self.circular = window, query.step, query.score, query.circular
        self.rows, self.cols = query.grid
        self.left, self.plain_right, self.exact, self.floor = comparable(query.left, query.right, window, query.score)
        self.sums_dtype = np.int32 if self.left.dtype == np.uint8 else np.float64
        self.left_norm, self.right_norm = (
            window * float(np.ptp(one)) / 2 or 1.0 for one in (self.left, self.plain_right)
        )
        # Scores are multiplied by this norm to undo their normalisation; 0 keeps it.
        self.score_norm = self.right_norm if query.score == "cross" else 0.0
        self.share = 0.0 if query.score == "ncc" else 1 / window**2
        inside = query.lags.within(self.height - window, self.width - window)
        self.lags = query.lags if query.circular else inside
        if self.lags is not None:
            self.right = self.plain_right if query.circular else framed(self.plain_right, self.lags)
            self.table = lag_table(self.lags, self.right.shape[1], wrapped=query.circular)
            self.right_row = max(0, -self.lags.dy_first) + self.lags.dy_first
            self.right_col = max(0, -self.lags.dx_first) + self.lags.dx_first
        shape = (self.rows, self.cols)
        right_shape = (self.rows, self.width - window + 1) if query.right_matches else (0, 0)
        vertical = self.lags is not None and self.lags.rows > 1
        allocate = np.empty if self.lags else np.zeros  # without lags, nothing is written
        self.found = WindowResults(
            dy=np.zeros(shape if vertical or (self.lags and self.lags.dy_first) else (0, 0), np.int16),
            dx=allocate(shape, np.int16),
            around=allocate((9 if vertical else 3, *shape), np.int32),
            runner_up=allocate(shape if query.runner_up else (0, 0), np.int32),
            right_key=np.zeros(
                (self.rows, self.right.shape[1]) if query.right_matches and self.lags else (0, 0), np.int32
            ),
        )
        self.right_dx = np.empty(right_shape, np.int16) if self.lags else np.full(right_shape, NO_MATCH, np.int16)
        self.texture = np.empty(shape, np.float32)

    def left_windows(self, first: int, end: int) -> Windows:
        """Return the left windows of rows `first` to `end` of the grid, and record their texture."""
        # The unnormalised scores of several left windows are compared at a right window, and need a common unit.
        norm = self.left_norm if self.score == "cross" and self.right_dx.size else 0.0
        shape, texture = (end - first, self.cols), self.texture[first:end]
        windows = Windows(np.empty(shape, self.sums_dtype), np.empty(shape, np.float32))
        describe_windows(self.left, self._norms(self.step, norm), first, windows, (0, end - first, 0), texture)
        return windows

    def right_windows(self, first: int, end: int) -> Windows:
        """Return the right windows that the lags of these grid rows lead to; outside the frame they have no norm.

        They are one px apart. Row 0 is that of the first row of left windows at the first lag; columns are those of the
        framed right image. For a circular correlation they are at the positions of the left windows.
        """
        assert self.lags is not None
        # For scores that do not use the norm of the right window, any norm marks it as inside the frame.
        norm = self.right_norm if self.score in ("cross", "phase") and not self.circular else 0.0
        if self.circular:
            step, top, where, windows = self.step, first, (0, end - first, 0), self._excluded(end - first, self.cols)
        else:
            step, begin = 1, first * self.step + self.lags.dy_first
            windows = self._excluded((end - first - 1) * self.step + self.lags.rows, self.right.shape[1])
            top, bottom = max(0, begin), min(self.height - self.window + 1, begin + len(windows.total))
            where = top - begin, bottom - begin, max(0, -self.lags.dx_first)
        if where[1] > where[0]:
            no_texture = np.empty((0, 0), np.float32)
            describe_windows(self.plain_right, self._norms(step, norm), top, windows, where, no_texture)
        return windows

    def _excluded(self, rows: int, cols: int) -> Windows:
        return Windows(np.zeros((rows, cols), self.sums_dtype), np.full((rows, cols), np.nan, np.float32))

    def _norms(self, step: int, norm: float) -> WindowNorms:
        return WindowNorms(self.window, step, self.share, norm, self.floor)

    def rescale(self, first: int, end: int, left_inverse: Array) -> None:
        """Convert the integers stored for rows `first` to `end` of the grid into scores, in place."""
        for stored in (*self.found.around, *self.found.runner_up[None, : self.rows]):
            if stored.size:
                as_scores(stored[first:end], stored[first:end].view(np.float32), left_inverse, self.score_norm)

    def matches(self) -> WindowMatches:
        """Return the matches found."""
        around = self.found.around.view(np.float32).reshape(-1, 3, self.rows, self.cols)
        no_dy = np.broadcast_to(np.int16(0), self.texture.shape)
        return WindowMatches(
            dy=self.found.dy if self.found.dy.size else no_dy,
            dx=self.found.dx,
            score=around[len(around) // 2, 1],
            around=around,
            texture=self.texture,
            runner_up=self.found.runner_up.view(np.float32) if self.found.runner_up.size else None,
            right_dx=self.right_dx if self.right_dx.size else None,
        )


def comparable(left: Image, right: Image, window: int, score: str) -> tuple[Array, Array, bool, float]:
    """Return both images in the type in which their products are summed: uint8, or float64 about their mean.

    Also return whether all sums are exact integers, and the energy up to which a window is flat.
    """
    if left.dtype == np.uint8 and window <= MAX_EXACT_WINDOW_PX:
        return np.ascontiguousarray(left), np.ascontiguousarray(right), True, flat_energy(window**2, 255, exact=True)
    # One mean for both images, so that both are shifted by the same amount. "ncc" keeps the mean.
    mean = 0.0 if score == "ncc" else float((left.mean(dtype=float) + right.mean(dtype=float)) / 2)
    mean = mean if np.issubdtype(left.dtype, np.floating) else float(np.rint(mean))
    left, right = left.astype(np.float64) - mean, right.astype(np.float64) - mean
    brightest = max(float(np.abs(left).max()), float(np.abs(right).max()))
    whole_numbers = mean == np.rint(mean) and brightest > 1
    exact = whole_numbers and bool((left == np.rint(left)).all() and (right == np.rint(right)).all())
    exact = exact and window**2 * brightest**2 < 2**46
    return left, right, exact, flat_energy(window**2, brightest, exact=exact)


def framed(image: Array, lags: LagRange) -> Array:
    """Return the image padded with zeros, so that every lag of every pixel can be read."""
    return cv2.copyMakeBorder(
        image,
        top=max(0, -lags.dy_first),
        bottom=max(0, lags.dy_last),
        left=max(0, -lags.dx_first),
        right=max(0, lags.dx_first + lanes_for(lags.cols)),
        borderType=cv2.BORDER_CONSTANT,
    )


CACHE_BYTES = 512 * 1024
"""Size of the column sums of a tile, which stay in a core's L2 cache."""

GROUP_BYTES = 24 * 1024
"""Size of the scores of a few windows, which stay in a core's L1 cache."""

BAND_CELLS = 60e6
"""Pixels times lags in a band: about 50 ms."""


def match_windows(query: WindowQuery, progress: Progress = silent) -> WindowMatches:
    """Find the lag at which each window of the left image correlates best with the right image.

    A lag is a candidate only if its right window is wholly inside the right image, and neither flat (``zncc``) nor
    without energy (``ncc``). Scores that differ by less than the resolution, which float32 and the number of lags limit
    (2e-6 for 441 lags), are equal, and the shortest displacement among them wins; see :meth:`LagRange.ranked`. The time
    does not depend on the window's size.

    Parameters
    ----------
    query
        uint8 images have exact integer sums, others float64 sums. `right_matches` needs step 1 and a search without
        vertical reach.
    progress
        Called with the fraction done.

    Raises
    ------
    ValueError
        Images that are not grey or differ in size or dtype, a window larger than they are, a step below 1, more than
        65535 lags, a score or a circular correlation that needs a spectrum, or unsupported `right_matches`.
    """
    lags = query.lags
    if query.score not in ("zncc", "ncc", "cross") or query.circular:
        raise ValueError(
            f"The score is {query.score!r}{', circular' if query.circular else ''}; "
            "allowed are 'zncc', 'ncc' and 'cross', none of them circular."
        )
    if query.right_matches and (query.step > 1 or lags.dy_first != 0 or lags.dy_last != 0):
        raise ValueError(
            f"Matches of the right windows need step 1 and no vertical search; the step is {query.step} and "
            f"dy goes from {lags.dy_first} to {lags.dy_last}."
        )
    pair = PreparedPair(query)
    lag_count = pair.lags.count if pair.lags else 1
    if lag_count > MAX_LAGS:
        raise ValueError(
            f"The search has {lag_count} lags; window sums allow at most {MAX_LAGS}, engine 'fft' any number."
        )
    row_cells = pair.width * lag_count * min(pair.window, 2 * pair.step) / 2
    max_rows = max(1, int(BAND_CELLS / row_cells))  # so that progress is reported often enough
    over_bands(lambda first, end: _match_band(pair, first, end), pair.rows, max_rows=max_rows, progress=progress)
    return pair.matches()


def _match_band(pair: PreparedPair, first: int, end: int) -> None:
    """Match rows `first` to `end` of the window grid, tile by tile."""
    left = pair.left_windows(first, end)
    if pair.lags is not None:
        right = pair.right_windows(first, end)
        top, bottom = first * pair.step, (end - 1) * pair.step + pair.window + pair.lags.rows - 1
        right_rows = changing_rows(pair.right[top + pair.right_row : bottom + pair.right_row], pair.window)
        found = pair.found._replace(right_key=pair.found.right_key[first:end])
        columns = max(CACHE_BYTES // (pair.table.codes.size * np.dtype(pair.sums_dtype).itemsize), 4 * pair.window)
        tile = max(1, (columns - pair.window) // pair.step + 1)
        work = _workspace(pair, min((tile - 1) * pair.step + pair.window, pair.width))
        for col in range(0, pair.cols, tile):
            cols = min(tile, pair.cols - col)
            place = TilePlace(first, col, cols, -top, pair.right_col, pair.window, pair.step, pair.share)
            match_tile(place, pair.left, right_rows, left, right, pair.table, work, found)
    pair.rescale(first, end, left.inverse)
    if pair.lags is not None and pair.right_dx.size:
        margin = max(0, -pair.lags.dx_first)
        keys, right_dx = pair.found.right_key[first:end, margin:], pair.right_dx[first:end]
        as_right_dx(keys, pair.table.dx, pair.table.code_mask, NO_MATCH, right_dx)


def _workspace(pair: PreparedPair, columns: int) -> Workspace:
    lags = pair.table.codes.size
    group = max(1, GROUP_BYTES // (4 * lags))
    return Workspace(
        columns=zeros((columns, lags), pair.sums_dtype),
        window=zeros((lags,), pair.sums_dtype),
        left=LeftTerms(
            np.zeros(group, pair.sums_dtype),
            *(np.zeros(group, np.float32) for _ in ("coarse", "fine", "scale")),
        ),
        scores=zeros((group, lags + LANES), np.int32),
        best=zeros((group, LANES), np.int32),
        codes=zeros((group,), np.int32),
    )


Surface = npt.NDArray[np.float64]

BATCH_BYTES = 32 * 2**20
"""Windows are processed in batches whose padded search areas take about this much memory."""

MIN_POWER_RATIO = 1e-9
"""Share of a spectrum's highest magnitude up to which a frequency has no power, and therefore no phase."""


def match_windows_fft(query: WindowQuery, progress: Progress = silent) -> WindowMatches:
    """Match every window of the left image by FFT, as :func:`match_windows` does.

    Sums of integers are rounded to integers, so that both engines agree to the bit. For other images the sums of both
    are rounded in the sixteenth digit, which changes a 32-bit score once in a million.

    Parameters
    ----------
    query
        `right_matches` is not supported.
    progress
        Called with the fraction done after every batch.

    Raises
    ------
    ValueError
        A query that :class:`PreparedPair` rejects, or one for `right_matches`.
    """
    if query.right_matches:
        raise ValueError("Only window sums find the matches of the right windows.")
    pair = PreparedPair(query)
    if pair.lags is None:
        pair.rescale(0, pair.rows, pair.left_windows(0, pair.rows).inverse)
        progress(1.0)
        return pair.matches()
    scores = _FftScores(pair, pair.lags)
    batch = max(1, BATCH_BYTES // scores.bytes_per_window)
    rows = max(1, batch // pair.cols)
    for first in range(0, pair.rows, rows):
        end = min(first + rows, pair.rows)
        left, right = pair.left_windows(first, end), pair.right_windows(first, end)
        for begin in range(0, left.inverse.size, batch):
            chosen = np.arange(begin, min(begin + batch, left.inverse.size))
            record_windows(pair, first, chosen, left, *scores.score(first, chosen, left, right))
            progress((first * pair.cols + int(chosen[-1]) + 1) / (pair.rows * pair.cols))
        pair.rescale(first, end, left.inverse)
    return pair.matches()


def record_windows(
    pair: PreparedPair,
    first: int,
    chosen: npt.NDArray[np.intp],
    left: Windows,
    scores: npt.NDArray[np.int32],
    best_lanes: npt.NDArray[np.int32],
) -> None:
    """Record the best lags of the chosen windows, counted from row `first` of the grid on."""
    found, table, left_at = pair.found, pair.table, int(chosen[0])
    at = first * pair.cols + left_at
    runner_up_table = table
    if np.count_nonzero(table.codes > 0) > MAX_LAGS:
        # Score and code do not fit in one integer: the best of each window is found separately, without losing bits.
        best_lanes = _best_of_many(scores, table)
        runner_up_table = table._replace(codes=np.minimum(table.codes, 0), code_mask=0)
    codes = np.empty(chosen.size, np.int32)
    record_group(chosen.size, at, left_at, left.inverse, table, best_lanes, scores, codes, found)
    if found.runner_up.size:
        record_runners_up(chosen.size, at, runner_up_table, scores, codes, found.runner_up)


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
    stored, _ = _FftScores(pair, pair.lags).score(top, np.array([left_edge]), left, right)
    stored = stored[0, : pair.table.codes.size].reshape(pair.lags.rows, -1)[:, : pair.lags.cols]
    inverse = float(left.inverse[0, left_edge])
    if inverse > 0:
        scores = np.empty(stored.shape, np.float32)
        as_scores(stored, scores, np.full(stored.shape, inverse, np.float32), pair.score_norm)
        row, col = pair.lags.dy_first - query.lags.dy_first, pair.lags.dx_first - query.lags.dx_first
        surface[row : row + pair.lags.rows, col : col + pair.lags.cols] = scores
    return surface


class _FftScores:
    """Scores of windows at every lag, by FFT, stored as in :mod:`stereolag.stereo.windows.scores`.

    The windows are correlated with larger search areas, zero-padded so that nothing wraps, and the products are scored
    as for window sums. Phase correlation uses only the phase of the spectrum. A circular correlation is with the same
    place in the right image, wrapped around at the window's edges.

    Parameters
    ----------
    pair
        The pair.
    lags
        The lags inside its frame.
    """

    def __init__(self, pair: PreparedPair, lags: LagRange) -> None:
        from scipy import fft  # not needed for window sums

        self.pair, self.lags, self.fft, self.right = pair, lags, fft, pair.right
        if pair.circular:
            self.area = self.fft_shape = (pair.window, pair.window)
        else:
            self.area = (pair.window + lags.rows - 1, pair.window + lags.cols - 1)
            rows, cols = (fft.next_fast_len(side, real=True) for side in self.area)
            self.fft_shape = (rows, cols)
        if pair.score == "phase" and not pair.circular:
            # Padded with the mean, since an edge at the border of the image would contribute phase.
            self.right = framed(pair.plain_right - float(np.mean(pair.left)), lags)
        self.bytes_per_window = 8 * 4 * self.fft_shape[0] * self.fft_shape[1]

    def score(
        self, first: int, chosen: npt.NDArray[np.intp], left: Windows, right: Windows
    ) -> tuple[npt.NDArray[np.int32], npt.NDArray[np.int32]]:
        """Return the scores and the best lanes of the chosen windows, as set by :func:`score_products`.

        Parameters
        ----------
        first
            Row of the grid at which `left` and `right` start.
        chosen
            (n,) consecutive indices of the left windows.
        left, right
            Sums and norms of the windows.
        """
        pair, lags, whitened = self.pair, self.lags, self.pair.score == "phase"
        rows, cols = np.divmod(chosen, pair.cols)
        tops, lefts = (first + rows) * pair.step, cols * pair.step
        windows = _cut(pair.left, tops, lefts, (pair.window, pair.window))
        areas = _cut(self.right, tops + pair.right_row, lefts + pair.right_col, self.area)
        if whitened or (pair.circular and pair.score != "ncc"):
            windows, areas = _mean_free(windows), _mean_free(areas)
        spectrum: Array = self.fft.rfft2(windows, self.fft_shape, workers=-1).conj()
        spectrum *= self.fft.rfft2(areas, self.fft_shape, workers=-1)
        if whitened:
            _whiten(spectrum)
        surface: Surface = self.fft.irfft2(spectrum, self.fft_shape, workers=-1)
        if pair.circular:
            surface = self.fft.fftshift(surface, axes=(1, 2))  # from the first lag to the last
            inverse = right.inverse.reshape(-1)[chosen].astype(np.float64)[:, None, None]
            if not whitened:
                factor = np.full(inverse.shape, 1 / pair.right_norm) if pair.score == "cross" else inverse
                surface *= left.inverse.reshape(-1)[chosen][:, None, None] * factor
            return stored_scores(pair, lags, np.where(inverse > 0, surface, np.nan))
        surface = surface[:, : lags.rows, : lags.cols]
        first_lag = tops - first * pair.step, lefts + pair.right_col
        if whitened:
            candidate = _cut(right.inverse, *first_lag, (lags.rows, lags.cols)) > 0
            return stored_scores(pair, lags, np.where(candidate, surface, np.nan))
        return self._score_products(surface, int(chosen[0]), left, first_lag, right)

    def _score_products(
        self, surface: Surface, left_at: int, left: Windows, first_lag: tuple[Array, Array], right: Windows
    ) -> tuple[npt.NDArray[np.int32], npt.NDArray[np.int32]]:
        """Return the scores of windows from their products; `first_lag` are the right windows at the first lag."""
        pair, lags, table, count = self.pair, self.lags, self.pair.table, len(surface)
        if pair.exact:
            np.rint(surface, out=surface)
        products = np.zeros((count, table.codes.size), pair.sums_dtype)
        products.reshape(count, lags.rows, -1)[:, :, : lags.cols] = surface
        scores, best_lanes = np.zeros((count, table.codes.size + LANES), np.int32), np.empty((count, LANES), np.int32)
        right_at = first_lag[0] * pair.right.shape[1] + first_lag[1]

        given = products, pair.share, left_at, left, right_at, right, table
        over_bands(lambda begin, end: score_products(begin, end, *given, scores, best_lanes), count)
        return scores, best_lanes


def stored_scores(
    pair: PreparedPair, lags: LagRange, scores: Surface
) -> tuple[npt.NDArray[np.int32], npt.NDArray[np.int32]]:
    """Return (n, lag rows, lag cols) scores of -1..1, NaN for none, as stored integers, and the best of each lane.

    They are rounded to the nearest integer, so that the error of an FFT does not decide between equal scores.
    """
    codes, count = pair.table.codes, len(scores)
    stored = np.zeros((count, codes.size + LANES), np.int32)
    strips = stored[:, : codes.size].reshape(count, lags.rows, -1)
    candidate = ~np.isnan(scores)
    strips[:, :, : lags.cols] = np.rint((np.where(candidate, scores, -SCORE_OFFSET) + SCORE_OFFSET) * SCORE_SCALE)
    keys = (stored[:, : codes.size] & ~pair.table.code_mask) | codes
    return stored, keys.reshape(count, -1, LANES).max(axis=1)


def _cut(image: Array, tops: npt.NDArray[np.intp], lefts: npt.NDArray[np.intp], shape: tuple[int, int]) -> Array:
    """Return the (n, *shape) float64 patches of `image` whose top-left pixels are given."""
    return np.lib.stride_tricks.sliding_window_view(image, shape)[tops, lefts].astype(np.float64, copy=False)


def _mean_free(patches: Array) -> Array:
    return np.asarray(patches - patches.mean(axis=(1, 2), keepdims=True))


def _whiten(spectrum: Array) -> None:
    """Keep only the phase of a cross-power spectrum; frequencies without power are set to 0."""
    magnitude = np.abs(spectrum)
    floor = MIN_POWER_RATIO * magnitude.max(axis=(1, 2), keepdims=True)
    np.divide(spectrum, magnitude, out=spectrum, where=magnitude > floor)
    spectrum[magnitude <= floor] = 0
