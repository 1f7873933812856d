"""Calibration boards in images: their corners, the area they cover, and the reprojection error of each pair."""

from __future__ import annotations

from collections.abc import Sequence

import cv2
import numpy as np
import plotly.graph_objects as go

from stereolag.core.arrays import Rgb
from stereolag.core.inputs import Image
from stereolag.figures.charts import LEGEND_ABOVE, laid_out
from stereolag.figures.pictures import FRAME, SENSOR_1, SENSOR_2, VIRIDIS, Rgba, fitted
from stereolag.geometry.boards import Board, Corners

CORNERS_WIDTH_PX = 720
"""Width of a picture with its corners, px."""

COVERAGE_WIDTH_PX = 420
"""Width of the coverage picture, px."""

COVERAGE_COLOUR = VIRIDIS[110]
"""Colour of boards in the coverage picture, which is transparent elsewhere: visible on the light and the dark page."""

BORDER_COLOUR = (150, 146, 138)
"""Colour of its border, visible on both pages too."""

BOARD_OPACITY = 0.2
"""Opacity of one board; overlapping boards are more opaque."""

UNUSED_COLOUR = "#9a9a9a"
"""Colour of pairs that are not used."""

ROW_LINE_COUNT = 14
"""Number of lines across a rectified pair."""


def with_corners(image: Image, corners: Corners | None, board: Board) -> Rgb:
    """Return a picture with the detected corners joined row by row, each row in its own colour."""
    picture = fitted(image, CORNERS_WIDTH_PX).copy()
    if corners is None:
        return picture
    factor = picture.shape[1] / image.shape[1]
    places = np.rint(((corners.points + 0.5) * factor - 0.5) * 16).astype(np.int32)  # in sixteenths of a pixel
    rows = corners.numbers // board.columns
    for row in np.unique(rows):
        colour = VIRIDIS[round(255 * (0.25 + 0.75 * row / max(1, board.rows - 1)))].tolist()
        line = places[rows == row]
        cv2.polylines(picture, [line], False, colour, 2, cv2.LINE_AA, 4)
        for place in line.tolist():
            cv2.circle(picture, place, 4 * 16, FRAME, 1, cv2.LINE_AA, 4)
    cv2.circle(picture, places[0].tolist(), 8 * 16, FRAME, 2, cv2.LINE_AA, 4)
    return picture


def coverage_picture(corners: Sequence[Corners], size: tuple[int, int]) -> Rgba:
    """Return all boards detected on a transparent picture, RGBA, with the aspect ratio of `size`, (width, height)."""
    factor = COVERAGE_WIDTH_PX / size[0]
    height = max(1, round(size[1] * factor))
    transparency = np.ones((height, COVERAGE_WIDTH_PX))
    for one in corners:
        covered = np.zeros((height, COVERAGE_WIDTH_PX), np.uint8)
        cv2.fillConvexPoly(covered, cv2.convexHull(np.rint(one.points * factor).astype(np.int32)), 1)
        transparency[covered > 0] *= 1 - BOARD_OPACITY
    opacity = np.rint(255 * (1 - transparency)).astype(np.uint8)
    for one in corners:
        for place in np.rint(one.points * factor).astype(int).tolist():
            cv2.circle(opacity, place, 1, 255, -1, cv2.LINE_AA)
    picture = np.dstack([np.full((height, COVERAGE_WIDTH_PX, 3), COVERAGE_COLOUR, np.uint8), opacity])
    cv2.rectangle(picture, (0, 0), (COVERAGE_WIDTH_PX - 1, height - 1), (*BORDER_COLOUR, 255), 1)
    return picture


def error_bars(
    names: Sequence[str], left: Sequence[float], right: Sequence[float], used: Sequence[bool], shown: int
) -> go.Figure:
    """Return the reprojection error of each pair, px, as two bars; a click returns the number of the pair.

    Parameters
    ----------
    names
        Names of the pairs.
    left, right
        RMS error of each image, px; NaN = unknown.
    used
        Whether each pair is used; others are grey.
    shown
        Number of the pair being shown; its name is bold.
    """
    figure = go.Figure(
        [
            go.Bar(
                x=[*range(len(names))],
                y=np.asarray(values, dtype=np.float32),
                name=side,
                marker={"color": np.where(used, colour, UNUSED_COLOUR).tolist()},
                hovertemplate=f"{side}: %{{y:.2f}} px<extra></extra>",
            )
            for side, values, colour in (("left", left, SENSOR_1), ("right", right, SENSOR_2))
        ]
    )
    known = [
        error for error, is_used in zip((*left, *right), (*used, *used), strict=True) if is_used and error == error
    ]
    if known:
        # Only the pairs in use determine the range: the error of another may be a hundred times larger.
        figure.update_yaxes(range=(0, 1.6 * max(known)))
    labels = [f"<b>{name}</b>" if number == shown else name for number, name in enumerate(names)]
    x = {"tickvals": [*range(len(names))], "ticktext": labels, "title": "pair"}
    return laid_out(
        figure, 240, x, "error, px", barmode="group", bargap=0.25, legend=LEGEND_ABOVE, hovermode="x unified"
    )


def with_row_lines(left: Image, right: Image) -> Rgb:
    """Return a rectified pair side by side with lines along rows: corresponding points are on the same line."""
    picture = np.ascontiguousarray(np.hstack([fitted(image, CORNERS_WIDTH_PX) for image in (left, right)]))
    for row in np.linspace(0, picture.shape[0] - 1, ROW_LINE_COUNT + 2)[1:-1].astype(int).tolist():
        cv2.line(picture, (0, row), (picture.shape[1] - 1, row), FRAME, 1)
    return picture
