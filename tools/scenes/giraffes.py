"""Giraffes before a wooden fence, in dry grass, with trees and sky behind."""

from itertools import pairwise
from typing import Any

import numpy as np
from scipy.spatial import cKDTree

from . import textures
from .rendering import StereoCamera, StereoScene
from .shapes import Mesh, Volume, box, bush, forest, grass, join, terrain, tree
from .surfaces import VERTEX_COLOUR, matte, sky

FENCE = 19.0


def build() -> StereoScene:
    rng = np.random.default_rng(12)
    hide = matte(VERTEX_COLOUR)
    herd = {
        "giraffe_left": giraffe(rng, neck=28, stride=0.22).turned(-8).moved((-2.6, 13.2, 0)),
        "giraffe_right": giraffe(rng, neck=38, stride=-0.15).turned(164).moved((2.5, 11.6, 0)),
        "giraffe_far": giraffe(rng, neck=15, stride=0.1).turned(205).moved((0.4, 17.0, 0)),
    }
    objects: dict[str, Any] = {name: mesh.shape(hide, smooth=True) for name, mesh in herd.items()}
    objects |= _ground(rng) | _fence(rng) | _trees(rng)
    objects["sky"] = sky(rng, sun_azimuth=215, sun_elevation=42, sun_strength=3.2, cloudiness=0.55)
    camera = StereoCamera(
        width=640,
        height=480,
        focal_px=780.0,
        baseline_m=0.46,
        position=(0.0, 0.0, 1.75),
        target=(0.0, 10.0, 2.28),
    )
    return StereoScene(
        title="Giraffes",
        description="Three giraffes in dry grass before a wooden fence, with trees behind it.",
        camera=camera,
        objects=objects,
        exposure=1.0,
    )


def giraffe(rng: np.random.Generator, *, neck: float, stride: float) -> Mesh:
    """Return an animal facing +x. `neck` is its forward lean in degrees; `stride` is a step in metres."""
    lean = np.radians(neck)
    shoulder = np.array([0.62, 0, 2.55])
    nape = shoulder + 1.95 * np.array([np.sin(lean), 0, np.cos(lean)])
    body = Volume((-1.5, -0.6, 0.0), (2.8, 0.6, 5.1), 0.02)
    _add_trunk(body)
    _add_neck_and_head(body, shoulder, nape)
    for side in (-1, 1):
        _add_legs(body, side, side * stride)
    mesh = body.mesh()
    return Mesh(mesh.vertices, mesh.faces, colour=_pelt(mesh.vertices, shoulder, nape, rng))


def _add_trunk(body: Volume) -> None:
    body.add_limb((-0.62, 0, 2.10), (0.05, 0, 2.12), (0.36, 0.42), 0.1)
    body.add_limb((0.05, 0, 2.12), (0.55, 0, 2.28), (0.42, 0.37), 0.1)
    body.add_limb((-0.75, 0, 2.30), (0.42, 0, 2.62), (0.18, 0.22), 0.25)
    body.add_limb((-0.98, 0, 2.25), (-1.12, 0, 1.60), (0.05, 0.022), 0.06)
    body.add_limb((-1.12, 0, 1.60), (-1.13, 0, 1.15), (0.03, 0.055), 0.04)


def _add_neck_and_head(body: Volume, shoulder: np.ndarray, nape: np.ndarray) -> None:
    throat = _beyond((2 * shoulder + nape) / 3, 0.03, 0, 0)
    body.add_limb(shoulder - [0.05, 0, 0.15], throat, (0.34, 0.20), 0.2)
    body.add_limb(throat, nape, (0.20, 0.115), 0.1)
    mane = np.array([-0.13, 0, 0.03])
    body.add_limb(_beyond(shoulder, -0.22, 0, 0.16), throat + mane * 1.5, (0.05, 0.04), 0.05)
    body.add_limb(throat + mane * 1.5, nape + mane, (0.04, 0.035), 0.05)
    skull = _beyond(nape, 0.06, 0, 0.08)
    body.add_limb(skull, _beyond(skull, 0.24, 0, -0.06), (0.135, 0.105), 0.05)
    body.add_limb(_beyond(skull, 0.20, 0, -0.07), _beyond(skull, 0.55, 0, -0.25), (0.10, 0.075), 0.08)
    for side in (-1, 1):
        horn = _beyond(skull, 0.02, side * 0.06, 0.10)
        body.add_limb(horn, _beyond(horn, -0.05, side * 0.02, 0.17), (0.028, 0.034), 0.03)
        ear = _beyond(skull, -0.06, side * 0.10, 0.04)
        body.add_limb(ear, _beyond(ear, -0.03, side * 0.13, 0.04), (0.035, 0.055), 0.02)
        middle = _beyond(ear, -0.03, side * 0.13, 0.04)
        body.add_limb(middle, _beyond(ear, -0.05, side * 0.23, 0.05), (0.05, 0.012), 0.02)


def _beyond(point: np.ndarray, x: float, y: float, z: float) -> np.ndarray:
    return point + np.array([x, y, z])


def _add_legs(body: Volume, side: int, step: float) -> None:
    y = 0.19 * side
    front = [
        ((0.50, y, 2.20), 0.24), ((0.50, y, 1.70), 0.135), ((0.50 + step * 0.6, y * 0.9, 0.98), 0.078),
        ((0.48 + step, y * 0.9, 0.20), 0.052), ((0.53 + step, y * 0.9, 0.06), 0.075),
    ]  # fmt: skip
    hind = [
        ((-0.60, y, 2.02), 0.30), ((-0.50 - step * 0.3, y, 1.62), 0.18), ((-0.74 - step * 0.7, y * 0.9, 1.02), 0.078),
        ((-0.70 - step, y * 0.9, 0.20), 0.052), ((-0.65 - step, y * 0.9, 0.06), 0.075),
    ]  # fmt: skip
    for leg in (front, hind):
        for (start, thick), (end, thin) in pairwise(leg):
            body.add_limb(start, end, (thick, thin), 0.06)


def _pelt(places: np.ndarray, shoulder: np.ndarray, nape: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """Return the colours of brown patches separated by cream lines, fading on the shins, the belly and the head."""
    warped = places + 0.025 * np.sin(places[:, [1, 2, 0]] * 23) + 0.012 * np.sin(places[:, [2, 0, 1]] * 61)
    spots = _spread(warped, rng, spacing=0.17)
    distance, index = cKDTree(spots).query(warped, k=2)
    gap = distance[:, 1] - distance[:, 0]
    tone = rng.uniform(0.8, 1.25, len(spots))[index[:, 0]]
    brown = np.array([0.50, 0.28, 0.13]) * (tone * (1.12 - 1.1 * distance[:, 0]))[:, None]
    cream = np.broadcast_to([0.86, 0.74, 0.55], brown.shape)
    x, z = places[:, 0], places[:, 2]
    head = np.linalg.norm(places - nape - [0.2, 0, 0], axis=1) < 0.52
    width = 0.030 + 0.09 * np.clip((1.25 - z) / 0.5, 0, 1)
    colour = np.where((gap > width)[:, None] & ~head[:, None], brown, cream)
    colour = np.where(head[:, None], [0.70, 0.50, 0.31], colour)
    muzzle = x > nape[0] + 0.50
    dark = (z < 0.14) | (muzzle & head) | ((x < -1.0) & (z < 1.5) & (z > 1.05))
    horns = head & (z > nape[2] + 0.30)
    for side in (-1, 1):
        eye = np.linalg.norm(places - nape - [0.24, side * 0.105, 0.06], axis=1) < 0.035
        dark = dark | eye
    colour = np.where((dark | horns)[:, None], [0.13, 0.09, 0.07], colour)
    return colour * (1 + 0.08 * rng.standard_normal((len(places), 1)))


def _spread(places: np.ndarray, rng: np.random.Generator, spacing: float) -> np.ndarray:
    """Return some of `places`, no two closer together than `spacing` (dart throwing)."""
    chosen: list[np.ndarray] = []
    for place in places[rng.permutation(len(places))[:4000]]:
        if not chosen or np.min(np.sum((np.array(chosen) - place) ** 2, axis=1)) > spacing**2:
            chosen.append(place)
    return np.array(chosen)


def _ground(rng: np.random.Generator) -> dict[str, Any]:
    soil = terrain((-70, 70), (2, 110), 0.03, rng, tile=6.0)
    distance = 6.0 + 16.0 * rng.random(150_000) ** 1.4
    sideways = rng.uniform(-0.5, 0.5, len(distance)) * distance * 1.05
    clumps = textures.fractal_noise((512, 512), rng, slope=1.2, finest=6)
    grows = clumps[(sideways * 25).astype(int) % 512, (distance * 25).astype(int) % 512] > -0.8
    roots = np.stack([sideways, distance, np.full(len(distance), -0.03)], -1)[grows]
    return {
        "soil": soil.shape(matte(textures.turf((1024, 1024), rng, dryness=0.7)), smooth=True),
        "blades": grass(rng, roots, 0.16).shape(matte(VERTEX_COLOUR)),
    }


def _fence(rng: np.random.Generator) -> dict[str, Any]:
    timber = matte(textures.wood((512, 1024), rng, (0.66, 0.56, 0.45), (0.36, 0.28, 0.21), rings=5))
    parts = []
    for x in np.arange(-16.0, 16.1, 2.0):
        post = box((0.15, 0.15, 1.75), radius=0.012, steps=2, tile=0.9).turned(rng.uniform(-2, 2), 1)
        parts.append(post.moved((x, FENCE, 0.8)))
        for height in (0.45, 0.95, 1.45):
            rail = box((2.02, 0.045, 0.15), radius=0.008, steps=2, tile=1.4)
            parts.append(rail.turned(rng.normal(0, 0.7), 1).moved((x + 1, FENCE - 0.1, height + rng.normal(0, 0.015))))
    return {"fence": join(parts).shape(timber)}


def _trees(rng: np.random.Generator) -> dict[str, Any]:
    acacias = [tree(rng, 6.0, crown_width=7.5, crown_height=2.2, leaves=30_000) for _ in range(2)]
    oaks = [tree(rng, 9.0, crown_width=6.5, crown_height=6.0, leaf=0.16, leaves=30_000) for _ in range(2)]
    far = [(x + rng.normal(0, 1.5), 52 + rng.normal(0, 6), rng.uniform(0.8, 1.3)) for x in np.arange(-44, 45, 4.2)]
    objects = forest(rng, "acacia", acacias, [(-7.5, 25, 1.0), (6.5, 29, 1.1), (15, 34, 1.0), (-16, 38, 1.2)])
    objects |= forest(rng, "oak", oaks, far)
    hedge = [bush(rng, (7, 2.5, 2.6), 9000, 0.14).moved((x, 44 + rng.normal(0, 2), 0)) for x in np.arange(-36, 37, 5.0)]
    return objects | {"hedge": join(hedge).shape(matte(VERTEX_COLOUR))}
