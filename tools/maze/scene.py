"""A whole picture: ground, walls and crowd, drawn from back to front."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from . import labyrinth, people, things
from .labyrinth import BLOCK, CELL, Theme
from .palette import Rng

COLUMNS, ROWS = 2446, 1526

Figures = tuple[tuple[Callable[[Rng], Image.Image], int], ...]

WALKING: Figures = ((people.visitor, 13), (people.robot, 3), (people.guest, 3), (people.dog, 2))
STANDING: Figures = ((things.crate, 2), (things.sign, 2), (things.tree, 3), (things.flag, 1))
FLOATING: Figures = ((things.rocket, 3), (things.planet, 2), (things.saucer, 2), (things.balloon, 4))
FLYING: Figures = ((people.rival, 1),)


@dataclass(frozen=True)
class Item:
    """A picture at a position; items whose feet are further down are drawn later."""

    depth: float
    left: int
    top: int
    picture: Image.Image

    def draw_on(self, canvas: Image.Image) -> None:
        """Draw the part that falls on the canvas."""
        cut = max(-self.left, 0), max(-self.top, 0)
        canvas.alpha_composite(self.picture.crop((*cut, *self.picture.size)), (max(self.left, 0), max(self.top, 0)))

    def shadow(self) -> "Item":
        """Return the shadow at its feet."""
        width = round(self.picture.width * 0.8)
        sheet = things.shade(width, round(width * 0.34))
        left = self.left + (self.picture.width - width) // 2
        return Item(self.depth, left, round(self.depth - 0.62 * sheet.height), sheet)


def compose(theme: Theme, rng: Rng) -> Image.Image:
    """Draw a labyrinth and its crowd."""
    walls = labyrinth.carve(ROWS // (BLOCK * CELL), COLUMNS // (BLOCK * CELL), rng)
    picture = labyrinth.paint_ground(COLUMNS, ROWS, theme, rng)
    blocks = [Item(*block) for block in labyrinth.wall_blocks(walls, theme, rng)]
    figures = [
        _standing(45, 150, things.sign(rng, "START")),
        _standing(COLUMNS - 45, ROWS - 20, things.sign(rng, "FINISH")),
    ]
    figures += _crowd(walls, [(item.left + item.picture.width / 2, item.depth) for item in figures], rng)
    for item in figures:
        item.shadow().draw_on(picture)
    for item in sorted([*blocks, *figures], key=lambda item: item.depth):
        item.draw_on(picture)
    return picture.convert("RGB")


def _standing(x: float, y: float, picture: Image.Image, lift: float = 0.0) -> Item:
    return Item(y, round(x - picture.width / 2), round(y - picture.height - lift), picture)


def _crowd(walls: NDArray[np.bool_], taken: list[tuple[float, float]], rng: Rng) -> list[Item]:
    """Fill the corridors with figures far enough apart to stay visible, and let some fly over the walls."""
    items, places = [], np.array(taken)
    for _ in range(9000):
        place = rng.uniform((15, 40), (COLUMNS - 15, ROWS + 20))
        col, row = (place / BLOCK).astype(int)
        on_wall = bool(walls[row - 1 : row + 1, max(col - 1, 0) : col + 2].any())
        apart = (places - place) / (1.0, 0.85)
        if (np.hypot(*apart.T) < 46).any() or (on_wall and rng.random() > 0.04):
            continue
        places = np.vstack([places, place])
        items.append(_figure(float(place[0]), float(place[1]), on_wall, rng))
    return items


def _figure(x: float, y: float, on_wall: bool, rng: Rng) -> Item:
    kind = rng.random()
    if on_wall or kind < 0.17:
        return _standing(x, y, _draw_one(FLOATING, rng), lift=14)
    if kind < 0.23:
        return _standing(x, y, _draw_one(FLYING, rng), lift=8)
    return _standing(x, y, _draw_one(WALKING if kind < 0.8 else STANDING, rng))


def _draw_one(figures: Figures, rng: Rng) -> Image.Image:
    weights = np.array([weight for _, weight in figures], float)
    figure, _ = figures[rng.choice(len(figures), p=weights / weights.sum())]
    return figure(rng)
