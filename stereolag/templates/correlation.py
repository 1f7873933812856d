"""The correlation coefficient (ZNCC) of every window, from its sums: the last step of a template search."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

from stereolag.loops.compilation import compiled

Array64 = npt.NDArray[np.float64]


def pearson(products: Array64, energy: Array64, norm: float, tolerance: float) -> npt.NDArray[np.float32]:
    """Return the score of each window, -1..1, NaN where the window is flat.

    Parameters
    ----------
    products
        (rows, cols), the sum of products of the deviations of window and template.
    energy
        (rows, cols), the sum of squared deviations of the window.
    norm
        Root of the summed squared deviations of the template.
    tolerance
        A window with no more energy than this is flat.
    """
    varies = energy > tolerance
    scores = products / (norm * np.sqrt(np.where(varies, energy, 1.0)))
    return np.where(varies, np.clip(scores, -1.0, 1.0), np.nan).astype(np.float32)


@compiled
def fill_pearson(scores: npt.NDArray[Any], products: Array64, energy: Array64, norm: float, tolerance: float) -> None:
    """Write :func:`pearson` into `scores` (rows, cols); the other arrays may be larger; their excess is not read."""
    rows, cols = scores.shape
    # A separate contiguous line lets the compiler vectorise over the columns.
    line = np.empty(cols, dtype=np.float32)
    for row in range(rows):
        for col in range(cols):
            score = products[row, col] / (norm * np.sqrt(energy[row, col]))
            score = 1.0 if score > 1.0 else score
            score = -1.0 if score < -1.0 else score
            line[col] = score if energy[row, col] > tolerance else np.nan
        scores[row] = line


def running_box_energy_reference(planes: Array64, height: int, width: int) -> Array64:
    """Return the squared deviations of each window from the mean of each channel, summed over all channels.

    Parameters
    ----------
    planes
        (channels, rows, cols).
    height, width
        Size of the window, px.

    Returns
    -------
    ndarray
        (rows - height + 1, cols - width + 1).
    """
    windows = np.lib.stride_tricks.sliding_window_view(planes, (height, width), axis=(1, 2))
    deviations = windows - windows.mean(axis=(3, 4), keepdims=True)
    return np.asarray(np.square(deviations).sum(axis=(0, 3, 4)))


@compiled
def running_box_energy(planes: Array64, height: int, width: int) -> Array64:
    """Return the result of :func:`running_box_energy_reference` at a cost independent of the window.

    Sums run down the columns, then along the row. Sums of integers below 2**26 are exact. Shift the mean of other
    numbers near 0 first: a running sum adds and subtracts every value, with a rounding error relative to the largest.
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


Indices = npt.NDArray[np.intp]


def score_at(
    image: npt.NDArray[Any], deviations: npt.NDArray[np.float64], opaque: npt.NDArray[np.bool_], row: int, col: int
) -> float:
    """Return the score of one position, -1..1, NaN where the window is flat.

    Parameters
    ----------
    image
        (rows, cols, channels).
    deviations
        (channels, height, width), the template with its mean removed, 0 where not opaque.
    opaque
        (height, width), the pixels that are compared.
    row, col
        Top-left pixel of the position.
    """
    height, width = opaque.shape
    pixels = image[row : row + height, col : col + width][opaque].astype(np.float64)
    relative = pixels - pixels[0]
    window = relative - relative.mean(axis=0)
    norm = np.linalg.norm(window) * np.linalg.norm(deviations)
    if norm == 0:
        return float("nan")
    return float(np.clip(np.sum(window * deviations[:, opaque].T) / norm, -1.0, 1.0))


@compiled
def scores_at(
    image: npt.NDArray[Any],
    deviations: npt.NDArray[np.float64],
    opaque: npt.NDArray[np.bool_],
    rows: Indices,
    cols: Indices,
) -> npt.NDArray[np.float64]:
    """Return :func:`score_at` at each of `rows`, `cols`."""
    height, width = opaque.shape
    channels = deviations.shape[0]
    template_energy = (deviations**2).sum()
    count = opaque.sum()
    scores = np.empty(len(rows))
    for index in range(len(rows)):
        top, left = rows[index], cols[index]
        product = 0.0
        energy = 0.0
        for channel in range(channels):
            # Relative to its first pixel, a flat window is exactly 0, and a large offset costs no precision.
            first = float(image[top, left, channel])
            total = 0.0
            for row in range(height):
                for col in range(width):
                    if opaque[row, col]:
                        total += float(image[top + row, left + col, channel]) - first
            mean = total / count
            for row in range(height):
                for col in range(width):
                    if opaque[row, col]:
                        deviation = float(image[top + row, left + col, channel]) - first - mean
                        product += deviation * deviations[channel, row, col]
                        energy += deviation * deviation
        scores[index] = np.nan
        if energy > 0:
            scores[index] = max(-1.0, min(1.0, product / np.sqrt(template_energy * energy)))
    return scores
