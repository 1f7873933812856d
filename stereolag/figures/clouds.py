"""Point clouds in three dimensions and from above."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt
import plotly.graph_objects as go
from PIL import Image as PillowImage

from stereolag.core.arrays import Vector
from stereolag.figures.charts import laid_out
from stereolag.figures.pictures import PEAK, data_url, png
from stereolag.geometry.scene import BirdsEyeView

Points = npt.NDArray[np.float32]
Colours = npt.NDArray[np.uint8]

HEIGHT_PX = 620
PALETTE_SIZE = 256
MIN_POINT_PX, MAX_POINT_PX = 1.6, 3.2
POINTS_AT_MIN_SIZE = 60_000
"""Number of points from which they are drawn at the smallest size."""


def point_cloud(points: Points, colours: Colours, unit: str, *, turned: float = 0.0, raised: float = 0.0) -> go.Figure:
    """Return a point cloud that can be turned by hand, first seen from the left camera.

    Parameters
    ----------
    points
        (n, 3): X to the right, Y down, Z forward; drawn in the same orientation.
    colours
        (n, 3) RGB. Sent to the browser as indices into a palette of 256 colours made for this cloud, since it takes
        seconds to read 100,000 points with a colour string each.
    unit
        Unit of the coordinates.
    turned, raised
        Rotation of the first view about the point straight ahead at the median distance, degrees: to the right of the
        left camera, and above it.
    """
    palette, index = _palette(colours)
    drawn = np.column_stack([points[:, 0], points[:, 2], -points[:, 1]])
    size = float(np.clip(MIN_POINT_PX * np.sqrt(POINTS_AT_MIN_SIZE / len(points)), MIN_POINT_PX, MAX_POINT_PX))
    figure = go.Figure(
        go.Scatter3d(
            x=drawn[:, 0],
            y=drawn[:, 1],
            z=drawn[:, 2],
            mode="markers",
            marker={
                "size": size,
                "symbol": "square",
                "color": index,
                "colorscale": palette,
                "cmin": 0,
                "cmax": PALETTE_SIZE - 1,
                "line": {"width": 0},
            },
            hovertemplate=f"%{{y:.3g}} {unit} away<extra></extra>",
        )
    )
    low, high = np.minimum(drawn.min(axis=0), 0, dtype=np.float64), np.maximum(drawn.max(axis=0), 0, dtype=np.float64)
    scene = {
        "xaxis": _axis(f"X, {unit}", low[0], high[0]),
        "yaxis": _axis(f"distance, {unit}", low[1], high[1]),
        "zaxis": _axis(f"height, {unit}", low[2], high[2]),
        "camera": _camera(low, high, float(np.median(points[:, 2])), np.radians(turned), np.radians(raised)),
        # The longest side is 2, and the scale the same in every direction.
        "aspectmode": "manual",
        "aspectratio": dict(zip("xyz", (2 * (high - low) / (high - low).max()).tolist(), strict=True)),
    }
    return laid_out(figure, HEIGHT_PX, {}, {}, margin=0, scene=scene)


def birds_eye(view: BirdsEyeView, unit: str) -> go.Figure:
    """Return a cloud seen from above, with the camera at the bottom and the same scale on both axes."""
    rows, cols = view.picture.shape[:2]
    cloud = go.Image(
        source=data_url(png(view.picture)),
        x0=view.left + view.cell / 2,
        dx=view.cell,
        y0=view.near + view.cell / 2,
        dy=view.cell,
        hovertemplate=f"%{{x:.3g}} {unit} to the right, %{{y:.3g}} {unit} away<extra></extra>",
    )
    camera = go.Scatter(
        x=[0],
        y=[0],
        mode="markers+text",
        marker={"symbol": "triangle-up", "size": 14, "color": PEAK},
        text=["  camera"],
        textposition="middle right",
        hoverinfo="skip",
        cliponaxis=False,
    )
    far, right = view.near + rows * view.cell, view.left + cols * view.cell
    axis = {"zeroline": False, "constrain": "domain"}
    x = {"title": f"X, {unit}", "range": [min(view.left, 0), max(right, 0)], **axis}
    y = {"title": f"distance, {unit}", "range": [0, far], "scaleanchor": "x", "rangemode": "tozero", **axis}
    return laid_out(go.Figure([cloud, camera]), HEIGHT_PX, x, y, showlegend=False, dragmode="pan")


def _palette(colours: Colours) -> tuple[list[list[Any]], npt.NDArray[np.uint8]]:
    """Return a colour scale of 256 colours fitted to these, and the index of each point's colour in it."""
    picture = PillowImage.fromarray(np.ascontiguousarray(colours[None])).quantize(
        PALETTE_SIZE, method=PillowImage.Quantize.MEDIANCUT, dither=PillowImage.Dither.NONE
    )
    found = np.array(picture.getpalette(), dtype=np.uint8).reshape(-1, 3)
    palette = np.pad(found, ((0, PALETTE_SIZE - len(found)), (0, 0)))
    scale = [[number / (PALETTE_SIZE - 1), "rgb({},{},{})".format(*colour)] for number, colour in enumerate(palette)]
    return scale, np.asarray(picture, dtype=np.uint8)[0]


def _axis(title: str, low: float, high: float) -> dict[str, Any]:
    return {
        "title": title,
        "range": [low, high],
        "showbackground": False,
        "showspikes": False,
        "gridcolor": "rgba(128,128,128,0.25)",
        "zeroline": False,
    }


def _camera(low: Vector, high: Vector, distance: float, turned: float, raised: float) -> dict[str, Any]:
    """Return a camera that looks from the origin at the point straight ahead at `distance`, turned about that point.

    Plotly's coordinates of a camera are relative to the middle of the box, whose longest side is 2.
    """
    unit, middle = 2 / (high - low).max(), (low + high) / 2
    target = np.array([0, distance, 0])
    direction = np.array([np.sin(turned) * np.cos(raised), -np.cos(turned) * np.cos(raised), np.sin(raised)])
    return {
        "eye": dict(zip("xyz", ((target + distance * direction - middle) * unit).tolist(), strict=True)),
        "center": dict(zip("xyz", ((target - middle) * unit).tolist(), strict=True)),
        "up": {"x": 0, "y": 0, "z": 1},
    }
