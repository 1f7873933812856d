"""Where disparity maps of one pair agree: what several methods find by different ways is seldom wrong."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

FloatMap = npt.NDArray[np.float32]

TOLERANCE_PX = 1.0


def consensus(maps: Sequence[FloatMap], *, tolerance_px: float = TOLERANCE_PX) -> npt.NDArray[np.uint8]:
    """Return how many of the maps agree at each pixel.

    Parameters
    ----------
    maps
        (H, W) disparities of one size, px, NaN = no answer.
    tolerance_px
        Answers agree when the largest and the smallest of them are at most so far apart.

    Returns
    -------
    ndarray
        (H, W) uint8: the size of the largest group that agrees; 1 where every answer stands alone, 0 without any.

    Raises
    ------
    ValueError
        No maps, or maps of different size.
    """
    sizes = {one.shape for one in maps}
    if len(sizes) != 1:
        raise ValueError(f"maps have the sizes {sorted(sizes)}; allowed are one or more maps of one size.")
    ordered = np.sort(np.stack(maps), axis=0)  # NaN goes last
    agreeing: npt.NDArray[np.uint8] = np.isfinite(ordered[0]).astype(np.uint8)
    for size in range(2, len(maps) + 1):
        span = ordered[size - 1 :] - ordered[: len(maps) - size + 1]
        agreeing[(span <= tolerance_px).any(axis=0)] = size
    return agreeing
