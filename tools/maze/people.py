"""The crowd: visitors, robots, green guests from elsewhere, and flyers who are not Rocketman."""

from PIL import Image

from .drawing import Sketch, star
from .palette import (
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
    pick,
)
from .rocketman import Outfit, rocketman

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
