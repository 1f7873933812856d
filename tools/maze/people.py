"""Rocketman and the people around him."""

from dataclasses import dataclass

from PIL import Image

from .drawing import (
    BLUE,
    BROWN,
    CLOTHES,
    CREAM,
    CRIMSON,
    GREEN,
    GREY,
    INK,
    LIME,
    NAVY,
    ORANGE,
    PEACH,
    PINK,
    PURPLE,
    RED,
    SILVER,
    SKINS,
    SKY,
    SLATE,
    TAN,
    TEAL,
    WHITE,
    YELLOW,
    Colour,
    Rng,
    Sketch,
    pick,
    star,
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


HAIR = (BROWN, INK, ORANGE, YELLOW, CRIMSON, GREY)
RIVALS = (
    Outfit(BLUE, NAVY, RED, CRIMSON, YELLOW, GREY, RED, WHITE, TAN, INK),
    Outfit(WHITE, SILVER, ORANGE, CRIMSON, RED, GREY, NAVY, BLUE, BROWN, INK),
    Outfit(YELLOW, ORANGE, NAVY, BROWN, BLUE, SILVER, RED, CRIMSON, PEACH, ORANGE),
    Outfit(TEAL, NAVY, YELLOW, BROWN, ORANGE, SLATE, YELLOW, RED, PEACH, CRIMSON),
    Outfit(NAVY, INK, YELLOW, RED, SKY, RED, WHITE, ORANGE, TAN, BROWN),
)


def visitor(rng: Rng) -> Image.Image:
    """Draw a walker in one of five hats and in Rocketman's colours."""
    sketch = Sketch(76, 112, scale=rng.uniform(0.72, 0.92), mirrored=rng.random() < 0.5)
    shirt, trousers, skin, shoes = (pick(rng, kind) for kind in (CLOTHES, CLOTHES, SKINS, (NAVY, BROWN, CRIMSON)))
    stride = rng.uniform(2, 9)
    for side in (-1, 1):
        sketch.limb(
            [(38 + 6 * side, 78), (38 + (6 + stride / 2) * side, 92), (38 + (5 + stride) * side, 102)], trousers, 11
        )
        sketch.ellipse(41 + (5 + stride) * side, 105, 8.5, 4.6, shoes)
    sketch.blob([(26, 56), (38, 53), (50, 56), (53, 82), (38, 86), (23, 82)], shirt)
    _print(sketch, shirt, rng)
    for side in (-1, 1):
        _arm(sketch, side, shirt, skin, rng)
    _person_head(sketch, skin, rng)
    return sketch.picture()


def _print(sketch: Sketch, shirt: Colour, rng: Rng) -> None:
    colour = pick(rng, tuple(paint for paint in (WHITE, YELLOW, RED, BLUE, ORANGE) if paint != shirt))
    match rng.integers(4):
        case 0:
            for y in (62, 70, 78):
                sketch.line([(26.5, y), (38, y + 1.5), (49.5, y)], colour, 3.6)
        case 1:
            sketch.polygon(star(38, 69, 8), colour, outline=1.4)
        case 2:
            sketch.ellipse(38, 69, 6, 6, colour, outline=1.6)
        case _:
            sketch.line([(30, 56), (38, 66), (46, 56)], colour, 3.4)


def _arm(sketch: Sketch, side: int, shirt: Colour, skin: Colour, rng: Rng) -> None:
    shoulder = 38 + 12 * side
    poses = ([(9, 12), (8, 24)], [(11, 6), (15, -8)], [(11, 9), (3, 17)], [(12, 2), (18, -2)])
    elbow, hand = poses[rng.integers(len(poses))]
    points = [(shoulder, 60), (shoulder + elbow[0] * side, 60 + elbow[1]), (shoulder + hand[0] * side, 60 + hand[1])]
    sketch.limb(points, shirt, 9.5).ellipse(*points[-1], 5.2, 5.2, skin)


def _person_head(sketch: Sketch, skin: Colour, rng: Rng) -> None:
    hair, hat = pick(rng, HAIR), pick(rng, CLOTHES)
    style = rng.integers(6)
    if style == 0:
        sketch.blob([(19, 34), (22, 14), (38, 6), (54, 14), (57, 34), (53, 54), (38, 50), (23, 54)], hair)
    sketch.ellipse(38, 35, 18.5, 19, skin)
    for x in (31, 45):
        sketch.ellipse(x, 35, 4, 4.6, WHITE, outline=1.4).ellipse(x + 1, 35.6, 2, 2.6, INK, outline=0)
    sketch.ellipse(38.5, 41, 3.2, 2.7, skin, outline=1.3)
    sketch.line([(31, 46), (38, 50), (45, 46)], CRIMSON, 2.2)
    if rng.random() < 0.3:
        sketch.blob([(28, 44), (34, 42), (38, 43.5), (42, 42), (48, 44), (43, 47.5), (38, 46), (33, 47.5)], hair, 0)
    match style:
        case 0 | 1:
            sketch.blob([(19, 31), (21, 18), (38, 11), (55, 18), (57, 31), (46, 22), (34, 25)], hair)
        case 2:
            sketch.blob([(19.5, 27), (23, 12), (38, 8), (53, 12), (56.5, 27), (38, 24)], hat)
            sketch.blob([(38, 25), (57, 24), (66, 28), (54, 30)], hat)
        case 3:
            sketch.blob([(20, 27), (24, 14), (38, 8), (52, 14), (56, 27), (38, 22)], hat)
            sketch.blob([(18, 24), (38, 19), (58, 24), (57, 30), (38, 25.5), (19, 30)], WHITE)
            sketch.ellipse(38, 7, 5.5, 5.5, WHITE)
        case 4:
            sketch.polygon([(25, 22), (27, 2), (49, 2), (51, 22)], hat).box(26, 14.5, 50.4, 20, YELLOW, 1.6)
            sketch.ellipse(38, 22, 21, 4, hat)
        case _:
            sketch.ellipse(38, 33, 23, 23.5, hat).ellipse(38, 35.5, 17, 15.5, SKY)
            sketch.blob([(24, 38), (27, 29), (38, 26), (49, 29), (52, 38), (47, 46), (38, 49), (29, 46)], skin, 0)
            for x in (32, 45):
                sketch.ellipse(x, 36, 2.2, 3.2, INK, outline=0)
            sketch.line([(33, 43), (38, 45.5), (43, 43)], CRIMSON, 2)


def robot(rng: Rng) -> Image.Image:
    """Draw a tin robot."""
    sketch = Sketch(84, 108, scale=rng.uniform(0.75, 0.95), mirrored=rng.random() < 0.5)
    metal, trim = pick(rng, (SILVER, GREY, SKY, YELLOW, ORANGE)), pick(rng, (RED, BLUE, ORANGE, TEAL, PURPLE))
    for x in (32, 52):
        sketch.limb([(x, 78), (x, 96)], SLATE, 9).blob([(x - 11, 104), (x - 8, 95), (x + 8, 95), (x + 11, 104)], trim)
    for side in (-1, 1):
        raised = rng.uniform(-22, 18)
        sketch.limb([(42 + 22 * side, 58), (42 + 31 * side, 62), (42 + 34 * side, 62 + raised)], SLATE, 8)
        sketch.ellipse(42 + 34 * side, 62 + raised, 6, 6, trim)
    sketch.box(21, 48, 63, 84, metal).box(27, 54, 49, 70, NAVY, 1.6)
    sketch.line([(30, 63), (34, 58), (38, 66), (46, 60)], LIME, 2)
    for y, colour in ((56, RED), (63, YELLOW), (70, BLUE)):
        sketch.ellipse(56, y, 2.6, 2.6, colour, outline=1.2)
    sketch.line([(29, 77), (55, 77)], trim, 4)
    sketch.line([(42, 14), (42, 6)], INK, 2.6).ellipse(42, 6, 4, 4, trim)
    sketch.blob([(22, 20), (42, 12), (62, 20), (64, 34), (60, 45), (42, 47), (24, 45), (20, 34)], metal)
    for x in (33, 51):
        sketch.ellipse(x, 29, 7, 7, CREAM).ellipse(x + 1, 30, 3, 3, INK, outline=0)
    sketch.line([(33, 40), (51, 40)], INK, 2.4)
    return sketch.picture()


def guest(rng: Rng) -> Image.Image:
    """Draw a guest from another planet."""
    sketch = Sketch(80, 96, scale=rng.uniform(0.72, 0.95), mirrored=rng.random() < 0.5)
    skin, suit = pick(rng, (LIME, GREEN, TEAL, PINK, PURPLE)), pick(rng, (RED, BLUE, ORANGE, YELLOW, WHITE))
    for side in (-1, 1):
        sketch.limb([(40 + 8 * side, 74), (40 + 10 * side, 88)], skin, 9)
        sketch.limb([(40 + 14 * side, 62), (40 + 26 * side, 64), (40 + 29 * side, 50)], skin, 7.5)
        sketch.line([(40 + 9 * side, 18), (40 + 13 * side, 7)], INK, 2.6).ellipse(40 + 14 * side, 6, 4.4, 4.4, suit)
    sketch.blob([(26, 60), (40, 54), (54, 60), (55, 78), (40, 84), (25, 78)], suit)
    sketch.blob([(10, 32), (20, 16), (40, 11), (60, 16), (70, 32), (58, 52), (40, 60), (22, 52)], skin)
    eyes = ((40, 33),) if rng.random() < 0.4 else ((28, 33), (52, 33))
    for x, y in eyes:
        sketch.ellipse(x, y, 9, 10, WHITE, outline=1.8).ellipse(x + 2, y + 1, 4.4, 5.4, INK, outline=0)
        sketch.ellipse(x + 3.6, y - 1.5, 1.5, 1.5, WHITE, outline=0)
    sketch.line([(31, 48), (40, 52), (49, 48)], CRIMSON, 2.6)
    return sketch.picture()


def rival(rng: Rng) -> Image.Image:
    """Draw a rocket flyer of Rocketman's build in the wrong colours, or in his own but mirrored."""
    if rng.random() < 0.25:
        return rocketman(mirrored=True, scale=rng.uniform(0.82, 0.96))
    outfit = RIVALS[rng.integers(len(RIVALS))]
    return rocketman(outfit, mirrored=rng.random() < 0.6, scale=rng.uniform(0.82, 0.96))


def dog(rng: Rng) -> Image.Image:
    """Draw a dog with a scarf."""
    sketch = Sketch(80, 62, scale=rng.uniform(0.7, 0.9), mirrored=rng.random() < 0.5)
    coat, ears, scarf = (
        pick(rng, (TAN, WHITE, BROWN, GREY, CREAM)),
        pick(rng, (BROWN, SLATE, ORANGE)),
        pick(rng, CLOTHES),
    )
    sketch.limb([(16, 36), (8, 28), (7, 18)], coat, 6.5)
    for x in (20, 29, 44, 52):
        sketch.limb([(x, 42), (x, 56)], coat, 7.5)
    sketch.blob([(12, 36), (22, 29), (46, 30), (57, 36), (54, 48), (34, 49), (15, 47)], coat)
    sketch.ellipse(28, 36, 6, 4.5, ears, outline=0)
    sketch.limb([(48, 33), (60, 37)], scarf, 7)
    sketch.blob([(46, 16), (58, 10), (68, 16), (77, 24), (74, 31), (60, 33), (48, 30)], coat)
    sketch.blob([(47, 14), (54, 13), (53, 26), (47, 31), (42, 24)], ears)
    sketch.ellipse(62, 20, 2.2, 2.8, INK, outline=0).ellipse(75, 24, 3.4, 2.8, INK, outline=0)
    return sketch.picture()
