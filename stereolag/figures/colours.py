"""The colours of every figure, and numbers turned into coloured pictures."""

from __future__ import annotations

from typing import Any

import cv2
import numpy as np
import numpy.typing as npt

Rgb = npt.NDArray[np.uint8]

# Chosen to stand out on the light and on the dark page alike.
SENSOR_1 = "#3a8fb7"
SENSOR_2 = "#e08138"
CORRELATION = "#8273cf"
PEAK = "#e0447c"

FRAME = (255, 0, 160)
"""Drawn around a place in a picture: a pink that hardly any picture holds."""

NO_ANSWER = (140, 140, 140)
"""A neutral grey: no colour of viridis is one."""


def palette(colour_map: int) -> Rgb:
    """Return one of OpenCV's colour maps as (256, 3) uint8 RGB."""
    ramp = np.arange(256, dtype=np.uint8)
    return np.asarray(cv2.applyColorMap(ramp, colour_map).reshape(256, 3)[:, ::-1], dtype=np.uint8)


VIRIDIS = palette(cv2.COLORMAP_VIRIDIS)


def coloured(values: npt.NDArray[np.floating[Any]], low: float, high: float, colours: Rgb = VIRIDIS) -> Rgb:
    """Return an array as a picture: the first of the colours at `low`, the last at `high`, NaN grey.

    Parameters
    ----------
    values
        (rows, cols); what lies beyond `low` and `high` gets the colour of that end.
    low, high
        ``low < high``.
    colours
        (256, 3) uint8 RGB.

    Returns
    -------
    picture
        (rows, cols, 3) uint8 RGB.
    """
    known = np.isfinite(values)
    share = (np.where(known, values, low) - low) / (high - low)
    picture = colours[np.rint(np.clip(share, 0, 1) * 255).astype(np.uint8)]
    picture[~known] = NO_ANSWER
    return picture
