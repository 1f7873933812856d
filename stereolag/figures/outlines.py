"""Objects outlined and labelled in a picture."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import cv2
import numpy as np
import numpy.typing as npt
from PIL import Image as PillowImage
from PIL import ImageDraw, ImageFont

from stereolag.core.arrays import Mask, Rgb
from stereolag.core.inputs import Image
from stereolag.figures.pictures import FRAME, as_rgb

TEXT_SHARE = 1 / 34
"""Text height as a share of the picture width: a page shows it at half its size."""

WHITE, BLACK = (255, 255, 255), (0, 0, 0)


class Outline(NamedTuple):
    """The outline of an object, and its label.

    Attributes
    ----------
    parts
        Closed lines, each (n, 2) int32 of (column, row).
    words
        Label above it; "" = none.
    """

    parts: tuple[npt.NDArray[np.int32], ...]
    words: str = ""


def outline_of(mask: Mask, words: str = "") -> Outline:
    """Return the outlines of the True regions of an (H, W) mask."""
    found, _ = cv2.findContours(mask.astype(np.uint8), cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_SIMPLE)
    return Outline(tuple(np.asarray(part[:, 0], np.int32) for part in found), words)


def with_outlines(image: Image, outlines: Sequence[Outline]) -> Rgb:
    """Return the image, (H, W, 3) uint8, with objects outlined in pink and labelled above."""
    picture = np.array(as_rgb(image))
    cols = picture.shape[1]
    thickness = max(1, round(cols / 400))
    for one in outlines:
        cv2.polylines(picture, [*one.parts], True, FRAME, thickness, cv2.LINE_AA)
    canvas = PillowImage.fromarray(picture)
    size = max(11, round(cols * TEXT_SHARE))
    draw, font = ImageDraw.Draw(canvas), ImageFont.load_default(size)
    for one in outlines:
        if not one.words or not one.parts:
            continue
        points = np.concatenate(one.parts)
        middle, top = float(np.mean(np.ptp(points[:, 0]) / 2 + points[:, 0].min())), float(points[:, 1].min())
        half = draw.textlength(one.words, font) / 2
        place = float(np.clip(middle, half, max(half, cols - half))), max(top - size / 4, 1.1 * size)
        draw.text(place, one.words, WHITE, font, anchor="ms", stroke_width=max(2, size // 8), stroke_fill=BLACK)
    return np.array(canvas)
