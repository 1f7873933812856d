"""Scene flow: the motion of every pixel in metres, our own motion, and the things that move against the world."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
import numpy.typing as npt

from stereolag.core.arrays import FloatMap, Mask
from stereolag.core.inputs import as_eight_bit, as_grey, as_image_pair, grey_level
from stereolag.geometry.calibration import Calibration
from stereolag.motion.flow import FlowMap
from stereolag.motion.moving_objects import (
    KMH,
    Camera,
    MovingRegion,
    MovingTest,
    Sight,
    Views,
    above_ground,
    better_explained,
    connected,
    fitted_shift,
    is_accurate,
    moves_as_one,
    region_of,
    whole_things,
)
from stereolag.motion.own_motion import Doubt, OwnMotion, estimate_own_motion, expected_errors
from stereolag.stereo.matcher import DisparityMap

BLUR = 1.0
"""Standard deviation of the blur before the extent of things is found, px: windows are not shifted in finer steps."""


@dataclass(frozen=True, eq=False)
class SceneFlow:
    """The motion of every pixel between two frames of a stereo camera.

    Attributes
    ----------
    motion
        (H, W, 3) float32 metres, X to the right, Y down, Z forward, relative to the camera, which may itself move;
        NaN = none.
    against_world
        (H, W, 3) float32 metres, the motion minus that of a static point; 0 in the static scene.
    significance
        (H, W) float32, deviation from a static point in expected errors; NaN = none.
    moving
        (H, W) bool, the pixels of things that move against the world.
    labels
        (H, W) int32, 1 + the index of the region that a pixel belongs to; 0 elsewhere.
    regions
        The moving things, nearest first; none where our own motion is in doubt.
    own_motion
        The motion of the static world in camera coordinates.
    own_speed_kmh, own_speed_error_kmh
        Our own speed and its standard error, km/h; None without a frame rate.

    Examples
    --------
    A flat road 1.5 m below a camera that moves 1 m forwards, with a patch that moves to the right:

    >>> import numpy as np
    >>> import stereolag as sl
    >>> camera = sl.Calibration(focal_px=200.0, baseline_m=0.5, cx=31.5, cy=-20.0)
    >>> row, col = np.indices((48, 64), dtype=np.float32)
    >>> road = (row + 20) / 3  # disparity, px: the same from every place
    >>> growth = road / (100 - road)
    >>> dy, dx = (row + 20) * growth, (col - 31.5) * growth  # px
    >>> dx[10:35, 20:45] += 8
    >>> motion = sl.scene_flow(road, road, (dy, dx), camera)
    >>> [(thing.row, thing.col) for thing in motion.regions]  # px, top left of the box
    [(10, 20)]
    >>> motion.moving.dtype, motion.against_world.shape  # metres
    (dtype('bool'), (48, 64, 3))
    """

    motion: FloatMap
    against_world: FloatMap
    significance: FloatMap
    moving: Mask
    labels: npt.NDArray[np.int32]
    regions: tuple[MovingRegion, ...]
    own_motion: OwnMotion
    own_speed_kmh: float | None
    own_speed_error_kmh: float | None

    @property
    def doubt(self) -> Doubt:
        """Return why our own speed is not to be shown: the doubt of our own motion, or "inaccurate"; otherwise ""."""
        told = self.own_speed_kmh is None or is_accurate(self.own_speed_kmh, self.own_speed_error_kmh)
        return self.own_motion.doubt or ("" if told else "inaccurate")


def scene_flow(
    first: DisparityMap | FloatMap,
    second: DisparityMap | FloatMap,
    flow: FlowMap | tuple[FloatMap, FloatMap],
    calibration: Calibration,
    *,
    frames: tuple[npt.ArrayLike, npt.ArrayLike] | None = None,
    frame_rate: float | None = None,
    test: MovingTest | None = None,
) -> SceneFlow:
    """Return the motion in space of every pixel, our own motion, and the things that move against the world.

    Parameters
    ----------
    first, second
        (H, W) disparities of the two frames, px; NaN = none. Filled-in disparities are ignored.
    flow
        Flow between the left images of the first and second frames, or a pair (dy, dx) of arrays. It should be blank
        where a pixel is hidden in the second frame, as after a forward-backward check: the object in front would be
        mistaken for it.
    calibration
        Calibration of the rectified camera.
    frames
        The left images of both frames: then pixels that match as well standing still do not count as moving. Flow errs
        most without texture, and the road is large.
    frame_rate
        Frames per second, for speeds.
    test
        Criteria for moving.

    Raises
    ------
    ValueError
        If the maps differ in size, the frame rate is not above 0, or our own motion cannot be found.

    Notes
    -----
    Our own motion is found by RANSAC over the pixels, then each residual is weighted by its expected error, as in A.
    Wedel et al., "Stereoscopic scene flow computation for 3D motion understanding", IJCV 95, 2011.

    Examples
    --------
    A camera 1.5 m above a flat road moves 1 m forwards in 0.1 s:

    >>> import numpy as np
    >>> import stereolag as sl
    >>> camera = sl.Calibration(focal_px=200.0, baseline_m=0.5, cx=31.5, cy=-20.0)
    >>> row, col = np.indices((48, 64), dtype=np.float32)
    >>> road = (row + 20) / 3  # disparity, px: the same from every place
    >>> growth = road / (100 - road)  # of the image, as a depth of 100 / road metres becomes 1 m less
    >>> flow = (row + 20) * growth, (col - 31.5) * growth  # dy, dx, px
    >>> motion = sl.scene_flow(road, road, flow, camera, frame_rate=10.0)
    >>> round(motion.own_speed_kmh, 1), motion.regions  # km/h; nothing moves against the world
    (36.0, ())
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
    camera = Camera.of(calibration, here.shape)
    places = np.indices(here.shape, dtype=np.float32)
    arrival = places + np.stack([dy, dx])
    arrived = disparity_at(there, arrival)
    seen = np.concatenate([arrival, arrived[None]])
    before, after = camera.points(here, places), camera.points(arrived, arrival)
    images = None if frames is None else as_image_pair(frames[0], frames[1], ("frames[0]", "frames[1]"))
    if images is not None and images[0].shape[:2] != here.shape:
        raise ValueError(
            f"The frames have the shape {images[0].shape[:2]} and the disparities {here.shape}; they must "
            "have the same."
        )
    own = estimate_own_motion(before, here, arrival, camera, settings, images and images[0])
    static = own.moved(before)
    expected = camera.seen(static)
    errors = expected_errors(own, expected, here, places, camera, settings)
    deviations = (seen - expected) / errors
    sight = Sight(static, seen, camera)
    # Without a disparity in the second frame, a pixel is judged by its flow alone.
    squares = np.square(deviations)
    significance = np.sqrt(squares[0] + squares[1] + np.where(np.isfinite(squares[2]), squares[2], 0))
    moving = significance > settings.threshold
    views = None
    if images is not None:
        whole = first.disparity if isinstance(first, DisparityMap) else here
        grey = [as_grey(image) for image in images]
        blurred = [np.asarray(cv2.GaussianBlur(one.astype(np.float32), (0, 0), BLUR), np.float32) for one in grey]
        views = Views(
            first=blurred[0],
            second=blurred[1],
            guide=as_eight_bit(*grey)[0],
            level=grey_level(*grey),
            points=own.moved(camera.points(whole, places)),
            disparity=whole,
            standing=above_ground(whole),
            origin=own.translation,
            camera=camera,
        )
        stay = (expected[:2] - places).astype(np.float32)
        moving &= better_explained(images, np.stack([dy, dx]), stay, settings.gain) & views.standing
    seeds = []
    for box, mask in () if own.doubt else connected(moving, settings):
        known = mask & np.isfinite(deviations[:, *box]).all(axis=0)
        shift = fitted_shift(sight, box, known)
        if shift is None:
            continue
        along = (seen[:, *box][:, known] - camera.seen(static[box][known] + shift.motion)) / errors[:, *box][:, known]
        if moves_as_one(deviations[:, *box][:, known], along, settings):
            seeds.append((box, mask))
    found = []
    for thing in whole_things(seeds, sight, views, settings.smallest):
        distance = float(np.nanmedian(before[thing.box][thing.mask][:, 2]))
        found.append((region_of(thing, distance, own.error_m, frame_rate), thing))
    found.sort(key=lambda one: one[0].distance_m)
    labels = np.zeros(here.shape, np.int32)
    for number, (_, thing) in enumerate(found, start=1):
        labels[thing.box][thing.mask] = number
    return SceneFlow(
        motion=(after - before).astype(np.float32),
        against_world=(after - static).astype(np.float32),
        significance=significance.astype(np.float32),
        moving=labels > 0,
        labels=labels,
        regions=tuple(region for region, _ in found),
        own_motion=own,
        own_speed_kmh=None if frame_rate is None else KMH * frame_rate * float(np.linalg.norm(own.travelled)),
        own_speed_error_kmh=None if frame_rate is None else KMH * frame_rate * own.error_m,
    )


def measured(disparity: DisparityMap | FloatMap) -> FloatMap:
    """Return the measured disparities of a map, without filled-in ones; of an array, all of them."""
    if isinstance(disparity, DisparityMap):
        return np.where(disparity.filled, np.float32(np.nan), disparity.disparity)
    return np.asarray(disparity, np.float32)


def disparity_at(disparity: FloatMap, places: FloatMap) -> FloatMap:
    """Return the disparity at sub-pixel (2, H, W) places, of the nearest pixel: a mean across an edge is on no surface.

    NaN where the position is unknown, outside the frame or without a disparity.
    """
    rows, cols = disparity.shape
    inside = np.isfinite(places).all(axis=0)
    y, x = (np.rint(np.where(inside, place, -1)).astype(np.intp) for place in places)
    inside &= (y >= 0) & (y < rows) & (x >= 0) & (x < cols)
    return np.where(inside, disparity[np.where(inside, y, 0), np.where(inside, x, 0)], np.float32(np.nan))
