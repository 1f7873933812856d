"""A sweep as two figures of one grid: small disparity maps, and the bad-2 of each cell."""

from __future__ import annotations

import base64
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import cv2
import numpy as np
import numpy.typing as npt
import plotly.graph_objects as go

from stereolag.assess.judging import Criterion
from stereolag.assess.sweep import Sweep
from stereolag.core.arrays import Mask
from stereolag.core.typography import typeset
from stereolag.figures.linked_pictures import Colours
from stereolag.figures.pictures import PEAK, VIRIDIS, coloured

THUMBNAIL_WIDTH = 180
GAP = 3
"""Px between the small maps."""

DRAWN_WIDTH = 640
"""Width of the grid of maps on a typical page, px; sets its height."""

SMALLEST_HEIGHT = 260
MARKER = 18


@dataclass(frozen=True, eq=False)
class ContactSheet:
    """The maps of a sweep, reduced and side by side.

    Attributes
    ----------
    maps
        (n_rows * height, n_cols * width) float32 disparities, px; NaN = none.
    height, width
        Size of one small map, px.
    rows, cols
        Values of the two parameters.
    bad
        (n_rows, n_cols) bad-2, %; NaN if there is no map, or no way to judge it.
    shown
        (n_rows, n_cols) bool: whether there is a map.
    criterion
        Whether `bad` is true or estimated.
    finished
        Whether all combinations have been tried.
    """

    maps: npt.NDArray[np.float32]
    height: int
    width: int
    rows: tuple[Any, ...]
    cols: tuple[Any, ...]
    bad: npt.NDArray[np.float64]
    shown: Mask
    criterion: Criterion
    finished: bool

    @property
    def judged(self) -> bool:
        """Return whether any map has a bad-2."""
        return bool(np.isfinite(self.bad).any())

    @classmethod
    def of(cls, grid: Sweep, shape: Sequence[int]) -> ContactSheet:
        """Return the sheet of a sweep over images of (H, W) pixels."""
        width = min(THUMBNAIL_WIDTH, shape[1])
        height = max(1, round(width * shape[0] / shape[1]))
        blank = np.full((height, width), np.nan, dtype=np.float32)
        small = [
            [
                blank if one is None else cv2.resize(one, (width, height), interpolation=cv2.INTER_NEAREST_EXACT)
                for one in line
            ]
            for line in grid.maps
        ]
        shown = np.array([[one is not None for one in line] for line in grid.maps])
        return cls(
            np.block(small), height, width, grid.rows[1], grid.cols[1], grid.bad, shown, grid.criterion, grid.finished
        )


def sweep_maps(
    sheet: ContactSheet, names: tuple[str, str], colours: Colours, current: tuple[int, int] | None
) -> go.Figure:
    """Return the grid of small maps, in the colours of all maps; a click returns the number of the cell.

    Parameters
    ----------
    sheet
        The maps.
    names
        Names of the two parameters, rows first.
    colours
        The colours that all maps share.
    current
        (row, col) of the cell whose settings are in use.
    """
    figure = go.Figure(
        go.Image(
            source=_sheet_png(sheet, colours),
            x0=-0.5 + 0.5 / sheet.width,
            dx=1 / sheet.width,
            y0=-0.5 + 0.5 / sheet.height,
            dy=1 / sheet.height,
            hoverinfo="skip",
        )
    )
    _as_grid(figure, sheet, names, current)
    figure.update_yaxes(scaleanchor="x", scaleratio=sheet.height / sheet.width, constrain="domain")
    figure.update_yaxes(constraintoward="bottom").update_xaxes(constraintoward="left")
    return figure


def sweep_bad(sheet: ContactSheet, names: tuple[str, str], current: tuple[int, int] | None) -> go.Figure:
    """Return bad-2 over the same grid as a heat map, low values bright; a click returns the number of the cell."""
    figure = go.Figure(
        go.Heatmap(
            z=sheet.bad.astype(np.float32),
            colorscale=[[share / 255, "rgb({},{},{})".format(*VIRIDIS[255 - share])] for share in range(0, 256, 15)],
            showscale=False,
            xgap=GAP,
            ygap=GAP,
            texttemplate="%{z:.1f}",
            hoverinfo="skip",
        )
    )
    return _as_grid(figure, sheet, names, current)


def _sheet_png(sheet: ContactSheet, colours: Colours) -> str:
    """Return the maps as the data URL of a PNG, transparent between maps and in cells without one."""
    picture = coloured(sheet.maps, colours.low, colours.high, colours.palette)
    rows, cols = np.ogrid[: picture.shape[0], : picture.shape[1]]
    opaque = (rows % sheet.height < sheet.height - GAP) & (cols % sheet.width < sheet.width - GAP)
    opaque &= sheet.shown[rows // sheet.height, cols // sheet.width]
    shown = np.dstack([picture[:, :, ::-1], np.where(opaque, 255, 0).astype(np.uint8)])
    _, data = cv2.imencode(".png", shown)
    return f"data:image/png;base64,{base64.b64encode(data.tobytes()).decode()}"


def _as_grid(
    figure: go.Figure, sheet: ContactSheet, names: tuple[str, str], current: tuple[int, int] | None
) -> go.Figure:
    """Label the cells, frame the best and the current one, and make every cell clickable."""
    n_rows, n_cols = sheet.bad.shape
    rows, cols = np.indices(sheet.bad.shape)
    figure.add_trace(
        go.Scatter(
            x=cols.ravel(),
            y=rows.ravel(),
            mode="markers",
            marker={"size": MARKER, "color": "rgba(0,0,0,0)", "symbol": "square"},
            text=[
                typeset(f"{names[0]} {row}, {names[1]} {col}<br>" + _of_cell(sheet, down, across))
                for down, row in enumerate(sheet.rows)
                for across, col in enumerate(sheet.cols)
            ],
            hovertemplate="%{text}<extra></extra>",
            showlegend=False,
        )
    )
    if sheet.judged:
        row, col = divmod(int(np.nanargmin(sheet.bad)), n_cols)
        figure.add_shape(_frame((row, col), "solid"))
    if current is not None:
        figure.add_shape(_frame(current, "dot"))
    height = DRAWN_WIDTH / n_cols * n_rows * sheet.height / sheet.width
    figure.update_layout(
        height=max(SMALLEST_HEIGHT, round(height) + 70),
        margin={"l": 8, "r": 8, "t": 8, "b": 8},
        dragmode=False,
        hovermode="closest",
        hoverdistance=-1,
    )
    figure.update_xaxes(
        title=names[1], tickvals=list(range(n_cols)), ticktext=[typeset(f"{value:g}") for value in sheet.cols],
        range=[-0.5, n_cols - 0.5], showgrid=False, zeroline=False, fixedrange=True, constrain="domain",
    )  # fmt: skip
    figure.update_yaxes(
        title=names[0], tickvals=list(range(n_rows)), ticktext=[typeset(f"{value:g}") for value in sheet.rows],
        range=[n_rows - 0.5, -0.5], showgrid=False, zeroline=False, fixedrange=True,
    )  # fmt: skip
    return figure


def _frame(cell: tuple[int, int], dash: str) -> dict[str, Any]:
    row, col = cell
    return {
        "type": "rect",
        "x0": col - 0.49,
        "x1": col + 0.47,
        "y0": row - 0.49,
        "y1": row + 0.47,
        "line": {"color": PEAK, "width": 3, "dash": dash},
    }


def _of_cell(sheet: ContactSheet, row: int, col: int) -> str:
    if not sheet.shown[row, col]:
        return "does not fit" if sheet.finished else "not tried, or does not fit"
    return f"{sheet.criterion} {sheet.bad[row, col]:.1f} %" if sheet.judged else "not judged"
