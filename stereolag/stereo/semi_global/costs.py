"""Matching cost: how badly each pixel of the left image fits the right image at each lag."""

from __future__ import annotations

from typing import Annotated

import numpy as np
from pydantic import Field, model_validator

from stereolag.inputs import Image
from stereolag.loops.bands import over_bands
from stereolag.settings import Applies, Settings
from stereolag.stereo.semi_global.census import BITS
from stereolag.stereo.semi_global.cost_features import features, mirrored
from stereolag.stereo.semi_global.cost_volume import Costs, Weights, cost_rows

UNSEEN = 0.28
"""Cost of a lag that leads out of the frame, as a share of the highest: between a good match and a mismatch."""


class MatchingCost(Settings):
    """What a mismatch costs: the correlation of the windows, joined by finer terms that keep edges sharp."""

    correlation: int = Field(
        default=100,
        title="Correlation",
        description="Cost of windows that are each other's negative (ZNCC -1); +1 costs nothing.",
        ge=0,
        le=100,
    )
    census: int = Field(
        default=100,
        title="Census",
        description="Cost where all of the 5 × 5 neighbours have changed from darker to brighter or back.",
        ge=0,
        le=100,
    )
    gradient: int = Field(
        default=40,
        title="Gradient",
        description="Cost of a horizontal gradient that differs by the limit or more.",
        ge=0,
        le=50,
    )
    gradient_limit: Annotated[int, Applies(lambda settings: settings.gradient > 0, "needs gradient above 0")] = Field(
        default=8,
        title="Gradient limit",
        description="Difference of gradients, grey levels of 255, beyond which a larger one costs no more.",
        ge=1,
        le=64,
    )

    @model_validator(mode="after")
    def _weighs_something(self) -> MatchingCost:
        if self.highest == 0:
            raise ValueError("correlation, census and gradient are all 0; at least one must be above 0.")
        return self

    @property
    def highest(self) -> int:
        """Return the cost of a lag at which nothing fits, at most 250."""
        return self.correlation + self.census + self.gradient


def matching_cost(
    left: Image,
    right: Image,
    *,
    window_size: int,
    min_disparity: int,
    num_disparities: int,
    settings: MatchingCost,
) -> Costs:
    """Return the cost of every pixel of the left image at every disparity.

    ZNCC on windows, truncated gradient difference, and the Hamming distance of census words, added up: correlation
    carries flat and noisy regions, the other two draw the edges that a window blurs (Hirschmüller & Scharstein,
    "Evaluation of stereo matching costs on images with radiometric differences", 2009; Mei et al., "On building an
    accurate stereo matching system on graphics hardware", 2011). A lag that leads out of the frame costs more than a
    match and less than a mismatch, so that a later optimisation carries the neighbours' disparity on to the border of
    the picture.

    Parameters
    ----------
    left, right
        (H, W) uint8, see :func:`stereolag.inputs.as_eight_bit`.
    window_size
        Side of the correlation's window, px; odd.
    min_disparity, num_disparities
        The disparities, px.
    settings
        The weights of the terms.

    Returns
    -------
    ndarray
        (H, W, num_disparities) uint8, 0..250.
    """
    radius = window_size // 2
    last = min_disparity + num_disparities - 1
    weights = Weights(
        correlation=float(settings.correlation),
        bit=settings.census / BITS,
        gradient=float(settings.gradient),
        unseen=UNSEEN * settings.highest,
    )
    slope = settings.gradient / settings.gradient_limit
    left_features = features(left, radius, slope)
    right_features = mirrored(features(right, radius, slope), radius, max(0, -min_disparity), max(0, last))
    costs = np.empty((*left.shape, num_disparities), np.uint8)
    over_bands(
        lambda first, end: cost_rows(left_features, right_features, radius, min_disparity, weights, first, end, costs),
        left.shape[0],
    )
    return costs
