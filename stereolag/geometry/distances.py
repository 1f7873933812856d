"""Distances between points of a scene, in metres, with their uncertainty."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from stereolag.geometry.calibration import Calibration

DISPARITY_ERROR = 0.25
"""Typical error of a disparity without ground truth, px, for a good subpixel match of well-textured windows."""

FIELD_OF_VIEW = 60.0
"""Horizontal field of view assumed for an unknown camera, degrees; phones and webcams have 55 to 75."""


@dataclass(frozen=True)
class SeenPoint:
    """A pixel of the left image with its disparity, both px."""

    row: float
    col: float
    disparity: float


@dataclass(frozen=True)
class Distance:
    """A distance and its typical error, metres; NaN where a point has no depth."""

    metres: float
    error: float


def typical_error(disparity: npt.ArrayLike, ground_truth: npt.ArrayLike) -> float:
    """Return the median error of the disparities with ground truth, px; NaN if there are none.

    The median, because a few gross mismatches say nothing about the accuracy of a good match.
    """
    error = np.abs(np.asarray(disparity, dtype=np.float64) - np.asarray(ground_truth, dtype=np.float64))
    known = error[np.isfinite(error)]
    return float(np.median(known)) if known.size else math.nan


def distance_between(
    calibration: Calibration,
    first: SeenPoint,
    second: SeenPoint,
    *,
    width: int,
    height: int,
    disparity_error: float = DISPARITY_ERROR,
) -> Distance:
    """Return the distance between two points of the scene.

    Parameters
    ----------
    calibration
        Calibration of the left image.
    first, second
        The points.
    width, height
        Size of the image, px: its centre replaces an unknown principal point.
    disparity_error
        Typical error of either disparity, px; the two are assumed to be independent.

    Returns
    -------
    Distance
        Its error is the component of the depth errors along the line between the points.
    """
    rays = np.array([_ray(calibration, point, width, height) for point in (first, second)])
    disparities = np.array([first.disparity, second.disparity])
    depths = calibration.depth(disparities).astype(np.float64)
    between = depths[1] * rays[1] - depths[0] * rays[0]
    metres = float(np.linalg.norm(between))
    if not math.isfinite(metres):
        return Distance(math.nan, math.nan)
    direction = between / metres if metres else np.array([0.0, 0.0, 1.0])
    errors = calibration.depth_uncertainty(disparities, disparity_error) * (rays @ direction)
    return Distance(metres, float(np.linalg.norm(errors)))


def calibrated_by(known: Calibration | None, disparity: float, distance_m: float, *, width: int) -> Calibration:
    """Return the calibration of an image `width` px wide that puts a point of `disparity` px at `distance_m` metres.

    One known distance determines only the product of focal length and baseline, and depth needs no more. The focal
    length, on which widths and heights depend, is kept from the `known` calibration; without one the camera is assumed
    to have a horizontal field of view of 60°.

    Raises
    ------
    ValueError
        A disparity that is not in front of infinity, or a distance that is not above 0.
    """
    start = known or Calibration(width / (2 * math.tan(math.radians(FIELD_OF_VIEW / 2))), baseline_m=1.0)
    return replace(start, rig=None).with_known_distance(disparity, distance_m)


def _ray(calibration: Calibration, point: SeenPoint, width: int, height: int) -> tuple[float, float, float]:
    """Return the position of the point at a depth of 1."""
    cx = (width - 1) / 2 if calibration.cx is None else calibration.cx
    cy = (height - 1) / 2 if calibration.cy is None else calibration.cy
    return (point.col - cx) / calibration.focal_px, (point.row - cy) / calibration.focal_px, 1.0
