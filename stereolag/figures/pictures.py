"""Pictures ready to be shown: 8-bit RGB of a bounded size, as PNG."""

from __future__ import annotations

import io
from typing import TypeVar

import cv2
import numpy as np
import numpy.typing as npt
import PIL.Image

from stereolag.figures.colours import Rgb
from stereolag.inputs import Image

Scalar = TypeVar("Scalar", bound=np.generic)

FASTEST_COMPRESSION = 1

JPEG_QUALITY = 92

SHOWN_WIDTH = 1400
"""What is wider, px, is made smaller here: Streamlit would do it, slowly, and mix the colours of a map."""


def as_rgb(image: Image) -> Rgb:
    """Return any image as 8-bit RGB, its transparent parts on neutral grey.

    Images of 16 bits and of floats are stretched from their darkest to their brightest value, so that something is
    seen whatever their range.
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
    """Return the image as RGB, made smaller where it is wider than `width` px."""
    picture = as_rgb(image)
    if picture.shape[1] <= width:
        return picture
    height = max(1, round(picture.shape[0] * width / picture.shape[1]))
    return np.asarray(cv2.resize(picture, (width, height), interpolation=cv2.INTER_AREA), dtype=np.uint8)


def thinned(values: npt.NDArray[Scalar]) -> npt.NDArray[Scalar]:
    """Return every second, third … row and column of what is wider than :data:`SHOWN_WIDTH`.

    For maps: colours mixed of several pixels would stand for a value that none of them has.
    """
    every = -(-values.shape[1] // SHOWN_WIDTH)
    return values[::every, ::every]


def png(picture: Rgb) -> bytes:
    """Return an RGB picture as the bytes of a PNG."""
    bgr = cv2.cvtColor(np.ascontiguousarray(picture), cv2.COLOR_RGB2BGR)
    _, data = cv2.imencode(".png", bgr, [cv2.IMWRITE_PNG_COMPRESSION, FASTEST_COMPRESSION])
    return data.tobytes()


def jpeg(picture: Rgb) -> bytes:
    """Return an RGB photograph as the bytes of a JPEG that looks the same, for a page to show."""
    bgr = cv2.cvtColor(np.ascontiguousarray(picture), cv2.COLOR_RGB2BGR)
    _, data = cv2.imencode(".jpg", bgr, [cv2.IMWRITE_JPEG_QUALITY, JPEG_QUALITY])
    return data.tobytes()


def indexed_png(numbers: npt.NDArray[np.uint8], table: Rgb) -> bytes:
    """Return (rows, cols) numbers into a (256, 3) table of colours as the bytes of a PNG.

    A third of the data of an RGB picture, and six times as fast.
    """
    picture = PIL.Image.fromarray(np.ascontiguousarray(numbers))
    picture.putpalette(table.tobytes())
    file = io.BytesIO()
    picture.save(file, "PNG", compress_level=FASTEST_COMPRESSION)
    return file.getvalue()


def _on_grey(image: npt.NDArray[np.uint8]) -> Rgb:
    opacity = image[:, :, 3:].astype(np.float32) / 255
    return np.rint(image[:, :, :3] * opacity + 128 * (1 - opacity)).astype(np.uint8)
