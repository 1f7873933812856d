"""A coloured map with its legend in one picture, without Plotly."""

from __future__ import annotations

import numpy as np
from PIL import Image as PillowImage
from PIL import ImageDraw, ImageFont

from stereolag.core.arrays import Rgb
from stereolag.figures.legends import round_values
from stereolag.figures.pictures import NO_ANSWER

NARROWEST = 360
DESIGNED_FOR = 900
"""Px; up to this image width the legend has the sizes below, beyond it grows in proportion."""

TEXT, MARGIN, BAR, TICK, GAP = 14, 24, 14, 5, 8
PAPER, INK = (255, 255, 255), (30, 30, 30)


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
    width = max(cols, NARROWEST)
    unit = max(1.0, width / DESIGNED_FOR)
    canvas = PillowImage.new("RGB", (width, rows + round(unit * (2 * TEXT + BAR + TICK + 5 * GAP))), PAPER)
    canvas.paste(PillowImage.fromarray(picture), ((width - cols) // 2, 0))
    draw = ImageDraw.Draw(canvas)
    font = ImageFont.load_default(TEXT * unit)
    left, right = MARGIN * unit, width - MARGIN * unit

    line = rows + unit * (GAP + TEXT)
    draw.text((left, line), title, INK, font, anchor="ls")
    draw.text((right, line), "no disparity", INK, font, anchor="rs")
    swatch = right - draw.textlength("no disparity", font) - unit * GAP
    draw.rectangle((swatch - unit * TEXT, line - unit * TEXT + unit, swatch, line), fill=NO_ANSWER)

    top = line + unit * GAP
    bottom = top + unit * BAR
    bar = PillowImage.fromarray(palette[None]).resize((round(right - left), round(bottom - top)))
    canvas.paste(bar, (round(left), round(top)))
    for value in round_values(low, high):
        column = left + (value - low) / (high - low) * (right - left)
        draw.line((column, bottom, column, bottom + unit * TICK), INK, max(1, round(unit)))
        draw.text((column, bottom + unit * (TICK + GAP / 2)), f"{value:g}", INK, font, anchor="mt")
    return np.array(canvas)
