"""The correlation coefficient (ZNCC) of every window, from its sums: the last step of a template search."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt
from numba import njit

from stereolag.kernels.compilation import KEPT

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
        A window of no more energy than this is flat.
    """
    varies = energy > tolerance
    scores = products / (norm * np.sqrt(np.where(varies, energy, 1.0)))
    return np.where(varies, np.clip(scores, -1.0, 1.0), np.nan).astype(np.float32)


@njit(nogil=True, cache=KEPT, error_model="numpy")
def fill_pearson(scores: npt.NDArray[Any], products: Array64, energy: Array64, norm: float, tolerance: float) -> None:
    """Write :func:`pearson` into `scores` (rows, cols); the other arrays may be larger, their excess is not read."""
    rows, cols = scores.shape
    # A contiguous line of its own lets the compiler take several columns at once.
    line = np.empty(cols, dtype=np.float32)
    for row in range(rows):
        for col in range(cols):
            score = products[row, col] / (norm * np.sqrt(energy[row, col]))
            score = 1.0 if score > 1.0 else score
            score = -1.0 if score < -1.0 else score
            line[col] = score if energy[row, col] > tolerance else np.nan
        scores[row] = line
