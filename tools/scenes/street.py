"""Objects along a motorway, its surface, and what drives on it: barriers, signs, a bridge, cars and a lorry."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import cv2
import mitsuba as mi
import numpy as np

from . import textures
from .shapes import Mesh, Volume, box, extruded, join, plane, revolved, smooth_intersection, tube
from .surfaces import glossy, matte, metal

LANE = 3.5
PERIOD = 24.0  # metres of road after which the texture repeats
TEXELS = 170.0  # per metre
WHITE, BLACK = (242, 242, 240), (10, 10, 10)


def carriageway(
    rng: np.random.Generator,
    centre: float,
    length: float,
    *,
    contrast: float = 1.0,
    finish: Callable[..., dict[str, Any]] = matte,
) -> mi.Mesh:
    """Return three lanes along y with edge lines, dashes, wheel tracks and repairs.

    `contrast` scales the contrast of the asphalt's stones; `finish` turns the texture into a surface.
    """
    width = 3 * LANE + 1.5
    rows, columns = int(PERIOD * TEXELS), int(width * TEXELS)
    tile = textures.asphalt((1024, 1024), rng)
    picture = np.tile(tile, (rows // 1024 + 1, columns // 1024 + 1, 1))[:rows, :columns]
    picture = picture.mean(axis=(0, 1)) * (1 - contrast) + picture * contrast
    stains = cv2.resize(textures.fractal_noise((512, 256), rng, slope=1.3), (columns, rows))
    picture = picture * (1 + 0.05 * stains[..., None])
    x = np.arange(columns) / TEXELS - width / 2
    for lane in (-LANE, 0.0, LANE):
        for side in (-0.8, 0.8):
            track = np.exp(-(((x - lane - side) / 0.32) ** 2))
            picture = picture * (1 - 0.13 * track)[None, :, None]
        oil = np.exp(-(((x - lane) / 0.28) ** 2))
        picture = picture * (1 - 0.07 * oil)[None, :, None]
    for _ in range(5):
        row, column = rng.integers(rows - 700), rng.integers(columns - 420)
        tall, wide = rng.integers(250, 700), rng.integers(150, 420)
        picture[row : row + tall, column : column + wide] *= rng.uniform(0.72, 0.85)
    picture = np.where(_markings(x, rows, rng)[..., None], _paint((rows, columns), rng), picture)
    surface = plane((centre - width / 2, -5, 0), (width, 0, 0), (0, length, 0))
    return surface.shape(finish(picture, repeat=(1.0, length / PERIOD)))


def _markings(x: np.ndarray, rows: int, rng: np.random.Generator) -> np.ndarray:
    along = np.arange(rows) / TEXELS
    edge = np.abs(np.abs(x) - 1.5 * LANE - 0.1) < 0.09
    between = np.abs(np.abs(x) - LANE / 2) < 0.07
    dash = (along % 12.0) < 4.0
    worn = cv2.resize(textures.fractal_noise((rows // 2, len(x) // 2), rng, slope=0.6), (len(x), rows))
    return (edge[None] | (between[None] & dash[:, None])) & (worn < 1.5)


def _paint(shape: tuple[int, int], rng: np.random.Generator) -> np.ndarray:
    dirt = cv2.resize(textures.fractal_noise((shape[0] // 2, shape[1] // 2), rng, slope=0.8), shape[::-1])
    return np.repeat((0.80 + 0.05 * dirt)[..., None], 3, axis=-1).astype(np.float32)


def guard_rail(name: str, rng: np.random.Generator, x: float, facing: int, end: float) -> dict[str, mi.Mesh]:
    """Return a W-shaped steel beam on posts; `facing` -1 turns it to the left, 1 to the right."""
    wave = np.array([[0.0, 0.45], [0.06, 0.48], [0.08, 0.54], [0.0, 0.60], [0.08, 0.66], [0.06, 0.73], [0.0, 0.76]])
    beam = extruded(wave * [facing, 1.0] + [x, 0.0], (0, end), tile=1.5)
    steel = textures.mottle((512, 512), rng, (0.42, 0.44, 0.46), (0.66, 0.68, 0.70))
    rust = textures.fractal_noise((512, 512), rng, slope=0.9) > 2.3
    steel = np.where(rust[..., None], np.array([0.42, 0.27, 0.17]), steel)
    posts = [box((0.06, 0.12, 0.8)).moved((x - facing * 0.04, y, 0.36)) for y in np.arange(1.0, end, 2.0)]
    plates = [box((0.01, 0.09, 0.16)).moved((x + facing * 0.085, y + 1.0, 0.66)) for y in np.arange(2.0, end, 16.0)]
    return {
        f"{name}_beam": beam.shape(glossy(steel, 0.3)),
        f"{name}_posts": join(posts).shape(glossy(steel, 0.35)),
        f"{name}_reflectors": join(plates).shape(glossy((0.9, 0.45, 0.05), 0.1)),
    }


def median_barrier(rng: np.random.Generator, x: float, end: float) -> mi.Mesh:
    """Return a concrete wall with a splayed foot."""
    section = np.array(
        [[-0.32, 0], [-0.30, 0.08], [-0.14, 0.32], [-0.09, 0.86], [0.09, 0.86], [0.14, 0.32], [0.30, 0.08], [0.32, 0]]
    )
    surface = textures.concrete((1024, 1024), rng)
    surface[:, :5] = 0.2  # the joint between two castings
    grime = np.linspace(0.72, 1.0, 1024)[:, None, None]
    return extruded(section + np.array([x, 0]), (0, end), tile=3.0).shape(matte(surface * grime))


def bridge(rng: np.random.Generator, y: float, clearance: float) -> dict[str, Any]:
    """Return a concrete overpass across the road, its railing and its piers."""
    surface = matte(textures.concrete((1024, 1024), rng))
    wide, deep = 90.0, 9.0
    slab = [
        box((wide, deep, 1.0), tile=4.0).moved((0, y + deep / 2, clearance + 0.5)),
        box((wide, 0.35, 0.55), tile=4.0).moved((0, y - 0.05, clearance + 1.1)),
    ]
    piers = [
        box((0.9, deep - 2, clearance), radius=0.08, tile=4.0).moved((x, y + deep / 2, clearance / 2))
        for x in (-6.35, 9.6, -22.0)
    ]
    rails = [
        tube(np.array([[-wide / 2, y, z], [wide / 2, y, z]]), np.full(2, 0.04))
        for z in (clearance + 1.75, clearance + 2.15)
    ]
    bars = [box((0.04, 0.04, 0.95)).moved((x, y, clearance + 1.7)) for x in np.arange(-44, 44, 0.8)]
    return {
        "bridge_slab": join(slab).shape(surface),
        "bridge_piers": join(piers).shape(surface),
        "bridge_rails": join(rails).shape(metal(roughness=0.4)),
        "bridge_bars": join(bars).shape(metal(roughness=0.4)),
    }


def sign(
    name: str, picture: np.ndarray, place: tuple[float, float, float], size: float, shape: str
) -> dict[str, mi.Mesh]:
    """Return a panel on a pole; arguments as for `panel`."""
    x, y, z = place
    pole = tube(np.array([[x, y + 0.08, -0.2], [x, y + 0.08, z + 0.2 * size]]), np.full(2, 0.04))
    steel = pole.shape(metal(roughness=0.35), smooth=True)
    return {**panel(name, picture, place, size, shape), f"{name}_pole": steel}


def panel(
    name: str, picture: np.ndarray, place: tuple[float, float, float], size: float, shape: str
) -> dict[str, mi.Mesh]:
    """Return `picture` on a ``"disc"``, ``"triangle"`` or ``"board"`` of width `size` centred at `place`."""
    turn = np.linspace(0, 2 * np.pi, 48, endpoint=False)
    corners = {
        "disc": np.stack([np.cos(turn), np.sin(turn)], -1),
        "triangle": np.array([[-1.0, -0.75], [1.0, -0.75], [0.0, 1.0]]),
        "board": np.array([[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]]),
    }[shape]
    flat = corners * [size / 2, size / 2 * picture.shape[0] / picture.shape[1]]
    vertices = np.insert(flat, 1, 0.0, axis=1) + place
    fan = np.array([[0, i, i + 1] for i in range(1, len(corners) - 1)])
    plate = Mesh(vertices, fan, uv=(corners + 1) / 2)
    back = Mesh(vertices + np.array([0, 0.02, 0]), fan)
    return {
        f"{name}_plate": plate.shape(glossy(picture[::-1], 0.25)),
        f"{name}_back": back.shape(metal(roughness=0.4)),
    }


def speed_limit(text: str) -> np.ndarray:
    image = np.full((256, 256, 3), 237, dtype=np.uint8)
    cv2.circle(image, (128, 128), 110, (199, 13, 15), 34, cv2.LINE_AA)
    scale = 3.4 if len(text) < 3 else 2.5
    (wide, tall), _ = cv2.getTextSize(text, cv2.FONT_HERSHEY_DUPLEX, scale, 9)
    place = ((256 - wide) // 2, (256 + tall) // 2)
    cv2.putText(image, text, place, cv2.FONT_HERSHEY_DUPLEX, scale, BLACK, 9, cv2.LINE_AA)
    return image / 255


def warning() -> np.ndarray:
    image = np.full((256, 256, 3), (204, 15, 15), dtype=np.uint8)
    cv2.fillPoly(image, [np.array([[38, 212], [218, 212], [128, 50]])], WHITE, cv2.LINE_AA)
    cv2.line(image, (128, 95), (128, 165), BLACK, 20, cv2.LINE_AA)
    cv2.circle(image, (128, 193), 11, BLACK, -1, cv2.LINE_AA)
    return image / 255


def direction(lines: tuple[str, ...], colour: tuple[int, int, int]) -> np.ndarray:
    """Return a board with place names and an arrow ahead."""
    image = np.full((300, 640, 3), colour, dtype=np.uint8)
    cv2.rectangle(image, (8, 8), (631, 291), WHITE, 8, cv2.LINE_AA)
    for number, line in enumerate(lines):
        place = (40, 120 + 120 * number)
        cv2.putText(image, line, place, cv2.FONT_HERSHEY_DUPLEX, 2.9, WHITE, 9, cv2.LINE_AA)
    cv2.arrowedLine(image, (565, 255), (565, 50), WHITE, 22, cv2.LINE_AA, tipLength=0.35)
    return image / 255


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
