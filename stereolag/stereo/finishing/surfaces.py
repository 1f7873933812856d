"""Filling of gaps with slanted surfaces: a plane per patch of similar colour, fitted to nearby measurements."""

from __future__ import annotations

from typing import Any

import cv2
import numpy as np
import numpy.typing as npt
from pydantic import Field

from stereolag.core.arrays import Array, FloatMap
from stereolag.core.settings import Settings
from stereolag.loops.bands import over_bands
from stereolag.loops.compilation import compiled
from stereolag.stereo.finishing.planes import GUESSED_SAMPLES, MEASURED_SAMPLES, Samples, fitted, sampled
from stereolag.stereo.finishing.superpixels import superpixels

REDUCED = 2
"""Patches and planes are computed on every other row and column."""

NARROW = 32
"""A gap of at most this many px between surfaces at different depths is hidden from a camera by the nearer one."""

HIDING = 2.5
"""Surfaces farther apart than this, px of disparity, are at different depths."""


class SurfaceFilling(Settings):
    """Surface filling: a gap continues the slanted surfaces around it, by patches of similar colour."""

    patch: int = Field(
        default=30,
        title="Patch",
        description="Approximate side of a patch, which is treated as one plane, px.",
        ge=8,
        le=200,
        json_schema_extra={"step": 2},
    )
    contrast: int = Field(
        default=23,
        title="Patch contrast",
        description="Difference of colour, levels of 255, that counts as much as a distance of one patch side.",
        ge=1,
        le=255,
    )


def filled_along_surfaces(
    disparity: FloatMap, guess: FloatMap, guide: npt.NDArray[np.uint8], settings: SurfaceFilling
) -> FloatMap:
    """Return the map with its gaps filled from planes.

    Each patch with a gap has one plane. It starts as the best of several through the guesses in the patch, which
    indicate the surface to look for, and is refitted repeatedly to the measured pixels of the patch near this plane, to
    its neighbours' planes where these may be the same surface, and weakly to the guesses. This is slanted-plane stereo
    (K. Yamaguchi et al., "Efficient joint segmentation, occlusion labeling, stereo and flow estimation", 2014) for the
    gaps only.

    Parameters
    ----------
    disparity
        (H, W) float32 px; NaN = none.
    guess
        (H, W) float32 px, the map already filled in some way; its values in the gaps indicate the surface.
    guide
        (H, W) or (H, W, channels) uint8, the left image.
    settings
        Size and contrast of the patches.

    Returns
    -------
    ndarray
        (H, W) float32; a map without any measurement, or without a gap, is returned unchanged.
    """
    missing = np.isnan(disparity)
    if missing.all() or not missing.any():
        return disparity
    size = -(-disparity.shape[1] // REDUCED), -(-disparity.shape[0] // REDUCED)
    small = cv2.resize(guide, size, interpolation=cv2.INTER_AREA)
    planes = np.ascontiguousarray(np.atleast_3d(small)[:, :, :3].transpose(2, 0, 1), np.float32)
    patches = superpixels(planes, settings.patch // REDUCED, settings.contrast)
    few = disparity[::REDUCED, ::REDUCED]
    gaps = np.where(np.isnan(few), guess[::REDUCED, ::REDUCED], np.float32(np.nan))
    count = len(patches.centres)
    measured = Samples(*sampled(patches.labels, few, count, MEASURED_SAMPLES))
    guessed = Samples(*sampled(patches.labels, gaps, count, GUESSED_SAMPLES))
    surfaces = fitted(patches, measured, guessed)
    low, high = np.nanmin(disparity), np.nanmax(disparity)
    at = np.ascontiguousarray(patches.centres[:, -2:])
    out = disparity.copy()
    over_bands(
        lambda first, end: fill_from_planes(disparity, guess, patches.labels, surfaces, at, low, high, first, end, out),
        len(out),
    )
    return out


@compiled
def fill_from_planes(
    disparity: Array,
    guess: Array,
    labels: Array,
    planes: Array,
    at: Array,
    low: Any,
    high: Any,
    first: int,
    end: int,
    out: Array,
) -> None:
    """Fill the gaps of rows `first` to `end` from the planes of their patches, clipped to `low`..`high`.

    In a narrow gap between a near and a far surface no value is nearer than the guess, which belongs to the far one.
    The guess is kept where a patch has no plane.
    """
    width = out.shape[1]
    for y in range(first, end):
        start = 0
        for x in range(width + 1):
            if x < width and np.isnan(disparity[y, x]):
                continue
            hidden = 0 < start < x < width and x - start <= NARROW
            hidden = hidden and abs(disparity[y, x] - disparity[y, start - 1]) > HIDING
            for gap in range(start, x):
                patch = labels[y // REDUCED, gap // REDUCED]
                across = np.float32(gap) / np.float32(REDUCED) - at[patch, 1]
                down = np.float32(y) / np.float32(REDUCED) - at[patch, 0]
                value = planes[patch, 2] + planes[patch, 0] * across + planes[patch, 1] * down
                value = guess[y, gap] if np.isnan(value) else min(max(value, low), high)
                out[y, gap] = min(value, guess[y, gap]) if hidden else value
            start = x + 1
