"""A picket fence before a white garden wall and a brick house, with a gate post in front."""

from typing import Any

import numpy as np

from . import textures
from .rendering import StereoCamera, StereoScene
from .shapes import Mesh, box, bush, forest, grass, join, plane, terrain, tree
from .surfaces import VERTEX_COLOUR, glossy, matte, sky

FOCAL_PX = 800.0
BASELINE = 0.2

# The true disparity and the spacing both end in half a pixel: whole-pixel windows fit better one picket away than at
# the true place, so a match by score alone is wrong, which this scene is meant to show.
FENCE = FOCAL_PX * BASELINE / 26.5
SPACING = 14.5 * FENCE / FOCAL_PX
PICKET = (0.062, 0.018, 1.28)
FENCE_ENDS = (-3.2, 1.55)

WALL = 10.6
HOUSE = 8.9
HOUSE_CORNER = 1.0


def build() -> StereoScene:
    rng = np.random.default_rng(23)
    objects = _ground(rng) | _fence(rng) | _walls(rng) | _post(rng) | _greenery(rng)
    objects["sky"] = sky(rng, sun_azimuth=212, sun_elevation=44, sun_strength=2.6, cloudiness=0.6)
    camera = StereoCamera(
        width=640,
        height=480,
        focal_px=FOCAL_PX,
        baseline_m=BASELINE,
        position=(0.0, 0.0, 1.42),
        target=(0.0, 10.0, 1.42),
    )
    return StereoScene(
        title="Fence and wall",
        description="A fence of equal pickets before a bare white wall and a brick house, with a post in front.",
        camera=camera,
        objects=objects,
        max_depth=5,
    )


def _fence(rng: np.random.Generator) -> dict[str, Any]:
    """Return equally spaced, identically painted pickets on two rails."""
    paint = glossy((0.17, 0.25, 0.22), 0.35)
    places = np.arange(FENCE_ENDS[0], FENCE_ENDS[1], SPACING)
    pickets = [_picket(PICKET).moved((x, FENCE, 0.06)) for x in places]
    middle, length = places.mean(), np.ptp(places) + 0.1
    rails = [box((length, 0.03, 0.075), radius=0.004).moved((middle, FENCE + 0.033, z)) for z in (0.36, 1.08)]
    return {"pickets": join(pickets).shape(paint), "rails": join(rails).shape(paint)}


def _picket(size: tuple[float, float, float]) -> Mesh:
    """Return a board that stands on the ground and ends in a point; its front is at y = 0."""
    width, thickness, height = size
    outline = np.array([[-0.5, 0], [0.5, 0], [0.5, 1 - 0.6 * width / height], [0, 1], [-0.5, 1 - 0.6 * width / height]])
    x, z = (outline * [width, height]).T
    front, back = (np.stack([x, np.full_like(x, y), z], -1) for y in (0.0, thickness))
    fan = np.array([[0, 1, 2], [0, 2, 4], [2, 3, 4]])
    ring = np.arange(5)
    after = (ring + 1) % 5
    sides = np.concatenate([np.stack([ring, ring + 5, after], -1), np.stack([after, ring + 5, after + 5], -1)])
    faces = np.concatenate([fan, fan[:, ::-1] + 5, sides])
    return Mesh(np.concatenate([front, back]), faces)


def _walls(rng: np.random.Generator) -> dict[str, Any]:
    """Return a white wall without any texture, and a house in which every brick has its own tone."""
    height = 2.75
    bricks = matte(textures.bricks((1536, 1440), rng, courses=16, across=5))
    stone = matte(textures.concrete((512, 1024), rng))
    start = np.array([HOUSE_CORNER, HOUSE, 0.0])
    return {
        "wall": plane((-12, WALL, 0), (16, 0, 0), (0, 0, height)).shape(matte((0.90, 0.89, 0.86))),
        "coping": box((16, 0.42, 0.07), radius=0.01, tile=1.2).moved((-4, WALL, height)).shape(stone),
        "house": plane(start, (8, 0, 0), (0, 0, 7), tile=1.2).shape(bricks),
        "house_side": plane(start, (0, 6, 0), (0, 0, 7), tile=1.2).shape(bricks),
        **_window(np.array([2.55, HOUSE, 1.95]), stone),
    }


def _window(middle: np.ndarray, stone: dict[str, Any]) -> dict[str, Any]:
    """Return a window with its blind down: reflections would show objects at another disparity."""
    width, height, bar = 1.05, 1.2, 0.06
    bars = [box((bar, 0.05, height)).moved((x, -0.03, 0)) for x in (-width / 2, 0, width / 2)]
    bars += [box((width + bar, 0.05, bar)).moved((0, -0.032, z)) for z in (-height / 2, 0.2, height / 2)]
    slats = [box((width, 0.012, 0.036)).turned(25, 0).moved((0, -0.008, z)) for z in np.arange(-0.58, 0.6, 0.04)]
    sill = box((width + 0.3, 0.16, 0.08), radius=0.008).moved((0, -0.03, -height / 2 - 0.07))
    return {
        "frame": join(bars).moved(middle).shape(matte((0.88, 0.87, 0.84))),
        "blind": join(slats).moved(middle).shape(matte((0.42, 0.45, 0.47))),
        "sill": sill.moved(middle).shape(stone),
    }


def _post(rng: np.random.Generator) -> dict[str, Any]:
    timber = textures.wood((512, 1024), rng, (0.70, 0.58, 0.43), (0.38, 0.28, 0.19), rings=6)
    post = box((0.115, 0.115, 1.75), radius=0.01, tile=0.7)
    cap = box((0.15, 0.15, 0.03), radius=0.008, tile=0.3)
    place = (-0.62, 3.05)
    return {
        "post": join([post.moved((*place, 0.83)), cap.moved((*place, 1.72))]).shape(matte(timber)),
    }


def _ground(rng: np.random.Generator) -> dict[str, Any]:
    lawn = terrain((-14, 14), (0.5, 14), 0.015, rng, tile=2.5)
    distance = 2.5 + 8.0 * rng.random(130_000) ** 1.3
    sideways = rng.uniform(-0.55, 0.55, len(distance)) * distance
    blades = grass(rng, np.stack([sideways, distance, np.full(len(distance), -0.01)], -1), 0.055)
    fresh = blades.colour * np.array([0.62, 0.78, 0.55])
    return {
        "lawn": lawn.shape(matte(textures.turf((1024, 1024), rng, dryness=0.25)), smooth=True),
        "blades": Mesh(blades.vertices, blades.faces, colour=fresh).shape(matte(VERTEX_COLOUR)),
    }


def _greenery(rng: np.random.Generator) -> dict[str, Any]:
    """Return a bush by the house, and trees above the wall."""
    oaks = [tree(rng, 7.5, crown_width=6.0, crown_height=5.0, leaf=0.13, leaves=24_000) for _ in range(2)]
    stands = [(x, 21 + rng.normal(0, 1.5), rng.uniform(0.75, 1.0)) for x in (-10.0, -5.5, -1.5, 3.0)]
    shrub = bush(rng, (1.5, 0.8, 1.0), 5000, 0.05).moved((2.6, HOUSE - 0.65, 0))
    return forest(rng, "oak", oaks, stands) | {"shrub": shrub.shape(matte(VERTEX_COLOUR))}
