"""Why a pixel has the disparity it has, or none."""

from __future__ import annotations

from enum import IntEnum


class Reason(IntEnum):
    """Why a pixel has the disparity it has, or none."""

    MEASURED = 0
    FILLED = 1
    OUT_OF_FRAME = 2
    LOW_TEXTURE = 3
    AMBIGUOUS = 4
    LEFT_RIGHT = 5
    SPECKLE = 6
    AT_SEARCH_EDGE = 7
