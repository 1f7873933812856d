"""Draw the preview picture of links to the project: ``python -m tools.share_card`` writes it to ``deployment``.

The proxy refers to it in links to the app; on GitHub it is uploaded under Settings, Social preview, with its 1280 × 640
px. All data in it are measured while it is drawn.
"""

from __future__ import annotations

import xml.etree.ElementTree as ElementTree
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from PIL import Image, ImageDraw, ImageFont

import stereolag as sl
from stereolag.core.arrays import Rgb
from stereolag.figures.pictures import CORRELATION, PEAK, as_rgb, coloured, disparity_range
from stereolag.samples import recordings, stereo_pairs
from stereolag.ui.navigation import HOME_ICON

CARD = Path(__file__).parents[1] / "deployment" / "share-card.png"
WIDTH, HEIGHT = 1280, 640
MARGIN = 64
PICTURE_LEFT = 610
"""Column at which the picture of depth begins, px."""

OVERSAMPLING = 3
"""Factor by which lines and letters are drawn larger and then reduced, because PIL's lines are not anti-aliased."""

BACKGROUND, TEXT, LINK = "#fcfbf9", "#17151d", "#4a3c8c"
QUESTIONS = ("How far apart are two sensors?", "Where is this template?", "How far away is everything?")

Point = tuple[float, float]


def depth_picture() -> Rgb:
    """Return a picture of the card's height: a photograph that turns into its disparity map."""
    pair = stereo_pairs()["giraffes"]
    left = sl.read_image(pair.left)
    disparity = (
        sl.preset("accurate", num_disparities=pair.num_disparities).compute(left, sl.read_image(pair.right)).disparity
    )
    colours = coloured(disparity, *disparity_range([disparity]))
    scale = HEIGHT / left.shape[0]
    size = (round(left.shape[1] * scale), HEIGHT)
    halves = [Image.fromarray(half).resize(size, Image.Resampling.LANCZOS) for half in (as_rgb(left), colours)]
    photograph, map_ = (np.asarray(half)[:, -(WIDTH - PICTURE_LEFT) :].copy() for half in halves)
    seam = photograph.shape[1] * 2 // 5
    photograph[:, seam:] = map_[:, seam:]
    return photograph


def curve(width: int, height: int, columns: int = 400) -> tuple[list[Point], Point]:
    """Return the correlation of two recordings around their lag as points of a picture, and its peak."""
    example = recordings()["coast"]
    found = sl.signal_lag(sl.read_signal(example.signal_1), sl.read_signal(example.signal_2))
    assert found.correlation is not None
    peak = found.lag - found.lags[0]
    around = found.correlation[peak - 40_000 : peak + 40_000]
    # The most extreme value of each column, because peaks are narrower than a pixel.
    parts = around.reshape(columns, -1)
    extremes = parts[np.arange(columns), np.abs(parts).argmax(axis=1)]
    heights = height * (extremes.max() - extremes) / np.ptp(extremes)
    points = [(width * column / (columns - 1), float(y)) for column, y in enumerate(heights)]
    return points, min(points, key=lambda point: point[1])


def icon() -> tuple[str, str, list[Point]]:
    """Return the colours of the app's icon and its line, on a square of 64 units."""
    square, line = ElementTree.parse(HOME_ICON).getroot()
    steps = line.attrib["d"].replace("M", "").replace("h", "|h").replace("l", "|l").split("|")
    x, y = map(float, steps[0].split())
    points = [(x, y)]
    for step in steps[1:]:
        numbers = [float(number) for number in step[1:].replace("-", " -").split()]
        moves = [(numbers[0], 0.0)] if step[0] == "h" else list(zip(numbers[::2], numbers[1::2], strict=True))
        for right, down in moves:
            x, y = x + right, y + down
            points.append((x, y))
    return square.attrib["fill"], line.attrib["stroke"], points


def placed(points: Sequence[Point], left: float, top: float, scale: float = 1.0) -> list[Point]:
    """Return points scaled and moved on the oversampled card."""
    return [(OVERSAMPLING * (left + scale * x), OVERSAMPLING * (top + scale * y)) for x, y in points]


def draw() -> Image.Image:
    """Return the card."""
    fine = Image.new("RGB", (OVERSAMPLING * WIDTH, OVERSAMPLING * HEIGHT), BACKGROUND)
    pen = ImageDraw.Draw(fine)

    side, line, points = icon()
    pen.rounded_rectangle(placed([(0, 0), (72, 72)], MARGIN, MARGIN), radius=16 * OVERSAMPLING, fill=side)
    pen.line(placed(points, MARGIN, MARGIN, 72 / 64), fill=line, width=round(4.5 * OVERSAMPLING), joint="curve")

    def write(words: str, size: int, left: float, top: float, colour: str) -> None:
        pen.text(
            (OVERSAMPLING * left, OVERSAMPLING * top),
            words,
            fill=colour,
            font=ImageFont.load_default(OVERSAMPLING * size),
            anchor="ls",
        )

    write("stereolag", 76, MARGIN + 92, MARGIN + 62, TEXT)
    write("Slide, multiply, find the peak.", 33, MARGIN, 204, LINK)
    for row, question in enumerate(QUESTIONS):
        write(question, 28, MARGIN, 270 + 42 * row, TEXT)

    points, peak = curve(PICTURE_LEFT - 2 * MARGIN, 150)
    ((x, y),) = placed([peak], MARGIN, 426)
    pen.line(placed(points, MARGIN, 426), fill=CORRELATION, width=2 * OVERSAMPLING, joint="curve")
    pen.ellipse((x - 8 * OVERSAMPLING, y - 8 * OVERSAMPLING, x + 8 * OVERSAMPLING, y + 8 * OVERSAMPLING), fill=PEAK)

    card = fine.resize((WIDTH, HEIGHT), Image.Resampling.LANCZOS)
    card.paste(Image.fromarray(depth_picture()), (PICTURE_LEFT, 0))
    return card


if __name__ == "__main__":
    draw().save(CARD, optimize=True)
