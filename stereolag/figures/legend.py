"""The strip of colours that says what the colours of a map stand for: as a figure, or as lighter HTML."""

from __future__ import annotations

import math
from collections.abc import Mapping
from functools import lru_cache

import numpy as np
import plotly.graph_objects as go

from stereolag.figures.colours import Rgb


def legend(low: float, high: float, palette: Rgb, title: str, ticks: Mapping[float, str] | None = None) -> go.Figure:
    """Return the colours of a (256, 3) palette, from `low` to `high`, over an axis with a title.

    `ticks` are {value: what is written there}; without them the axis chooses its own. The same arguments give the same
    figure, which must not be changed: to make one takes Plotly longer than a small map takes OpenCV.
    """
    return _legend(low, high, palette.tobytes(), title, tuple((ticks or {}).items()))


@lru_cache(maxsize=32)
def _legend(low: float, high: float, colours: bytes, title: str, ticks: tuple[tuple[float, str], ...]) -> go.Figure:
    palette = np.frombuffer(colours, dtype=np.uint8).reshape(-1, 3)
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
        figure.update_xaxes(tickvals=[value for value, _ in ticks], ticktext=[text for _, text in ticks])
    figure.update_yaxes(visible=False, fixedrange=True)
    return figure


def strip(low: float, high: float, palette: Rgb, title: str, note: str) -> str:
    """Return the colours of a (256, 3) palette, from `low` to `high`, over round values, a title and a note, as HTML.

    It takes the text's colour and size from where it stands, and none of the time that Plotly takes.
    """
    colours = ", ".join("rgb({},{},{})".format(*colour) for colour in palette[::15])
    marks = "".join(
        f'<span style="position: absolute; left: {100 * (value - low) / (high - low):.2f}%; '
        f'transform: translateX(-50%)">{value:g}</span>'.replace(">-", ">−")
        for value in round_values(low, high)
    )
    return (
        f'<div role="img" aria-label="Legend: {title}, {low:g} to {high:g}" style="padding: 0 0.75rem; '
        f'font-size: 0.8rem; opacity: 0.85">'
        f'<div style="height: 1.5rem; border-radius: 3px; background: linear-gradient(to right, {colours})"></div>'
        f'<div style="position: relative; height: 1.4rem">{marks}</div>'
        f'<div style="text-align: center; margin-bottom: 0.75rem">{title}</div><div>{note}</div></div>'
    )


def round_values(low: float, high: float, most_steps: int = 8) -> list[float]:
    """Return the multiples of 1, 2 or 5 times a power of ten from low to high, in `most_steps` steps at the most."""
    power = 10 ** math.floor(math.log10((high - low) / most_steps))
    step = next(factor * power for factor in (1, 2, 5, 10) if (high - low) / (factor * power) <= most_steps)
    first, last = math.ceil(low / step - 1e-9), math.floor(high / step + 1e-9)
    return [float(f"{number * step:.12g}") for number in range(first, last + 1)]
