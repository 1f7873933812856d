"""A straight line through points with outliers."""

from __future__ import annotations

import numpy as np

from stereolag.core.arrays import Vector


def median_line(places: Vector, values: Vector) -> tuple[float, float]:
    """Return slope and intercept of the median line of Theil (1950) and Sen (1968).

    Agrees with :func:`scipy.stats.theilslopes`, whose package takes a second to import.

    Parameters
    ----------
    places, values
        (points,) abscissae, not all equal, and ordinates.
    """
    apart = places[:, np.newaxis] - places
    later = apart > 0
    slope = float(np.median((values[:, np.newaxis] - values)[later] / apart[later]))
    return slope, float(np.median(values) - slope * np.median(places))
