"""The stages after the checks, the same for every matcher of ours: speckles taken away, gaps filled, edges kept."""

from __future__ import annotations

from typing import Annotated, Protocol

import numpy as np
import numpy.typing as npt
from pydantic import Field

from stereolag.inputs import Image, as_eight_bit
from stereolag.settings import Applies
from stereolag.stereo.finishing.filters import (
    MedianFilter,
    SpeckleFilter,
    edge_respecting_median,
    filled_from_behind,
    without_speckles,
)
from stereolag.stereo.finishing.surfaces import SurfaceFilling, filled_along_surfaces
from stereolag.stereo.matcher import PixelMatches

Speckle = Annotated[
    SpeckleFilter | None,
    Field(title="Speckle filter", description="Drop small islands of disparity unlike all around them."),
]
Filling = Annotated[
    bool, Field(title="Fill gaps", description="Continue the surface behind over what could not be measured.")
]
Surfaces = Annotated[
    SurfaceFilling | None,
    Applies(lambda settings: settings.filling, "needs filling"),
    Field(
        title="Slanted surfaces",
        description="Fill gaps by patches of like colour, each a slanted plane, and not along the row alone.",
    ),
]
Median = Annotated[
    MedianFilter | None,
    Field(
        title="Edge-respecting median",
        description="Smooth the map where the image is smooth, and only there.",
    ),
]


class Finishing(Protocol):
    """The settings of a matcher that finishes its map."""

    @property
    def speckle(self) -> SpeckleFilter | None:
        """Return what a speckle is; None keeps all."""

    @property
    def filling(self) -> bool:
        """Return whether gaps are filled."""

    @property
    def surfaces(self) -> SurfaceFilling | None:
        """Return how gaps are filled as slanted surfaces; None: along their rows."""

    @property
    def median(self) -> MedianFilter | None:
        """Return how the map is smoothed; None leaves it as it is."""


def is_finished(settings: Finishing) -> bool:
    """Return whether the settings ask for any of the stages."""
    return settings.speckle is not None or settings.filling or settings.median is not None


def finished(found: PixelMatches, left: Image, right: Image, settings: Finishing) -> PixelMatches:
    """Return the map filtered and filled, as far as the settings ask for it.

    Parameters
    ----------
    found
        What was measured.
    left, right
        The images; patches and median follow the edges of the left one.
    settings
        Which stages, and how.
    """
    if not is_finished(settings):
        return found
    disparity, reason = found.disparity, found.reason
    if settings.speckle is not None:
        disparity, reason = without_speckles(disparity, reason, settings.speckle)
    if settings.filling:
        measured = disparity
        disparity, reason = filled_from_behind(measured, reason)
        if settings.surfaces is not None:
            disparity = filled_along_surfaces(measured, disparity, _guide(left, right), settings.surfaces)
    if settings.median is not None:
        disparity = edge_respecting_median(disparity, _guide(left, right), settings.median)
    # After a search in two dimensions only speckles are taken away: nothing is filled.
    dy = None if found.dy is None else np.where(np.isnan(disparity), np.float32(np.nan), found.dy)
    return PixelMatches(disparity, reason, found.score, dy)


def _guide(left: Image, right: Image) -> npt.NDArray[np.uint8]:
    """Return the left image in 8 bits; alpha, which is no brightness, has no part in how it is stretched."""
    colours = (image if image.ndim == 2 else image[:, :, :3] for image in (left, right))
    return np.ascontiguousarray(as_eight_bit(*colours)[0])
