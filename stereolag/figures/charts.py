"""The layout shared by all charts, points marked by rings, and colour legends."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
import plotly.graph_objects as go

from stereolag.core.arrays import Rgb

LEGEND_ABOVE = {"orientation": "h", "x": 0, "y": 1.02, "yanchor": "bottom"}

DASHES = ("solid", "dash", "dot", "dashdot")

Axis = str | Mapping[str, Any]
"""The title of an axis, or a mapping of its Plotly properties."""


def laid_out(figure: go.Figure, height: int, x: Axis, y: Axis, *, margin: int = 8, **layout: Any) -> go.Figure:
    """Return the figure, `height` px high, with its axes set; `layout` holds other properties of Plotly's layout."""
    figure.update_layout(height=height, margin=dict.fromkeys("lrtb", margin), **layout)
    # Commas in every number from 1,000, as in all text; Plotly begins at 10,000.
    figure.update_xaxes({"title": x} if isinstance(x, str) else x, separatethousands=True)
    return figure.update_yaxes({"title": y} if isinstance(y, str) else y, separatethousands=True)


def rings(x: Any, y: Any, colour: str, size: int, thickness: float, **more: Any) -> go.Scatter:
    """Return points marked by rings and, with `text`, labelled in the same colour."""
    if "text" in more:
        more = {"mode": "markers+text", "textfont": {"color": colour}, "cliponaxis": False} | more
    marker = {"color": colour, "size": size, "symbol": "circle-open", "line": {"width": thickness}}
    return go.Scatter(**{"x": x, "y": y, "mode": "markers", "marker": marker} | more)


def legend(low: float, high: float, palette: Rgb, title: str, ticks: Mapping[float, str] | None = None) -> go.Figure:
    """Return the colours of a (256, 3) palette, from `low` to `high`, above an axis with a title.

    `ticks` maps values to labels; without it Plotly chooses them.
    """
    shares = np.linspace(0, 1, len(palette))
    scale = [[share, "rgb({},{},{})".format(*colour)] for share, colour in zip(shares, palette, strict=True)]
    figure = go.Figure(
        go.Heatmap(
            z=np.arange(256, dtype=np.uint8)[None, :],
            x=np.linspace(low, high, 256, dtype=np.float32),
            colorscale=scale[::15],
            showscale=False,
            hovertemplate="%{x:.3g}<extra></extra>",
        )
    )
    figure.update_layout(height=84, margin={"l": 12, "r": 12, "t": 4, "b": 52}, dragmode=False)
    figure.update_xaxes(title={"text": title, "standoff": 14}, fixedrange=True, showgrid=False, ticks="outside")
    if ticks:
        figure.update_xaxes(tickvals=[*ticks], ticktext=[*ticks.values()])
    return figure.update_yaxes(visible=False, fixedrange=True)
