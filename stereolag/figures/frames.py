"""Frames around template matches, rotated with the match, solid or dashed."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import TypeAlias

import cv2

from stereolag.core.arrays import Rgb
from stereolag.figures.pictures import FRAME
from stereolag.templates import TemplateMatch

Point: TypeAlias = tuple[int, int]
Shape: TypeAlias = tuple[int, ...]


def draw_frame(
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
        The match, in pixels of the picture before scaling.
    scale, thickness
        Size of `picture` relative to the one searched; thickness of the frame, px.
    template
        Shape of the template, to rotate the frame with the match; None for the upright box around it.
    dashed
        Whether the frame is dashed.
    """
    corners = _corners(match, scale, thickness // 2 + 1, template)
    for colour, width in (((255, 255, 255), thickness + 2), (FRAME, thickness)):
        for start, end in zip(corners, (*corners[1:], corners[0]), strict=True):
            for one, other in _dashes(start, end, 5 * thickness) if dashed else [(start, end)]:
                cv2.line(picture, one, other, colour, width)


def _corners(match: TemplateMatch, scale: float, away: int, template: Shape | None) -> tuple[Point, ...]:
    if template is None or not match.rotation:
        left, top = round(match.col * scale) - away, round(match.row * scale) - away
        right = round((match.col + match.width) * scale) + away
        bottom = round((match.row + match.height) * scale) + away
        return (left, top), (right, top), (right, bottom), (left, bottom)
    centre_row, centre_col = (match.row + match.height / 2) * scale, (match.col + match.width / 2) * scale
    tall, wide = (side * match.scale * scale / 2 + away for side in template[:2])
    sine, cosine = math.sin(math.radians(match.rotation)), math.cos(math.radians(match.rotation))
    # Rows count downwards: seen on screen, a counter-clockwise rotation moves the right side up.
    return tuple(
        (round(centre_col + col * cosine + row * sine), round(centre_row - col * sine + row * cosine))
        for row, col in ((-tall, -wide), (-tall, wide), (tall, wide), (tall, -wide))
    )


def _dashes(start: Point, end: Point, length: int) -> Iterator[tuple[Point, Point]]:
    """Yield the ends of the dashes of a line, with gaps as long as a dash; both ends of the line have a dash."""
    span = max(abs(end[0] - start[0]), abs(end[1] - start[1]))
    pieces = 2 * max(1, round(span / length / 2)) + 1
    at = [
        (round(start[0] + (end[0] - start[0]) * step / pieces), round(start[1] + (end[1] - start[1]) * step / pieces))
        for step in range(pieces + 1)
    ]
    yield from zip(at[::2], at[1::2], strict=True)
