"""Triangle meshes built in NumPy and passed to Mitsuba."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import mitsuba as mi
import numpy as np
from numpy.typing import ArrayLike

from .materials import linear
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
