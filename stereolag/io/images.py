"""Images from untrusted bytes."""

from __future__ import annotations

import io
from collections.abc import Callable

import cv2
import numpy as np
from PIL import Image as PillowImage

from stereolag.core.inputs import Image, as_image
from stereolag.io import gif, jpeg, netpbm, png, tiff, webp
from stereolag.io.bare import BarePicture
from stereolag.io.sources import Source, check_pixels, read_bytes

ACCEPTED = "PNG, JPEG, BMP, TIFF, WEBP, PPM, PGM and GIF"
WHAT = "image"
MAX_RUN_LENGTH_BYTES = 4 * 2**20
MAX_RUN_LENGTH_PIXELS = 8_000_000
"""Pillow reads run-length coded BMP in a Python loop, and fills the gaps between the runs pixel by pixel."""

_NETPBM = (b"P1", b"P2", b"P3", b"P4", b"P5", b"P6", b"Pf")
_BAND_PIXELS = 2**20
_PROGRESSIVE_PIXELS = 20_000_000
"""Above this, the coefficients of a progressive JPEG plus Pillow's four bytes per pixel take too much memory."""


def read_image(source: Source) -> Image:
    """Read an image: PNG, JPEG, BMP, TIFF, WEBP, PPM, PGM or GIF (the first frame of several).

    The camera orientation stored in the file (EXIF) is applied; all other metadata is ignored, and broken metadata is
    not an error. Palettes, CMYK, YCbCr and the like are converted to RGB; any kind of transparency gives RGBA. Grey and
    colour images keep 16 bits per channel; a TIFF of floats stays float.

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
        An empty file, one that is not such an image or is cut short, or an image of more megapixels than the limit
        in force (50 unless set otherwise). The limit is checked on the header, before any pixel is decoded.

    Examples
    --------
    >>> import stereolag as sl
    >>> from stereolag import samples
    >>> image = sl.read_image(samples.stereo_pairs()["cube"].left)
    >>> image.shape, image.dtype
    ((480, 640, 3), dtype('uint8'))
    """
    pixels, orientation = _decoded(read_bytes(source, WHAT))
    return _upright(as_image(pixels, "The image"), orientation)


def _decoded(data: bytes) -> tuple[Image, int]:
    if data.startswith(_NETPBM):
        return netpbm.parse_netpbm(data, WHAT), 1
    kind, bare_image = _kind(data)
    bare = bare_image(data)
    del data  # unless the caller holds it, this frees its memory before pixels are decoded
    check_pixels(bare.width, bare.height, WHAT)
    if bare.canvas:
        check_pixels(*bare.canvas[:2], WHAT)
    orientation, canvas = bare.orientation, bare.canvas
    try:
        loaded = _loaded(kind, bare)
        del bare
        pixels = loaded if isinstance(loaded, np.ndarray) else _as_array(loaded)
    except Exception as error:  # decoders raise all kinds of errors on broken files
        raise ValueError(
            f"The image ({kind}) is damaged or cut short and cannot be decoded; accepted are whole files of {ACCEPTED}."
        ) from error
    return (_on_canvas(pixels, *canvas) if canvas else pixels), orientation


def _kind(data: bytes) -> tuple[str, Callable[[bytes], BarePicture]]:
    """Return the name of the file's kind and the function that strips its metadata."""
    if data.startswith(png.MAGIC) and data[12:16] == b"IHDR" and len(data) >= 33:
        return "PNG", png.bare_png
    if data.startswith(jpeg.MAGIC):
        return "JPEG", jpeg.bare_jpeg
    if data.startswith(gif.MAGICS):
        return "GIF", gif.bare_gif
    if webp.is_webp(data):
        return "WEBP", webp.bare_webp
    if data.startswith(tiff.MAGICS):
        return "TIFF", tiff.bare_tiff
    if data.startswith(b"BM") and len(data) > 34:
        return "BMP", _bare_bmp
    raise ValueError(f"This is not an image that can be read, or its beginning is damaged; accepted are {ACCEPTED}.")


def _bare_bmp(data: bytes) -> BarePicture:
    if int.from_bytes(data[14:18], "little") == 12:
        width, height = (int.from_bytes(data[start : start + 2], "little") for start in (18, 20))
        return BarePicture(data, width, height)
    width, height = (int.from_bytes(data[start : start + 4], "little", signed=True) for start in (18, 22))
    too_long = len(data) > MAX_RUN_LENGTH_BYTES or width * abs(height) > MAX_RUN_LENGTH_PIXELS
    if data[30] in (1, 2) and too_long:
        raise ValueError(
            f"The image (BMP) is run-length coded, {width} × {abs(height)} pixels in {len(data) / 1e6:.1f} MB; "
            f"at most {MAX_RUN_LENGTH_PIXELS // 10**6} megapixels in 4 MB are accepted: save it as PNG."
        )
    return BarePicture(data, width, abs(height))


def _loaded(kind: str, bare: BarePicture) -> PillowImage.Image | Image:
    """Return the decoded image, as a Pillow image if Pillow is the better decoder."""
    if kind == "WEBP":
        return _by_opencv(bare.data)  # Pillow keeps five copies of the pixels
    if kind == "JPEG" and bare.width * bare.height > _PROGRESSIVE_PIXELS and jpeg.is_progressive_colour(bare.data):
        return _by_opencv(bare.data)
    with io.BytesIO(bare.data) as stream:
        image = PillowImage.open(stream, formats=(kind,))
        if image.size != (bare.width, bare.height):
            raise ValueError(f"{image.size} pixels after {bare.width} × {bare.height}")
        colour, layout = image.mode in ("RGB", "RGBA"), str(getattr(image, "tile", ""))
        if not (colour and ";16" in layout):
            image.load()
            return image
    return _by_opencv(bare.data)  # Pillow would keep the upper 8 bits only


def _by_opencv(data: bytes) -> Image:
    pixels = cv2.imdecode(np.frombuffer(data, np.uint8), cv2.IMREAD_UNCHANGED)
    if pixels is None:
        raise ValueError("OpenCV cannot decode these pixels")
    if pixels.ndim == 3:
        to_rgb = cv2.COLOR_BGRA2RGBA if pixels.shape[2] == 4 else cv2.COLOR_BGR2RGB
        for rows in _bands(pixels.shape[1], pixels.shape[0]):
            pixels[rows] = cv2.cvtColor(pixels[rows], to_rgb)
    return np.asarray(pixels)


def _as_array(image: PillowImage.Image) -> Image:
    """Return the pixels, converted and copied in bands of rows: another whole copy would take a lot of memory."""
    mode: str | None = "RGB"
    if image.has_transparency_data and not image.mode.startswith("I"):
        mode = "RGBA"
    elif image.mode in ("1", "L", "RGB", "I", "F") or image.mode.startswith("I;16"):
        mode = None
    pixels: Image | None = None
    for rows in _bands(*image.size):
        band = image.crop((0, rows.start, image.width, rows.stop))
        part = np.asarray(band if mode is None or band.mode == mode else band.convert(mode))
        if pixels is None:
            pixels = np.empty((image.height, *part.shape[1:]), part.dtype.newbyteorder("="))
        pixels[rows] = part
    if pixels is None:
        raise ValueError("no rows")
    return pixels


def _bands(width: int, height: int) -> list[slice]:
    """Return slices of rows of about a megapixel each."""
    step = max(1, _BAND_PIXELS // width)
    return [slice(first, min(first + step, height)) for first in range(0, height, step)]


def _on_canvas(frame: Image, width: int, height: int, left: int, top: int) -> Image:
    """Return a frame on the transparent canvas of its animation."""
    canvas = np.zeros((height, width, 4), np.uint8)
    part = canvas[top : top + frame.shape[0], left : left + frame.shape[1]]
    frame = frame[: part.shape[0], : part.shape[1]]
    part[:, :, : frame.shape[2]] = frame
    if frame.shape[2] == 3:
        part[:, :, 3] = 255
    return canvas


def _upright(pixels: Image, orientation: int) -> Image:
    """Undo the camera's orientation: EXIF values 5 to 8 are 1 to 4 with rows and columns exchanged."""
    if orientation in (5, 6, 7, 8):
        pixels = np.swapaxes(pixels, 0, 1)
    if orientation in (3, 4, 7, 8):
        pixels = pixels[::-1]
    if orientation in (2, 3, 6, 7):
        pixels = pixels[:, ::-1]
    return np.ascontiguousarray(pixels)
