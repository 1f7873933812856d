"""Errors and differences of disparity maps: error maps, error over coverage, and agreement between methods."""

from __future__ import annotations

from collections.abc import Mapping

import cv2
import numpy as np
import numpy.typing as npt
import plotly.graph_objects as go

from stereolag.core.arrays import Rgb
from stereolag.core.inputs import Image
from stereolag.core.typography import typeset
from stereolag.figures.disparity import legend
from stereolag.figures.pictures import CORRELATION, NO_ANSWER, PEAK, SENSOR_1, SENSOR_2, as_rgb, coloured, png, thinned
from stereolag.stereo.evaluation import CoverageCurve

MOST_SHOWN_PX = 4.0
"""Larger errors share the last colour."""

NO_TRUTH = (0, 0, 0)
"""Black: all error colours are lighter."""

SPARSE = 0.5
"""Ground truth for a smaller share of the pixels is drawn thicker: a laser scanner gives thin lines of dots."""

METHOD_COLOURS = (CORRELATION, SENSOR_2, SENSOR_1, PEAK)
DASHES = ("solid", "dash", "dot", "dashdot")
SYMBOLS = ("diamond", "circle", "square", "cross")


def _ramp(*stops: tuple[int, int, int]) -> Rgb:
    """Return (256, 3) colours interpolated between evenly spaced stops."""
    places = np.linspace(0, 255, len(stops))
    bands = [np.interp(np.arange(256), places, band) for band in zip(*stops, strict=True)]
    return np.asarray(np.rint(np.column_stack(bands)), dtype=np.uint8)


ERROR_COLOURS = _ramp((49, 54, 149), (116, 173, 209), (224, 243, 248), (253, 174, 97), (165, 0, 38))
"""Blue is right and red is wrong, as on KITTI's error maps: ColorBrewer's RdYlBu, reversed."""


def error_png(disparity: npt.NDArray[np.float32], truth: npt.NDArray[np.float32]) -> bytes:
    """Return |disparity - ground truth| as a PNG, thinned if wide: red from 4 px, no disparity grey, no truth black."""
    known = np.isfinite(truth)
    picture = coloured(np.abs(disparity - truth), 0, MOST_SHOWN_PX, ERROR_COLOURS)
    picture[~known] = NO_TRUTH
    return png(thinned(_thickened(picture, known) if known.mean() < SPARSE else picture))


def _thickened(picture: Rgb, known: npt.NDArray[np.bool_]) -> Rgb:
    """Return the image with its known pixels spread over 3 × 3 where there is room, to make them visible."""
    picture, known = np.pad(picture, ((1, 1), (1, 1), (0, 0))), np.pad(known, 1)
    for axis in (0, 1):
        for shift in (1, -1):
            neighbour = np.roll(known, shift, axis) & ~known
            picture[neighbour] = np.roll(picture, shift, axis)[neighbour]
            known = known | neighbour
    return picture[1:-1, 1:-1]


def error_legend() -> go.Figure:
    """Return the legend of the error colours."""
    ticks = {0: "0", 1: "1", 2: "2", 3: "3", MOST_SHOWN_PX: "≥ 4"}
    return legend(0, MOST_SHOWN_PX, ERROR_COLOURS, "right ← error, px → wrong", ticks)


def error_over_coverage(curves: Mapping[str, CoverageCurve], threshold: float) -> go.Figure:
    """Return the error rate of each method as its least sure pixels are dropped; a method without scores is a dot."""
    figure = go.Figure()
    for number, (name, curve) in enumerate(curves.items()):
        colour = METHOD_COLOURS[number % len(METHOD_COLOURS)]
        alone = curve.coverage.size == 1
        figure.add_trace(
            go.Scatter(
                x=(100 * curve.coverage).astype(np.float32),
                y=curve.bad.astype(np.float32),
                name=name,
                mode="markers" if alone else "lines",
                line={"color": colour, "width": 2, "dash": DASHES[number % len(DASHES)]},
                marker={"color": colour, "size": 12, "symbol": SYMBOLS[number % len(SYMBOLS)]},
                hovertemplate="%{y:.1f} % wrong at %{x:.0f} %",
            )
        )
    figure.update_layout(
        height=340,
        margin={"l": 8, "r": 8, "t": 8, "b": 8},
        legend={"orientation": "h", "x": 0, "y": 1.02, "yanchor": "bottom"},
        showlegend=True,
        dragmode=False,
    )
    figure.update_xaxes(
        title="pixels kept, the surest first, % of the ground truth", range=[0, 101], dtick=20, fixedrange=True
    )
    figure.update_yaxes(title=typeset(f"off by more than {threshold:g} px, %"), rangemode="tozero", fixedrange=True)
    return figure


LARGEST_DIFFERENCE = 4.0
"""Px at the ends of the colours: fixed, so that maps shown one after another can be compared."""


def _diverging() -> Rgb:
    """Return (256, 3) colours from blue through white to red, as in ColorBrewer's RdBu, reversed."""
    ends = np.array([(33, 102, 172), (146, 197, 222), (247, 247, 247), (244, 165, 130), (178, 24, 43)])
    at = np.linspace(0, 4, 256)
    return np.stack([np.rint(np.interp(at, np.arange(5), part)) for part in ends.T], axis=1).astype(np.uint8)


BELOW_TO_ABOVE = _diverging()

ALL_AGREE, SOME_AGREE, ALL_DIFFER = (16, 118, 200), (244, 198, 79), (182, 57, 27)
"""Blue and red, as on the error maps: colour-blind eyes confuse green and red."""


def difference_picture(difference: npt.NDArray[np.float32]) -> Rgb:
    """Return differences, px, as an image: red where positive, blue where negative, grey where a value is missing."""
    return coloured(difference, -LARGEST_DIFFERENCE, LARGEST_DIFFERENCE, BELOW_TO_ABOVE)


def agreement_picture(agreeing: npt.NDArray[np.uint8], methods: int, image: Image) -> Rgb:
    """Return the number of agreeing methods as colours over the image."""
    palette = np.array([NO_ANSWER, ALL_DIFFER, *[SOME_AGREE] * (methods - 2), ALL_AGREE], dtype=np.uint8)
    return tinted(palette[agreeing], image)


def tinted(colours: Rgb, image: Image) -> Rgb:
    """Return colours shaded by the brightness of an image, to show where in the scene they are."""
    grey = cv2.cvtColor(np.ascontiguousarray(as_rgb(image)), cv2.COLOR_RGB2GRAY)
    shade = (0.65 + 0.35 * grey.astype(np.float32) / 255)[:, :, None]
    return np.rint(colours * shade).astype(np.uint8)
