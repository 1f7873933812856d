"""Cars and a lorry: smooth bodies cut into paint, glass and lamps, on round wheels."""

from dataclasses import dataclass
from typing import Any

import cv2
import mitsuba as mi
import numpy as np

from . import textures
from .implicit import Volume, smooth_intersection
from .materials import glossy, matte, metal
from .meshes import Mesh, box, join, plane, revolved

Outline = tuple[tuple[float, float], ...]


@dataclass(frozen=True)
class BodyStyle:
    """A car's side view as ``(y, z)`` corners, with y forwards, and its other dimensions, metres."""

    outline: Outline
    width: float
    belt: float  # height of the lower edge of the windows
    pillars: tuple[float, ...]  # y of the posts between the side windows
    axles: tuple[float, float]
    wheel: float = 0.32

    @property
    def rear(self) -> float:
        return min(y for y, _ in self.outline)

    @property
    def front(self) -> float:
        return max(y for y, _ in self.outline)

    @property
    def roof(self) -> float:
        return max(z for _, z in self.outline)


SALOON = BodyStyle(
    outline=(
        (-2.25, 0.30), (-2.32, 0.62), (-2.26, 1.00), (-1.68, 1.06), (-0.98, 1.42), (-0.10, 1.47),
        (0.35, 1.42), (1.12, 1.00), (2.10, 0.82), (2.28, 0.58), (2.22, 0.22), (-2.1, 0.20),
    ),
    width=1.80, belt=0.98, pillars=(-1.12, -0.12), axles=(-1.38, 1.38),
)  # fmt: skip
HATCHBACK = BodyStyle(
    outline=(
        (-1.92, 0.28), (-2.00, 0.60), (-1.93, 1.00), (-1.66, 1.46), (-0.60, 1.54), (0.20, 1.50),
        (0.98, 1.06), (1.78, 0.88), (1.98, 0.62), (1.94, 0.24), (-1.8, 0.20),
    ),
    width=1.76, belt=1.00, pillars=(-1.25, -0.20), axles=(-1.26, 1.26),
)  # fmt: skip
ESTATE = BodyStyle(
    outline=(
        (-2.28, 0.36), (-2.36, 0.70), (-2.30, 1.14), (-2.04, 1.62), (-0.80, 1.72), (0.25, 1.68),
        (1.02, 1.18), (2.10, 1.02), (2.30, 0.70), (2.24, 0.32), (-2.1, 0.28),
    ),
    width=1.88, belt=1.12, pillars=(-1.45, -0.25), axles=(-1.42, 1.40), wheel=0.36,
)  # fmt: skip


def car(
    name: str,
    style: BodyStyle,
    paint: tuple[float, float, float],
    place: tuple[float, float],
    rng: np.random.Generator,
    *,
    oncoming: bool = False,
) -> dict[str, mi.Mesh]:
    """Return the shapes of a car centred at ``(x, y)``."""
    body, parts = _shell(style)
    dust = textures.fractal_noise((512, 512), rng, slope=1.9)[..., None]
    coat = np.asarray(paint) * (1 + 0.03 * dust)
    coat[91:95] *= 0.3  # the moulding at bumper height: texture rows follow height
    surfaces = {
        "paint": glossy(coat, 0.06, repeat=(0.3, 0.3)),
        "trim": matte((0.07, 0.07, 0.075)),
        "glass": glossy((0.03, 0.04, 0.045), 0.02),
        "tail_lamp": glossy((0.62, 0.03, 0.03), 0.06),
        "head_lamp": glossy((0.85, 0.87, 0.88), 0.03),
    }
    meshes = [(body.faces_where(parts == part), surface, True) for part, surface in surfaces.items()]
    meshes += _wheels(style)
    meshes.append((_mirrors(style), surfaces["paint"], False))
    meshes.append((_plate(style), matte(_plate_print(rng)), False))
    shapes = {}
    for number, (mesh, surface, smooth) in enumerate(meshes):
        placed = mesh.turned(180 if oncoming else 0).moved((*place, 0.0))
        shapes[f"{name}_{number}"] = placed.shape(surface, smooth=smooth)
    return shapes


def _shell(style: BodyStyle) -> tuple[Mesh, np.ndarray]:
    """Return the body, and the material of each of its triangles."""
    margin = 0.06
    volume = Volume(
        (-style.width / 2 - margin, style.rear - margin, 0.1),
        (style.width / 2 + margin, style.front + margin, style.roof + margin),
        0.014,
    )
    side_view = _outline_distance(style.outline, volume.y, volume.z)
    sideways = np.abs(volume.x) - _half_width(style, volume.y, volume.z)
    body = smooth_intersection(side_view, sideways, 0.16)
    for axle in style.axles:
        arch = np.hypot(volume.y - axle, volume.z - style.wheel) - (style.wheel + 0.055)
        inside = style.width / 2 - 0.30 - np.abs(volume.x)
        body = np.maximum(body, -np.maximum(arch, inside))
    volume.distance = body
    mesh = volume.mesh()
    across = mesh.vertices[:, 0] + mesh.vertices[:, 1]
    mesh = Mesh(mesh.vertices, mesh.faces, uv=np.stack([across, mesh.vertices[:, 2]], -1))
    return mesh, _parts(style, mesh)


def _half_width(style: BodyStyle, y: np.ndarray, z: np.ndarray) -> np.ndarray:
    """Return the half width: narrower above the belt line and, seen from above, rounded at both ends."""
    leaning = 0.30 * np.maximum(z - style.belt + 0.03, 0)
    sill = 0.25 * np.maximum(0.45 - z, 0)
    end = np.maximum(np.abs(y) - (style.front - 0.55), 0)
    return style.width / 2 - leaning - sill - 0.42 * end**2


def _parts(style: BodyStyle, mesh: Mesh) -> np.ndarray:
    corners = mesh.vertices[mesh.faces]
    x, y, z = corners.mean(axis=1).T
    normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    normal /= np.linalg.norm(normal, axis=1, keepdims=True) + 1e-12
    inward = _half_width(style, y, z) - np.abs(x)
    sideways = np.abs(normal[:, 0]) > 0.7
    pane = (z > style.belt + 0.05) & (z < style.roof - 0.09) & (np.abs(normal[:, 2]) < 0.9)
    post = np.min([np.abs(y - pillar) for pillar in style.pillars], axis=0) < 0.045
    wide = style.width / 2
    tail = (y < style.rear + 0.22) & (np.abs(x) > wide - 0.34) & (np.abs(z - style.belt + 0.16) < 0.095)
    head = (y > style.front - 0.45) & (np.abs(x) > wide - 0.42) & (np.abs(z - 0.68) < 0.075)
    grille = (y > style.front - 0.3) & (np.abs(x) < wide - 0.45) & (np.abs(z - 0.56) < 0.10)
    parts = np.full(len(x), "paint", dtype="<U9")
    parts[pane & np.where(sideways, ~post, inward > 0.10)] = "glass"
    parts[tail] = "tail_lamp"
    parts[head] = "head_lamp"
    parts[grille | (z < 0.40)] = "trim"
    return parts


def _wheels(style: BodyStyle) -> list[tuple[Mesh, dict[str, Any], bool]]:
    r = style.wheel
    tyre = revolved(
        np.array([[0.62 * r, 0.10], [0.9 * r, 0.11], [r, 0.08], [r, -0.08], [0.9 * r, -0.11], [0.62 * r, -0.10]])
    )
    rim = revolved(np.array([[0.0, 0.075], [0.2 * r, 0.08], [0.55 * r, 0.055], [0.64 * r, 0.10]]))
    meshes = []
    for axle in style.axles:
        for side in (-1, 1):
            centre = (side * (style.width / 2 - 0.12), axle, r)
            meshes.append((tyre.moved(centre), matte((0.09, 0.09, 0.09)), True))
            outer = rim if side == 1 else rim.turned(180)
            meshes.append((outer.moved(centre), metal(roughness=0.25), True))
    return meshes


def _mirrors(style: BodyStyle) -> Mesh:
    housing = box((0.20, 0.10, 0.14), radius=0.04)
    return join([housing.moved((side * (style.width / 2 + 0.06), 0.62, style.belt + 0.06)) for side in (-1, 1)])


def _plate(style: BodyStyle) -> Mesh:
    return plane((-0.26, style.rear - 0.022, 0.56), (0.52, 0, 0), (0, 0, 0.115))


def _plate_print(rng: np.random.Generator) -> np.ndarray:
    image = np.full((64, 290, 3), 237, dtype=np.uint8)
    letters = "".join(rng.choice(list("ABCDEFHKLMNPRSTVXYZ"), 3))
    text = f"{letters} {rng.integers(100, 999)}"
    cv2.putText(image, text, (18, 50), cv2.FONT_HERSHEY_DUPLEX, 1.6, (18, 18, 26), 4, cv2.LINE_AA)
    return image[::-1] / 255


def lorry(name: str, place: tuple[float, float], rng: np.random.Generator) -> dict[str, mi.Mesh]:
    """Return a box lorry seen from behind; `place` is the middle of its tail."""
    x, y = place
    doors = textures.mottle((512, 512), rng, (0.80, 0.79, 0.75), (0.90, 0.90, 0.88), spread=0.15)
    doors[:, 252:260] = 0.25
    doors[:24], doors[-24:] = 0.35, 0.35
    for column in (110, 150, 360, 400):
        doors[:, column : column + 6] = 0.55
    doors[150:215, 60:200] = [0.10, 0.30, 0.55]
    doors[150:215, 310:450] = [0.10, 0.30, 0.55]
    cargo = box((2.5, 7.0, 2.7)).moved((x, y + 3.51, 2.45))
    shapes = {
        f"{name}_doors": plane((x - 1.25, y, 1.1), (2.5, 0, 0), (0, 0, 2.7)).shape(glossy(doors, 0.25)),
        f"{name}_cargo": cargo.shape(glossy((0.85, 0.85, 0.83), 0.25)),
        f"{name}_cab": box((2.4, 1.8, 2.5), radius=0.15).moved((x, y + 8.1, 1.9)).shape(glossy((0.12, 0.26, 0.5), 0.1)),
        f"{name}_frame": box((2.2, 7.4, 0.3)).moved((x, y + 3.8, 0.9)).shape(matte((0.08, 0.08, 0.08))),
        f"{name}_bumper": box((2.4, 0.1, 0.18)).moved((x, y + 0.1, 0.55)).shape(matte((0.15, 0.15, 0.15))),
    }
    tyre = revolved(np.array([[0.0, 0.14], [0.42, 0.15], [0.5, 0.12], [0.5, -0.12], [0.42, -0.15], [0, -0.14]]))
    for number, (side, axle) in enumerate(((-1, 1.6), (1, 1.6), (-1, 7.9), (1, 7.9))):
        wheel = tyre.moved((x + side * 1.0, y + axle, 0.5))
        shapes[f"{name}_wheel_{number}"] = wheel.shape(matte((0.07, 0.07, 0.07)), smooth=True)
        if axle == 1.6:
            lamp = box((0.28, 0.04, 0.13)).moved((x + side * 0.95, y + 0.02, 0.78))
            shapes[f"{name}_lamp_{number}"] = lamp.shape(glossy((0.6, 0.04, 0.03), 0.1))
    return shapes


def _outline_distance(outline: Outline, y: np.ndarray, z: np.ndarray) -> np.ndarray:
    """Return the signed distance to a closed polygon, negative inside."""
    nearest = np.full(np.broadcast_shapes(y.shape, z.shape), np.inf, dtype=np.float32)
    inside = np.zeros(nearest.shape, dtype=bool)
    for (y0, z0), (y1, z1) in zip(outline, (*outline[1:], outline[0]), strict=True):
        edge_y, edge_z = y1 - y0, z1 - z0
        along = np.clip(((y - y0) * edge_y + (z - z0) * edge_z) / (edge_y**2 + edge_z**2), 0, 1)
        nearest = np.minimum(nearest, np.hypot(y - y0 - along * edge_y, z - z0 - along * edge_z))
        if z0 != z1:
            crossing = (z0 > z) != (z1 > z)
            inside ^= crossing & (y < edge_y * (z - z0) / edge_z + y0)
    return np.where(inside, -nearest, nearest)
