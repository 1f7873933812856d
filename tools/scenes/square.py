"""A raised square on a printed sheet with the same print, seen from above."""

from typing import Any

import mitsuba as mi
import numpy as np

from . import textures
from .rendering import StereoCamera, StereoScene
from .shapes import Mesh, box, grid, plane
from .surfaces import glossy, matte

SHEET = 0.36
SQUARE = 0.125
RAISED = 0.17


def build() -> StereoScene:
    rng = np.random.default_rng(7)
    print_ = _terrazzo((2048, 2048), rng)
    desk = textures.planks((1536, 1536), rng, (0.55, 0.38, 0.25), (0.27, 0.16, 0.09), count=5)
    rows = slice(int(2048 * (0.5 - SQUARE / SHEET / 2)), int(2048 * (0.5 + SQUARE / SHEET / 2)))
    board = box((SQUARE, SQUARE, 0.006), radius=0.0006)
    top = plane((-SQUARE / 2, -SQUARE / 2, 0), (SQUARE, 0, 0), (0, SQUARE, 0))
    objects = {
        "desk": plane((-0.5, -0.5, -0.002), (1, 0, 0), (0, 1, 0)).shape(glossy(desk, 0.25)),
        "sheet": _sheet(rng).shape(matte(print_), smooth=True),
        "board": board.moved((0, 0, RAISED - 0.0035)).shape(matte((0.93, 0.92, 0.89))),
        "board_print": top.moved((0, 0, RAISED)).shape(matte(print_[rows, rows])),
        "post": box((0.05, 0.05, RAISED - 0.007)).moved((0, 0, (RAISED - 0.007) / 2)).shape(matte((0.9, 0.89, 0.86))),
        **_lights(),
    }
    camera = StereoCamera(
        width=480,
        height=480,
        focal_px=760.0,
        baseline_m=0.024,
        position=(0.0, -0.12, 0.62),
        target=(0.0, 0.004, 0.03),
        up=(0.0, 1.0, 0.0),
    )
    return StereoScene(
        title="Raised square",
        description="A printed square held above a sheet with the very same print, seen from above.",
        camera=camera,
        objects=objects,
        num_disparities=48,
    )


def _sheet(rng: np.random.Generator) -> Mesh:
    """Return paper that is not quite flat: its corners lift a little."""
    count = 80
    v, u = np.meshgrid(np.linspace(0, 1, count), np.linspace(0, 1, count), indexing="ij")
    x, y = (u - 0.5) * SHEET, (v - 0.5) * SHEET
    lift = 0.010 * ((2 * np.abs(u - 0.5)) ** 4 * (2 * np.abs(v - 0.5)) ** 4)
    wave = 0.0006 * textures.fractal_noise((count, count), rng, slope=2.5, finest=10)
    vertices = np.stack([x, y, 0.001 + lift + np.abs(wave)], -1).reshape(-1, 3)
    return Mesh(vertices, grid(count, count), np.stack([u, v], -1).reshape(-1, 2))


def _terrazzo(shape: tuple[int, int], rng: np.random.Generator) -> np.ndarray:
    """Return angular chips of several sizes on off-white, which look different everywhere."""
    palette = np.array(
        [
            [0.80, 0.36, 0.25], [0.17, 0.36, 0.45], [0.88, 0.66, 0.27], [0.24, 0.25, 0.27],
            [0.46, 0.58, 0.42], [0.62, 0.28, 0.36], [0.55, 0.68, 0.75],
        ]
    )  # fmt: skip
    picture = np.full((*shape, 3), (0.91, 0.89, 0.84), dtype=np.float32)
    for count, share in ((700, 0.50), (3500, 0.42), (16000, 0.30)):
        number, first, second = textures.cells(shape, rng, count)
        size = np.sqrt(shape[0] * shape[1] / count)
        chosen = rng.random(count) < share
        colour = palette[rng.integers(len(palette), size=count)] * rng.uniform(0.85, 1.1, (count, 1))
        chip = chosen[number] & (second - first > 0.16 * size)
        picture[chip] = colour[number][chip]
    ink = textures.fractal_noise(shape, rng, slope=0.7)
    return np.clip(picture * (1 + 0.045 * ink[..., None]), 0, 1)


def _lights() -> dict[str, Any]:
    pose = mi.ScalarTransform4f().look_at(origin=[-0.75, 0.45, 1.0], target=[0, 0, 0], up=[0, 0, 1])
    return {
        "window": {
            "type": "rectangle",
            "to_world": pose @ mi.ScalarTransform4f().scale([0.16, 0.16, 1]),
            "emitter": {"type": "area", "radiance": {"type": "rgb", "value": [42.0, 40.0, 37.0]}},
        },
        "room_light": {"type": "constant", "radiance": {"type": "rgb", "value": [0.2, 0.21, 0.23]}},
    }
