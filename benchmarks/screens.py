"""Pictures in which users search: screens with icons, text and lists, photographs, landscapes, terrain and objects.

Screens are drawn from a layout, at any scale of the display and with icons shifted by any part of a pixel; two screens
of one layout differ only in the widgets that were exchanged.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path
from typing import Any, Literal, TypeAlias

import cv2
import numpy as np
import numpy.typing as npt
import skimage
from PIL import Image, ImageDraw, ImageFont

from benchmarks.pairs import DATA
from stereolag import read_image

Array: TypeAlias = npt.NDArray[Any]
Random: TypeAlias = np.random.Generator
Colour: TypeAlias = tuple[int, int, int]

OVERSAMPLING = 8
"""Subpixels of a drawn shape along each axis of a pixel."""

UNIT = 24
"""Side of the square in which glyphs are defined."""


# --- Glyphs ---------------------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Stroke:
    """An open or closed line through (x, y) points of a square of side :data:`UNIT`, or the area within it."""

    points: Array
    form: Literal["line", "loop", "area"]


Glyph: TypeAlias = tuple[Stroke, ...]


def _points(text: str) -> Array:
    return np.array(text.split(), dtype=float).reshape(-1, 2)


def line(text: str) -> Stroke:
    return Stroke(_points(text), "line")


def loop(text: str) -> Stroke:
    return Stroke(_points(text), "loop")


def area(text: str) -> Stroke:
    return Stroke(_points(text), "area")


def _arc(x: float, y: float, radius: float, first: float, last: float) -> Array:
    angles = np.radians(np.linspace(first, last, 48))
    return np.stack([x + radius * np.cos(angles), y - radius * np.sin(angles)], axis=1)


def arc(x: float, y: float, radius: float, first: float, last: float) -> Stroke:
    return Stroke(_arc(x, y, radius, first, last), "line")


def ring(x: float, y: float, radius: float) -> Stroke:
    return Stroke(_arc(x, y, radius, 0, 360), "loop")


def disc(x: float, y: float, radius: float) -> Stroke:
    return Stroke(_arc(x, y, radius, 0, 360), "area")


def star(inner: float, form: Literal["loop", "area"]) -> Stroke:
    angles = np.radians(90 + 36 * np.arange(10))
    radius = np.where(np.arange(10) % 2, inner, 10)
    return Stroke(np.stack([12 + radius * np.cos(angles), 12.5 - radius * np.sin(angles)], axis=1), form)


BODIES: dict[str, tuple[Glyph, tuple[float, float]]] = {
    "": ((), (12, 12)),
    "page": ((loop("5 2 14 2 19 7 19 22 5 22"), line("14 2 14 7 19 7")), (12, 14.5)),
    "folder": ((loop("2 5 9 5 11 8 22 8 22 20 2 20"),), (12, 14)),
    "circle": ((ring(12, 12, 10),), (12, 12)),
    "square": ((loop("3 3 21 3 21 21 3 21"),), (12, 12)),
    "magnifier": ((ring(10, 10, 7.5), line("15.5 15.5 22 22")), (10, 10)),
    "cloud": (
        (arc(7.5, 14.5, 5, 90, 270), arc(12.5, 10, 6, 20, 160), arc(18, 15, 4.5, -90, 80), line("7.5 19.5 18 19.5")),
        (12, 14),
    ),
    "shield": ((loop("12 2 20 5 20 12 17 18 12 22 7 18 4 12 4 5"),), (12, 12)),
}
"""Outlines, and the middle of the mark in them."""

MARKS: dict[str, Glyph] = {
    "": (),
    "plus": (line("-4 0 4 0"), line("0 -4 0 4")),
    "minus": (line("-4 0 4 0"),),
    "cross": (line("-3 -3 3 3"), line("-3 3 3 -3")),
    "check": (line("-4 0 -1 3 4 -3"),),
    "up": (line("0 4 0 -4"), line("-3 -1 0 -4 3 -1")),
    "down": (line("0 4 0 -4"), line("-3 1 0 4 3 1")),
    "left": (line("4 0 -4 0"), line("-1 -3 -4 0 -1 3")),
    "right": (line("4 0 -4 0"), line("1 -3 4 0 1 3")),
    "lines": (line("-4 -3 4 -3"), line("-4 0 4 0"), line("-4 3 2 3")),
    "dot": (disc(0, 0, 2.4),),
    "bars": (line("-2 -3.5 -2 3.5"), line("2 -3.5 2 3.5")),
    "play": (area("-2.5 -4 4 0 -2.5 4"),),
}

OTHERS: dict[str, Glyph] = {
    "bell": (arc(12, 10, 6, 0, 180), line("6 10 6 15 4 18 20 18 18 15 18 10"), line("10 21 14 21")),
    "lock": (loop("5 11 19 11 19 21 5 21"), arc(12, 8, 4.5, 0, 180), line("7.5 8 7.5 11"), line("16.5 8 16.5 11")),
    "unlocked": (loop("5 11 19 11 19 21 5 21"), arc(12, 7, 4.5, 20, 180), line("7.5 7 7.5 11")),
    "star": (star(4.4, "loop"),),
    "star filled": (star(4.4, "area"),),
    "heart": (arc(7.5, 8.5, 4.7, 20, 215), arc(16.5, 8.5, 4.7, -35, 160), line("3.6 11.3 12 21 20.4 11.3")),
    "house": (loop("3 12 12 3 21 12"), line("5 12 5 21 19 21 19 12"), line("10 21 10 15 14 15 14 21")),
    "bin": (
        line("3 6 21 6"),
        line("9 6 9 3 15 3 15 6"),
        line("5 6 6 22 18 22 19 6"),
        line("10 10 10 18"),
        line("14 10 14 18"),
    ),
    "pencil": (loop("3 21 4 16 16 4 20 8 8 20"), line("13 7 17 11")),
    "disk": (loop("3 3 17 3 21 7 21 21 3 21"), loop("7 21 7 13 17 13 17 21"), line("8 3 8 8 15 8")),
    "printer": (loop("6 8 6 2 18 2 18 8"), loop("2 8 22 8 22 17 2 17"), loop("6 14 18 14 18 22 6 22")),
    "person": (ring(12, 7, 4.5), arc(12, 22, 8, 0, 180)),
    "people": (ring(9, 7, 4), arc(9, 21, 7, 0, 180), ring(18, 9, 3), arc(18, 20, 4.5, 0, 90)),
    "stop": (area("5 5 19 5 19 19 5 19"),),
    "pause": (area("6 4 10 4 10 20 6 20"), area("14 4 18 4 18 20 14 20")),
    "record": (disc(12, 12, 8),),
    "forward": (area("4 5 12 12 4 19"), area("12 5 20 12 12 19")),
    "back": (area("20 5 12 12 20 19"), area("12 5 4 12 12 19")),
    "again": (arc(12, 12, 8.5, 40, 330), line("13.5 6 19 6.5 19 1.5")),
    "undo": (arc(12, 14, 7.5, -60, 160), line("2 8 5 12 9 9")),
    "redo": (arc(12, 14, 7.5, 20, 240), line("22 8 19 12 15 9")),
    "list": (
        line("8 5 21 5"),
        line("8 12 21 12"),
        line("8 19 21 19"),
        disc(4, 5, 1.5),
        disc(4, 12, 1.5),
        disc(4, 19, 1.5),
    ),
    "to the left": (line("3 5 21 5"), line("3 10 14 10"), line("3 15 21 15"), line("3 20 14 20")),
    "to the right": (line("3 5 21 5"), line("10 10 21 10"), line("3 15 21 15"), line("10 20 21 20")),
    "centred": (line("3 5 21 5"), line("7 10 17 10"), line("3 15 21 15"), line("7 20 17 20")),
    "grid": (loop("3 3 21 3 21 21 3 21"), line("12 3 12 21"), line("3 12 21 12")),
    "clock": (ring(12, 12, 10), line("12 6 12 12 16 14")),
    "sun": (
        ring(12, 12, 4),
        *(
            line(f"{12 + 7 * x} {12 + 7 * y} {12 + 10 * x} {12 + 10 * y}")
            for x, y in ((1, 0), (-1, 0), (0, 1), (0, -1), (0.7, 0.7), (-0.7, 0.7), (0.7, -0.7), (-0.7, -0.7))
        ),
    ),
    "cup": (loop("4 8 17 8 16 20 5 20"), arc(17, 13, 4, -90, 90), line("8 2 8 5"), line("13 2 13 5")),
    "flag": (line("5 2 5 22"), loop("5 3 19 3 15 8 19 13 5 13")),
    "key": (ring(7, 12, 4.5), line("11.5 12 22 12 22 16"), line("18 12 18 15")),
    "letter": (loop("2 5 22 5 22 19 2 19"), line("2 6 12 13 22 6")),
    "chart": (
        line("3 2 3 21 22 21"),
        area("6 12 9 12 9 19 6 19"),
        area("11 6 14 6 14 19 11 19"),
        area("16 9 19 9 19 19 16 19"),
    ),
    "drop": (loop("12 2 17 10 19 15 17 20 12 22 7 20 5 15 7 10"),),
    "bolt": (area("13 1 4 14 11 14 10 23 20 9 13 9"),),
}


def moved(glyph: Glyph, x: float, y: float, size: float) -> Glyph:
    return tuple(replace(path, points=size * path.points + np.array([x, y])) for path in glyph)


GLYPHS: dict[str, Glyph] = OTHERS | {
    f"{body} {mark}".strip(): outline + moved(sign, *middle, 1 if body else 2)
    for body, (outline, middle) in BODIES.items()
    for mark, sign in MARKS.items()
    if (body, mark) != ("", "")
}

FAMILIES: tuple[tuple[str, ...], ...] = (
    *(tuple(f"{body} {mark}".strip() for mark in MARKS if body or mark) for body in BODIES),
    ("lock", "unlocked"),
    ("forward", "back"),
    ("undo", "redo"),
    ("to the left", "to the right", "centred", "list"),
    ("star", "star filled"),
    ("person", "people"),
    ("stop", "pause", "record"),
    ("clock", "circle check", "circle cross"),
)
"""Groups of glyphs that look similar."""


def siblings(name: str) -> list[str]:
    """Return the other glyphs of a glyph's families, or all other glyphs if it has no family."""
    similar = {one for family in FAMILIES if name in family for one in family} - {name}
    return sorted(similar or set(GLYPHS) - {name})


def coverage(
    glyph: Glyph,
    shape: tuple[int, int],
    size: float,
    at: tuple[float, float] = (0, 0),
    weight: float = 2.0,
    turned: float = 0.0,
) -> Array:
    """Return the share of each pixel that a glyph covers, 0..1.

    `at` is the (row, col) of its top-left corner, `size` its side in pixels, `weight` the width of its lines in units,
    `turned` its counter-clockwise rotation about the centre of its square, degrees.
    """
    fine = np.zeros((shape[0] * OVERSAMPLING, shape[1] * OVERSAMPLING), np.uint8)
    cos, sin = np.cos(np.radians(turned)), np.sin(np.radians(turned))
    turn = np.array([[cos, -sin], [sin, cos]])
    for path in glyph:
        middle = (path.points - UNIT / 2) @ turn
        points = ((middle + UNIT / 2) * size / UNIT + (at[1], at[0])) * OVERSAMPLING - 0.5
        rounded = [np.rint(points * 16).astype(np.int32)]
        if path.form == "area":
            cv2.fillPoly(fine, rounded, 255, shift=4)
        else:
            thick = max(1, round(weight * size / UNIT * OVERSAMPLING))
            cv2.polylines(fine, rounded, path.form == "loop", 255, thick, shift=4)
    return np.asarray(cv2.resize(fine, shape[::-1], interpolation=cv2.INTER_AREA) / np.float32(255))


@cache
def is_symmetric(name: str) -> bool:
    """Return whether a glyph is its own mirror image."""
    cover = coverage(GLYPHS[name], (48, 48), 48)
    return bool(np.abs(cover - cover[:, ::-1]).mean() < 0.04 * cover.mean())


def paint(picture: Array, cover: Array, colour: Sequence[float] | Array, row: int, col: int) -> None:
    """Paint a colour, or one for each pixel, over a part of a picture, in place, clipped at its borders."""
    top, left = max(0, row), max(0, col)
    bottom, right = min(picture.shape[0], row + cover.shape[0]), min(picture.shape[1], col + cover.shape[1])
    if bottom <= top or right <= left:
        return
    inside = slice(top - row, bottom - row), slice(left - col, right - col)
    shown = np.broadcast_to(np.asarray(colour, np.float32), (*cover.shape, 3))[inside]
    part, share = picture[top:bottom, left:right], cover[inside][:, :, None]
    part[:] = np.rint(np.clip(part * (1 - share) + shown * share, 0, 255))


# --- Screens --------------------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Panel:
    """A rectangle with a border and round corners."""

    row: float
    col: float
    height: float
    width: float
    fill: Colour
    border: Colour | None = None
    radius: float = 0.0


@dataclass(frozen=True)
class Icon:
    """A glyph in a square."""

    row: float
    col: float
    size: float
    name: str
    colour: Colour
    weight: float


@dataclass(frozen=True)
class Text:
    """A line of text, placed by its top-left corner."""

    row: float
    col: float
    size: float
    text: str
    colour: Colour


@dataclass(frozen=True)
class Lamp:
    """A round lamp with a rim and a highlight."""

    row: float
    col: float
    size: float
    colour: Colour


@dataclass(frozen=True)
class Photograph:
    """A photograph, or part of one, at 100 %."""

    row: float
    col: float
    picture: Array


Part: TypeAlias = Panel | Icon | Text | Lamp | Photograph


@dataclass(frozen=True)
class Widget:
    """Parts that belong together, in their box; widgets with the same `key` differ only in size and colour."""

    key: str
    row: float
    col: float
    height: float
    width: float
    parts: tuple[Part, ...]


WORDS = (
    "Paste", "Start", "Refresh", "Invoice", "Price", "Replace", "Accept", "Connect", "Apply", "Total", "Decline",
    "Product", "Undo", "Help", "Download", "Shipping", "Payment", "Discount", "Quantity", "Customer", "Previous",
    "Resume", "Rename", "Account", "Cancel", "Settings", "Layers", "Window", "Filter", "Search", "Insert", "Delete",
    "Export", "Import", "Format", "Tables", "Figures", "Colour", "Border", "Margin", "Header", "Footer", "Sharpen",
    "Contrast", "Level", "Mixer", "Tempo", "Volume", "Record", "Balance", "Transfer", "Deposit", "Archive",
    "Message", "Contact", "Calendar", "Schedule", "Monday", "Friday", "Berlin", "Madrid", "Tokyo", "Oslo", "Engine",
    "Brake", "Voltage", "Current", "Pressure", "Humidity", "Station", "Signal", "Antenna", "Sensor", "Camera",
    "Shutter", "Gallery",
)  # fmt: skip

PALETTE: dict[str, Colour] = {
    "red": (200, 40, 40),
    "green": (30, 140, 50),
    "blue": (20, 95, 190),
    "orange": (225, 130, 20),
    "grey": (125, 125, 125),
}
"""Colours that are easy to distinguish."""


@dataclass(frozen=True)
class Theme:
    """The colours and glyphs of a screen."""

    back: Colour
    card: Colour
    border: Colour
    ink: Colour
    accent: Colour
    icons: tuple[Colour, ...]
    weight: float
    glyphs: tuple[str, ...]


def theme(random: Random) -> Theme:
    """Return a light or a dark theme."""
    dark = random.random() < 0.3
    level = int(random.integers(25, 50) if dark else random.integers(225, 246))
    card = level + 14 if dark else 255
    ink = int(random.integers(190, 240) if dark else random.integers(15, 70))
    colours = [(ink, ink, ink)] if random.random() < 0.5 else [*PALETTE.values()]
    accent = tuple(int(one) for one in random.integers(20, 190, 3))
    # Whole families, so that there are siblings.
    glyphs: list[str] = list(random.choice(sorted(OTHERS), 18, replace=False))
    for index in random.choice(len(FAMILIES), 6, replace=False).tolist():
        glyphs += FAMILIES[index]
    return Theme(
        back=(level, level, level + int(random.integers(0, 5))),
        card=(card, card, card),
        border=(level - 30, level - 30, level - 30) if not dark else (level + 40, level + 40, level + 40),
        ink=(ink, ink, ink),
        accent=accent,  # type: ignore[arg-type]
        icons=tuple(colours),
        weight=float(random.uniform(1.4, 2.4)),
        glyphs=tuple(dict.fromkeys(glyphs)),
    )


def icon_at(name: str, row: float, col: float, size: float, look: Theme, colour: Colour, frame: float = 0.0) -> Widget:
    """Return an icon; if `frame` is above 0, in a frame that is larger by so many px on each side."""
    inner = Icon(row + frame, col + frame, size, name, colour, look.weight)
    side = size + 2 * frame
    framed = (Panel(row, col, side, side, look.card, look.border, 4),) if frame else ()
    return Widget(name, row, col, side, side, (*framed, inner))


def button_at(
    text: str, row: float, col: float, height: float, width: float, look: Theme, fill: Colour | None = None
) -> Widget:
    """Return a button with centred text, filled with a colour or that of a card."""
    colour = look.ink if fill is None else (255, 255, 255)
    panel = Panel(row, col, height, width, fill or look.card, look.border if fill is None else None, 4)
    size = 0.46 * height
    start = col + (width - text_width(text, size)) / 2
    return Widget(text, row, col, height, width, (panel, Text(row + 0.27 * height, start, size, text, colour)))


@cache
def font(size: float) -> ImageFont.FreeTypeFont:
    loaded = ImageFont.load_default(size)
    assert isinstance(loaded, ImageFont.FreeTypeFont)
    return loaded


def text_width(text: str, size: float) -> float:
    return float(font(size).getlength(text))


@cache
def text_cover(text: str, size: float) -> Array:
    """Return the share of each pixel that a text covers, from its top-left corner on."""
    tile = Image.new("L", (int(font(size).getlength(text)) + 4, int(1.4 * size) + 2), 0)
    ImageDraw.Draw(tile).text((1, 0), text, fill=255, font=font(size))
    return np.asarray(tile, np.float32) / 255


Block: TypeAlias = Callable[[Random, Theme, float, float, float, float], Iterator[Widget]]


def _word(random: Random) -> str:
    return str(random.choice(WORDS))


def _colour(random: Random, look: Theme) -> Colour:
    return look.icons[int(random.integers(len(look.icons)))]


def icon_block(random: Random, look: Theme, row: float, col: float, height: float, width: float) -> Iterator[Widget]:
    """A grid of icons, framed or not, with a few gaps."""
    size = float(random.choice([20, 24, 32]))
    frame = float(random.choice([0, 6, 10]))
    pitch = size + 2 * frame + float(random.integers(4, 16))
    for top in np.arange(row, row + height - pitch, pitch).tolist():
        for left in np.arange(col, col + width - pitch, pitch).tolist():
            if random.random() < 0.9:
                yield icon_at(str(random.choice(look.glyphs)), top, left, size, look, _colour(random, look), frame)


def list_block(random: Random, look: Theme, row: float, col: float, height: float, width: float) -> Iterator[Widget]:
    """Rows of an icon, a word and a number."""
    pitch = float(random.integers(20, 30))
    yield Widget("panel", row, col, height, width, (Panel(row, col, height, width, look.card, look.border),))
    for top in np.arange(row + 4, row + height - pitch, pitch).tolist():
        name = str(random.choice(look.glyphs))
        yield icon_at(name, top + (pitch - 16) / 2, col + 6, 16, look, _colour(random, look))
        for start, text in ((30, _word(random)), (130, f"{random.uniform(1, 999):.2f}")):
            if start + 80 < width:
                label = Text(top + pitch / 2 - 8, col + start, 13, text, look.ink)
                yield Widget(text, top, col + start - 2, pitch, text_width(text, 13) + 6, (label,))


def button_block(random: Random, look: Theme, row: float, col: float, height: float, width: float) -> Iterator[Widget]:
    """A grid of buttons."""
    tall, wide = float(random.integers(24, 36)), float(random.integers(84, 130))
    for top in np.arange(row, row + height - tall, tall + 12).tolist():
        for left in np.arange(col, col + width - wide, wide + 14).tolist():
            fill = look.accent if random.random() < 0.2 else None
            yield button_at(_word(random), top, left, tall, wide, look, fill)


def text_block(random: Random, look: Theme, row: float, col: float, height: float, width: float) -> Iterator[Widget]:
    """Lines of words."""
    size = float(random.choice([11, 12, 13, 15]))
    for top in np.arange(row, row + height - 1.5 * size, 1.6 * size).tolist():
        left = col
        while left < col + width - 90:
            word = _word(random).lower()
            yield Widget(
                word, top, left - 1, 1.4 * size, text_width(word, size) + 3, (Text(top, left, size, word, look.ink),)
            )
            left += text_width(word, size) + 0.5 * size


def photograph_block(
    random: Random, look: Theme, row: float, col: float, height: float, width: float
) -> Iterator[Widget]:
    """Part of a photograph."""
    size = int(min(height, random.integers(90, 180))), int(min(width, random.integers(120, 240)))
    picture = part_of(photograph(random), size, random)
    yield Widget("photograph", row, col, *picture.shape[:2], (Photograph(row, col, picture),))


BLOCKS: tuple[Block, ...] = (icon_block, icon_block, list_block, button_block, text_block, photograph_block)


@dataclass(frozen=True)
class Layout:
    """The widgets of a screen at 100 %, drawn in their order."""

    rows: int
    cols: int
    look: Theme
    widgets: tuple[Widget, ...]

    def unique_widgets(self) -> list[Widget]:
        """Return the widgets that look like no other."""
        counts = Counter(one.key for one in self.widgets)
        return [one for one in self.widgets if counts[one.key] == 1 and one.height < 60 and one.key != "panel"]

    def exchanged(self, old: Widget, new: Widget) -> Layout:
        return replace(self, widgets=tuple(new if one is old else one for one in self.widgets))

    def drawn(self, scale: float = 1.0, shift: tuple[float, float] = (0.0, 0.0)) -> Array:
        """Return the screen at a scale of the display, with its icons shifted by (row, col) pixels."""
        picture = np.empty((round(self.rows * scale), round(self.cols * scale), 3), np.uint8)
        picture[:] = self.look.back
        for widget in self.widgets:
            for part in widget.parts:
                draw(picture, part, scale, shift)
        return picture


def draw(picture: Array, part: Part, scale: float, shift: tuple[float, float]) -> None:
    """Draw one part of a widget, in place, at whole pixels but for `shift`."""
    row, col = round(part.row * scale), round(part.col * scale)
    if isinstance(part, Panel):
        height, width = round((part.row + part.height) * scale) - row, round((part.col + part.width) * scale) - col
        stroke = max(1, round(scale))
        for inset, colour in ((0, part.border or part.fill), (stroke, part.fill)):
            if min(height, width) <= 2 * inset:
                break
            cover = rounded(height - 2 * inset, width - 2 * inset, max(0.0, part.radius * scale - inset))
            paint(picture, cover, colour, row + inset, col + inset)
    elif isinstance(part, Icon):
        side = int(np.ceil(part.size * scale)) + 3
        at = 1 + shift[0], 1 + shift[1]
        cover = coverage(GLYPHS[part.name], (side, side), part.size * scale, at, part.weight)
        paint(picture, cover, part.colour, row - 1, col - 1)
    elif isinstance(part, Text):
        paint(picture, text_cover(part.text, part.size * scale), part.colour, row, col)
    elif isinstance(part, Lamp):
        side = int(np.ceil(part.size * scale)) + 2
        at = 1 + shift[0], 1 + shift[1]
        for glyph, colour in (
            ((disc(12, 12, 12),), (70, 70, 70)),
            ((disc(12, 12, 10),), part.colour),
            ((disc(9, 8, 3.2),), tuple((one + 255) // 2 for one in part.colour)),
        ):
            paint(picture, coverage(glyph, (side, side), part.size * scale, at), colour, row - 1, col - 1)
    else:
        size = round(part.picture.shape[1] * scale), round(part.picture.shape[0] * scale)
        resized = part.picture if scale == 1 else cv2.resize(part.picture, size, interpolation=cv2.INTER_LINEAR)
        paint(picture, np.ones(resized.shape[:2], np.float32), resized, row, col)


@cache
def rounded(height: int, width: int, radius: float) -> Array:
    """Return the share of each pixel that a rectangle with rounded corners covers."""
    rows, cols = np.arange(height) + 0.5, np.arange(width) + 0.5
    down = np.maximum(0, radius - np.minimum(rows, height - rows))[:, None]
    across = np.maximum(0, radius - np.minimum(cols, width - cols))
    return (
        np.clip(radius + 0.5 - np.hypot(down, across), 0, 1).astype(np.float32)
        if radius
        else np.ones((height, width), np.float32)
    )


def layout(random: Random, rows: int = 0, cols: int = 0) -> Layout:
    """Return a screen: a window with a title, a toolbar, perhaps a sidebar, and blocks of widgets."""
    rows, cols = rows or int(random.integers(420, 721)), cols or int(random.integers(560, 1081))
    look = theme(random)
    title = " ".join(str(word) for word in random.choice(WORDS, 2))
    bar = Panel(0, 0, 30, cols, look.accent)
    widgets = [
        Widget("panel", 0, 0, 30, cols, (bar,)),
        Widget(title, 4, 8, 22, text_width(title, 14) + 6, (Text(7, 10, 14, title, (255, 255, 255)),)),
        Widget("panel", 30, 0, 40, cols, (Panel(30, 0, 40, cols, look.card, look.border),)),
    ]
    size, left = float(random.choice([20, 24])), 10.0
    while left < cols - 60:
        widgets.append(icon_at(str(random.choice(look.glyphs)), 50 - size / 2, left, size, look, _colour(random, look)))
        left += size + float(random.choice([8, 14, 30], p=[0.6, 0.3, 0.1]))
    start = 0
    if random.random() < 0.6:
        start = 170
        widgets += list_block(random, look, 70, 0, rows - 70, 160)
    height, width = int(random.integers(170, 260)), int(random.integers(220, 340))
    for row in range(84, rows - 100, height):
        for col in range(start + 14, cols - 100, width):
            block = BLOCKS[int(random.integers(len(BLOCKS)))]
            widgets += block(random, look, row, col, min(height, rows - row) - 16, min(width, cols - col) - 16)
    return Layout(rows, cols, look, tuple(widgets))


# --- Photographs, landscapes, terrain -------------------------------------------------------------------------------

SAMPLE_PICTURES = (
    "astronaut.png", "chelsea.png", "coffee.png", "rocket.jpg", "ihc.png", "hubble_deep_field.jpg", "retina.jpg",
    "camera.png", "coins.png", "brick.png", "grass.png", "gravel.png", "moon.png", "motorcycle_left.png",
)  # fmt: skip
"""Photographs that are part of scikit-image."""

STREET_PICTURES = (
    "kitti2015_000046/left.png", "drivingstereo_00/left.jpg", "drivingstereo_06/left.jpg", "drivingstereo_12/left.jpg",
    "drivingstereo_18/left.jpg",
)  # fmt: skip
"""Photographs of streets in :data:`benchmarks.pairs.DATA`, if available."""

STILL_PICTURES = (
    "tsukuba/left.png", "teddy/left.png", "cones/left.png", "aloe_half/left.png", "report_rubiks/left.jpg",
    "report_block/left.jpg", "report_giraffe/left.jpg",
)  # fmt: skip
"""Other photographs there."""


@cache
def photographs(streets: bool = False) -> tuple[Array, ...]:
    """Return all available photographs as (rows, cols, 3) uint8, or those of streets only."""
    folder = Path(skimage.__file__).parent / "data"
    paths = [DATA / "stereo" / name for name in STREET_PICTURES]
    if not streets:
        paths += [folder / name for name in SAMPLE_PICTURES] + [DATA / "stereo" / name for name in STILL_PICTURES]
    pictures = (read_image(path) for path in paths if path.is_file())
    return tuple(np.dstack([one] * 3) if one.ndim == 2 else np.ascontiguousarray(one[:, :, :3]) for one in pictures)


def photograph(random: Random, rows: int = 480, cols: int = 640) -> Array:
    """Return a photograph, or part of one, of at most `rows` rows and `cols` columns."""
    every = photographs()
    return part_of(every[int(random.integers(len(every)))], (rows, cols), random)


def part_of(picture: Array, shape: tuple[int, int], random: Random) -> Array:
    """Return a part of a picture at a random place, of this shape or smaller if the picture is."""
    height, width = (min(size, side) for size, side in zip(shape, picture.shape, strict=False))
    row = int(random.integers(picture.shape[0] - height + 1))
    col = int(random.integers(picture.shape[1] - width + 1))
    return picture[row : row + height, col : col + width].copy()


def has_detail(picture: Array) -> bool:
    """Return whether at least seven of nine equal parts of a picture have contrast."""
    grey = picture.astype(np.float32).mean(axis=2) if picture.ndim == 3 else picture.astype(np.float32)
    ninths = [part for band in np.array_split(grey, 3) for part in np.array_split(band, 3, axis=1)]
    return sum(float(part.std()) > 8 for part in ninths) >= 7


def detailed_place(picture: Array, height: int, width: int, random: Random) -> tuple[int, int]:
    """Return the (row, col) of a part with detail, or of the last part tried."""
    for _ in range(100):
        row = int(random.integers(picture.shape[0] - height + 1))
        col = int(random.integers(picture.shape[1] - width + 1))
        if has_detail(picture[row : row + height, col : col + width]):
            break
    return row, col


def fractal(rows: int, cols: int, slope: float, random: Random) -> Array:
    """Return noise of mean 0 and standard deviation 1 whose amplitude falls with this power of its frequency."""
    frequency = np.hypot(np.fft.fftfreq(rows)[:, None], np.fft.rfftfreq(cols))
    frequency[0, 0] = np.inf
    spectrum = np.fft.rfft2(random.normal(size=(rows, cols))) * frequency**-slope
    noise = np.fft.irfft2(spectrum, (rows, cols))
    return np.asarray(noise / noise.std(), np.float32)


def landscape(random: Random, rows: int, cols: int) -> Array:
    """Return a landscape: a sky with clouds, overlapping ridges, a meadow, perhaps houses and a sun."""
    sky = np.linspace(*random.uniform(110, 235, (2, 3)), rows) + np.array([0, 5, 25])
    picture = np.repeat(sky[:, None], cols, axis=1) + 8 * fractal(rows, cols, 1.5, random)[:, :, None]
    if random.random() < 0.4:
        at = random.uniform(0, rows / 3), random.uniform(0, cols)
        distance = np.hypot(np.arange(rows)[:, None] - at[0], np.arange(cols) - at[1])
        picture += np.exp(-((distance / random.uniform(8, 30)) ** 2))[:, :, None] * [90, 80, 20]
    horizon, ridges = random.uniform(0.3, 0.55) * rows, int(random.integers(2, 5))
    for index in range(ridges):
        top = horizon + (rows - horizon) * index / (ridges + 0.5)
        edge = top + random.uniform(0.02, 0.1) * rows * fractal(1, cols, 1.3, random)[0]
        colour = random.uniform([30, 50, 20], [110, 130, 90]) + (ridges - index) * np.array([8, 10, 18])
        below = np.clip(np.arange(rows)[:, None] - edge + 0.5, 0, 1)[:, :, None]
        ground = colour + random.uniform(6, 18) * fractal(rows, cols, 0.7, random)[:, :, None]
        picture = picture * (1 - below) + ground * below
        for _ in range(int(random.integers(0, 4))):
            left, tall = int(random.integers(cols)), int(random.uniform(0.05, 0.2) * rows) + 2
            base, wide = int(edge[left]) + tall // 3, int(tall * random.uniform(0.6, 1.8)) + 2
            picture[max(0, base - tall) : base, left : left + wide] = random.uniform(40, 230, 3)
    return np.asarray(np.clip(picture + random.normal(scale=2, size=picture.shape), 0, 255), np.uint8)


# --- Objects --------------------------------------------------------------------------------------------------------


def product(random: Random) -> tuple[tuple[Glyph, Colour], ...]:
    """Return the layers of a label: its ground, a bar at one end, so that no rotation repeats it, and some shapes."""
    grounds = random.permutation([*PALETTE.values(), (235, 205, 60), (240, 240, 235), (35, 35, 45)])
    high = random.uniform(14, 20)
    top = (UNIT - high) / 2
    layers: list[tuple[Glyph, Colour]] = [
        ((area(f"0 {top} 24 {top} 24 {top + high} 0 {top + high}"),), tuple(grounds[0]))
    ]
    layers.append(((area(f"20 {top} 23 {top} 23 {top + high} 20 {top + high}"),), tuple(grounds[1])))
    for index in range(int(random.integers(2, 4))):
        x, y, reach = random.uniform(4, 16), random.uniform(top + 3.5, top + high - 3.5), random.uniform(2, 3.5)
        if random.random() < 0.5:
            shape = disc(x, y, reach)
        else:
            shape = area(
                f"{x - reach} {y - reach} {x + reach} {y - reach} {x + reach} {y + reach} {x - reach} {y + reach}"
            )
        layers.append(((shape,), tuple(grounds[2 + index])))
    return tuple(layers)


def put(
    picture: Array, layers: Sequence[tuple[Glyph, Colour]], row: float, col: float, size: float, turned: float
) -> None:
    """Paint layers of a size, in place, with their centre at (row, col), and turned about it."""
    reach = int(0.75 * size) + 2
    top, left = int(row) - reach, int(col) - reach
    at = row - top - size / 2, col - left - size / 2
    for glyph, colour in layers:
        paint(picture, coverage(glyph, (2 * reach, 2 * reach), size, at, turned=turned), colour, top, left)


def sprite(random: Random, softness: float) -> tuple[Array, Array]:
    """Return a coloured blob with a glyph in it, and its alpha, 0..1, which falls off over `softness` pixels."""
    height, width = (int(one) for one in random.integers(36, 90, 2))
    rows, cols = np.mgrid[:height, :width] + 0.5
    angle = np.arctan2(rows - height / 2, cols - width / 2)
    reach = 0.72 + sum(random.uniform(0, 0.12) * np.cos(turn * angle + random.uniform(0, 6.3)) for turn in (1, 2, 3, 5))
    inside = reach - np.hypot((rows - height / 2) / (height / 2), (cols - width / 2) / (width / 2))
    alpha = np.clip(0.5 + inside * min(height, width) / 2 / max(1.0, softness), 0, 1)
    colours = random.uniform(30, 225, 3) + 30 * np.dstack([fractal(height, width, 1.2, random) for _ in range(3)])
    coloured = np.clip(colours, 0, 255)
    side = 0.5 * min(height, width)
    at = (height - side) / 2, (width - side) / 2
    glyph = GLYPHS[str(random.choice(sorted(GLYPHS)))]
    paint(coloured, coverage(glyph, (height, width), side, at, 3.0), random.uniform(0, 255, 3), 0, 0)
    return coloured.astype(np.uint8), alpha.astype(np.float32)
