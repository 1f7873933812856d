"""Detection of motion against the world: tests of pixels, and the regions that they form."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import NamedTuple, TypeAlias

import cv2
import numpy as np
import numpy.typing as npt
from pydantic import Field

from stereolag.core.arrays import DoubleMap, FloatMap, Mask
from stereolag.core.inputs import Image, as_grey, grey_level
from stereolag.core.settings import Settings
from stereolag.motion.pyramid import Flow, fetched, places

Box: TypeAlias = tuple[slice, slice]
"""Rows and columns."""

Vector: TypeAlias = npt.NDArray[np.float64]
"""(3,) metres: to the right, down, forward."""

KMH = 3.6
"""km/h per m/s."""

OWN_ERROR = 0.01
"""Error of our own motion as a share of the distance travelled; every other motion inherits it."""

MOST_ERROR_KMH, MOST_SHARE = 6.0, 0.1
"""Largest error of a trusted speed: the larger of this value in km/h and this share of the speed."""

WINDOW = 9
"""Side of the window in which two flows are compared, px."""

LEAST_VARIANCE = 0.25
"""Added to every variance, grey levels squared, so that without texture neither flow is better."""


class RigidShift(NamedTuple):
    """The motion of a thing against the world between two frames, without rotation."""

    motion: Vector
    covariance: npt.NDArray[np.float64]
    """(3, 3) square metres."""


class MovingTest(Settings):
    """Criteria for motion against the world: flow or disparity that our own motion does not explain."""

    threshold: float = Field(
        default=4.0,
        title="Significance",
        description="Deviation from a static point's motion, in expected errors, above which a pixel counts as moving.",
        gt=0,
        le=100,
        json_schema_extra={"step": 0.5},
    )
    flow_error: float = Field(
        default=0.5, title="Error of the flow", description="Expected error of the flow, px.", gt=0, le=64
    )
    relative_error: float = Field(
        default=0.05,
        title="Relative error of the flow",
        description="Added to the error of the flow for each px that a static point would move.",
        ge=0,
        le=1,
        json_schema_extra={"step": 0.01},
    )
    disparity_error: float = Field(
        default=0.5, title="Error of the disparity", description="Expected error of a disparity, px.", gt=0, le=64
    )
    gain: float = Field(
        default=0.1,
        title="Gain",
        description="How much better a window must correlate along its flow than along a static point's.",
        ge=0,
        le=2,
        json_schema_extra={"step": 0.05},
    )
    coherence: float = Field(
        default=2.0,
        title="Coherence",
        description="How many times better one motion must explain a region than no motion: mismatches go anywhere.",
        ge=0,
        le=100,
        json_schema_extra={"step": 0.5},
    )
    smallest: int = Field(
        default=300,
        title="Smallest region",
        description="Connected regions of fewer pixels do not count as moving objects.",
        ge=1,
        le=1_000_000,
    )
    opening: int = Field(
        default=5,
        title="Opening",
        description="Parts narrower than this are removed before regions are formed, px.",
        ge=1,
        le=51,
    )


@dataclass(frozen=True)
class MovingRegion:
    """One thing that moves against the world.

    Attributes
    ----------
    row, col, height, width
        Its bounding box in the first frame, px.
    pixels
        Number of pixels.
    distance_m
        Median depth in the first frame, metres.
    motion_m
        (right, down, forward) motion against the world between the frames, metres, in camera coordinates at the second
        frame.
    speed_kmh
        Magnitude of that motion, km/h; None without a frame rate.
    speed_error_kmh
        Its standard error, km/h.
    """

    row: int
    col: int
    height: int
    width: int
    pixels: int
    distance_m: float
    motion_m: tuple[float, float, float]
    speed_kmh: float | None
    speed_error_kmh: float | None

    @property
    def trusted(self) -> bool:
        """Return whether the speed is accurate enough to be shown."""
        if self.speed_kmh is None or self.speed_error_kmh is None:
            return False
        return self.speed_error_kmh <= max(MOST_ERROR_KMH, MOST_SHARE * self.speed_kmh)


def better_explained(images: tuple[Image, Image], flow: Flow, other: Flow, gain: float) -> Mask:
    """Return (H, W) where the windows of two frames correlate better along one flow than along another.

    Parameters
    ----------
    images
        (H, W) or (H, W, 3 | 4), both frames.
    flow, other
        (2, H, W) float32 px; NaN = none. False where either is unknown or leads out of the frame.
    gain
        Least difference in correlation.
    """
    first, second = (as_grey(image).astype(np.float32) for image in images)
    known = _within(flow) & _within(other)
    least = flat_variance(grey_level(*images))
    scores = [correlation(first, fetched(second, np.where(known, one, np.float32(0))), least) for one in (flow, other)]
    return np.asarray(known & (scores[0] - scores[1] > gain))


def _within(flow: Flow) -> Mask:
    """Return (H, W) where the flow is known and its end point has a whole window within the frame."""
    row, col = places(flow)
    rows, cols = row.shape
    margin = WINDOW // 2
    return np.asarray((row >= margin) & (row < rows - margin) & (col >= margin) & (col < cols - margin))


def flat_variance(level: float) -> float:
    """Return the value added to every variance; `level` is one grey level of 255 in image units."""
    return LEAST_VARIANCE * level**2


def correlation(one: Image, other: Image, least: float) -> FloatMap:
    """Return the Pearson correlation of the windows around every pixel, with `least` added to the variances."""
    size = (WINDOW, WINDOW)
    one, other = one - one.mean(), other - other.mean()
    mean, other_mean = cv2.blur(one, size), cv2.blur(other, size)
    both = cv2.blur(one * other, size) - mean * other_mean
    own = np.maximum(cv2.blur(one * one, size) - mean * mean, 0) + least
    others = np.maximum(cv2.blur(other * other, size) - other_mean * other_mean, 0) + least
    return np.asarray(both / np.sqrt(own * others))


def connected(moving: Mask, settings: MovingTest) -> Iterator[tuple[Box, Mask]]:
    """Yield the bounding box of every connected region that is large enough, and its mask within the box."""
    element = cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (settings.opening, settings.opening))
    opened = cv2.morphologyEx(moving.astype(np.uint8), cv2.MORPH_OPEN, element)
    _, labels, figures, _ = cv2.connectedComponentsWithStats(opened, connectivity=8)
    for number, (col, row, width, height, pixels) in enumerate(figures):
        if number > 0 and pixels >= settings.smallest:
            box = slice(row, row + height), slice(col, col + width)
            yield box, labels[box] == number


def moves_as_one(standing: DoubleMap, moving: DoubleMap, settings: MovingTest) -> bool:
    """Return whether the pixels of a region move as one thing, and significantly.

    Parameters
    ----------
    standing, moving
        (3, n) deviations of row, column and disparity, in expected errors, from static points and from one moving
        thing.
    settings
        The thresholds.
    """
    if standing.shape[1] < settings.smallest / 2:
        return False
    before, after = (float(np.median(np.linalg.norm(one, axis=0))) for one in (standing, moving))
    return before > settings.threshold and before > settings.coherence * after


def region_of(
    box: Box, mask: Mask, distance_m: float, shift: RigidShift, own: float, frame_rate: float | None
) -> MovingRegion:
    """Return the moving region of a thing; `own` is the distance travelled by the camera, metres."""
    rows, cols = box
    row, col = np.nonzero(mask)
    length = float(np.linalg.norm(shift.motion))
    along = shift.motion / max(length, 1e-9)
    error = float(np.sqrt(along @ shift.covariance @ along + (OWN_ERROR * own) ** 2))
    speed, speed_error = (None, None) if frame_rate is None else (KMH * frame_rate * length, KMH * frame_rate * error)
    return MovingRegion(
        row=int(rows.start + row.min()),
        col=int(cols.start + col.min()),
        height=int(np.ptp(row) + 1),
        width=int(np.ptp(col) + 1),
        pixels=int(row.size),
        distance_m=distance_m,
        motion_m=(float(shift.motion[0]), float(shift.motion[1]), float(shift.motion[2])),
        speed_kmh=speed,
        speed_error_kmh=speed_error,
    )
