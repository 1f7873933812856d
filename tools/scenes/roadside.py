"""Objects along a motorway, and its surface: barriers, rails, signs, a bridge, the carriageway."""

from collections.abc import Callable
from typing import Any

import cv2
import mitsuba as mi
import numpy as np

from . import textures
from .materials import glossy, matte, metal
from .meshes import Mesh, box, extruded, join, plane, tube

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
