"""Images as files: read from untrusted bytes, by Pillow, OpenCV or as Netpbm, and written as PNG and TIFF."""

from __future__ import annotations

import io
import re
from typing import Any

import cv2
import numpy as np
import numpy.typing as npt
from PIL import Image as PillowImage
from PIL.BmpImagePlugin import BmpImageFile
from PIL.GifImagePlugin import GifImageFile
from PIL.ImageFile import ImageFile
from PIL.JpegImagePlugin import JpegImageFile
from PIL.PngImagePlugin import PngImageFile
from PIL.TiffImagePlugin import TiffImageFile
from PIL.WebPImagePlugin import WebPImageFile

from stereolag.core.inputs import Image, as_image
from stereolag.core.jobs import limits
from stereolag.io.sources import HEADER_BYTES, Source, check_pixels, read_bytes

IMAGE_SUFFIXES = ("png", "jpg", "jpeg", "webp", "bmp", "tif", "tiff", "ppm", "pgm", "gif")
ACCEPTED = "PNG, JPEG, BMP, TIFF, WEBP, PPM, PGM and GIF"
WHAT = "image"

_DECODERS: dict[str, tuple[tuple[bytes, ...], type[ImageFile]]] = {
    "PNG": ((b"\x89PNG\r\n\x1a\n",), PngImageFile),
    "JPEG": ((b"\xff\xd8\xff",), JpegImageFile),
    "GIF": ((b"GIF87a", b"GIF89a"), GifImageFile),
    "WEBP": ((b"RIFF",), WebPImageFile),
    "TIFF": ((b"II*\0", b"MM\0*", b"II+\0", b"MM\0+"), TiffImageFile),
    "BMP": ((b"BM",), BmpImageFile),
}
"""How files of each kind begin, and Pillow's class for them."""

_ORIENTATION = 274
"""The camera's orientation among the tags of EXIF."""


def read_image(source: Source) -> Image:
    """Read an image: PNG, JPEG, BMP, TIFF, WEBP, PPM, PGM or GIF (the first frame of several).

    The camera orientation stored in the file (EXIF) is applied, unless it is broken; all other metadata is ignored.
    Palettes, CMYK, YCbCr and the like are converted to RGB; any kind of transparency gives RGBA. Grey and colour images
    keep 16 bits per channel; a TIFF of floats stays float.

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
    data = read_bytes(source, WHAT)
    pixels = parse_netpbm(data, WHAT) if data.startswith(_NETPBM) else _decoded(data)
    return np.ascontiguousarray(as_image(pixels, "The image"))


def _decoded(data: bytes) -> Image:
    kind = next((name for name, (marks, _) in _DECODERS.items() if data.startswith(marks)), None)
    if kind is None or (kind == "WEBP" and data[8:12] != b"WEBP"):
        raise ValueError(
            f"This is not an image that can be read, or its beginning is damaged; accepted are {ACCEPTED}."
        )
    try:
        # Not by `PillowImage.open`, whose limit on pixels is one for the whole process.
        image = _DECODERS[kind][1](io.BytesIO(data))
        width, height = image.size
    except Exception as error:  # decoders raise all kinds of errors on broken files
        raise _undecodable(kind) from error
    check_pixels(width, height, WHAT)
    try:
        if image.mode in ("RGB", "RGBA") and ";16" in str(image.tile):
            return _deep_colours(data, image)
        image.load()
        return _upright(_as_array(image), image)
    except MemoryError:
        raise
    except PillowImage.DecompressionBombError as error:  # a frame that reaches far beyond its screen
        raise ValueError(
            f"At most {limits().max_megapixels} megapixels are accepted, and the image has more."
        ) from error
    except Exception as error:
        raise _undecodable(kind) from error


def _undecodable(kind: str) -> ValueError:
    return ValueError(
        f"The image ({kind}) is damaged or cut short and cannot be decoded; accepted are whole files of {ACCEPTED}."
    )


def _as_array(image: PillowImage.Image) -> Image:
    if image.has_transparency_data and not image.mode.startswith("I"):
        image = image.convert("RGBA")
    elif image.mode not in ("1", "L", "RGB", "I", "F") and not image.mode.startswith("I;16"):
        image = image.convert("RGB")
    pixels = np.array(image)
    return pixels.astype(pixels.dtype.newbyteorder("="), copy=False)


def _deep_colours(data: bytes, image: ImageFile) -> Image:
    """Return colours of 16 bits by OpenCV; Pillow keeps their upper 8 bits only."""
    pixels = cv2.imdecode(np.frombuffer(data, np.uint8), cv2.IMREAD_UNCHANGED)
    if pixels is None:
        raise ValueError("OpenCV cannot decode these pixels")
    pixels = cv2.cvtColor(pixels, cv2.COLOR_BGRA2RGBA if pixels.shape[2] == 4 else cv2.COLOR_BGR2RGB)
    # OpenCV applies the orientation in a TIFF, but not in a PNG.
    return pixels if isinstance(image, TiffImageFile) else _upright(pixels, image)


def _upright(pixels: Image, image: PillowImage.Image) -> Image:
    """Undo the camera's orientation: EXIF values 5 to 8 are 1 to 4 with rows and columns exchanged."""
    try:
        # Not `image.getexif`, which decodes a whole PNG to look for EXIF behind the pixels, where none may be.
        orientation = PillowImage.Image.getexif(image).get(_ORIENTATION, 1)
    except Exception:  # broken EXIF raises all kinds of errors
        orientation = 1
    if orientation in (5, 6, 7, 8):
        pixels = np.swapaxes(pixels, 0, 1)
    if orientation in (3, 4, 7, 8):
        pixels = pixels[::-1]
    if orientation in (2, 3, 6, 7):
        pixels = pixels[:, ::-1]
    return pixels


# Netpbm: PBM, PGM and PPM (bits, grey and colour integers) and PFM (grey floats). Pillow cuts colours to 8 bits and
# reads most of these in Python; OpenCV does not stretch them to the full range of their type, and multiplies some PFMs
# by 256.
# Formats: https://netpbm.sourceforge.net/doc/pgm.html and https://www.pauldebevec.com/Research/HDR/PFM/

_NETPBM = (b"P1", b"P2", b"P3", b"P4", b"P5", b"P6", b"Pf")
_COMMENT = re.compile(rb"#[^\r\n]*")
_FIELD = rb"(?:\s|#[^\r\n]*+)*+([^\s#]++)"
"""Spaces and comments, then what is neither."""


def parse_netpbm(data: bytes, what: str, *, as_stored: bool = False) -> npt.NDArray[Any]:
    """Return a P1 to P6 or Pf image, its integers stretched to the full range of their type, or as they are stored.

    Returns
    -------
    pixels
        (rows, cols) or, for P3 and P6, (rows, cols, 3); uint8, or uint16 if the largest value is above 255; float32
        for a PFM.

    Raises
    ------
    ValueError
        A broken header, too many or too few pixels, or integers to be returned as stored above the announced largest.
    """
    if data.startswith(b"Pf"):
        return np.ascontiguousarray(parse_pfm(data, what), dtype=np.float32)
    magic = data[:2]
    channels = 3 if magic in (b"P3", b"P6") else 1
    header = _header(data, magic, 2 if magic in (b"P1", b"P4") else 3)
    if header is None:
        raise ValueError(f"The {what} begins like a PPM, PGM or PBM, but no size and largest value follow.")
    width, height, rest, offset = header
    check_pixels(width, height, what)
    largest = _whole(rest) if rest else 1
    if not 1 <= largest <= 65535:
        raise ValueError(f"The {what} (PGM) has {largest} for its largest value; allowed are 1 to 65535.")
    dtype: np.dtype[np.unsignedinteger[Any]] = np.dtype(np.uint8 if largest < 256 else np.uint16)
    full = np.iinfo(dtype).max
    if magic == b"P4":
        packed = _from_binary(data, offset, np.dtype(np.uint8), (width + 7) // 8, height, what)
        pixels = 1 - np.unpackbits(packed, axis=1, count=width)
    elif magic in (b"P5", b"P6"):
        pixels = _from_binary(data, offset, dtype.newbyteorder(">"), width * channels, height, what)
    else:
        pixels = np.minimum(_from_text(data[offset:], magic, width * height * channels, what), full)
    if not as_stored:
        pixels = np.minimum(np.rint(np.arange(full + 1) * full / largest), full).astype(dtype)[pixels]
    elif pixels.max() > largest:
        raise ValueError(f"The {what} (PGM) holds {pixels.max()}, above the {largest} it announces.")
    return pixels.astype(dtype, copy=False).reshape((height, width, 3) if channels == 3 else (height, width))


def parse_pfm(data: bytes, what: str) -> npt.NDArray[np.floating[Any]]:
    """Return the (rows, cols) floats of a grey PFM, top row first: a view of the file in its byte order.

    The sign of the scale gives the byte order; its magnitude, which writers use for all sorts of things, is ignored.

    Raises
    ------
    ValueError
        Colour, a broken header, too many pixels or too few bytes.
    """
    header = _header(data, b"Pf", 3)
    if header is None:
        raise ValueError(f"The {what} is not a grey PFM: it must begin with Pf, width, height and scale.")
    width, height, written, offset = header
    check_pixels(width, height, what)
    scale = float(written) if re.fullmatch(rb"[-+]?(\d+\.?\d*|\.\d+)([eE][-+]?\d+)?", written[:40]) else 0.0
    if scale == 0 or not np.isfinite(scale):
        shown = re.sub(r"[^-+.\w]", "?", written[:40].decode("latin-1"))
        raise ValueError(f"The {what} (PFM) has the scale {shown}; allowed are numbers other than 0.")
    return _from_binary(data, offset, np.dtype("<f4" if scale < 0 else ">f4"), width, height, what)[::-1]


def _header(data: bytes, magic: bytes, count: int) -> tuple[int, int, bytes, int] | None:
    """Return width, height, the third field if `count` is 3, and the offset of the pixels after one more space."""
    found = re.match(magic + rb"(?=[\s#])" + count * _FIELD + rb"(?=\s)", data[:HEADER_BYTES])
    if found is None or not (found[1].isdigit() and found[2].isdigit()):
        return None
    end = found.end()
    line_end = 2 if magic == b"Pf" and data[end : end + 2] == b"\r\n" else 1
    return _whole(found[1]), _whole(found[2]), found[3] if count == 3 else b"", end + line_end


def _whole(field: bytes) -> int:
    """Return a number of up to nine digits, 0 for anything else."""
    return int(field) if field.isdigit() and len(field) < 10 else 0


def _from_binary(
    data: bytes, offset: int, dtype: np.dtype[Any], width: int, height: int, what: str
) -> npt.NDArray[Any]:
    needed, found = width * height * dtype.itemsize, len(data) - offset
    if found < needed:
        raise ValueError(f"The {what} is cut short: {width} × {height} pixels need {needed} bytes, it has {found}.")
    return np.frombuffer(data, dtype, width * height, offset).reshape(height, width)


def _from_text(text: bytes, magic: bytes, count: int, what: str) -> npt.NDArray[Any]:
    text = _COMMENT.sub(b" ", text)
    if magic == b"P1":
        pixels = 1 - (np.frombuffer(b"".join(text.split())[:count], np.uint8) - np.uint8(ord("0")))
        allowed = bool((pixels <= 1).all())
    else:
        words = np.array(text.split(maxsplit=count)[:count], dtype="S6")
        allowed = bool(np.char.isdigit(words).all())
        pixels = words.astype(np.int32) if allowed else words
    if not allowed:
        raise ValueError(f"The {what} ({magic.decode()}) holds something other than whole numbers from 0.")
    if pixels.size < count:
        raise ValueError(f"The {what} is cut short: {count} numbers are needed, it has {pixels.size}.")
    return pixels


def image_png(image: npt.ArrayLike) -> bytes:
    """Return an image as a lossless PNG.

    Parameters
    ----------
    image
        (rows, cols) grey, (rows, cols, 3) RGB or (rows, cols, 4) RGBA, uint8 or uint16; bool becomes 0 and 255.

    Raises
    ------
    ValueError
        Floats, which a PNG cannot store, or another shape.
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
    """Return a grey image of floats as a TIFF with 32 bits per pixel, since a PNG stores integers only.

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
