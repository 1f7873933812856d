"""Things that move against the world: regions that disagree with the own motion, grown to whole objects."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import NamedTuple, TypeAlias

import cv2
import numpy as np
import numpy.typing as npt
from pydantic import Field

from stereolag.core.arrays import DoubleMap, FloatMap, Mask
from stereolag.core.inputs import Image, as_grey, grey_level
from stereolag.core.settings import Settings
from stereolag.geometry.calibration import Calibration
from stereolag.geometry.scene import ground_of
from stereolag.motion.candidates import Flow, fetched, places
from stereolag.motion.levels import edge_aware_mean

Box: TypeAlias = tuple[slice, slice]
"""Rows and columns."""

Vector: TypeAlias = npt.NDArray[np.float64]
"""(3,) metres: to the right, down, forward."""

Points: TypeAlias = npt.NDArray[np.float64]
"""(..., 3) metres: X to the right, Y down, Z forward; NaN = none."""

KMH = 3.6
"""km/h per m/s."""

MOST_ERROR_KMH, MOST_SHARE = 6.0, 0.1
"""Largest error of a trusted speed: the larger of this value in km/h and this share of the speed."""

WINDOW = 9
"""Side of the window in which two flows are compared, px."""

LEAST_VARIANCE = 0.25
"""Added to every variance, grey levels squared, so that without texture neither flow is better."""


class Camera(NamedTuple):
    """The rectified left camera, and its (3, 3) matrix for the images at hand."""

    calibration: Calibration
    matrix: npt.NDArray[np.float64]

    @classmethod
    def of(cls, calibration: Calibration, shape: tuple[int, ...]) -> Camera:
        """Return the camera for images of (rows, cols)."""
        focal, (cx, cy) = calibration.focal_px, calibration.centre(shape[1], shape[0])
        return cls(calibration, np.array([[focal, 0, cx], [0, focal, cy], [0, 0, 1]]))

    def points(self, disparity: FloatMap, places: FloatMap) -> Points:
        """Return the points (..., 3) with a disparity, px, at (2, ...) rows and columns."""
        depth = self.calibration.depth(disparity).astype(np.float64)
        x, y = (places[1] - self.matrix[0, 2]) * depth, (places[0] - self.matrix[1, 2]) * depth
        return np.stack([x / self.calibration.focal_px, y / self.calibration.focal_px, depth], axis=-1)

    def projected(self, points: Points) -> DoubleMap:
        """Return the (2, ...) row and column, px, at which points (..., 3) are seen; NaN behind the camera."""
        depth = np.where(points[..., 2] > 0, points[..., 2], np.nan)
        row = self.matrix[1, 2] + self.matrix[1, 1] * points[..., 1] / depth
        col = self.matrix[0, 2] + self.matrix[0, 0] * points[..., 0] / depth
        return np.stack([row, col])

    def seen(self, points: Points) -> DoubleMap:
        """Return the (3, ...) row, column and disparity, px, of points (..., 3); NaN behind the camera."""
        depth = np.where(points[..., 2] > 0, points[..., 2], np.nan)
        disparity = self.calibration.focal_px * self.calibration.baseline_m / depth - self.calibration.doffs_px
        return np.stack([*self.projected(points), disparity])


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
        return is_accurate(self.speed_kmh, self.speed_error_kmh)


def is_accurate(speed_kmh: float | None, error_kmh: float | None) -> bool:
    """Return whether a speed is accurate enough to be shown; one that is unknown is not."""
    if speed_kmh is None or error_kmh is None:
        return False
    return error_kmh <= max(MOST_ERROR_KMH, MOST_SHARE * speed_kmh)


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
    level = grey_level(*images)
    scores = [correlation(first, fetched(second, np.where(known, one, np.float32(0))), level) for one in (flow, other)]
    return np.asarray(known & (scores[0] - scores[1] > gain))


def _within(flow: Flow) -> Mask:
    """Return (H, W) where the flow is known and its end point has a whole window within the frame."""
    row, col = places(flow)
    rows, cols = row.shape
    margin = WINDOW // 2
    return np.asarray((row >= margin) & (row < rows - margin) & (col >= margin) & (col < cols - margin))


def correlation(one: Image, other: Image, level: float) -> FloatMap:
    """Return the Pearson correlation of the windows around every pixel; `level` is one grey level of 255 in units."""
    size, least = (WINDOW, WINDOW), LEAST_VARIANCE * level**2
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


def region_of(thing: Thing, distance_m: float, own_error_m: float, frame_rate: float | None) -> MovingRegion:
    """Return the moving region of a thing, which inherits the error of our own motion."""
    (rows, cols), motion = thing.box, thing.shift.motion
    row, col = np.nonzero(thing.mask)
    length = float(np.linalg.norm(motion))
    along = motion / max(length, 1e-9)
    error = float(np.sqrt(along @ thing.shift.covariance @ along + own_error_m**2))
    speed, speed_error = (None, None) if frame_rate is None else (KMH * frame_rate * length, KMH * frame_rate * error)
    return MovingRegion(
        row=int(rows.start + row.min()),
        col=int(cols.start + col.min()),
        height=int(np.ptp(row) + 1),
        width=int(np.ptp(col) + 1),
        pixels=int(row.size),
        distance_m=distance_m,
        motion_m=(float(motion[0]), float(motion[1]), float(motion[2])),
        speed_kmh=speed,
        speed_error_kmh=speed_error,
    )


ROUNDS = 2
"""Rounds of growing a thing by its motion and refitting the motion to all of it."""

STEPS = 8
"""Steps of the fit, each weighting pixels by their residuals from the one before."""

FEWEST = 30
"""Fewest pixels with a disparity in both frames for which a motion is fitted."""

ALIKE = 64
"""Pixels of a region that count as one independent witness, as a flow is smooth over the width of its windows."""

MOST_WITNESSES = 12
"""Most independent witnesses: averaging does not remove errors shared by all pixels, such as bias towards whole px."""

LEAST_SCATTER = 0.2
"""Least scatter of flow and disparity assumed in a fit, px."""

SLACK = (-1.0, -0.67, -0.33, 0.0, 0.33, 0.67, 1.0)
"""Disparity errors allowed for when testing whether a point stands still, px."""

LENGTH = 4.0
"""Largest extent of a thing in front of and behind its median depth, metres."""

GAIN = 0.02
"""Least median gain in correlation over the windows of a thing if it moves rather than stands still."""

MARGIN = 0.6
"""Margin around the known part of a thing in which the rest is searched, as a share of its size."""

LEAST_MARGIN = 16
"""Least margin, px."""

DOUBT = 0.06
"""Evidence for standing still, in correlation, that a pixel may show and still belong to a thing at its distance."""

LOWEST = 0.12
"""Height above the ground from which a pixel no longer counts as ground, in camera heights."""

BRIDGED, BRIDGED_SHARE = 9, 0.3
"""Largest gap that is closed: the larger of this many px and this share of the known part's height."""


@dataclass(frozen=True, eq=False)
class Views:
    """The data from which the extent of a thing is found.

    Attributes
    ----------
    first, second
        (H, W) float32, both frames, grey.
    guide
        (H, W) uint8, the first frame.
    level
        One grey level of 255 in the units of the frames.
    points
        (H, W, 3) metres, position of every pixel in the second frame if it stood still; gaps may be filled.
    disparity
        (H, W) px of the first frame; gaps may be filled.
    standing
        (H, W) bool, pixels above the ground; the ground is excluded because shadows move too.
    """

    first: FloatMap
    second: FloatMap
    guide: npt.NDArray[np.uint8]
    level: float
    points: Points
    disparity: FloatMap
    standing: Mask
    origin: Vector
    """Position of the camera at the first frame in its coordinates at the second, metres."""
    camera: Camera


@dataclass(frozen=True, eq=False)
class Sight:
    """The measurements of every pixel.

    Attributes
    ----------
    static
        (H, W, 3) metres, its position in the second frame if it stood still; NaN = none.
    seen
        (3, H, W) px, its row, column and disparity in the second frame; NaN = none.
    """

    static: Points
    seen: FloatMap
    camera: Camera


class Thing(NamedTuple):
    """A moving thing: its place in the first frame, and its motion."""

    box: Box
    mask: Mask
    shift: RigidShift


def whole_things(seeds: Sequence[tuple[Box, Mask]], sight: Sight, views: Views | None, smallest: int) -> list[Thing]:
    """Return the distinct things that regions are part of, without those that the frames contradict."""
    taken = np.zeros(sight.seen.shape[1:], np.bool_)
    found = []
    for box, seed in sorted(seeds, key=lambda one: -np.count_nonzero(one[1])):
        if 2 * np.count_nonzero(seed & taken[box]) > np.count_nonzero(seed):
            continue
        shift = fitted_shift(sight, box, seed)
        mask = seed
        for _ in range(ROUNDS if views is not None and shift is not None else 0):
            assert views is not None and shift is not None
            box, mask = extent(views, box, mask, shift.motion)
            mask &= ~taken[box]
            if np.count_nonzero(mask) < smallest:
                shift = None
                break
            shift = fitted_shift(sight, box, mask) or shift
            if np.median(explained(views, box, shift.motion)[mask]) < GAIN:
                shift = None
                break
        if shift is not None:
            taken[box] |= mask
            found.append(Thing(box, mask, shift))
    return found


def fitted_shift(sight: Sight, box: Box, mask: Mask) -> RigidShift | None:
    """Return the shift that takes a thing's points to their positions in the second frame; None with too few points.

    Rows and columns show how a thing grows as it approaches, which is more accurate than its disparity if it is large
    in the picture; if it is small and far, both are weak, and the covariance reflects that.

    Notes
    -----
    Gauss-Newton with Geman-McClure weights; each coordinate's scatter is estimated from its median absolute residual.
    """
    static = sight.static[box][mask]
    seen = sight.seen[:, *box][:, mask].T
    known = np.isfinite(static).all(axis=1) & np.isfinite(seen[:, :2]).all(axis=1)
    static, seen = static[known], seen[known].astype(np.float64)
    with_disparity = np.isfinite(seen[:, 2])
    if np.count_nonzero(with_disparity) < FEWEST:
        return None
    after = sight.camera.points(seen[with_disparity, 2], seen[with_disparity, :2].T)
    motion: Vector = np.median(after - static[with_disparity], axis=0).astype(np.float64)
    calibration = sight.camera.calibration
    focal, scale = calibration.focal_px, calibration.focal_px * calibration.baseline_m
    normal = np.eye(3)
    for _ in range(STEPS):
        moved = static + motion
        depth = np.maximum(moved[:, 2], 0.1)
        expected = np.stack([*sight.camera.projected(moved), scale / depth - calibration.doffs_px], axis=1)
        residual = np.nan_to_num(seen - expected)
        residual[~with_disparity, 2] = 0
        slopes = np.zeros((len(static), 3, 3))
        slopes[:, 0, 1] = slopes[:, 1, 0] = focal / depth
        slopes[:, 0, 2], slopes[:, 1, 2] = -focal * moved[:, 1] / depth**2, -focal * moved[:, 0] / depth**2
        slopes[:, 2, 2] = -scale / depth**2
        slopes[~with_disparity, 2] = 0
        scatter = np.maximum(1.4826 * np.median(np.abs(residual), axis=0), LEAST_SCATTER)
        scatter[2] = max(1.4826 * float(np.median(np.abs(residual[with_disparity, 2]))), LEAST_SCATTER)
        share = residual / (3 * scatter)
        weight = 1 / np.square(1 + np.square(share)) / np.square(scatter)
        normal = np.einsum("nki,nk,nkj->ij", slopes, weight, slopes) + 1e-9 * np.eye(3)
        step = np.linalg.solve(normal, np.einsum("nki,nk,nk->i", slopes, weight, residual))
        motion = np.asarray(motion + step, np.float64)
    witnesses = min(max(len(static) / ALIKE, 1.0), MOST_WITNESSES)
    return RigidShift(motion, np.asarray(np.linalg.inv(normal) * (len(static) / witnesses), np.float64))


def explained(views: Views, box: Box, motion: Vector) -> FloatMap:
    """Return the gain in correlation of the windows in a box if their content moves by `motion` over standing still."""
    points = views.points[box]
    calibration = views.camera.calibration
    scale = calibration.focal_px * calibration.baseline_m
    standing = np.full(points.shape[:2], -1, np.float32)
    own = views.disparity[box] + calibration.doffs_px
    for slack in SLACK:
        # A point with a slightly larger disparity is nearer along its ray, by this factor. The camera's motion is a
        # rotation and a shift, so its distance from `origin`, the position at depth 0, shrinks by the same factor.
        factor = own / np.maximum(own + slack, scale / 1e4)
        shifted = views.origin + factor[..., None] * (points - views.origin)
        standing = np.maximum(standing, _correlated(views, box, shifted))
    return np.asarray(_correlated(views, box, points + motion) - standing)


def _correlated(views: Views, box: Box, points: Points) -> FloatMap:
    row, col = views.camera.projected(points).astype(np.float32)
    rows, cols = views.first.shape
    inside = (row > -0.5) & (row < rows - 0.5) & (col > -0.5) & (col < cols - 0.5)
    there = cv2.remap(
        views.second,
        np.where(inside, col, -1),
        np.where(inside, row, -1),
        cv2.INTER_LINEAR,
        borderMode=cv2.BORDER_REPLICATE,
    )
    found = correlation(views.first[box], there, views.level)
    return np.where(inside, found, np.float32(-1))


def extent(views: Views, box: Box, seed: Mask, motion: Vector) -> tuple[Box, Mask]:
    """Return the box of the thing that `seed` is part of, and its mask within the box.

    The thing comprises the pixels at the distance of the seed that are connected to it and move like it. The evidence
    is propagated from pixels where the frames distinguish the two motions to those where they do not, up to edges.
    """
    wide = _widened(box, views.first.shape)
    known = np.zeros(views.first.shape, np.bool_)
    known[box] = seed
    known = known[wide]
    disparity = views.disparity[wide]
    middle = float(np.median(disparity[known & np.isfinite(disparity)]))
    calibration = views.camera.calibration
    depth, own = calibration.depth(disparity), float(calibration.depth(middle))
    reach = LENGTH + 2 * float(calibration.depth_uncertainty(middle, 0.5))
    near = (np.abs(depth - own) < reach) & views.standing[wide]
    gain = np.nan_to_num(explained(views, wide, motion))
    weight = np.abs(gain).astype(np.float32)
    carried = edge_aware_mean(
        np.stack([gain, gain]).astype(np.float32), weight, np.ascontiguousarray(views.guide[wide])
    )[0]
    member = (near & (carried > -DOUBT)).astype(np.uint8)
    member = cv2.morphologyEx(member, cv2.MORPH_OPEN, np.ones((3, 3), np.uint8))
    _, labels = cv2.connectedComponents(member, connectivity=4)
    parts = np.unique(labels[known & (member > 0)])
    whole = np.isin(labels, parts[parts > 0]).astype(np.uint8)
    gap = max(BRIDGED, round(BRIDGED_SHARE * np.ptp(np.nonzero(known)[0])))
    bridge = cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (gap, gap))
    whole = np.pad(whole, gap)
    whole = np.asarray(cv2.morphologyEx(whole, cv2.MORPH_CLOSE, bridge), np.uint8)
    outlines, _ = cv2.findContours(whole, cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_NONE)
    cv2.drawContours(whole, outlines, -1, 1, cv2.FILLED)
    return wide, whole[gap:-gap, gap:-gap] > 0


def _widened(box: Box, shape: tuple[int, ...]) -> Box:
    wide = []
    for side, length in zip(box, shape, strict=True):
        margin = max(LEAST_MARGIN, round(MARGIN * (side.stop - side.start)))
        wide.append(slice(max(0, int(side.start) - margin), min(length, int(side.stop) + margin)))
    return wide[0], wide[1]


def above_ground(disparity: FloatMap) -> Mask:
    """Return the (H, W) mask of pixels above the ground; all pixels if no ground is seen."""
    ground = ground_of(disparity)
    if ground is None:
        return np.ones(disparity.shape, np.bool_)
    return np.asarray(disparity * np.float32(1 - LOWEST) > ground.disparities(len(disparity)))
