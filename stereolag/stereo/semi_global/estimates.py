"""Memory and time of semi-global matching."""

from __future__ import annotations

import numpy.typing as npt

from stereolag.estimates import OVERHEAD, Estimate, kept_blocks
from stereolag.stereo.estimates import FINISHING, PIXEL_SECONDS, Shape, grey_bytes
from stereolag.stereo.semi_global.matching import BYTES_OF_A_CELL, MOST_BYTES, OVERLAP

FOUND = 20
"""A pixel of what the volume says: the cheapest lag, the costs around it, the runner-up and the right view's lag."""

VALLEY = 50
"""A pixel while the valley between the lags is fitted."""

FEATURES = 66
"""A pixel while the features of both images are made."""

UNEVEN = 2 * 2**20
"""What one run takes more than another: of 400 MB, up to 0.2 MB more than the stages tell, on a busy machine."""

VOLUME_SECONDS = 3e-9
"""Seconds per pixel and lag: its cost, eight paths and its part in the selection."""


def estimate_volume(shape: Shape, dtype: npt.DTypeLike, *, num_disparities: int) -> Estimate:
    """Return what matching by semi-global optimisation will take, in strips of rows where its volume is large.

    Parameters
    ----------
    shape, dtype
        Of one image: (rows, cols) or (rows, cols, channels).
    num_disparities
        How many are tried, px.
    """
    (height, width), pixels = shape[:2], shape[0] * shape[1]
    bytes_of_a_row = width * num_disparities * BYTES_OF_A_CELL
    own = height if height * bytes_of_a_row <= MOST_BYTES else max(1, MOST_BYTES // bytes_of_a_row - 2 * OVERLAP)
    strip = min(height, own + 2 * OVERLAP)
    # What a strip found stays until all are joined, with the rows that it shares with its neighbours.
    found = FOUND * pixels * min(strip, height) // min(own, height)
    fronts = 24 * (width + 2) * (num_disparities + 2)
    in_strip = strip * max(bytes_of_a_row, FEATURES * (width + num_disparities) + width * num_disparities)
    stages = [
        found + fronts + in_strip,
        found + (FOUND + VALLEY) * pixels,
        (2 * FOUND + FINISHING) * pixels,
    ]
    cells = pixels * num_disparities * strip / own
    seconds = 3 * PIXEL_SECONDS * pixels + VOLUME_SECONDS * cells
    return Estimate(grey_bytes(shape, dtype) + max(stages) + kept_blocks(4 * pixels, 3) + OVERHEAD + UNEVEN, seconds)
