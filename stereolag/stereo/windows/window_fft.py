"""Window matching by batched FFT: every window against its own search area, many at a time.

Beside :mod:`stereolag.stereo.windows.window_sums` this engine pays where windows are few (a low overlap) and the
search is large, and it is the only one for scores that need a spectrum: phase correlation, and the circular
correlation of an unpadded search.
"""

from __future__ import annotations

from typing import TypeVar

import numpy as np
import numpy.typing as npt
import scipy.fft

from stereolag.progress import Progress, silent
from stereolag.stereo.windows.matches import WindowMatches, WindowQuery
from stereolag.stereo.windows.search import LagRange

Spectrum = npt.NDArray[np.complex128]
Surface = npt.NDArray[np.float64]
Pixel = TypeVar("Pixel", bound=np.generic)

BATCH_BYTES = 32 * 2**20
"""Windows are taken in batches whose padded search areas fill about this much memory."""

TIE = 1e-9
"""Scores closer than this are equal: the rounding of an FFT must not choose between them."""

FLAT = 1e-12
"""A window is flat when its variance is below this share of the image's own energy: what rounding leaves of zero."""


def match_windows_fft(query: WindowQuery, progress: Progress = silent) -> WindowMatches:
    """Match every window of the left image by FFT; the answer equals that of the window sums.

    Parameters
    ----------
    query
        `right_matches` are not had by FFT.
    progress
        Called with the fraction done after every batch.
    """
    scorer = _scorer(query)
    window_size, lags, (n_rows, n_cols) = query.window_size, query.lags, query.grid
    rows = np.arange(0, query.left.shape[0] - window_size + 1, query.step)
    cols = np.arange(0, query.left.shape[1] - window_size + 1, query.step)
    count, vertical = n_rows * n_cols, 3 if lags.rows > 1 else 1
    best = np.empty((2, count), dtype=np.int16)
    around = np.empty((vertical, 3, count), dtype=np.float32)
    second, texture = np.empty((2, count), dtype=np.float32)
    batch = max(1, BATCH_BYTES // scorer.bytes_per_window)
    for start in range(0, count, batch):
        some = np.arange(start, min(start + batch, count))
        surface, texture[some] = scorer.score(rows[some // n_cols], cols[some % n_cols])
        peak = _peaks(surface, lags)
        best[:, some] = peak + np.array([[lags.dy_first], [lags.dx_first]])
        around[:, :, some] = _around(surface, peak, vertical, wrapped=query.circular)
        if query.runner_up:
            second[some] = _runners_up(surface, peak)
        progress((some[-1] + 1) / count)
    scores = around.reshape(vertical, 3, n_rows, n_cols)
    score_at_peak = scores[vertical // 2, 1].copy()
    none = np.isnan(score_at_peak)
    dy, dx = np.where(none, np.int16(0), best.reshape(2, n_rows, n_cols))
    return WindowMatches(
        dy=dy,
        dx=dx,
        score=score_at_peak,
        around=scores,
        texture=texture.reshape(n_rows, n_cols),
        runner_up=second.reshape(n_rows, n_cols) if query.runner_up else None,
    )


def score_surface(query: WindowQuery, top: int, left_edge: int) -> Surface:
    """Return the (lag rows, lag cols) float64 scores of the one window whose top-left pixel is given.

    NaN = no candidate. :func:`match_windows_fft` finds its peaks on these surfaces.
    """
    surfaces, _ = _scorer(query).score(np.array([top]), np.array([left_edge]))
    only: Surface = surfaces[0]
    return only


def _scorer(query: WindowQuery) -> _CircularSurfaces | _LinearSurfaces:
    # The scores that remove means do not see a common offset; taking it away keeps the sums small and so exact.
    offset = 0.0 if query.score == "ncc" else float(np.mean(query.left, dtype=np.float64))
    surfaces = _CircularSurfaces if query.circular else _LinearSurfaces
    left, right = (image.astype(np.float64) - offset for image in (query.left, query.right))
    return surfaces(left, right, query.window_size, query.lags, query.score)


class _LinearSurfaces:
    """Scores of windows inside larger search areas: zero-padded, so nothing wraps."""

    def __init__(self, left: Surface, right: Surface, window_size: int, lags: LagRange, score: str) -> None:
        self.left, self.window_size, self.lags, self.kind = left, window_size, lags, score
        height, width = window_size + lags.rows - 1, window_size + lags.cols - 1
        self.fft_shape = (scipy.fft.next_fast_len(height, real=True), scipy.fft.next_fast_len(width, real=True))
        self.search_shape = (height, width)
        self.bytes_per_window = 8 * 4 * self.fft_shape[0] * self.fft_shape[1]
        # A frame of zeros around the right image lets every search area be cut the same way; lags that reach into
        # it are struck out again.
        self.margin = (
            max(0, -lags.dy_first),
            max(0, lags.dy_last),
            max(0, -lags.dx_first),
            max(0, lags.dx_last),
        )
        top, bottom, before, after = self.margin
        self.padded = np.pad(right, ((top, bottom), (before, after)))
        inside = np.pad(np.ones(right.shape, dtype=np.bool_), ((top, bottom), (before, after)))
        count = window_size**2
        sums = _window_sums(self.padded, window_size)
        self.variance = np.maximum(_window_sums(self.padded**2, window_size) - sums**2 / count, 0)
        self.energy = _window_sums(self.padded**2, window_size) if score == "ncc" else self.variance
        self.inside = _window_sums(inside.astype(np.float64), window_size) == count
        self.flat = FLAT * count * float(np.mean(right**2) + np.mean(left**2))

    def score(self, tops: npt.NDArray[np.intp], lefts: npt.NDArray[np.intp]) -> tuple[Surface, Surface]:
        """Return the (n, lag rows, lag cols) scores, NaN where no candidate, and the (n,) texture of each window."""
        size, lags = self.window_size, self.lags
        windows = _cut(self.left, tops, lefts, (size, size))
        mean_free = windows - windows.mean(axis=(1, 2), keepdims=True)
        norm = np.sqrt((windows**2 if self.kind == "ncc" else mean_free**2).sum(axis=(1, 2)))
        texture = np.sqrt((mean_free**2).mean(axis=(1, 2)))
        starts = tops + self.margin[0] + lags.dy_first, lefts + self.margin[2] + lags.dx_first
        areas = _cut(self.padded, *starts, self.search_shape)
        pattern = windows if self.kind == "ncc" else mean_free
        if self.kind == "phase":
            areas = areas - areas.mean(axis=(1, 2), keepdims=True)
        spectrum: Spectrum = scipy.fft.rfft2(pattern, self.fft_shape, workers=-1).conj()
        spectrum *= scipy.fft.rfft2(areas, self.fft_shape, workers=-1)
        if self.kind == "phase":
            _whiten(spectrum)
        surface = scipy.fft.irfft2(spectrum, self.fft_shape, workers=-1)[:, : lags.rows, : lags.cols]
        candidate = _cut(self.inside, *starts, (lags.rows, lags.cols))
        if self.kind in ("zncc", "ncc"):
            energy = _cut(self.energy, *starts, (lags.rows, lags.cols))
            candidate = candidate & (energy > self.flat)
            with np.errstate(divide="ignore", invalid="ignore"):
                surface = surface / (np.sqrt(energy) * norm[:, None, None])
            surface = np.clip(surface, -1, 1)
        candidate = candidate & (texture**2 * self.window_size**2 > self.flat)[:, None, None]
        return np.where(candidate, surface, np.nan), texture


class _CircularSurfaces:
    """Scores of windows against the same place of the right image, wrapped around at the window's edges."""

    def __init__(self, left: Surface, right: Surface, window_size: int, lags: LagRange, score: str) -> None:
        self.left, self.right, self.window_size, self.kind = left, right, window_size, score
        self.order = np.ix_(
            np.arange(lags.dy_first, lags.dy_last + 1) % window_size,
            np.arange(lags.dx_first, lags.dx_last + 1) % window_size,
        )
        self.bytes_per_window = 8 * 4 * window_size**2
        self.flat = FLAT * window_size**2 * float(np.mean(right**2) + np.mean(left**2))

    def score(self, tops: npt.NDArray[np.intp], lefts: npt.NDArray[np.intp]) -> tuple[Surface, Surface]:
        """Return the (n, lag rows, lag cols) circular scores and the (n,) texture of each window."""
        shape = (self.window_size, self.window_size)
        pair = [_cut(image, tops, lefts, shape) for image in (self.left, self.right)]
        texture = pair[0].std(axis=(1, 2))
        if self.kind != "ncc":
            pair = [windows - windows.mean(axis=(1, 2), keepdims=True) for windows in pair]
        energy = [(windows**2).sum(axis=(1, 2)) for windows in pair]
        spectrum: Spectrum = scipy.fft.rfft2(pair[0], workers=-1).conj()
        spectrum *= scipy.fft.rfft2(pair[1], workers=-1)
        if self.kind == "phase":
            _whiten(spectrum)
        surface = scipy.fft.irfft2(spectrum, shape, workers=-1)[:, self.order[0], self.order[1]]
        candidate = (texture**2 * self.window_size**2 > self.flat) & (energy[1] > self.flat)
        if self.kind in ("zncc", "ncc"):
            with np.errstate(divide="ignore", invalid="ignore"):
                surface = np.clip(surface / np.sqrt(energy[0] * energy[1])[:, None, None], -1, 1)
        return np.where(candidate[:, None, None], surface, np.nan), texture


def _cut(
    image: npt.NDArray[Pixel], tops: npt.NDArray[np.intp], lefts: npt.NDArray[np.intp], shape: tuple[int, int]
) -> npt.NDArray[Pixel]:
    """Return the (n, *shape) patches of `image` whose top-left pixels are given."""
    return np.lib.stride_tricks.sliding_window_view(image, shape)[tops, lefts]


def _window_sums(image: Surface, size: int) -> Surface:
    """Return the sum over every `size` × `size` window, from the summed-area table (Crow 1984)."""
    table = np.pad(image, ((1, 0), (1, 0))).cumsum(axis=0).cumsum(axis=1)
    sums: Surface = table[size:, size:] - table[:-size, size:] - table[size:, :-size] + table[:-size, :-size]
    return sums


def _whiten(spectrum: Spectrum) -> None:
    """Leave only the phase of a cross-power spectrum; where there is no power there is no phase either."""
    magnitude = np.abs(spectrum)
    floor = 1e-9 * magnitude.max(axis=(1, 2), keepdims=True)
    np.divide(spectrum, magnitude, out=spectrum, where=magnitude > floor)
    spectrum[magnitude <= floor] = 0


def _peaks(surface: Surface, lags: LagRange) -> npt.NDArray[np.intp]:
    """Return the (2, n) row and column of the highest score of every (n, lag rows, lag cols) surface.

    Of equal maxima, as periodic pictures have them, the smallest displacement wins.
    """
    dy, dx = np.mgrid[lags.dy_first : lags.dy_last + 1, lags.dx_first : lags.dx_last + 1].reshape(2, -1)
    nearest_first = np.lexsort((dx, dy, dy**2 + dx**2))
    scores = np.where(np.isnan(surface), -np.inf, surface).reshape(surface.shape[0], -1)[:, nearest_first]
    highest = scores.max(axis=1, keepdims=True)
    first = np.argmax(scores >= highest - TIE * np.abs(highest), axis=1)
    return np.stack(np.divmod(nearest_first[first], lags.cols))


def _around(surface: Surface, peak: npt.NDArray[np.intp], vertical: int, *, wrapped: bool) -> Surface:
    """Return the (vertical, 3, n) scores around the peak of every surface; NaN outside, or the far side if wrapped."""
    border = ((0, 0), (1, 1), (1, 1))
    framed = np.pad(surface, border, mode="wrap") if wrapped else np.pad(surface, border, constant_values=np.nan)
    down, across = np.mgrid[-(vertical // 2) : vertical // 2 + 1, -1:2]
    each = np.arange(surface.shape[0])
    beside: Surface = framed[each, peak[0] + 1 + down[..., None], peak[1] + 1 + across[..., None]]
    return beside


def _runners_up(surface: Surface, peak: npt.NDArray[np.intp]) -> Surface:
    """Return the best score farther than 1 px from the peak of every surface; NaN where there is none."""
    rows, cols = np.arange(surface.shape[1])[:, None], np.arange(surface.shape[2])
    near = (np.abs(rows - peak[0][:, None, None]) <= 1) & (np.abs(cols - peak[1][:, None, None]) <= 1)
    second = np.where(near | np.isnan(surface), -np.inf, surface).max(axis=(1, 2))
    return np.where(np.isfinite(second), second, np.nan)
