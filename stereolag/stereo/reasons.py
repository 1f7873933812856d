"""Reasons why a pixel is blank, or how it got its disparity."""

from __future__ import annotations

from enum import IntEnum


class Reason(IntEnum):
    """Reason why a pixel is blank, or how it got its disparity.

    Examples
    --------
    >>> import numpy as np
    >>> import stereolag as sl
    >>> left = np.random.default_rng(0).integers(0, 256, (60, 100), dtype=np.uint8)
    >>> right = np.roll(left, -5, axis=1)  # disparity 5 px
    >>> result = sl.SemiGlobalMatcher(num_disparities=16).compute(left, right)
    >>> sl.Reason(result.reason[30, 50]).name, sl.Reason(result.reason[30, 2]).name
    ('MEASURED', 'OUT_OF_FRAME')
    """

    MEASURED = 0
    FILLED = 1
    OUT_OF_FRAME = 2
    LOW_TEXTURE = 3
    AMBIGUOUS = 4
    LEFT_RIGHT = 5
    SPECKLE = 6
    AT_SEARCH_EDGE = 7
