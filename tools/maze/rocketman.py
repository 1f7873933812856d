"""Rocketman: a little man with a big helmet and a rocket pack, and his rivals in other colours."""

from dataclasses import dataclass

from PIL import Image

from .drawing import Sketch, star
from .palette import (
    BLUE,
    BROWN,
    CREAM,
    CRIMSON,
    GREY,
    INK,
    NAVY,
    ORANGE,
    PEACH,
    RED,
    SILVER,
    SKY,
    SLATE,
    WHITE,
    YELLOW,
    Colour,
)

WIDTH, HEIGHT = 111, 123


@dataclass(frozen=True)
class Outfit:
    """The colours of a rocket flyer."""

    suit: Colour = RED
    shade: Colour = CRIMSON
    gloves: Colour = BLUE
    boots: Colour = NAVY
    helmet: Colour = WHITE
    tanks: Colour = SILVER
    noses: Colour = ORANGE
    scarf: Colour = YELLOW
    skin: Colour = PEACH
    moustache: Colour = BROWN


def rocketman(outfit: Outfit = Outfit(), *, mirrored: bool = False, scale: float = 1.0) -> Image.Image:
    """Draw him in flight, waving: RGBA, 111 × 123 at scale 1."""
    sketch = Sketch(WIDTH, HEIGHT, mirrored=mirrored, scale=scale)
    for x in (26.0, 86.0):
        _flame(sketch, x, 93)
        _tank(sketch, x, outfit)
    _scarf(sketch, outfit)
    _legs(sketch, outfit)
    _body(sketch, outfit)
    _arms(sketch, outfit)
    _head(sketch, outfit)
    return sketch.picture()


def _flame(sketch: Sketch, x: float, y: float) -> None:
    for half, length, colour in ((9.5, 29, RED), (7, 21, ORANGE), (4.6, 14, YELLOW), (2.4, 8, CREAM)):
        edge = [(x - half * 0.7, y), (x - half, y + length * 0.3), (x - half * 0.35, y + length * 0.62)]
        tips = [(x, y + length), (x + half * 0.45, y + length * 0.66), (x + half, y + length * 0.32)]
        sketch.blob([*edge, *tips, (x + half * 0.7, y)], colour, outline=1.6 if colour == RED else 0)


def _tank(sketch: Sketch, x: float, outfit: Outfit) -> None:
    sketch.polygon([(x - 5, 84), (x + 5, 84), (x + 8, 94), (x - 8, 94)], SLATE)
    sketch.box(x - 9, 50, x + 9, 86, outfit.tanks)
    sketch.box(x + 3, 51.5, x + 7.6, 84.6, GREY, outline=0)
    sketch.box(x - 6.2, 53, x - 3.4, 82, WHITE, outline=0)
    sketch.box(x - 9, 71, x + 9, 77, outfit.noses, outline=1.6)
    sketch.blob([(x - 9, 51), (x - 7.5, 41), (x, 31), (x + 7.5, 41), (x + 9, 51), (x, 51.5)], outfit.noses)
    sketch.line([(x - 3.6, 46), (x - 2, 40)], WHITE, 1.8)


def _scarf(sketch: Sketch, outfit: Outfit) -> None:
    sketch.blob([(66, 60), (84, 57), (97, 63), (108, 54), (106, 66), (97, 72), (84, 66), (66, 67)], outfit.scarf)
    sketch.line([(82, 61.5), (96, 67.5), (103, 63)], outfit.noses, 1.8)


def _legs(sketch: Sketch, outfit: Outfit) -> None:
    sketch.limb([(49, 88), (46, 98), (47, 107)], outfit.suit, 12)
    sketch.limb([(62, 88), (67, 96), (62, 104)], outfit.shade, 12)
    sketch.blob([(41, 105), (53, 105), (54, 114), (52, 119.5), (35, 119.5), (35, 114), (41, 112)], outfit.boots)
    sketch.blob([(57, 101), (69, 103), (69, 112), (75, 114), (75, 119), (59, 117), (56, 110)], outfit.boots)
    sketch.line([(37, 117), (51, 117)], SKY, 1.6).line([(60, 114.8), (73, 116.6)], SKY, 1.6)


def _body(sketch: Sketch, outfit: Outfit) -> None:
    sketch.blob([(43, 62), (55.5, 58), (68, 62), (70, 76), (67, 91), (55.5, 94), (44, 91), (41, 76)], outfit.suit)
    sketch.blob([(61, 62), (66.5, 64), (68.3, 76), (66, 89.5), (60, 91.5), (63.5, 77)], outfit.shade, outline=0)
    sketch.line([(44, 66), (52, 79), (66, 87)], SLATE, 4.6).line([(67, 66), (59, 79), (45, 87)], SLATE, 4.6)
    sketch.ellipse(55.5, 77, 7, 7, outfit.scarf).polygon(star(55.5, 77.2, 5), outfit.suit, outline=0)


def _arms(sketch: Sketch, outfit: Outfit) -> None:
    sketch.limb([(45, 67), (27, 66), (15.5, 50)], outfit.suit, 11)
    sketch.limb([(16.5, 51), (14, 46)], outfit.scarf, 12.5)
    sketch.ellipse(11, 37, 8, 8, outfit.gloves).ellipse(18.2, 32.5, 3.4, 3.2, outfit.gloves, outline=1.6)
    sketch.line([(6.6, 34.5), (5.8, 39)], SKY, 1.8)
    sketch.limb([(66, 67), (82, 76), (72, 86)], outfit.shade, 11)
    sketch.ellipse(69.5, 87.5, 6.6, 6.2, outfit.gloves)


def _head(sketch: Sketch, outfit: Outfit) -> None:
    sketch.line([(55.5, 13), (57.5, 5)], INK, 3.4).ellipse(57.5, 5, 3.6, 3.6, outfit.noses, outline=1.8)
    sketch.ellipse(55.5, 36, 25, 24.5, outfit.helmet)
    sketch.blob([(68, 17), (77, 26), (78.7, 38), (73, 51), (63, 57.5), (71, 47), (74, 33)], SILVER, outline=0)
    for x in (30.5, 80.5):
        sketch.ellipse(x, 38, 4, 7, outfit.gloves)
    sketch.ellipse(55.5, 38.5, 20.5, 17.5, SKY)
    sketch.blob(
        [(39, 42), (43, 30), (55.5, 26.5), (68, 30), (72, 42), (66, 51.5), (55.5, 54.6), (45, 51.5)], outfit.skin, 0
    )
    _face(sketch, outfit)
    sketch.blob([(39.5, 35), (42.5, 28), (49, 24), (45.5, 30)], WHITE, outline=0)
    sketch.box(35.5, 56.5, 75.5, 63, outfit.scarf)
    sketch.line([(48, 58), (46.5, 61.6)], outfit.noses, 1.6).line([(58, 58), (57, 61.6)], outfit.noses, 1.6)


def _face(sketch: Sketch, outfit: Outfit) -> None:
    for x in (47.5, 63.5):
        sketch.ellipse(x, 37, 4.4, 5.2, WHITE, outline=1.4).ellipse(x + 0.8, 37.8, 2.2, 2.9, INK, outline=0)
        sketch.ellipse(x + 1.5, 36.4, 0.9, 0.9, WHITE, outline=0)
    sketch.line([(43, 30.6), (47, 29), (50.5, 30.4)], outfit.moustache, 2.2)
    sketch.line([(60.5, 30.4), (64, 29), (68, 30.6)], outfit.moustache, 2.2)
    sketch.blob([(50, 49.4), (55.5, 51), (61, 49.4), (58.5, 53), (55.5, 53.8), (52.5, 53)], CRIMSON, outline=0)
    left = [(55.5, 44.4), (50, 44), (45, 47.5), (42, 45.8), (45, 50.4), (51, 50.2), (55.5, 48)]
    sketch.blob([*left, *((111 - x, y) for x, y in left[:0:-1])], outfit.moustache, outline=0)
    sketch.ellipse(55.5, 43, 3.6, 3.2, ORANGE if outfit.skin == PEACH else outfit.skin, outline=1.2)
