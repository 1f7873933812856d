"""Template matches framed in the image, score maps, and results of searches in a damaged part."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import replace
from functools import cache
from typing import TypeAlias

import cv2
import numpy as np
import plotly.graph_objects as go

from stereolag.core.arrays import FloatMap, Rgb
from stereolag.core.inputs import Image
from stereolag.figures.charts import legend
from stereolag.figures.pictures import (
    BLACK,
    FRAME,
    MAX_WIDTH_PX,
    VIRIDIS,
    WHITE,
    Colour,
    Rgba,
    as_rgb,
    coloured,
    fitted,
    jpeg,
    png,
)
from stereolag.templates import TemplateMatch
from stereolag.templates.by_hand import ReducedSearch, best_of_blocks, block_side
from stereolag.templates.patterns import opaque_pixels
from stereolag.templates.trials import Trial, pixels_around

Point: TypeAlias = tuple[int, int]
Shape: TypeAlias = tuple[int, ...]

CLOSE_UP_WIDTH_PX = 640
MASKED_GREY = 128
"""Grey level of the template's pixels that are not compared."""


def framed(
    picture: Image,
    matches: Sequence[TemplateMatch],
    doubtful: Sequence[TemplateMatch] = (),
    *,
    template: Shape | None = None,
    width: int = MAX_WIDTH_PX,
) -> Rgb:
    """Return the image, at most `width` px wide, with a frame around every match, boldest for the best.

    Frames are dashed at doubtful places, and rotated if the shape of the template is given. Blocks that disagree with
    the template are outlined.
    """
    shown = fitted(picture, width).copy()
    scale = shown.shape[1] / picture.shape[1]
    thickness = max(2, shown.shape[1] // 250)
    for match in reversed(doubtful):
        _draw_frame(shown, match, scale, thickness, template=template, dashed=True)
    for match in reversed(matches):
        bold = thickness if match is matches[0] else max(1, thickness // 2)
        _draw_frame(shown, match, scale, bold, template=template)
    return shown


def masked_template(template: Image, mask: Image | None) -> bytes:
    """Return the template as a PNG, neutral grey where its mask, or else its alpha, excludes it."""
    if mask is None:
        return png(as_rgb(template))
    shown = as_rgb(template[:, :, :3] if template.ndim == 3 else template).copy()
    shown[~opaque_pixels(template, mask)] = MASKED_GREY
    return png(shown)


def match_close_up(
    picture: Image, match: TemplateMatch, *, doubtful: bool = False, template: Shape | None = None
) -> bytes:
    """Return the match and its surroundings, 4:3 and enlarged, as a PNG; its frame is dashed if doubtful."""
    height = 2 * max(match.height, match.width)
    rows = pixels_around(match.row + match.height // 2, height, picture.shape[0])
    cols = pixels_around(match.col + match.width // 2, height * 4 // 3, picture.shape[1])
    part = as_rgb(picture[rows, cols])
    scale = CLOSE_UP_WIDTH_PX / max(part.shape[:2])
    size = (max(1, round(part.shape[1] * scale)), max(1, round(part.shape[0] * scale)))
    shown = np.asarray(cv2.resize(part, size, interpolation=cv2.INTER_CUBIC), dtype=np.uint8)
    moved = replace(match, row=match.row - rows.start, col=match.col - cols.start)
    _draw_frame(shown, moved, scale, 5, template=template, dashed=doubtful)
    return png(shown)


def score_map_picture(score_map: FloatMap, matches: Sequence[TemplateMatch], factor: int | None = None) -> Rgb:
    """Return the score of every place as a picture: dark at 0 and below, yellow at 1, flat places grey, matches ringed.

    Each pixel shows the best score of `factor` × `factor` places, because a peak is one place wide; by default the map
    is as large as fits the page.
    """
    factor = factor or block_side(score_map)
    shown = coloured(best_of_blocks(score_map, factor)[0], 0, 1)
    for match in matches:
        centre = (match.col // factor, match.row // factor)
        radius, width = max(8, shown.shape[1] // 50), max(1, shown.shape[1] // 250)
        for colour, thickness in ((WHITE, width + 2), (FRAME, width)):  # visible on every colour
            cv2.circle(shown, centre, radius, colour, thickness, cv2.LINE_AA)
    return shown


def relief(search: ReducedSearch, row: int, col: int, side: int = 400) -> Rgba:
    """Return a relief of the scores around a place, seen from the front and above, (side, side, 4) uint8.

    Equal heights are equal scores, from 0 upwards; places without a score and outside the map have the height 0.
    """
    reach = int(np.clip(round(0.6 * max(search.opaque.shape)), 8, 20))
    around = np.nan_to_num(np.pad(search.score_map, reach))[row : row + 2 * reach + 1, col : col + 2 * reach + 1]
    across = np.arange(-reach, reach + 1) / (2 * reach + 1)
    near = (across - across[0])[:, np.newaxis]  # 0 far … 1 near
    x = side * (0.5 + across * (0.72 + 0.26 * near))
    y = side * (0.58 + 0.42 * near - 0.54 * np.maximum(0, around)) - 4
    corners = np.rint(np.stack([x, y], axis=-1)).astype(np.int32)
    means = (around[:-1, :-1] + around[:-1, 1:] + around[1:, 1:] + around[1:, :-1]) / 4
    light = 1 + 1.2 * np.clip(np.diff(around[:-1], axis=1), -0.3, 0.3)  # from the left
    colours = np.minimum(255, coloured(means, 0, 1) * light[..., np.newaxis])
    picture = np.zeros((side, side, 4), dtype=np.uint8)
    for down, right in np.ndindex(means.shape):  # far rows first
        cv2.fillConvexPoly(
            picture,
            corners[[down, down, down + 1, down + 1], [right, right + 1, right + 1, right]],
            (*colours[down, right].tolist(), 255),
        )
    return picture


@cache
def score_legend() -> go.Figure:
    """Return the legend of the score colours; it is shared and must not be changed."""
    return legend(0, 1, VIRIDIS, "score")


def _draw_frame(
    picture: Rgb,
    match: TemplateMatch,
    scale: float,
    thickness: int,
    *,
    template: Shape | None = None,
    dashed: bool = False,
) -> None:
    """Draw a frame just outside the match.

    Parameters
    ----------
    picture
        The picture to draw on, changed in place.
    match
        The match, in pixels of the image searched.
    scale, thickness
        Size of `picture` relative to the image searched; thickness of the frame, px.
    template
        Shape of the template, to rotate the frame with the match; None for the upright box around it.
    dashed
        Whether the frame is dashed.
    """
    for colour, width in ((BLACK, thickness + 1), (WHITE, max(1, thickness // 2))):
        for start, end in _disagreement_lines(match, scale):
            cv2.line(picture, start, end, colour, width)
    corners = corners_of(match, scale, thickness // 2 + 1, template)
    for colour, width in ((WHITE, thickness + 2), (FRAME, thickness)):
        for start, end in zip(corners, (*corners[1:], corners[0]), strict=True):
            for one, other in _dashes(start, end, 5 * thickness) if dashed else [(start, end)]:
                cv2.line(picture, one, other, colour, width)


def _disagreement_lines(match: TemplateMatch, scale: float) -> Iterator[tuple[Point, Point]]:
    """Yield the ends of the lines, scaled, around blocks of a match that disagree with the template."""
    if match.kind == "not_there" or not match.blocks:  # nearly all blocks disagree
        return
    differs = np.pad(~np.array(match.blocks), 1)
    down, across = match.height / len(match.blocks), match.width / len(match.blocks[0])

    def corner(row: int, col: int) -> Point:
        return round((match.col + col * across) * scale), round((match.row + row * down) * scale)

    for row, col in np.argwhere(differs[1:] != differs[:-1]).tolist():
        yield corner(row, col - 1), corner(row, col)
    for row, col in np.argwhere(differs[:, 1:] != differs[:, :-1]).tolist():
        yield corner(row - 1, col), corner(row, col)


def corners_of(match: TemplateMatch, scale: float, margin: int, template: Shape | None) -> tuple[Point, ...]:
    """Return the (x, y) of the corners of a match, scaled and moved outwards by `margin` px.

    `template` is the shape of the template, to rotate the corners with the match; None for the upright box around it.
    """
    if template is None or not match.rotation:
        left, top = round(match.col * scale) - margin, round(match.row * scale) - margin
        right = round((match.col + match.width) * scale) + margin
        bottom = round((match.row + match.height) * scale) + margin
        return (left, top), (right, top), (right, bottom), (left, bottom)
    centre_row, centre_col = (match.row + match.height / 2) * scale, (match.col + match.width / 2) * scale
    tall, wide = (side * match.scale * scale / 2 + margin for side in template[:2])
    sine, cosine = math.sin(math.radians(match.rotation)), math.cos(math.radians(match.rotation))
    # Rows count downwards: seen on screen, a counter-clockwise rotation moves the right side up.
    return tuple(
        (round(centre_col + col * cosine + row * sine), round(centre_row - col * sine + row * cosine))
        for row, col in ((-tall, -wide), (-tall, wide), (tall, wide), (tall, -wide))
    )


def _dashes(start: Point, end: Point, length: int) -> Iterator[tuple[Point, Point]]:
    """Yield the ends of the dashes of a line, which begins and ends with one; gaps are as long as dashes."""
    span = max(abs(end[0] - start[0]), abs(end[1] - start[1]))
    pieces = 2 * max(1, round(span / length / 2)) + 1
    at = [
        (round(start[0] + (end[0] - start[0]) * step / pieces), round(start[1] + (end[1] - start[1]) * step / pieces))
        for step in range(pieces + 1)
    ]
    yield from zip(at[::2], at[1::2], strict=True)


def trial_jpeg(part: Image, trial: Trial, place: tuple[int, int], shape: tuple[int, int]) -> bytes:
    """Return the part as a JPEG: a thin white frame at the known place, a bold one where the template was found.

    Parameters
    ----------
    part
        The part searched.
    trial
        Result of a method; a miss has no bold frame.
    place
        True (row, col) of the template's top-left pixel.
    shape
        (height, width) of the template.
    """
    shown = np.ascontiguousarray(as_rgb(part)).copy()
    thin = max(2, shown.shape[1] // 300)
    _draw_box(shown, place, shape, thin, WHITE, BLACK)
    if trial.outcome in ("right", "elsewhere") and trial.row is not None and trial.col is not None:
        _draw_box(shown, (trial.row, trial.col), shape, 3 * thin, FRAME, WHITE)
    return jpeg(shown)


def _draw_box(
    picture: Rgb,
    place: tuple[int, int],
    shape: tuple[int, int],
    thick: int,
    colour: Colour,
    rim: Colour,
) -> None:
    (row, col), (height, width) = place, shape
    top_left, bottom_right = (col - 1, row - 1), (col + width, row + height)
    cv2.rectangle(picture, top_left, bottom_right, rim, thick + 2)
    cv2.rectangle(picture, top_left, bottom_right, colour, thick)
