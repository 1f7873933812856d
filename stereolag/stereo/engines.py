"""The two engines that match windows, and the cost model that chooses between them."""

from __future__ import annotations

import math
from typing import Literal, TypeAlias

from stereolag.inputs import Image
from stereolag.kernels.lag_range import LagRange
from stereolag.kernels.matches import WindowMatches
from stereolag.kernels.window_fft import match_windows_fft
from stereolag.kernels.window_sums import match_windows
from stereolag.progress import Progress, silent

Engine: TypeAlias = Literal["window_sums", "fft"]
Score: TypeAlias = Literal["zncc", "ncc", "cross", "phase"]

SUMS_SECONDS = 1.2e-10
"""Running sums: seconds a pixel and lag, two cores; they visit every pixel whatever the step."""

FFT_SECONDS = 2.1e-9
"""Batched FFT: seconds a point of a padded search area and doubling of its size."""


def cheaper_engine(shape: tuple[int, int], window_size: int, step: int, lags: LagRange) -> Engine:
    """Return the engine that should need less time.

    Window sums cost pixels × lags, whatever the window; batched FFT costs windows × N log N, N being the area of a
    window's search area. So the FFT is favoured where windows hardly overlap and the search is two-dimensional and
    several times as large as they are; on all else measured (windows 8 to 40 px, 64 to 14,641 lags) sums are faster,
    mostly ten times and more.
    """
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


def find_matches(
    left: Image,
    right: Image,
    *,
    engine: Engine,
    score: Score,
    window_size: int,
    step: int,
    lags: LagRange,
    circular: bool,
    runner_up: bool = False,
    right_matches: bool = False,
    progress: Progress = silent,
) -> WindowMatches:
    """Match every window of `left` with the engine named; both give the same answer.

    `right_matches`, the best left window of every right one, is had by window sums alone.
    """
    if engine == "fft":
        return match_windows_fft(
            left,
            right,
            window_size=window_size,
            step=step,
            lags=lags,
            score=score,
            circular=circular,
            runner_up=runner_up,
            progress=progress,
        )
    return match_windows(
        left,
        right,
        window_size=window_size,
        step=step,
        search=lags,
        score=score,
        runner_up=runner_up,
        right_matches=right_matches,
        progress=progress,
    )
