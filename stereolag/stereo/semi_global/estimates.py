"""Memory and time of semi-global matching."""

from __future__ import annotations

import numpy.typing as npt

from stereolag.core.estimates import OVERHEAD, Estimate, kept_blocks
from stereolag.stereo.estimates import FINISHING, PIXEL_SECONDS, Shape, grey_bytes
from stereolag.stereo.semi_global.matching import BYTES_OF_A_CELL, MOST_BYTES, OVERLAP

FOUND = 20
"""Bytes per pixel of the matches: cheapest lag, costs around it, runner-up and the right view's lag."""

VALLEY = 50
"""Bytes per pixel while the valley between the lags is fitted."""

FEATURES = 66
"""Bytes per pixel while the features of both images are computed."""

UNEVEN = 2 * 2**20
"""Bytes allowed for variation between runs: on a busy machine, 400 MB became up to 0.2 MB more than estimated."""

VOLUME_SECONDS = 3e-9
"""Seconds per pixel and lag for the cost, eight paths and the selection."""


def estimate_volume(shape: Shape, dtype: npt.DTypeLike, *, num_disparities: int) -> Estimate:
    """Return the memory and time of semi-global matching, in strips of rows if the volume is large.

    Parameters
    ----------
    shape, dtype
        Shape, (rows, cols) or (rows, cols, channels), and dtype of one image.
    num_disparities
        Number of disparities tried, px.
    """
    (height, width), pixels = shape[:2], shape[0] * shape[1]
    bytes_of_a_row = width * num_disparities * BYTES_OF_A_CELL
    own = height if height * bytes_of_a_row <= MOST_BYTES else max(1, MOST_BYTES // bytes_of_a_row - 2 * OVERLAP)
    strip = min(height, own + 2 * OVERLAP)
    # The matches of a strip, with the rows shared with its neighbours, are kept until all strips are joined.
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
