"""Filters that finish a map: islands removed, gaps filled from the background, edges kept."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
from pydantic import Field

from stereolag.core.arrays import FloatMap, ReasonMap
from stereolag.core.settings import Settings
from stereolag.stereo.finishing.checks import rejected
from stereolag.stereo.finishing.gap_ends import filled_from_ends
from stereolag.stereo.finishing.speckles import speckles
from stereolag.stereo.finishing.weighted_median import weighted_median
from stereolag.stereo.reasons import Reason


class SpeckleFilter(Settings):
    """Speckle filter: small islands of disparity unlike their surroundings are mismatches."""

    size: int = Field(
        default=100,
        title="Smallest surface",
        description="Connected surfaces of fewer pixels are removed.",
        ge=1,
        le=10_000,
        json_schema_extra={"step": 10},
    )
    difference: float = Field(
        default=2.0,
        title="Connected within",
        description="Largest difference in disparity between neighbours of one surface, px.",
        gt=0,
        le=64,
        json_schema_extra={"step": 0.5},
    )


class MedianFilter(Settings):
    """Edge-respecting median: each pixel takes the median disparity of its neighbours of similar colour."""

    radius: int = Field(
        default=6,
        title="Median radius",
        description="Radius of the neighbourhood, px.",
        ge=2,
        le=30,
        multiple_of=2,
    )
    contrast: int = Field(
        default=25,
        title="Median contrast",
        description="Difference of colour, levels of 255, from which a neighbour hardly counts.",
        ge=1,
        le=255,
    )


def without_speckles(disparity: FloatMap, reason: ReasonMap, settings: SpeckleFilter) -> tuple[FloatMap, ReasonMap]:
    """Return the map without its small islands (like OpenCV's ``filterSpeckles``), which become SPECKLE.

    Parameters
    ----------
    disparity
        (H, W) float32 px, within ±2047; NaN = none.
    reason
        (H, W) uint8.
    settings
        Size below which an island is removed, and disparity step that bounds it.
    """
    return rejected(disparity, reason, speckles(disparity, settings.size, settings.difference), Reason.SPECKLE)


def edge_respecting_median(disparity: FloatMap, guide: npt.NDArray[np.uint8], settings: MedianFilter) -> FloatMap:
    """Return the weighted median of 25 neighbours on a 5 × 5 grid, weighted by similarity of colour.

    Parameters
    ----------
    disparity
        (H, W) float32 px; NaN is ignored, and stays NaN.
    guide
        (H, W) or (H, W, channels) uint8, the left image.
    settings
        Radius and contrast.

    Returns
    -------
    ndarray
        (H, W) float32, rounded to 1/256 px.
    """
    planes = guide[:, :, None] if guide.ndim == 2 else guide[:, :, :3]
    return weighted_median(disparity, planes, settings.radius, settings.radius // 2, settings.contrast)


def filled_from_behind(disparity: FloatMap, reason: ReasonMap) -> tuple[FloatMap, ReasonMap]:
    """Return the map with every gap filled.

    A gap takes the smaller disparity of its two ends along the row (`filled_from_ends`): areas hidden from one camera
    belong to the farther surface, and the ground, which makes up most of the gaps in street scenes, has one depth along
    a row. Filling from eight or sixteen directions was worse there. A row without any measurement repeats the nearest
    row that has one.

    Parameters
    ----------
    disparity
        (H, W) float32 px; NaN = none.
    reason
        (H, W) uint8.

    Returns
    -------
    tuple of ndarray
        The map, and its reasons with FILLED where it was filled. A map without any measurement is returned unchanged.
    """
    filled = filled_from_ends(disparity)
    known = np.flatnonzero(np.isfinite(filled[:, 0]))
    if known.size == 0:
        return disparity, reason
    if known.size < len(filled):
        rows = np.arange(len(filled))
        after = np.searchsorted(known, rows).clip(max=known.size - 1)
        before = (after - 1).clip(min=0)
        nearest = np.where(rows - known[before] <= np.abs(known[after] - rows), known[before], known[after])
        nearest[known] = known
        filled = filled[nearest]
    return filled, np.where(np.isnan(disparity), np.uint8(Reason.FILLED), reason)
