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

NO_ANSWER_NUMBER = 255
"""Its place in a table of colours, after all others."""


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
    return colour_table(colours)[colour_numbers(values, low, high)]


def colour_numbers(values: npt.NDArray[np.floating[Any]], low: float, high: float) -> npt.NDArray[np.uint8]:
    """Return which entry of a :func:`colour_table` each value gets: 0 at `low`, 254 at `high`, 255 without a value."""
    # In place: at every move of a slider the memory of each intermediate array would have to be found anew.
    share: npt.NDArray[np.float32] = np.subtract(values, low, dtype=np.float32, casting="same_kind")
    share *= np.float32((NO_ANSWER_NUMBER - 1) / (high - low))
    np.fmax(share, 0, out=share)
    np.fmin(share, NO_ANSWER_NUMBER - 1, out=share)
    share += np.float32(0.5)
    numbers = share.astype(np.uint8)
    numbers[~np.isfinite(values)] = NO_ANSWER_NUMBER
    return numbers


def colour_table(colours: Rgb) -> Rgb:
    """Return (256, 3) uint8 RGB: a ramp of 256 colours in 255 steps, and last the grey of no answer."""
    return np.vstack([colours[np.rint(np.linspace(0, 255, NO_ANSWER_NUMBER)).astype(np.intp)], [NO_ANSWER]]).astype(
        np.uint8
    )
