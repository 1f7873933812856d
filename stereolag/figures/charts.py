"""The common look of all charts: narrow margins, a legend above, and rings around points."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    import plotly.graph_objects as go

LEGEND_ABOVE = {"orientation": "h", "x": 0, "y": 1.02, "yanchor": "bottom"}

DASHES = ("solid", "dash", "dot", "dashdot")

Axis = str | Mapping[str, Any]
"""The title of an axis, or several of Plotly's properties of it."""


def laid_out(figure: go.Figure, height: int, x: Axis, y: Axis, *, margin: int = 8, **layout: Any) -> go.Figure:
    """Return the figure `height` px high with its axes described; `layout` holds Plotly's other properties."""
    figure.update_layout(height=height, margin=dict.fromkeys("lrtb", margin), **layout)
    figure.update_xaxes({"title": x} if isinstance(x, str) else x)
    return figure.update_yaxes({"title": y} if isinstance(y, str) else y)


def rings(x: Any, y: Any, colour: str, size: int, thickness: float, **more: Any) -> go.Scatter:
    """Return points marked by rings; with `text`, each is labelled in its colour."""
    import plotly.graph_objects as go  # a command draws no charts

    if "text" in more:
        more = {"mode": "markers+text", "textfont": {"color": colour}, "cliponaxis": False} | more
    marker = {"color": colour, "size": size, "symbol": "circle-open", "line": {"width": thickness}}
    return go.Scatter(**{"x": x, "y": y, "mode": "markers", "marker": marker} | more)
