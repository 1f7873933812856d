"""The plain formulas that the compiled loops must equal: slow, and short enough to check by eye."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt
from numpy.lib.stride_tricks import sliding_window_view

from stereolag.kernels.lag_range import LagRange

Array = npt.NDArray[Any]


def score_lag(left_windows: Array, right_windows: Array, score: str) -> npt.NDArray[np.float64]:
    """Return the score of each left window with the right window at the same place; NaN where there is none.

    Parameters
    ----------
    left_windows, right_windows
        (rows, cols, window, window).
    score
        ``"zncc"`` is Pearson's correlation, ``"ncc"`` equation 1.3 of the report, ``"cross"`` the numerator of the
        first.
    """
    left, right = left_windows.astype(np.float64), right_windows.astype(np.float64)
    flat = np.ptp(left, axis=(2, 3)) == 0
    if score != "ncc":
        left = left - left.mean((2, 3), keepdims=True)
        right = right - right.mean((2, 3), keepdims=True)
    products = (left * right).sum((2, 3))
    if score == "cross":
        return np.where(flat, np.nan, products)
    flat |= (np.ptp(right_windows, axis=(2, 3)) == 0) if score == "zncc" else ~right.any((2, 3))
    norms = np.sqrt((left**2).sum((2, 3)) * (right**2).sum((2, 3)))
    return np.where(flat, np.nan, products / np.where(flat, 1, norms))


def score_volume(
    left: Array, right: Array, *, window_size: int, step: int, search: LagRange, score: str
) -> npt.NDArray[np.float64]:
    """Return (dy, dx, rows, cols): the score of every window at every lag, NaN where that is no candidate."""
    left_windows = sliding_window_view(left, (window_size, window_size))[::step, ::step]
    right_windows = sliding_window_view(right, (window_size, window_size))
    volume = np.full((search.rows, search.cols, *left_windows.shape[:2]), np.nan)
    y, x = step * np.arange(left_windows.shape[0]), step * np.arange(left_windows.shape[1])
    for row, dy in enumerate(range(search.dy_first, search.dy_last + 1)):
        for col, dx in enumerate(range(search.dx_first, search.dx_last + 1)):
            i = np.flatnonzero((y + dy >= 0) & (y + dy < right_windows.shape[0]))
            j = np.flatnonzero((x + dx >= 0) & (x + dx < right_windows.shape[1]))
            here, there = np.ix_(i, j), np.ix_(y[i] + dy, x[j] + dx)
            volume[row, col][here] = score_lag(left_windows[here], right_windows[there], score)
    return volume
