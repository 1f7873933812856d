"""Figures of one match: the compared windows, the score surface, the row through its peak, and the window grid."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from itertools import cycle
from typing import Any

import numpy as np
import plotly.graph_objects as go
from plotly.subplots import make_subplots

from stereolag.assess.explaining import MatchExplanation
from stereolag.core.arrays import Array, Box, Indices, Vector
from stereolag.core.inputs import Image, as_grey
from stereolag.core.typography import typeset
from stereolag.figures.charts import DASHES, laid_out, rings
from stereolag.figures.legends import hexadecimal
from stereolag.figures.pictures import CORRELATION, PEAK, SENSOR_1, SENSOR_2, VIRIDIS, data_url, fitted, png

WINDOW_COLOUR = PEAK
SEARCH_COLOUR = SENSOR_1
RUNNER_UP_COLOUR = SENSOR_2
TRUTH_COLOUR = "#2a6e3e"

PATCH_PX = 240
"""Side to which a window is enlarged, px."""

FIT_REACH_PX = 4
"""Reach of the figure of the sub-pixel fit on either side of the peak, px."""

STRIP_WIDTH_PX = 720
"""Width of the strip on a typical screen, px; determines its height so that pixels are about square."""

ROW_HEIGHT_PX = 300
"""Height of the chart of the scores below the strip, px."""

LABEL_SHARE = 0.25
"""Distance of two peaks, as a share of the row, below which their labels are on opposite sides."""

DISPARITY_TITLE = "← nearer    disparity, px    farther →"
"""As in the right image, where nearer points are farther to the left."""

DISPARITY_AXIS: dict[str, Any] = {"title": DISPARITY_TITLE, "autorange": "reversed"}
ROWS_AXIS: dict[str, Any] = {"title": "rows down", "autorange": "reversed"}

OTHER_COLOURS = ("#3f9d6d", "#8a8a94", "#b5863b", "#4b86c9")
SCORE_FORMAT, PLACE_FORMAT = ".3f", ".2~f"
"""Set on the axes, where Plotly writes a true minus sign, which it does not for a format inside a text template."""

SCORE_COLOURS = [[at / 15, hexadecimal(VIRIDIS[at * 17])] for at in range(16)]


def patch_png(image: Image, box: Box) -> bytes:
    """Return part of an image as a PNG, enlarged, in grey, with its contrast stretched."""
    part = as_grey(image)[box.row : box.row + box.height, box.col : box.col + box.width].astype(np.float32)
    scale = max(1, PATCH_PX // max(box.height, box.width))
    return png(fitted(part.repeat(scale, axis=0).repeat(scale, axis=1), 2 * PATCH_PX))


def score_landscape(match: MatchExplanation, searched: MatchExplanation) -> go.Figure:
    """Return the score of every lag of `match` as a surface, with the peak and the runner-up of `searched`."""
    figure = go.Figure(
        go.Surface(
            z=match.surface.astype(np.float32),
            x=-match.dx,
            y=match.dy,
            colorscale=SCORE_COLOURS,
            showscale=False,
            contours={"z": {"show": True, "color": "rgba(255,255,255,0.35)", "width": 1}},
            hovertemplate="disparity %{x} px, %{y} rows down: %{z}<extra></extra>",
        )
    )
    low, high = _score_range(match)
    for at, score, colour, name, side in _peaks(searched):
        # A pin with its head above the surface, so that slopes in front do not hide it.
        figure.add_trace(
            go.Scatter3d(
                x=[-at[1]] * 2,
                y=[at[0]] * 2,
                z=[score, high],
                mode="lines+markers+text",
                line={"color": colour, "width": 5},
                marker={"color": colour, "size": [3, 6]},
                text=["", typeset(f"{name} {score:.3f}")],
                textfont={"color": colour, "size": 13},
                textposition=f"top {side}",
                hovertemplate=typeset(f"{name}: {score:.3f}<extra></extra>"),
            )
        )
    grid = "rgba(128,128,128,0.3)"
    axis = {"showbackground": False, "gridcolor": grid, "zerolinecolor": grid}
    scene = {
        "xaxis": {"title": {"text": "disparity, px"}, "autorange": "reversed", **axis},
        "yaxis": {"title": {"text": "rows down"}, "autorange": "reversed", **axis},
        "zaxis": {"title": {"text": "score"}, "range": [low, high], "hoverformat": SCORE_FORMAT, **axis},
        "aspectmode": "manual",
        "aspectratio": {"x": 1.7, "y": 1.0, "z": 0.75},
        "camera": {"eye": {"x": 0.5, "y": -1.7, "z": 0.95}, "center": {"x": 0, "y": 0, "z": -0.12}},
    }
    return laid_out(figure, 420, {}, {}, margin=0, showlegend=False, scene=scene)


def score_map(match: MatchExplanation, searched: MatchExplanation) -> go.Figure:
    """Return the score of every lag of `match` as a heat map, with the rows of `searched` framed if they are fewer."""
    figure = go.Figure(
        go.Heatmap(
            z=match.surface.astype(np.float32),
            x=-match.dx,
            y=match.dy,
            colorscale=SCORE_COLOURS,
            zmin=_score_range(match)[0],
            zmax=_score_range(match)[1],
            colorbar={"title": {"text": "score"}, "thickness": 12},
            zhoverformat=SCORE_FORMAT,
            hovertemplate="disparity %{x} px, %{y} rows down: %{z}<extra></extra>",
        )
    )
    if searched.dy.size < match.dy.size:
        figure.add_shape(
            type="rect",
            x0=-searched.dx[-1] - 0.5,
            x1=-searched.dx[0] + 0.5,
            y0=searched.dy[0] - 0.5,
            y1=searched.dy[-1] + 0.5,
            line={"color": "#fff", "width": 2},
        )
    for at, _, colour, name, _ in _peaks(searched):
        figure.add_trace(rings([-at[1]], [at[0]], colour, 13, 3, name=name, hoverinfo="skip"))
    return laid_out(figure, 420, DISPARITY_AXIS, ROWS_AXIS, showlegend=False)


def score_row(match: MatchExplanation, right: Image, others: Mapping[str, float]) -> go.Figure:
    """Return the strip of the right image along which the window was shifted, above the score of each disparity.

    Parameters
    ----------
    match
        The match; the row of its peak is shown.
    right
        The right image.
    others
        {name of another method: its disparity at the pixel, px}, drawn as lines.
    """
    top = (match.found or match.search).row
    size = match.window.height
    strip = as_grey(right)[top : top + size, match.search.col : match.search.col + match.search.width]
    # The disparity at which the window is centred on each column of the strip.
    middle = match.window.col + (size - 1) / 2 - (match.search.col + np.arange(strip.shape[1]))
    strip_height = int(np.clip(STRIP_WIDTH_PX * size / max(strip.shape[1], 1), 40, 160))
    height = strip_height + ROW_HEIGHT_PX
    figure = make_subplots(
        rows=2, shared_xaxes=True, vertical_spacing=0.03, row_heights=[strip_height / height, ROW_HEIGHT_PX / height]
    )
    figure.add_trace(
        go.Heatmap(z=strip, x=middle, y=np.arange(size), colorscale="gray", showscale=False, hoverinfo="skip"),
        row=1,
        col=1,
    )
    figure.add_trace(_line(-match.dx, match.row, CORRELATION, "score", markers=match.dx.size <= 96), row=2, col=1)
    low, high = _score_range(match)
    for (name, disparity), colour, dash in zip(others.items(), cycle(OTHER_COLOURS), cycle(DASHES), strict=False):
        other = go.Scatter(
            x=[disparity] * 2,
            y=[low, high],
            mode="lines",
            line={"color": colour, "width": 2, "dash": dash},
            name=typeset(f"{name} {disparity:.2f} px"),
            hoverinfo="skip",
        )
        figure.add_trace(other, row=2, col=1)
    for at, score, colour, name, side in _peaks(match):
        if match.peak and at[0] == match.peak[0]:
            label = {"text": [typeset(f"{name} {score:.3f}")], "textfont": {"color": colour, "size": 13}}
            more = {"textposition": f"top {side}", "showlegend": False, "hoverinfo": "skip"}
            figure.add_trace(rings([-at[1]], [score], colour, 12, 3, **label, **more), row=2, col=1)
            edges = {"x0": -at[1] - size / 2, "x1": -at[1] + size / 2, "y0": -0.5, "y1": size - 0.5}
            figure.add_shape(type="rect", **edges, line={"color": colour, "width": 3}, row=1, col=1)
    whole = -float(match.dx[0]) + size / 2 + 0.5, -float(match.dx[-1]) - size / 2 - 0.5
    below = {"orientation": "h", "x": 0, "y": -0.2, "yanchor": "top"}
    x = {"range": whole, "showgrid": False, "hoverformat": PLACE_FORMAT}
    laid_out(figure, height, x, {}, legend=below, hovermode="x")
    figure.update_xaxes(title=DISPARITY_TITLE, row=2, col=1)
    figure.update_yaxes(visible=False, autorange="reversed", row=1, col=1)
    return figure.update_yaxes(title="score", range=[low, high], hoverformat=SCORE_FORMAT, row=2, col=1)


def sub_pixel_fit(match: MatchExplanation) -> go.Figure:
    """Return the scores near a peak that is not at the edge, with the fitted curve, whose maximum is the disparity."""
    assert match.peak is not None
    near = np.abs(match.dx - match.peak[1]) <= FIT_REACH_PX
    fine = np.linspace(-1.5, 1.5, 121)
    scores = go.Scatter(
        x=-match.dx[near],
        y=match.row[near].astype(np.float32),
        mode="markers",
        marker={"color": CORRELATION, "size": 10},
        hovertemplate="%{x} px: %{y}<extra></extra>",
    )
    figure = go.Figure([_line(-(match.peak[1] + fine), match.fit(fine), PEAK, "fit"), scores])
    figure.add_vline(
        x=match.disparity,
        line={"color": PEAK, "width": 2},
        annotation={"text": typeset(f"{match.disparity:.2f} px"), "font": {"color": PEAK, "size": 14}},
        annotation_position="bottom right",
    )
    x = DISPARITY_AXIS | {"dtick": 1, "hoverformat": PLACE_FORMAT}
    return laid_out(figure, 330, x, {"hoverformat": SCORE_FORMAT}, showlegend=False)


def _peaks(match: MatchExplanation) -> list[tuple[tuple[int, int], float, str, str, str]]:
    """Return position, score, colour, name and label side of the runner-up and of the peak, if they exist."""
    peaks = [
        (match.runner_up, match.runner_up_score, RUNNER_UP_COLOUR, "runner-up"),
        (match.peak, match.peak_score, WINDOW_COLOUR, "peak"),
    ]
    apart = match.runner_up[1] - match.peak[1] if match.peak and match.runner_up else match.dx.size
    sides = ("center", "center")
    if abs(apart) < LABEL_SHARE * match.dx.size:
        sides = ("right", "left") if apart > 0 else ("left", "right")
    return [
        (at, score, colour, name, side)
        for (at, score, colour, name), side in zip(peaks, sides, strict=True)
        if at is not None
    ]


def _score_range(match: MatchExplanation) -> tuple[float, float]:
    """Return the ends of the score axis: just above 1 for correlations, and just below -0.2 or lower for ZNCC."""
    known = match.surface[np.isfinite(match.surface)]
    if known.size == 0:
        return 0.0, 1.0
    low, high = float(known.min()), float(known.max())
    # Fixed ends for correlations, so that figures can be compared.
    if match.score in ("zncc", "ncc"):
        return min(low, -0.2 if match.score == "zncc" else low) - 0.02, 1.12
    return low, high + 0.12 * (high - low)


def _line(x: Array, y: Vector, colour: str, name: str, *, markers: bool = False) -> go.Scatter:
    return go.Scatter(
        x=x,
        y=y.astype(np.float32),
        mode="lines+markers" if markers else "lines",
        line={"color": colour, "width": 2},
        marker={"size": 4},
        name=name,
        showlegend=False,
        hovertemplate="%{x} px: %{y}<extra></extra>",
    )


MAX_PER_SIDE = 24
"""Largest number of windows drawn per window side; of a finer grid only every second, third … window is drawn."""

MARGIN_SHARE = 0.25
"""Margin of image around the windows drawn, as a share of a window's side."""

MANY_DOTS = 20
"""Number of dots in a row above which they are drawn smaller."""

HEIGHT_PX = 420
WINDOW_FILL = "rgba(224, 68, 124, 0.06)"
"""So transparent that the image shows through nine overlapping windows."""


@dataclass(frozen=True, eq=False)
class WindowGrid:
    """The windows of a map around one of them.

    Attributes
    ----------
    part
        The part of the image drawn.
    rows, cols
        Top rows and left columns of windows with their centres in that part, px; each pair is one window and one value.
    middle
        The window around which the part was chosen.
    step
        Distance from one window to the next, px.
    every
        Every `every`-th window is drawn.
    """

    part: Box
    rows: Indices
    cols: Indices
    middle: Box
    step: int
    every: int

    @property
    def values(self) -> int:
        """Return the number of map values in the part drawn."""
        return self.rows.size * self.cols.size

    @property
    def overlap(self) -> float:
        """Return the actual overlap with the next window, as a share of its side: the step is in whole pixels."""
        return max(0.0, 1 - self.step / self.middle.height)

    def drawn(self, starts: Indices, middle: int) -> Indices:
        """Return the rows or columns that are drawn: `middle`, and every `every`-th on both sides of it."""
        return np.asarray(starts[(starts - middle) % (self.every * self.step) == 0])

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
        Distance from one window to the next, px.

    Raises
    ------
    ValueError
        If `middle` is not a window of the grid.
    """
    if middle.row % step or middle.col % step:
        raise ValueError(f"a window at ({middle.row}, {middle.col}) is not on a grid of step {step}.")
    size = middle.height
    every = math.ceil(size / (MAX_PER_SIDE * step))
    margin = every * step + max(2, round(MARGIN_SHARE * size))
    (top, bottom), (left, right) = (
        (max(0, start - margin), min(end, start + size + margin))
        for start, end in ((middle.row, shape[0]), (middle.col, shape[1]))
    )
    rows, cols = (
        _starts(first, last, end, size, step) for first, last, end in ((top, bottom, shape[0]), (left, right, shape[1]))
    )
    return WindowGrid(Box(top, left, bottom - top, right - left), rows, cols, middle, step, every)


def _starts(first: int, last: int, end: int, size: int, step: int) -> Indices:
    """Return the starts of the windows inside the image whose centres are at pixels from `first` up to `last`."""
    starts = np.arange(0, end - size + 1, step)
    centres = starts + (size - 1) / 2
    return starts[(centres >= first) & (centres < last)]


def overlap_figure(image: Image, grid: WindowGrid) -> go.Figure:
    """Return part of an image with neighbouring windows, darker where they overlap, and their centres as dots."""
    figure = go.Figure()
    part, size = grid.part, grid.middle.height
    # Plotly places the centre of a pixel at its index.
    left, top = part.col - 0.5, part.row - 0.5
    figure.add_layout_image(
        source=data_url(patch_png(image, part)),
        x=left,
        y=top,
        sizex=part.width,
        sizey=part.height,
        xref="x",
        yref="y",
        sizing="stretch",
        layer="below",
    )
    for row, col in grid.neighbours():
        figure.add_shape(
            type="rect",
            x0=col - 0.5,
            x1=col + size - 0.5,
            y0=row - 0.5,
            y1=row + size - 0.5,
            fillcolor=WINDOW_FILL,
            line={"color": WINDOW_COLOUR, "width": 4 if (row, col) == (grid.middle.row, grid.middle.col) else 1.5},
            layer="between",
        )
    half = (size - 1) / 2
    rows, cols = grid.drawn(grid.rows, grid.middle.row), grid.drawn(grid.cols, grid.middle.col)
    own_centre = grid.middle.row + half, grid.middle.col + half
    centres = [(row + half, col + half) for row in rows for col in cols]
    small = 3 if max(rows.size, cols.size) > MANY_DOTS else 4
    others = _dots([at for at in centres if at != own_centre], small, "centre of a window")
    figure.add_traces([others, _dots([own_centre], 10, "centre of the window chosen")])
    axis = {"showgrid": False, "zeroline": False, "constrain": "domain"}
    x = {"title": "column, px", "range": [left, left + part.width], **axis}
    y = {"title": "row, px", "range": [top + part.height, top], "scaleanchor": "x", **axis}
    return laid_out(figure, HEIGHT_PX, x, y, showlegend=False, plot_bgcolor="rgba(0,0,0,0)")


def _dots(places: list[tuple[float, float]], size: int, name: str) -> go.Scatter:
    return go.Scatter(
        x=np.array([col for _, col in places], np.float32),
        y=np.array([row for row, _ in places], np.float32),
        mode="markers",
        marker={"size": size, "color": "#fff", "line": {"color": "#16161c", "width": 0.5 if size == 3 else 1}},
        name=name,
        hovertemplate=f"{name}<br>row %{{y}}, column %{{x}}<extra></extra>",
    )
