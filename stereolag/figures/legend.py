"""The strip of colours that says what the colours of a map stand for."""

from __future__ import annotations

import numpy as np
import plotly.graph_objects as go

from stereolag.figures.colours import Rgb


def legend(low: float, high: float, palette: Rgb, title: str) -> go.Figure:
    """Return the colours of a (256, 3) palette, from `low` to `high`, over an axis with a title."""
    shares = np.linspace(0, 1, len(palette))
    colours = [[share, "rgb({},{},{})".format(*colour)] for share, colour in zip(shares, palette, strict=True)]
    figure = go.Figure(
        go.Heatmap(
            z=np.arange(256, dtype=np.uint8)[None, :],
            x=np.linspace(low, high, 256, dtype=np.float32),
            colorscale=colours[::15],
            showscale=False,
            hovertemplate="%{x:.3g}<extra></extra>",
        )
    )
    figure.update_layout(height=84, margin={"l": 12, "r": 12, "t": 4, "b": 52}, dragmode=False)
    figure.update_xaxes(title={"text": title, "standoff": 14}, fixedrange=True, showgrid=False, ticks="outside")
    figure.update_yaxes(visible=False, fixedrange=True)
    return figure
