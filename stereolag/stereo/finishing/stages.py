"""Stages after the checks, shared by the project's own matchers: speckles removed, gaps filled, edges kept."""

from __future__ import annotations

from typing import Annotated, Protocol

import numpy as np
import numpy.typing as npt
from pydantic import Field

from stereolag.core.inputs import Image, as_eight_bit
from stereolag.core.settings import Applies
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
    Field(title="Speckle filter", description="Drop small islands of disparity that differ from their surroundings."),
]
Filling = Annotated[
    bool, Field(title="Fill gaps", description="Fill pixels that could not be measured from the surface behind.")
]
Surfaces = Annotated[
    SurfaceFilling | None,
    Applies(lambda settings: settings.filling, "needs filling"),
    Field(
        title="Slanted surfaces",
        description="Fill gaps with patches of similar colour, each a slanted plane, not only along the row.",
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
    """Settings of a matcher that finishes its map."""

    @property
    def speckle(self) -> SpeckleFilter | None:
        """Return the speckle filter; None keeps all speckles."""

    @property
    def filling(self) -> bool:
        """Return whether gaps are filled."""

    @property
    def surfaces(self) -> SurfaceFilling | None:
        """Return how gaps are filled with slanted surfaces; None fills them along their rows."""

    @property
    def median(self) -> MedianFilter | None:
        """Return how the map is smoothed; None leaves it unsmoothed."""


def is_finished(settings: Finishing) -> bool:
    """Return whether the settings ask for any of the stages."""
    return settings.speckle is not None or settings.filling or settings.median is not None


def finished(found: PixelMatches, left: Image, right: Image, settings: Finishing) -> PixelMatches:
    """Return the map filtered and filled as the settings ask.

    Parameters
    ----------
    found
        The measured matches.
    left, right
        The images; patches and median follow the edges of the left one.
    settings
        The stages to run, and their settings.
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
    # After a search in two dimensions only speckles are removed; nothing is filled.
    dy = None if found.dy is None else np.where(np.isnan(disparity), np.float32(np.nan), found.dy)
    return PixelMatches(disparity, reason, found.score, dy)


def _guide(left: Image, right: Image) -> npt.NDArray[np.uint8]:
    """Return the left image in 8 bits; alpha, which is not brightness, does not affect the stretching."""
    colours = (image if image.ndim == 2 else image[:, :, :3] for image in (left, right))
    return np.ascontiguousarray(as_eight_bit(*colours)[0])
