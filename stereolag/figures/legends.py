"""Palettes of disparity maps, legends for the page and for pictures, and files of coloured maps and points."""

from __future__ import annotations

import math
from collections.abc import Callable, Collection, Sequence
from dataclasses import dataclass, field
from functools import partial

import cv2
import numpy as np
from PIL import Image as PillowImage

from stereolag.core.arrays import FloatMap, Rgb
from stereolag.core.inputs import Image
from stereolag.core.typography import typeset
from stereolag.figures.pictures import (
    NO_ANSWER,
    VIRIDIS,
    as_rgb,
    colour_wheel,
    coloured,
    data_url,
    disparity_range,
    palette,
    png,
)
from stereolag.geometry.calibration import Calibration
from stereolag.io.depths import ply
from stereolag.io.images import image_png
from stereolag.stereo.matcher import DisparityMap

FAR_TO_NEAR = VIRIDIS
"""Near is bright."""

PALETTES: dict[str, Rgb] = {
    "viridis": FAR_TO_NEAR,
    "plasma": palette(cv2.COLORMAP_PLASMA),
    "turbo": palette(cv2.COLORMAP_TURBO),
}
"""Palettes that can be chosen, from far to near; none contains the grey of no disparity."""

WHEEL_PX = 144
"""Diameter of the wheel, shown at half that size."""

MAX_STEPS = 5
"""Largest number of steps between the values along a legend."""

MIN_WIDTH_PX = 360
"""Least width of a picture with a legend, px."""

UNSCALED_WIDTH_PX = 900
"""Image width up to which its legend has the sizes below, px; for a wider image they grow in proportion."""

TEXT_PX, MARGIN_PX, BAR_PX, TICK_PX, GAP_PX = 14, 24, 14, 5, 8
PAPER, INK = (255, 255, 255), (30, 30, 30)


@dataclass(frozen=True, eq=False)
class Colours:
    """The colours that all maps share, a (256, 3) uint8 palette from `low` to `high` px, and outlines over the maps.

    `outlines` is an SVG path, px of the whole picture; "" = none. It is sent separately.
    """

    low: float
    high: float
    palette: Rgb = field(default_factory=lambda: FAR_TO_NEAR)
    outlines: str = ""


def searched_range(results: Collection[DisparityMap]) -> tuple[float, float]:
    """Return the smallest and the largest disparity that any of the maps can contain, px."""
    ranges = [found for one in results if (found := one.settings.reach()) is not None]
    if not ranges:
        return disparity_range([one.disparity for one in results])
    return float(min(first for first, _ in ranges)), float(max(first + count for first, count in ranges))


@dataclass(frozen=True)
class Legend:
    """A colour legend: a strip with values along it, or one word for each colour.

    Attributes
    ----------
    title
        The quantity shown, with its unit.
    colours
        CSS colours.
    words
        One for each colour; for a strip, those at its two ends.
    strip
        Whether the colours form a continuous strip.
    ticks
        Values along the strip: (share of its length, label, label below it).
    picture
        Data URL of a picture used instead of a strip, such as a wheel; "" = none.
    """

    title: str
    colours: tuple[str, ...]
    words: tuple[str, ...]
    strip: bool
    ticks: tuple[tuple[float, str, str], ...] = ()
    picture: str = ""


def strip_legend(
    title: str,
    low: float,
    high: float,
    palette: Rgb,
    *,
    ends: tuple[str, str] = ("", ""),
    below: Callable[[float], str] | None = None,
) -> Legend:
    """Return the legend of a (256, 3) palette from `low` to `high`, with ticks at round values.

    `ends` are the labels of its ends; `below` returns a second label for a value, such as metres for a disparity.
    """
    ticks = tuple(
        ((value - low) / (high - low), typeset(f"{value:g}"), below(value) if below else "")
        for value in round_values(low, high, MAX_STEPS)
    )
    return Legend(title, tuple(hexadecimal(colour) for colour in palette[::17]), ends, True, ticks)


def word_legend(title: str, colours: Sequence[str], words: Sequence[str]) -> Legend:
    """Return the legend of CSS colours with one word each."""
    return Legend(title, tuple(colours), tuple(words), False)


def wheel_legend(title: str, largest: float) -> Legend:
    """Return the legend of flow colours: the wheel of all directions, `largest` px at its rim."""
    words = (typeset(f"white: none, rim: {largest:g} px"),)
    return Legend(title, (), words, False, picture=data_url(png(colour_wheel(largest, WHEEL_PX))))


def hexadecimal(colour: Sequence[int] | Rgb) -> str:
    """Return an RGB colour as #rrggbb."""
    return "#{:02x}{:02x}{:02x}".format(*(int(part) for part in colour))


def round_values(low: float, high: float, max_steps: int = 8) -> list[float]:
    """Return the multiples of 1, 2 or 5 times a power of ten from low to high, in at most `max_steps` steps."""
    power = 10 ** math.floor(math.log10((high - low) / max_steps))
    step = next(factor * power for factor in (1, 2, 5, 10) if (high - low) / (factor * power) <= max_steps)
    first, last = math.ceil(low / step - 1e-9), math.floor(high / step + 1e-9)
    return [float(f"{number * step:.12g}") for number in range(first, last + 1)]


def disparity_legends(low: float, high: float, palette: Rgb, calibration: Calibration | None) -> tuple[Legend, ...]:
    """Return the legends of disparity maps: disparity, metres if calibrated, and the grey of no disparity."""
    return (
        strip_legend(
            "disparity, px" + (", and distance" if calibration else ""),
            low,
            high,
            palette,
            ends=("FAR", "NEAR"),
            below=partial(_metres, calibration) if calibration else None,
        ),
        word_legend("", [hexadecimal(NO_ANSWER)], ["no disparity"]),
    )


def _metres(calibration: Calibration, disparity: float) -> str:
    depth = float(calibration.depth(disparity))
    return "∞" if math.isnan(depth) else typeset(f"{depth:.3g} m")


def with_legend(picture: Rgb, low: float, high: float, palette: Rgb, title: str) -> Rgb:
    """Return a coloured map above a strip of its colours, with a scale and a title, on white.

    Parameters
    ----------
    picture
        (rows, cols, 3) uint8 RGB; kept pixel for pixel, centred at the top.
    low, high
        Values at the first and the last colour of the palette, ``low < high``.
    palette
        (256, 3) uint8 RGB.
    title
        The quantity shown, with its unit; Latin letters only.

    Returns
    -------
    picture
        uint8 RGB, at least 360 px wide.
    """
    rows, cols = picture.shape[:2]
    width = max(cols, MIN_WIDTH_PX)
    unit = max(1.0, width / UNSCALED_WIDTH_PX)
    canvas = PillowImage.new("RGB", (width, rows + round(unit * (2 * TEXT_PX + BAR_PX + TICK_PX + 5 * GAP_PX))), PAPER)
    canvas.paste(PillowImage.fromarray(picture), ((width - cols) // 2, 0))
    from PIL import ImageDraw, ImageFont  # 40 ms to load

    draw = ImageDraw.Draw(canvas)
    font = ImageFont.load_default(TEXT_PX * unit)
    left, right = MARGIN_PX * unit, width - MARGIN_PX * unit

    line = rows + unit * (GAP_PX + TEXT_PX)
    draw.text((left, line), title, INK, font, anchor="ls")
    draw.text((right, line), "no disparity", INK, font, anchor="rs")
    swatch = right - draw.textlength("no disparity", font) - unit * GAP_PX
    draw.rectangle((swatch - unit * TEXT_PX, line - unit * TEXT_PX + unit, swatch, line), fill=NO_ANSWER)

    top = line + unit * GAP_PX
    bottom = top + unit * BAR_PX
    bar = PillowImage.fromarray(palette[None]).resize((round(right - left), round(bottom - top)))
    canvas.paste(bar, (round(left), round(top)))
    for value in round_values(low, high):
        column = left + (value - low) / (high - low) * (right - left)
        draw.line((column, bottom, column, bottom + unit * TICK_PX), INK, max(1, round(unit)))
        draw.text((column, bottom + unit * (TICK_PX + GAP_PX / 2)), f"{value:g}", INK, font, anchor="mt")
    return np.array(canvas)


LEGEND_TITLE = "disparity, px: from far to near"
MAX_POINTS = 2_000_000


def coloured_png(disparity: FloatMap, low: float, high: float, palette: Rgb = VIRIDIS) -> bytes:
    """Return a coloured disparity map above its legend, as a PNG.

    Parameters
    ----------
    disparity
        (rows, cols) px, NaN = none.
    low, high
        Disparities at the first and the last colour, px, ``low < high``.
    palette
        (256, 3) uint8 RGB, from far to near.
    """
    return image_png(with_legend(coloured(disparity, low, high, palette), low, high, palette, LEGEND_TITLE))


def cloud_ply(calibration: Calibration, disparity: FloatMap, left: Image) -> bytes:
    """Return the points of a disparity map in metres and in the colours of the left image, as a binary PLY.

    Flying pixels are left out. Of more than 2 million points, a uniform random sample is kept, always the same.
    """
    from stereolag.geometry.scene import clean_point_cloud

    return ply(*clean_point_cloud(calibration, disparity, as_rgb(left), max_points=MAX_POINTS))
