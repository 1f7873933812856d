"""Write Rocketman, both mazes and their ground truth to ``assets/maze``: ``python -m tools.maze``."""

import json
from pathlib import Path

import numpy as np
from PIL import Image

from . import things
from .drawing import CREAM, DUNE, DUST, FOREST, GREEN, GREY, LIME, MOON, SAND, SLATE, VIOLET, mix, raise_dust, snap
from .people import HEIGHT, WIDTH, rocketman
from .scene import COLUMNS, ROWS, Item, Theme, compose

MAZE = Path(__file__).parents[2] / "assets" / "maze"

GARDEN = Theme(SAND, DUNE, GREEN, LIME, FOREST, hedge=True)
MOON_BASE = Theme(MOON, DUST, GREY, SLATE, VIOLET, hedge=False)

PLACE = (528, 982)
DULLED_PLACE = (1048, 1707)


def make_template() -> Image.Image:
    """Draw Rocketman in the palette's colours; every pixel is either opaque or fully transparent."""
    pixels = np.array(rocketman())
    pixels[..., :3] = snap(pixels[..., :3])
    pixels[..., 3] = np.where(pixels[..., 3] >= 128, 255, 0)
    pixels[pixels[..., 3] == 0] = 0
    return Image.fromarray(pixels)


def make_maze(template: Image.Image) -> Image.Image:
    """Draw the garden maze, with Rocketman exactly as in the template."""
    picture = Image.fromarray(snap(np.array(compose(GARDEN, np.random.default_rng(528_982)))))
    row, col = PLACE
    picture.paste(template, (col, row), template)
    return picture


def make_dulled_maze(template: Image.Image) -> Image.Image:
    """Draw the maze on the moon: a boulder and a balloon half hide Rocketman, and dust lies over everything."""
    rng = np.random.default_rng(1_048_170)
    picture = Image.fromarray(snap(np.array(compose(MOON_BASE, rng)))).convert("RGBA")
    row, col = DULLED_PLACE
    picture.alpha_composite(template, (col, row))
    for item in covers(row, col):
        item.draw_on(picture)
    pixels = np.array(picture.convert("RGB"))
    clouds = [
        (row + HEIGHT / 2, col + WIDTH / 2),
        *zip(rng.uniform(80, ROWS - 80, 6), (np.arange(6) + rng.random(6)) * COLUMNS / 6, strict=True),
    ]
    for cloud_row, cloud_col in clouds:
        pixels = raise_dust(pixels, cloud_row, cloud_col, rng.uniform(150, 175), mix(DUST, CREAM, 0.3), rng)
    return Image.fromarray(pixels)


def covers(row: int, col: int) -> list[Item]:
    """Draw the objects in front of Rocketman."""
    rng = np.random.default_rng(3)
    return [
        Item(0, col - 12, row + 77, things.boulder(85, 66)),
        Item(0, col + 80, row + 18, things.balloon(rng)),
    ]


def main() -> None:
    MAZE.mkdir(parents=True, exist_ok=True)
    template = make_template()
    template.save(MAZE / "rocketman.png", optimize=True)
    make_maze(template).save(MAZE / "maze.png", optimize=True)
    make_dulled_maze(template).save(MAZE / "maze_dulled.png", optimize=True)
    mazes = [
        {
            "name": "maze",
            "title": "Garden maze",
            "description": "Rocketman hovers somewhere in a hedge maze full of visitors who wear his colours.",
            "picture": "maze.png",
            "template": "rocketman.png",
            "row": PLACE[0],
            "col": PLACE[1],
        },
        {
            "name": "maze_dulled",
            "title": "Moon dust",
            "description": "Dust has dulled his colours and made him grainy, and nearly a quarter of him is hidden: "
            "not one of his pixels is left as it was.",
            "picture": "maze_dulled.png",
            "template": "rocketman.png",
            "row": DULLED_PLACE[0],
            "col": DULLED_PLACE[1],
        },
    ]
    (MAZE / "mazes.json").write_text(json.dumps(mazes, indent=2) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
