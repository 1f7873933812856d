"""The two engines that match windows, and the cost model that chooses between them."""

from __future__ import annotations

import math
from typing import Literal, TypeAlias

import numpy as np
import numpy.typing as npt

from stereolag.core.jobs import COSTS, Estimate, Progress, silent
from stereolag.stereo.matcher import grey_bytes
from stereolag.stereo.windows.matches import Score, WindowMatches, WindowQuery
from stereolag.stereo.windows.search import MOST_LAGS, LagRange
from stereolag.stereo.windows.window_fft import BATCH_BYTES, match_windows_fft
from stereolag.stereo.windows.window_sums import match_windows

Engine: TypeAlias = Literal["window_sums", "fft"]


def find_matches(query: WindowQuery, engine: Engine, progress: Progress = silent) -> WindowMatches:
    """Match every window with the given engine; both give the same result, bit for bit if the images are integers.

    Only window sums support `right_matches`, the best left window of every right window.
    """
    return (match_windows_fft if engine == "fft" else match_windows)(query, progress)


def cheaper_engine(shape: tuple[int, int], window_size: int, step: int, lags: LagRange) -> Engine:
    """Return the engine that is expected to be faster.

    Window sums cost pixels × lags, whatever the window; batched FFT costs windows × N log N, where N is the area of a
    window's search area. So FFT wins where windows hardly overlap and the search is two-dimensional and several times
    their size; in all other cases measured (windows 8 to 40 px, 64 to 14,641 lags) sums are faster, mostly by ten times
    or more. Only FFT can search more than 65535 lags.
    """
    if lags.count > MOST_LAGS:
        return "fft"
    seconds = COSTS["windows"].seconds
    by_sums = seconds["products"] * products(shape, lags)
    by_fft = seconds["turns"] * turns(shape, window_size, step, lags)
    return "window_sums" if by_sums <= by_fft else "fft"


def products(shape: tuple[int, ...], lags: LagRange) -> int:
    """Return the number of products that running sums take: every pixel at every lag, whatever the step."""
    return shape[0] * shape[1] * lags.rows * lags.cols


def turns(shape: tuple[int, ...], window_size: int, step: int, lags: LagRange) -> float:
    """Return the work of the batched FFT: N log2 N for every window, with N the points of its padded search area."""
    rows, cols = ((side - window_size) // step + 1 for side in shape[:2])
    area = (window_size + lags.rows - 1) * (window_size + lags.cols - 1)
    return rows * cols * area * math.log2(area)


BYTES_OF_A_POINT = 32
"""Bytes that the batched FFT allows per point of a search area."""

SLOWER_WHOLE, SLOWER_DOUBLE, SLOWER_FFT, WHITENED = 3, 8, 1.5, 5
"""Ratio of a whole match's time to its products: sums of uint8, sums of float64, FFT, and whitened FFT."""


def estimate_windows(
    shape: tuple[int, ...],
    dtype: npt.DTypeLike,
    *,
    window_size: int,
    step: int,
    lags: LagRange,
    engine: Engine,
    score: Score,
    circular: bool,
    both_views: bool,
    finished: bool,
) -> Estimate:
    """Return the memory and time of matching window by window.

    Parameters
    ----------
    shape, dtype
        Shape, (rows, cols) or (rows, cols, channels), and dtype of one image.
    window_size, step, lags, engine, score, circular
        As in :class:`stereolag.stereo.windows.matches.WindowQuery`; `engine` is the one that answers it.
    both_views
        Whether the best left window of every right window is found too.
    finished
        Whether the map is filtered or filled.
    """
    (height, width), pixels = shape[:2], shape[0] * shape[1]
    rows, cols = (max(1, (side - window_size) // step + 1) for side in (height, width))
    windows = rows * cols
    # Bytes per window: scores at and around the peak, lag, texture, runner-up and sub-pixel offset.
    record = (4 * 9 + 4 if lags.rows > 1 else 4 * 3 + 2) + 4 + 4 + 8 + 2 * both_views
    whole, by_sums = np.dtype(dtype) == np.uint8, engine == "window_sums"
    margin = (height + lags.rows) * (width + lags.cols + 32)
    # Pixels of other types are compared as float64: a plain copy, a padded one, and a temporary one. Running sums of
    # whole numbers pack entering rows with leaving ones; whitening takes another copy.
    prepared = (6 if by_sums else 2) * margin if whole else 8 * (4 * pixels + margin)
    prepared += 8 * (pixels + margin) * (score == "phase")
    area = window_size**2 if circular else (window_size + lags.rows) * (window_size + lags.cols)
    return COSTS["windows"].estimate(
        grey=grey_bytes(shape, dtype),
        pixels=pixels,
        finished=pixels * finished,
        prepared=prepared,
        records=record * windows,
        windows=windows,
        seen=windows * both_views,
        columns=(lags.rows + step) * (width + lags.cols) * by_sums,
        batch=0 if by_sums else min(BATCH_BYTES, BYTES_OF_A_POINT * area * windows),
        products=by_sums * products(shape, lags) * (SLOWER_WHOLE if whole else SLOWER_DOUBLE),
        turns=(not by_sums) * turns(shape, window_size, step, lags) * (WHITENED if score == "phase" else SLOWER_FFT),
    )
