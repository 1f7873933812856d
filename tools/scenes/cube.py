"""A scrambled puzzle cube on a wooden table, a brick behind it and wallpaper at the back."""

from typing import Any

import mitsuba as mi
import numpy as np

from . import textures
from .rendering import StereoCamera, StereoScene
from .shapes import Mesh, box, join, plane, revolved, rotation, tube
from .surfaces import glossy, matte, metal

CUBIE = 0.019
Cubie = tuple[np.ndarray, np.ndarray, list[tuple[int, int, textures.Rgb]]]
STICKER_COLOURS = {
    (0, 1): (0.78, 0.09, 0.08),
    (0, -1): (0.95, 0.42, 0.05),
    (1, 1): (0.05, 0.23, 0.66),
    (1, -1): (0.05, 0.55, 0.20),
    (2, 1): (0.92, 0.92, 0.90),
    (2, -1): (0.96, 0.80, 0.06),
}


def build() -> StereoScene:
    rng = np.random.default_rng(31)
    objects = {
        **_room(rng),
        **_puzzle(rng),
        **_brick(rng),
        **_pencil_and_coin(rng),
        **_lights(),
    }
    camera = StereoCamera(
        width=640,
        height=480,
        focal_px=900.0,
        baseline_m=0.017,
        position=(0.0, -0.325, 0.172),
        target=(0.014, 0.0, 0.038),
    )
    return StereoScene(
        title="Puzzle cube",
        description="A scrambled puzzle cube on a wooden table, with a brick and a papered wall behind it.",
        camera=camera,
        objects=objects,
        exposure=1.15,
        max_depth=7,
    )


def _room(rng: np.random.Generator) -> dict[str, mi.Mesh]:
    table = textures.planks((2048, 2048), rng, (0.76, 0.55, 0.34), (0.40, 0.23, 0.12), count=6)
    stamp = rng.random((24, 24)) < 0.5
    motif = np.kron(stamp | stamp[:, ::-1], np.ones((20, 20)))
    paper = textures.mottle(motif.shape, rng, (0.66, 0.70, 0.64), (0.80, 0.82, 0.74))
    paper = np.where(motif[..., None] > 0, paper * np.array([0.80, 0.90, 0.88]), paper)
    return {
        "table": plane((-0.75, -0.75, 0), (1.5, 0, 0), (0, 1.5, 0)).turned(62.0).shape(glossy(table, 0.3)),
        "wall": plane((-1.5, 0.50, -0.5), (3, 0, 0), (0, 0, 2), tile=0.22).shape(matte(paper)),
    }


def _puzzle(rng: np.random.Generator) -> dict[str, mi.Mesh]:
    """Return the cube, its upper layer turned by a few degrees as if put down mid-game."""
    body = box((CUBIE * 0.985,) * 3, radius=0.0017)
    bodies: list[Mesh] = []
    stickers: dict[tuple[float, float, float], list[Mesh]] = {}
    for place, turn, faces in _scramble(rng, moves=25):
        bodies.append(_seat(body, place))
        for axis, sign, colour in faces:
            sticker = _seat(_sticker(axis, sign), place, turn)
            stickers.setdefault(colour, []).append(sticker)
    shapes = {"cubies": join(bodies).shape(glossy((0.03, 0.03, 0.033), 0.22))}
    for number, (colour, meshes) in enumerate(stickers.items()):
        worn = textures.fractal_noise((256, 256), rng, slope=1.1)
        paint = np.asarray(colour) * (1 + 0.02 * worn[..., None])
        shapes[f"sticker_{number}"] = join(meshes).shape(glossy(paint, 0.16))
    return shapes


def _scramble(rng: np.random.Generator, moves: int) -> list[Cubie]:
    """Return the 26 cubies after random turns of outer layers, each with its place, orientation and stickers."""
    cubies: list[Cubie] = []
    for corner in np.ndindex(3, 3, 3):
        place = np.array(corner) - 1
        stickers = [(axis, sign, colour) for (axis, sign), colour in STICKER_COLOURS.items() if place[axis] == sign]
        cubies.append((place, np.eye(3), stickers))
    for _ in range(moves):
        axis, layer = int(rng.integers(3)), rng.choice([-1, 1])
        turn = rotation(90.0 * rng.integers(1, 4), axis)
        cubies = [
            (turn @ place, turn @ pose, stickers) if round(place[axis]) == layer else (place, pose, stickers)
            for place, pose, stickers in cubies
        ]
    return cubies


def _sticker(axis: int, sign: int) -> Mesh:
    size = np.full(3, CUBIE * 0.84)
    size[axis] = 0.0008
    offset = np.zeros(3)
    offset[axis] = sign * CUBIE * 0.497
    return box(size, radius=0.00038, steps=3).moved(offset)


def _seat(mesh: Mesh, place: np.ndarray, turn: np.ndarray | None = None) -> Mesh:
    vertices = mesh.vertices if turn is None else mesh.vertices @ turn.T
    seated = Mesh(vertices, mesh.faces, mesh.uv).moved(np.asarray(place) * CUBIE)
    if round(float(place[2])) == 1:
        seated = seated.turned(14.0)
    return seated.turned(33.0).moved((-0.012, 0.0, 1.5 * CUBIE))


def _brick(rng: np.random.Generator) -> dict[str, mi.Mesh]:
    shape = (768, 1536)
    clay = textures.mottle(shape, rng, (0.42, 0.17, 0.11), (0.64, 0.31, 0.21), (0.74, 0.46, 0.34))
    grain = textures.fractal_noise(shape, rng, slope=0.35, finest=3)
    pits = textures.fractal_noise(shape, rng, slope=0.6, finest=5, coarsest=40) > 2.0
    clay = clay * (1 + 0.12 * grain[..., None]) * np.where(pits, 0.5, 1.0)[..., None]
    brick = box((0.21, 0.062, 0.10), radius=0.004)
    return {"brick": brick.turned(-9.0).moved((0.075, 0.155, 0.05)).shape(matte(clay))}


def _pencil_and_coin(rng: np.random.Generator) -> dict[str, mi.Mesh]:
    start, tip = np.array([0.062, -0.055, 0.0036]), np.array([0.125, 0.035, 0.0036])
    along = np.array([[0.0], [0.002], [0.44], [0.88]])
    shaft = tube(start + (tip - start) * along, np.array([0.0, 0.0036, 0.0036, 0.0036]), sides=6)
    cone = tube(start + (tip - start) * np.array([[0.88], [0.97], [1.0]]), np.array([0.0036, 0.001, 0.0004]))
    wood = textures.wood((256, 256), rng, (0.85, 0.68, 0.46), (0.66, 0.46, 0.27))
    coin = revolved(np.array([[0, 0], [0.011, 0], [0.0117, 0.0006], [0.0117, 0.0015], [0.0109, 0.002], [0, 0.0017]]))
    return {
        "pencil": shaft.shape(glossy((0.85, 0.55, 0.05), 0.12)),
        "pencil_tip": cone.shape(matte(wood)),
        "coin": coin.turned(-90, 1).moved((-0.083, -0.035, 0.0)).shape(metal((0.95, 0.72, 0.40), 0.22)),
    }


def _lights() -> dict[str, Any]:
    def softbox(origin: list[float], size: float, radiance: list[float]) -> dict[str, Any]:
        pose = mi.ScalarTransform4f().look_at(origin=origin, target=[0, 0, 0], up=[0, 0.1, 1])
        return {
            "type": "rectangle",
            "to_world": pose @ mi.ScalarTransform4f().scale([size, size, 1]),
            "emitter": {"type": "area", "radiance": {"type": "rgb", "value": radiance}},
        }

    return {
        "window": softbox([-0.9, -0.5, 1.0], 0.22, [30, 29, 27]),
        "lamp": softbox([0.9, -0.9, 0.9], 0.25, [4.0, 4.2, 5.0]),
        "room_light": {"type": "constant", "radiance": {"type": "rgb", "value": [0.38, 0.38, 0.40]}},
    }
