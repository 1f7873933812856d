"""Exact disparity and occlusion: one ray through the centre of every left pixel."""

from dataclasses import dataclass

import drjit as dr
import mitsuba as mi
import numpy as np

from .camera import StereoCamera

DISPARITY_SCALE = 256  # codes per pixel in the 16-bit file; code 0 means "no ground truth"


@dataclass(frozen=True)
class Truth:
    """`disparity` in px, 0 in the sky; `occluded` where the point is hidden from the right eye."""

    disparity: np.ndarray
    occluded: np.ndarray


def trace(scene: mi.Scene, camera: StereoCamera) -> Truth:
    """Return the ground truth in the frame of the left camera, shapes ``(height, width)``.

    Neither is averaged over a pixel, so no depths between an edge and its background are invented.
    """
    ray = centre_rays(camera)
    hit = scene.ray_intersect(ray)
    seen = hit.is_valid()

    depth = dr.dot(hit.p - mi.Point3f(camera.position), mi.Vector3f(camera.forward.tolist()))
    disparity = dr.select(seen, camera.focal_px * camera.baseline_m / depth, 0.0)

    right = mi.Point3f(camera.right_position.tolist())
    towards_right = hit.spawn_ray_to(right)
    towards_sky = mi.Ray3f(right, ray.d)
    hidden = dr.select(seen, scene.ray_test(towards_right), scene.ray_test(towards_sky))

    shape = camera.height, camera.width
    pixels = np.array(disparity, dtype=np.float64).reshape(shape)
    out_of_frame = np.arange(camera.width) - pixels < -0.5
    return Truth(pixels, np.array(hidden, dtype=bool).reshape(shape) | out_of_frame)


def centre_rays(camera: StereoCamera) -> mi.Ray3f:
    """Return one ray through the exact centre of every left pixel, row by row."""
    sensor = mi.load_dict(camera.sensor("left"))
    rows, columns = np.mgrid[: camera.height, : camera.width]
    centre = mi.Point2f(
        mi.Float((columns.ravel() + 0.5) / camera.width),
        mi.Float((rows.ravel() + 0.5) / camera.height),
    )
    ray, _ = sensor.sample_ray(0.0, 0.5, centre, mi.Point2f(0.5))
    return ray


def encode(truth: Truth, num_disparities: int) -> np.ndarray:
    """Return the 16-bit codes of `disparity.png`; a disparity outside the scene's range raises an error."""
    nearest = float(truth.disparity.max())
    if nearest > num_disparities - 1:
        raise ValueError(
            f"the nearest point has a disparity of {nearest:.1f} px, "
            f"but {num_disparities} disparities reach only {num_disparities - 1} px"
        )
    return np.round(truth.disparity * DISPARITY_SCALE).astype(np.uint16)
