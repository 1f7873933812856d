"""Checks: which of the matches found can be believed."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt
from pydantic import Field

from stereolag.arrays import FloatMap, Mask, ReasonMap
from stereolag.inputs import FLAT_TEXTURE, Image, grey_level
from stereolag.loops.bands import over_bands
from stereolag.loops.compilation import compiled
from stereolag.settings import Settings
from stereolag.stereo.reasons import Reason


class LeftRightCheck(Settings):
    """A match must be the same, seen from the right image."""

    tolerance: int = Field(
        default=1,
        title="Left-right tolerance",
        description="How far the match of the right image's pixel may lead from where it came, px. What fails is "
        "mostly hidden from one of the cameras.",
        ge=0,
        le=16,
    )


class AmbiguityTest(Settings):
    """A match must clearly beat any other.

    The scores of the plain correlation have no bounds: beside them any lead is small, and the test refuses little.
    """

    lead: float = Field(
        default=0.015,
        title="Lead over the next best",
        description="By how much the best place must beat every place farther than 1 px from it: in the score, or as "
        "a share of the highest cost where matches are optimised.",
        ge=0,
        le=2,
        json_schema_extra={"step": 0.005},
    )


class TextureTest(Settings):
    """A window must hold something to match."""

    least: float = Field(
        default=1.0,
        title="Least texture",
        description="Standard deviation of the window, in grey levels of 255, below which nothing is measured.",
        ge=0,
        json_schema_extra={"step": 0.5},
    )


def least_texture(test: TextureTest | None, left: Image, right: Image) -> float:
    """Return the standard deviation, in the units of two images, up to which a window is not matched."""
    return (test.least if test else FLAT_TEXTURE) * grey_level(left, right)


def rejected(disparity: FloatMap, reason: ReasonMap, where: Mask, why: Reason) -> tuple[FloatMap, ReasonMap]:
    """Return the map and its reasons without the measured pixels that are `where`.

    Parameters
    ----------
    disparity
        (H, W) float32, NaN = none.
    reason
        (H, W) uint8, :class:`Reason`; only what is MEASURED can be rejected: the first reason found stays.
    where
        (H, W) bool.
    why
        Their new reason.
    """
    lost = where & (reason == Reason.MEASURED)
    return np.where(lost, np.float32(np.nan), disparity), np.where(lost, np.uint8(why), reason)


def left_right_disagree(match: npt.NDArray[Any], back: npt.NDArray[Any], tolerance: int) -> Mask:
    """Return where the match of the left pixel, followed to the right image, does not lead back.

    Parameters
    ----------
    match
        (H, W) integer column of the right image to which each pixel of the left one is matched.
    back
        (H, W) integer column of the left image to which each pixel of the right one is matched; any number far out of
        the frame says that there is none.
    tolerance
        Largest difference that still agrees, px.

    Returns
    -------
    ndarray
        (H, W) bool; true as well where the match lies out of the frame.
    """
    disagree = np.empty(match.shape, np.bool_)
    over_bands(lambda first, end: _disagreeing_rows(match, back, tolerance, first, end, disagree), match.shape[0])
    return disagree


@compiled
def _disagreeing_rows(
    match: npt.NDArray[Any], back: npt.NDArray[Any], tolerance: int, first: int, end: int, disagree: Mask
) -> None:
    """Do rows `first` to `end` of :func:`left_right_disagree`."""
    width = np.int64(match.shape[1])
    for y in range(first, end):
        for x in range(width):
            place = np.int64(match[y, x])
            inside = (place >= 0) & (place < width)
            apart = np.int64(back[y, place if inside else 0]) - x
            disagree[y, x] = (not inside) | (abs(apart) > tolerance)


def left_right_disagree_reference(match: npt.NDArray[Any], back: npt.NDArray[Any], tolerance: int) -> Mask:
    """Return what :func:`left_right_disagree` must equal, by plain NumPy."""
    width = match.shape[1]
    inside = (match >= 0) & (match < width)
    returned = np.take_along_axis(back, np.where(inside, match, 0).astype(np.intp), axis=1)
    return np.asarray(~inside | (np.abs(returned.astype(np.int64) - np.arange(width)) > tolerance))


def ambiguous(lowest: npt.NDArray[Any], runner_up: npt.NDArray[Any], margin: int) -> Mask:
    """Return where the best lag is not cheaper by `margin` than every lag farther than one from it.

    A negative `runner_up` says that there is no such lag.
    """
    return np.asarray((runner_up >= 0) & (runner_up - lowest < margin))
