"""Whether pictures are rectified already, told from the rows of matched features before and after rectification."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from stereolag.doctor.correspondences import find_correspondences
from stereolag.doctor.findings import FEWEST_MATCHES
from stereolag.inputs import Image

NOISE_PX = 0.1
"""Medians that differ by no more tell nothing."""

STRAIGHT_PX = 1.0
"""Rows this near are those of a rectified pair; farther ones must be half as far apart as after rectification."""


@dataclass(frozen=True)
class RowEvidence:
    """How far apart the rows of matched features lie in pictures as they were given, and once rectified.

    Attributes
    ----------
    given_px, rectified_px
        Median of the absolute difference of rows, px; NaN where too few features were matched to tell.
    given_matches, rectified_matches
        How many features were matched.
    """

    given_px: float
    rectified_px: float
    given_matches: int
    rectified_matches: int

    @property
    def already_rectified(self) -> bool:
        """Return whether the given rows match better; where the rows do not tell, pictures are raw."""
        if np.isnan(self.rectified_px):
            return self.given_px <= STRAIGHT_PX
        near = self.given_px <= max(STRAIGHT_PX, self.rectified_px / 2)
        return near and self.given_px + NOISE_PX < self.rectified_px


def row_evidence(given: tuple[Image, Image], rectified: tuple[Image, Image]) -> RowEvidence:
    """Compare the rows of a pair as it was given with those of the same pair after rectification.

    Parameters
    ----------
    given, rectified
        The left and the right image: (H, W) or (H, W, 3 | 4), uint8, uint16 or float.
    """
    (given_px, given_matches), (rectified_px, rectified_matches) = _median(*given), _median(*rectified)
    return RowEvidence(given_px, rectified_px, given_matches, rectified_matches)


def _median(left: Image, right: Image) -> tuple[float, int]:
    """Return the median difference of rows, px, and the number of matches."""
    differences = np.abs(find_correspondences(left, right).dy)
    count = len(differences)
    return (float(np.median(differences)) if count >= FEWEST_MATCHES else np.nan), count
