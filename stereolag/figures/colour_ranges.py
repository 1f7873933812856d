"""Which disparities the first and the last colour stand for."""

from __future__ import annotations

from collections.abc import Collection, Sequence

import numpy as np
import numpy.typing as npt

from stereolag.figures.pictures import thinned
from stereolag.stereo.matcher import DisparityMap

ROUNDED_TO = 4
"""Px to which the ends of a range are rounded: small changes of a map leave its colours where they were."""


def disparity_range(maps: Sequence[npt.NDArray[np.float32]]) -> tuple[float, float]:
    """Return the disparities, px, at the ends of the colours: all but the outermost 1 % of the maps lies between.

    Given the ground truth alone the range holds still whatever the settings; without it, the maps to compare share one.
    """
    known = np.concatenate([np.empty(0, dtype=np.float32), *(one[np.isfinite(one)] for one in map(thinned, maps))])
    if known.size == 0:
        return 0.0, float(ROUNDED_TO)
    low, high = np.percentile(known, (1, 99))
    first = np.floor(low / ROUNDED_TO) * ROUNDED_TO
    return float(first), float(max(np.ceil(high / ROUNDED_TO) * ROUNDED_TO, first + ROUNDED_TO))


def searched_range(results: Collection[DisparityMap]) -> tuple[float, float]:
    """Return the first and the last disparity that any of the maps can hold, px."""
    ranges = [found for one in results if (found := one.settings.reach()) is not None]
    if not ranges:
        return disparity_range([one.disparity for one in results])
    return float(min(first for first, _ in ranges)), float(max(first + count for first, count in ranges))
