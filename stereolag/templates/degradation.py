"""A part of an image made harder to search: dull, noisy, turned, resized, covered."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import cv2
import numpy as np
import numpy.typing as npt
from pydantic import Field

from stereolag.core.inputs import Image, grey_level
from stereolag.core.settings import Settings

LEAST_ROWS, LEAST_COLS = 480, 640
"""The part is at least this large, px, and at least twice as large as the template, unless the image is smaller."""


class Degradation(Settings):
    """Changes made to the image, in this order: resize and turn, contrast and brightness, cover, noise."""

    contrast: float = Field(
        default=1.0,
        title="Contrast",
        description="1 leaves the image as it is; at 0.1 all values are close to their mean.",
        ge=0.1,
        le=1,
        json_schema_extra={"step": 0.05},
    )
    brightness: int = Field(
        default=0, title="Brightness", description="Grey levels of 255 added to every pixel.", ge=-120, le=120
    )
    noise: int = Field(
        default=0,
        title="Noise",
        description="Standard deviation of Gaussian noise added to every pixel, grey levels of 255.",
        ge=0,
        le=120,
    )
    turn: float = Field(
        default=0.0,
        title="Turn, degrees",
        description="The image is turned about the template’s centre, counter-clockwise.",
        ge=-45,
        le=45,
        json_schema_extra={"step": 1.0},
    )
    resize: float = Field(
        default=1.0,
        title="Resize",
        description="The image grows or shrinks about the template’s centre by this factor.",
        ge=0.5,
        le=2,
        json_schema_extra={"step": 0.05},
    )
    cover: float = Field(
        default=0.0,
        title="Cover",
        description="Share of the template’s area that a grey box hides, from the bottom up.",
        ge=0,
        le=1,
        json_schema_extra={"step": 0.05},
    )


@dataclass(frozen=True, eq=False)
class DegradedPart:
    """A part of an image after a :class:`Degradation`.

    Attributes
    ----------
    pixels
        (rows, cols) or (rows, cols, 3), of the image's dtype.
    top, left
        Position of its first pixel in the image, px, if nothing is turned or resized.
    row, col
        Top-left pixel, within the part, of a window of the template's size centred on the template.
    """

    pixels: Image
    top: int
    left: int
    row: int
    col: int


def degraded_part(
    image: Image, place: tuple[int, int], shape: tuple[int, int], degradation: Degradation
) -> DegradedPart:
    """Cut out the part of an image around a template's place and degrade it, leaving the template's centre in place.

    Parameters
    ----------
    image
        (rows, cols) or (rows, cols, 3 | 4), checked; its alpha is dropped.
    place
        (row, col) of the template's top-left pixel.
    shape
        (height, width) of the template, px.
    degradation
        Changes to make; the noise is always the same. With all of them at their defaults, no pixel changes.

    Raises
    ------
    ValueError
        A place at which the template is not inside the image.
    """
    (row, col), (height, width) = place, shape
    if row < 0 or col < 0 or row + height > image.shape[0] or col + width > image.shape[1]:
        raise ValueError(
            f"A template of {width} × {height} pixels at row {row}, column {col} does not lie within an image of "
            f"{image.shape[1]} × {image.shape[0]}."
        )
    colours = image[:, :, :3] if image.ndim == 3 else image
    high, wide = part_shape(image.shape, shape)[:2]
    rows, cols = _around(row, height, high, image.shape[0]), _around(col, width, wide, image.shape[1])
    inside = row - rows.start, col - cols.start
    if degradation.turn == 0 and degradation.resize == 1:
        part = colours[rows, cols]
    else:
        part = _warped(colours, rows, cols, (row + (height - 1) / 2, col + (width - 1) / 2), degradation)
    return DegradedPart(
        _altered(part, inside, shape, grey_level(colours, colours), degradation), rows.start, cols.start, *inside
    )


def part_shape(image_shape: tuple[int, ...], shape: tuple[int, int]) -> tuple[int, ...]:
    """Return the shape of the part of an image (rows, cols[, channels]) around a template of (height, width)."""
    rows, cols = min(max(LEAST_ROWS, 2 * shape[0]), image_shape[0]), min(max(LEAST_COLS, 2 * shape[1]), image_shape[1])
    return (rows, cols, 3) if len(image_shape) == 3 else (rows, cols)


def _around(first: int, length: int, wanted: int, end: int) -> slice:
    """Return `wanted` pixels centred on the `length` pixels from `first` on, moved or cut to stay within 0 … `end`."""
    start = min(max(0, first + length // 2 - wanted // 2), end - wanted)
    return slice(start, start + wanted)


def _warped(
    image: Image, rows: slice, cols: slice, centre: tuple[float, float], degradation: Degradation
) -> npt.NDArray[Any]:
    """Return the part in `rows` and `cols` turned and resized about `centre` (row, col), its rim mirrored."""
    reach = math.hypot(rows.stop - rows.start, cols.stop - cols.start) / degradation.resize
    # Only the visible area is passed on: OpenCV refuses to warp images of more than 32767 pixels a side.
    top, left = (max(0, math.floor(middle - reach)) for middle in centre)
    source = np.ascontiguousarray(image[top : math.ceil(centre[0] + reach), left : math.ceil(centre[1] + reach)])
    # Maps a pixel (x, y) of the part to the place in the source that it shows; y points down.
    turn = math.radians(degradation.turn)
    cosine, sine = math.cos(turn) / degradation.resize, math.sin(turn) / degradation.resize
    linear = np.array([[cosine, -sine], [sine, cosine]])
    middle = np.array([centre[1], centre[0]])
    offset = middle - (left, top) - linear @ (middle - (cols.start, rows.start))
    size = cols.stop - cols.start, rows.stop - rows.start
    flags = cv2.INTER_LINEAR | cv2.WARP_INVERSE_MAP
    return np.asarray(
        cv2.warpAffine(source, np.column_stack((linear, offset)), size, flags=flags, borderMode=cv2.BORDER_REFLECT_101)
    )


def _altered(
    part: npt.NDArray[Any], inside: tuple[int, int], shape: tuple[int, int], level: float, degradation: Degradation
) -> Image:
    """Return a part with its contrast and brightness changed, covered, and with noise, in its own dtype.

    `level` is one grey level of 255 in the part's units.
    """
    values = part.astype(np.float64)
    mean = float(values.mean())
    if degradation.contrast != 1 or degradation.brightness:
        values = (values - mean) * degradation.contrast + mean + degradation.brightness * level
    if degradation.cover:
        (row, col), (height, width) = inside, shape
        middle_row, middle_col = row + height / 2, col + width / 2
        half_rows, half_cols = height * degradation.resize / 2, width * degradation.resize / 2
        first = middle_row + half_rows - 2 * half_rows * degradation.cover
        box = (
            slice(max(0, round(first)), max(0, round(middle_row + half_rows))),
            slice(max(0, round(middle_col - half_cols)), max(0, round(middle_col + half_cols))),
        )
        values[box] = mean + degradation.brightness * level
    if degradation.noise:
        values += np.random.default_rng(0).normal(0, degradation.noise * level, values.shape)
    if part.dtype.kind == "u":
        values = np.clip(np.rint(values), 0, np.iinfo(part.dtype).max)
    return values.astype(part.dtype)
