"""The labyrinth, and what stands in it."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from . import people, things
from .drawing import INK, Colour, Rng, Sketch, mix

BLOCK = 24
CELL = 7
WALL_HEIGHT = 22


@dataclass(frozen=True)
class Theme:
    """The colours of a labyrinth's ground and walls."""

    ground: Colour
    paving: Colour
    wall_top: Colour
    wall_leaf: Colour
    wall_front: Colour
    hedge: bool


def carve(rows: int, cols: int, rng: Rng) -> NDArray[np.bool_]:
    """Carve a maze into blocks, True where a wall stands.

    A depth-first walk visits every cell of ``CELL`` blocks; a tenth of the remaining walls are opened too, so that
    there are loops to get lost in.
    """
    walls = np.ones((rows * CELL + 1, cols * CELL + 1), bool)
    seen = np.zeros((rows, cols), bool)
    path = [(0, 0)]
    seen[0, 0] = True
    while path:
        row, col = path[-1]
        _open_cell(walls, row, col)
        around = [(row + 1, col), (row - 1, col), (row, col + 1), (row, col - 1)]
        free = [(r, c) for r, c in around if 0 <= r < rows and 0 <= c < cols and not seen[r, c]]
        if not free:
            path.pop()
            continue
        step = free[rng.integers(len(free))]
        _open_between(walls, (row, col), step)
        seen[step] = True
        path.append(step)
    for row in range(rows - 1):
        for col in range(cols - 1):
            if rng.random() < 0.1:
                _open_between(walls, (row, col), (row + 1, col) if rng.random() < 0.5 else (row, col + 1))
    walls[1:CELL, 0] = False
    walls[-CELL:-1, -1] = False
    return walls


def _open_cell(walls: NDArray[np.bool_], row: int, col: int) -> None:
    walls[row * CELL + 1 : (row + 1) * CELL, col * CELL + 1 : (col + 1) * CELL] = False


def _open_between(walls: NDArray[np.bool_], cell: tuple[int, int], other: tuple[int, int]) -> None:
    (top, left), (bottom, right) = sorted((cell, other))
    rows = slice(top * CELL + 1, (bottom + 1) * CELL)
    walls[rows, left * CELL + 1 : (right + 1) * CELL] = False


def paint_ground(width: int, height: int, theme: Theme, rng: Rng) -> Image.Image:
    """Paint paving stones, tufts and pebbles."""
    sketch = Sketch(width, height)
    sketch.box(0, 0, width, height, theme.ground, outline=0)
    for _ in range(width * height // 3400):
        x, y = rng.uniform(0, width), rng.uniform(0, height)
        if rng.random() < 0.55:
            sketch.ellipse(x, y, rng.uniform(7, 22), rng.uniform(4, 9), theme.paving, outline=0)
        elif rng.random() < 0.6:
            for lean in (-4, 0, 4):
                sketch.line([(x, y), (x + lean, y - 8)], theme.wall_leaf, 1.8)
        else:
            sketch.ellipse(x, y, 4.5, 3, mix(theme.paving, INK, 0.12), outline=1.2)
    return sketch.picture()


def wall_blocks(walls: NDArray[np.bool_], theme: Theme, rng: Rng) -> list[tuple[int, int, int, Image.Image]]:
    """Draw every block of the walls: (depth, left, top, picture), where depth is the foot of the block."""
    blocks = []
    for row, col in np.argwhere(walls):
        north, south = row > 0 and walls[row - 1, col], row + 1 < walls.shape[0] and walls[row + 1, col]
        west, east = col > 0 and walls[row, col - 1], col + 1 < walls.shape[1] and walls[row, col + 1]
        picture = _block(theme, rng, not north, not south, not west, not east)
        foot = (int(row) + 1) * BLOCK
        blocks.append((foot, int(col) * BLOCK, foot - BLOCK - WALL_HEIGHT, picture))
    return blocks


def _block(theme: Theme, rng: Rng, north: bool, south: bool, west: bool, east: bool) -> Image.Image:
    """Draw one block; each flag says that the side is a free edge, which gets an outline."""
    size, front = BLOCK, BLOCK + WALL_HEIGHT
    sketch = Sketch(size, front)
    sketch.box(0, 0, size, size, theme.wall_top, outline=0)
    if theme.hedge:
        for _ in range(5):
            x, y = rng.uniform(3, size - 3, 2)
            sketch.line([(x - 3, y + 1), (x, y - 2), (x + 3, y + 1)], theme.wall_leaf, 2)
    else:
        sketch.line([(size / 2, 0), (size / 2, size)], theme.wall_leaf, 1.6)
        sketch.line([(0, size / 2), (size, size / 2)], theme.wall_leaf, 1.6)
    if south:
        _front(sketch, theme, rng)
    edges = {
        (0, 1, size, 1): north,
        (0, size, size, size): south,
        (0, front - 1, size, front - 1): south,
        (1, 0, 1, front if south else size): west,
        (size - 1, 0, size - 1, front if south else size): east,
    }
    for (x0, y0, x1, y1), drawn in edges.items():
        if drawn:
            sketch.line([(x0, y0), (x1, y1)])
    return sketch.picture()


def _front(sketch: Sketch, theme: Theme, rng: Rng) -> None:
    top, bottom = BLOCK, BLOCK + WALL_HEIGHT
    sketch.box(0, top, BLOCK, bottom, theme.wall_front, outline=0)
    shade = mix(theme.wall_front, INK, 0.25)
    if theme.hedge:
        for _ in range(4):
            x, y = rng.uniform(3, BLOCK - 3), rng.uniform(top + 4, bottom - 3)
            sketch.line([(x - 3, y + 1), (x, y - 2), (x + 3, y + 1)], shade, 2)
    else:
        middle = (top + bottom) / 2
        sketch.line([(0, middle), (BLOCK, middle)], shade, 1.6)
        sketch.line([(BLOCK / 2, top), (BLOCK / 2, middle)], shade, 1.6).line([(0, middle), (0, bottom)], shade, 1.6)


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
    walls = carve(ROWS // (BLOCK * CELL), COLUMNS // (BLOCK * CELL), rng)
    picture = paint_ground(COLUMNS, ROWS, theme, rng)
    blocks = [Item(*block) for block in wall_blocks(walls, theme, rng)]
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
