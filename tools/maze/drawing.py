"""Drawing with hard edges in a few colours, and haze over it."""

from collections.abc import Sequence
from typing import Self

import numpy as np
from numpy.typing import ArrayLike, NDArray
from PIL import Image, ImageDraw, ImageFont
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


SUPERSAMPLING = 4
OUTLINE = 2.2

Points = Sequence[tuple[float, float]]


def smooth(points: ArrayLike, closed: bool = True, steps: int = 8) -> NDArray[np.float64]:
    """Run a Catmull-Rom curve through the points."""
    knots = np.asarray(points, float)
    around = np.vstack([knots[-1:], knots, knots[:2]]) if closed else np.vstack([knots[:1], knots, knots[-1:]])
    p0, p1, p2, p3 = (around[i : len(around) - 3 + i, None] for i in range(4))
    t = np.linspace(0, 1, steps, endpoint=False)[None, :, None]
    curve = p1 + 0.5 * t * (p2 - p0 + t * (2 * p0 - 5 * p1 + 4 * p2 - p3 + t * (3 * (p1 - p2) + p3 - p0)))
    return np.vstack([curve.reshape(-1, 2), *([] if closed else [knots[-1:]])])


def ring(x: float, y: float, across: float, down: float, turn: float = 0.0, steps: int = 40) -> NDArray[np.float64]:
    """Return the points of an ellipse, rotated by an angle in degrees."""
    angle = np.linspace(0, 2 * np.pi, steps, endpoint=False)
    cos, sin = np.cos(np.radians(turn)), np.sin(np.radians(turn))
    u, v = across * np.cos(angle), down * np.sin(angle)
    return np.stack([x + u * cos - v * sin, y + u * sin + v * cos], axis=-1)


def star(x: float, y: float, radius: float, turn: float = 0.0, tips: int = 5) -> NDArray[np.float64]:
    """Return the points of a star."""
    angle = np.radians(turn - 90) + np.pi / tips * np.arange(2 * tips)
    reach = radius * np.where(np.arange(2 * tips) % 2, 0.45, 1.0)
    return np.stack([x + reach * np.cos(angle), y + reach * np.sin(angle)], axis=-1)


class Sketch:
    """A transparent sheet of ``width`` × ``height`` px; figures are drawn in units of ``scale`` px.

    ``mirrored`` flips left and right, ``turn`` rotates about the middle (degrees).
    """

    def __init__(
        self, width: float, height: float, *, scale: float = 1.0, mirrored: bool = False, turn: float = 0.0
    ) -> None:
        self.size = round(width * scale), round(height * scale)
        cos, sin = np.cos(np.radians(turn)), np.sin(np.radians(turn))
        flip = np.diag([-1.0 if mirrored else 1.0, 1.0])
        self._matrix = SUPERSAMPLING * scale * np.array([[cos, -sin], [sin, cos]]) @ flip
        self._middle = np.array([width / 2, height / 2])
        self._centre = np.array(self.size) * SUPERSAMPLING / 2
        self._thickness = SUPERSAMPLING * scale
        self._sheet = Image.new("RGBA", (self.size[0] * SUPERSAMPLING, self.size[1] * SUPERSAMPLING))
        self._pen = ImageDraw.Draw(self._sheet)

    def _place(self, points: ArrayLike) -> list[tuple[float, float]]:
        placed = (np.asarray(points, float) - self._middle) @ self._matrix.T + self._centre
        return [(float(x), float(y)) for x, y in placed]

    def polygon(self, points: ArrayLike, fill: Colour, outline: float = OUTLINE, ink: Colour = INK) -> Self:
        """Fill a polygon and draw its outline, half of it inside."""
        corners = self._place(points)
        self._pen.polygon(corners, fill=fill)
        if outline:
            self._line([*corners, corners[0]], ink, outline)
        return self

    def blob(self, points: ArrayLike, fill: Colour, outline: float = OUTLINE) -> Self:
        """Fill a smooth closed curve."""
        return self.polygon(smooth(points), fill, outline)

    def ellipse(
        self,
        x: float,
        y: float,
        across: float,
        down: float,
        fill: Colour,
        *,
        outline: float = OUTLINE,
        turn: float = 0.0,
    ) -> Self:
        """Fill an ellipse given by its centre and half-axes."""
        return self.polygon(ring(x, y, across, down, turn), fill, outline)

    def box(self, x0: float, y0: float, x1: float, y1: float, fill: Colour, outline: float = OUTLINE) -> Self:
        """Fill a rectangle."""
        return self.polygon([(x0, y0), (x1, y0), (x1, y1), (x0, y1)], fill, outline)

    def line(self, points: ArrayLike, colour: Colour = INK, width: float = OUTLINE) -> Self:
        """Draw a smooth open line with round ends."""
        self._line(self._place(smooth(points, closed=False)), colour, width)
        return self

    def limb(self, points: ArrayLike, colour: Colour, width: float) -> Self:
        """Draw an outlined tube: an arm, a leg, a pole."""
        return self.line(points, INK, width + OUTLINE).line(points, colour, width - OUTLINE)

    def text(self, x: float, y: float, words: str, colour: Colour, size: float) -> Self:
        """Write words centred on a point; never mirrored."""
        font = ImageFont.load_default(size * self._thickness)
        self._pen.text(self._place([(x, y)])[0], words, colour, font, anchor="mm")
        return self

    def _line(self, points: list[tuple[float, float]], colour: Colour, width: float) -> None:
        thickness = width * self._thickness
        self._pen.line(points, colour, round(thickness))
        half = thickness / 2
        for x, y in points:
            self._pen.ellipse((x - half, y - half, x + half, y + half), fill=colour)

    def picture(self) -> Image.Image:
        """Scale the drawing down to its final size, RGBA."""
        return self._sheet.convert("RGBa").resize(self.size, Image.Resampling.BOX).convert("RGBA")


DULLING = 0.52
GRAIN = 17.0


def raise_dust(
    pixels: NDArray[np.uint8], row: float, col: float, radius: float, dust: Colour, rng: Rng
) -> NDArray[np.uint8]:
    """Blend a round cloud of dust into an RGB picture: thick to three quarters of its radius, then thinning out."""
    vertical, horizontal = window = _window(pixels, row, col, radius)
    rows, cols = np.ogrid[vertical, horizontal]
    distance = np.hypot(rows - row, cols - col) / radius
    thickness = np.clip((1 - distance) / 0.25, 0, 1)[..., None]
    clear = pixels[window].astype(float)
    grain = rng.normal(0, GRAIN, clear.shape)
    hazy = clear + thickness * (DULLING * (np.array(dust) - clear) + grain)
    result = pixels.copy()
    result[window] = np.clip(np.rint(hazy), 0, 255)
    return result


def _window(pixels: NDArray[np.uint8], row: float, col: float, radius: float) -> tuple[slice, slice]:
    height, width = pixels.shape[:2]
    vertical = slice(max(int(row - radius), 0), min(int(row + radius) + 1, height))
    return vertical, slice(max(int(col - radius), 0), min(int(col + radius) + 1, width))
