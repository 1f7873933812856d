"""Pictures of one scene with a common crosshair: zoomed together, read under the pointer, clickable.

Everything that follows the pointer happens in the browser; only a click comes back.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from typing import Any

import cv2
import numpy as np
import streamlit as st
from isal import isal_zlib

from stereolag.core.arrays import Array, Rgb
from stereolag.core.typography import typeset
from stereolag.figures.legends import Colours, Legend
from stereolag.figures.pictures import NO_ANSWER, jpeg, png
from stereolag.ui.components import component, deliver, packed_item
from stereolag.ui.elements import Number

MAX_SENT_WIDTH = 1600
"""Width of a picture above which only every second, third … pixel is sent, px: no screen shows more side by side."""

NAN_CODE = -32768
"""The int16 that stands for NaN in data for the browser."""

LONG_STEP_CODE = -128
"""The int8 that stands for a step that needs an int16, which is stored separately."""


@dataclass(frozen=True)
class DepthScale:
    """Constants to convert disparity to metres in the browser: focal length × baseline, px·m, and doffs, px.

    `disparity_error` is the typical error of a disparity, px; with 0 no uncertainty is shown.
    """

    focal_times_baseline: float
    doffs_px: float
    disparity_error: float


@dataclass(frozen=True, eq=False)
class Reading:
    """A value or word to read at every pixel of a picture.

    Attributes
    ----------
    values
        (rows, cols) float, NaN = nothing to read; or uint8 indices into `words`.
    label, unit, digits
        Text before a number, text after it, and number of decimals.
    words
        The word for each index; an empty word is not shown.
    depth
        For disparities: returns the scale of the depths shown beside them.
    """

    values: Array
    label: str = ""
    unit: str = ""
    digits: int = 2
    words: tuple[str, ...] = ()
    depth: Callable[[], DepthScale | None] = lambda: None


@dataclass(frozen=True, eq=False)
class Picture:
    """One of several pictures of the same size.

    Attributes
    ----------
    title
        Title above the picture.
    pixels
        (rows, cols, 3) uint8 RGB; None for a map: the browser colours its first reading with the :class:`Colours` that
        all maps share.
    readings
        Values shown below the picture for the pixel under the crosshair.
    figures
        Numbers shown below it for the whole picture.
    photograph
        Whether it is sent as a JPEG, with a fifth of the bytes; maps stay exact.
    pickable
        Whether a click on it picks a pixel.
    thumbnail
        Whether it is initially small and is enlarged by a click.
    alternative
        Returns its text alternative, which is read out after the title.
    """

    title: str
    pixels: Rgb | None
    readings: tuple[Reading, ...] = ()
    figures: tuple[Number, ...] = ()
    photograph: bool = False
    pickable: bool = True
    thumbnail: bool = False
    alternative: Callable[[], str] = str


@dataclass(frozen=True)
class PackedPicture:
    """The pixels and readings of a picture, encoded for the browser.

    Attributes
    ----------
    data
        An item with the image and the compressed readings as its parts.
    digest
        Identifies the content.
    shape
        Rows and columns of the whole picture.
    step
        Every `step`-th pixel was sent.
    """

    data: bytes
    digest: str
    shape: tuple[int, int]
    step: int


@dataclass(frozen=True)
class Mark:
    """A mark drawn over the pictures: a point, a frame, or a line to another point; lengths in px of the picture.

    Attributes
    ----------
    row, col
        The pixel of a point or of the start of a line, or the top-left pixel of a frame.
    colour
        CSS colour.
    label
        Text beside it.
    height, width
        The size of a frame.
    to
        (row, col) of the pixel where a line ends.
    dashed, filled
        Whether its line is dashed, and whether a frame is tinted inside.
    pictures
        Indices of the pictures it is drawn on; empty means all.
    """

    row: int
    col: int
    colour: str
    label: str = ""
    height: int = 0
    width: int = 0
    to: tuple[int, int] | None = None
    dashed: bool = False
    filled: bool = False
    pictures: tuple[int, ...] = ()


def packed(picture: Picture, more: Mapping[str, Any] | None = None) -> PackedPicture:
    """Return the pixels and the readings of a picture as an item, with `more` in its header.

    Readings are int16 in units of a power of two below their last decimal (or larger if the range requires it). Each is
    stored as the step from its left neighbour: in smooth maps most steps fit into a byte; longer ones are stored
    separately.

    Raises
    ------
    ValueError
        If pixels and readings differ in size, or there are neither.
    """
    arrays = picture.pixels, *(one.values for one in picture.readings)
    shapes = {array.shape[:2] for array in arrays if array is not None}
    if len(shapes) != 1:
        raise ValueError(f"pixels and readings have the shapes {sorted(shapes)}; they must all have one.")
    shape = shapes.pop()
    step = -(-shape[1] // MAX_SENT_WIDTH)
    parts: list[bytes] = []
    header: dict[str, Any] = {"kind": "pictures", "image": None, **(more or {})}
    header["readings"] = [_reading(one, step, parts) for one in picture.readings]
    if picture.pixels is not None:
        pixels = picture.pixels[::step, ::step]
        header |= {"image": len(parts), "type": "image/jpeg" if picture.photograph else "image/png"}
        parts.append(jpeg(pixels) if picture.photograph else png(pixels))
    return PackedPicture(*packed_item(header, parts), shape, step)


def described(
    pictures: Sequence[Picture],
    packs: Sequence[PackedPicture],
    *,
    name: str,
    colours: Colours | None = None,
    legends: Sequence[Legend] = (),
    columns: int = 3,
    hint: str = "",
    marks: Sequence[Mark] = (),
) -> dict[str, Any]:
    """Return the header of the item that describes a set of packed pictures of one size, ready for JSON.

    `name` identifies the set; `colours` are needed if a picture has no pixels.
    """
    return {
        "kind": "description",
        "name": name,
        "rows": packs[0].shape[0],
        "cols": packs[0].shape[1],
        "step": packs[0].step,
        "columns": columns,
        "hint": hint,
        "colours": None
        if colours is None
        else {
            "low": colours.low,
            "high": colours.high,
            "palette": colours.palette[:, ::-1].astype(np.uint8).tobytes().hex(),  # bbggrr, as pixels lie in memory
            "none": bytes(reversed(NO_ANSWER)).hex(),
        },
        "pictures": [
            {
                "digest": pack.digest,
                "title": one.title,
                "pickable": one.pickable,
                "thumbnail": one.thumbnail,
                "alternative": typeset(one.alternative()),
                "figures": [figure._replace(value=typeset(figure.value))._asdict() for figure in one.figures],
                "depths": [asdict(depth) if (depth := reading.depth()) else None for reading in one.readings],
            }
            for one, pack in zip(pictures, packs, strict=True)
        ],
        "legends": [asdict(legend) for legend in legends],
        "marks": [asdict(mark) for mark in marks],
        "outlines": colours.outlines if colours else "",
    }


def _reading(reading: Reading, step: int, parts: list[bytes]) -> dict[str, Any]:
    """Add the values of a reading to the parts, and return its description."""
    values = reading.values[::step, ::step]
    quantum = 1.0
    if not reading.words:
        known = np.isfinite(values)
        scaled = cv2.copyTo(np.ascontiguousarray(values), known.view(np.uint8))  # 0 elsewhere
        fine_enough, to_reach = 10.0**-reading.digits, cv2.norm(scaled, cv2.NORM_INF) / -(NAN_CODE + 1)
        quantum = 2.0 ** max(math.floor(math.log2(fine_enough)), math.ceil(math.log2(max(to_reach, 1e-9))))
        values = cv2.addWeighted(scaled, 1 / quantum, scaled, 0, 0, dtype=cv2.CV_16S)
        np.copyto(values, NAN_CODE, where=~known)
    else:
        values = values.astype("<i2")
    steps = np.diff(values, axis=1, prepend=np.int16(0))  # int16 overflow cancels when the steps are summed
    long = (steps > 127) | (steps < -127)
    short = steps.astype(np.int8)
    np.copyto(short, LONG_STEP_CODE, where=long)
    parts.extend(isal_zlib.compress(one.data, 1, 9) for one in (short, steps[long]))
    return {
        "steps": len(parts) - 2,
        "long_steps": len(parts) - 1,
        "rows": values.shape[0],
        "cols": values.shape[1],
        "quantum": quantum,
        "label": reading.label,
        "unit": reading.unit,
        "digits": reading.digits,
        "words": reading.words,
    }


def send_picture(pack: PackedPicture, title: str, *, key: str) -> None:
    """Send the pixels and readings of one picture of :func:`linked_pictures`, ahead of its description.

    In the browser it replaces the picture shown with this title.
    """
    deliver(pack.data, key=f"{key}.picture.{title}")


def linked_pictures(
    pictures: Sequence[Picture],
    *,
    key: str,
    colours: Colours | None = None,
    legends: Sequence[Legend] = (),
    columns: int = 3,
    hint: str = "",
    marks: Sequence[Mark] = (),
    on_pick: Callable[[int, int], None] | None = None,
    pack: Callable[[Picture], PackedPicture] = packed,
    sent: Mapping[str, PackedPicture] | None = None,
) -> None:
    """Show pictures of one size.

    Parameters
    ----------
    pictures, legends
        The pictures, and the legends of their colours.
    key
        Key of the component.
    colours
        Colours of the pictures without pixels, and the outlines over them.
    columns
        Number of pictures side by side, if there is room.
    hint
        Sentence below the pictures, before the one on zooming and moving.
    marks
        Marks drawn over the pictures; while no pointer is over the pictures, the readings of the last point are shown.
    on_pick
        Called with the row and column of a clicked pixel, before the fragment reruns; if None, clicks do nothing.
    pack
        Packs a picture; callers may pass a function that caches the packed pictures.
    sent
        Pictures that :func:`send_picture` already sent in this run, by title.
    """

    def picked() -> None:
        pixel = st.session_state[key].picked
        if on_pick and pixel is not None:
            on_pick(int(pixel["row"]), int(pixel["col"]))

    if on_pick is None:
        pictures = [replace(picture, pickable=False) for picture in pictures]
    packs = []
    with st.container(gap=None):
        for picture in pictures:
            sent_before = (sent or {}).get(picture.title)
            packs.append(sent_before or pack(picture))
            if not sent_before:
                send_picture(packs[-1], picture.title, key=key)
        description = described(
            pictures, packs, name=key, colours=colours, legends=legends, columns=columns, hint=hint, marks=marks
        )
        deliver(packed_item(description).data, key=f"{key}.description")
        # The same in every run: its script is sent once.
        component("linked_pictures")(key=key, data=key, on_picked_change=picked)
