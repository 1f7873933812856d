"""Pixels without a measurement, coloured by the reason."""

from __future__ import annotations

from collections.abc import Mapping

import cv2
import numpy as np
import plotly.graph_objects as go

from stereolag.core.arrays import ReasonMap, Rgb
from stereolag.core.inputs import Image
from stereolag.core.typography import typeset
from stereolag.figures.legends import hexadecimal
from stereolag.figures.pictures import as_rgb
from stereolag.stereo.reasons import Reason

REASON_COLOURS: dict[Reason, tuple[int, int, int]] = {
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
    grey = cv2.cvtColor(np.ascontiguousarray(as_rgb(image)), cv2.COLOR_RGB2GRAY)
    picture = np.stack([96 + grey // 2] * 3, axis=-1).astype(np.uint8)
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
    figure.update_layout(
        barmode="stack",
        uniformtext={"minsize": 11, "mode": "hide"},
        height=84 + 44 * len(names),
        bargap=0.35,
        margin={"l": 8, "r": 8, "t": 8, "b": 8},
        legend={"orientation": "h", "x": 0, "y": 1.02, "yanchor": "bottom", "traceorder": "normal"},
    )
    figure.update_xaxes(title="% of the pixels", range=[0, 100], fixedrange=True)
    figure.update_yaxes(autorange="reversed", fixedrange=True)
    return figure
