"""The colours of the mazes: few, so that every colour of Rocketman occurs many times around him.

Anti-aliasing would make nearly every edge pixel unique, and an edge pixel of Rocketman would then betray him at once.
So each picture is snapped to one palette: the paints below, and their mixtures with ink and with white, as found along
edges.
"""

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

Colour = tuple[int, int, int]
Rng = np.random.Generator

INK: Colour = (29, 30, 58)
WHITE: Colour = (252, 250, 244)
SILVER: Colour = (203, 211, 222)
GREY: Colour = (146, 156, 173)
SLATE: Colour = (88, 96, 120)
RED: Colour = (228, 57, 60)
CRIMSON: Colour = (166, 34, 56)
ORANGE: Colour = (248, 141, 43)
YELLOW: Colour = (255, 212, 72)
CREAM: Colour = (255, 238, 176)
BLUE: Colour = (48, 116, 222)
NAVY: Colour = (32, 70, 150)
SKY: Colour = (130, 199, 245)
TEAL: Colour = (38, 166, 160)
LIME: Colour = (168, 211, 83)
GREEN: Colour = (88, 168, 72)
FOREST: Colour = (48, 118, 66)
PURPLE: Colour = (132, 82, 194)
PINK: Colour = (246, 134, 176)
PEACH: Colour = (252, 208, 168)
TAN: Colour = (206, 146, 100)
BROWN: Colour = (126, 80, 56)
SAND: Colour = (238, 218, 172)
DUNE: Colour = (222, 197, 146)
MOON: Colour = (190, 184, 206)
DUST: Colour = (170, 162, 190)
VIOLET: Colour = (104, 92, 140)

PAINTS = (
    *(WHITE, SILVER, GREY, SLATE, RED, CRIMSON, ORANGE, YELLOW, CREAM, BLUE, NAVY, SKY, TEAL, LIME),
    *(GREEN, FOREST, PURPLE, PINK, PEACH, TAN, BROWN, SAND, DUNE, MOON, DUST, VIOLET),
)
SKINS = (PEACH, PEACH, TAN, BROWN)
CLOTHES = (RED, RED, BLUE, BLUE, NAVY, ORANGE, YELLOW, TEAL, GREEN, PURPLE, PINK, WHITE, CRIMSON, SKY)


def mix(colour: Colour, other: Colour, share: float) -> Colour:
    """Blend ``share`` of another colour in."""
    red, green, blue = (round(a + (b - a) * share) for a, b in zip(colour, other, strict=True))
    return red, green, blue


def pick(rng: Rng, colours: tuple[Colour, ...]) -> Colour:
    """Choose one of several colours."""
    return colours[rng.integers(len(colours))]


def _mixtures() -> NDArray[np.uint8]:
    with_ink = [mix(paint, INK, share) for paint in PAINTS for share in (0, 0.14, 0.28, 0.43, 0.57, 0.72, 0.86)]
    with_white = [mix(paint, WHITE, share) for paint in PAINTS for share in (0.35, 0.68)]
    return np.unique(np.array([INK, *with_ink, *with_white], np.uint8), axis=0)


PALETTE = _mixtures()


def snap(pixels: NDArray[np.uint8]) -> NDArray[np.uint8]:
    """Replace every pixel of an (..., 3) picture by the nearest colour of the palette."""
    packed = pixels.astype(np.uint32) @ np.array([1 << 16, 1 << 8, 1], np.uint32)
    values, places = np.unique(packed, return_inverse=True)
    colours = np.stack([values >> 16, values >> 8 & 255, values & 255], axis=-1)
    _, nearest = cKDTree(PALETTE).query(colours)
    return PALETTE[nearest][places].reshape(pixels.shape)
