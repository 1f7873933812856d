"""Trees, bushes and grass made of triangles."""

from dataclasses import dataclass
from typing import Any

import mitsuba as mi
import numpy as np

from . import textures
from .materials import VERTEX_COLOUR, matte
from .meshes import Mesh, join, tube

GREENS = np.array([[0.16, 0.26, 0.07], [0.30, 0.42, 0.13], [0.44, 0.52, 0.20], [0.24, 0.34, 0.10]])
STRAW = np.array([[0.42, 0.46, 0.18], [0.66, 0.60, 0.32], [0.76, 0.68, 0.43], [0.32, 0.39, 0.14], [0.58, 0.50, 0.28]])


@dataclass(frozen=True)
class Tree:
    """A tree standing at the origin."""

    wood: Mesh
    leaves: Mesh


def tree(
    rng: np.random.Generator,
    height: float,
    *,
    crown_width: float,
    crown_height: float,
    leaf: float = 0.11,
    leaves: int = 22_000,
) -> Tree:
    """Return a trunk that forks into boughs, each ending in a cloud of leaves."""
    fork = height - crown_height
    trunk_width = 0.035 * height
    sway = rng.normal(0, 0.02 * height, 2)
    trunk = np.array([[0, 0, -0.2], [sway[0] / 2, sway[1] / 2, fork / 2], [*sway, fork]])
    limbs = [tube(trunk, trunk_width * np.array([1.25, 0.95, 0.8]), tile=1.0)]
    tips = []
    for number in range(11):
        azimuth = 2.4 * number + rng.uniform(-0.3, 0.3)
        reach = crown_width / 2 * np.sqrt((number + 0.5) / 11) * rng.uniform(0.75, 1.0)
        rise = fork + crown_height * (0.30 + 0.5 * rng.random())
        tip = np.array([np.cos(azimuth) * reach, np.sin(azimuth) * reach, rise])
        middle = (trunk[-1] + tip) / 2 + [0, 0, 0.12 * crown_height]
        bough = np.stack([trunk[-1] - [0, 0, 0.1 * fork], middle, tip])
        limbs.append(tube(bough, trunk_width * np.array([0.6, 0.35, 0.12]), sides=8, tile=1.0))
        tips.append(tip)
    size = np.array([0.30 * crown_width, 0.30 * crown_width, 0.30 * crown_height])
    places = np.concatenate([_cloud(rng, tip, size, leaves // len(tips)) for tip in tips])
    return Tree(join(limbs), foliage(rng, places, leaf))


def bush(rng: np.random.Generator, size: tuple[float, float, float], leaves: int, leaf: float) -> Mesh:
    """Return leaves down to the ground, as in a hedge."""
    blobs = [
        _cloud(
            rng, np.array([x, 0, 0.45 * size[2]]) * [size[0] / 2, 1, 1], np.array(size) * [0.35, 0.5, 0.5], leaves // 4
        )
        for x in (-0.6, -0.2, 0.2, 0.6)
    ]
    places = np.concatenate(blobs)
    return foliage(rng, places[places[:, 2] > 0], leaf)


def foliage(rng: np.random.Generator, places: np.ndarray, leaf: float) -> Mesh:
    """Return a small kite of two triangles at every place, lighter towards the top."""
    count = len(places)
    along, across = _frames(rng, count)
    length = leaf * rng.uniform(0.6, 1.3, (count, 1))
    corners = np.stack(
        [
            places - along * length,
            places - across * length * 0.5,
            places + across * length * 0.5,
            places + along * length,
        ],
        axis=1,
    )
    top = np.clip((places[:, 2] - places[:, 2].min()) / np.ptp(places[:, 2]), 0, 1)
    tone = GREENS[rng.integers(len(GREENS), size=count)]
    colour = tone * (0.75 + 0.5 * top * rng.uniform(0.7, 1.2, count))[:, None]
    faces = np.arange(count)[:, None, None] * 4 + np.array([[0, 1, 2], [1, 3, 2]])
    return Mesh(corners.reshape(-1, 3), faces.reshape(-1, 3), colour=np.repeat(colour, 4, axis=0))


def grass(rng: np.random.Generator, places: np.ndarray, length: float) -> Mesh:
    """Return a bent blade at every ``(x, y, z)`` place."""
    count = len(places)
    heading = rng.uniform(0, 2 * np.pi, count)
    across = np.stack([np.cos(heading), np.sin(heading), np.zeros(count)], -1)
    lean = rng.normal(0, 0.45, (count, 3)) * [1, 1, 0]
    tall = (length * rng.gamma(6.0, 1 / 6, count))[:, None]
    upward = np.array([0.0, 0.0, 1.0])
    width = 0.035 * length + 0.004
    root, middle = places, places + tall * (0.55 * upward + 0.25 * lean)
    tip = places + tall * (0.9 * upward + 0.8 * lean)
    corners = np.stack(
        [
            root - width * across,
            root + width * across,
            middle - 0.7 * width * across,
            middle + 0.7 * width * across,
            tip,
        ],
        axis=1,
    )
    tone = STRAW[rng.integers(len(STRAW), size=count)] * rng.uniform(0.7, 1.15, (count, 1))
    shade = np.array([0.55, 0.55, 0.9, 0.9, 1.15])
    colour = tone[:, None] * shade[None, :, None]
    faces = np.arange(count)[:, None, None] * 5 + np.array([[0, 1, 2], [1, 3, 2], [2, 3, 4]])
    return Mesh(corners.reshape(-1, 3), faces.reshape(-1, 3), colour=colour.reshape(-1, 3))


def forest(
    rng: np.random.Generator, name: str, kinds: list[Tree], stands: list[tuple[float, float, float]]
) -> dict[str, Any]:
    """Return copies of `kinds` at every ``(x, y, scale)``; Mitsuba keeps one mesh per kind."""
    bark = matte(textures.bark((512, 512), rng), repeat=(2.0, 1.0))
    objects: dict[str, Any] = {}
    for number, kind in enumerate(kinds):
        objects[f"{name}_kind_{number}"] = {
            "type": "shapegroup",
            "wood": kind.wood.shape(bark, smooth=True),
            "leaves": kind.leaves.shape(matte(VERTEX_COLOUR)),
        }
    for number, (x, y, scale) in enumerate(stands):
        pose = mi.ScalarTransform4f().translate([x, y, 0]).rotate([0, 0, 1], float(rng.uniform(0, 360))).scale(scale)
        group = {"type": "ref", "id": f"{name}_kind_{number % len(kinds)}"}
        objects[f"{name}_{number}"] = {"type": "instance", "to_world": pose, "group": group}
    return objects


def _cloud(rng: np.random.Generator, centre: np.ndarray, size: np.ndarray, count: int) -> np.ndarray:
    """Return places in an ellipsoid, denser at its surface and clustered in twigs."""
    twigs = rng.standard_normal((max(count // 25, 1), 3))
    twigs /= np.linalg.norm(twigs, axis=1, keepdims=True)
    twigs *= rng.uniform(0.25, 1.0, (len(twigs), 1)) ** 0.4
    places = twigs[rng.integers(len(twigs), size=count)] + rng.normal(0, 0.10, (count, 3))
    return centre + places * size


def _frames(rng: np.random.Generator, count: int) -> tuple[np.ndarray, np.ndarray]:
    along = rng.standard_normal((count, 3))
    along /= np.linalg.norm(along, axis=1, keepdims=True)
    across = np.cross(along, rng.standard_normal((count, 3)))
    return along, across / np.linalg.norm(across, axis=1, keepdims=True)
