"""The two engines that match windows, and the cost model that chooses between them."""

from __future__ import annotations

import math
from typing import Literal, TypeAlias

from stereolag.progress import Progress, silent
from stereolag.stereo.windows.matches import WindowMatches, WindowQuery
from stereolag.stereo.windows.search import MOST_LAGS, LagRange
from stereolag.stereo.windows.window_fft import match_windows_fft
from stereolag.stereo.windows.window_sums import match_windows

Engine: TypeAlias = Literal["window_sums", "fft"]

SUMS_SECONDS = 1.2e-10
"""Running sums: seconds per pixel and lag, two cores; they visit every pixel whatever the step."""

FFT_SECONDS = 2.1e-9
"""Batched FFT: seconds per point of a padded search area and doubling of its size."""


def find_matches(query: WindowQuery, engine: Engine, progress: Progress = silent) -> WindowMatches:
    """Match every window with the engine named; both find the same, to the bit where the images hold integers.

    `right_matches`, the best left window of every right one, is had by window sums alone.
    """
    return (match_windows_fft if engine == "fft" else match_windows)(query, progress)


def cheaper_engine(shape: tuple[int, int], window_size: int, step: int, lags: LagRange) -> Engine:
    """Return the engine that should need less time.

    Window sums cost pixels × lags, whatever the window; batched FFT costs windows × N log N, N being the area of a
    window's search area. So the FFT is favoured where windows hardly overlap and the search is two-dimensional and
    several times as large as they are; on all else measured (windows 8 to 40 px, 64 to 14,641 lags) sums are faster,
    mostly ten times and more. Searches of more than 65535 lags are the FFT's alone.
    """
    if lags.count > MOST_LAGS:
        return "fft"
    by_sums = predicted_seconds(shape, window_size, step, lags, "window_sums")
    by_fft = predicted_seconds(shape, window_size, step, lags, "fft")
    return "window_sums" if by_sums <= by_fft else "fft"


def predicted_seconds(shape: tuple[int, int], window_size: int, step: int, lags: LagRange, engine: Engine) -> float:
    """Return how long an engine will take to match all windows, s."""
    if engine == "window_sums":
        return shape[0] * shape[1] * lags.rows * lags.cols * SUMS_SECONDS
    rows, cols = ((side - window_size) // step + 1 for side in shape)
    area = (window_size + lags.rows - 1) * (window_size + lags.cols - 1)
    return rows * cols * area * math.log2(area) * FFT_SECONDS
