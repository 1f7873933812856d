"""Test for already rectified pictures: the rows of matched features before and after rectification."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from stereolag.assess.doctor.correspondences import find_correspondences
from stereolag.assess.doctor.findings import FEWEST_MATCHES
from stereolag.core.inputs import Image

NOISE_PX = 0.1
"""Medians that differ by no more than this are inconclusive."""

STRAIGHT_PX = 1.0
"""Row difference up to which a pair may count as rectified; above it, half the difference after rectification."""


@dataclass(frozen=True)
class RowEvidence:
    """Row differences of matched features in pictures as given and after rectification.

    Attributes
    ----------
    given_px, rectified_px
        Median absolute row difference, px; NaN if too few features were matched.
    given_matches, rectified_matches
        Number of matched features.
    """

    given_px: float
    rectified_px: float
    given_matches: int
    rectified_matches: int

    @property
    def already_rectified(self) -> bool:
        """Return whether the rows match better as given; inconclusive rows count as unrectified."""
        if np.isnan(self.rectified_px):
            return self.given_px <= STRAIGHT_PX
        near = self.given_px <= max(STRAIGHT_PX, self.rectified_px / 2)
        return near and self.given_px + NOISE_PX < self.rectified_px


def row_evidence(given: tuple[Image, Image], rectified: tuple[Image, Image]) -> RowEvidence:
    """Compare the rows of a pair as given with those after rectification.

    Parameters
    ----------
    given, rectified
        The left and right images: (H, W) or (H, W, 3 | 4), uint8, uint16 or float.
    """
    (given_px, given_matches), (rectified_px, rectified_matches) = _median(*given), _median(*rectified)
    return RowEvidence(given_px, rectified_px, given_matches, rectified_matches)


def _median(left: Image, right: Image) -> tuple[float, int]:
    """Return the median absolute row difference, px, and the number of matches."""
    differences = np.abs(find_correspondences(left, right).dy)
    count = len(differences)
    return (float(np.median(differences)) if count >= FEWEST_MATCHES else np.nan), count
