"""Checks that decide which matches are reliable."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt
from pydantic import Field

from stereolag.core.arrays import FloatMap, Mask, ReasonMap
from stereolag.core.inputs import FLAT_TEXTURE, Image, grey_level
from stereolag.core.settings import Settings
from stereolag.loops.bands import over_bands
from stereolag.loops.compilation import compiled
from stereolag.stereo.matcher import Reason

MEASURED = np.uint8(Reason.MEASURED)


class LeftRightCheck(Settings):
    """Left-right check: a match must be the same seen from the right image."""

    tolerance: int = Field(
        default=1,
        title="Left-right tolerance",
        description="How far from its start a pixel may end when matched to the right image and back, px. Pixels "
        "that fail are mostly hidden from one of the cameras.",
        ge=0,
        le=16,
    )


class AmbiguityTest(Settings):
    """Ambiguity test: a match must clearly beat any other.

    The scores of plain correlation are unbounded: any lead is small beside them, and the test rejects little.
    """

    lead: float = Field(
        default=0.015,
        title="Lead over the next best",
        description="How far the best match must lead every other one farther than 1 px from it: in score or, in "
        "semi-global matching, as a share of the highest cost.",
        ge=0,
        le=2,
        json_schema_extra={"step": 0.005},
    )


class TextureTest(Settings):
    """Texture test: a window must contain something to match."""

    least: float = Field(
        default=1.0,
        title="Least texture",
        description="Standard deviation of the window, in grey levels of 255, below which nothing is measured.",
        ge=0,
        json_schema_extra={"step": 0.5},
    )


def least_texture(test: TextureTest | None, left: Image, right: Image) -> float:
    """Return the standard deviation, in the units of the images, up to which a window is not matched."""
    return (test.least if test else FLAT_TEXTURE) * grey_level(left, right)


def rejected(disparity: FloatMap, reason: ReasonMap, where: Mask, why: Reason) -> tuple[FloatMap, ReasonMap]:
    """Return the map and its reasons without the measured pixels in `where`.

    Parameters
    ----------
    disparity
        (H, W) float32, NaN = none.
    reason
        (H, W) uint8, :class:`Reason`; only MEASURED pixels can be rejected: the first reason found stays.
    where
        (H, W) bool.
    why
        Their new reason.
    """
    kept, reasons = np.empty_like(disparity), np.empty_like(reason)
    over_bands(
        lambda first, end: _reject_rows(disparity, reason, where, np.uint8(why), first, end, kept, reasons), len(kept)
    )
    return kept, reasons


@compiled
def _reject_rows(
    disparity: FloatMap,
    reason: ReasonMap,
    where: Mask,
    why: np.uint8,
    first: int,
    end: int,
    kept: FloatMap,
    reasons: ReasonMap,
) -> None:
    """Process rows `first` to `end` for :func:`rejected`."""
    for y in range(first, end):
        for x in range(disparity.shape[1]):
            lost = where[y, x] & (reason[y, x] == MEASURED)
            kept[y, x] = np.float32(np.nan) if lost else disparity[y, x]
            reasons[y, x] = why if lost else reason[y, x]


def left_right_disagree(dx: npt.NDArray[Any], right_dx: npt.NDArray[Any], tolerance: int) -> Mask:
    """Return where a left pixel's match, followed to the right image, does not lead back.

    Parameters
    ----------
    dx
        (H, W) integer displacement of the match of each left pixel, right minus left, px.
    right_dx
        (H, W) integer displacement, with the same sign, at which each right pixel was matched; a value that leads far
        out of the frame means none.
    tolerance
        Largest difference that still agrees, px.

    Returns
    -------
    ndarray
        (H, W) bool; also true where the match is out of the frame.
    """
    disagree = np.empty(dx.shape, np.bool_)
    over_bands(lambda first, end: _disagreeing_rows(dx, right_dx, tolerance, first, end, disagree), dx.shape[0])
    return disagree


@compiled
def _disagreeing_rows(
    dx: npt.NDArray[Any], right_dx: npt.NDArray[Any], tolerance: int, first: int, end: int, disagree: Mask
) -> None:
    """Process rows `first` to `end` for :func:`left_right_disagree`."""
    width = np.int64(dx.shape[1])
    for y in range(first, end):
        for x in range(width):
            moved = np.int64(dx[y, x])
            place = x + moved
            inside = (place >= 0) & (place < width)
            apart = moved - np.int64(right_dx[y, place if inside else 0])
            disagree[y, x] = (not inside) | (abs(apart) > tolerance)


def left_right_disagree_reference(dx: npt.NDArray[Any], right_dx: npt.NDArray[Any], tolerance: int) -> Mask:
    """Return the expected result of :func:`left_right_disagree`, computed with plain NumPy."""
    width = dx.shape[1]
    place = np.arange(width) + dx
    inside = (place >= 0) & (place < width)
    returned = np.take_along_axis(right_dx, np.where(inside, place, 0), axis=1)
    return np.asarray(~inside | (np.abs(returned.astype(np.int64) - dx) > tolerance))


def ambiguous(lowest: npt.NDArray[Any], runner_up: npt.NDArray[Any], margin: int) -> Mask:
    """Return where the best lag is not cheaper by `margin` than every lag more than one away from it.

    A negative `runner_up` means there is no such lag.
    """
    return np.asarray((runner_up >= 0) & (runner_up - lowest < margin))
