"""The two engines that match windows, and the cost model that chooses between them."""

from __future__ import annotations

import math
from typing import Literal, TypeAlias

import numpy as np
import numpy.typing as npt

from stereolag.core.estimates import OVERHEAD, Estimate, kept_blocks
from stereolag.core.progress import Progress, silent
from stereolag.stereo.estimates import ANSWER, FINISHING, PIXEL_SECONDS, Shape, grey_bytes
from stereolag.stereo.windows.matches import Score, WindowMatches, WindowQuery
from stereolag.stereo.windows.search import MOST_LAGS, LagRange
from stereolag.stereo.windows.window_fft import BATCH_BYTES, match_windows_fft
from stereolag.stereo.windows.window_sums import match_windows

Engine: TypeAlias = Literal["window_sums", "fft"]

SUMS_SECONDS = 1.2e-10
"""Running sums: seconds per pixel and lag on two cores; they visit every pixel whatever the step."""

FFT_SECONDS = 2.1e-9
"""Batched FFT: seconds per N log2 N, with N the points of a padded search area."""


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
    by_sums = predicted_seconds(shape, window_size, step, lags, "window_sums")
    by_fft = predicted_seconds(shape, window_size, step, lags, "fft")
    return "window_sums" if by_sums <= by_fft else "fft"


def predicted_seconds(shape: tuple[int, int], window_size: int, step: int, lags: LagRange, engine: Engine) -> float:
    """Return the time an engine takes to match all windows, s."""
    if engine == "window_sums":
        return shape[0] * shape[1] * lags.rows * lags.cols * SUMS_SECONDS
    rows, cols = ((side - window_size) // step + 1 for side in shape)
    area = (window_size + lags.rows - 1) * (window_size + lags.cols - 1)
    return rows * cols * area * math.log2(area) * FFT_SECONDS


WINDOW_CHECKS = 24
"""Bytes per window while the left-right check compares the two directions."""

BYTES_OF_A_POINT = 32
"""Bytes that the batched FFT allows per point of a search area."""

SLOWER_WHOLE, SLOWER_DOUBLE, SLOWER_FFT, SLOWER_WHITENED = 3, 8, 1.5, 5
"""Ratio of a whole match's time to the prediction: sums of uint8, sums of float64, FFT, and whitened FFT."""


def estimate_windows(
    shape: Shape,
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
    kept = (4 * 9 + 4 if lags.rows > 1 else 4 * 3 + 2) + 4 + 4 + 8 + 2 * both_views
    images = grey_bytes(shape, dtype)
    whole = np.dtype(dtype) == np.uint8
    margin = (height + lags.rows) * (width + lags.cols + 32)
    # Pixels of other types are compared as float64: a plain copy, a padded one, and a temporary one.
    matching = 2 * margin if whole else 8 * (4 * pixels + margin)
    if whole and engine == "window_sums":
        matching += 4 * margin  # entering rows packed with leaving ones
    if engine == "fft":
        slower = SLOWER_WHITENED if score == "phase" else SLOWER_FFT
        area = window_size**2 if circular else (window_size + lags.rows) * (window_size + lags.cols)
        matching += min(BATCH_BYTES, BYTES_OF_A_POINT * area * windows) * 5 // 4 + kept * windows
        if score == "phase":
            matching += 8 * (pixels + margin)
    else:
        slower = SLOWER_WHOLE if whole else SLOWER_DOUBLE
        matching += (kept + 4 * both_views) * windows + 2 * 12 * (lags.rows + step) * (width + lags.cols)
    stages = [
        matching,
        kept * windows + WINDOW_CHECKS * windows * both_views,
        (kept + 2) * windows + ANSWER * pixels,
        FINISHING * pixels * finished,
    ]
    seconds = PIXEL_SECONDS * pixels + slower * predicted_seconds((height, width), window_size, step, lags, engine)
    return Estimate(images + max(stages) + kept_blocks(4 * pixels, 3) + OVERHEAD, seconds)
