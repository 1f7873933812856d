"""From light to an 8-bit picture: path tracing, exposure, tone curve, sensor noise."""

from typing import Any

import drjit as dr
import mitsuba as mi
import numpy as np

from .scene import StereoScene

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
