"""From the description of a scene to its picture and its exact ground truth."""

from dataclasses import dataclass
from typing import Any

import drjit as dr
import mitsuba as mi
import numpy as np


@dataclass(frozen=True)
class StereoCamera:
    """A rectified pair: the right camera is the left one moved `baseline_m` to its right.

    Pixel centres have whole-number coordinates, so the principal point of an image
    of `width` columns is at ``(width - 1) / 2``.
    """

    width: int
    height: int
    focal_px: float
    baseline_m: float
    position: tuple[float, float, float]
    target: tuple[float, float, float]
    up: tuple[float, float, float] = (0.0, 0.0, 1.0)

    @property
    def principal_point(self) -> tuple[float, float]:
        return (self.width - 1) / 2, (self.height - 1) / 2

    @property
    def forward(self) -> np.ndarray:
        return _unit(np.subtract(self.target, self.position))

    @property
    def rightward(self) -> np.ndarray:
        return _unit(np.cross(self.forward, self.up))

    @property
    def right_position(self) -> np.ndarray:
        return np.asarray(self.position) + self.baseline_m * self.rightward

    def sensor(self, eye: str) -> dict[str, Any]:
        """Return the Mitsuba description of the ``"left"`` or ``"right"`` camera."""
        position = np.asarray(self.position) if eye == "left" else self.right_position
        pose = mi.ScalarTransform4f().look_at(
            origin=position.tolist(),
            target=(position + self.forward).tolist(),
            up=list(self.up),
        )
        return {
            "type": "perspective",
            "to_world": pose,
            "fov": float(np.degrees(2 * np.arctan(self.width / 2 / self.focal_px))),
            "fov_axis": "x",
            "near_clip": 1e-3,
            "far_clip": 1e5,
            "film": {
                "type": "hdrfilm",
                "width": self.width,
                "height": self.height,
                "pixel_format": "rgb",
                "rfilter": {"type": "box"},
            },
            "sampler": {"type": "independent"},
        }


def _unit(vector: np.ndarray) -> np.ndarray:
    return vector / np.linalg.norm(vector)


@dataclass(frozen=True)
class StereoScene:
    """`objects` are Mitsuba shapes and lights by name; `exposure` scales their light so that white is 1."""

    title: str
    description: str
    camera: StereoCamera
    objects: dict[str, Any]
    num_disparities: int = 64
    exposure: float = 1.0
    max_depth: int = 6
    sensor_noise: float = 0.8  # standard deviation, 8-bit levels
    sampler: str = "independent"
    brightest: float | None = None  # limit for the light of one path; None: no limit

    def load(self) -> mi.Scene:
        return mi.load_dict(
            {
                "type": "scene",
                "integrator": self._integrator(),
                **self.objects,
            }
        )

    def _integrator(self) -> dict[str, Any]:
        if self.brightest is None:
            return {"type": "path", "max_depth": self.max_depth}
        return {"type": "bounded_paths", "max_depth": self.max_depth, "brightest": self.brightest}


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


SAMPLES_PER_PASS = 16  # bounds the memory of one pass; passes are averaged


class BoundedPaths(mi.SamplingIntegrator):
    """Path tracing that limits the light of one path, so that a rare path by way of a mirror leaves no spark."""

    def __init__(self, properties: mi.Properties) -> None:
        super().__init__(properties)
        self.brightest = properties["brightest"]
        self.paths = mi.load_dict({"type": "path", "max_depth": int(properties["max_depth"])})

    def sample(
        self, scene: mi.Scene, sampler: mi.Sampler, ray: mi.RayDifferential3f, medium: Any = None, active: Any = True
    ) -> tuple[mi.Color3f, mi.Bool, list[mi.Float]]:
        light, valid, others = self.paths.sample(scene, sampler, ray, medium, active)
        return dr.minimum(light, self.brightest), valid, others


mi.register_integrator("bounded_paths", BoundedPaths)


def render(
    scene: mi.Scene,
    description: StereoScene,
    eye: str,
    spp: int,
    seed: int,
    *,
    per_pass: int = SAMPLES_PER_PASS,
    veil: np.ndarray | float = 0.0,
) -> np.ndarray:
    """Return the picture of one eye, ``(height, width, 3)`` uint8; `veil` is light that the lens scatters over it.

    `seed` determines every random number; use different seeds for the two eyes, so that their noise is independent.
    """
    sampler = {"type": description.sampler, "sample_count": per_pass}
    sensor = mi.load_dict({**description.camera.sensor(eye), "sampler": sampler})
    passes = max(1, spp // per_pass)
    light = np.zeros((description.camera.height, description.camera.width, 3))
    for number in range(passes):
        image = mi.render(scene, sensor=sensor, spp=min(spp, per_pass), seed=seed * 10_000 + number)
        light += np.asarray(image, dtype=np.float64)
    picture = _develop((light / passes + veil) * description.exposure)
    noise = np.random.default_rng(seed).normal(0.0, description.sensor_noise, picture.shape)
    return np.clip(np.round(picture * 255 + noise), 0, 255).astype(np.uint8)


def _develop(light: np.ndarray) -> np.ndarray:
    """Convert linear light to sRGB, with a soft shoulder above 0.6 instead of clipping."""
    knee = 0.6
    above = np.maximum(light - knee, 0.0)
    shoulder = knee + (1 - knee) * (1 - np.exp(-above / (1 - knee)))
    toned = np.where(light > knee, shoulder, light)
    return np.where(toned <= 0.0031308, 12.92 * toned, 1.055 * toned ** (1 / 2.4) - 0.055)
