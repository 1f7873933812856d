"""Objects that move against the world: regions that disagree with our own motion, grown to whole objects."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import NamedTuple, TypeAlias

import cv2
import numpy as np
from pydantic import Field

from stereolag.core.arrays import DoubleMap, EightBit, FloatMap, Mask, Vector
from stereolag.core.inputs import Image, as_grey, grey_level
from stereolag.core.settings import Settings
from stereolag.geometry.calibration import Calibration
from stereolag.geometry.scene import ground_of
from stereolag.motion.candidates import Flow, end_points, warped
from stereolag.motion.levels import edge_aware_mean

Box: TypeAlias = tuple[slice, slice]
"""Rows and columns of a rectangle."""

Points: TypeAlias = DoubleMap
"""(..., 3) metres: X to the right, Y down, Z forward; NaN = none."""

KMH = 3.6
"""km/h per m/s."""

WINDOW_PX = 9
"""Side of the window in which two flows are compared, px."""

ADDED_VARIANCE = 0.25
"""Added to every variance, grey levels squared, so that without texture neither flow is better."""


class Camera(NamedTuple):
    """The rectified left camera, and its (3, 3) matrix for images of a given size."""

    calibration: Calibration
    matrix: DoubleMap

    @classmethod
    def of(cls, calibration: Calibration, shape: tuple[int, ...]) -> Camera:
        """Return the camera for images of (rows, cols)."""
        focal, (cx, cy) = calibration.focal_px, calibration.centre(shape[1], shape[0])
        return cls(calibration, np.array([[focal, 0, cx], [0, focal, cy], [0, 0, 1]]))

    def points(self, disparity: FloatMap, places: FloatMap) -> Points:
        """Return the points (..., 3) at (2, ...) rows and columns, px, with the given disparities, px."""
        depth = self.calibration.depth(disparity).astype(np.float64)
        x, y = (places[1] - self.matrix[0, 2]) * depth, (places[0] - self.matrix[1, 2]) * depth
        return np.stack([x / self.calibration.focal_px, y / self.calibration.focal_px, depth], axis=-1)

    def projected(self, points: Points) -> DoubleMap:
        """Return the (2, ...) row and column, px, of points (..., 3); NaN behind the camera."""
        depth = np.where(points[..., 2] > 0, points[..., 2], np.nan)
        row = self.matrix[1, 2] + self.matrix[1, 1] * points[..., 1] / depth
        col = self.matrix[0, 2] + self.matrix[0, 0] * points[..., 0] / depth
        return np.stack([row, col])

    def observed(self, points: Points) -> DoubleMap:
        """Return the (3, ...) row, column and disparity, px, of points (..., 3); NaN behind the camera."""
        depth = np.where(points[..., 2] > 0, points[..., 2], np.nan)
        disparity = self.calibration.focal_px * self.calibration.baseline_m / depth - self.calibration.doffs_px
        return np.stack([*self.projected(points), disparity])


class RigidShift(NamedTuple):
    """The motion of an object against the world between two frames, without rotation."""

    motion: Vector
    """(3,) metres: to the right, down, forward."""
    covariance: DoubleMap
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
    """One object that moves against the world.

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
        return is_accurate(self.speed_kmh, self.speed_error_kmh)


def is_accurate(speed_kmh: float | None, error_kmh: float | None) -> bool:
    """Return whether a speed is known with an error of at most 6 km/h or a tenth of it, and can be shown."""
    return speed_kmh is not None and error_kmh is not None and error_kmh <= max(6.0, 0.1 * speed_kmh)


def better_correlated(images: tuple[Image, Image], flow: Flow, other: Flow, gain: float) -> Mask:
    """Return the (H, W) mask of pixels whose windows correlate better along one flow than along another.

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
    known = _window_within(flow) & _window_within(other)
    level = grey_level(*images)
    scores = [correlation(first, warped(second, np.where(known, one, np.float32(0))), level) for one in (flow, other)]
    return np.asarray(known & (scores[0] - scores[1] > gain))


def _window_within(flow: Flow) -> Mask:
    """Return the (H, W) mask of pixels whose flow is known and ends where a whole window is within the frame."""
    row, col = end_points(flow)
    rows, cols = row.shape
    margin = WINDOW_PX // 2
    return np.asarray((row >= margin) & (row < rows - margin) & (col >= margin) & (col < cols - margin))


def correlation(first: Image, second: Image, level: float) -> FloatMap:
    """Return the Pearson correlation of the windows around every pixel.

    `level` is one grey level of 255 in the units of the images.
    """
    size, added = (WINDOW_PX, WINDOW_PX), ADDED_VARIANCE * level**2
    first, second = first - first.mean(), second - second.mean()
    mean, other_mean = cv2.blur(first, size), cv2.blur(second, size)
    covariance = cv2.blur(first * second, size) - mean * other_mean
    variance = np.maximum(cv2.blur(first * first, size) - mean * mean, 0) + added
    other_variance = np.maximum(cv2.blur(second * second, size) - other_mean * other_mean, 0) + added
    return np.asarray(covariance / np.sqrt(variance * other_variance))


def connected_regions(moving: Mask, settings: MovingTest) -> Iterator[tuple[Box, Mask]]:
    """Yield the bounding box of every connected region that is large enough, and its mask within the box."""
    element = cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (settings.opening, settings.opening))
    opened = cv2.morphologyEx(moving.astype(np.uint8), cv2.MORPH_OPEN, element)
    _, labels, statistics, _ = cv2.connectedComponentsWithStats(opened, connectivity=8)
    for number, (col, row, width, height, pixels) in enumerate(statistics):
        if number > 0 and pixels >= settings.smallest:
            box = slice(row, row + height), slice(col, col + width)
            yield box, labels[box] == number


def moves_as_one(from_static: DoubleMap, from_moving: DoubleMap, settings: MovingTest) -> bool:
    """Return whether the pixels of a region move significantly, and as one object.

    Parameters
    ----------
    from_static, from_moving
        (3, n) deviations of row, column and disparity, in expected errors, from static points and from one moving
        object.
    settings
        The thresholds.
    """
    if from_static.shape[1] < settings.smallest / 2:
        return False
    static, moving = (float(np.median(np.linalg.norm(one, axis=0))) for one in (from_static, from_moving))
    return static > settings.threshold and static > settings.coherence * moving


def region_of(moving: MovingObject, depth: DoubleMap, own_error_m: float, frame_rate: float | None) -> MovingRegion:
    """Return the region of a moving object, given the depth of every pixel, m; its error includes our own motion's."""
    (rows, cols), motion = moving.box, moving.shift.motion
    row, col = np.nonzero(moving.mask)
    length = float(np.linalg.norm(motion))
    direction = motion / max(length, 1e-9)
    error = float(np.sqrt(direction @ moving.shift.covariance @ direction + own_error_m**2))
    speed, speed_error = (None, None) if frame_rate is None else (KMH * frame_rate * length, KMH * frame_rate * error)
    return MovingRegion(
        row=int(rows.start + row.min()),
        col=int(cols.start + col.min()),
        height=int(np.ptp(row) + 1),
        width=int(np.ptp(col) + 1),
        pixels=int(row.size),
        distance_m=float(np.nanmedian(depth[moving.box][moving.mask])),
        motion_m=(float(motion[0]), float(motion[1]), float(motion[2])),
        speed_kmh=speed,
        speed_error_kmh=speed_error,
    )


MIN_PIXELS = 30
"""Least number of pixels with a disparity in both frames for which a motion is fitted."""

CORRELATED_PIXELS = 64
"""Pixels of a region that count as one independent observation, as a flow is smooth over the width of its windows."""

MAX_OBSERVATIONS = 12
"""Largest number of independent observations: averaging does not remove errors shared by all pixels, such as a bias
towards whole px."""

MIN_SCATTER_PX = 0.2
"""Least scatter of flow and disparity assumed in a fit, px."""

MAX_EXTENT_M = 4.0
"""Largest extent of an object in front of and behind its median depth, metres."""

MIN_GAIN = 0.02
"""Least median gain in correlation over the windows of an object if it moves rather than stands still."""

MAX_LOSS = 0.06
"""Largest loss in correlation under the motion of an object, against standing still, of a pixel that belongs to it."""


@dataclass(frozen=True, eq=False)
class Views:
    """The data from which the extent of an object is found.

    Attributes
    ----------
    first, second
        (H, W) float32, both frames, grey.
    guide
        (H, W) uint8, the first frame.
    level
        One grey level of 255 in the units of the frames.
    points
        (H, W, 3) metres, position of every pixel in the second frame if it is static; gaps may be filled.
    disparity
        (H, W) px of the first frame; gaps may be filled.
    above_ground
        (H, W) bool, pixels above the ground; the ground is excluded because shadows move too.
    origin
        (3,) metres, position of the camera at the first frame in its coordinates at the second.
    camera
        The left camera.
    """

    first: FloatMap
    second: FloatMap
    guide: EightBit
    level: float
    points: Points
    disparity: FloatMap
    above_ground: Mask
    origin: Vector
    camera: Camera


@dataclass(frozen=True, eq=False)
class Measurements:
    """The measurements of every pixel.

    Attributes
    ----------
    static
        (H, W, 3) metres, its position in the second frame if it is static; NaN = none.
    observed
        (3, H, W) px, its row, column and disparity in the second frame; NaN = none.
    camera
        The left camera.
    """

    static: Points
    observed: FloatMap
    camera: Camera


class MovingObject(NamedTuple):
    """A moving object: its place in the first frame, and its motion."""

    box: Box
    mask: Mask
    shift: RigidShift


def whole_objects(
    seeds: Sequence[tuple[Box, Mask]], measurements: Measurements, views: Views | None, smallest: int
) -> list[MovingObject]:
    """Return the distinct objects that regions are part of, without those that the frames contradict."""
    taken = np.zeros(measurements.observed.shape[1:], np.bool_)
    found = []
    for box, mask in sorted(seeds, key=lambda one: -np.count_nonzero(one[1])):
        if 2 * np.count_nonzero(mask & taken[box]) > np.count_nonzero(mask):
            continue
        whole = _whole_object(box, mask, taken, measurements, views, smallest)
        if whole is not None:
            taken[whole.box] |= whole.mask
            found.append(whole)
    return found


def _whole_object(
    box: Box, mask: Mask, taken: Mask, measurements: Measurements, views: Views | None, smallest: int
) -> MovingObject | None:
    """Return the object that a region is part of, or without views the region; None if the frames contradict it.

    Twice, the object is grown by its motion, and the motion is fitted to all of it.
    """
    shift = fitted_shift(measurements, box, mask)
    if shift is None or views is None:
        return None if shift is None else MovingObject(box, mask, shift)
    for _ in range(2):
        box, mask = extent(views, box, mask, shift.motion)
        mask &= ~taken[box]
        if np.count_nonzero(mask) < smallest:
            return None
        shift = fitted_shift(measurements, box, mask) or shift
        if np.median(motion_gain(views, box, shift.motion)[mask]) < MIN_GAIN:
            return None
    return MovingObject(box, mask, shift)


def fitted_shift(measurements: Measurements, box: Box, mask: Mask) -> RigidShift | None:
    """Return the shift that takes an object's points to their positions in the second frame; None with too few points.

    Rows and columns show how an object grows as it approaches, which is more accurate than its disparity if it is large
    in the image; if it is small and far, both are weak, and the covariance reflects that.

    Notes
    -----
    Eight steps of Gauss-Newton with Geman-McClure weights, from the residuals of the step before; each coordinate's
    scatter is estimated from its median absolute residual.
    """
    static = measurements.static[box][mask]
    observed = measurements.observed[:, *box][:, mask].T
    known = np.isfinite(static).all(axis=1) & np.isfinite(observed[:, :2]).all(axis=1)
    static, observed = static[known], observed[known].astype(np.float64)
    with_disparity = np.isfinite(observed[:, 2])
    if np.count_nonzero(with_disparity) < MIN_PIXELS:
        return None
    camera = measurements.camera
    after = camera.points(observed[with_disparity, 2], observed[with_disparity, :2].T)
    motion: Vector = np.median(after - static[with_disparity], axis=0).astype(np.float64)
    focal, scale = camera.calibration.focal_px, camera.calibration.focal_px * camera.calibration.baseline_m
    normal = np.eye(3)
    for _ in range(8):
        moved = static + motion
        depth = np.maximum(moved[:, 2], 0.1)
        expected = np.stack([*camera.projected(moved), scale / depth - camera.calibration.doffs_px], axis=1)
        residual = np.nan_to_num(observed - expected)
        residual[~with_disparity, 2] = 0
        jacobian = np.zeros((len(static), 3, 3))
        jacobian[:, 0, 1] = jacobian[:, 1, 0] = focal / depth
        jacobian[:, 0, 2], jacobian[:, 1, 2] = -focal * moved[:, 1] / depth**2, -focal * moved[:, 0] / depth**2
        jacobian[:, 2, 2] = -scale / depth**2
        jacobian[~with_disparity, 2] = 0
        scatter = np.maximum(1.4826 * np.median(np.abs(residual), axis=0), MIN_SCATTER_PX)
        scatter[2] = max(1.4826 * float(np.median(np.abs(residual[with_disparity, 2]))), MIN_SCATTER_PX)
        weight = 1 / np.square(1 + np.square(residual / (3 * scatter))) / np.square(scatter)
        normal = np.einsum("nki,nk,nkj->ij", jacobian, weight, jacobian) + 1e-9 * np.eye(3)
        step = np.linalg.solve(normal, np.einsum("nki,nk,nk->i", jacobian, weight, residual))
        motion = np.asarray(motion + step, np.float64)
    observations = min(max(len(static) / CORRELATED_PIXELS, 1.0), MAX_OBSERVATIONS)
    return RigidShift(motion, np.asarray(np.linalg.inv(normal) * (len(static) / observations), np.float64))


def motion_gain(views: Views, box: Box, motion: Vector) -> FloatMap:
    """Return the gain in correlation of the windows in a box if their content moves by `motion` over standing still."""
    points = views.points[box]
    calibration = views.camera.calibration
    scale = calibration.focal_px * calibration.baseline_m
    static_score = np.full(points.shape[:2], -1, np.float32)
    disparity = views.disparity[box] + calibration.doffs_px
    for error in (-1.0, -0.67, -0.33, 0.0, 0.33, 0.67, 1.0):  # of a disparity, px
        # A point with a slightly larger disparity is nearer along its ray, by this factor. The camera's motion is a
        # rotation and a shift, so its distance from `origin`, the position at depth 0, shrinks by the same factor.
        factor = disparity / np.maximum(disparity + error, scale / 1e4)
        shifted = views.origin + factor[..., None] * (points - views.origin)
        static_score = np.maximum(static_score, _correlation_at(views, box, shifted))
    return np.asarray(_correlation_at(views, box, points + motion) - static_score)


def _correlation_at(views: Views, box: Box, points: Points) -> FloatMap:
    """Return the correlation of the windows in a box with those at the projections of points; -1 out of the frame."""
    row, col = views.camera.projected(points).astype(np.float32)
    rows, cols = views.first.shape
    inside = (row > -0.5) & (row < rows - 0.5) & (col > -0.5) & (col < cols - 0.5)
    second = cv2.remap(
        views.second,
        np.where(inside, col, -1),
        np.where(inside, row, -1),
        cv2.INTER_LINEAR,
        borderMode=cv2.BORDER_REPLICATE,
    )
    return np.where(inside, correlation(views.first[box], second, views.level), np.float32(-1))


def extent(views: Views, box: Box, seed: Mask, motion: Vector) -> tuple[Box, Mask]:
    """Return the box of the object that `seed` is part of, and its mask within the box.

    The object comprises the pixels at the distance of the seed that are connected to it and move like it. The evidence
    is propagated from pixels where the frames distinguish the two motions to those where they do not, up to edges.
    """
    rows, cols = (_widened(*side) for side in zip(box, views.first.shape, strict=True))
    wide = rows, cols
    known = np.zeros(views.first.shape, np.bool_)
    known[box] = seed
    known = known[wide]
    disparity = views.disparity[wide]
    median = float(np.median(disparity[known & np.isfinite(disparity)]))
    calibration = views.camera.calibration
    reach = MAX_EXTENT_M + 2 * float(calibration.depth_uncertainty(median, 0.5))
    near = np.abs(calibration.depth(disparity) - float(calibration.depth(median))) < reach
    gain = np.nan_to_num(motion_gain(views, wide, motion))
    weight = np.abs(gain).astype(np.float32)
    smoothed = edge_aware_mean(
        np.stack([gain, gain]).astype(np.float32), weight, np.ascontiguousarray(views.guide[wide])
    )[0]
    member = (near & views.above_ground[wide] & (smoothed > -MAX_LOSS)).astype(np.uint8)
    member = cv2.morphologyEx(member, cv2.MORPH_OPEN, np.ones((3, 3), np.uint8))
    _, labels = cv2.connectedComponents(member, connectivity=4)
    parts = np.unique(labels[known & (member > 0)])
    gap = max(9, round(0.3 * np.ptp(np.nonzero(known)[0])))  # closed, px: 30 % of the height of the known part
    element = cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (gap, gap))
    whole = np.pad(np.isin(labels, parts[parts > 0]).astype(np.uint8), gap)
    whole = np.asarray(cv2.morphologyEx(whole, cv2.MORPH_CLOSE, element), np.uint8)
    outlines, _ = cv2.findContours(whole, cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_NONE)
    cv2.drawContours(whole, outlines, -1, 1, cv2.FILLED)
    return wide, whole[gap:-gap, gap:-gap] > 0


def _widened(side: slice, length: int) -> slice:
    """Return a side of a box with margins of 60 % of its size, at least 16 px, within an image of that length."""
    margin = max(16, round(0.6 * (side.stop - side.start)))
    return slice(max(0, int(side.start) - margin), min(length, int(side.stop) + margin))


def above_ground(disparity: FloatMap) -> Mask:
    """Return the (H, W) mask of pixels that are above the ground by more than 12 % of the camera's height.

    These are all pixels if no ground is visible.
    """
    ground = ground_of(disparity)
    if ground is None:
        return np.ones(disparity.shape, np.bool_)
    return np.asarray(disparity * np.float32(1 - 0.12) > ground.disparities(len(disparity)))
