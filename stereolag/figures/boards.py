"""Calibration boards in pictures: their corners, their coverage, and the error of each pair."""

from __future__ import annotations

from collections.abc import Sequence

import cv2
import numpy as np
import plotly.graph_objects as go

from stereolag.core.arrays import Rgb
from stereolag.core.inputs import Image
from stereolag.figures.charts import LEGEND_ABOVE, laid_out
from stereolag.figures.pictures import FRAME, SENSOR_1, SENSOR_2, VIRIDIS, Rgba, as_rgb, fitted
from stereolag.geometry.boards import Board, Corners

SHOWN_WIDTH = 720
"""Width of a picture with its corners, px."""

COVERED_WIDTH = 420
INK, EDGE = VIRIDIS[110], (150, 146, 138)
"""Colours of the coverage picture, which is transparent elsewhere: both show on the light and on the dark page."""

OPACITY = 0.2
"""Opacity of one board; it adds up where boards overlap."""

LEFT_OUT_COLOUR = "#9a9a9a"
ROW_LINES = 14


def with_corners(image: Image, corners: Corners | None, board: Board) -> Rgb:
    """Return a picture with the detected corners joined row by row, each row in its own colour."""
    picture = np.ascontiguousarray(fitted(image, SHOWN_WIDTH))
    if corners is None:
        return picture
    factor = picture.shape[1] / image.shape[1]
    places = (corners.points + 0.5) * factor - 0.5
    rows = corners.numbers // board.columns
    for row in np.unique(rows):
        shade = VIRIDIS[round(255 * (0.25 + 0.75 * row / max(1, board.rows - 1)))]
        colour = int(shade[0]), int(shade[1]), int(shade[2])
        line = np.rint(places[rows == row] * 16).astype(np.int32)
        cv2.polylines(picture, [line[:, None]], False, colour, 2, cv2.LINE_AA, 4)
        for place in line:
            cv2.circle(picture, (int(place[0]), int(place[1])), 4 * 16, FRAME, 1, cv2.LINE_AA, 4)
    first = np.rint(places[0] * 16).astype(int)
    cv2.circle(picture, (int(first[0]), int(first[1])), 8 * 16, FRAME, 2, cv2.LINE_AA, 4)
    return picture


def coverage_picture(corners: Sequence[Corners], size: tuple[int, int]) -> Rgba:
    """Return a transparent picture, RGBA, in the proportions of `size` (width, height) with all boards detected."""
    factor = COVERED_WIDTH / size[0]
    height = max(1, round(size[1] * factor))
    seen_through = np.ones((height, COVERED_WIDTH))
    for one in corners:
        here = np.zeros((height, COVERED_WIDTH), np.uint8)
        cv2.fillConvexPoly(here, cv2.convexHull(np.rint(one.points * factor).astype(np.int32)), 1)
        seen_through[here > 0] *= 1 - OPACITY
    opacity = np.rint(255 * (1 - seen_through)).astype(np.uint8)
    for one in corners:
        for place in np.rint(one.points * factor).astype(int):
            cv2.circle(opacity, (int(place[0]), int(place[1])), 1, 255, -1, cv2.LINE_AA)
    picture = np.dstack([np.full((height, COVERED_WIDTH, 3), INK, np.uint8), opacity])
    cv2.rectangle(picture, (0, 0), (COVERED_WIDTH - 1, height - 1), (*EDGE, 255), 1)
    return picture


def error_bars(
    names: Sequence[str], left: Sequence[float], right: Sequence[float], counts: Sequence[bool], shown: int
) -> go.Figure:
    """Return the reprojection error of each pair, px, as two bars; a click returns the number of the pair.

    Parameters
    ----------
    names
        Names of the pairs.
    left, right
        RMS error of each image, px; NaN = unknown.
    counts
        Whether each pair is used; others are grey.
    shown
        Number of the pair on show; its name is bold.
    """
    figure = go.Figure()
    for side, values, colour in (("left", left, SENSOR_1), ("right", right, SENSOR_2)):
        colours = [colour if used else LEFT_OUT_COLOUR for used in counts]
        figure.add_trace(
            go.Bar(
                x=[*range(len(names))],
                y=np.asarray(values, dtype=np.float32),
                name=side,
                marker={"color": colours},
                hovertemplate=f"{side}: %{{y:.2f}} px<extra></extra>",
            )
        )
    known = [value for value, used in zip((*left, *right), (*counts, *counts), strict=True) if used and value == value]
    if known:
        # Only the pairs in use set the range: the error of one left out may be a hundred times larger.
        figure.update_yaxes(range=(0, 1.6 * max(known)))
    labels = [f"<b>{name}</b>" if number == shown else name for number, name in enumerate(names)]
    x = {"tickvals": [*range(len(names))], "ticktext": labels, "title": "pair"}
    return laid_out(
        figure, 240, x, "error, px", barmode="group", bargap=0.25, legend=LEGEND_ABOVE, hovermode="x unified"
    )


def with_row_lines(left: Image, right: Image) -> Rgb:
    """Return a rectified pair side by side with lines along rows: a point on a line is on it in both images."""
    both = np.hstack([fitted(image, SHOWN_WIDTH) for image in (as_rgb(left), as_rgb(right))])
    picture = np.ascontiguousarray(both)
    for row in np.linspace(0, picture.shape[0] - 1, ROW_LINES + 2)[1:-1].astype(int):
        cv2.line(picture, (0, int(row)), (picture.shape[1] - 1, int(row)), FRAME, 1)
    return picture
