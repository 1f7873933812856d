"""A straight line through points of which some are far off it."""

from __future__ import annotations

import numpy as np

from stereolag.arrays import Vector


def median_line(places: Vector, values: Vector) -> tuple[float, float]:
    """Return slope and intercept of the line by medians, after Theil (1950) and Sen (1968).

    Agrees with :func:`scipy.stats.theilslopes`, whose package takes a second to load.

    Parameters
    ----------
    places, values
        (points,) the abscissae, not all the same, and the ordinates.
    """
    apart = places[:, np.newaxis] - places
    later = apart > 0
    slope = float(np.median((values[:, np.newaxis] - values)[later] / apart[later]))
    return slope, float(np.median(values) - slope * np.median(places))
