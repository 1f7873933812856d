"""Pictures and masks as PNG, or TIFF where they hold floats, every value kept."""

from __future__ import annotations

import io

import cv2
import numpy as np
import numpy.typing as npt
from PIL import Image as PillowImage

from stereolag.inputs import as_image
from stereolag.stereo.result import DisparityMap


def image_png(image: npt.ArrayLike) -> bytes:
    """Return a picture as a PNG without loss.

    Parameters
    ----------
    image
        (rows, cols) grey, (rows, cols, 3) RGB or (rows, cols, 4) RGBA, uint8 or uint16; bool becomes 0 and 255.

    Raises
    ------
    ValueError
        Floats, which a PNG cannot hold, or another shape.
    """
    pixels = as_image(image, "image")
    if pixels.dtype not in (np.uint8, np.uint16):
        raise ValueError(f"image holds {pixels.dtype}; a PNG holds uint8 or uint16, floats go into an .npy file.")
    if pixels.ndim == 3:
        order = cv2.COLOR_RGB2BGR if pixels.shape[2] == 3 else cv2.COLOR_RGBA2BGRA
        pixels = np.asarray(cv2.cvtColor(np.ascontiguousarray(pixels), order))
    _, data = cv2.imencode(".png", pixels)
    return data.tobytes()


def image_tiff(image: npt.ArrayLike) -> bytes:
    """Return a grey picture of floats as a TIFF of 32 bits a pixel, for what a PNG cannot hold.

    Parameters
    ----------
    image
        (rows, cols) float.

    Raises
    ------
    ValueError
        Another shape or type.
    """
    pixels = as_image(image, "image")
    if pixels.ndim != 2 or pixels.dtype.kind != "f":
        raise ValueError(f"image has shape {pixels.shape} and holds {pixels.dtype}; allowed is (rows, cols) of floats.")
    stream = io.BytesIO()
    PillowImage.fromarray(pixels.astype(np.float32)).save(stream, "TIFF")
    return stream.getvalue()


def valid_mask_png(result: DisparityMap) -> bytes:
    """Return an 8-bit grey PNG of a result: 255 where there is a disparity, measured or filled, and 0 elsewhere."""
    return image_png(result.valid)


def reason_png(result: DisparityMap) -> bytes:
    """Return an 8-bit grey PNG of the number of every pixel's :class:`~stereolag.stereo.result.Reason`, 0 to 7."""
    return image_png(result.reason)
