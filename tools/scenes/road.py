"""A motorway from the driver's seat: cars, barriers, signs, an overpass and trees."""

from typing import Any

import mitsuba as mi
import numpy as np

from . import textures
from .rendering import StereoCamera, StereoScene
from .shapes import box, forest, grass, plane, terrain, tree
from .street import (
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
from .surfaces import VERTEX_COLOUR, glossy, matte, sky

LENGTH = 288.0


def build() -> StereoScene:
    rng = np.random.default_rng(5)
    objects = {
        **_roads(rng),
        **_traffic(rng),
        **_signs(),
        **bridge(rng, y=46.0, clearance=5.8),
        **_verges(rng),
        "sky": sky(rng, sun_azimuth=128, sun_elevation=40, sun_strength=3.3, cloudiness=0.5),
    }
    camera = StereoCamera(
        width=881,
        height=400,
        focal_px=960.0,
        baseline_m=0.42,
        position=(0.1, 0.0, 1.5),
        target=(0.1, 10.0, 1.56),
    )
    return StereoScene(
        title="Motorway",
        description="A motorway seen by a driver: cars, guard rails, signs, an overpass and trees.",
        camera=camera,
        objects=objects,
        exposure=1.05,
    )


def _roads(rng: np.random.Generator) -> dict[str, Any]:
    return {
        "road": carriageway(rng, 0.0, LENGTH),
        "opposite_road": carriageway(rng, -13.0, LENGTH),
        "median": median_barrier(rng, -6.45, LENGTH),
        **guard_rail("rail_right", rng, 6.75, -1, LENGTH),
        **guard_rail("rail_left", rng, -20.2, 1, LENGTH),
    }


def _traffic(rng: np.random.Generator) -> dict[str, Any]:
    return {
        **car("hatchback", HATCHBACK, (0.03, 0.30, 0.36), (3.35, 11.8), rng),
        **car("saloon", SALOON, (0.24, 0.25, 0.28), (-0.1, 18.8), rng),
        **car("estate", ESTATE, (0.80, 0.81, 0.80), (-3.5, 13.6), rng),
        **lorry("lorry", (3.5, 33.0), rng),
        **car("far_saloon", SALOON, (0.62, 0.60, 0.56), (-3.6, 38.0), rng),
        **car("far_hatchback", HATCHBACK, (0.60, 0.08, 0.07), (0.1, 62.0), rng),
        **car("oncoming_hatchback", HATCHBACK, (0.82, 0.68, 0.12), (-10.0, 24.0), rng, oncoming=True),
        **car("oncoming_saloon", SALOON, (0.10, 0.10, 0.11), (-13.4, 37.0), rng, oncoming=True),
    }


def _signs() -> dict[str, Any]:
    names = direction(("Nordhafen", "Airport"), (13, 56, 140))
    exit_board = direction(("Exit 24", "Seeburg"), (8, 92, 51))
    return {
        **sign("limit", speed_limit("100"), (7.5, 19.0, 2.5), 0.95, "disc"),
        **sign("caution", warning(), (7.6, 30.0, 2.6), 1.15, "triangle"),
        **sign("exit", exit_board, (12.6, 40.0, 4.4), 3.8, "board"),
        **panel("gantry", names, (-0.2, 45.6, 7.0), 5.2, "board"),
        **sign("limit_left", speed_limit("80"), (-21.0, 30.0, 2.5), 0.95, "disc"),
    }


def _verges(rng: np.random.Generator) -> dict[str, Any]:
    turf = matte(textures.turf((1024, 1024), rng))
    right = terrain((6.2, 130), (-5, 420), 0.02, rng, tile=5.0).moved((0, 0, -0.04))
    left = terrain((-150, -19.4), (-5, 420), 0.02, rng, tile=5.0).moved((0, 0, -0.04))
    strip = plane((-6.9, -5, -0.01), (0.9, 0, 0), (0, LENGTH, 0), tile=4.0)
    distance = 9 + 45 * rng.random(45_000) ** 1.5
    roots = np.stack([6.4 + rng.random(45_000) ** 1.5 * 14, distance, np.full(45_000, -0.05)], -1)
    kinds = [tree(rng, h, crown_width=5.0, crown_height=h * 0.72, leaf=0.16, leaves=26_000) for h in (8.0, 9.5)]
    stands = [(15 + 7 * rng.random(), y + rng.normal(0, 1.5), rng.uniform(0.7, 1.15)) for y in np.arange(24, 200, 6.0)]
    stands += [(-25 - 9 * rng.random(), y + rng.normal(0, 1.5), rng.uniform(0.7, 1.2)) for y in np.arange(30, 200, 5.5)]
    stands += [(x, 235 + rng.normal(0, 8), rng.uniform(1.2, 1.7)) for x in np.arange(-110, 111, 6.0)]
    return {
        "verge_right": right.shape(turf, smooth=True),
        "verge_left": left.shape(turf, smooth=True),
        "median_strip": strip.shape(matte(textures.concrete((512, 512), rng))),
        "tufts": grass(rng, roots, 0.28).shape(matte(VERTEX_COLOUR)),
        "marker_post": _marker_post(),
        **forest(rng, "tree", kinds, stands),
    }


def _marker_post() -> mi.Mesh:
    return box((0.12, 0.08, 1.1), radius=0.02).moved((7.3, 12.5, 0.5)).shape(glossy((0.9, 0.9, 0.88), 0.3))
