"""What every stereo matcher answers."""

from __future__ import annotations

from dataclasses import dataclass, field
from enum import IntEnum

import numpy as np
import numpy.typing as npt

from stereolag.settings import Settings

FloatMap = npt.NDArray[np.float32]
ReasonMap = npt.NDArray[np.uint8]


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


@dataclass(frozen=True, eq=False)
class DisparityMap:
    """A disparity map in the frame of the left image, with what is known about every pixel.

    Attributes
    ----------
    disparity
        (H, W) float32, px, ``-dx``; NaN = no answer.
    dy, dx
        (H, W) float32 displacement, right minus left, px; NaN = no answer.
    score
        (H, W) float32 score of the match, or NaN where the method gives none.
    reason
        (H, W) uint8, a :class:`Reason` for every pixel.
    elapsed_s
        Seconds of the computation alone.
    settings
        The matcher that made it: a :class:`~stereolag.stereo.matcher.StereoMatcher`.
    """

    disparity: FloatMap
    dy: FloatMap
    dx: FloatMap
    score: FloatMap
    reason: ReasonMap
    elapsed_s: float
    settings: Settings = field(repr=False)

    def __post_init__(self) -> None:
        for array in (self.disparity, self.dy, self.dx, self.score, self.reason):
            array.flags.writeable = False

    @property
    def lag(self) -> FloatMap:
        """Return the Euclidean lag ``hypot(dy, dx)``, px: what the depth maps of the report show."""
        return np.hypot(self.dy, self.dx)

    @property
    def valid(self) -> npt.NDArray[np.bool_]:
        """Return where there is an answer, measured or filled."""
        return np.isfinite(self.disparity)

    @property
    def filled(self) -> npt.NDArray[np.bool_]:
        """Return where the answer was filled in from the surroundings instead of measured."""
        return np.asarray(self.reason == Reason.FILLED)

    @property
    def coverage(self) -> float:
        """Return the share of pixels that have an answer, 0..1."""
        return float(np.count_nonzero(self.valid) / self.valid.size)
