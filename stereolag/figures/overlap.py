"""The grid of windows around one of them: the overlap of neighbours, and the places of the map's values."""

from __future__ import annotations

import base64
import math
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
import plotly.graph_objects as go

from stereolag.assess.explaining import Box
from stereolag.core.inputs import Image
from stereolag.figures.match import MARGIN, WINDOW_COLOUR, patch_png

Starts = npt.NDArray[np.int64]

CLOSEST = 24
"""Most windows drawn per window side; of a finer grid only every second, third … window is drawn."""

BESIDE_SHARE = 0.25
"""Margin of image around the windows drawn, as a share of a window's side."""

MANY_ACROSS = 20
"""With more dots side by side they are drawn smaller."""

HEIGHT = 420
FILL = "rgba(224, 68, 124, 0.06)"
"""Nine overlapping windows still let the image show through."""


@dataclass(frozen=True, eq=False)
class WindowGrid:
    """The windows of a map around one of them.

    Attributes
    ----------
    cut
        The part of the image drawn.
    rows, cols
        Top rows and left columns of windows with their centres in the cut, px; each pair is one window and one value.
    middle
        The window around which the cut was made.
    step
        Px from one window to the next.
    every
        Every how many windows one is drawn.
    """

    cut: Box
    rows: Starts
    cols: Starts
    middle: Box
    step: int
    every: int

    @property
    def values(self) -> int:
        """Return the number of map values in the cut."""
        return self.rows.size * self.cols.size

    @property
    def overlap(self) -> float:
        """Return the actual overlap with the next window, 0..1 of the side: the step is in whole pixels."""
        return max(0.0, 1 - self.step / self.middle.height)

    def drawn(self, starts: Starts, middle: int) -> Starts:
        """Return the rows or columns that are drawn: `middle`, and every `every`-th on both sides of it."""
        shown: Starts = starts[(starts - middle) % (self.every * self.step) == 0]
        return shown

    def neighbours(self) -> list[tuple[int, int]]:
        """Return (row, col) of the middle window and of the up to eight drawn around it."""
        reach = self.every * self.step
        row, col = self.middle.row, self.middle.col
        rows, cols = self.drawn(self.rows, row), self.drawn(self.cols, col)
        return [(int(y), int(x)) for y in rows for x in cols if abs(y - row) <= reach and abs(x - col) <= reach]


def window_grid(shape: tuple[int, int], middle: Box, step: int) -> WindowGrid:
    """Return the windows of a map around one of them.

    Parameters
    ----------
    shape
        Shape of the image, (rows, cols) px.
    middle
        A window of the grid, entirely inside the image.
    step
        Px from one window to the next.

    Raises
    ------
    ValueError
        If `middle` is not a window of the grid.
    """
    if middle.row % step or middle.col % step:
        raise ValueError(f"a window at ({middle.row}, {middle.col}) is not on a grid of step {step}.")
    size = middle.height
    every = math.ceil(size / (CLOSEST * step))
    beside = every * step + max(2, round(BESIDE_SHARE * size))
    (top, bottom), (left, right) = (
        (max(0, start - beside), min(end, start + size + beside))
        for start, end in ((middle.row, shape[0]), (middle.col, shape[1]))
    )
    rows, cols = (
        _starts(first, last, end, size, step) for first, last, end in ((top, bottom, shape[0]), (left, right, shape[1]))
    )
    return WindowGrid(Box(top, left, bottom - top, right - left), rows, cols, middle, step, every)


def _starts(first: int, last: int, end: int, size: int, step: int) -> Starts:
    """Return the starts of the windows inside the image whose centres are at pixels from `first` up to `last`."""
    starts = np.arange(0, end - size + 1, step)
    centres = starts + (size - 1) / 2
    return starts[(centres >= first) & (centres < last)]


def overlap_figure(image: Image, grid: WindowGrid) -> go.Figure:
    """Return the cut of an image with neighbouring windows, darker where they overlap, and their centres as dots."""
    figure = go.Figure()
    cut, size = grid.cut, grid.middle.height
    # Plotly places the centre of a pixel at its index.
    left, top = cut.col - 0.5, cut.row - 0.5
    figure.add_layout_image(
        source="data:image/png;base64," + base64.b64encode(patch_png(image, cut)).decode(),
        x=left,
        y=top,
        sizex=cut.width,
        sizey=cut.height,
        xref="x",
        yref="y",
        sizing="stretch",
        layer="below",
    )
    for row, col in grid.neighbours():
        own = (row, col) == (grid.middle.row, grid.middle.col)
        figure.add_shape(
            type="rect",
            x0=col - 0.5,
            x1=col + size - 0.5,
            y0=row - 0.5,
            y1=row + size - 0.5,
            fillcolor=FILL,
            line={"color": WINDOW_COLOUR, "width": 4 if own else 1.5},
            layer="between",
        )
    half = (size - 1) / 2
    rows, cols = grid.drawn(grid.rows, grid.middle.row), grid.drawn(grid.cols, grid.middle.col)
    own_centre = grid.middle.row + half, grid.middle.col + half
    centres = [(row + half, col + half) for row in rows for col in cols]
    small = 3 if max(rows.size, cols.size) > MANY_ACROSS else 4
    figure.add_trace(_dots([at for at in centres if at != own_centre], small, "centre of a window"))
    figure.add_trace(_dots([own_centre], 10, "centre of the window chosen"))
    figure.update_layout(height=HEIGHT, margin=MARGIN, showlegend=False, plot_bgcolor="rgba(0,0,0,0)")
    axis = {"showgrid": False, "zeroline": False, "constrain": "domain"}
    figure.update_xaxes(title="column, px", range=[left, left + cut.width], **axis)
    figure.update_yaxes(title="row, px", range=[top + cut.height, top], scaleanchor="x", **axis)
    return figure


def _dots(places: list[tuple[float, float]], size: int, name: str) -> go.Scatter:
    return go.Scatter(
        x=np.array([col for _, col in places], np.float32),
        y=np.array([row for row, _ in places], np.float32),
        mode="markers",
        marker={"size": size, "color": "#fff", "line": {"color": "#16161c", "width": 0.5 if size == 3 else 1}},
        name=name,
        hovertemplate=f"{name}<br>row %{{y}}, column %{{x}}<extra></extra>",
    )
