"""Disparities at the ends of a colour scale."""

from __future__ import annotations

from collections.abc import Collection, Sequence

import numpy as np
import numpy.typing as npt

from stereolag.figures.pictures import thinned
from stereolag.stereo.matcher import DisparityMap

ROUNDED_TO = 4
"""Px to which the ends of a range are rounded, so that small changes of a map do not shift its colours."""


def disparity_range(maps: Sequence[npt.NDArray[np.float32]]) -> tuple[float, float]:
    """Return the disparities, px, at the ends of the colours, which leave out the outermost 1 % at either end.

    Given only the ground truth, the range does not depend on the settings; given the maps to compare, they share one.
    """
    known = np.concatenate([np.empty(0, dtype=np.float32), *(one[np.isfinite(one)] for one in map(thinned, maps))])
    if known.size == 0:
        return 0.0, float(ROUNDED_TO)
    low, high = np.percentile(known, (1, 99))
    first = np.floor(low / ROUNDED_TO) * ROUNDED_TO
    return float(first), float(max(np.ceil(high / ROUNDED_TO) * ROUNDED_TO, first + ROUNDED_TO))


def searched_range(results: Collection[DisparityMap]) -> tuple[float, float]:
    """Return the smallest and the largest disparity that any of the maps can contain, px."""
    ranges = [found for one in results if (found := one.settings.reach()) is not None]
    if not ranges:
        return disparity_range([one.disparity for one in results])
    return float(min(first for first, _ in ranges)), float(max(first + count for first, count in ranges))
