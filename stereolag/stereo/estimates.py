"""What the estimates of all stereo matchers share.

Bytes are counted for each pixel, or each window, of the stage that holds most of them.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import numpy.typing as npt

from stereolag.estimates import Estimate, largest_fitting

Shape = tuple[int, ...]

ANSWER = 17
"""A pixel of the map: disparity, dy, dx, score and reason."""

FINISHING = 48
"""A pixel while the map is filtered and filled: the maps before and after, their reasons, and what OpenCV takes."""

PIXEL_SECONDS = 1.2e-7
"""Seconds per pixel, for the checks, filters and maps."""

DISPARITY_STEP, MOST_DISPARITIES = 16, 1024
"""Numbers of disparities that a refusal names are multiples of the one, up to the other."""


def fitting_pair(
    allowed: int,
    *,
    shape: Shape,
    of_shape: Callable[[Shape], Estimate],
    of_disparities: Callable[[int], Estimate] | None,
) -> str:
    """Return a sentence that names what share of the size, or how many disparities, would fit."""

    def of_percent(percent: int) -> Estimate:
        return of_shape((*(max(1, side * percent // 100) for side in shape[:2]), *shape[2:]))

    percent = largest_fitting(of_percent, 100, allowed)
    size = "Half" if percent == 50 else f"{percent} % of"
    fitting = [f"{size} the width and height"] if percent else []
    if of_disparities is not None:
        of_count = of_disparities
        count = DISPARITY_STEP * largest_fitting(
            lambda steps: of_count(DISPARITY_STEP * steps), MOST_DISPARITIES // DISPARITY_STEP, allowed
        )
        fitting += [f"{count} disparities"] if count else []
    if len(fitting) == 1:
        return f"{fitting[0]} would fit."
    return f"{', or '.join(fitting)}, would fit." if fitting else "Less than 1 % of the width and height would fit."


def grey_bytes(shape: Shape, dtype: npt.DTypeLike) -> int:
    """Return the bytes of both images as grey, and of one's colours in one piece where they lie beside an alpha."""
    if len(shape) == 2:
        return 0
    pixel = np.dtype(dtype).itemsize
    return shape[0] * shape[1] * pixel * (2 + 3 * (shape[2] == 4))
