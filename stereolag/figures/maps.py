"""Disparity maps coloured by error, difference and reason, and charts that compare them."""

from __future__ import annotations

from collections.abc import Mapping
from functools import cache
from itertools import cycle
from typing import Any

import numpy as np
import numpy.typing as npt
import plotly.graph_objects as go

from stereolag.assess.judging import Sweep
from stereolag.core.arrays import FloatMap, Mask, ReasonMap, Rgb
from stereolag.core.inputs import Image
from stereolag.core.typography import typeset
from stereolag.figures.charts import DASHES, LEGEND_ABOVE, laid_out, legend
from stereolag.figures.legends import FAR_TO_NEAR, Colours, hexadecimal
from stereolag.figures.pictures import (
    CORRELATION,
    NO_ANSWER,
    PEAK,
    SENSOR_1,
    SENSOR_2,
    VIRIDIS,
    Colour,
    as_rgb,
    brightness,
    coloured,
    data_url,
    png,
    thinned,
)
from stereolag.stereo.evaluation import CoverageCurve
from stereolag.stereo.matcher import Reason


def image_into_map(image: Image, disparity: FloatMap, low: float, high: float) -> bytes:
    """Return the image with its right three fifths replaced by the disparity map, as a PNG."""
    picture = as_rgb(image).copy()
    seam = picture.shape[1] * 2 // 5
    picture[:, seam:] = coloured(disparity, low, high, FAR_TO_NEAR)[:, seam:]
    return png(picture)


MAX_ERROR_PX = 4.0
"""Error at the last colour, which larger errors share, px."""

NO_TRUTH = (0, 0, 0)
"""Black: all error colours are lighter."""

SPARSE_SHARE = 0.5
"""Ground truth of a smaller share of the pixels is drawn thicker: a laser scanner's is thin lines of dots."""

METHOD_COLOURS = (CORRELATION, SENSOR_2, SENSOR_1, PEAK)
SYMBOLS = ("diamond", "circle", "square", "cross")


def _ramp(*stops: Colour) -> Rgb:
    """Return (256, 3) colours interpolated between evenly spaced stops."""
    places = np.linspace(0, 255, len(stops))
    bands = [np.interp(np.arange(256), places, band) for band in zip(*stops, strict=True)]
    return np.asarray(np.rint(np.column_stack(bands)), dtype=np.uint8)


ERROR_COLOURS = _ramp((49, 54, 149), (116, 173, 209), (224, 243, 248), (253, 174, 97), (165, 0, 38))
"""From blue, right, to red, wrong, as on KITTI's error maps: ColorBrewer's RdYlBu, reversed."""


def error_png(disparity: FloatMap, truth: FloatMap) -> bytes:
    """Return |disparity - ground truth| as a PNG: red from 4 px on, grey without a disparity, black without a truth.

    It is thinned if it is wide.
    """
    known = np.isfinite(truth)
    picture = coloured(np.abs(disparity - truth), 0, MAX_ERROR_PX, ERROR_COLOURS)
    picture[~known] = NO_TRUTH
    return png(thinned(_thickened(picture, known) if known.mean() < SPARSE_SHARE else picture))


def _thickened(picture: Rgb, known: Mask) -> Rgb:
    """Return the picture with its known pixels spread over unknown ones in 3 × 3 px, to make them visible."""
    picture, known = np.pad(picture, ((1, 1), (1, 1), (0, 0))), np.pad(known, 1)
    for axis in (0, 1):
        for shift in (1, -1):
            neighbour = np.roll(known, shift, axis) & ~known
            picture[neighbour] = np.roll(picture, shift, axis)[neighbour]
            known = known | neighbour
    return picture[1:-1, 1:-1]


@cache
def error_legend() -> go.Figure:
    """Return the legend of the error colours; it is shared and must not be changed."""
    ticks = {0: "0", 1: "1", 2: "2", 3: "3", MAX_ERROR_PX: "≥ 4"}
    return legend(0, MAX_ERROR_PX, ERROR_COLOURS, "right ← error, px → wrong", ticks)


def error_over_coverage(curves: Mapping[str, CoverageCurve], threshold: float) -> go.Figure:
    """Return the error rate of each method over its coverage, as the pixels with the lowest scores are dropped.

    A method without scores is a single point.
    """
    looks = zip(cycle(METHOD_COLOURS), cycle(DASHES), cycle(SYMBOLS), strict=False)
    lines = [
        go.Scatter(
            x=(100 * curve.coverage).astype(np.float32),
            y=curve.bad.astype(np.float32),
            name=name,
            mode="markers" if curve.coverage.size == 1 else "lines",
            line={"color": colour, "width": 2, "dash": dash},
            marker={"color": colour, "size": 12, "symbol": symbol},
            hovertemplate="%{y:.1f} % wrong at %{x:.0f} %",
        )
        for (name, curve), (colour, dash, symbol) in zip(curves.items(), looks, strict=False)
    ]
    kept = "pixels kept, the surest first, % of the ground truth"
    return laid_out(
        go.Figure(lines),
        340,
        {"title": kept, "range": [0, 101], "dtick": 20, "fixedrange": True},
        {"title": typeset(f"off by more than {threshold:g} px, %"), "rangemode": "tozero", "fixedrange": True},
        legend=LEGEND_ABOVE,
        showlegend=True,
        dragmode=False,
    )


MAX_DIFFERENCE_PX = 4.0
"""Difference at the ends of the colours, px: fixed, so that maps shown one after another can be compared."""

BELOW_TO_ABOVE = _ramp((33, 102, 172), (146, 197, 222), (247, 247, 247), (244, 165, 130), (178, 24, 43))
"""From blue through white to red, as in ColorBrewer's RdBu, reversed."""

ALL_AGREE, SOME_AGREE, ALL_DIFFER = (16, 118, 200), (244, 198, 79), (182, 57, 27)
"""Blue and red, as on the error maps, since green and red look alike to colour-blind people."""


def difference_picture(difference: FloatMap) -> Rgb:
    """Return differences, px, as an image: red where positive, blue where negative, grey where a value is missing."""
    return coloured(difference, -MAX_DIFFERENCE_PX, MAX_DIFFERENCE_PX, BELOW_TO_ABOVE)


def agreement_picture(agreeing: npt.NDArray[np.uint8], methods: int, image: Image) -> Rgb:
    """Return the number of agreeing methods as colours over the image."""
    palette = np.array([NO_ANSWER, ALL_DIFFER, *[SOME_AGREE] * (methods - 2), ALL_AGREE], dtype=np.uint8)
    # Shaded by the brightness of the image, so that the scene can be recognised.
    shade = (0.65 + 0.35 * brightness(image).astype(np.float32) / 255)[:, :, None]
    return np.rint(palette[agreeing] * shade).astype(np.uint8)


REASON_COLOURS: dict[Reason, Colour] = {
    Reason.FILLED: (210, 172, 237),
    Reason.OUT_OF_FRAME: (89, 108, 136),
    Reason.LOW_TEXTURE: (41, 138, 202),
    Reason.AMBIGUOUS: (230, 170, 45),
    Reason.LEFT_RIGHT: (211, 70, 73),
    Reason.SPECKLE: (66, 192, 131),
    Reason.AT_SEARCH_EDGE: (145, 77, 13),
}
"""The colour of each reason but MEASURED; also for colour-blind people they differ from each other and the image."""


def reasons_picture(reason: ReasonMap, image: Image) -> Rgb:
    """Return the image in pale grey, with every pixel without a measurement in the colour of its reason."""
    picture = np.stack([96 + brightness(image) // 2] * 3, axis=-1).astype(np.uint8)
    for cause, colour in REASON_COLOURS.items():
        picture[reason == cause] = colour
    return picture


def share_of_reasons(reasons: Mapping[str, ReasonMap], words: Mapping[Reason, str]) -> go.Figure:
    """Return a bar for each map with its shares of pixels without a measurement, by reason.

    Parameters
    ----------
    reasons
        {name of the method: its reason map}.
    words
        Name of each reason on the page.
    """
    figure = go.Figure()
    names = list(reasons)
    for cause, colour in REASON_COLOURS.items():
        percent = [100 * float(np.mean(one == cause)) for one in reasons.values()]
        if any(percent):
            figure.add_bar(
                y=names,
                x=percent,
                orientation="h",
                name=words[cause],
                marker={"color": hexadecimal(colour)},
                text=[typeset(f"{share:.1f} %") if share >= 1 else "" for share in percent],
                textposition="inside",
                insidetextanchor="middle",
                textangle=0,
                hovertemplate="%{y}: %{x:.2f} %<extra>" + words[cause] + "</extra>",
            )
    return laid_out(
        figure,
        84 + 44 * len(names),
        {"title": "% of the pixels", "range": [0, 100], "fixedrange": True},
        {"autorange": "reversed", "fixedrange": True},
        barmode="stack",
        uniformtext={"minsize": 11, "mode": "hide"},
        bargap=0.35,
        legend=LEGEND_ABOVE | {"traceorder": "normal"},
    )


GAP_PX = 3
"""Gap between the small maps, px."""

GRID_WIDTH_PX = 640
"""Width of the grid of maps on a typical page, px; determines its height."""

MIN_HEIGHT_PX = 260
"""Least height of the grid of maps, px."""

MARKER_PX = 18
"""Size of the invisible marker that makes a cell clickable, px."""


def sweep_maps(sweep: Sweep, names: tuple[str, str], colours: Colours, current: tuple[int, int] | None) -> go.Figure:
    """Return the grid of small maps, in the colours of all maps; a click returns the number of the cell.

    Parameters
    ----------
    sweep
        The sweep.
    names
        Names of the two parameters, rows first.
    colours
        The colours that all maps share.
    current
        (row, col) of the cell whose settings are in use.
    """
    height, width = sweep.maps.shape[2:]
    figure = go.Figure(
        go.Image(
            source=_maps_url(sweep, colours),
            x0=-0.5 + 0.5 / width,
            dx=1 / width,
            y0=-0.5 + 0.5 / height,
            dy=1 / height,
            hoverinfo="skip",
        )
    )
    _as_grid(figure, sweep, names, current)
    figure.update_yaxes(scaleanchor="x", scaleratio=height / width, constrain="domain", constraintoward="bottom")
    return figure.update_xaxes(constraintoward="left")


def sweep_bad(sweep: Sweep, names: tuple[str, str], current: tuple[int, int] | None) -> go.Figure:
    """Return bad-2 on the same grid as a heat map, low values bright; a click returns the number of the cell."""
    figure = go.Figure(
        go.Heatmap(
            z=sweep.bad.astype(np.float32),
            colorscale=[[share / 255, "rgb({},{},{})".format(*VIRIDIS[255 - share])] for share in range(0, 256, 15)],
            showscale=False,
            xgap=GAP_PX,
            ygap=GAP_PX,
            texttemplate="%{z:.1f}",
            hoverinfo="skip",
        )
    )
    return _as_grid(figure, sweep, names, current)


def _maps_url(sweep: Sweep, colours: Colours) -> str:
    """Return the maps as the data URL of a PNG, transparent between maps and in cells without one."""
    height, width = sweep.maps.shape[2:]
    picture = coloured(np.block([[*line] for line in sweep.maps]), colours.low, colours.high, colours.palette)
    rows, cols = np.ogrid[: picture.shape[0], : picture.shape[1]]
    opaque = (rows % height < height - GAP_PX) & (cols % width < width - GAP_PX)
    opaque &= sweep.shown[rows // height, cols // width]
    return data_url(png(np.dstack([picture, np.where(opaque, 255, 0).astype(np.uint8)])))


def _as_grid(figure: go.Figure, sweep: Sweep, names: tuple[str, str], current: tuple[int, int] | None) -> go.Figure:
    """Label the cells, frame the best and the current one, and make every cell clickable."""
    n_rows, n_cols = sweep.bad.shape
    rows, cols = np.indices(sweep.bad.shape)
    figure.add_trace(
        go.Scatter(
            x=cols.ravel(),
            y=rows.ravel(),
            mode="markers",
            marker={"size": MARKER_PX, "color": "rgba(0,0,0,0)", "symbol": "square"},
            text=[
                typeset(f"{names[0]} {row}, {names[1]} {col}<br>" + _cell_text(sweep, down, across))
                for down, row in enumerate(sweep.rows)
                for across, col in enumerate(sweep.cols)
            ],
            hovertemplate="%{text}<extra></extra>",
            showlegend=False,
        )
    )
    for cell, dash in ((sweep.best, "solid"), (current, "dot")):
        if cell is not None:
            row, col = cell
            edges = {"x0": col - 0.49, "x1": col + 0.47, "y0": row - 0.49, "y1": row + 0.47}
            figure.add_shape(type="rect", **edges, line={"color": PEAK, "width": 3, "dash": dash})
    height = GRID_WIDTH_PX / n_cols * n_rows * sweep.maps.shape[2] / sweep.maps.shape[3]
    axis = {"showgrid": False, "zeroline": False, "fixedrange": True}

    def value_axis(title: str, values: tuple[Any, ...], ends: tuple[float, float]) -> dict[str, Any]:
        labels = [typeset(f"{value:g}") for value in values]
        return {"title": title, "tickvals": [*range(len(values))], "ticktext": labels, "range": ends, **axis}

    return laid_out(
        figure,
        max(MIN_HEIGHT_PX, round(height) + 70),
        value_axis(names[1], sweep.cols, (-0.5, n_cols - 0.5)) | {"constrain": "domain"},
        value_axis(names[0], sweep.rows, (n_rows - 0.5, -0.5)),
        dragmode=False,
        hovermode="closest",
        hoverdistance=-1,
    )


def _cell_text(sweep: Sweep, row: int, col: int) -> str:
    if not sweep.shown[row, col]:
        return "does not fit" if sweep.finished else "not tried, or does not fit"
    return f"{sweep.criterion} {sweep.bad[row, col]:.1f} %" if sweep.best else "not judged"
