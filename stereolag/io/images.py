"""Images as files, read from untrusted bytes by Pillow, OpenCV or the Netpbm parser here, and written."""

from __future__ import annotations

import io
import re
import struct
import warnings
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass
from typing import Any

import cv2
import numpy as np
import numpy.typing as npt
from isal import isal_zlib
from pi_heif import HeifImageFile
from PIL import Image as PillowImage
from PIL.AvifImagePlugin import AvifImageFile
from PIL.BmpImagePlugin import BmpImageFile
from PIL.GifImagePlugin import GifImageFile
from PIL.ImageFile import ImageFile
from PIL.JpegImagePlugin import JpegImageFile
from PIL.MpoImagePlugin import MpoImageFile
from PIL.PngImagePlugin import PngImageFile
from PIL.TiffImagePlugin import TiffImageFile
from PIL.WebPImagePlugin import WebPImageFile

from stereolag.core.inputs import Image, as_image
from stereolag.core.jobs import limits
from stereolag.io.sources import HEADER_BYTES, Source, check_pixels, read_bytes

IMAGE_SUFFIXES = (
    *("png", "jpg", "jpeg", "jfif", "webp", "heic", "heif", "avif", "bmp", "tif", "tiff"),
    *("ppm", "pgm", "pbm", "pnm", "gif", "mpo", "jps", "pns"),
)
ACCEPTED = "PNG, JPEG, HEIC, AVIF, WEBP, BMP, TIFF, PPM, PGM and GIF"
WHAT = "image"
MAX_UINT16 = 65535

_PNG_MAGIC = b"\x89PNG\r\n\x1a\n"
_PNG_END = b"\0\0\0\0IEND\xaeB`\x82"
_JPEG_MAGIC = b"\xff\xd8\xff"

_DECODERS: dict[str, tuple[re.Pattern[bytes], type[ImageFile]]] = {
    kind: (re.compile(begins, re.DOTALL), decoder)
    for kind, begins, decoder in (
        ("PNG", _PNG_MAGIC, PngImageFile),
        ("JPEG", _JPEG_MAGIC, JpegImageFile),
        ("GIF", rb"GIF8[79]a", GifImageFile),
        ("WEBP", rb"RIFF....WEBP", WebPImageFile),
        ("TIFF", rb"II[*+]\0|MM\0[*+]", TiffImageFile),
        ("BMP", rb"BM", BmpImageFile),
        ("AVIF", rb"....ftyp(?:....){0,9}avi[fs]", AvifImageFile),
        ("HEIC", rb"....ftyp(?:....){0,9}(?:hei[cmxs]|mif1)", HeifImageFile),
    )
}
"""The beginning of files of each kind, and Pillow's class for them."""

_EXIF_ORIENTATION_TAG = 274
"""The EXIF tag of the camera's orientation."""

_TURNS = {2: (0, True), 3: (2, False), 4: (2, True), 5: (3, True), 6: (3, False), 7: (1, True), 8: (1, False)}
"""Quarters, counter-clockwise, by which pixels of each orientation are turned, and whether they are then mirrored."""

MAX_VIEWS = 4
"""Views of one scene in a file of a stereo camera."""


class UnseenFrames(UserWarning, ValueError):  # noqa: N818
    """A file holds several frames and none was chosen: a warning, and an error where nobody sees warnings."""


@dataclass(frozen=True, eq=False)
class Frame:
    """A frame of an image file as :func:`read_image` returns it, its number, from 1, and the number of frames."""

    pixels: Image
    number: int
    count: int


def read_image(source: Source, *, frame: int | None = None) -> Image:
    """Read an image: PNG, JPEG, HEIC, AVIF, WEBP, BMP, TIFF, PPM, PGM or GIF.

    The camera orientation stored in the file (EXIF) is applied, unless it is broken; all other metadata is ignored.
    Palettes, CMYK, YCbCr and the like are converted to RGB; transparency gives RGBA, unless it is a single transparent
    value in a 16-bit PNG. Grey and colour images keep 16 bits per channel, those of a HEIC or AVIF 8; a TIFF of floats
    remains float, with NaN where it has no data, and integers below 0 or above 65535 become floats.

    Parameters
    ----------
    source
        A path, the bytes of the file, or a binary file object.
    frame
        Which frame of a GIF, WEBP, HEIC, AVIF or animated PNG, page of a TIFF or view of an MPO: its number, from 1.
        None: the first, with a warning if there are others.

    Returns
    -------
    image
        (rows, cols) grey, (rows, cols, 3) RGB or (rows, cols, 4) RGBA; uint8, uint16, float32 or float64.

    Raises
    ------
    ValueError
        An empty file, one that is not such an image or is cut short, no such frame, or an image of more megapixels than
        the current limit (50 unless set otherwise). The limit is checked on the header, before any pixel is decoded.
    OSError
        A path that cannot be opened.

    Examples
    --------
    >>> import stereolag as sl
    >>> from stereolag import samples
    >>> image = sl.read_image(samples.stereo_pairs()["cube"].left)
    >>> image.shape, image.dtype
    ((480, 640, 3), dtype('uint8'))
    """
    chosen = read_frame(source, 1 if frame is None else frame)
    if frame is None and chosen.count > 1:
        warnings.warn(
            f"The image holds {chosen.count} frames: choose one (frame=1 is the first), or save it as a separate file.",
            UnseenFrames,
            stacklevel=2,
        )
    return chosen.pixels


def read_frame(source: Source, number: int = 1) -> Frame:
    """Read a frame of an image, as :func:`read_image` does, and the number of frames."""
    data = read_bytes(source, WHAT)
    if data.startswith(_NETPBM_MAGICS):
        _check_frame(number, 1)
        pixels, count = parse_netpbm(data, WHAT), 1
    else:
        pixels, count = _decode(data, number)
    is_other_integer = pixels.dtype.kind in "iu" and pixels.dtype not in (np.uint8, np.uint16)
    if is_other_integer and (pixels.min() < 0 or pixels.max() > MAX_UINT16):
        pixels = pixels.astype(np.float32 if pixels.dtype.itemsize < 4 else np.float64)
    elif pixels.dtype.kind != "f":
        pixels = as_image(pixels, "The image")
    return Frame(np.ascontiguousarray(pixels), number, count)


def read_camera_frame(data: bytes, max_pixels: int, *, grey: bool = False) -> Image:
    """Read a JPEG made by a browser from a camera frame, uint8 RGB or grey; ValueError for anything else."""
    if not data.startswith(_JPEG_MAGIC):
        raise ValueError("The frame is not a JPEG.")
    with suppress(SyntaxError, OSError):
        cols, rows = JpegImageFile(io.BytesIO(data)).size
        if rows * cols > max_pixels:
            raise ValueError(f"The frame has {rows * cols:,} pixels; live frames may have {max_pixels:,}.")
        colours = cv2.IMREAD_GRAYSCALE if grey else cv2.IMREAD_COLOR_RGB
        pixels = cv2.imdecode(np.frombuffer(data, np.uint8), colours | cv2.IMREAD_IGNORE_ORIENTATION)
        if pixels is not None:
            return pixels
    raise ValueError("The frame is damaged.")


def _check_frame(number: int, count: int) -> None:
    if not 1 <= number <= count:
        raise ValueError(f"The image has no frame {number}; it holds {count}.")


def _decode(data: bytes, number: int) -> tuple[Image, int]:
    """Return a frame and the number of frames."""
    kind = next((name for name, (begins, _) in _DECODERS.items() if begins.match(data)), None)
    if kind is None:
        raise ValueError(
            f"This is not an image that can be read, or its beginning is damaged; accepted are {ACCEPTED}."
        )
    pages = _page_offsets(data) if kind == "TIFF" else []
    if pages:
        _check_frame(number, len(pages))
        data = _with_page_first(data, pages[number - 1])
        pillow_keeps = _pillow_keeps_tiff(data)
        if number == 1 and _page_tags(data).get(_SUBFILE_TYPE, (0,))[0] & _IS_PREVIEW:
            raise ValueError(
                "The image (TIFF) begins with a small preview, as raw photographs do (DNG, NEF, ARW): develop it, and "
                "save it as TIFF or PNG."
            )
        if not pillow_keeps:
            return _decode_with_opencv(data, kind), len(pages)  # which also applies the orientation, unlike in a PNG
    try:
        # Not `PillowImage.open`, whose limit on pixels holds for the whole process.
        image = _DECODERS[kind][1](io.BytesIO(data))
        views = _views_in_jpeg(data) if "mpoffset" in image.info else 1
        if 1 < number <= views:
            image = MpoImageFile(io.BytesIO(data))
        width, height = image.size
    except Exception as error:  # decoders raise all kinds of errors on broken files
        raise _decoding_error(kind) from error
    check_pixels(width, height, WHAT)
    try:
        count = views if kind == "JPEG" else len(pages) or getattr(image, "n_frames", 1)
        has_16_bits = image.mode in ("RGB", "RGBA") and ";16" in str(image.tile)
        is_still_webp = kind == "WEBP" and image.mode == "RGB" and count == 1  # OpenCV takes 60 % of the time
        if (has_16_bits or is_still_webp) and number == 1:
            return _upright(_decode_with_opencv(data, kind, image.mode), image), count
        if kind == "PNG" and count == number == 1 and _is_plain_png(image, data):
            with suppress(ValueError):  # Pillow is more tolerant of faults
                return _upright(_decode_with_opencv(data, kind, image.mode), image), count
        if 1 <= number <= count and not pages:
            image.seek(number - 1)
        image.load()
        pixels = _upright(_as_array(image), image)
    except MemoryError:
        raise
    except PillowImage.DecompressionBombError as error:  # a frame far larger than its canvas
        raise ValueError(
            f"At most {limits().max_megapixels} megapixels are accepted, and the image has more."
        ) from error
    except Exception as error:
        raise _decoding_error(kind) from error
    _check_frame(number, count)
    if has_16_bits and number > 1:
        raise ValueError(
            f"Frame {number} of the image (PNG) has 16 bits per channel, and only the first frame of such a file is "
            "read: save the frame as a separate file."
        )
    return pixels, count


def _is_plain_png(image: ImageFile, data: bytes) -> bool:
    """Return whether OpenCV decodes a PNG to the same pixels as Pillow, which it does in two thirds of the time.

    It does so with 8 bits per channel and nothing after the pixels, where there may be an orientation.
    """
    last_chunk = data.rfind(b"IDAT")
    end = last_chunk + 8 + int.from_bytes(data[last_chunk - 4 : last_chunk], "big")
    has_8_bits = image.mode in ("L", "RGB", "RGBA") and [tile[3] for tile in image.tile] == [image.mode]
    return has_8_bits and "transparency" not in image.info and len(data) - end == len(_PNG_END)


def _views_in_jpeg(data: bytes) -> int:
    """Return the number of pictures of the same size at the beginning of an MPO, which is several JPEGs in a row.

    The others are smaller previews and brightness maps of other cameras and phones.
    """
    count = 1
    with suppress(Exception):  # damaged tables raise all kinds of errors; the first picture is intact
        image = MpoImageFile(io.BytesIO(data))
        first = image.size
        while count < min(image.n_frames, MAX_VIEWS):
            image.seek(count)
            if image.size != first:
                break
            count += 1
    return count


def _decoding_error(kind: str) -> ValueError:
    return ValueError(
        f"The image ({kind}) is damaged or cut short and cannot be decoded; accepted are whole files of {ACCEPTED}."
    )


# TIFF: https://www.itu.int/itudoc/itu-t/com16/tiff-fx/docs/tiff6.pdf

_SUBFILE_TYPE, _WIDTH, _HEIGHT, _BITS, _SAMPLES, _PLANES, _SAMPLE_FORMAT = 254, 256, 257, 258, 277, 284, 339
"""Tags of a page."""

_IS_PREVIEW = 1
"""Bit of the type of a page that shows another one at reduced size."""

_INTEGER_LETTERS = {1: "B", 3: "H", 4: "L", 16: "Q"}
"""Types of integers in a tag, as letters of :mod:`struct`."""

_SAMPLE_FORMAT_NAMES = {
    1: "unsigned integers",
    2: "signed integers",
    3: "floats",
    5: "complex numbers",
    6: "complex numbers",
}


def _tiff_structure(data: bytes) -> tuple[str, str, int, int]:
    """Return the struct formats of a count and an offset, the bytes of an entry, and the place of the first offset."""
    order = "<" if data[:2] == b"II" else ">"
    return (f"{order}Q", f"{order}Q", 20, 8) if b"+" in data[2:4] else (f"{order}H", f"{order}L", 12, 4)


def _page_offsets(data: bytes) -> list[int]:
    """Return the offsets of the directories of a TIFF's pages, up to one outside the file or one that is repeated."""
    count, offset, entry, first_place = _tiff_structure(data)
    pages: dict[int, None] = {}
    with suppress(struct.error, OverflowError):
        (start,) = struct.unpack_from(offset, data, first_place)
        while start and start not in pages:
            (entries,) = struct.unpack_from(count, data, start)
            (following,) = struct.unpack_from(offset, data, start + struct.calcsize(count) + entry * entries)
            pages[start] = None
            start = following
    return [*pages]


def _page_tags(data: bytes) -> dict[int, tuple[int, ...]]:
    """Return the tags that describe the first page of a TIFF, at most four values of each.

    Pillow is not used, since it does not recognise a big-endian BigTIFF.
    """
    count, offset, entry, first_place = _tiff_structure(data)
    inline = struct.calcsize(offset)
    (start,) = struct.unpack_from(offset, data, first_place)
    (entries,) = struct.unpack_from(count, data, start)
    tags = {}
    for place in range(start + struct.calcsize(count), len(data) - entry, entry)[:entries]:
        tag, kind = struct.unpack_from(f"{count[0]}HH", data, place)
        (size,) = struct.unpack_from(offset, data, place + 4)
        if tag in (_SUBFILE_TYPE, _WIDTH, _HEIGHT, _BITS, _SAMPLES, _PLANES, _SAMPLE_FORMAT) and size:
            letter, values_at = _INTEGER_LETTERS[kind], place + 4 + inline
            if size * struct.calcsize(count[0] + letter) > inline:
                (values_at,) = struct.unpack_from(offset, data, values_at)
            tags[tag] = struct.unpack_from(f"{count[0]}{min(size, 4)}{letter}", data, values_at)
    return tags


def _with_page_first(data: bytes, start: int) -> bytes:
    """Return a TIFF that begins with the page whose directory starts at an offset."""
    _, offset, _, first_place = _tiff_structure(data)
    return data[:first_place] + struct.pack(offset, start) + data[first_place + struct.calcsize(offset) :]


def _pillow_keeps_tiff(data: bytes) -> bool:
    """Return whether Pillow reads the pixels of a TIFF's first page without loss; otherwise OpenCV does.

    Raises
    ------
    ValueError
        Pixels that neither reads, or too many.
    """
    try:
        tags = _page_tags(data)
        bits, sample_formats = (set(tags.get(tag, (1,))) for tag in (_BITS, _SAMPLE_FORMAT))
        (samples,), (planes,) = tags.get(_SAMPLES, (1,)), tags.get(_PLANES, (1,))
        (width,), (height,) = tags[_WIDTH], tags[_HEIGHT]
    except Exception as error:  # broken directories raise all kinds of errors
        raise _decoding_error("TIFF") from error
    size, form = max(bits), max(sample_formats)
    is_plain = sample_formats == {1} and (size <= 8 or (size <= 16 and samples == 1))
    if is_plain and not data.startswith(b"MM\0+"):  # a big-endian BigTIFF, which Pillow does not recognise
        return True
    is_uniform = len(bits) == len(sample_formats) == 1
    opencv_keeps = is_uniform and (form, size) in _OPENCV_SAMPLE_FORMATS and (form, size, samples) != (2, 8, 4)
    if not opencv_keeps or samples not in (1, 3, 4) or (planes != 1 and samples > 1):
        raise ValueError(
            f"The image (TIFF) has {samples} × {size} bits per pixel, "
            f"{_SAMPLE_FORMAT_NAMES.get(form, 'of an unknown type')}{', in separate channels' if planes != 1 else ''}, "
            "which is not read: save it as grey, RGB or RGBA, pixel by pixel, of integers or of 32-bit floats."
        )
    check_pixels(width, height, WHAT)
    return False


_OPENCV_SAMPLE_FORMATS = {(1, 8), (2, 8), *((form, size) for form in (1, 2) for size in (16, 32, 64)), (3, 32), (3, 64)}
"""The sample formats and sizes, bits, of a TIFF that OpenCV reads without loss."""


def _as_array(image: PillowImage.Image) -> Image:
    if image.has_transparency_data and not image.mode.startswith("I"):
        image = image.convert("RGBA")
    elif image.mode not in ("1", "L", "RGB", "I", "F") and not image.mode.startswith("I;16"):
        image = image.convert("RGB")
    pixels = np.array(image)
    return pixels.astype(pixels.dtype.newbyteorder("="), copy=False)


def _decode_with_opencv(data: bytes, kind: str, mode: str = "") -> Image:
    """Return the first frame by OpenCV; Pillow keeps only 8 of 16 bits of colours, and not all types of numbers."""
    as_rgb = cv2.IMREAD_COLOR_RGB | cv2.IMREAD_ANYDEPTH | cv2.IMREAD_IGNORE_ORIENTATION
    pixels = cv2.imdecode(np.frombuffer(data, np.uint8), as_rgb if mode == "RGB" else cv2.IMREAD_UNCHANGED)
    if pixels is None:
        raise _decoding_error(kind)
    return pixels if mode == "RGB" or pixels.ndim == 2 else pixels[:, :, [2, 1, 0, 3][: pixels.shape[2]]]


def _upright(pixels: Image, image: PillowImage.Image) -> Image:
    """Undo the camera's orientation."""
    try:
        # Not `image.getexif`, which decodes a whole PNG to look for EXIF after the pixels.
        orientation = PillowImage.Image.getexif(image).get(_EXIF_ORIENTATION_TAG, 1)
    except Exception:  # broken EXIF raises all kinds of errors
        orientation = 1
    quarters, mirrored = _TURNS.get(orientation, (0, False))
    turned = np.rot90(pixels, quarters)
    return turned[:, ::-1] if mirrored else turned


# Netpbm: PBM, PGM and PPM (bits, grey and colour integers) and PFM (grey floats). Pillow cuts colours to 8 bits and
# reads most of these in Python; OpenCV does not scale them to the full range of their type, and multiplies some PFMs
# by 256.
# Formats: https://netpbm.sourceforge.net/doc/pgm.html and https://www.pauldebevec.com/Research/HDR/PFM/

_NETPBM_MAGICS = (b"P1", b"P2", b"P3", b"P4", b"P5", b"P6", b"Pf")
_COMMENT = re.compile(rb"#[^\r\n]*")
_FIELD = rb"(?:\s|#[^\r\n]*+)*+([^\s#]++)"
"""Spaces and comments, then a field."""


def parse_netpbm(data: bytes, what: str, *, as_stored: bool = False) -> npt.NDArray[Any]:
    """Return a P1 to P6 or Pf image, its integers scaled to the full range of their type, or as they are stored.

    Returns
    -------
    pixels
        (rows, cols) or, for P3 and P6, (rows, cols, 3); uint8, or uint16 if the largest value is above 255; float32
        for a PFM.

    Raises
    ------
    ValueError
        A broken header, too many or too few pixels, or, as stored, integers above the maximum in the header.
    """
    if data.startswith(b"Pf"):
        return np.ascontiguousarray(parse_pfm(data, what), dtype=np.float32)
    magic = data[:2]
    channels = 3 if magic in (b"P3", b"P6") else 1
    header = _netpbm_header(data, magic, 2 if magic in (b"P1", b"P4") else 3)
    if header is None:
        raise ValueError(f"The {what} begins like a PPM, PGM or PBM, but no size and largest value follow.")
    width, height, third, offset = header
    check_pixels(width, height, what)
    largest = _small_integer(third) if third else 1
    if not 1 <= largest <= 65535:
        raise ValueError(f"The {what} (PGM) has {largest} for its largest value; allowed are 1 to 65535.")
    dtype: np.dtype[np.unsignedinteger[Any]] = np.dtype(np.uint8 if largest < 256 else np.uint16)
    full = np.iinfo(dtype).max
    if magic == b"P4":
        packed = _binary_pixels(data, offset, np.dtype(np.uint8), (width + 7) // 8, height, what)
        pixels = 1 - np.unpackbits(packed, axis=1, count=width)
    elif magic in (b"P5", b"P6"):
        pixels = _binary_pixels(data, offset, dtype.newbyteorder(">"), width * channels, height, what)
    else:
        pixels = np.minimum(_text_pixels(data[offset:], magic, width * height * channels, what), full)
    if not as_stored:
        pixels = np.minimum(np.rint(np.arange(full + 1) * full / largest), full).astype(dtype)[pixels]
    elif pixels.max() > largest:
        raise ValueError(f"The {what} (PGM) holds {pixels.max()}, above the {largest} it announces.")
    return pixels.astype(dtype, copy=False).reshape((height, width, 3) if channels == 3 else (height, width))


def parse_pfm(data: bytes, what: str) -> npt.NDArray[np.floating[Any]]:
    """Return the (rows, cols) floats of a PFM, with a third axis for colours, top row first: a view of the file.

    The sign of the scale gives the byte order; its magnitude, which writers use in different ways, is ignored.

    Raises
    ------
    ValueError
        A broken header, too many pixels or too few bytes.
    """
    header, channels = _netpbm_header(data, data[:2], 3), 3 if data.startswith(b"PF") else 1
    if header is None:
        raise ValueError(f"The {what} is not a PFM: it must begin with Pf or PF, width, height and scale.")
    width, height, written, offset = header
    check_pixels(width, height, what)
    scale = float(written) if re.fullmatch(rb"[-+]?(\d+\.?\d*|\.\d+)([eE][-+]?\d+)?", written[:40]) else 0.0
    if scale == 0 or not np.isfinite(scale):
        shown = re.sub(r"[^-+.\w]", "?", written[:40].decode("latin-1"))
        raise ValueError(f"The {what} (PFM) has the scale {shown}; allowed are numbers other than 0.")
    pixels = _binary_pixels(data, offset, np.dtype("<f4" if scale < 0 else ">f4"), width * channels, height, what)
    return (pixels if channels == 1 else pixels.reshape(height, width, 3))[::-1]


def _netpbm_header(data: bytes, magic: bytes, count: int) -> tuple[int, int, bytes, int] | None:
    """Return width, height, the third field if `count` is 3, and the offset of the pixels after one space."""
    found = re.match(magic + rb"(?=[\s#])" + count * _FIELD + rb"(?=\s)", data[:HEADER_BYTES])
    if found is None or not (found[1].isdigit() and found[2].isdigit()):
        return None
    end = found.end()
    line_end = 2 if magic in (b"Pf", b"PF") and data[end : end + 2] == b"\r\n" else 1
    return _small_integer(found[1]), _small_integer(found[2]), found[3] if count == 3 else b"", end + line_end


def _small_integer(field: bytes) -> int:
    """Return an integer of up to nine digits, 0 for anything else."""
    return int(field) if field.isdigit() and len(field) < 10 else 0


def _binary_pixels(
    data: bytes, offset: int, dtype: np.dtype[Any], width: int, height: int, what: str
) -> npt.NDArray[Any]:
    needed, found = width * height * dtype.itemsize, len(data) - offset
    if found < needed:
        raise ValueError(f"The {what} is cut short: {width} × {height} pixels need {needed} bytes, it has {found}.")
    return np.frombuffer(data, dtype, width * height, offset).reshape(height, width)


def _text_pixels(text: bytes, magic: bytes, count: int, what: str) -> npt.NDArray[Any]:
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
    if pixels.dtype == np.uint16:
        return _png_of_16_bits(pixels)
    if pixels.ndim == 3:
        order = cv2.COLOR_RGB2BGR if pixels.shape[2] == 3 else cv2.COLOR_RGBA2BGRA
        pixels = np.asarray(cv2.cvtColor(np.ascontiguousarray(pixels), order))
    return cv2.imencode(".png", pixels)[1].tobytes()


def _png_chunk(kind: bytes, content: bytes) -> bytes:
    check = isal_zlib.crc32(content, isal_zlib.crc32(kind))
    return b"".join([struct.pack(">I", len(content)), kind, content, struct.pack(">I", check)])


def _png_of_16_bits(pixels: npt.NDArray[np.uint16]) -> bytes:
    """Return a PNG with 16 bits per channel. ISA-L takes a fifth of the time of OpenCV's zlib for the same size."""
    rows, cols, channels = *pixels.shape[:2], pixels[0, 0].size
    # Each byte is stored as its difference from the pixel before (filter 1 of ISO/IEC 15948).
    stored, step = pixels.astype(">u2").view(np.uint8).reshape(rows, -1), 2 * channels
    lines = np.ones((rows, 1 + stored.shape[1]), np.uint8)
    lines[:, 1 : 1 + step] = stored[:, :step]
    np.subtract(stored[:, step:], stored[:, :-step], out=lines[:, 1 + step :])
    header = struct.pack(">IIBBBBB", cols, rows, 16, {1: 0, 3: 2, 4: 6}[channels], 0, 0, 0)
    # A window of 512 bytes is faster, and farther back only chance repeats anything.
    body = _png_chunk(b"IDAT", isal_zlib.compress(lines.data, 1, 9))
    return _PNG_MAGIC + _png_chunk(b"IHDR", header) + body + _PNG_END


def image_tiff(image: npt.ArrayLike) -> bytes:
    """Return a grey image of floats as a TIFF with 32 bits per pixel, since a PNG stores integers only.

    Parameters
    ----------
    image
        (rows, cols) float; NaN stands for no data.

    Raises
    ------
    ValueError
        Another shape or type.
    """
    pixels = np.asarray(image)
    if pixels.ndim != 2 or pixels.dtype.kind != "f":
        raise ValueError(f"image has shape {pixels.shape} and holds {pixels.dtype}; allowed is (rows, cols) of floats.")
    stream = io.BytesIO()
    PillowImage.fromarray(pixels.astype(np.float32)).save(stream, "TIFF")
    return stream.getvalue()


def image_file(name: str, image: Image) -> tuple[str, Callable[[npt.ArrayLike], bytes]]:
    """Return the name and the writer of a file that keeps all values of an image: ``name.tif`` or ``name.png``."""
    return (f"{name}.tif", image_tiff) if image.dtype.kind == "f" else (f"{name}.png", image_png)
