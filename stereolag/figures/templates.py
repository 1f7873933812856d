"""The matches of a template search framed in the image, and its score map."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import cv2
import numpy as np
import numpy.typing as npt
import plotly.graph_objects as go

from stereolag.core.inputs import Image
from stereolag.figures.block_scores import best_of_blocks, block_side
from stereolag.figures.disparity import legend
from stereolag.figures.frames import draw_frame
from stereolag.figures.pictures import FRAME, SHOWN_WIDTH, VIRIDIS, as_rgb, coloured, fitted, png
from stereolag.templates import TemplateMatch
from stereolag.templates.patterns import opaque_pixels

CLOSE_UP_WIDTH = 640
LEFT_OUT = 128


def framed(
    picture: Image,
    matches: Sequence[TemplateMatch],
    doubtful: Sequence[TemplateMatch] = (),
    *,
    template: tuple[int, ...] | None = None,
    width: int = SHOWN_WIDTH,
) -> bytes:
    """Return the image, at most `width` px wide, as a PNG with a frame around every match, boldest for the best.

    Frames are dashed at doubtful places, and rotated if the shape of the template is given.
    """
    shown = fitted(picture, width).copy()
    scale = shown.shape[1] / picture.shape[1]
    thickness = max(2, shown.shape[1] // 250)
    for match in reversed(doubtful):
        draw_frame(shown, match, scale, thickness, template=template, dashed=True)
    for match in reversed(matches):
        bold = thickness if match is matches[0] else max(1, thickness // 2)
        draw_frame(shown, match, scale, bold, template=template)
    return png(shown)


def what_counts(template: Image, mask: Image | None) -> bytes:
    """Return the template as a PNG, neutral grey where its mask, or else its alpha, excludes it."""
    if mask is None:
        return png(as_rgb(template))
    colours = template[:, :, :3] if template.ndim == 3 else template
    shown = as_rgb(colours).copy()
    shown[~opaque_pixels(template, mask)] = LEFT_OUT
    return png(shown)


def match_close_up(
    picture: Image, match: TemplateMatch, *, doubtful: bool = False, template: tuple[int, ...] | None = None
) -> bytes:
    """Return the match and its surroundings, 4:3 and enlarged, as a PNG; its frame is dashed if doubtful."""
    height = 2 * max(match.height, match.width)
    rows = _around(match.row + match.height // 2, height, picture.shape[0])
    cols = _around(match.col + match.width // 2, height * 4 // 3, picture.shape[1])
    part = as_rgb(picture[rows, cols])
    scale = CLOSE_UP_WIDTH / max(part.shape[:2])
    size = (max(1, round(part.shape[1] * scale)), max(1, round(part.shape[0] * scale)))
    shown = np.asarray(cv2.resize(part, size, interpolation=cv2.INTER_CUBIC), dtype=np.uint8)
    moved = replace(match, row=match.row - rows.start, col=match.col - cols.start)
    draw_frame(shown, moved, scale, 5, template=template, dashed=doubtful)
    return png(shown)


def score_map_png(score_map: npt.NDArray[np.float32], matches: Sequence[TemplateMatch]) -> bytes:
    """Return the score of every place as a PNG: dark at 0 and below, yellow at 1, flat places grey, matches ringed.

    A pixel that stands for several places shows the best of them, because a peak is one place wide.
    """
    factor = block_side(score_map)
    shown = coloured(best_of_blocks(score_map, factor)[0], 0, 1)
    for match in matches:
        centre = (match.col // factor, match.row // factor)
        radius, width = max(8, shown.shape[1] // 50), max(1, shown.shape[1] // 250)
        for colour, thickness in (((255, 255, 255), width + 2), (FRAME, width)):  # seen on every colour by all eyes
            cv2.circle(shown, centre, radius, colour, thickness, cv2.LINE_AA)
    return png(shown)


def score_legend() -> go.Figure:
    """Return the legend of the score colours."""
    return legend(0, 1, VIRIDIS, "score")


def _around(centre: int, length: int, end: int) -> slice:
    """Return `length` pixels around `centre`, shifted (or cut) to stay within 0 … `end`."""
    start = max(0, min(centre - length // 2, end - length))
    return slice(start, min(end, start + length))
