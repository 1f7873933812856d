"""Disparity maps coloured by error, difference and reason; charts that compare them."""

from __future__ import annotations

from collections.abc import Mapping
from functools import cache
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


MOST_SHOWN_PX = 4.0
"""Larger errors share the last colour."""

NO_TRUTH = (0, 0, 0)
"""Black: all error colours are lighter."""

SPARSE = 0.5
"""Ground truth for a smaller share of the pixels is drawn thicker: a laser scanner gives thin lines of dots."""

METHOD_COLOURS = (CORRELATION, SENSOR_2, SENSOR_1, PEAK)
SYMBOLS = ("diamond", "circle", "square", "cross")


def _ramp(*stops: Colour) -> Rgb:
    """Return (256, 3) colours interpolated between evenly spaced stops."""
    places = np.linspace(0, 255, len(stops))
    bands = [np.interp(np.arange(256), places, band) for band in zip(*stops, strict=True)]
    return np.asarray(np.rint(np.column_stack(bands)), dtype=np.uint8)


ERROR_COLOURS = _ramp((49, 54, 149), (116, 173, 209), (224, 243, 248), (253, 174, 97), (165, 0, 38))
"""Blue is right and red is wrong, as on KITTI's error maps: ColorBrewer's RdYlBu, reversed."""


def error_png(disparity: FloatMap, truth: FloatMap) -> bytes:
    """Return |disparity - ground truth| as a PNG, thinned if wide: red from 4 px, no disparity grey, no truth black."""
    known = np.isfinite(truth)
    picture = coloured(np.abs(disparity - truth), 0, MOST_SHOWN_PX, ERROR_COLOURS)
    picture[~known] = NO_TRUTH
    return png(thinned(_thickened(picture, known) if known.mean() < SPARSE else picture))


def _thickened(picture: Rgb, known: Mask) -> Rgb:
    """Return the image with its known pixels spread over 3 × 3 where there is room, to make them visible."""
    picture, known = np.pad(picture, ((1, 1), (1, 1), (0, 0))), np.pad(known, 1)
    for axis in (0, 1):
        for shift in (1, -1):
            neighbour = np.roll(known, shift, axis) & ~known
            picture[neighbour] = np.roll(picture, shift, axis)[neighbour]
            known = known | neighbour
    return picture[1:-1, 1:-1]


@cache
def error_legend() -> go.Figure:
    """Return the legend of the error colours, made once; it must not be changed."""
    ticks = {0: "0", 1: "1", 2: "2", 3: "3", MOST_SHOWN_PX: "≥ 4"}
    return legend(0, MOST_SHOWN_PX, ERROR_COLOURS, "right ← error, px → wrong", ticks)


def error_over_coverage(curves: Mapping[str, CoverageCurve], threshold: float) -> go.Figure:
    """Return the error rate of each method as its least sure pixels are dropped; a method without scores is a dot."""
    figure = go.Figure()
    for number, (name, curve) in enumerate(curves.items()):
        colour = METHOD_COLOURS[number % len(METHOD_COLOURS)]
        figure.add_trace(
            go.Scatter(
                x=(100 * curve.coverage).astype(np.float32),
                y=curve.bad.astype(np.float32),
                name=name,
                mode="markers" if curve.coverage.size == 1 else "lines",
                line={"color": colour, "width": 2, "dash": DASHES[number % len(DASHES)]},
                marker={"color": colour, "size": 12, "symbol": SYMBOLS[number % len(SYMBOLS)]},
                hovertemplate="%{y:.1f} % wrong at %{x:.0f} %",
            )
        )
    kept = "pixels kept, the surest first, % of the ground truth"
    return laid_out(
        figure,
        340,
        {"title": kept, "range": [0, 101], "dtick": 20, "fixedrange": True},
        {"title": typeset(f"off by more than {threshold:g} px, %"), "rangemode": "tozero", "fixedrange": True},
        legend=LEGEND_ABOVE,
        showlegend=True,
        dragmode=False,
    )


LARGEST_DIFFERENCE = 4.0
"""Px at the ends of the colours: fixed, so that maps shown one after another can be compared."""


BELOW_TO_ABOVE = _ramp((33, 102, 172), (146, 197, 222), (247, 247, 247), (244, 165, 130), (178, 24, 43))
"""From blue through white to red, as in ColorBrewer's RdBu, reversed."""

ALL_AGREE, SOME_AGREE, ALL_DIFFER = (16, 118, 200), (244, 198, 79), (182, 57, 27)
"""Blue and red, as on the error maps: colour-blind eyes confuse green and red."""


def difference_picture(difference: FloatMap) -> Rgb:
    """Return differences, px, as an image: red where positive, blue where negative, grey where a value is missing."""
    return coloured(difference, -LARGEST_DIFFERENCE, LARGEST_DIFFERENCE, BELOW_TO_ABOVE)


def agreement_picture(agreeing: npt.NDArray[np.uint8], methods: int, image: Image) -> Rgb:
    """Return the number of agreeing methods as colours over the image."""
    palette = np.array([NO_ANSWER, ALL_DIFFER, *[SOME_AGREE] * (methods - 2), ALL_AGREE], dtype=np.uint8)
    # Shaded by the brightness of the image, to show where in the scene they are.
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
"""A colour for each reason but MEASURED; distinct from each other and from the image for colour-blind eyes too."""


def reasons_picture(reason: ReasonMap, image: Image) -> Rgb:
    """Return the image, pale and grey where there is a measurement, with every other pixel in its reason's colour."""
    picture = np.stack([96 + brightness(image) // 2] * 3, axis=-1).astype(np.uint8)
    for cause, colour in REASON_COLOURS.items():
        picture[reason == cause] = colour
    return picture


def share_of_reasons(reasons: Mapping[str, ReasonMap], words: Mapping[Reason, str]) -> go.Figure:
    """Return one bar for each map: its share without a measurement, by reason.

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


GAP = 3
"""Px between the small maps."""

DRAWN_WIDTH = 640
"""Width of the grid of maps on a typical page, px; sets its height."""

SMALLEST_HEIGHT = 260
MARKER = 18


def sweep_maps(sheet: Sweep, names: tuple[str, str], colours: Colours, current: tuple[int, int] | None) -> go.Figure:
    """Return the grid of small maps, in the colours of all maps; a click returns the number of the cell.

    Parameters
    ----------
    sheet
        The sweep.
    names
        Names of the two parameters, rows first.
    colours
        The colours that all maps share.
    current
        (row, col) of the cell whose settings are in use.
    """
    height, width = sheet.maps.shape[2:]
    figure = go.Figure(
        go.Image(
            source=_sheet_png(sheet, colours),
            x0=-0.5 + 0.5 / width,
            dx=1 / width,
            y0=-0.5 + 0.5 / height,
            dy=1 / height,
            hoverinfo="skip",
        )
    )
    _as_grid(figure, sheet, names, current)
    figure.update_yaxes(scaleanchor="x", scaleratio=height / width, constrain="domain", constraintoward="bottom")
    return figure.update_xaxes(constraintoward="left")


def sweep_bad(sheet: Sweep, names: tuple[str, str], current: tuple[int, int] | None) -> go.Figure:
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


def _sheet_png(sheet: Sweep, colours: Colours) -> str:
    """Return the maps as the data URL of a PNG, transparent between maps and in cells without one."""
    height, width = sheet.maps.shape[2:]
    picture = coloured(np.block([[*line] for line in sheet.maps]), colours.low, colours.high, colours.palette)
    rows, cols = np.ogrid[: picture.shape[0], : picture.shape[1]]
    opaque = (rows % height < height - GAP) & (cols % width < width - GAP)
    opaque &= sheet.shown[rows // height, cols // width]
    return data_url(png(np.dstack([picture, np.where(opaque, 255, 0).astype(np.uint8)])))


def _as_grid(figure: go.Figure, sheet: Sweep, names: tuple[str, str], current: tuple[int, int] | None) -> go.Figure:
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
    for cell, dash in ((sheet.best, "solid"), (current, "dot")):
        if cell is not None:
            figure.add_shape(_frame(cell, dash))
    height = DRAWN_WIDTH / n_cols * n_rows * sheet.maps.shape[2] / sheet.maps.shape[3]
    axis = {"showgrid": False, "zeroline": False, "fixedrange": True}

    def values(title: str, of: tuple[Any, ...], ends: tuple[float, float]) -> dict[str, Any]:
        ticks = [typeset(f"{value:g}") for value in of]
        return {"title": title, "tickvals": [*range(len(of))], "ticktext": ticks, "range": ends, **axis}

    return laid_out(
        figure,
        max(SMALLEST_HEIGHT, round(height) + 70),
        values(names[1], sheet.cols, (-0.5, n_cols - 0.5)) | {"constrain": "domain"},
        values(names[0], sheet.rows, (n_rows - 0.5, -0.5)),
        dragmode=False,
        hovermode="closest",
        hoverdistance=-1,
    )


def _frame(cell: tuple[int, int], dash: str) -> dict[str, Any]:
    row, col = cell
    edges = {"x0": col - 0.49, "x1": col + 0.47, "y0": row - 0.49, "y1": row + 0.47}
    return {"type": "rect", **edges, "line": {"color": PEAK, "width": 3, "dash": dash}}


def _of_cell(sheet: Sweep, row: int, col: int) -> str:
    if not sheet.shown[row, col]:
        return "does not fit" if sheet.finished else "not tried, or does not fit"
    return f"{sheet.criterion} {sheet.bad[row, col]:.1f} %" if sheet.best else "not judged"
