"""Memory and time figures shared by the estimates of all stereo matchers.

Bytes are counted per pixel, or per window, in the stage that uses the most.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import numpy.typing as npt

from stereolag.core.estimates import Estimate, largest_fitting

Shape = tuple[int, ...]

ANSWER = 17
"""Bytes per pixel of the map: disparity, dy, dx, score and reason."""

FINISHING = 48
"""Bytes per pixel while the map is filtered and filled: maps before and after, their reasons, OpenCV's buffers."""

PIXEL_SECONDS = 1.2e-7
"""Seconds per pixel for the checks, filters and maps."""

DISPARITY_STEP, MOST_DISPARITIES = 16, 1024
"""A refusal suggests a number of disparities that is a multiple of the first and at most the second."""


def fitting_pair(
    allowed: int,
    *,
    shape: Shape,
    of_shape: Callable[[Shape], Estimate],
    of_disparities: Callable[[int], Estimate] | None,
) -> str:
    """Return a sentence naming the share of the image size, or the number of disparities, that would fit."""

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
    """Return the bytes of both grey images, plus a contiguous copy of one's colours if there is an alpha channel."""
    if len(shape) == 2:
        return 0
    pixel = np.dtype(dtype).itemsize
    return shape[0] * shape[1] * pixel * (2 + 3 * (shape[2] == 4))
