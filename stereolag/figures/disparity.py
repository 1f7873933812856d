"""Disparity maps as colour images, and their legend."""

from __future__ import annotations

from collections.abc import Mapping
from functools import lru_cache

import cv2
import numpy as np
import numpy.typing as npt
import plotly.graph_objects as go

from stereolag.core.arrays import Rgb
from stereolag.core.inputs import Image
from stereolag.figures.pictures import (
    VIRIDIS,
    as_rgb,
    coloured,
    palette,
    png,
)

FAR_TO_NEAR = VIRIDIS
"""Near is bright."""

PALETTES: dict[str, Rgb] = {
    "viridis": FAR_TO_NEAR,
    "plasma": palette(cv2.COLORMAP_PLASMA),
    "turbo": palette(cv2.COLORMAP_TURBO),
}
"""Palettes to choose from, far to near; none contains the grey of no disparity."""


def image_into_map(image: Image, disparity: npt.NDArray[np.float32], low: float, high: float) -> bytes:
    """Return the image with its right three fifths replaced by the disparity map, as a PNG."""
    picture = as_rgb(image).copy()
    seam = picture.shape[1] * 2 // 5
    picture[:, seam:] = coloured(disparity, low, high, FAR_TO_NEAR)[:, seam:]
    return png(picture)


def legend(low: float, high: float, palette: Rgb, title: str, ticks: Mapping[float, str] | None = None) -> go.Figure:
    """Return the colours of a (256, 3) palette, from `low` to `high`, over an axis with a title.

    `ticks` maps values to labels; without it the axis chooses its own. The same arguments return the same figure, which
    must not be changed: making one takes Plotly longer than a small map takes OpenCV.
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
