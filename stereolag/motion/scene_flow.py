"""Scene flow: the motion of every pixel in metres, our own motion, and the objects that move against the world."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
import numpy.typing as npt

from stereolag.core.arrays import DoubleMap, FloatMap, Mask
from stereolag.core.inputs import Image, as_eight_bit, as_grey, as_image_pair, check_positive, grey_level
from stereolag.geometry.calibration import Calibration
from stereolag.motion.flow import FlowMap
from stereolag.motion.moving_objects import (
    KMH,
    Box,
    Camera,
    Measurements,
    MovingRegion,
    MovingTest,
    Views,
    above_ground,
    better_correlated,
    connected_regions,
    fitted_shift,
    is_accurate,
    moves_as_one,
    region_of,
    whole_objects,
)
from stereolag.motion.own_motion import Doubt, OwnMotion, estimate_own_motion, expected_errors
from stereolag.stereo.matcher import DisparityMap


@dataclass(frozen=True, eq=False)
class SceneFlow:
    """The motion of every pixel between two frames of a stereo camera.

    Attributes
    ----------
    motion
        (H, W, 3) float32 metres, X to the right, Y down, Z forward, relative to the camera, which may itself move;
        NaN = none.
    against_world
        (H, W, 3) float32 metres, the motion minus that of a static point; 0 in the static world.
    significance
        (H, W) float32, deviation from a static point in expected errors; NaN = none.
    moving
        (H, W) bool, the pixels of objects that move against the world.
    labels
        (H, W) int32, 1 + the index of the region that a pixel belongs to; 0 elsewhere.
    regions
        The moving objects, nearest first; none where our own motion is in doubt.
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
    >>> [(region.row, region.col) for region in motion.regions]  # px, top left of the box
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
        accurate = self.own_speed_kmh is None or is_accurate(self.own_speed_kmh, self.own_speed_error_kmh)
        return self.own_motion.doubt or ("" if accurate else "inaccurate")


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
    """Return the motion in space of every pixel, our own motion, and the objects that move against the world.

    Parameters
    ----------
    first, second
        (H, W) disparities of the two frames, px; NaN = none. Filled-in disparities are ignored.
    flow
        Flow between the left images of the first and second frames, or a pair (dy, dx) of arrays. It should be NaN
        where a pixel is hidden in the second frame, as after a forward-backward check: the object in front would be
        mistaken for it.
    calibration
        Calibration of the rectified camera.
    frames
        The left images of both frames. If given, pixels that match equally well as static points do not count as
        moving: flow is least accurate without texture, and the road is large.
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
    if frame_rate is not None:
        check_positive(frame_rate, "frame_rate", "Hz")
    disparity, disparity_after = (measured(one) for one in (first, second))
    dy, dx = (
        (np.where(flow.filled, np.float32(np.nan), part) for part in (flow.dy, flow.dx))
        if isinstance(flow, FlowMap)
        else (np.asarray(part) for part in flow)
    )
    if len({disparity.shape, disparity_after.shape, dy.shape, dx.shape}) != 1 or disparity.ndim != 2:
        shapes = f"{disparity.shape}, {disparity_after.shape}, {dy.shape} and {dx.shape}"
        raise ValueError(f"Both disparities, dy and dx have the shapes {shapes}; all must be one (H, W).")
    camera = Camera.of(calibration, disparity.shape)
    places = np.indices(disparity.shape, dtype=np.float32)
    places_after = places + np.stack([dy, dx])
    arrived = disparity_at(disparity_after, places_after)
    before, after = camera.points(disparity, places), camera.points(arrived, places_after)
    images = None if frames is None else as_image_pair(frames[0], frames[1], ("frames[0]", "frames[1]"))
    if images is not None and images[0].shape[:2] != disparity.shape:
        raise ValueError(
            f"The frames have the shape {images[0].shape[:2]} and the disparities {disparity.shape}; they must "
            "have the same."
        )
    own = estimate_own_motion(before, disparity, places_after, camera, settings, images and images[0])
    static = own.moved(before)
    expected = camera.observed(static)
    errors = expected_errors(own, expected, disparity, places, camera, settings)
    measurements = Measurements(static, np.concatenate([places_after, arrived[None]]), camera)
    deviations = (measurements.observed - expected) / errors
    # Without a disparity in the second frame, a pixel is judged by its flow alone.
    squares = np.square(deviations)
    significance = np.sqrt(squares[0] + squares[1] + np.where(np.isfinite(squares[2]), squares[2], 0))
    moving = significance > settings.threshold
    views = None
    if images is not None:
        filled = first.disparity if isinstance(first, DisparityMap) else disparity
        views = _views(images, filled, places, own, camera)
        static_flow = (expected[:2] - places).astype(np.float32)
        moving &= better_correlated(images, np.stack([dy, dx]), static_flow, settings.gain) & views.above_ground
    seeds = [] if own.doubt else _coherent_regions(moving, measurements, deviations, errors, settings)
    objects = whole_objects(seeds, measurements, views, settings.smallest)
    found = [(region_of(one, before[..., 2], own.error_m, frame_rate), one) for one in objects]
    found.sort(key=lambda pair: pair[0].distance_m)
    labels = np.zeros(disparity.shape, np.int32)
    for number, (_, one) in enumerate(found, start=1):
        labels[one.box][one.mask] = number
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


def _views(images: tuple[Image, Image], disparity: FloatMap, places: FloatMap, own: OwnMotion, camera: Camera) -> Views:
    """Return the data from which the extent of objects is found; gaps in the disparity may be filled."""
    grey = [as_grey(image) for image in images]
    # Blurred by 1 px, since windows are not shifted in finer steps.
    first, second = (cv2.GaussianBlur(one.astype(np.float32), (0, 0), 1.0) for one in grey)
    return Views(
        first=np.asarray(first, np.float32),
        second=np.asarray(second, np.float32),
        guide=as_eight_bit(*grey)[0],
        level=grey_level(*grey),
        points=own.moved(camera.points(disparity, places)),
        disparity=disparity,
        above_ground=above_ground(disparity),
        origin=own.translation,
        camera=camera,
    )


def _coherent_regions(
    moving: Mask, measurements: Measurements, deviations: DoubleMap, errors: DoubleMap, settings: MovingTest
) -> list[tuple[Box, Mask]]:
    """Return the connected regions of moving pixels, each with its box, of which each moves as one object.

    Parameters
    ----------
    moving
        (H, W) mask.
    measurements
        The measurements of every pixel.
    deviations, errors
        (3, H, W) deviations from static points, in expected errors, and these errors, px.
    settings
        The thresholds.
    """
    coherent = []
    for box, mask in connected_regions(moving, settings):
        known = mask & np.isfinite(deviations[:, *box]).all(axis=0)
        shift = fitted_shift(measurements, box, known)
        if shift is None:
            continue
        expected = measurements.camera.observed(measurements.static[box][known] + shift.motion)
        from_moving = (measurements.observed[:, *box][:, known] - expected) / errors[:, *box][:, known]
        if moves_as_one(deviations[:, *box][:, known], from_moving, settings):
            coherent.append((box, mask))
    return coherent


def measured(disparity: DisparityMap | FloatMap) -> FloatMap:
    """Return the disparities of a map that were measured, not filled in; of an array, all."""
    if isinstance(disparity, DisparityMap):
        return np.where(disparity.filled, np.float32(np.nan), disparity.disparity)
    return np.asarray(disparity, np.float32)


def disparity_at(disparity: FloatMap, places: FloatMap) -> FloatMap:
    """Return the disparity of the pixel nearest to each sub-pixel position, (2, H, W) rows and columns.

    NaN where the position is unknown, outside the frame or without a disparity. A mean across an edge would be on no
    surface.
    """
    rows, cols = disparity.shape
    inside = np.isfinite(places).all(axis=0)
    y, x = (np.rint(np.where(inside, place, -1)).astype(np.intp) for place in places)
    inside &= (y >= 0) & (y < rows) & (x >= 0) & (x < cols)
    return np.where(inside, disparity[np.where(inside, y, 0), np.where(inside, x, 0)], np.float32(np.nan))
