"""Images prepared for display: 8-bit RGB of bounded size, as PNG or JPEG."""

from __future__ import annotations

from typing import Any, TypeVar

import cv2
import numpy as np
import numpy.typing as npt

from stereolag.core.arrays import Rgb
from stereolag.core.inputs import Image

Scalar = TypeVar("Scalar", bound=np.generic)

FASTEST_COMPRESSION = 1

JPEG_QUALITY = 92

SHOWN_WIDTH = 1400
"""Px; wider pictures are reduced here: Streamlit would do it slowly, and blend the colours of a map."""


def as_rgb(image: Image) -> Rgb:
    """Return any image as 8-bit RGB, its transparent parts on neutral grey.

    16-bit and float images are stretched from their darkest to their brightest value, to be visible whatever their
    range.
    """
    if image.dtype != np.uint8:
        low, high = float(image.min()), float(image.max())
        scaled = (image.astype(np.float32) - np.float32(low)) * np.float32(255 / (high - low or 1.0))
        image = np.rint(scaled).astype(np.uint8)
    if image.ndim == 2:
        return np.stack([image] * 3, axis=-1)
    if image.shape[2] == 4:
        return _on_grey(image)
    return image


def fitted(image: Image, width: int = SHOWN_WIDTH) -> Rgb:
    """Return the image as RGB, reduced if it is wider than `width` px."""
    picture = as_rgb(image)
    if picture.shape[1] <= width:
        return picture
    height = max(1, round(picture.shape[0] * width / picture.shape[1]))
    return np.asarray(cv2.resize(picture, (width, height), interpolation=cv2.INTER_AREA), dtype=np.uint8)


def thinned(values: npt.NDArray[Scalar]) -> npt.NDArray[Scalar]:
    """Return every second, third … row and column of an array wider than :data:`SHOWN_WIDTH`.

    For maps: a blend of the colours of several pixels would stand for a value that none of them has.
    """
    every = -(-values.shape[1] // SHOWN_WIDTH)
    return values[::every, ::every]


def png(picture: Rgb) -> bytes:
    """Return an RGB image as the bytes of a PNG."""
    bgr = cv2.cvtColor(np.ascontiguousarray(picture), cv2.COLOR_RGB2BGR)
    _, data = cv2.imencode(".png", bgr, [cv2.IMWRITE_PNG_COMPRESSION, FASTEST_COMPRESSION])
    return data.tobytes()


def rgba_png(picture: npt.NDArray[np.uint8]) -> bytes:
    """Return an (H, W, 4) RGBA image as the bytes of a PNG."""
    _, data = cv2.imencode(".png", cv2.cvtColor(picture, cv2.COLOR_RGBA2BGRA))
    return data.tobytes()


def jpeg(picture: Rgb) -> bytes:
    """Return an RGB photograph as the bytes of a visually identical JPEG."""
    bgr = cv2.cvtColor(np.ascontiguousarray(picture), cv2.COLOR_RGB2BGR)
    _, data = cv2.imencode(".jpg", bgr, [cv2.IMWRITE_JPEG_QUALITY, JPEG_QUALITY])
    return data.tobytes()


def _on_grey(image: npt.NDArray[np.uint8]) -> Rgb:
    opacity = image[:, :, 3:].astype(np.float32) / 255
    return np.rint(image[:, :, :3] * opacity + 128 * (1 - opacity)).astype(np.uint8)


# Chosen to stand out on both the light and the dark page.
SENSOR_1 = "#3a8fb7"
SENSOR_2 = "#e08138"
CORRELATION = "#8273cf"
PEAK = "#e0447c"

FRAME = (255, 0, 160)
"""Colour of frames around places in an image: a pink that hardly any image contains."""

NO_ANSWER = (140, 140, 140)
"""A neutral grey, which viridis does not contain."""

NO_ANSWER_NUMBER = 255
"""Its index in a colour table, after all others."""


def palette(colour_map: int) -> Rgb:
    """Return one of OpenCV's colour maps as (256, 3) uint8 RGB."""
    ramp = np.arange(256, dtype=np.uint8)
    return np.asarray(cv2.applyColorMap(ramp, colour_map).reshape(256, 3)[:, ::-1], dtype=np.uint8)


VIRIDIS = palette(cv2.COLORMAP_VIRIDIS)


def coloured(values: npt.NDArray[np.floating[Any]], low: float, high: float, colours: Rgb = VIRIDIS) -> Rgb:
    """Return an array as an image: the first colour at `low`, the last at `high`, NaN grey.

    Parameters
    ----------
    values
        (rows, cols); values beyond `low` or `high` get the colour of that end.
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
    """Return the index of each value in a :func:`colour_table`: 0 at `low`, 254 at `high`, 255 for no value."""
    # In place: otherwise every move of a slider would allocate memory for each intermediate array.
    share: npt.NDArray[np.float32] = np.subtract(values, low, dtype=np.float32, casting="same_kind")
    share *= np.float32((NO_ANSWER_NUMBER - 1) / (high - low))
    np.fmax(share, 0, out=share)
    np.fmin(share, NO_ANSWER_NUMBER - 1, out=share)
    share += np.float32(0.5)
    numbers = share.astype(np.uint8)
    numbers[~np.isfinite(values)] = NO_ANSWER_NUMBER
    return numbers


def colour_table(colours: Rgb) -> Rgb:
    """Return (256, 3) uint8 RGB: a ramp of 256 colours sampled at 255, then the grey of no disparity."""
    return np.vstack([colours[np.rint(np.linspace(0, 255, NO_ANSWER_NUMBER)).astype(np.intp)], [NO_ANSWER]]).astype(
        np.uint8
    )
