"""Disparity maps as images in one range of colours, and the legend to read them by."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import lru_cache

import cv2
import numpy as np
import numpy.typing as npt
import plotly.graph_objects as go
from PIL import Image as PillowImage
from PIL import ImageDraw, ImageFont

from stereolag.arrays import Rgb
from stereolag.figures.legends import round_values
from stereolag.figures.pictures import (
    NO_ANSWER,
    VIRIDIS,
    as_rgb,
    coloured,
    palette,
    png,
    thinned,
)
from stereolag.inputs import Image

FAR_TO_NEAR = VIRIDIS
"""Near bright."""

PALETTES: dict[str, Rgb] = {
    "viridis": FAR_TO_NEAR,
    "plasma": palette(cv2.COLORMAP_PLASMA),
    "turbo": palette(cv2.COLORMAP_TURBO),
}
"""The colours a visitor may choose, from far to near; none holds the grey of no disparity."""

ROUNDED_TO = 4
"""Px to which the ends of a range are rounded: small changes of a map leave its colours where they were."""


def disparity_range(maps: Sequence[npt.NDArray[np.float32]]) -> tuple[float, float]:
    """Return the disparities, px, at the ends of the colours: all but the outermost 1 % of the maps lies between.

    Given the ground truth alone the range holds still whatever the settings; without it, the maps to compare share one.
    """
    known = np.concatenate([np.empty(0, dtype=np.float32), *(one[np.isfinite(one)] for one in map(thinned, maps))])
    if known.size == 0:
        return 0.0, float(ROUNDED_TO)
    low, high = np.percentile(known, (1, 99))
    first = np.floor(low / ROUNDED_TO) * ROUNDED_TO
    return float(first), float(max(np.ceil(high / ROUNDED_TO) * ROUNDED_TO, first + ROUNDED_TO))


def image_into_map(image: Image, disparity: npt.NDArray[np.float32], low: float, high: float) -> bytes:
    """Return the image that turns into its disparity map two fifths of the way to the right, as a PNG."""
    picture = as_rgb(image).copy()
    seam = picture.shape[1] * 2 // 5
    picture[:, seam:] = coloured(disparity, low, high, FAR_TO_NEAR)[:, seam:]
    return png(picture)


def legend(low: float, high: float, palette: Rgb, title: str, ticks: Mapping[float, str] | None = None) -> go.Figure:
    """Return the colours of a (256, 3) palette, from `low` to `high`, over an axis with a title.

    `ticks` are {value: what is written there}; without them the axis chooses its own. The same arguments give the same
    figure, which must not be changed: to make one takes Plotly longer than a small map takes OpenCV.
    """
    return _legend(low, high, palette.tobytes(), title, tuple((ticks or {}).items()))


@lru_cache(maxsize=32)
def _legend(low: float, high: float, colours: bytes, title: str, ticks: tuple[tuple[float, str], ...]) -> go.Figure:
    palette = np.frombuffer(colours, dtype=np.uint8).reshape(-1, 3)
    shares = np.linspace(0, 1, len(palette))
    scale = [[share, "rgb({},{},{})".format(*colour)] for share, colour in zip(shares, palette, strict=True)]
    figure = go.Figure(
        go.Heatmap(
            z=np.arange(256, dtype=np.uint8)[None, :],
            x=np.linspace(low, high, 256, dtype=np.float32),
            colorscale=scale[::15],
            showscale=False,
            hovertemplate="%{x:.3g}<extra></extra>",
        )
    )
    figure.update_layout(height=84, margin={"l": 12, "r": 12, "t": 4, "b": 52}, dragmode=False)
    figure.update_xaxes(title={"text": title, "standoff": 14}, fixedrange=True, showgrid=False, ticks="outside")
    if ticks:
        figure.update_xaxes(tickvals=[value for value, _ in ticks], ticktext=[text for _, text in ticks])
    figure.update_yaxes(visible=False, fixedrange=True)
    return figure


NARROWEST = 360
DESIGNED_FOR = 900
"""Px; the width of an image up to which the legend has the sizes below, and with which it grows beyond."""

TEXT, MARGIN, BAR, TICK, GAP = 14, 24, 14, 5, 8
PAPER, INK = (255, 255, 255), (30, 30, 30)


def with_legend(picture: Rgb, low: float, high: float, palette: Rgb, title: str) -> Rgb:
    """Return a coloured map above a strip of its colours, with a scale and a title, on white.

    Parameters
    ----------
    picture
        (rows, cols, 3) uint8 RGB; it is kept pixel for pixel, in the middle of the upper edge.
    low, high
        What the first and the last colour of the palette stand for, ``low < high``.
    palette
        (256, 3) uint8 RGB.
    title
        What is shown, with its unit; letters of the Latin alphabet.

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
