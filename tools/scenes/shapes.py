"""Triangle meshes built in NumPy and passed to Mitsuba: plain shapes, smooth bodies from signed distances, plants."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import mitsuba as mi
import numpy as np
from numpy.typing import ArrayLike
from skimage.measure import marching_cubes

from . import textures
from .surfaces import VERTEX_COLOUR, linear, matte
from .textures import fractal_noise


@dataclass(frozen=True)
class Mesh:
    """Vertices ``(n, 3)`` in metres, triangles ``(m, 3)``, and per vertex ``uv`` and ``colour`` (sRGB)."""

    vertices: np.ndarray
    faces: np.ndarray
    uv: np.ndarray | None = None
    colour: np.ndarray | None = None

    def moved(self, offset: ArrayLike) -> "Mesh":
        return Mesh(self.vertices + np.asarray(offset), self.faces, self.uv, self.colour)

    def turned(self, degrees: float, axis: int = 2) -> "Mesh":
        """Return the mesh rotated anticlockwise about a coordinate axis through the origin."""
        return Mesh(self.vertices @ rotation(degrees, axis).T, self.faces, self.uv, self.colour)

    def faces_where(self, chosen: np.ndarray) -> "Mesh":
        return Mesh(self.vertices, self.faces[chosen], self.uv, self.colour)

    def shape(self, surface: dict[str, Any], *, smooth: bool = False) -> mi.Mesh:
        """Return the Mitsuba shape; `smooth` shades across edges."""
        properties = mi.Properties()
        properties["surface"] = mi.load_dict(surface)
        mesh = mi.Mesh(
            "mesh",
            vertex_count=len(self.vertices),
            face_count=len(self.faces),
            has_vertex_normals=smooth,
            has_vertex_texcoords=self.uv is not None,
            props=properties,
        )
        parameters = mi.traverse(mesh)
        parameters["vertex_positions"] = mi.Float(self.vertices.astype(np.float32).ravel())
        parameters["faces"] = mi.UInt32(self.faces.astype(np.uint32).ravel())
        if self.uv is not None:
            parameters["vertex_texcoords"] = mi.Float(self.uv.astype(np.float32).ravel())
        parameters.update()
        if self.colour is not None:
            mesh.add_attribute("vertex_color", 3, linear(self.colour).astype(np.float32).ravel())
        return mesh


def rotation(degrees: float, axis: int) -> np.ndarray:
    cosine, sine = np.cos(np.radians(degrees)), np.sin(np.radians(degrees))
    first, second = (axis + 1) % 3, (axis + 2) % 3
    matrix = np.eye(3)
    matrix[first, first] = matrix[second, second] = cosine
    matrix[first, second], matrix[second, first] = -sine, sine
    return matrix


def join(meshes: Sequence[Mesh]) -> Mesh:
    """Join meshes into one; all must have the same attributes."""
    starts = np.cumsum([0] + [len(mesh.vertices) for mesh in meshes[:-1]])
    uv = None if meshes[0].uv is None else np.concatenate([m.uv for m in meshes])
    colour = None if meshes[0].colour is None else np.concatenate([m.colour for m in meshes])
    return Mesh(
        np.concatenate([mesh.vertices for mesh in meshes]),
        np.concatenate([mesh.faces + start for mesh, start in zip(meshes, starts, strict=True)]),
        uv,
        colour,
    )


def grid(rows: int, columns: int, wrap: bool = False) -> np.ndarray:
    """Return triangles over a ``(rows, columns)`` array of vertices; `wrap` closes the columns."""
    across = columns if wrap else columns - 1
    i, j = np.meshgrid(np.arange(rows - 1), np.arange(across), indexing="ij")
    a, b = i * columns + j, i * columns + (j + 1) % columns
    c, d = a + columns, b + columns
    return np.concatenate([np.stack([a, b, c], -1).reshape(-1, 3), np.stack([b, d, c], -1).reshape(-1, 3)])


def plane(corner: ArrayLike, along_u: ArrayLike, along_v: ArrayLike, tile: float = 0.0) -> Mesh:
    """Return a parallelogram; the texture covers it once, or repeats every `tile` metres."""
    corner, along_u, along_v = (np.asarray(v, dtype=float) for v in (corner, along_u, along_v))
    vertices = np.stack([corner, corner + along_u, corner + along_v, corner + along_u + along_v])
    uv = np.array([[0, 0], [1, 0], [0, 1], [1, 1]], dtype=float)
    if tile:
        uv = uv * [np.linalg.norm(along_u) / tile, np.linalg.norm(along_v) / tile]
    return Mesh(vertices, grid(2, 2), uv)


def terrain(
    x_range: tuple[float, float],
    y_range: tuple[float, float],
    relief: float,
    rng: np.random.Generator,
    tile: float,
    cells: int = 256,
) -> Mesh:
    """Return rolling ground whose height deviates from 0 by about `relief` metres."""
    y, x = np.meshgrid(np.linspace(*y_range, cells), np.linspace(*x_range, cells), indexing="ij")
    height = relief * fractal_noise((cells, cells), rng, slope=2.0, finest=6)
    vertices = np.stack([x, y, height], -1).reshape(-1, 3)
    return Mesh(vertices, grid(cells, cells), np.stack([x, y], -1).reshape(-1, 2) / tile)


def box(size: ArrayLike, radius: float = 0.0, steps: int = 4, tile: float = 0.0) -> Mesh:
    """Return a box about the origin with rounded edges; every face shows the whole texture.

    With `tile` the texture instead repeats at that distance in metres, as on sawn wood.
    """
    half = np.asarray(size, dtype=float) / 2
    inner = half - radius
    sides = []
    for axis in range(3):
        for sign in (-1.0, 1.0):
            sides.append(_box_side(half, inner, radius, axis, sign, steps, tile))
    return join(sides)


def _box_side(
    half: np.ndarray, inner: np.ndarray, radius: float, axis: int, sign: float, steps: int, tile: float
) -> Mesh:
    first, second = (axis + 1) % 3, (axis + 2) % 3
    if half[first] < half[second]:  # the texture's columns follow the longer edge
        first, second = second, first

    def knots(extent: float) -> np.ndarray:
        if radius == 0:
            return np.array([-extent, extent])
        bend = extent - radius * (1 - np.tan(np.linspace(0, np.pi / 4, steps)))
        return np.concatenate([-bend[::-1], bend])

    v, u = np.meshgrid(knots(half[second]), knots(half[first]), indexing="ij")
    surface = np.empty((*u.shape, 3))
    surface[..., axis], surface[..., first], surface[..., second] = sign * half[axis], u, v
    if radius:
        core = np.clip(surface, -inner, inner)
        outward = surface - core
        surface = core + radius * outward / np.linalg.norm(outward, axis=-1, keepdims=True)
    scale = np.array([tile, tile]) if tile else 2 * half[[first, second]]
    uv = np.stack([u + half[first], v + half[second]], -1) / scale
    return Mesh(surface.reshape(-1, 3), grid(*u.shape), uv.reshape(-1, 2))


def tube(points: np.ndarray, radii: np.ndarray, sides: int = 12, tile: float = 0.5) -> Mesh:
    """Return a round bar along `points` ``(n, 3)`` with a radius at each point."""
    points, radii = np.asarray(points, dtype=float), np.asarray(radii, dtype=float)
    tangent = np.gradient(points, axis=0)
    tangent /= np.linalg.norm(tangent, axis=1, keepdims=True)
    helper = np.eye(3)[np.argmin(np.abs(tangent).sum(0))]
    across = np.cross(tangent, helper)
    across /= np.linalg.norm(across, axis=1, keepdims=True)
    other = np.cross(tangent, across)
    angle = np.linspace(0, 2 * np.pi, sides + 1)[None, :, None]
    ring = np.cos(angle) * across[:, None] + np.sin(angle) * other[:, None]
    vertices = points[:, None] + radii[:, None, None] * ring
    length = np.concatenate([[0], np.cumsum(np.linalg.norm(np.diff(points, axis=0), axis=1))])
    turn = np.broadcast_to(np.linspace(0, 1, sides + 1), (len(points), sides + 1))
    along = np.broadcast_to(length[:, None] / tile, turn.shape)
    uv = np.stack([turn, along], -1).reshape(-1, 2)
    return Mesh(vertices.reshape(-1, 3), grid(len(points), sides + 1), uv)


def revolved(profile: np.ndarray, sides: int = 40) -> Mesh:
    """Rotate a ``(radius, x)`` profile about the x axis: wheels, discs, posts."""
    radius, offset = np.asarray(profile, dtype=float).T
    angle = np.linspace(0, 2 * np.pi, sides, endpoint=False)
    ring = np.stack([np.zeros(sides), np.cos(angle), np.sin(angle)], -1)
    vertices = radius[:, None, None] * ring + offset[:, None, None] * np.array([1.0, 0, 0])
    return Mesh(vertices.reshape(-1, 3), grid(len(radius), sides, wrap=True))


def extruded(profile: np.ndarray, y_range: tuple[float, float], tile: float = 1.0) -> Mesh:
    """Extrude an ``(x, z)`` outline along y: barriers, rails, kerbs."""
    outline = np.asarray(profile, dtype=float)
    length = np.concatenate([[0], np.cumsum(np.linalg.norm(np.diff(outline, axis=0), axis=1))])
    ends = [np.insert(outline, 1, y, axis=1) for y in y_range]
    uv = [np.stack([np.full(len(length), y), length], -1) / tile for y in y_range]
    return Mesh(np.concatenate(ends), grid(2, len(outline)), np.concatenate(uv))


class Volume:
    """A grid of signed distances (negative inside) over a box of the world."""

    def __init__(self, low: ArrayLike, high: ArrayLike, spacing: float) -> None:
        self.low = np.asarray(low, dtype=np.float32)
        self.spacing = spacing
        axes = [
            np.arange(a, b, spacing, dtype=np.float32) for a, b in zip(np.asarray(low), np.asarray(high), strict=True)
        ]
        self.x, self.y, self.z = np.meshgrid(*axes, indexing="ij", sparse=True)
        self.distance = np.full([len(axis) for axis in axes], 10.0, dtype=np.float32)

    def add_limb(self, start: ArrayLike, end: ArrayLike, radii: tuple[float, float], blend: float) -> None:
        """Add a bone with flesh of a given radius at either end, blended with the existing body."""
        a, b = np.asarray(start, dtype=np.float32), np.asarray(end, dtype=np.float32)
        axis = b - a
        along = (self.x - a[0]) * axis[0] + (self.y - a[1]) * axis[1] + (self.z - a[2]) * axis[2]
        along = np.clip(along / float(axis @ axis), 0, 1)
        distance = np.sqrt(
            (self.x - a[0] - along * axis[0]) ** 2
            + (self.y - a[1] - along * axis[1]) ** 2
            + (self.z - a[2] - along * axis[2]) ** 2
        ) - (radii[0] + along * (radii[1] - radii[0]))
        self.distance = smooth_union(self.distance, distance, blend)

    def mesh(self) -> Mesh:
        vertices, faces, _, _ = marching_cubes(self.distance, 0.0, spacing=(self.spacing,) * 3)
        return Mesh(vertices + self.low, faces)


def smooth_union(first: np.ndarray, second: np.ndarray, radius: float) -> np.ndarray:
    """Return the lesser of two distances, with the seam rounded over `radius` (polynomial minimum)."""
    overlap = np.maximum(radius - np.abs(first - second), 0) / radius
    return np.minimum(first, second) - overlap * overlap * radius / 4


def smooth_intersection(first: np.ndarray, second: np.ndarray, radius: float) -> np.ndarray:
    """Return the greater of two distances, with the edge rounded over `radius`."""
    return -smooth_union(-first, -second, radius)


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
