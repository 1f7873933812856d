"""The course of the drive, and the world along it."""

from dataclasses import dataclass
from typing import Any

import mitsuba as mi
import numpy as np

from ..scenes import textures
from ..scenes.rendering import StereoCamera, StereoScene
from ..scenes.shapes import box, forest, grass, join, plane, rotation, terrain, tree
from ..scenes.street import (
    ESTATE,
    HATCHBACK,
    SALOON,
    bridge,
    car,
    carriageway,
    direction,
    guard_rail,
    lorry,
    median_barrier,
    panel,
    sign,
    speed_limit,
    warning,
)
from ..scenes.surfaces import VERTEX_COLOUR, glossy, matte, sky

FRAME_RATE = 10.0
FRAMES = 60
FOCAL_PX = 960.0
BASELINE_M = 0.36
SPEED = 25.0
RIGHT_LANE, MIDDLE_LANE = 3.2, 0.15
LANE_CHANGE = (0.8, 4.4)  # s, from the right lane to the middle one


@dataclass(frozen=True)
class Run:
    """A vehicle driving straight with a slight sway: `start` is ``(x, y)`` at time 0; `speed`, m/s, is along y."""

    start: tuple[float, float]
    speed: float
    sway: float = 0.06
    period: float = 4.0
    phase: float = 0.0

    def pose(self, time: float) -> np.ndarray:
        """Return the 4 × 4 pose, vehicle to world; the vehicle's own y points forwards."""
        turn = 2 * np.pi / self.period
        across = self.sway * np.sin(turn * time + self.phase)
        drift = self.sway * turn * np.cos(turn * time + self.phase)
        pose = np.eye(4)
        pose[:3, :3] = rotation(-np.degrees(np.arctan2(drift, self.speed)), 2)
        pose[:3, 3] = self.start[0] + across, self.start[1] + self.speed * time, 0.0
        return pose


RUNS = {
    "slow_hatchback": Run((3.4, 49.0), 18.5, phase=1.0),
    "overtaking_estate": Run((-3.55, 5.0), 32.0, sway=0.10, phase=2.0),
    "overtaking_saloon": Run((-3.65, -34.0), 33.0, sway=0.03),
    "saloon_ahead": Run((0.0, 44.0), 27.0, sway=0.10, phase=4.0),
    "lorry": Run((3.5, 84.0), 22.5, sway=0.04, period=6.0),
    "oncoming_hatchback": Run((-13.2, 150.0), -27.0, phase=0.5),
    "oncoming_saloon": Run((-9.7, 235.0), -33.0, phase=1.5),
    "oncoming_estate": Run((-16.6, 322.0), -25.0, phase=2.5),
}
"""Vehicles by name, in the order of their object numbers from 1; 0 is everything that stands still."""


def camera(time: float) -> StereoCamera:
    """Return the stereo camera in our car, which changes lanes, leans and pitches a little on its springs."""
    begin, end = LANE_CHANGE
    share = np.clip((time - begin) / (end - begin), 0.0, 1.0)
    across = RIGHT_LANE + (MIDDLE_LANE - RIGHT_LANE) * share**3 * (10 - 15 * share + 6 * share**2)
    drift = (MIDDLE_LANE - RIGHT_LANE) * 30 * share**2 * (1 - share) ** 2 / (end - begin)
    heading = np.arctan2(drift, SPEED)
    pitch = np.radians(0.30 + 0.10 * np.sin(2 * np.pi * 1.3 * time) + 0.04 * np.sin(2 * np.pi * 3.1 * time + 1))
    roll = np.radians(0.35 * np.sin(2 * np.pi * share) + 0.10 * np.sin(2 * np.pi * 0.9 * time + 2))
    height = 1.5 + 0.012 * np.sin(2 * np.pi * 1.3 * time + 0.7)
    position = np.array([across, SPEED * time, height])
    forward = np.array([np.sin(heading) * np.cos(pitch), np.cos(heading) * np.cos(pitch), np.sin(pitch)])
    right = np.array([np.cos(heading), -np.sin(heading), 0.0])
    up = np.cos(roll) * np.cross(right, forward) + np.sin(roll) * right
    return StereoCamera(
        width=881,
        height=400,
        focal_px=FOCAL_PX,
        baseline_m=BASELINE_M,
        position=tuple(position.tolist()),
        target=tuple((position + 10 * forward).tolist()),
        up=tuple(up.tolist()),
    )


def camera_pose(view: StereoCamera) -> np.ndarray:
    """Return the 4 × 4 pose, left camera to world, with the camera's x to the right, y down and z forwards."""
    pose = np.eye(4)
    pose[:3, 0] = view.rightward
    pose[:3, 1] = np.cross(view.forward, view.rightward)
    pose[:3, 2] = view.forward
    pose[:3, 3] = view.position
    return pose


LENGTH = 576.0
BRIDGES = (88.0, 330.0)
SUN_AZIMUTH, SUN_ELEVATION = 27.0, 21.0


@dataclass(frozen=True)
class World:
    """`still` never moves; `vehicles` are groups of shapes about their own origins, by name."""

    still: dict[str, Any]
    vehicles: dict[str, mi.Object]

    def at(self, time: float, camera: StereoCamera) -> tuple[StereoScene, mi.Scene]:
        """Return the description and the scene at `time`, s; vehicle `name` is its shape ``name``."""
        placed: dict[str, Any] = {}
        for name, group in self.vehicles.items():
            pose = mi.ScalarTransform4f(RUNS[name].pose(time))
            placed[f"{name}_model"] = group  # a scene knows only groups that are among its own objects
            placed[name] = {"type": "instance", "to_world": pose, "group": group}
        description = StereoScene(
            title="Drive",
            description="Six seconds on a motorway: a lane change, traffic on both sides, and a bridge.",
            camera=camera,
            objects={**self.still, **placed},
            exposure=1.3,
            max_depth=3,
            sensor_noise=0.7,
            sampler="orthogonal",  # half the noise of independent samples, which would need four times as many
            brightest=3.0,
        )
        return description, description.load()


def build() -> World:
    rng = np.random.default_rng(11)
    parts = {**_roads(rng), **_signs(), **_bridges(rng), **_verges(rng)}
    parts["sky"] = sky(rng, sun_azimuth=SUN_AZIMUTH, sun_elevation=SUN_ELEVATION, sun_strength=3.6, cloudiness=0.45)
    return World(_loaded(parts), _vehicles(rng))


def sun_direction() -> np.ndarray:
    azimuth, elevation = np.radians(SUN_AZIMUTH), np.radians(SUN_ELEVATION)
    return np.array([np.sin(azimuth) * np.cos(elevation), np.cos(azimuth) * np.cos(elevation), np.sin(elevation)])


def _loaded(parts: dict[str, Any]) -> dict[str, Any]:
    """Load groups as objects, so that new scenes share their geometry, and return them with all other loaded parts."""
    groups = {name: mi.load_dict(part) for name, part in parts.items() if _kind(part) == "shapegroup"}
    loaded: dict[str, Any] = {}
    for name, part in parts.items():
        if _kind(part) == "instance":
            loaded[name] = mi.load_dict({**part, "group": groups[part["group"]["id"]]})
        elif name not in groups:
            loaded[name] = mi.load_dict(part) if isinstance(part, dict) else part
    return groups | loaded


def _kind(part: Any) -> str:
    return part["type"] if isinstance(part, dict) else ""


def _asphalt(picture: np.ndarray, repeat: tuple[float, float]) -> dict[str, Any]:
    """Return asphalt worn smooth by tyres, which shines against the sun."""
    return {
        "type": "blendbsdf",
        "weight": 0.22,
        "worn": matte(picture, repeat),
        "polished": glossy(picture, 0.30, repeat),
    }


def _roads(rng: np.random.Generator) -> dict[str, Any]:
    return {
        "road": carriageway(rng, 0.0, LENGTH, contrast=0.22, finish=_asphalt),
        "opposite_road": carriageway(rng, -13.0, LENGTH, contrast=0.5, finish=_asphalt),
        "median": median_barrier(rng, -6.45, LENGTH),
        **guard_rail("rail_right", rng, 6.75, -1, LENGTH),
        **guard_rail("rail_left", rng, -20.2, 1, LENGTH),
    }


def _vehicles(rng: np.random.Generator) -> dict[str, mi.Object]:
    shapes = {
        "slow_hatchback": car("a", HATCHBACK, (0.03, 0.30, 0.36), (0, 0), rng),
        "overtaking_estate": car("b", ESTATE, (0.80, 0.81, 0.80), (0, 0), rng),
        "overtaking_saloon": car("c", SALOON, (0.52, 0.06, 0.06), (0, 0), rng),
        "saloon_ahead": car("d", SALOON, (0.24, 0.25, 0.28), (0, 0), rng),
        "lorry": lorry("e", (0.0, 0.0), rng),
        "oncoming_hatchback": car("f", HATCHBACK, (0.82, 0.68, 0.12), (0, 0), rng),
        "oncoming_saloon": car("g", SALOON, (0.10, 0.10, 0.11), (0, 0), rng),
        "oncoming_estate": car("h", ESTATE, (0.12, 0.22, 0.48), (0, 0), rng),
    }
    return {name: mi.load_dict({"type": "shapegroup", **shapes[name]}) for name in RUNS}


def _signs() -> dict[str, Any]:
    names = direction(("Nordhafen", "Airport"), (13, 56, 140))
    exit_board = direction(("Exit 24", "Seeburg"), (8, 92, 51))
    return {
        **sign("limit", speed_limit("100"), (7.5, 27.0, 2.5), 0.95, "disc"),
        **sign("caution", warning(), (7.6, 58.0, 2.6), 1.15, "triangle"),
        **sign("exit", exit_board, (12.6, 76.0, 4.4), 3.8, "board"),
        **panel("gantry", names, (0.6, BRIDGES[0] - 0.4, 7.0), 5.2, "board"),
        **sign("limit_left", speed_limit("80"), (-21.0, 70.0, 2.5), 0.95, "disc"),
        **sign("limit_again", speed_limit("120"), (7.5, 128.0, 2.5), 0.95, "disc"),
        **sign("exit_again", exit_board, (12.4, 168.0, 4.4), 3.8, "board"),
        **sign("caution_again", warning(), (7.6, 192.0, 2.6), 1.15, "triangle"),
        **panel("gantry_again", names, (-0.2, BRIDGES[1] - 0.4, 7.0), 5.2, "board"),
    }


def _bridges(rng: np.random.Generator) -> dict[str, Any]:
    return {
        f"{name}_{number}": shape
        for number, y in enumerate(BRIDGES)
        for name, shape in bridge(rng, y=y, clearance=5.8).items()
    }


def _verges(rng: np.random.Generator) -> dict[str, Any]:
    turf = matte(textures.turf((1024, 1024), rng))
    right = terrain((6.2, 150), (-5, 760), 0.02, rng, tile=5.0).moved((0, 0, -0.04))
    left = terrain((-170, -19.4), (-5, 760), 0.02, rng, tile=5.0).moved((0, 0, -0.04))
    strip = plane((-6.9, -5, -0.01), (0.9, 0, 0), (0, LENGTH, 0), tile=4.0)
    distance = 9 + 195 * rng.random(90_000)
    roots = np.stack([6.4 + rng.random(90_000) ** 1.5 * 12, distance, np.full(90_000, -0.05)], -1)
    kinds = [tree(rng, h, crown_width=5.0, crown_height=h * 0.72, leaf=0.16, leaves=26_000) for h in (8.0, 9.5)]
    stands = [(15 + 9 * rng.random(), y + rng.normal(0, 2), rng.uniform(0.6, 1.15)) for y in np.arange(20, 420, 9.0)]
    stands += [(-25 - 9 * rng.random(), y + rng.normal(0, 2), rng.uniform(0.7, 1.2)) for y in np.arange(24, 420, 8.0)]
    stands += [(x, 500 + rng.normal(0, 20), rng.uniform(1.6, 2.4)) for x in np.arange(-190, 191, 8.0)]
    stands = [stand for stand in stands if all(abs(stand[1] - y - 4.5) > 9 for y in BRIDGES)]
    posts = [box((0.12, 0.08, 1.1), radius=0.02).moved((7.3, y, 0.5)) for y in np.arange(12.5, 400, 25.0)]
    return {
        "verge_right": right.shape(turf, smooth=True),
        "verge_left": left.shape(turf, smooth=True),
        "median_strip": strip.shape(matte(textures.concrete((512, 512), rng))),
        "tufts": grass(rng, roots, 0.28).shape(matte(VERTEX_COLOUR)),
        "marker_posts": join(posts).shape(glossy((0.9, 0.9, 0.88), 0.3)),
        **forest(rng, "tree", kinds, stands),
    }
