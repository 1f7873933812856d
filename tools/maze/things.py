"""Objects in and above the maze: rockets, planets, saucers, balloons, signs, trees, crates."""

from PIL import Image

from .drawing import (
    BLUE,
    BROWN,
    CLOTHES,
    CREAM,
    CRIMSON,
    DUST,
    FOREST,
    GREEN,
    GREY,
    INK,
    LIME,
    NAVY,
    ORANGE,
    PINK,
    PURPLE,
    RED,
    SILVER,
    SKY,
    SLATE,
    TAN,
    TEAL,
    WHITE,
    YELLOW,
    Rng,
    Sketch,
    pick,
    star,
)

BRIGHT = (RED, BLUE, ORANGE, YELLOW, TEAL, PURPLE, PINK, GREEN, SKY)
WORDS = ("FUEL", "EXIT?", "MARS", "HOME", "NO!", "UP", "WALLS", "LOST?", "TEA", "WOW", "ZOOM", "MOON")


def rocket(rng: Rng) -> Image.Image:
    """Draw a rocket in flight."""
    sketch = Sketch(70, 124, scale=rng.uniform(0.6, 0.95), turn=rng.uniform(-24, 24))
    hull, trim = pick(rng, (WHITE, SILVER, YELLOW, SKY, RED)), pick(rng, (RED, BLUE, ORANGE, NAVY, TEAL))
    for half, length, colour in ((9, 30, RED), (6.5, 21, ORANGE), (4, 13, YELLOW)):
        sketch.blob(
            [
                (35 - half, 86),
                (35 - half / 2, 86 + length * 0.6),
                (35, 86 + length),
                (35 + half / 2, 86 + length * 0.6),
                (35 + half, 86),
            ],
            colour,
            1.6 if colour == RED else 0,
        )
    for side in (-1, 1):
        sketch.blob([(35 + 14 * side, 58), (35 + 24 * side, 74), (35 + 25 * side, 90), (35 + 14 * side, 82)], trim)
    sketch.polygon([(28, 82), (42, 82), (45, 89), (25, 89)], SLATE)
    sketch.blob([(35, 6), (47, 24), (51, 48), (46, 82), (24, 82), (19, 48), (23, 24)], hull)
    sketch.blob([(35, 6), (45, 20), (46, 27), (35, 29.5), (24, 27), (25, 20)], trim)
    sketch.ellipse(35, 44, 8.5, 8.5, SILVER).ellipse(35, 44, 5.6, 5.6, SKY, outline=1.6)
    sketch.line([(32, 43), (34, 40.6)], WHITE, 1.8)
    sketch.line([(24, 70), (35, 72.5), (46, 70)], trim, 4)
    return sketch.picture()


def planet(rng: Rng) -> Image.Image:
    """Draw a planet with bands or craters, sometimes ringed."""
    sketch = Sketch(110, 80, scale=rng.uniform(0.55, 0.95), turn=rng.uniform(-25, 25), mirrored=rng.random() < 0.5)
    body, other = pick(rng, BRIGHT), pick(rng, BRIGHT)
    sketch.ellipse(55, 40, 29, 29, body)
    if rng.random() < 0.5:
        for y, half in ((28, 23), (40, 26.5), (51, 24)):
            sketch.line([(55 - half, y), (55, y + 3), (55 + half, y)], other, 4.4)
    else:
        for x, y, r in ((44, 30, 6), (62, 24, 4), (66, 44, 7.5), (48, 52, 5)):
            sketch.ellipse(x, y, r, r * 0.85, other, outline=1.4)
    sketch.line([(35, 27), (41, 19.5)], WHITE, 3)
    if rng.random() < 0.65:
        band = [(30, 34), (10, 46), (20, 56), (55, 54), (92, 38), (101, 26), (82, 26)]
        sketch.line(band, INK, 8).line(band, pick(rng, (YELLOW, CREAM, ORANGE, WHITE)), 4)
    return sketch.picture()


def saucer(rng: Rng) -> Image.Image:
    """Draw a flying saucer and its pilot."""
    sketch = Sketch(110, 66, scale=rng.uniform(0.65, 0.95), turn=rng.uniform(-14, 14))
    hull = pick(rng, (SILVER, PURPLE, TEAL, ORANGE, RED))
    sketch.ellipse(55, 25, 21, 20, SKY).ellipse(55, 26, 11, 12, pick(rng, (LIME, GREEN, PINK)), outline=1.8)
    for x in (51, 59):
        sketch.ellipse(x, 24, 2.2, 3, INK, outline=0)
    sketch.line([(42, 19), (47, 12)], WHITE, 2.4)
    sketch.ellipse(55, 41, 49, 15, hull).ellipse(55, 36, 30, 6.5, GREY, outline=1.6)
    for x, y in ((18, 43), (36, 49), (55, 51), (74, 49), (92, 43)):
        sketch.ellipse(x, y, 4, 3.6, YELLOW, outline=1.6)
    return sketch.picture()


def balloon(rng: Rng) -> Image.Image:
    """Draw a balloon on its string."""
    sketch = Sketch(52, 104, scale=rng.uniform(0.65, 0.9))
    colour = pick(rng, BRIGHT)
    sketch.line([(26, 62), (22, 76), (29, 88), (25, 102)], INK, 1.8)
    sketch.polygon([(26, 58), (31, 65), (21, 65)], colour)
    sketch.blob([(26, 4), (42, 12), (47, 29), (38, 50), (26, 59), (14, 50), (5, 29), (10, 12)], colour)
    sketch.line([(12, 28), (14, 19), (20, 13)], WHITE, 3.2)
    if rng.random() < 0.4:
        sketch.polygon(star(28, 33, 9), WHITE if colour == YELLOW else YELLOW, outline=1.4)
    return sketch.picture()


def sign(rng: Rng, words: str = "") -> Image.Image:
    """Draw a signpost; without given words it shows unhelpful ones."""
    sketch = Sketch(92, 96, scale=rng.uniform(0.75, 0.95), turn=rng.uniform(-5, 5))
    board = pick(rng, (RED, BLUE, YELLOW, ORANGE, WHITE, TEAL, NAVY))
    sketch.limb([(46, 46), (46, 93)], BROWN, 8)
    points = [(8, 14), (70, 14), (87, 31), (70, 48), (8, 48)]
    if rng.random() < 0.5:
        points = [(92 - x, y) for x, y in points]
    sketch.polygon(points, board)
    sketch.text(
        46, 31, words or WORDS[rng.integers(len(WORDS))], INK if board in (YELLOW, WHITE, ORANGE) else WHITE, 17
    )
    return sketch.picture()


def tree(rng: Rng) -> Image.Image:
    """Draw a round or pointed tree with fruit."""
    sketch = Sketch(76, 108, scale=rng.uniform(0.7, 0.95), mirrored=rng.random() < 0.5)
    leaves, fruit = pick(rng, (GREEN, FOREST, LIME, TEAL)), pick(rng, (RED, ORANGE, YELLOW, PINK))
    sketch.limb([(38, 70), (38, 102)], BROWN, 11)
    if rng.random() < 0.5:
        sketch.blob([(38, 6), (58, 14), (70, 34), (64, 58), (48, 74), (26, 74), (10, 58), (7, 34), (18, 14)], leaves)
        spots = ((24, 30), (42, 22), (54, 40), (34, 50), (50, 60), (20, 50))
    else:
        for top, half in ((44, 30), (25, 25), (6, 19)):
            sketch.polygon([(38, top), (38 + half, top + 34), (38 - half, top + 34)], leaves)
        spots = ((38, 26), (30, 50), (46, 52), (22, 72), (38, 70), (55, 72))
    for x, y in spots:
        sketch.ellipse(x, y, 3.8, 3.8, fruit, outline=1.4)
    return sketch.picture()


def crate(rng: Rng) -> Image.Image:
    """Draw a crate, a barrel or a present."""
    sketch = Sketch(64, 64, scale=rng.uniform(0.65, 0.9))
    colour = pick(rng, (TAN, BROWN, *CLOTHES))
    band = pick(rng, tuple(paint for paint in (YELLOW, WHITE, RED, SLATE) if paint != colour))
    match rng.integers(3):
        case 0:
            sketch.box(6, 12, 58, 60, colour).line([(10, 16), (54, 56)], band, 5).line([(54, 16), (10, 56)], band, 5)
        case 1:
            sketch.blob([(14, 10), (50, 10), (57, 36), (50, 60), (14, 60), (7, 36)], colour)
            sketch.ellipse(32, 11, 18.5, 5, band).line([(8, 28), (32, 32), (56, 28)], band, 4)
            sketch.line([(8, 44), (32, 48), (56, 44)], band, 4)
        case _:
            sketch.box(8, 20, 56, 60, colour).box(28, 20, 36, 60, band, 1.4).box(5, 16, 59, 28, colour).box(
                28, 16, 36, 28, band, 1.4
            )
            sketch.ellipse(24, 11, 8, 5, band, turn=25).ellipse(40, 11, 8, 5, band, turn=-25)
    return sketch.picture()


def boulder(width: float, height: float) -> Image.Image:
    """Draw a boulder that fills its sheet."""
    w, h = width, height
    sketch = Sketch(w, h)
    outline = [(0.03, 0.97), (0.05, 0.55), (0.2, 0.2), (0.48, 0.04), (0.78, 0.16), (0.95, 0.52), (0.97, 0.97)]
    sketch.polygon([(x * w, y * h) for x, y in outline], GREY)
    sketch.polygon(
        [
            (0.5 * w, 0.07 * h),
            (0.77 * w, 0.18 * h),
            (0.93 * w, 0.53 * h),
            (0.94 * w, 0.94 * h),
            (0.62 * w, 0.94 * h),
            (0.66 * w, 0.5 * h),
        ],
        SLATE,
        0,
    )
    sketch.line([(0.22 * w, 0.45 * h), (0.36 * w, 0.55 * h), (0.34 * w, 0.75 * h)], INK, 2)
    sketch.ellipse(0.38 * w, 0.26 * h, 0.09 * w, 0.05 * h, DUST, outline=0, turn=-20)
    return sketch.picture()


def flag(rng: Rng) -> Image.Image:
    """Draw a pennant on a pole."""
    sketch = Sketch(64, 96, scale=rng.uniform(0.65, 0.9), mirrored=rng.random() < 0.5)
    colour, mark = pick(rng, BRIGHT), pick(rng, (WHITE, YELLOW, CRIMSON))
    sketch.limb([(12, 8), (12, 92)], SILVER, 6).ellipse(12, 7, 4.5, 4.5, YELLOW)
    sketch.blob([(14, 14), (32, 18), (46, 13), (60, 17), (59, 42), (45, 39), (32, 44), (14, 40)], colour)
    sketch.polygon(star(36, 29, 8), mark, outline=1.2)
    return sketch.picture()


def shade(width: int, height: int) -> Image.Image:
    """Draw the soft shadow at a figure's feet."""
    sheet = Sketch(width, height).ellipse(width / 2, height / 2, width / 2, height / 2, INK, outline=0).picture()
    sheet.putalpha(sheet.getchannel("A").point(lambda alpha: alpha * 72 // 255))
    return sheet
