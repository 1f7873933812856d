"""Pictures of one scene packed for the browser: their pixels, what can be read at each of them, and their legends."""

from __future__ import annotations

import hashlib
import json
import math
import zlib
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from stereolag.arrays import Rgb
from stereolag.figures.legends import Legend, hexadecimal
from stereolag.figures.pictures import NO_ANSWER, jpeg, png
from stereolag.typography import typeset

WIDEST = 1600
"""Px; of wider pictures every second, third … pixel is sent: no screen shows more of them side by side."""

NOTHING = -32768
"""The int16 that stands for NaN on the way to the browser."""

LONG = -128
"""The int8 that stands for a step that needs an int16, which follows elsewhere."""

FASTEST_COMPRESSION = 1


@dataclass(frozen=True)
class DepthScale:
    """What turns a disparity into metres in the browser: focal length × baseline, px·m, and doffs, px.

    `disparity_error` is how far off the disparity typically is, px; 0 leaves the uncertainty out.
    """

    focal_times_baseline: float
    doffs_px: float
    disparity_error: float


def no_depth() -> None:
    """Return None, for readings that are no disparities."""


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
        Given for disparities: returns what turns them into the depth that is read beside them.
    """

    values: npt.NDArray[Any]
    label: str = ""
    unit: str = ""
    digits: int = 2
    words: tuple[str, ...] = ()
    depth: Callable[[], DepthScale | None] = no_depth


class Figure(NamedTuple):
    """A number that belongs to a whole picture, with its unit, what it is called, and what it means."""

    label: str
    value: str
    meaning: str


@dataclass(frozen=True, eq=False)
class Picture:
    """One of several pictures of the same size.

    Attributes
    ----------
    title
        Written above it.
    pixels
        (rows, cols, 3) uint8 RGB; None of a map, whose first reading the browser shows in the :class:`Colours` that
        all maps share.
    readings
        What is written below it of the pixel under the crosshair.
    figures
        Returns what is written below it of the whole; asked for when the pixels are on their way already.
    photograph
        Sent as JPEG, a fifth of the bytes; maps stay exact.
    pickable
        Whether a click on it picks a pixel.
    thumbnail
        Whether it is small at first, and grows when it is clicked.
    alternative
        Returns what it shows, for whoever cannot see it; read after its title.
    """

    title: str
    pixels: Rgb | None
    readings: tuple[Reading, ...] = ()
    figures: Callable[[], tuple[Figure, ...]] = tuple
    photograph: bool = False
    pickable: bool = True
    thumbnail: bool = False
    alternative: Callable[[], str] = str


@dataclass(frozen=True, eq=False)
class Colours:
    """The colours that maps share: a (256, 3) uint8 palette from `low` to `high`; and the lines over all of them.

    `outlines` is the path of an SVG, px of the whole picture; "" = none. It travels on its own.
    """

    low: float
    high: float
    palette: Rgb
    outlines: str = ""


@dataclass(frozen=True)
class PackedPicture:
    """The pixels and readings of a picture on their way to the browser.

    Attributes
    ----------
    data
        After the 64 characters of the digest, four bytes (little-endian) give the length of a JSON header; the image
        and the compressed readings follow it, and the header says where.
    digest
        Tells it from all others.
    shape
        Rows and columns of the whole picture.
    step
        Every so many pixels of it were sent.
    """

    data: bytes
    digest: str
    shape: tuple[int, int]
    step: int


def packed(picture: Picture) -> PackedPicture:
    """Return the pixels and the readings of a picture as one run of bytes.

    Readings travel as int16 in units of a power of two that is below their last decimal (or what the largest of them
    needs), each as its step from the one on its left: of smooth maps most fit into a byte, and the long ones follow.

    Raises
    ------
    ValueError
        Pixels and readings of different sizes, or neither.
    """
    arrays = [*([] if picture.pixels is None else [picture.pixels]), *(one.values for one in picture.readings)]
    shapes = {array.shape[:2] for array in arrays}
    if len(shapes) != 1:
        raise ValueError(f"pixels and readings have the shapes {sorted(shapes)}; they must all have one.")
    shape = shapes.pop()
    step = -(-shape[1] // WIDEST)
    body = _Body()
    header: dict[str, Any] = {"image": None, "readings": [_reading(one, step, body) for one in picture.readings]}
    if picture.pixels is not None:
        pixels = picture.pixels[::step, ::step]
        header["image"] = body.add(jpeg(pixels) if picture.photograph else png(pixels))
        header["type"] = "image/jpeg" if picture.photograph else "image/png"
    text = json.dumps(header).encode()
    content = len(text).to_bytes(4, "little") + text + bytes(body.bytes)
    digest = hashlib.sha256(content).hexdigest()
    return PackedPicture(digest.encode() + content, digest, shape, step)


def described(
    pictures: Sequence[Picture],
    packs: Sequence[PackedPicture],
    *,
    name: str,
    colours: Colours | None = None,
    legends: Sequence[Legend] = (),
    columns: int = 3,
    hint: str = "",
) -> dict[str, Any]:
    """Return what the browser needs besides the packed pictures, ready for JSON; `name` is what they call the set.

    Raises
    ------
    ValueError
        Pictures of different sizes, or one without pixels and no colours.
    """
    if colours is None and any(picture.pixels is None for picture in pictures):
        raise ValueError("a picture has no pixels; give the colours that maps share.")
    sizes = {pack.shape for pack in packs}
    if len(sizes) != 1:
        raise ValueError(f"pictures have the sizes {sorted(sizes)}; they must all have one.")
    rows, cols = sizes.pop()
    return {
        "name": name,
        "rows": rows,
        "cols": cols,
        "step": packs[0].step,
        "columns": columns,
        "hint": hint,
        "colours": None
        if colours is None
        else {
            "low": colours.low,
            "high": colours.high,
            "palette": bytes(colours.palette.astype(np.uint8).tobytes()).hex(),
            "none": hexadecimal(NO_ANSWER),
        },
        "pictures": [
            {
                "digest": pack.digest,
                "title": one.title,
                "pickable": one.pickable,
                "thumbnail": one.thumbnail,
                "alternative": typeset(one.alternative()),
                "figures": [figure._replace(value=typeset(figure.value))._asdict() for figure in one.figures()],
                "depths": [asdict(depth) if (depth := reading.depth()) else None for reading in one.readings],
            }
            for one, pack in zip(pictures, packs, strict=True)
        ],
        "legends": [asdict(legend) for legend in legends],
    }


class _Body:
    """Bytes one after another, each run known by where it starts and how long it is."""

    def __init__(self) -> None:
        self.bytes = bytearray()

    def add(self, data: bytes) -> tuple[int, int]:
        start = len(self.bytes)
        self.bytes += data
        return start, len(data)


def _reading(reading: Reading, step: int, body: _Body) -> dict[str, Any]:
    values = reading.values[::step, ::step]
    quantum = 1.0
    if not reading.words:
        unknown = ~np.isfinite(values)
        scaled = np.where(unknown, np.float32(0), values)
        largest = float(np.abs(scaled).max(initial=0.0))
        fine_enough, to_reach = 10.0**-reading.digits, largest / -(NOTHING + 1)
        quantum = 2.0 ** max(math.floor(math.log2(fine_enough)), math.ceil(math.log2(max(to_reach, 1e-9))))
        scaled *= 1 / quantum
        values = np.rint(scaled, out=scaled).astype("<i2")
        values[unknown] = NOTHING
    else:
        values = values.astype("<i2")
    steps = np.diff(values, axis=1, prepend=np.int16(0))  # wraps around, and back when added up
    long = (steps > 127) | (steps < -127)
    short = np.where(long, np.int16(LONG), steps).astype(np.int8)
    return {
        "steps": body.add(zlib.compress(short.data, FASTEST_COMPRESSION)),
        "long_steps": body.add(zlib.compress(steps[long].data, FASTEST_COMPRESSION)),
        "rows": values.shape[0],
        "cols": values.shape[1],
        "quantum": quantum,
        "label": reading.label,
        "unit": reading.unit,
        "digits": reading.digits,
        "words": reading.words,
    }
