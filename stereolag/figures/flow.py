"""Optical flow as a picture: the colours of the Middlebury benchmark, arrows, and the colour wheel as legend."""

from __future__ import annotations

from functools import cache
from typing import TypeAlias

import cv2
import numpy as np
import numpy.typing as npt
from PIL import Image as PillowImage
from PIL import ImageDraw, ImageFont

from stereolag.core.arrays import FloatMap, Rgb
from stereolag.core.inputs import Image
from stereolag.figures.pictures import as_rgb

Rgba: TypeAlias = npt.NDArray[np.uint8]
"""(H, W, 4) uint8."""

RAMPS = ((15, 0, 1, 1), (6, 1, 0, -1), (4, 1, 2, 1), (11, 2, 1, -1), (13, 2, 0, 1), (6, 0, 2, -1))
"""Parts of the wheel: number of colours, full channel, changing channel, and whether it rises or falls."""

BEYOND = 0.75
"""Brightness factor of motions longer than the largest: darker than all others."""

WHITE, BLACK = (255, 255, 255), (0, 0, 0)
OUTLINE = 2
"""Px by which an arrow's dark outline is thicker, to make it visible on light and dark pictures."""


@cache
def _wheel() -> npt.NDArray[np.float64]:
    """Return the wheel as (55, 3) RGB, 0..1, red first."""
    colours = []
    for count, full, changing, rising in RAMPS:
        ramp = np.arange(count) / count
        part = np.zeros((count, 3))
        part[:, full] = 1
        part[:, changing] = ramp if rising > 0 else 1 - ramp
        colours.append(part)
    return np.concatenate(colours)


def largest_motion(*flows: tuple[FloatMap, FloatMap]) -> float:
    """Return the length at the rim of the wheel, px: the 99th percentile, rounded up to half a unit of its first digit.

    Each flow is (dy, dx), NaN = none.
    """
    lengths = np.concatenate([np.hypot(dy, dx)[np.isfinite(dx)] for dy, dx in flows])
    longest = max(float(np.percentile(lengths, 99)), 1e-3) if lengths.size else 1.0
    unit = 10.0 ** np.floor(np.log10(longest)) / 2
    return float(np.ceil(longest / unit - 1e-9) * unit)


def flow_colours(dy: FloatMap, dx: FloatMap, largest: float) -> Rgba:
    """Return a flow as an image: direction as hue, length as saturation.

    Parameters
    ----------
    dy, dx
        (H, W) px, downwards and to the right; NaN = none.
    largest
        Length with full colour, px; longer motions are darker.

    Returns
    -------
    ndarray
        (H, W, 4) uint8 RGBA; transparent where no motion is known.

    Raises
    ------
    ValueError
        If `largest` is not above 0.

    Notes
    -----
    The published colour code of S. Baker, D. Scharstein, J. Lewis, S. Roth, M. Black & R. Szeliski, "A database and
    evaluation methodology for optical flow", IJCV 92, 2011.
    """
    if not largest > 0:
        raise ValueError(f"largest is {largest} px; it must be above 0.")
    known = np.isfinite(dy) & np.isfinite(dx)
    down, right = (np.where(known, part, 0).astype(np.float64) / largest for part in (dy, dx))
    wheel = _wheel()
    length = np.hypot(down, right)
    place = (np.arctan2(-down, -right) / np.pi + 1) / 2 * (len(wheel) - 1)
    before = place.astype(np.intp)
    share = (place - before)[..., None]
    colour = (1 - share) * wheel[before] + share * wheel[(before + 1) % len(wheel)]
    radius = length[..., None]
    colour = np.where(radius <= 1, 1 - radius * (1 - colour), colour * BEYOND)
    picture = np.empty((*dy.shape, 4), np.uint8)
    picture[..., :3] = np.floor(255 * colour)
    picture[..., 3] = np.where(known, 255, 0)
    return picture


def with_arrows(image: Image, dy: FloatMap, dx: FloatMap, *, spacing: int = 24) -> Rgb:
    """Return the image with an arrow every `spacing` px that shows where the pixel moves.

    Parameters
    ----------
    image
        (H, W) or (H, W, 3 | 4), the first frame.
    dy, dx
        (H, W) px; no arrow where NaN.
    spacing
        Px between the arrows.

    Returns
    -------
    ndarray
        (H, W, 3) uint8 RGB; each arrow is coloured by its direction.
    """
    picture = np.ascontiguousarray(as_rgb(image)).copy()
    rows, cols = dx.shape
    grid = np.s_[spacing // 2 :: spacing, spacing // 2 :: spacing]
    row, col = np.mgrid[:rows, :cols]
    starts = np.stack([row[grid], col[grid], dy[grid], dx[grid]], axis=-1).reshape(-1, 4)
    starts = starts[np.isfinite(starts).all(axis=1)]
    lengths = np.hypot(starts[:, 2], starts[:, 3])
    down, right = (starts[:, 2:].T / np.maximum(lengths, 1e-6)).astype(np.float32)[..., None]
    hues = flow_colours(down, right, 1 + 1e-6)
    thickness = max(1, spacing // 16)
    for (y, x, dy_here, dx_here), length, hue in zip(starts, lengths, hues[:, 0, :3], strict=True):
        start, end = (round(x), round(y)), (round(x + dx_here), round(y + dy_here))
        tip = min(0.4, 6 / max(length, 1e-6))
        for colour, width in ((BLACK, thickness + OUTLINE), (tuple(int(part) for part in hue), thickness)):
            if start == end:
                cv2.circle(picture, start, width, colour, -1, cv2.LINE_AA)
            else:
                cv2.arrowedLine(picture, start, end, colour, width, cv2.LINE_AA, tipLength=tip)
    return picture


def colour_wheel(largest: float, size: int = 160) -> Rgba:
    """Return the wheel of all directions, `largest` px at its rim, (size, size, 4), transparent around it."""
    radius = (size - 1) / 2
    row, col = np.mgrid[:size, :size].astype(np.float32)
    dy, dx = (row - radius) / radius * largest, (col - radius) / radius * largest
    outside = np.hypot(dy, dx) > largest
    return flow_colours(np.where(outside, np.nan, dy), np.where(outside, np.nan, dx), largest)


def wheel_legend(largest: float, size: int = 160) -> Rgba:
    """Return the wheel of all directions, `largest` px at its rim, with that length written below it.

    Parameters
    ----------
    largest
        Length at the rim, px.
    size
        Diameter of the wheel in the picture, px.

    Returns
    -------
    ndarray
        (rows, size, 4) uint8 RGBA, transparent around the wheel.
    """
    wheel = colour_wheel(largest, size)
    text = max(11, size // 9)
    canvas = PillowImage.new("RGBA", (size, size + 2 * text))
    canvas.paste(PillowImage.fromarray(wheel), (0, 0))
    draw, font = ImageDraw.Draw(canvas), ImageFont.load_default(text)
    words = f"rim: {largest:g} px"
    draw.text((size / 2, size + text / 2), words, WHITE, font, anchor="mt", stroke_width=2, stroke_fill=BLACK)
    return np.array(canvas)
