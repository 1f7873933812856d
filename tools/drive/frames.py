"""The frames of the drive: rendered, and packed for the app."""

import json
import shutil
from dataclasses import dataclass
from pathlib import Path

import cv2
import drjit as dr
import mitsuba as mi
import numpy as np

from ..scenes.rendering import StereoCamera, centre_rays, encode, render, trace
from .world import (
    BASELINE_M,
    FOCAL_PX,
    FRAME_RATE,
    FRAMES,
    RUNS,
    SUN_AZIMUTH,
    SUN_ELEVATION,
    World,
    camera,
    camera_pose,
    sun_direction,
)

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


DESTINATION = Path(__file__).parents[2] / "assets" / "drive" / "motorway"
QUALITY = 95  # of WebP: its effect on the matchers is in benchmarks/NOTES.md
TRUTHS = ("disparity", "occlusion", "objects")


def pack(work: Path, destination: Path = DESTINATION) -> None:
    """Rewrite the folder from the frames in `work`, which must be complete."""
    if destination.exists():
        shutil.rmtree(destination)
    for part in (*EYES, *TRUTHS):
        (destination / part).mkdir(parents=True)
    for number in range(FRAMES):
        for eye in EYES:
            picture = _read(work / eye / f"{number:06d}.png")
            _write(destination / eye / f"{number:06d}.webp", picture, [cv2.IMWRITE_WEBP_QUALITY, QUALITY])
        for part in TRUTHS:
            image = _read(work / part / f"{number:06d}.png")
            _write(destination / part / f"{number:06d}.png", image, [cv2.IMWRITE_PNG_COMPRESSION, 9])
    _describe(destination)


def poses() -> dict[str, object]:
    """Return the 4 × 4 poses of camera and objects to world in every frame; object 0 is the stationary world."""
    times = np.arange(FRAMES) / FRAME_RATE
    cameras = [camera_pose(camera(time)) for time in times]
    objects = [[np.eye(4), *(run.pose(time) for run in RUNS.values())] for time in times]
    return {
        "frame_rate": FRAME_RATE,
        "object_names": ["world", *RUNS],
        "camera": np.round(cameras, 9).tolist(),
        "objects": np.round(objects, 9).tolist(),
    }


def _describe(destination: Path) -> None:
    view = camera(0.0)
    cx, cy = view.principal_point
    calibration = {
        "focal_px": FOCAL_PX,
        "baseline_m": BASELINE_M,
        "doffs_px": 0.0,
        "cx": cx,
        "cy": cy,
        "width": view.width,
        "height": view.height,
        "num_disparities": 64,
        "title": "Motorway drive",
        "description": "Six seconds on a motorway: a change of lanes, traffic on both sides, and a bridge.",
    }
    (destination / "calibration.json").write_text(json.dumps(calibration, indent=2) + "\n")
    (destination / "poses.json").write_text(json.dumps(poses()) + "\n")


def _read(path: Path) -> np.ndarray:
    image = cv2.imread(str(path), cv2.IMREAD_UNCHANGED)
    if image is None:
        raise FileNotFoundError(f"{path} is missing or no picture: render it by python -m tools.drive first")
    return image


def _write(path: Path, image: np.ndarray, options: list[int]) -> None:
    if not cv2.imwrite(str(path), image, options):
        raise OSError(f"could not write {path}")
