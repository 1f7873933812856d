"""Rendering of one frame: both pictures and the ground truth."""

from dataclasses import dataclass

import drjit as dr
import mitsuba as mi
import numpy as np

from ..scenes.camera import StereoCamera
from ..scenes.rendering import render
from ..scenes.truth import centre_rays, encode, trace
from .course import FRAME_RATE, RUNS, camera
from .world import SUN_AZIMUTH, SUN_ELEVATION, World, sun_direction

GLARE = 27.0  # times the sun's light, divided by the squared angle from it in degrees
PER_PASS = 25  # the orthogonal sampler needs the square of a prime
EYES = ("left", "right")


@dataclass(frozen=True)
class Frame:
    """Pictures ``(height, width, 3)``, RGB uint8; `disparity` as 16-bit codes; `objects` as object numbers."""

    left: np.ndarray
    right: np.ndarray
    disparity: np.ndarray
    occlusion: np.ndarray
    objects: np.ndarray


def frame(world: World, number: int, spp: int) -> Frame:
    view = camera(number / FRAME_RATE)
    description, scene = world.at(number / FRAME_RATE, view)
    truth = trace(scene, view)
    pictures = [
        render(
            scene, description, eye, spp, seed=1 + 2 * number + side, per_pass=PER_PASS, veil=_veil(scene, view, eye)
        )
        for side, eye in enumerate(EYES)
    ]
    return Frame(
        *pictures,
        disparity=encode(truth, description.num_disparities),
        occlusion=truth.occluded.astype(np.uint8) * 255,
        objects=object_numbers(scene, view),
    )


def object_numbers(scene: mi.Scene, view: StereoCamera) -> np.ndarray:
    """Return the vehicle shown by every left pixel, counted from 1 in the order of `RUNS`; 0 stands still."""
    hit = scene.ray_intersect(centre_rays(view))
    placed = {shape.id(): shape for shape in scene.shapes()}
    numbers = mi.UInt32(0)
    for number, name in enumerate(RUNS, start=1):
        numbers = dr.select(hit.instance == mi.ShapePtr(placed[name]), number, numbers)
    return np.array(numbers, dtype=np.uint8).reshape(view.height, view.width)


def _veil(scene: mi.Scene, view: StereoCamera, eye: str) -> np.ndarray:
    """Return the light scattered by the lens from the sun just out of view, less at larger angles (CIE's glare law)."""
    cx, cy = view.principal_point
    rows, columns = np.mgrid[: view.height, : view.width]
    down = np.cross(view.forward, view.rightward)
    rays = view.forward + ((columns - cx)[..., None] * view.rightward + (rows - cy)[..., None] * down) / view.focal_px
    rays /= np.linalg.norm(rays, axis=-1, keepdims=True)
    angle = np.degrees(np.arccos(np.clip(rays @ sun_direction(), -1, 1)))
    tint = np.array([1.0, 0.93, 0.80])
    position = np.asarray(view.position) if eye == "left" else view.right_position
    return GLARE * _sun_seen(scene, position) / np.maximum(angle, 4.0)[..., None] ** 2 * tint


def _sun_seen(scene: mi.Scene, position: np.ndarray) -> float:
    """Return the unhidden share of the sun's disc, which is some degrees wide with its haze."""
    spread = np.linspace(-1.2, 1.2, 9)
    azimuth, elevation = (np.radians(v) for v in np.meshgrid(SUN_AZIMUTH + spread, SUN_ELEVATION + spread))
    towards = mi.Vector3f(
        mi.Float((np.sin(azimuth) * np.cos(elevation)).ravel()),
        mi.Float((np.cos(azimuth) * np.cos(elevation)).ravel()),
        mi.Float(np.sin(elevation).ravel()),
    )
    blocked = scene.ray_test(mi.Ray3f(mi.Point3f(position.tolist()), towards))
    return 1.0 - float(np.array(blocked, dtype=bool).mean())
