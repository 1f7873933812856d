"""Scene flow: the motion of every pixel in metres, our own motion, and what moves against the world."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
import numpy.typing as npt
from pydantic import Field

from stereolag.arrays import DoubleMap, FloatMap, Mask
from stereolag.geometry.calibration import Calibration
from stereolag.motion.own_motion import (
    OwnMotion,
    Points,
    camera_matrix,
    estimate_own_motion,
    projected,
    seen_points,
)
from stereolag.motion.result import FlowMap
from stereolag.settings import Settings
from stereolag.stereo.matcher import DisparityMap

KMH = 3.6
"""km/h of one m/s."""

PROBE = 0.5
"""Px of disparity by which the static flow is varied, to learn how it depends on it."""


class MovingTest(Settings):
    """What moves against the world: its flow or its disparity is not what our own motion would give."""

    threshold: float = Field(
        default=4.0,
        title="Significance",
        description="How many times its expected error a motion must be off from a static point's.",
        gt=0,
        le=100,
        json_schema_extra={"step": 0.5},
    )
    flow_error: float = Field(
        default=0.5, title="Error of the flow", description="Expected error of the flow, px.", gt=0, le=64
    )
    disparity_error: float = Field(
        default=0.5, title="Error of the disparity", description="Expected error of a disparity, px.", gt=0, le=64
    )
    smallest: int = Field(
        default=150,
        title="Smallest region",
        description="A connected region of fewer pixels is no moving thing.",
        ge=1,
        le=1_000_000,
    )
    opening: int = Field(
        default=5,
        title="Opening",
        description="What is narrower than this is taken away before regions are formed, px.",
        ge=1,
        le=51,
    )


@dataclass(frozen=True)
class MovingRegion:
    """One thing that moves against the world.

    Attributes
    ----------
    row, col, height, width
        The box around it in the first frame, px.
    pixels
        How many there are.
    distance_m
        Median depth, metres.
    motion_m
        (right, down, forward) against the world between the frames, metres, median of its pixels, in the second
        frame of the camera.
    speed_kmh
        Length of that, km/h; None without a frame rate.
    """

    row: int
    col: int
    height: int
    width: int
    pixels: int
    distance_m: float
    motion_m: tuple[float, float, float]
    speed_kmh: float | None


@dataclass(frozen=True, eq=False)
class SceneFlow:
    """The motion of every pixel between two frames of a stereo camera.

    Attributes
    ----------
    motion
        (H, W, 3) float32 metres, X to the right, Y down, Z forward, in the frame of the camera, which may move itself;
        NaN = none.
    against_world
        (H, W, 3) float32 metres, the same less what a static point would do; 0 of the static scene.
    significance
        (H, W) float32: how many times the expected error the pixel is off from a static one; NaN = none.
    moving
        (H, W) bool, what moves against the world.
    labels
        (H, W) int32, 1 + the index of the region a pixel belongs to; 0 elsewhere.
    regions
        The moving things, nearest first.
    own_motion
        How the static world moves in the frame of the camera.
    own_speed_kmh
        Km/h; None without a frame rate.
    """

    motion: FloatMap
    against_world: FloatMap
    significance: FloatMap
    moving: Mask
    labels: npt.NDArray[np.int32]
    regions: tuple[MovingRegion, ...]
    own_motion: OwnMotion
    own_speed_kmh: float | None


def scene_flow(
    first: DisparityMap | FloatMap,
    second: DisparityMap | FloatMap,
    flow: FlowMap | tuple[FloatMap, FloatMap],
    calibration: Calibration,
    *,
    frame_rate: float | None = None,
    test: MovingTest | None = None,
) -> SceneFlow:
    """Return the motion in space of every pixel, our own motion, and what moves against the world.

    Parameters
    ----------
    first, second
        (H, W) disparities of the two frames, px; NaN = none. What was filled in takes no part.
    flow
        From the left image of the first frame to that of the second; a pair (dy, dx) of arrays will do. It should know
        nothing where the second frame hides the pixel, as after a forward-backward check: what stands before it there
        would be taken for it.
    calibration
        Of the rectified camera.
    frame_rate
        Frames per second, for speeds.
    test
        What counts as moving.

    Raises
    ------
    ValueError
        Maps of different size, a frame rate that is not above 0, or a scene in which no own motion is found.

    Notes
    -----
    Own motion by RANSAC over the pixels, then the residual of each, weighed by its expected error, as in A. Wedel
    et al., "Stereoscopic scene flow computation for 3D motion understanding", IJCV 95, 2011.
    """
    settings = test or MovingTest()
    if frame_rate is not None and not frame_rate > 0:
        raise ValueError(f"frame_rate is {frame_rate}; it must be above 0.")
    here, there = (measured(one) for one in (first, second))
    dy, dx = (
        (np.where(flow.filled, np.float32(np.nan), part) for part in (flow.dy, flow.dx))
        if isinstance(flow, FlowMap)
        else (np.asarray(part) for part in flow)
    )
    if len({here.shape, there.shape, dy.shape, dx.shape}) != 1 or here.ndim != 2:
        shapes = f"{here.shape}, {there.shape}, {dy.shape} and {dx.shape}"
        raise ValueError(f"Both disparities, dy and dx have the shapes {shapes}; all must be one (H, W).")
    matrix = camera_matrix(calibration, here.shape)
    row, col = places_of(here.shape)
    row_2, col_2 = row + dy, col + dx
    arrived = disparity_at(there, row_2, col_2)
    before = seen_points(calibration, here, row, col)
    after = seen_points(calibration, arrived, row_2, col_2)
    own = estimate_own_motion(before, row_2, col_2, matrix, tolerance=3 * settings.flow_error)
    static = own.moved(before)
    significance = _significance(own, before, (here, arrived), (row_2, col_2), calibration, settings)
    labels = _connected(significance > settings.threshold, settings)
    against_world = (after - static).astype(np.float32)
    found: list[tuple[int, MovingRegion]] = []
    for number in range(1, labels.max() + 1):
        region = _region(labels == number, after, against_world, frame_rate)
        found += [] if region is None else [(number, region)]
    found.sort(key=lambda one: one[1].distance_m)
    order = np.zeros(labels.max() + 1, np.int32)
    for place, (number, _) in enumerate(found):
        order[number] = place + 1
    return SceneFlow(
        motion=(after - before).astype(np.float32),
        against_world=against_world,
        significance=significance.astype(np.float32),
        moving=order[labels] > 0,
        labels=order[labels],
        regions=tuple(region for _, region in found),
        own_motion=own,
        own_speed_kmh=None if frame_rate is None else KMH * frame_rate * float(np.linalg.norm(own.travelled)),
    )


def measured(disparity: DisparityMap | FloatMap) -> FloatMap:
    """Return the disparities of a map without what was filled in; of an array all of them."""
    if isinstance(disparity, DisparityMap):
        return np.where(disparity.filled, np.float32(np.nan), disparity.disparity)
    return np.asarray(disparity, np.float32)


def places_of(shape: tuple[int, ...]) -> tuple[FloatMap, FloatMap]:
    """Return the (row, col) of every pixel, each (H, W) float32."""
    row, col = np.indices(shape, dtype=np.float32)
    return row, col


def disparity_at(disparity: FloatMap, row: FloatMap, col: FloatMap) -> FloatMap:
    """Return the disparity at places between the pixels: of the nearest one, as a mean over an edge is on no surface.

    NaN where the place is unknown, out of the frame or without a disparity.
    """
    rows, cols = disparity.shape
    inside = np.isfinite(row) & np.isfinite(col)
    y, x = (np.rint(np.where(inside, place, -1)).astype(np.intp) for place in (row, col))
    inside &= (y >= 0) & (y < rows) & (x >= 0) & (x < cols)
    return np.where(inside, disparity[np.where(inside, y, 0), np.where(inside, x, 0)], np.float32(np.nan))


def _significance(
    own: OwnMotion,
    before: Points,
    disparities: tuple[FloatMap, FloatMap],
    seen: tuple[FloatMap, FloatMap],
    calibration: Calibration,
    settings: MovingTest,
) -> FloatMap:
    """Return how many expected errors each pixel is off from a static one, over flow and disparity together."""
    here, arrived = disparities
    matrix = camera_matrix(calibration, here.shape)
    scale = calibration.focal_px * calibration.baseline_m
    row, col = places_of(here.shape)

    def expected(points: Points) -> tuple[DoubleMap, ...]:
        moved = own.moved(points)
        depth = np.where(moved[..., 2] > 0, moved[..., 2], np.nan)
        return *projected(moved, matrix), scale / depth - calibration.doffs_px

    static = expected(before)
    varied = expected(seen_points(calibration, here + np.float32(PROBE), row, col))
    total = np.zeros(here.shape)
    errors = (settings.flow_error, settings.flow_error, settings.disparity_error)
    for is_there, should_be, would_be, error in zip((*seen, arrived), static, varied, errors, strict=True):
        slope = (would_be - should_be) / PROBE
        residual = (is_there - should_be) ** 2 / (error**2 + (slope * settings.disparity_error) ** 2)
        # A pixel without a disparity in the second frame is judged by its flow alone.
        total += residual if is_there is not arrived else np.where(np.isfinite(residual), residual, 0)
    return np.asarray(np.sqrt(total))


def _connected(moving: Mask, settings: MovingTest) -> npt.NDArray[np.int32]:
    """Return the connected regions that are large enough, numbered from 1."""
    element = cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (settings.opening, settings.opening))
    opened = cv2.morphologyEx(moving.astype(np.uint8), cv2.MORPH_OPEN, element)
    _, labels, figures, _ = cv2.connectedComponentsWithStats(opened, connectivity=8)
    large = figures[:, cv2.CC_STAT_AREA] >= settings.smallest
    large[0] = False
    return np.asarray((np.cumsum(large) * large)[labels], np.int32)


def _region(mask: Mask, after: Points, against_world: FloatMap, frame_rate: float | None) -> MovingRegion | None:
    """Return what moves there; None where no pixel has a depth in both frames."""
    known = mask & np.isfinite(against_world).all(axis=2)
    if not known.any():
        return None
    motion = np.median(against_world[known], axis=0).astype(np.float64)
    rows, cols = np.flatnonzero(mask.any(axis=1)), np.flatnonzero(mask.any(axis=0))
    return MovingRegion(
        row=int(rows[0]),
        col=int(cols[0]),
        height=int(rows[-1] - rows[0] + 1),
        width=int(cols[-1] - cols[0] + 1),
        pixels=int(np.count_nonzero(mask)),
        distance_m=float(np.median(after[known][:, 2])),
        motion_m=(float(motion[0]), float(motion[1]), float(motion[2])),
        speed_kmh=None if frame_rate is None else KMH * frame_rate * float(np.linalg.norm(motion)),
    )
