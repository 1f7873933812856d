"""Template searches with known truth, of the kinds that users bring, each generated from its kind and a seed.

They are independent of how the search works. The rules of truth:

- A place is right if the centre of its visible part is right to 2 px or 4 % of its side; if sizes and angles are
  searched, also its size to 5 % and its angle to 5 degrees, or to 1.5 px at the sides of a small template.
- All places that show the template must be named, and no others: one sibling among 30 copies is a wrong place, one copy
  too few is a miss.
- A sibling (another mark in the same outline, another word on the same button), a mirror image, another colour of the
  same object and another landscape are not the template, whatever their correlation. Changes of white balance, gain
  and gamma of the whole picture, compression, noise and a shift by part of a pixel leave it the template.
- A pale (disabled) form alone is found correctly only with a reason other than "clear"; it may also be not found.
  Beside the normal form, only the latter is right.
- A template that is partly covered or partly outside the picture is present. An icon is never covered: with its mark
  covered, nobody could distinguish it from its sibling.
"""

from __future__ import annotations

import colorsys
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from typing import Any, TypeAlias

import cv2
import numpy as np

from benchmarks.pairs import DATA
from benchmarks.screens import (
    FAMILIES,
    GLYPHS,
    PALETTE,
    UNIT,
    WORDS,
    Array,
    Colour,
    Icon,
    Lamp,
    Layout,
    Panel,
    Part,
    Random,
    Text,
    Theme,
    Widget,
    button_at,
    coverage,
    detailed_place,
    fractal,
    has_detail,
    icon_at,
    is_symmetric,
    landscape,
    layout,
    paint,
    part_of,
    photograph,
    photographs,
    product,
    put,
    rounded,
    siblings,
    sprite,
    text_width,
    theme,
)
from stereolag import read_image
from stereolag.samples import mazes


@dataclass(frozen=True)
class Place:
    """The upright box of a template, including any part outside the picture, px; its scale, and its angle, degrees."""

    row: float
    col: float
    height: float
    width: float
    scale: float = 1.0
    rotation: float = 0.0

    def middle(self, shape: Sequence[int]) -> tuple[float, float]:
        """Return the centre of the part that is visible in a picture of this shape."""
        ends = ((self.row, self.height, shape[0]), (self.col, self.width, shape[1]))
        row, col = ((max(0.0, start) + min(start + size, end)) / 2 for start, size, end in ends)
        return row, col

    def is_near(self, other: Place, shape: Sequence[int]) -> bool:
        """Return whether another place has the same centre, to 2 px or 4 % of the side of this place."""
        here, there = self.middle(shape), other.middle(shape)
        sides = self.height, self.width
        return all(abs(a - b) <= max(2.0, 0.04 * side) for a, b, side in zip(here, there, sides, strict=True))

    def has_pose(self, other: Place) -> bool:
        """Return whether another place has the same size, to 5 %, and angle, to 5 degrees or 1.5 px at its sides."""
        turned = abs((self.rotation - other.rotation + 180) % 360 - 180)
        tolerance = max(5.0, float(np.degrees(4 / max(self.height, self.width))))
        return abs(other.scale / self.scale - 1) <= 0.05 and turned <= tolerance


@dataclass(frozen=True)
class Trial:
    """A picture, a template, and all places that show it.

    Attributes
    ----------
    picture, template, mask, options
        Arguments of :func:`stereolag.match_template`.
    places
        The places of the template; none if it is absent.
    pale
        Places of a pale form, which may be named with a reason other than "clear".
    """

    picture: Array
    template: Array
    places: tuple[Place, ...]
    mask: Array | None = None
    options: dict[str, Any] = field(default_factory=dict)
    pale: tuple[Place, ...] = ()


Kind: TypeAlias = Callable[[Random], Trial]

SCALES = (0.7, 1.4)
"""Range of sizes searched, relative to the template's own."""

ROTATIONS = (-30.0, 30.0)
"""Range of angles searched, degrees."""


# --- Ways to alter a picture ------------------------------------------------------------------------------------------


def as_jpeg(picture: Array, quality: int) -> Array:
    """Return a picture after JPEG compression."""
    shown = picture[:, :, ::-1] if picture.ndim == 3 else picture
    _, data = cv2.imencode(".jpg", np.ascontiguousarray(shown), [cv2.IMWRITE_JPEG_QUALITY, quality])
    read = cv2.imdecode(data, cv2.IMREAD_UNCHANGED)
    return np.ascontiguousarray(read[:, :, ::-1]) if picture.ndim == 3 else np.asarray(read)


def noisy(picture: Array, sigma: float, random: Random) -> Array:
    """Return a picture with Gaussian noise of this standard deviation."""
    return np.asarray(np.clip(np.rint(picture + random.normal(scale=sigma, size=picture.shape)), 0, 255), np.uint8)


def degraded(picture: Array, random: Random) -> Array:
    """Return a picture unchanged, compressed as JPEG, with noise, or with less contrast and another brightness."""
    way = int(random.integers(4))
    if way == 1:
        return as_jpeg(picture, int(random.integers(40, 96)))
    if way == 2:
        return noisy(picture, float(random.uniform(2, 10)), random)
    if way == 3:
        return np.asarray(np.rint(picture * random.uniform(0.6, 1) + random.uniform(0, 40)).clip(0, 255), np.uint8)
    return picture


def in_other_light(picture: Array, random: Random) -> Array:
    """Return a picture with another gain and offset in each channel."""
    gains = random.uniform(0.72, 1, 3)
    return np.asarray(np.rint(picture * gains / gains.max() * 0.95 + random.uniform(0, 12, 3)).clip(0, 255), np.uint8)


# --- Ways to choose a template ----------------------------------------------------------------------------------------


def cut(picture: Array, place: Place) -> Array:
    """Return the pixels of a place in whole pixels."""
    row, col = int(place.row), int(place.col)
    return picture[row : row + int(place.height), col : col + int(place.width)].copy()


def box(widget: Widget, scale: float, margin: int, shape: Sequence[int]) -> Place:
    """Return the place of a widget with a margin, in whole pixels, within the picture."""
    top, left = (max(0, int(np.floor(start * scale)) - margin) for start in (widget.row, widget.col))
    bottom = min(shape[0], int(np.ceil((widget.row + widget.height) * scale)) + margin)
    right = min(shape[1], int(np.ceil((widget.col + widget.width) * scale)) + margin)
    return Place(top, left, bottom - top, right - left)


def screen_with(random: Random, is_suitable: Callable[[Widget], bool] = lambda _: True) -> tuple[Layout, Widget]:
    """Return a screen and one of its unique widgets that is suitable."""
    while True:
        screen = layout(random)
        widgets = [one for one in screen.unique_widgets() if is_suitable(one)]
        if widgets:
            return screen, widgets[int(random.integers(len(widgets)))]


def is_icon(widget: Widget) -> bool:
    return any(isinstance(part, Icon) for part in widget.parts)


def is_word(widget: Widget) -> bool:
    return widget.key in WORDS


def is_filled(widget: Widget) -> bool:
    """Return whether a widget has white text on a colour."""
    return any(isinstance(part, Text) and part.colour == (255, 255, 255) for part in widget.parts)


def with_name(widget: Widget, name: str) -> Widget:
    """Return an icon or a button with another glyph or word."""
    parts = []
    for part in widget.parts:
        if isinstance(part, Icon):
            part = replace(part, name=name)
        if isinstance(part, Text):
            part = replace(part, text=name)
        parts.append(part)
    return replace(widget, key=name, parts=tuple(parts))


def with_colour(widget: Widget, colour: Callable[[Colour], Colour]) -> Widget:
    """Return a widget with its icons, words and lamps in other colours."""
    parts = (
        replace(part, colour=colour(part.colour)) if isinstance(part, Icon | Text | Lamp) else part
        for part in widget.parts
    )
    return replace(widget, parts=tuple(parts))


def piece(random: Random, low: int = 48, high: int = 150) -> tuple[Array, Place]:
    """Return a photograph and a place in it with detail."""
    while True:
        picture = photograph(random)
        place = place_in(picture, random, low, high)
        if has_detail(cut(picture, place)):
            return picture, place


def place_in(picture: Array, random: Random, low: int = 48, high: int = 150) -> Place:
    """Return a place with detail in a picture, or the last place tried."""
    height, width = (int(random.integers(low, max(low + 1, min(high, side // 2)))) for side in picture.shape[:2])
    return Place(*detailed_place(picture, height, width, random), height, width)


def screen_piece(random: Random) -> tuple[Array, Place]:
    """Return a screen and a place with several widgets in it."""
    while True:
        picture = layout(random).drawn()
        height, width = int(random.integers(70, 170)), int(random.integers(110, 260))
        row, col = detailed_place(picture, height, width, random)
        place = Place(row, col, height, width)
        if has_detail(cut(picture, place)):
            return picture, place


# --- Screens and photographs ------------------------------------------------------------------------------------------


def screens(random: Random) -> Trial:
    """An icon, a button, a word or a part of a screen at 100 to 150 %, cut from it."""
    scale = float(random.choice([1, 1.1, 1.25, 1.33, 1.5]))
    if random.random() < 0.2:
        picture, place = screen_piece(random)
    else:
        screen, widget = screen_with(random)
        picture = screen.drawn(scale)
        place = box(widget, scale, int(random.integers(0, 6)), picture.shape)
    return Trial(picture, cut(picture, place), (place,))


def screens_as_jpeg(random: Random) -> Trial:
    """The same for a screen compressed by JPEG of quality 40 to 95."""
    given = screens(random)
    return replace(given, picture=as_jpeg(given.picture, int(random.integers(40, 96))))


def screens_at_other_sizes(random: Random) -> Trial:
    """A widget at 100 % in a screen at 100 to 150 %."""
    screen, widget = screen_with(random, lambda one: one.height >= 20)
    scale = float(random.choice([1, 1.1, 1.25, 1.33, 1.5]))
    plain = screen.drawn()
    place = box(widget, 1, int(random.integers(1, 6)), plain.shape)
    there = Place(place.row * scale, place.col * scale, place.height * scale, place.width * scale, scale)
    return Trial(screen.drawn(scale), cut(plain, place), (there,), options={"scales": (0.9, 1.6)})


def photographs_as_taken(random: Random) -> Trial:
    """A part of a photograph, in that photograph as JPEG, with noise, or in other light."""
    picture, place = piece(random)
    return Trial(degraded(picture, random), cut(picture, place), (place,))


def photographs_turned_and_resized(random: Random) -> Trial:
    """A part of a photograph, in that photograph turned by up to 30 degrees and resized to 70 to 140 %."""
    while True:
        picture, place = piece(random, 56, 130)
        scale, rotation = float(np.exp(random.uniform(*np.log(SCALES)))), float(random.uniform(*ROTATIONS))
        size = round(picture.shape[1] * scale), round(picture.shape[0] * scale)
        middle = (picture.shape[1] - 1) / 2, (picture.shape[0] - 1) / 2
        matrix = cv2.getRotationMatrix2D(middle, rotation, scale)
        matrix[:, 2] += (size[0] - 1) / 2 - middle[0], (size[1] - 1) / 2 - middle[1]
        soft = picture if scale > 1 else cv2.GaussianBlur(picture, (0, 0), 0.35 / scale)
        turned = cv2.warpAffine(soft, matrix, size, flags=cv2.INTER_CUBIC, borderMode=cv2.BORDER_REFLECT)
        rows, cols = (place.row, place.row + place.height), (place.col, place.col + place.width)
        corners = np.array([[x, y] for y in rows for x in cols]) - 0.5
        at = corners @ matrix[:, :2].T + matrix[:, 2] + 0.5
        (left, top), (right, bottom) = at.min(axis=0), at.max(axis=0)
        if left >= 0 and top >= 0 and right <= size[0] and bottom <= size[1]:
            there = Place(top, left, bottom - top, right - left, scale, rotation)
            options = {"scales": SCALES, "rotations": ROTATIONS}
            return Trial(degraded(turned, random), cut(picture, place), (there,), options=options)


def photographs_without_room(random: Random) -> Trial:
    """A part of a photograph or landscape so large that no second one fits beside it."""
    picture = landscape(random, 150, 200) if random.random() < 0.5 else photograph(random, 180, 240)
    shares = random.uniform(0.55, 0.95, 2)
    height, width = (int(share * side) for share, side in zip(shares, picture.shape, strict=False))
    row, col = detailed_place(picture, height, width, random)
    place = Place(row, col, height, width)
    return Trial(degraded(picture, random), cut(picture, place), (place,))


# --- Parts of a pixel, light ------------------------------------------------------------------------------------------


def icons_off_the_grid(random: Random) -> Trial:
    """An icon, in a screen whose icons are shifted by a quarter to three quarters of a pixel."""
    return _off_the_grid(random, is_icon)


def symmetric_icons_off_the_grid(random: Random) -> Trial:
    """The same for icons that are their own mirror image."""
    return _off_the_grid(random, lambda one: is_icon(one) and is_symmetric(one.key))


def _off_the_grid(random: Random, is_suitable: Callable[[Widget], bool]) -> Trial:
    screen, widget = screen_with(random, is_suitable)
    down, right = (float(random.uniform(0.25, 0.75)) for _ in range(2))
    shift = ((0.0, right), (down, 0.0), (down, right))[int(random.integers(3))]
    plain = screen.drawn()
    place = box(widget, 1, int(random.integers(1, 5)), plain.shape)
    return Trial(screen.drawn(shift=shift), cut(plain, place), (place,))


def other_white_balance(random: Random) -> Trial:
    """A part of a photograph or a screen, with another gain and offset in each channel."""
    picture, place = piece(random) if random.random() < 0.6 else screen_piece(random)
    return Trial(in_other_light(picture, random), cut(picture, place), (place,))


def icons_in_other_white_balance(random: Random) -> Trial:
    """An icon or a word, in its screen with another gain and offset in each channel."""
    screen, widget = screen_with(random)
    picture = screen.drawn()
    place = box(widget, 1, int(random.integers(1, 5)), picture.shape)
    return Trial(in_other_light(picture, random), cut(picture, place), (place,))


def other_gamma(random: Random) -> Trial:
    """A part of a photograph or a screen with another gamma."""
    picture, place = piece(random) if random.random() < 0.6 else screen_piece(random)
    gamma = float(np.exp(random.uniform(-0.6, 0.6)))
    shown = np.rint(255 * (picture / 255) ** gamma).astype(np.uint8)
    return Trial(shown, cut(picture, place), (place,))


# --- Covered, outside -------------------------------------------------------------------------------------------------


def covered_by_10_to_30_percent(random: Random) -> Trial:
    """A part of a photograph or screen, of which 10 to 30 % is covered from a side, from a corner or in its middle."""
    return _covered(random, 0.1, 0.3)


def covered_by_30_to_40_percent(random: Random) -> Trial:
    """The same with 30 to 40 % covered."""
    return _covered(random, 0.3, 0.4)


def _covered(random: Random, min_share: float, max_share: float) -> Trial:
    picture, place = piece(random, 60) if random.random() < 0.5 else screen_piece(random)
    template, shown = cut(picture, place), picture.copy()
    share, way = random.uniform(min_share, max_share), int(random.integers(3))
    height, width = int(place.height), int(place.width)
    if way == 0 and random.random() < 0.5:
        tall, wide = height, round(share * width)
    elif way == 0:
        tall, wide = round(share * height), width
    else:
        ratio = np.sqrt(share) * np.exp(random.uniform(-0.3, 0.3))
        tall = round(min(1.0, ratio) * height)
        wide = min(width, round(share * height * width / tall))
    row, col = (int(random.choice([0, room])) for room in (height - tall, width - wide))
    if way == 2:
        row, col = (int(random.integers(room + 1)) for room in (height - tall, width - wide))
    row, col = row + int(place.row), col + int(place.col)
    cover = shown[row : row + tall, col : col + wide]
    filling = int(random.integers(3))
    if filling == 0:
        cover[:] = random.integers(0, 256, 3)
    elif filling == 1:
        other = photograph(random)
        cover[:] = cv2.resize(part_of(other, (2 * tall, 2 * wide), random), (wide, tall), interpolation=cv2.INTER_AREA)
    else:
        note = Panel(0, 0, tall, wide, (255, 255, 225), (90, 90, 90))
        words = [Text(6 + 18 * index, 6, 12, " ".join(random.choice(WORDS, 4)), (40, 40, 40)) for index in range(20)]
        parts = Widget("note", 0, 0, tall, wide, (note, *words))
        cover[:] = Layout(tall, wide, theme(random), (parts,)).drawn()
    return Trial(shown, template, (place,))


def outside_by_5_to_30_percent(random: Random) -> Trial:
    """A part of a photograph or screen, of which 5 to 30 % is outside the picture, at a side or a corner."""
    return _outside(random, 0.05, 0.3)


def outside_by_30_to_50_percent(random: Random) -> Trial:
    """The same with 30 to 50 % outside."""
    return _outside(random, 0.3, 0.5)


def _outside(random: Random, min_share: float, max_share: float) -> Trial:
    while True:
        picture, place = piece(random) if random.random() < 0.6 else screen_piece(random)
        share = random.uniform(min_share, max_share)
        corner = random.random() < 0.3
        split = random.uniform(0.2, 0.8) if corner else float(random.integers(2))
        inside = (1 - share) ** split, (1 - share) ** (1 - split)
        ends = []
        for start, size, length, part in zip(
            (place.row, place.col), (place.height, place.width), picture.shape, inside, strict=False
        ):
            first, last = 0, length
            if part < 1 and random.random() < 0.5:
                first = round(start + (1 - part) * size)
            elif part < 1:
                last = round(start + part * size)
            ends.append((first, last))
        (top, bottom), (left, right) = ends
        shown = picture[top:bottom, left:right].copy()
        visible = picture[max(top, int(place.row)) : bottom, max(left, int(place.col)) : right]
        visible = visible[: int(place.height), : int(place.width)]
        if shown.shape[0] > place.height and shown.shape[1] > place.width and has_detail(visible):
            there = replace(place, row=place.row - top, col=place.col - left)
            return Trial(shown, cut(picture, place), (there,))


# --- Drawn over -------------------------------------------------------------------------------------------------------


def _word_or_piece(random: Random) -> tuple[Array, Place]:
    """Return a screen and the place of a button, a word, or a part with several widgets."""
    if random.random() < 0.4:
        return screen_piece(random)
    screen, widget = screen_with(random, is_word)
    picture = screen.drawn()
    return picture, box(widget, 1, int(random.integers(2, 7)), picture.shape)


def _mixed(picture: Array, rows: slice, cols: slice, colour: Array, share: float | Array) -> None:
    """Mix a colour into a part of a picture, in place."""
    part = picture[rows, cols]
    part[:] = np.rint(part + np.asarray(share) * (colour - part.astype(float)))


def text_cursors(random: Random) -> Trial:
    """A word, a button or a part of a screen, with a text cursor of 1 or 2 px over it."""
    picture, place = _word_or_piece(random)
    shown = picture.copy()
    high, wide = min(int(random.integers(15, 23)), int(place.height)), int(random.integers(1, 3))
    row = int(place.row) + int(random.integers(int(place.height) - high + 1))
    col = int(place.col) + int(random.integers(2, int(place.width) - wide - 1))
    ground = np.median(shown[row : row + high, col : col + wide], axis=(0, 1))
    ink = (0, 0, 0) if ground.mean() > 110 else (255, 255, 255)
    shown[row : row + high, col : col + wide] = ink
    return Trial(shown, cut(picture, place), (place,))


def _pixels(widget: Widget, margin: int = 0) -> tuple[slice, slice]:
    """Return the rows and columns of a widget with a margin, px."""
    first, last = (int(widget.row), int(widget.col)), (widget.row + widget.height, widget.col + widget.width)
    rows, cols = (
        slice(max(0, start - margin), int(np.ceil(end)) + margin) for start, end in zip(first, last, strict=True)
    )
    return rows, cols


POINTER = ("1 1", "1 17", "5 13.5", "8 20", "10.5 19", "7.5 12.5", "12.5 12.5")
"""The corners of a mouse pointer, x and y, px."""


def mouse_pointers(random: Random) -> Trial:
    """A part of a screen or a photograph, with a mouse pointer over it."""
    picture, place = screen_piece(random) if random.random() < 0.6 else piece(random, 60)
    shown, scale = picture.copy(), float(random.choice([1, 1.25, 1.5]))
    corners = np.array([corner.split() for corner in POINTER], float) * scale
    row = place.row + float(random.uniform(0, max(1, place.height - 22 * scale)))
    col = place.col + float(random.uniform(0, max(1, place.width - 14 * scale)))
    at = np.rint((corners + np.array([col, row])) * 16).astype(np.int32)
    fill, line = ((255, 255, 255), (0, 0, 0)) if random.random() < 0.6 else ((0, 0, 0), (255, 255, 255))
    cv2.fillPoly(shown, [at], fill, cv2.LINE_AA, 4)
    cv2.polylines(shown, [at], True, line, 1, cv2.LINE_AA, 4)
    return Trial(shown, cut(picture, place), (place,))


def selected(random: Random) -> Trial:
    """A word, a button or a part of a screen, tinted as if selected: all of it, or some of its rows or columns."""
    picture, place = _word_or_piece(random)
    shown, colour = picture.copy(), random.uniform([0, 60, 150], [90, 150, 255])
    rows = slice(int(place.row), int(place.row + place.height))
    cols = slice(int(place.col), int(place.col + place.width))
    way, part = int(random.integers(3)), random.uniform(0.3, 0.8)
    if way == 1:
        rows = slice(rows.start, rows.start + int(part * place.height))
    if way == 2:
        cols = slice(cols.start, cols.start + int(part * place.width))
    _mixed(shown, rows, cols, colour, float(random.uniform(0.15, 0.45)))
    return Trial(shown, cut(picture, place), (place,))


def focus_rings(random: Random) -> Trial:
    """A button or a word within a ring or a dotted line, as if it had the focus."""
    screen, widget = screen_with(random, is_word)
    picture = screen.drawn()
    margin = int(random.integers(3, 7))
    place = box(widget, 1, margin, picture.shape)
    shown, thickness, gap = picture.copy(), int(random.integers(1, 3)), int(random.integers(0, 3))
    colour = random.uniform([0, 60, 150], [90, 150, 255])
    rows, cols = _pixels(widget, gap + thickness)
    ring = np.zeros(shown.shape[:2], bool)
    ring[rows, cols] = True
    ring[_pixels(widget, gap)] = False
    if random.random() < 0.3:
        ring &= np.add.outer(np.arange(shown.shape[0]), np.arange(shown.shape[1])) % 2 == 0
    shown[ring] = colour
    return Trial(shown, cut(picture, place), (place,))


def badges(random: Random) -> Trial:
    """A button or a part of a screen, with a red dot with a number over a corner."""
    picture, place = _word_or_piece(random)
    shown, reach = picture.copy(), int(random.integers(6, 10))
    row, col = place.row + reach * random.uniform(0, 0.8), place.col + place.width - reach * random.uniform(0, 0.8)
    middle = round(16 * col), round(16 * row)
    cv2.circle(shown, middle, 16 * reach, (220, 30, 40), -1, cv2.LINE_AA, 4)
    digit = str(int(random.integers(1, 10)))
    cv2.putText(
        shown, digit, (round(col) - 3, round(row) + 4), cv2.FONT_HERSHEY_PLAIN, 0.8, (255, 255, 255), 1, cv2.LINE_AA
    )
    return Trial(shown, cut(picture, place), (place,))


def scroll_bars(random: Random) -> Trial:
    """A part of a screen or a photograph, with a scroll bar over its right or lower side."""
    picture, place = screen_piece(random) if random.random() < 0.6 else piece(random, 70)
    shown, wide, tone = picture.copy(), int(random.integers(8, 16)), int(random.integers(190, 245))
    if random.random() < 0.5:
        shown, place = shown.swapaxes(0, 1), Place(place.col, place.row, place.width, place.height)
    col = int(place.col + place.width) - wide + int(random.integers(0, 3))
    bar = shown[:, col : col + wide]
    bar[:] = tone
    first = int(random.integers(bar.shape[0] // 2))
    bar[first : first + bar.shape[0] // 3, 2:-2] = tone - 60
    if shown.base is not None:
        shown, place = (
            np.ascontiguousarray(shown.swapaxes(0, 1)),
            Place(place.col, place.row, place.width, place.height),
        )
    return Trial(shown, cut(picture, place), (place,))


def drop_shadows(random: Random) -> Trial:
    """A button, a word's box or an icon, with a shadow around it that the template does not have."""
    screen, widget = screen_with(
        random, lambda one: is_word(one) and any(isinstance(part, Panel) for part in one.parts)
    )
    picture = screen.drawn()
    place = box(widget, 1, int(random.integers(2, 7)), picture.shape)
    shadow: Array = np.zeros(picture.shape[:2], np.float32)
    down, right = int(random.integers(0, 4)), int(random.integers(-1, 3))
    rows, cols = _pixels(widget)
    shadow[rows.start + down : rows.stop + down, max(0, cols.start + right) : cols.stop + right] = random.uniform(
        0.25, 0.6
    )
    shadow = np.asarray(cv2.GaussianBlur(shadow, (0, 0), float(random.uniform(1.5, 5))))
    radius = max(part.radius for part in widget.parts if isinstance(part, Panel))
    own = shadow[rows, cols]
    own *= 1 - rounded(*own.shape, radius)
    shown = np.rint(picture * (1 - shadow[:, :, None])).astype(np.uint8)
    return Trial(shown, cut(picture, place), (place,))


def _message(text: str, row: float, look: Theme, width: float) -> Widget:
    """Return a line of a chat: a bubble with words in it."""
    parts = (Panel(row, 40, 26, width, look.card, look.border, 8), Text(row + 5, 52, 13, text, look.ink))
    return Widget(text, row, 40, 26, width, parts)


def _chat(random: Random, is_present: bool) -> Trial:
    look = theme(random)
    texts = [" ".join(str(one) for one in random.choice(WORDS, int(random.integers(2, 6)))) for _ in range(11)]
    width = float(random.integers(220, 320))
    rows = [20 + 34 * number for number in range(10)]
    lines = (_message(text, row, look, width) for text, row in zip(texts, rows, strict=False))
    shown = Layout(380, 420, look, tuple(lines))
    picture = as_jpeg(shown.drawn(), int(random.integers(60, 81)))
    number = int(random.integers(10))
    wanted = texts[number] if is_present else texts[10]
    at = _message(wanted, rows[number], look, width)
    place = box(at, 1, int(random.integers(0, 5)), picture.shape)
    template = cut(shown.exchanged(shown.widgets[number], at).drawn(), place)
    return Trial(picture, template, (place,) if is_present else ())


def messages(random: Random) -> Trial:
    """A message in a chat, compressed by JPEG of quality 60 to 80."""
    return _chat(random, True)


def other_messages(random: Random) -> Trial:
    """A message that is not in the chat, which has others in equal bubbles."""
    return _chat(random, False)


def buttons_of_a_near_colour(random: Random) -> Trial:
    """A coloured button with a white or dark word, where there is only a button in another hue."""
    hue = float(random.uniform(0, 360))
    other = hue + float(random.choice([-1, 1])) * float(random.uniform(30, 70))
    light, vivid = float(random.uniform(0.3, 0.6)), float(random.uniform(0.5, 1))

    def colour(angle: float) -> Colour:
        shown = colorsys.hls_to_rgb(angle % 360 / 360, light, vivid)
        return tuple(round(255 * one) for one in shown)  # type: ignore[return-value]

    look, word = theme(random), str(random.choice(WORDS))
    height, width = float(random.integers(24, 40)), float(random.integers(80, 120))
    one, another = (button_at(word, 40, 60, height, width, look, colour(angle)) for angle in (hue, other))
    shape = 160, 300
    picture, plain = (Layout(*shape, look, (shown,)).drawn() for shown in (another, one))
    place = box(one, 1, int(random.integers(0, 5)), shape)
    return Trial(degraded(picture, random) if random.random() < 0.4 else picture, cut(plain, place), ())


def grey_in_colours(random: Random) -> Trial:
    """A grey part of a colour picture, or a colour part of a grey picture, each in 8 or 16 bits."""
    picture, place = piece(random) if random.random() < 0.6 else screen_piece(random)
    grey = cv2.cvtColor(picture, cv2.COLOR_RGB2GRAY)

    def deep(shown: Array) -> Array:
        return shown.astype(np.uint16) * 257 if random.random() < 0.6 else shown

    if random.random() < 0.7:
        return Trial(deep(picture), deep(cut(grey, place)), (place,))
    return Trial(deep(grey), deep(cut(picture, place)), (place,))


# --- Alpha and masks --------------------------------------------------------------------------------------------------


def _composed(random: Random, coloured: Array, alpha: Array) -> tuple[Array, Place]:
    """Return a photograph or screen with a sprite over it where it is visible, and its place."""
    while True:
        plain = photograph(random, 360, 480) if random.random() < 0.7 else layout(random, 360, 480).drawn()
        rooms = (side - size + 1 for side, size in zip(plain.shape, alpha.shape, strict=False))
        row, col = (int(random.integers(room)) for room in rooms)
        place, picture = Place(row, col, *alpha.shape), plain.copy()
        paint(picture, alpha, coloured, row, col)
        change = np.abs(cut(picture, place).astype(float) - cut(plain, place)).max(axis=2)
        if (change * alpha).sum() > 25 * alpha.sum():
            return picture, place


def _with_alpha(coloured: Array, alpha: Array) -> Array:
    return np.dstack([coloured, np.rint(255 * alpha).astype(np.uint8)])


def soft_alpha(random: Random) -> Trial:
    """A sprite whose alpha falls off over 1 to 12 px, or is 254 in all pixels but one."""
    coloured, alpha = sprite(random, float(random.uniform(1, 12)))
    if random.random() < 0.3:
        alpha = np.minimum(alpha, 254 / 255)
        alpha[alpha.shape[0] // 2, alpha.shape[1] // 2] = 1
    picture, place = _composed(random, coloured, alpha)
    return Trial(picture, _with_alpha(coloured, alpha), (place,))


def other_sprites(random: Random) -> Trial:
    """A sprite with soft alpha, where only another sprite is in the picture."""
    given, other = soft_alpha(random), soft_alpha(random)
    return replace(given, template=other.template, places=())


def glows(random: Random) -> Trial:
    """A glow that falls off from its centre to its border, with an alpha of 60 to 100 % in the centre only."""
    side = int(random.integers(36, 100))
    distance = np.hypot(*(np.mgrid[:side, :side] - (side - 1) / 2)) / (side / 2)
    alpha = random.uniform(0.6, 1) * np.clip(1 - distance, 0, 1) ** random.uniform(0.5, 1.5)
    inner, outer = random.uniform(170, 255, 3), random.uniform(0, 255, 3)
    coloured = outer + (inner - outer) * np.exp(-((distance / random.uniform(0.3, 0.6)) ** 2))[:, :, None]
    rays = 1 + 0.25 * np.cos(int(random.integers(2, 7)) * np.arctan2(*(np.mgrid[:side, :side] - (side - 1) / 2)))
    coloured = np.clip(coloured * rays[:, :, None], 0, 255).astype(np.uint8)
    picture, place = _composed(random, coloured, alpha.astype(np.float32))
    return Trial(picture, _with_alpha(coloured, alpha), (place,))


def blurred_masks(random: Random) -> Trial:
    """A sprite on another background, with a mask that is blurred or compressed by JPEG, so that it is nowhere 0."""
    coloured, alpha = sprite(random, 1.0)
    picture, place = _composed(random, coloured, alpha)
    other = cv2.resize(part_of(photograph(random), (200, 200), random), alpha.shape[::-1])
    paint(other, alpha, coloured, 0, 0)
    mask = np.rint(255 * alpha).astype(np.uint8)
    if random.random() < 0.5:
        mask = cv2.GaussianBlur(mask, (0, 0), float(random.uniform(1, 4)))
    else:
        mask = as_jpeg(mask, int(random.integers(20, 90)))
    return Trial(picture, other, (place,), mask=mask)


def _silhouette(random: Random) -> tuple[str, Array, Array, Callable[[str], tuple[Array, Array]]]:
    name, size = str(random.choice(sorted(GLYPHS))), int(random.integers(24, 81))
    shape, weight = (size + 4, size + 4), float(random.uniform(2, 4))
    tones = ((0, 0, 0), (255, 255, 255), (255, 200, 0), (220, 0, 40), (0, 90, 200))
    colour = np.array(tones[int(random.integers(len(tones)))])
    while True:
        picture = photograph(random, 360, 480)
        row, col = (int(random.integers(side - shape[0] + 1)) for side in picture.shape[:2])
        near = picture[row : row + shape[0], col : col + shape[1]].astype(float)
        # A silhouette is not visible on a background of its own colour.
        if np.percentile(np.abs(near - colour).max(axis=2), 10) > 60:
            break

    def drawn(named: str) -> tuple[Array, Array]:
        alpha = coverage(GLYPHS[named], shape, size, (2, 2), weight)
        shown = picture.copy()
        paint(shown, alpha, colour, row, col)
        return shown, _with_alpha(np.broadcast_to(colour, (*shape, 3)).astype(np.uint8), alpha)

    return name, np.array([row, col, *shape]), colour, drawn


def silhouettes(random: Random) -> Trial:
    """A glyph of one colour, with its shape in the alpha only, on a photograph."""
    name, place, _, drawn = _silhouette(random)
    picture, template = drawn(name)
    return Trial(picture, template, (Place(*place.tolist()),))


def other_silhouettes(random: Random) -> Trial:
    """A silhouette, where only a sibling or nothing is on the photograph."""
    name, _, _, drawn = _silhouette(random)
    template = drawn(name)[1]
    picture = drawn(str(random.choice(siblings(name))))[0] if random.random() < 0.5 else photograph(random, 360, 480)
    return Trial(picture, template, ())


# --- Copies -----------------------------------------------------------------------------------------------------------


def copies(random: Random) -> Trial:
    """1 to 70 equal icons among their siblings, with more matches requested than there are."""
    count, look = int(random.integers(1, 71)), theme(random)
    size, frame = float(random.choice([20, 24, 32])), float(random.choice([0, 0, 5, 8]))
    pitch = int(size + 2 * frame + random.integers(2, 14))
    cells = [(row, col) for row in range(10) for col in range(14)]
    wanted = str(random.choice(look.glyphs))
    others = [one for one in (*siblings(wanted), *look.glyphs) if one != wanted]
    colour = look.icons[int(random.integers(len(look.icons)))]
    widgets = []
    for index, cell in enumerate(random.permutation(cells)[: count + int(random.integers(10, 60))].tolist()):
        name = wanted if index < count else str(random.choice(others))
        widgets.append(icon_at(name, 20 + cell[0] * pitch, 20 + cell[1] * pitch, size, look, colour, frame))
    picture = Layout(10 * pitch + 40, 14 * pitch + 40, look, tuple(widgets)).drawn()
    margin = int(random.integers(0, 2))
    places = tuple(box(one, 1, margin, picture.shape) for one in widgets[:count])
    wished = count + int(random.integers(1, 40))
    return Trial(picture, cut(picture, places[0]), places, options={"max_matches": wished})


def rows_of_a_list(random: Random) -> Trial:
    """1 to 12 equal rows of a list among rows with other names, with more matches requested than there are."""
    count, look = int(random.integers(1, 13)), theme(random)
    total, pitch = count + int(random.integers(5, 18)), int(random.integers(18, 28))
    width = int(random.integers(240, 480))
    names = random.permutation([f"{one} {other}" for one in WORDS[:20] for other in WORDS[20:30]])
    glyph, colour = str(random.choice(look.glyphs)), look.icons[0]
    order = random.permutation(total)
    widgets: list[Widget] = []
    for index, slot in enumerate(order.tolist()):
        row = 10 + slot * pitch
        name = str(names[0] if index < count else names[index])
        icon = Icon(row + (pitch - 16) // 2, 26, 16, glyph, colour, look.weight)
        label = Text(row + pitch // 2 - 8, 50, 13, name, look.ink)
        kept = Text(row + pitch // 2 - 8, 190, 13, "12.05.2026", look.ink)
        edge = Panel(row + pitch - 1, 20, 1, width, look.border)
        widgets.append(Widget(name, row, 20, pitch, width, (edge, icon, label, kept)))
    picture = Layout(total * pitch + 20, width + 40, look, tuple(widgets)).drawn()
    places = tuple(box(one, 1, 0, picture.shape) for one in widgets[:count])
    wished = count + int(random.integers(1, 20))
    return Trial(picture, cut(picture, places[0]), places, options={"max_matches": wished})


def copies_at_any_angle(random: Random) -> Trial:
    """1 to 20 equal labels on a table at any angle, also of 75 to 130 %, with more matches requested than there are."""
    return _labels(random, int(random.integers(1, 21)))


def other_labels_at_any_angle(random: Random) -> Trial:
    """A label, where only other labels are on the table."""
    return _labels(random, 0)


def _labels(random: Random, count: int) -> Trial:
    """Return a table with `count` equal labels and up to four others, at least one if `count` is 0."""
    size, resized = float(random.integers(32, 50)), random.random() < 0.4
    wanted, ground = product(random), random.uniform(60, 235, 3)
    picture = np.clip(ground + 4 * fractal(440, 600, 0.5, random)[:, :, None], 0, 255).astype(np.uint8)
    side = int(size)
    template = np.zeros((side, side, 3), np.uint8)
    put(template, wanted, size / 2, size / 2, size, 0)
    high = np.ptp(wanted[0][0][0].points[:, 1]) * size / UNIT
    top = int(np.ceil((size - high) / 2))
    template = template[top : side - top]
    labels = [wanted] * count + [product(random) for _ in range(int(random.integers(count == 0, 5)))]
    taken: list[tuple[float, float]] = []
    places = []
    for index, label in enumerate(labels):
        for _ in range(500):
            row, col = random.uniform(size, 440 - size), random.uniform(size, 600 - size)
            if all(np.hypot(row - y, col - x) >= 1.7 * size for y, x in taken):
                break
        else:
            break
        taken.append((row, col))
        scale = float(random.uniform(0.75, 1.3)) if resized else 1.0
        turned = float(random.uniform(-180, 180))
        put(picture, label, row, col, scale * size, turned)
        cos, sin = abs(np.cos(np.radians(turned))), abs(np.sin(np.radians(turned)))
        tall = scale * (template.shape[0] * cos + template.shape[1] * sin)
        wide = scale * (template.shape[1] * cos + template.shape[0] * sin)
        if index < count:
            places.append(Place(row - tall / 2, col - wide / 2, tall, wide, scale, turned))
    options: dict[str, Any] = {"rotations": (-180.0, 180.0), "max_matches": count + int(random.integers(1, 12))}
    if resized:
        options["scales"] = SCALES
    return Trial(as_jpeg(picture, int(random.integers(80, 97))), template, tuple(places), options=options)


# --- Siblings, colours, disabled forms --------------------------------------------------------------------------------


def the_right_one_of_siblings(random: Random) -> Trial:
    """An icon among all of its siblings, in the same colour and size."""
    given, names = _family(random)
    row = int(random.integers(len(names)))
    picture = given.drawn()
    place = box(given.widgets[row], 1, int(random.integers(0, 4)), picture.shape)
    return Trial(degraded(picture, random), cut(picture, place), (place,))


def siblings_of_icons(random: Random) -> Trial:
    """An icon that is not on the screen, which has one or more of its siblings."""
    screen, widget = screen_with(random, lambda one: is_icon(one) and bool(siblings(one.key)))
    return _exchanged(random, screen, widget, siblings(widget.key))


def siblings_of_words(random: Random) -> Trial:
    """A word or button that is not on the screen, which has similar ones."""
    screen, widget = screen_with(random, is_word)
    long = text_width(widget.key, 13)
    return _exchanged(random, screen, widget, [one for one in WORDS if 0.8 < text_width(one, 13) / long < 1.25])


def siblings_at_other_sizes(random: Random) -> Trial:
    """An icon with only siblings on the screen, searched at 90 to 160 % of its size."""
    given = siblings_of_icons(random)
    return replace(given, options={"scales": (0.9, 1.6)})


def siblings_of_many(random: Random) -> Trial:
    """An icon that is absent, with up to 20 matches requested."""
    given = siblings_of_icons(random)
    return replace(given, options={"max_matches": int(random.integers(2, 21))})


def siblings_without_room(random: Random) -> Trial:
    """An icon searched in a small region around its usual place, where a sibling is."""
    given = siblings_of_icons(random)
    place = given.options.pop("at")
    reach = int(random.integers(2, max(3, min(given.template.shape[:2]) // 2)))
    top, left = max(0, int(place.row) - reach), max(0, int(place.col) - reach)
    bottom, right = int(place.row + place.height) + reach, int(place.col + place.width) + reach
    return replace(given, picture=given.picture[top:bottom, left:right].copy())


def _exchanged(random: Random, screen: Layout, widget: Widget, names: Sequence[str]) -> Trial:
    shown = {one.key for one in screen.widgets}
    absent = [one for one in names if one not in shown] or sorted(set(GLYPHS) - shown)
    other = with_name(widget, str(random.choice(absent)))
    picture = screen.drawn()
    place = box(widget, 1, int(random.integers(0, 5)), picture.shape)
    template = cut(screen.exchanged(widget, other).drawn(), place)
    return Trial(picture, template, (), options={"at": place})


def _in_a_chat(random: Random, is_present: bool) -> Trial:
    if is_present:
        given = screens_at_other_sizes(random)
    else:
        screen, widget = screen_with(random, lambda one: is_icon(one) and one.height >= 20 and bool(siblings(one.key)))
        given = _exchanged(random, screen, widget, siblings(widget.key))
    scale = float(random.choice([0.5, 0.67, 0.75, 0.8]))
    shown = cv2.resize(given.picture, None, fx=scale, fy=scale, interpolation=cv2.INTER_AREA)
    scaled = tuple(
        Place(*(scale * one for one in (at.row, at.col, at.height, at.width)), scale * at.scale) for at in given.places
    )
    return Trial(as_jpeg(shown, int(random.integers(60, 86))), given.template, scaled, options={"scales": (0.45, 1.3)})


def screens_in_a_chat(random: Random) -> Trial:
    """A widget, in a screen that a chat reduced to 50 to 80 % and compressed."""
    return _in_a_chat(random, True)


def siblings_in_a_chat(random: Random) -> Trial:
    """An icon with only siblings in such a screen."""
    return _in_a_chat(random, False)


def other_parts(random: Random) -> Trial:
    """A part of a screen in which some widgets have been exchanged or removed."""
    while True:
        screen = layout(random)
        picture = screen.drawn()
        height, width = int(random.integers(60, 170)), int(random.integers(90, 260))
        place = Place(*detailed_place(picture, height, width, random), height, width)
        template = cut(picture, place)
        inside = [
            one
            for one in screen.widgets
            if place.row <= one.row <= place.row + height - one.height
            and place.col <= one.col <= place.col + width - one.width
            and (is_icon(one) or is_word(one))
        ]
        if len(inside) > 2 and has_detail(template):
            break
    changed = [inside[index] for index in random.permutation(len(inside))[: int(random.integers(1, len(inside)))]]
    gone = random.random() < 0.4
    for one in changed:
        other = with_name(one, str(random.choice(sorted(GLYPHS) if is_icon(one) else WORDS)))
        screen = screen.exchanged(one, replace(one, parts=()) if gone or other == one else other)
    return Trial(screen.drawn(), template, ())


def _rows(random: Random, states: Sequence[str], part: Callable[[str, float, Theme], tuple[Part, ...]]) -> Trial:
    """Return a list, with one of its rows in another state as the template."""
    look = theme(random)
    words = random.choice(WORDS, 8, replace=False).tolist()
    own = [str(random.choice(states)) for _ in words]
    wanted = int(random.integers(len(words)))

    def drawn(shown: Sequence[str]) -> Array:
        rows = (
            Widget(word, top, 12, 28, 200, (Text(top + 6, 12, 14, word, look.ink), *part(state, top, look)))
            for word, state, top in zip(words, shown, range(10, 300, 32), strict=False)
        )
        return Layout(280, 240, replace(look, back=look.card), tuple(rows)).drawn()

    other = str(random.choice([state for state in states if state != own[wanted]]))
    template = drawn([*own[:wanted], other, *own[wanted + 1 :]])
    place = Place(10 + 32 * wanted, 4, 28, 232)
    return Trial(degraded(drawn(own), random), cut(template, place), ())


def other_states(random: Random) -> Trial:
    """A row of a list with a switch or a check box, where only its other state is present."""

    def switch(state: str, top: float, look: Theme) -> tuple[Part, ...]:
        knob = Panel(top + 6, 208 if state == "on" else 190, 16, 16, (255, 255, 255), None, 8)
        return Panel(top + 4, 188, 20, 38, look.accent if state == "on" else (150, 150, 150), None, 10), knob

    def box(state: str, top: float, look: Theme) -> tuple[Part, ...]:
        if state == "off":
            return (Panel(top + 5, 198, 18, 18, look.card, look.border, 3),)
        check = Icon(top + 2, 195, 24, "check", (255, 255, 255), 2.4)
        return Panel(top + 5, 198, 18, 18, look.accent, None, 3), check

    return _rows(random, ("on", "off"), switch if random.random() < 0.5 else box)


def other_digits(random: Random) -> Trial:
    """A row of a list with a time, where one digit differs."""

    def clock(state: str, top: float, look: Theme) -> tuple[Part, ...]:
        return (Text(top + 6, 160, 14, state, look.ink),)

    return _rows(random, ("12:45", "12:46", "12:48", "13:45", "12:15"), clock)


def _family(random: Random) -> tuple[Layout, list[str]]:
    look, names = theme(random), list(FAMILIES[int(random.integers(len(FAMILIES)))])
    random.shuffle(names)
    size, colour = float(random.choice([20, 24, 32])), look.icons[int(random.integers(len(look.icons)))]
    frame = float(random.choice([0, 6]))
    pitch = size + 2 * frame + float(random.integers(6, 20))
    places = [(30 + pitch * (index // 8), 30 + pitch * (index % 8)) for index in range(len(names))]
    widgets = (icon_at(name, *at, size, look, colour, frame) for name, at in zip(names, places, strict=True))
    return Layout(240, 520, look, tuple(widgets)), names


def _coloured(
    random: Random, template: str, shown: Sequence[str], widget_of: Callable[[str, float, float], Widget]
) -> Trial:
    """Return a panel with widgets of these colours, and one of a colour that may be among them as the template."""
    look = theme(random)
    look = replace(look, back=look.card)
    pitch = float(random.integers(60, 100))
    widgets = [widget_of(name, 24 + pitch * (index // 3), 24 + 130 * (index % 3)) for index, name in enumerate(shown)]
    picture = Layout(240, 420, look, tuple(widgets)).drawn()
    margin = int(random.integers(0, 6))
    at = widget_of(template, 24, 24)
    place = box(at, 1, margin, picture.shape)
    wanted = cut(Layout(240, 420, look, (at,)).drawn(), place)
    places = tuple(
        box(one, 1, margin, picture.shape) for one, name in zip(widgets, shown, strict=True) if name == template
    )
    return Trial(degraded(picture, random) if random.random() < 0.4 else picture, wanted, places)


def _colours(random: Random, is_present: bool) -> tuple[str, list[str]]:
    names = [str(one) for one in random.permutation(sorted(PALETTE))]
    shown = [str(random.choice(names[1:])) for _ in range(int(random.integers(1, 8)))]
    if is_present:
        shown.insert(int(random.integers(len(shown) + 1)), names[0])
    return names[0], shown


def _lamps(random: Random) -> Callable[[str, float, float], Widget]:
    size = float(random.integers(14, 44))
    return lambda name, row, col: Widget(name, row, col, size, size, (Lamp(row, col, size, PALETTE[name]),))


def _buttons(random: Random) -> Callable[[str, float, float], Widget]:
    look, word = theme(random), str(random.choice(WORDS))
    height, width = float(random.integers(24, 40)), float(random.integers(80, 120))
    return lambda name, row, col: replace(button_at(word, row, col, height, width, look, PALETTE[name]), key=name)


def _icons(random: Random) -> Callable[[str, float, float], Widget]:
    look, glyph, size = theme(random), str(random.choice(sorted(GLYPHS))), float(random.choice([20, 24, 32, 48]))
    return lambda name, row, col: replace(icon_at(glyph, row, col, size, look, PALETTE[name]), key=name)


def lamps_of_another_colour(random: Random) -> Trial:
    """A lamp, where only lamps of other colours are on the panel."""
    return _coloured(random, *_colours(random, False), _lamps(random))


def buttons_of_another_colour(random: Random) -> Trial:
    """A coloured button, where only buttons of other colours are present, grey among them."""
    return _coloured(random, *_colours(random, False), _buttons(random))


def icons_of_another_colour(random: Random) -> Trial:
    """An icon, where it is present in other colours only."""
    return _coloured(random, *_colours(random, False), _icons(random))


def the_right_one_of_colours(random: Random) -> Trial:
    """A lamp, a button or an icon among those of other colours."""
    ways = _lamps, _buttons, _icons
    return _coloured(random, *_colours(random, True), ways[int(random.integers(3))](random))


def _paler(screen: Layout, widget: Widget, random: Random) -> Widget:
    share = random.uniform(0.25, 0.5)
    back = np.array(screen.look.card)
    return with_colour(widget, lambda colour: tuple(int(one) for one in back + share * (np.array(colour) - back)))  # type: ignore[return-value]


def disabled_alone(random: Random) -> Trial:
    """An icon or word, where only its pale (disabled) form is on the screen."""
    screen, widget = screen_with(random, lambda one: (is_icon(one) or is_word(one)) and not is_filled(one))
    plain = screen.drawn()
    place = box(widget, 1, int(random.integers(1, 5)), plain.shape)
    picture = screen.exchanged(widget, _paler(screen, widget, random)).drawn()
    return Trial(picture, cut(plain, place), (), pale=(place,))


def enabled_beside_disabled(random: Random) -> Trial:
    """An icon whose pale (disabled) form is on the screen as well."""
    given, names = _family(random)
    given = replace(given, look=replace(given.look, back=given.look.card), rows=400)
    widget = given.widgets[int(random.integers(len(names)))]
    paler = replace(_paler(given, widget, random), row=widget.row)
    below = 200.0
    paler = replace(
        paler, row=widget.row + below, parts=tuple(replace(one, row=one.row + below) for one in paler.parts)
    )
    picture = replace(given, widgets=(*given.widgets, paler)).drawn()
    place = box(widget, 1, int(random.integers(1, 4)), picture.shape)
    return Trial(picture, cut(picture, place), (place,))


# --- Other pictures ---------------------------------------------------------------------------------------------------


def _two_landscapes(random: Random) -> tuple[Array, Array]:
    """Return two drawn landscapes or two streets, both of 120 to 240 rows."""
    rows = int(random.integers(120, 240))
    streets = photographs(streets=True)
    if random.random() < 0.6 or len(streets) < 2:
        cols = int(rows * random.uniform(1.2, 1.6))
        one, other = landscape(random, rows, cols), landscape(random, rows, cols)
        return one, other
    first, second = random.choice(len(streets), 2, replace=False).tolist()
    seen = []
    for index in (first, second):
        street = streets[index]
        width = round(rows * street.shape[1] / street.shape[0])
        small = cv2.resize(street, (width, rows), interpolation=cv2.INTER_AREA)
        seen.append(part_of(small, (rows, int(1.4 * rows)), random))
    return seen[0], seen[1]


def other_landscapes(random: Random) -> Trial:
    """A part of a landscape, searched in another landscape, where it fits at several places."""
    one, other = _two_landscapes(random)
    height, width = (int(random.uniform(0.25, 0.45) * side) for side in one.shape[:2])
    row, col = detailed_place(one, height, width, random)
    return Trial(other, one[row : row + height, col : col + width].copy(), ())


def other_landscapes_without_room(random: Random) -> Trial:
    """A landscape, searched in another landscape of nearly its size."""
    one, other = _two_landscapes(random)
    height, width = (int(random.uniform(0.55, 0.98) * side) for side in one.shape[:2])
    row, col = (int(random.integers(room + 1)) for room in (one.shape[0] - height, one.shape[1] - width))
    return Trial(other, one[row : row + height, col : col + width].copy(), ())


def other_photographs(random: Random) -> Trial:
    """A part of a photograph, searched in another photograph, or where it is painted over; perhaps in all poses."""
    every = photographs()
    first, second = random.choice(len(every), 2, replace=False).tolist()
    picture, shown = (part_of(every[index], (480, 640), random) for index in (first, second))
    place = place_in(picture, random)
    template = cut(picture, place)
    if random.random() < 0.5:
        shown, (row, col) = picture.copy(), (int(place.row), int(place.col))
        other = cv2.resize(part_of(every[second], (200, 200), random), template.shape[1::-1])
        shown[row : row + template.shape[0], col : col + template.shape[1]] = other
    posed = {"scales": SCALES, "rotations": ROTATIONS} if random.random() < 0.4 else {}
    return Trial(shown, template, (), options=posed)


# --- Rocketman, public pictures ---------------------------------------------------------------------------------------


def rocketman_turned_and_resized(random: Random) -> Trial:
    """Rocketman in the maze, turned by up to 30 degrees and resized to 70 to 140 %."""
    picture, template, place = _maze()
    scale, rotation = float(np.exp(random.uniform(*np.log(SCALES)))), float(random.uniform(*ROTATIONS))
    row, col = (float(random.uniform(130, side - 130)) for side in picture.shape[:2])
    shown = drawn(painted_over(picture, place), template, row, col, scale, rotation)
    cos, sin = np.cos(np.radians(rotation)), abs(np.sin(np.radians(rotation)))
    height = scale * (place.height * cos + place.width * sin)
    width = scale * (place.width * cos + place.height * sin)
    there = Place(row - height / 2, col - width / 2, height, width, scale, rotation)
    return Trial(shown, template, (there,), options={"scales": SCALES, "rotations": ROTATIONS})


def no_rocketman(random: Random) -> Trial:
    """The maze without Rocketman, or with him where his mirror image, other colours or his negative are searched."""
    picture, template, place = _maze()
    way, posed = int(random.integers(6)), {"scales": SCALES, "rotations": ROTATIONS}
    if way == 0:
        picture = painted_over(picture, place)
    elif way == 1:  # in his own size, since the maze contains his smaller mirror image
        template, posed = np.ascontiguousarray(template[:, ::-1]), {}
    elif way == 2:
        orders = ((1, 2, 0), (2, 1, 0), (0, 2, 1))
        template = template[:, :, (*orders[int(random.integers(3))], 3)]
    elif way == 3:
        template = np.dstack([255 - template[:, :, :3], template[:, :, 3:]])
    elif way == 4:
        template, posed = np.asarray(cv2.resize(template, None, fx=0.9, fy=0.9, interpolation=cv2.INTER_AREA)), {}
    else:
        other = photograph(random)
        template = cut(other, place_in(other, random))
    return Trial(picture, template, (), options=posed if random.random() < 0.5 else {})


def _maze() -> tuple[Array, Array, Place]:
    """Return the maze, Rocketman, and his place."""
    example = mazes()["maze"]
    picture, template = read_image(example.picture), read_image(example.template)
    return picture, template, Place(example.row, example.col, *template.shape[:2])


def painted_over(picture: Array, place: Place) -> Array:
    """Return the picture with a place covered by another part of it, 300 px further right."""
    painted, row, col = picture.copy(), int(place.row), int(place.col)
    painted[row : row + int(place.height), col : col + int(place.width)] = cut(picture, replace(place, col=col + 300))
    return painted


def drawn(picture: Array, template: Array, row: float, col: float, scale: float, rotation: float) -> Array:
    """Return the picture with an RGBA template drawn into it, centred at (row, col) and supersampled."""
    oversampling = 4
    reach = int(np.hypot(*template.shape[:2]) * scale / 2) + 3
    top, left, side = round(row) - reach, round(col) - reach, 2 * reach
    middle = template.shape[1] / 2 - 0.5, template.shape[0] / 2 - 0.5
    matrix = cv2.getRotationMatrix2D(middle, rotation, scale * oversampling)
    matrix[:, 2] += np.array([(col - left) * oversampling, (row - top) * oversampling]) - 0.5 - np.array(middle)
    layers = template.astype(np.float32)
    layers[:, :, :3] *= layers[:, :, 3:] / 255
    fine = cv2.warpAffine(layers, matrix, (side * oversampling, side * oversampling), flags=cv2.INTER_CUBIC)
    little = cv2.resize(fine, (side, side), interpolation=cv2.INTER_AREA)
    cover = np.clip(little[:, :, 3:] / 255, 0, 1)
    shown = picture.copy()
    part = shown[top : top + side, left : left + side]
    part[:] = np.clip(np.rint(part * (1 - cover) + little[:, :, :3]), 0, 255)
    return shown


PUBLIC: tuple[tuple[str, str, str | None, tuple[tuple[int, int], ...]], ...] = (
    ("boofcv_desktop/scene.png", "template_paint.png", None, ((222, 338),)),
    ("simplecv/scene.png", "template.png", None, ((33, 363),)),
    ("opencv_messi/scene.jpg", "template.jpg", None, ((85, 220),)),
    ("boofcv_desktop/scene.png", "template_cursor.png", "mask.png", ((6, 271), (265, 210), (285, 371))),
    ("boofcv_desktop/scene.png", "template_browser.png", None, ()),
)
"""Pictures in :data:`benchmarks.pairs.DATA`: scene, template, mask, and the (row, col) of each place."""


def public_pictures(random: Random) -> Trial:
    """Screens and photographs of other projects, searched at their size or at all sizes."""
    scene, name, mask, corners = PUBLIC[int(random.integers(len(PUBLIC)))]
    path = DATA / "template" / scene
    template = read_image(path.parent / name)
    marks = None if mask is None else read_image(path.parent / mask)[:, :, :3].max(axis=2)
    places = tuple(Place(*corner, *template.shape[:2]) for corner in corners)
    posed = {"scales": SCALES} if random.random() < 0.5 else {}
    return Trial(read_image(path), template, places, marks, {"max_matches": max(1, len(corners)), **posed})


# --- Numbers and sizes ------------------------------------------------------------------------------------------------


def _terrain(random: Random) -> Array:
    return 900 + 250 * fractal(int(random.integers(240, 400)), int(random.integers(300, 520)), 1.6, random)


def _numbers(random: Random) -> tuple[Array, Place]:
    """Return heights of terrain or the grey levels of a photograph as floats, and a place in it."""
    if random.random() < 0.5:
        picture, place = piece(random)
        return picture.mean(axis=2).astype(np.float32), place
    picture = _terrain(random)
    height, width = (int(one) for one in random.integers(36, 100, 2))
    row, col = (
        int(random.integers(side - size + 1)) for side, size in zip(picture.shape, (height, width), strict=True)
    )
    return picture.astype(np.float32), Place(row, col, height, width)


def _holes(shape: Sequence[int], place: Place, random: Random) -> Array:
    """Return the mask of pixels without data, outside the place: spots, and the wedge beside a rotated strip."""
    holes = np.zeros(shape, np.uint8)
    for _ in range(int(random.integers(1, 6))):
        at = int(random.integers(shape[1])), int(random.integers(shape[0]))
        axes = int(random.integers(2, 40)), int(random.integers(2, 40))
        cv2.ellipse(holes, at, axes, float(random.uniform(0, 180)), 0, 360, 1, -1)
    if random.random() < 0.5:
        side = int(random.uniform(0.1, 0.5) * min(shape))
        cv2.fillPoly(holes, [np.array([[0, 0], [side, 0], [0, side]])], 1)
    row, col = int(place.row), int(place.col)
    holes[row : row + int(place.height), col : col + int(place.width)] = 0
    if not holes.any():
        holes[0 if row else -1, 0 if col else -1] = 1
    return holes > 0


def missing_values(random: Random) -> Trial:
    """Terrain or a photograph with NaN outside the place."""
    picture, place = _numbers(random)
    template = cut(picture, place)
    picture[_holes(picture.shape, place, random)] = np.nan
    return Trial(picture, template, (place,))


def other_terrain(random: Random) -> Trial:
    """A part of terrain, searched in other terrain, perhaps with NaN."""
    picture, other = _terrain(random).astype(np.float32), _terrain(random).astype(np.float32)
    height, width = (int(one) for one in random.integers(36, 100, 2))
    template = part_of(other, (height, width), random)
    if random.random() < 0.5:
        picture[_holes(picture.shape, Place(0, 0, 1, 1), random)] = np.nan
    return Trial(picture, template, ())


def signed_with_nodata(random: Random) -> Trial:
    """Terrain or a photograph as int16, with -32768 where there is no data."""
    picture, place = _numbers(random)
    numbers = np.rint(picture - random.uniform(0, 900)).astype(np.int16)
    template = cut(numbers, place)
    numbers[_holes(picture.shape, place, random)] = -32768
    return Trial(numbers, template, (place,))


def one_hot_pixel(random: Random) -> Trial:
    """A picture of 16 bits or floats with one pixel, outside the place, that is far brighter than all others."""
    picture, place = _numbers(random)
    floats = random.random() < 0.5
    numbers = picture if floats else np.rint(picture + 800).astype(np.uint16)
    template = cut(numbers, place)
    outside = np.ones(numbers.shape, bool)
    outside[int(place.row) : int(place.row + place.height), int(place.col) : int(place.col + place.width)] = False
    every = np.argwhere(outside)
    hot = every[int(random.integers(len(every)))]
    numbers[tuple(hot)] = 1e6 if floats else 65535
    return Trial(numbers, template, (place,))


def other_number_types(random: Random) -> Trial:
    """A screen or photograph, grey or in colour, in 16 bits, in part of their range, as signed numbers or floats."""
    picture, place = piece(random) if random.random() < 0.6 else screen_piece(random)
    if random.random() < 0.5:
        picture = np.rint(picture.mean(axis=2)).astype(np.uint8)
    level = int(random.integers(500, 20000))
    ways: tuple[Callable[[Array], Array], ...] = (
        lambda one: one.astype(np.uint16) * 257,
        lambda one: one.astype(np.uint16) // 4 + level,
        lambda one: (one / 255).astype(np.float32),
        lambda one: one / 255 * 1e-3,
        lambda one: (one.astype(np.int16) - 128) * 100,
        lambda one: one.astype(np.float32) * 1000 - 30000,
    )
    as_numbers = ways[int(random.integers(len(ways)))]
    return Trial(as_numbers(picture), as_numbers(cut(picture, place)), (place,))


def small_templates(random: Random) -> Trial:
    """An icon of 8 to 14 px among others."""
    return _small(random, is_present=True)


def other_small_templates(random: Random) -> Trial:
    """An icon of 8 to 14 px that is absent, where there are others."""
    return _small(random, is_present=False)


def _small(random: Random, is_present: bool) -> Trial:
    look, size = theme(random), int(random.integers(8, 15))
    wanted, *names = (str(one) for one in random.permutation(sorted(DISTINCT_GLYPHS)))
    pitch = size + int(random.integers(3, 10))
    colour = look.icons[int(random.integers(len(look.icons)))]
    index = int(random.integers(len(names)))
    cells = [(16 + pitch * (cell // 6), 16 + pitch * (cell % 6)) for cell in range(len(names))]
    screens = [
        Layout(
            180, 260, look, tuple(icon_at(name, *at, size, look, colour) for name, at in zip(shown, cells, strict=True))
        )
        for shown in (names, [*names[:index], wanted, *names[index + 1 :]])
    ]
    without, within = (screen.drawn() for screen in screens)
    place = box(screens[1].widgets[index], 1, 0, within.shape)
    return Trial(within if is_present else without, cut(within, place), (place,) if is_present else ())


DISTINCT_GLYPHS = (
    "bell", "lock", "star", "heart", "house", "bin", "disk", "person", "undo", "flag", "letter", "drop", "bolt",
    "clock", "page", "folder", "cloud", "magnifier", "shield plus", "circle cross", "square check",
)  # fmt: skip
"""Glyphs that can be distinguished at 8 px."""


def small_templates_at_any_angle(random: Random) -> Trial:
    """An icon of 16 to 24 px at any angle on a plain background, with others at other angles."""
    size, ground = int(random.integers(16, 25)), random.uniform(150, 250, 3)
    names = [str(one) for one in random.permutation(["bell", "flag", "key", "pencil", "heart", "house", "cup", "undo"])]
    picture = np.empty((220, 300, 3), np.uint8)
    picture[:] = ground
    template = np.empty((size, size, 3), np.uint8)
    template[:] = ground
    ink: Colour = tuple(int(one) for one in random.integers(0, 90, 3))  # type: ignore[assignment]
    put(template, [(GLYPHS[names[0]], ink)], size / 2, size / 2, size, 0)
    spots = random.permutation([(row, col) for row in (40, 110, 180) for col in (40, 110, 180, 250)])[: len(names)]
    turned = random.uniform(-180, 180, len(names))
    for name, at, angle in zip(names, spots.tolist(), turned.tolist(), strict=True):
        put(picture, [(GLYPHS[name], ink)], *at, size, angle)
    side = size * float(abs(np.cos(np.radians(turned[0]))) + abs(np.sin(np.radians(turned[0]))))
    place = Place(spots[0][0] - side / 2, spots[0][1] - side / 2, side, side, 1.0, float(turned[0]))
    return Trial(picture, template, (place,), options={"rotations": (-180.0, 180.0)})


KINDS: dict[str, Kind] = {
    kind.__name__.replace("_", " "): kind
    for kind in (
        screens,
        screens_as_jpeg,
        screens_at_other_sizes,
        screens_in_a_chat,
        photographs_as_taken,
        photographs_turned_and_resized,
        photographs_without_room,
        icons_off_the_grid,
        symmetric_icons_off_the_grid,
        other_white_balance,
        icons_in_other_white_balance,
        other_gamma,
        covered_by_10_to_30_percent,
        covered_by_30_to_40_percent,
        outside_by_5_to_30_percent,
        outside_by_30_to_50_percent,
        text_cursors,
        mouse_pointers,
        selected,
        focus_rings,
        badges,
        scroll_bars,
        drop_shadows,
        messages,
        grey_in_colours,
        soft_alpha,
        glows,
        blurred_masks,
        silhouettes,
        copies,
        rows_of_a_list,
        copies_at_any_angle,
        the_right_one_of_siblings,
        the_right_one_of_colours,
        enabled_beside_disabled,
        missing_values,
        signed_with_nodata,
        one_hot_pixel,
        other_number_types,
        small_templates,
        small_templates_at_any_angle,
        rocketman_turned_and_resized,
        public_pictures,
        siblings_of_icons,
        siblings_of_words,
        siblings_at_other_sizes,
        siblings_in_a_chat,
        other_parts,
        other_states,
        other_digits,
        siblings_of_many,
        siblings_without_room,
        lamps_of_another_colour,
        buttons_of_another_colour,
        buttons_of_a_near_colour,
        other_messages,
        icons_of_another_colour,
        disabled_alone,
        other_silhouettes,
        other_sprites,
        other_labels_at_any_angle,
        other_small_templates,
        other_terrain,
        other_landscapes,
        other_landscapes_without_room,
        other_photographs,
        no_rocketman,
    )
}


def trial(kind: str, seed: int) -> Trial:
    """Return one search of a kind of :data:`KINDS`."""
    given = KINDS[kind](np.random.default_rng([*kind.encode(), seed]))
    given.options.pop("at", None)
    return given
