"""Files of disparity maps, read from untrusted bytes and written, and of confidences."""

from __future__ import annotations

import math
import os
import re
import warnings
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from stereolag.io.arrays import NPY_MAGIC, mat_arrays, npy, npz_arrays, parse_npy
from stereolag.io.images import MAX_UINT16, image_png, parse_netpbm, parse_pfm, read_image
from stereolag.io.sources import ZIP_MAGIC, Source, check_pixels, quote, read_archive, read_bytes, write_file

MAP = "disparity map"
"""Name of the map in messages."""

KITTI_SCALE = 256
"""KITTI's images of 16 bits are in units of 1/256 px."""

MIN_KITTI_PX = -0.5
"""Minimum disparity that KITTI's format takes, as 1/256 px: the sub-pixel fit may put a point at infinity there."""

_BAND_PIXELS = 2**20
"""Number of pixels that are converted at once."""


def read_disparity(source: Source, *, divisor: float | None = None) -> npt.NDArray[np.float32]:
    """Read a disparity map: PFM, EXR, FLO, PNG, PGM or TIFF of 16 or 8 bits, TIFF of floats, NPY, NPZ or MAT.

    Parameters
    ----------
    source
        A path, the bytes of the file, or a binary file object.
    divisor
        Divides the stored values to give px; below 0 for files with disparities of the opposite sign. The default is
        256 for images of 16 bits (as in KITTI and in this project's examples), 16 for arrays of int16 (as OpenCV
        returns them) and for images of 16 bits whose unknown pixels are OpenCV's (65520), and 1 for other numbers and
        for the colours of Sintel, 4 R + G / 64 + B / 16384. It is required for 8-bit integers: the data sets that use
        them differ (Middlebury 2003: 4 for quarter size; Tsukuba: 16).

    Returns
    -------
    disparity
        (rows, cols) float32, px, positive in front of infinity; NaN where the file marks a pixel as unknown: by 0 in an
        image of integers, and by 65535 at 100 pixels and more if all others are below 32768; otherwise by NaN, infinity
        or numbers from 1e9 on, by -9999 and the like, by a repeated whole number if it is the only negative one, by
        OpenCV's minDisparity - 1, also if positive, which fills a whole side of a map in 1/16 px, and if no pixel is
        marked otherwise, by a repeated whole number that alone is not below the width, or by a repeated 0 if all other
        numbers are of one sign and at least 1 px away.

    Raises
    ------
    ValueError
        An empty, damaged or unknown file, a colour image, more megapixels than the limit in force, no pixel with a
        disparity, 8-bit integers without a divisor, or a divisor of 0.
    OSError
        A path that cannot be opened.

    Examples
    --------
    >>> import stereolag as sl
    >>> from stereolag import samples
    >>> disparity = sl.read_disparity(samples.stereo_pairs()["cube"].disparity)
    >>> disparity.shape, disparity.dtype
    ((480, 640), dtype('float32'))
    >>> round(float(disparity[240, 320]), 2)  # px
    45.57
    """
    stored = read_stored_disparity(source)
    divisor = stored.divisor if divisor is None else divisor
    if divisor is None:
        raise ValueError(f"The {MAP} has 8 bits per pixel: its divisor must be given, often 1, 2, 4 or 16.")
    disparity = stored.divided(divisor)
    if divisor > 0 and np.nanmax(disparity) < 0:
        warnings.warn(
            f"All disparities of the {MAP} are below 0, behind infinity: divisor={-divisor:g} gives the other sign.",
            stacklevel=2,
        )
    return disparity


NO_DATA_VALUES = (-9999.0, -32768.0, -32767.0, -99999.0)
"""Numbers that programs write where they have no data."""

MAX_DISPARITY_PX = 1e9
"""Magnitude below which a number is a disparity: 1e10, 1e20 and the largest float32 are in use for unknown pixels."""

SINTEL_WEIGHTS_PX = (4.0, 1 / 64, 1 / 16384)
"""Disparity per level of red, green and blue in the files of MPI Sintel, px."""

MIN_PHOTO_CORRELATION = 0.6
"""Minimum magnitude of the correlation of red with green and with blue in a photograph."""

OPENCV_SCALE = 16
"""OpenCV's matchers return int16, in units of 1/16 px."""

OPENCV_UNKNOWN = 2**16 - OPENCV_SCALE
"""OpenCV's -1 px, for unknown pixels, in a PNG: the only number in such a file that is above the range of int16."""

MIN_OPENCV_FRACTIONS = 4
"""Minimum number of different sixteenths among the disparities of OpenCV's sub-pixel fit: scenes made by hand have
fewer."""

MIN_MARKED = 100
"""Minimum number of pixels of 65535, far from all others, for it to mark unknown ones: a map of KITTI may hold one."""

_EXR_MAGIC, _FLO_MAGIC = b"v/1\x01", b"PIEH"
_UNSUPPORTED = {
    b"\x89HDF": "an HDF5 file, as those of Spring (.dsp5), which is not read: save its array as .npy, by "
    "numpy.save('gt.npy', h5py.File('gt.dsp5')['disparity'][::2, ::2])",
    b"MATLAB 7.3": "a MAT file of version 7.3, which is not read: save it by save(file, '-v7')",
}
"""Unsupported files by their first bytes: what they are, and how to convert them."""


class StoredDisparity(NamedTuple):
    """A disparity map as stored in a file.

    Attributes
    ----------
    stored
        (rows, cols) numbers of any type.
    divisor
        Divides them to give px, as in :func:`read_disparity`; None for 8 bits, whose divisor is unknown.
    unknown
        The stored numbers that mark unknown pixels.
    """

    stored: npt.NDArray[Any]
    divisor: float | None
    unknown: tuple[float, ...] = ()

    def divided(self, divisor: float) -> npt.NDArray[np.float32]:
        """Return the disparities for a divisor, px, as :func:`read_disparity` does.

        Raises
        ------
        ValueError
            A divisor of 0, or a map without any disparity.
        """
        if divisor == 0 or not math.isfinite(divisor):
            raise ValueError(f"The divisor is {divisor}; allowed are numbers above 0, or below for the other sign.")
        disparity = np.empty(self.stored.shape, np.float32)
        step = max(1, _BAND_PIXELS // max(1, self.stored.shape[1]))
        # Quotients of 16-bit integers are the same in float32 as in float64 rounded to float32.
        fits_float32 = self.stored.dtype in (np.uint8, np.uint16) and float(np.float32(divisor)) == divisor
        dtype: type[np.float32 | np.float64] = np.float32 if fits_float32 else np.float64
        for first in range(0, len(disparity), step):  # in bands of rows: whole float64 copies take a lot of memory
            band = self.stored[first : first + step]
            with np.errstate(all="ignore"):  # overflow is infinite, and infinite is unknown
                quotient = np.asarray(band.astype(dtype) / np.asarray(divisor, dtype)).astype(np.float32, copy=False)
                quotient[~(np.abs(quotient) < MAX_DISPARITY_PX)] = np.nan
                for marker in self.unknown:
                    quotient[band == marker] = np.nan
            disparity[first : first + step] = quotient
        if np.isnan(disparity).all():
            raise ValueError(f"The {MAP} holds no disparity at all: every pixel is marked as unknown.")
        return disparity


def read_stored_disparity(source: Source) -> StoredDisparity:
    """Read a disparity map whose divisor may not be known yet; errors as in :func:`read_disparity`."""
    data = read_bytes(source, MAP)
    kind = next((one for one in FORMATS if data.startswith(one.magic)), IMAGES)
    for magic, description in _UNSUPPORTED.items():
        if data.startswith(magic):
            raise ValueError(f"The {MAP} is {description}.")
    stored = kind.read(data)
    if stored.ndim == 3 and stored.dtype == np.uint8 and np.ptp(stored[:, :, :3], axis=2).any():
        colours = stored[:, :, :3]
        disparity = np.where(colours.any(axis=2), colours @ np.array(SINTEL_WEIGHTS_PX), np.nan).astype(np.float32)
        # Red is the coarse part, green and blue the fraction: a photograph's colours all rise and fall together.
        red, *fractions = np.reshape(colours, (-1, 3)).T.astype(np.float64)
        together = all(
            np.abs(np.cov(red, one)[0, 1]) > MIN_PHOTO_CORRELATION * max(1e-9, float(red.std() * one.std()))
            for one in fractions
        )
        if np.nanmax(disparity) < stored.shape[1] and not together:
            return StoredDisparity(disparity, 1.0)
    if stored.ndim == 3 and stored.shape[2] in (3, 4) and (stored[:, :, :1] == stored[:, :, :3]).all():
        stored = stored[:, :, 0]  # grey, saved as colours
    if stored.ndim > 2 and kind is not IMAGES:
        stored = stored.squeeze()  # networks keep axes of length 1 for the batch and the channel
    if stored.ndim != 2:
        raise ValueError(f"The {MAP} has shape {stored.shape}; allowed is one channel, (rows, cols).")
    check_pixels(stored.shape[1], stored.shape[0], MAP)
    if kind is IMAGES and stored.dtype.kind == "u":
        if stored.dtype == np.uint16 and {*stored[stored >= 2**15]} == {OPENCV_UNKNOWN}:
            return StoredDisparity(stored, float(OPENCV_SCALE), (float(OPENCV_UNKNOWN),))
        signed = stored.view(np.int16) if stored.dtype == np.uint16 else stored
        marker = _opencv_marker(signed)
        if marker and marker[0] < 0:
            return StoredDisparity(signed, float(OPENCV_SCALE), marker)
        below = stored[stored < MAX_UINT16]
        is_full = stored.size - below.size >= MIN_MARKED and below.max(initial=0) < 2**15
        full = (float(MAX_UINT16),) if stored.dtype == np.uint16 and is_full else ()
        return StoredDisparity(stored, None if stored.dtype == np.uint8 else float(KITTI_SCALE), (0.0, *full))
    divisor = float(OPENCV_SCALE) if stored.dtype == np.int16 else 1.0
    markers = _repeated_markers(stored, divisor) or _opencv_marker(stored)
    return StoredDisparity(stored, None if stored.itemsize == 1 else divisor, (*NO_DATA_VALUES, *markers))


def _repeated_markers(stored: npt.NDArray[Any], divisor: float) -> tuple[float, ...]:
    """Return the repeated numbers by which a program marks unknown pixels, as they go with no other number of its map.

    These are the only negative one, if it is whole; and where no pixel is marked otherwise, the only one not below the
    width, beyond which nothing matches, and 0, if all others are of one sign and at least 1 px away.
    """
    with np.errstate(invalid="ignore", over="ignore"):  # float16 cannot hold -99999
        known = stored[np.isfinite(stored) & ~np.isin(stored, NO_DATA_VALUES)]
    unmarked = known.size == stored.size
    for some in (known[known < 0], known[unmarked & (known >= divisor * stored.shape[1])]):
        if 1 < some.size < known.size and some[0] % 1 == 0 and (some == some[0]).all():
            return (float(some[0]),)
    others = known[known != 0]
    if unmarked and 0 < others.size < known.size - 1 and max(others.min(), -others.max()) >= divisor:
        return (0.0,)
    return ()


def _opencv_marker(stored: npt.NDArray[Any]) -> tuple[float, ...]:
    """Return the marker of unknown pixels of OpenCV's matchers, 1 px below the search range, if the map is theirs.

    Their maps have no disparity along the left side, or along the right one if the search is behind infinity; the
    disparities are multiples of 1/16 px.
    """
    if stored.dtype != np.int16 and stored.dtype.kind != "f":
        return ()
    pixel, marker = (OPENCV_SCALE if stored.dtype == np.int16 else 1), float(stored.min())
    if not np.isfinite(stored).all() or marker % pixel or not (stored[:, [0, -1]] == marker).all(axis=0).any():
        return ()
    known = stored[stored != marker]
    fractions = np.unique(known % pixel)
    in_sixteenths = (fractions * (OPENCV_SCALE // pixel) % 1 == 0).all()
    is_opencv = len(fractions) >= MIN_OPENCV_FRACTIONS and in_sixteenths and known.min() >= marker + pixel
    return (marker,) if is_opencv else ()


def write_disparity(path: str | os.PathLike[str], disparity: npt.ArrayLike) -> None:
    """Write a disparity map; :func:`stereolag.read_disparity` reads it back.

    Parameters
    ----------
    path
        Its suffix selects the format: ``.pfm`` and ``.npy`` store any disparity as float32, ``.png`` stores 0 to
        255.99 px in steps of 1/256 px (16 bits, as in KITTI: :func:`stereolag.io.kitti_png`). An existing file is
        replaced.
    disparity
        (rows, cols), px; NaN or infinite for pixels without one.

    Raises
    ------
    ValueError
        Another suffix, an array that is not (rows, cols), or a disparity that the format cannot store; nothing is
        written then.
    OSError
        The folder does not exist, the disk is full, and so on; an existing file is left unchanged.

    Examples
    --------
    >>> import numpy as np
    >>> import stereolag as sl
    >>> sl.write_disparity("map.pfm", [[12.5, np.nan]])  # px; NaN = none
    >>> sl.read_disparity("map.pfm")
    array([[12.5,  nan]], dtype=float32)
    """
    write_map(path, disparity, MAP, {suffix: kind.write for suffix, kind in DISPARITY_FORMATS.items()})


def write_map(
    path: str | os.PathLike[str], values: npt.ArrayLike, name: str, writers: Mapping[str, Callable[..., bytes]]
) -> None:
    """Write a map by the writer for the suffix of its path."""
    target = Path(path)
    encode = writers.get(target.suffix.lower())
    if encode is None:
        raise ValueError(f"path ends in {target.suffix!r}; a {name} is written as {', '.join(writers)}.")
    write_file(target, encode(values))


def pfm(disparity: npt.ArrayLike) -> bytes:
    """Return a disparity map as a grey PFM: float32, little-endian, bottom row first.

    Parameters
    ----------
    disparity
        (rows, cols), px; NaN or infinite for pixels without one, written as +infinity, as in Middlebury's files.

    Raises
    ------
    ValueError
        An array that is not (rows, cols).

    Notes
    -----
    The header's scale is exactly -1.0. Its sign gives the byte order; its magnitude has no agreed meaning, and OpenCV
    divides by it: from a Middlebury file with the scale 0.003922 (1/255) it reads disparities 255 times too large. At
    -1.0 all readers agree. Format: https://www.pauldebevec.com/Research/HDR/PFM/
    """
    values = as_map(disparity)
    stored = np.where(np.isfinite(values), values, np.inf).astype("<f4")
    return f"Pf\n{values.shape[1]} {values.shape[0]}\n-1.0\n".encode() + stored[::-1].tobytes()


def kitti_png(disparity: npt.ArrayLike) -> bytes:
    """Return a disparity map as KITTI stores it: a 16-bit grey PNG of the disparity × 256, 0 for pixels without one.

    Parameters
    ----------
    disparity
        (rows, cols), px, from -0.5 to 255.99; NaN or infinite for pixels without one. It is rounded to 1/256 px. Values
        that would become 0, and those that the sub-pixel fit put up to half a pixel behind infinity, become
        1/256 px.

    Raises
    ------
    ValueError
        A disparity that the format cannot store, or an array that is not (rows, cols).

    Notes
    -----
    Format: the development kit of Geiger, Lenz & Urtasun, "Are we ready for autonomous driving?", CVPR 2012.
    """
    check_kitti(disparity)
    return counts_png(as_map(disparity) * KITTI_SCALE)


def check_kitti(disparity: npt.ArrayLike) -> None:
    """Refuse a disparity map that :func:`kitti_png` cannot store; much faster than trying.

    Raises
    ------
    ValueError
        As :func:`kitti_png` does.
    """
    values = as_map(disparity)
    low, high = (float(end.reduce(values, axis=None)) for end in (np.fmin, np.fmax))
    if not (math.isfinite(low) and math.isfinite(high)):
        known = values[np.isfinite(values)]
        if known.size == 0:
            return
        low, high = float(known.min()), float(known.max())
    first, last = np.rint(low * KITTI_SCALE), np.rint(high * KITTI_SCALE)
    if first < MIN_KITTI_PX * KITTI_SCALE or last > MAX_UINT16:
        raise ValueError(
            f"disparity reaches from {low:.2f} to {high:.2f} px; KITTI's PNG holds 0 to 255.99 px, "
            "PFM and NPY hold any."
        )


def as_map(numbers: npt.ArrayLike, name: str = "disparity") -> npt.NDArray[np.floating[Any]]:
    """Return a (rows, cols) map of floats; ValueError, with its name, for another shape."""
    values = np.asarray(numbers)
    if values.ndim != 2 or values.size == 0:
        raise ValueError(f"{name} has shape {values.shape}; allowed is (rows, cols) with at least one pixel.")
    return values.astype(np.float64 if values.dtype == np.float64 else np.float32, copy=False)


def _stored_image(data: bytes) -> npt.NDArray[Any]:
    if data.startswith((b"P2", b"P5")):
        return parse_netpbm(data, MAP, as_stored=True)
    try:
        return read_image(data)
    except ValueError as error:
        raise ValueError(
            f"The {MAP} cannot be read; accepted are {ACCEPTED_MAPS}. {str(error).partition('; accepted')[0]}."
        ) from error


_NAMED_MAP = re.compile("disp|gt|truth", re.IGNORECASE)
_OF_RIGHT_VIEW = re.compile(r"(?:.*[_ ])?r(?:ight)?(?:[_ ].*)?|.*Right.*|[a-zA-Z]+R", re.DOTALL)


def _stored_array(data: bytes) -> npt.NDArray[Any]:
    """Return the array of an NPY, or the map in an NPZ or MAT: the only one, or the only one named like a disparity."""
    if data.startswith(NPY_MAGIC):
        return parse_npy(data, MAP)

    arrays = (
        npz_arrays(read_archive(data), MAP)
        if data.startswith(ZIP_MAGIC)
        else mat_arrays(data, MAP, lambda shape: check_pixels(shape[-1], shape[0], MAP))
    )
    maps = [name for name, array in arrays.items() if array.squeeze().ndim == 2]
    candidates = maps if len(maps) == 1 else [name for name in maps if _NAMED_MAP.search(name)]
    candidates = [name for name in candidates if not _OF_RIGHT_VIEW.fullmatch(name)] or candidates
    if len(candidates) != 1:
        contents = ", ".join(f"{quote(name)} {array.shape}" for name, array in [*arrays.items()][:9])
        raise ValueError(
            f"The {MAP} is not the only one in its file, which holds {contents or 'no array'}: save it alone."
        )
    return arrays[candidates[0]]


def _stored_floats(data: bytes) -> npt.NDArray[Any]:
    """Return the map of a PFM or EXR, perhaps in colours, or the motion to the left of a FLO."""
    if data.startswith(_EXR_MAGIC):
        return _parse_exr(data)
    if not data.startswith(_FLO_MAGIC):
        return parse_pfm(data, MAP)
    width, height = (int(side) for side in np.frombuffer(data[4:12].ljust(8, b"\0"), "<i4"))
    check_pixels(width, height, MAP)
    if len(data) < 12 + 8 * width * height:
        raise ValueError(
            f"The {MAP} (FLO) is cut short: {width} × {height} pixels need {12 + 8 * width * height} bytes."
        )
    across, down = np.moveaxis(np.frombuffer(data, "<f4", 2 * width * height, 12).reshape(height, width, 2), 2, 0)
    if np.abs(down, where=np.abs(down) < MAX_DISPARITY_PX, out=np.zeros_like(down)).max(initial=0.0) > 1:
        raise ValueError(f"The {MAP} (FLO) holds motion down or up, which disparities of a rectified pair have not.")
    return -across


def _parse_exr(data: bytes) -> npt.NDArray[Any]:
    """Return the (rows, cols) Y or (rows, cols, 3) RGB of an OpenEXR file, decoded by FFmpeg."""
    import av  # loaded on first use, since it takes tens of megabytes

    window = data.find(b"dataWindow\0box2i\0") + 21
    left, top, right, bottom = map(int, np.frombuffer(data[window : window + 16].ljust(16, b"\0"), "<i4"))
    check_pixels(right - left + 1, bottom - top + 1, MAP)
    try:
        decoder: Any = av.CodecContext.create("exr", "r")
        frames: list[Any] = decoder.decode(av.Packet(data)) + decoder.decode(None)
        frame = frames[0]
    except (av.FFmpegError, IndexError) as error:
        raise ValueError(
            f"The {MAP} is an OpenEXR file without a channel Y or channels RGB, or damaged: save its channel as .npy."
        ) from error
    dtype, order = (
        np.dtype("<f2" if "f16" in frame.format.name else "<f4"),
        (0,) if "gray" in frame.format.name else (2, 0, 1),
    )
    planes: list[npt.NDArray[Any]] = [
        np.frombuffer(frame.planes[plane], dtype).reshape(frame.height, -1)[:, : frame.width] for plane in order
    ]
    return planes[0] if len(planes) == 1 else np.stack(planes, axis=2)


def _npy_map(disparity: npt.ArrayLike) -> bytes:
    values = as_map(disparity).astype(np.float32)
    return npy(np.where(np.isfinite(values), values, np.float32(np.nan)))


class MapFormat(NamedTuple):
    """A file format of disparity maps.

    Attributes
    ----------
    name
        Its name in messages.
    suffixes
        Suffixes of its files, in lower case; a map is written under the first.
    magic
        The possible first bytes of its files.
    read
        A function from the bytes of a file to the map as stored.
    write
        A function from a map, (rows, cols) px, NaN or infinite where unknown, to the bytes of a file.
    holds
        The disparities that it can store.
    """

    name: str
    suffixes: tuple[str, ...]
    magic: tuple[bytes, ...]
    read: Callable[[bytes], npt.NDArray[Any]]
    write: Callable[[npt.ArrayLike], bytes]
    holds: str = "any disparity"


IMAGES = MapFormat(
    "PNG, PGM or TIFF of 16 bits (÷ 256) or 8 bits (with a divisor)",
    ("png", "pgm", "tif", "tiff"),
    (b"\x89PNG", b"P2", b"P5"),
    _stored_image,
    kitti_png,
    "0 to 255 px",
)
"""The format of all image files; other kinds of images are tried with its reader too."""

FORMATS = (
    MapFormat("PFM, EXR or FLO", ("pfm", "exr", "flo"), (b"Pf", b"PF", _EXR_MAGIC, _FLO_MAGIC), _stored_floats, pfm),
    IMAGES,
    MapFormat("NPY, NPZ or MAT", ("npy", "npz", "mat"), (NPY_MAGIC, ZIP_MAGIC, b"MATLAB 5.0"), _stored_array, _npy_map),
)
"""All formats: readers, writers, uploads and the help of commands follow this list."""

ACCEPTED_MAPS = f"{', '.join(one.name for one in FORMATS[:-1])}, and {FORMATS[-1].name}"
DISPARITY_SUFFIXES = tuple(suffix for one in FORMATS for suffix in one.suffixes)
DISPARITY_FORMATS = {
    f".{one.suffixes[0]}": one for one in sorted(FORMATS, key=lambda one: one.holds != "any disparity")
}
"""The formats by the suffix under which they are written, those that store any disparity first."""


def confidence_png(confidence: npt.ArrayLike) -> bytes:
    """Return a confidence, 0..1, as a 16-bit grey PNG: × 65535, at least 1; 0 for NaN."""
    return counts_png(np.clip(np.asarray(confidence), 0, 1) * MAX_UINT16)


def counts_png(numbers: npt.NDArray[np.floating[Any]]) -> bytes:
    """Return numbers as a 16-bit grey PNG, rounded, at least 1; 0 where they are NaN or infinite."""
    counts = np.rint(numbers)
    np.maximum(counts, np.float32(1), out=counts)
    counts[~np.isfinite(numbers)] = 0
    return image_png(counts.astype(np.uint16))
