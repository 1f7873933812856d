"""Pictures from untrusted bytes."""

from __future__ import annotations

import io
import re

import cv2
import numpy as np
from PIL import Image as PillowImage

from stereolag.inputs import Image, as_image
from stereolag.reading.sources import MAX_PIXELS, Source, check_pixels, no_warnings, read_bytes

ACCEPTED = "PNG, JPEG, BMP, TIFF, WEBP, PPM, PGM and GIF"
_FORMATS = ("PNG", "JPEG", "BMP", "TIFF", "WEBP", "PPM", "GIF")
_EXIF_ORIENTATION = 0x0112


def read_image(source: Source) -> Image:
    """Read a picture: PNG, JPEG, BMP, TIFF, WEBP, PPM, PGM or GIF (the first frame of several).

    The orientation a camera noted in the file (EXIF) is applied. A palette is resolved, and so are CMYK, YCbCr and
    the like, to RGB; any kind of transparency gives RGBA. Grey and colour of 16 bits a channel keep them (but for
    16-bit colour PPM, which is reduced to 8); a TIFF of floats stays float.

    Parameters
    ----------
    source
        A path, the bytes of the file, or a binary file object.

    Returns
    -------
    image
        (rows, cols) grey, (rows, cols, 3) RGB or (rows, cols, 4) RGBA; uint8, uint16 or float32.

    Raises
    ------
    ValueError
        An empty file, one that is not such a picture or is cut short, or a picture of more than 50 megapixels.
        The limit is checked on the header, before any pixel is decoded.
    """
    data = read_bytes(source, "picture")
    with no_warnings(), _opened(data) as picture:
        check_pixels(*picture.size, "picture")
        pixels, orientation = _decoded(picture, data)
    return _upright(as_image(pixels, "The picture"), orientation)


def _opened(data: bytes) -> PillowImage.Image:
    try:
        return PillowImage.open(io.BytesIO(data), formats=_FORMATS)
    except PillowImage.DecompressionBombError as error:
        # Pillow's own limit is far above ours, and the size is in its message alone.
        pixels = re.search(r"\d+", str(error))
        size = f"{int(pixels[0]) / 1e6:.0f}" if pixels else "far too many"
        raise ValueError(
            f"The picture has {size} megapixels; at most {MAX_PIXELS // 1_000_000} megapixels are accepted."
        ) from error
    except Exception as error:  # Pillow's parsers raise whatever comes up on broken headers
        raise ValueError(
            f"This is not a picture that can be read, or its beginning is damaged; accepted are {ACCEPTED}."
        ) from error


def _decoded(picture: PillowImage.Image, data: bytes) -> tuple[Image, int]:
    try:
        has_16_bit_colour = picture.mode in ("RGB", "RGBA") and any(
            ";16" in str(tile) for tile in getattr(picture, "tile", [])
        )
        picture.load()
        orientation = int(picture.getexif().get(_EXIF_ORIENTATION, 1))
        # Pillow would keep the upper 8 bits only. It has decoded the file all the same, so OpenCV gets no broken one.
        return (_colour_of_16_bits(data) if has_16_bit_colour else _as_array(picture)), orientation
    except Exception as error:  # Pillow's decoders raise whatever comes up on broken pixels
        raise ValueError(
            f"The picture ({picture.format}) is damaged or cut short and cannot be decoded; accepted are whole "
            f"files of {ACCEPTED}."
        ) from error


def _as_array(picture: PillowImage.Image) -> Image:
    if picture.has_transparency_data and not picture.mode.startswith("I"):
        return np.array(picture.convert("RGBA"))
    if picture.mode in ("1", "L", "RGB", "I", "F") or picture.mode.startswith("I;16"):
        return np.array(picture)
    return np.array(picture.convert("RGB"))


def _colour_of_16_bits(data: bytes) -> Image:
    pixels = cv2.imdecode(np.frombuffer(data, np.uint8), cv2.IMREAD_UNCHANGED)
    if pixels is None:
        raise ValueError("OpenCV cannot decode these 16-bit pixels")
    return np.asarray(cv2.cvtColor(pixels, cv2.COLOR_BGRA2RGBA if pixels.shape[2] == 4 else cv2.COLOR_BGR2RGB))


def _upright(pixels: Image, orientation: int) -> Image:
    """Undo how the camera was held: EXIF orientation 5 to 8 are 1 to 4 with rows and columns exchanged."""
    if orientation in (5, 6, 7, 8):
        pixels = np.swapaxes(pixels, 0, 1)
    if orientation in (3, 4, 7, 8):
        pixels = pixels[::-1]
    if orientation in (2, 3, 6, 7):
        pixels = pixels[:, ::-1]
    return np.ascontiguousarray(pixels)
