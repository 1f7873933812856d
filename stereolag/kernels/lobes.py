"""How far the main lobe of a correlation peak reaches."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
from numba import njit

from stereolag.kernels.compilation import KEPT


@njit(nogil=True, cache=KEPT)
def main_lobe(curve: npt.NDArray[np.float64], peak: int) -> tuple[int, int]:
    """Return the first index of the main lobe around `peak` and the one behind its last.

    On either side the lobe goes down to half the peak, and on to the next minimum.
    """
    first, last = peak, peak
    while first > 0 and (curve[first] >= curve[peak] / 2 or curve[first - 1] <= curve[first]):
        first -= 1
    while last < curve.size - 1 and (curve[last] >= curve[peak] / 2 or curve[last + 1] <= curve[last]):
        last += 1
    return first, last + 1
