"""How much every rectangular window of an image varies: the sum of its squared deviations from its mean."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
from numba import njit

from stereolag.kernels.compilation import KEPT

Array64 = npt.NDArray[np.float64]


def box_energy(planes: Array64, height: int, width: int) -> Array64:
    """Return the squared deviations of each window from the mean of each channel, summed over all its channels.

    Parameters
    ----------
    planes
        (channels, rows, cols).
    height, width
        Of the window, px.

    Returns
    -------
    ndarray
        (rows - height + 1, cols - width + 1).
    """
    windows = np.lib.stride_tricks.sliding_window_view(planes, (height, width), axis=(1, 2))
    deviations = windows - windows.mean(axis=(3, 4), keepdims=True)
    return np.asarray(np.square(deviations).sum(axis=(0, 3, 4)))


@njit(nogil=True, cache=KEPT)
def running_box_energy(planes: Array64, height: int, width: int) -> Array64:
    """Return :func:`box_energy` at a cost independent of the window: sums run down the columns, then along the row.

    The sums of integers below 2**26 are exact. Of other numbers bring the mean near 0 first: what a running sum
    adds and takes away again leaves a rounding error relative to the largest value.
    """
    channels, rows, cols = planes.shape
    energy: Array64 = np.zeros((rows - height + 1, cols - width + 1))
    share = 1.0 / (height * width)
    for channel in range(channels):
        plane = planes[channel]
        column_sums = np.zeros(cols)
        column_squares = np.zeros(cols)
        for row in range(rows):
            for col in range(cols):
                value = plane[row, col]
                column_sums[col] += value
                column_squares[col] += value * value
            if row < height - 1:
                continue
            top = row - height + 1
            total = 0.0
            total_squares = 0.0
            for col in range(width - 1):
                total += column_sums[col]
                total_squares += column_squares[col]
            for col in range(cols - width + 1):
                total += column_sums[col + width - 1]
                total_squares += column_squares[col + width - 1]
                energy[top, col] += total_squares - total * total * share
                total -= column_sums[col]
                total_squares -= column_squares[col]
            for col in range(cols):
                value = plane[top, col]
                column_sums[col] -= value
                column_squares[col] -= value * value
    return energy
