"""Pictures of one scene packed for the browser: their pixels, what can be read at each of them, and their legends."""

from __future__ import annotations

import hashlib
import json
import math
import zlib
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from typing import Any

import cv2
import numpy as np
import numpy.typing as npt

from stereolag.arrays import Rgb
from stereolag.figures.pictures import png

WIDEST = 1600
"""Px; of wider pictures every second, third … pixel is sent: no screen shows more of them side by side."""

JPEG_QUALITY = 92
NOTHING = -32768
"""The int16 that stands for NaN on the way to the browser."""

FASTEST_COMPRESSION = 1


@dataclass(frozen=True)
class DepthScale:
    """What turns a disparity into metres in the browser: focal length × baseline, px·m, and doffs, px.

    `disparity_error` is how far off the disparity typically is, px; 0 leaves the uncertainty out.
    """

    focal_times_baseline: float
    doffs_px: float
    disparity_error: float


@dataclass(frozen=True, eq=False)
class Reading:
    """What can be read at every pixel of a picture.

    Attributes
    ----------
    values
        (rows, cols) float, NaN = nothing to read; or uint8 numbers of `words`.
    label, unit, digits
        How a number is written: what stands before and after it, and its decimals.
    words
        What each uint8 stands for; an empty word is not shown.
    depth
        Given for disparities: the depth is read beside them.
    """

    values: npt.NDArray[Any]
    label: str = ""
    unit: str = ""
    digits: int = 2
    words: tuple[str, ...] = ()
    depth: DepthScale | None = None


@dataclass(frozen=True, eq=False)
class Picture:
    """One of several pictures of the same size.

    Attributes
    ----------
    title
        Written above it.
    pixels
        (rows, cols, 3) uint8 RGB.
    readings
        What is written below it of the pixel under the crosshair.
    photograph
        Sent as JPEG, a fifth of the bytes; maps stay exact.
    pickable
        Whether a click on it picks a pixel.
    """

    title: str
    pixels: Rgb
    readings: tuple[Reading, ...] = ()
    photograph: bool = False
    pickable: bool = True


@dataclass(frozen=True)
class Legend:
    """What the colours mean: a strip from `low` to `high`, or, with those left out, one word for each colour."""

    title: str
    colours: tuple[str, ...]
    words: tuple[str, ...]
    strip: bool


def strip_legend(title: str, low: float, high: float, palette: Rgb) -> Legend:
    """Return the legend of a (256, 3) palette that runs from `low` to `high`."""
    return Legend(title, tuple(hexadecimal(colour) for colour in palette[::17]), (f"{low:g}", f"{high:g}"), True)


def word_legend(title: str, colours: Sequence[str], words: Sequence[str]) -> Legend:
    """Return the legend of colours, as CSS writes them, that each stand for a word."""
    return Legend(title, tuple(colours), tuple(words), False)


def hexadecimal(colour: Sequence[int] | npt.NDArray[np.uint8]) -> str:
    """Return an RGB colour as #rrggbb."""
    return "#{:02x}{:02x}{:02x}".format(*(int(part) for part in colour))


def packed(
    pictures: Sequence[Picture], *, name: str, legends: Sequence[Legend] = (), columns: int = 3, hint: str = ""
) -> bytes:
    """Return everything the browser needs as one run of bytes; `name` is what marks on the pictures call them.

    Four bytes (little-endian) give the length of a JSON header; the images and the compressed readings follow it, and
    the header says where. Readings travel as int16 in units of a power of two that is below their last decimal (or what
    the largest of them needs), each as its difference from the one on its left: smooth maps then pack well.

    Raises
    ------
    ValueError
        Pictures or readings of different sizes.
    """
    rows, cols = pictures[0].pixels.shape[:2]
    sizes = {part.shape[:2] for one in pictures for part in (one.pixels, *(r.values for r in one.readings))}
    if sizes != {(rows, cols)}:
        raise ValueError(f"pictures and readings have the sizes {sorted(sizes)}; they must all have one.")
    step = -(-cols // WIDEST)
    body = _Body()
    header = {
        "name": name,
        "rows": rows,
        "cols": cols,
        "step": step,
        "columns": columns,
        "hint": hint,
        "pictures": [_picture(one, step, body) for one in pictures],
        "legends": [asdict(legend) for legend in legends],
    }
    header["digest"] = hashlib.sha256(json.dumps(header).encode() + body.bytes).hexdigest()
    text = json.dumps(header).encode()
    return len(text).to_bytes(4, "little") + text + bytes(body.bytes)


class _Body:
    """Bytes one after another, each run known by where it starts and how long it is."""

    def __init__(self) -> None:
        self.bytes = bytearray()

    def add(self, data: bytes) -> tuple[int, int]:
        start = len(self.bytes)
        self.bytes += data
        return start, len(data)


def _picture(picture: Picture, step: int, body: _Body) -> dict[str, Any]:
    pixels = picture.pixels[::step, ::step]
    return {
        "title": picture.title,
        "pickable": picture.pickable,
        "type": "image/jpeg" if picture.photograph else "image/png",
        "image": body.add(_jpeg(pixels) if picture.photograph else png(pixels)),
        "readings": [_reading(reading, step, body) for reading in picture.readings],
    }


def _reading(reading: Reading, step: int, body: _Body) -> dict[str, Any]:
    values = reading.values[::step, ::step]
    quantum = 1.0
    if not reading.words:
        known = np.isfinite(values)
        largest = float(np.abs(values[known]).max(initial=0.0))
        fine_enough, to_reach = 10.0**-reading.digits, largest / -(NOTHING + 1)
        quantum = 2.0 ** max(math.floor(math.log2(fine_enough)), math.ceil(math.log2(max(to_reach, 1e-9))))
        values = np.where(known, np.rint(np.where(known, values, 0) / quantum), NOTHING)
    steps = np.diff(values.astype("<i2"), axis=1, prepend=np.int16(0))  # wraps around, and back when added up
    return {
        "values": body.add(zlib.compress(steps.tobytes(), FASTEST_COMPRESSION)),
        "cols": values.shape[1],
        "quantum": quantum,
        "label": reading.label,
        "unit": reading.unit,
        "digits": reading.digits,
        "words": reading.words,
        "depth": asdict(reading.depth) if reading.depth else None,
    }


def _jpeg(pixels: Rgb) -> bytes:
    bgr = cv2.cvtColor(np.ascontiguousarray(pixels), cv2.COLOR_RGB2BGR)
    _, data = cv2.imencode(".jpg", bgr, [cv2.IMWRITE_JPEG_QUALITY, JPEG_QUALITY])
    return data.tobytes()
