"""Marks drawn by hand in the browser: a box in an image, and a mask painted over a template."""

from __future__ import annotations

import base64
import binascii
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Final

import numpy as np
import numpy.typing as npt

LEAST_SIDE: Final = 4
"""Px; a smaller template fits nearly everywhere."""


@dataclass(frozen=True)
class Box:
    """A part of an image, px.

    Attributes
    ----------
    row, col
        The top-left pixel.
    height, width
        The size.
    """

    row: int
    col: int
    height: int
    width: int

    @property
    def slices(self) -> tuple[slice, slice]:
        """The rows and columns of the box."""
        return slice(self.row, self.row + self.height), slice(self.col, self.col + self.width)


def read_box(value: object, image_shape: tuple[int, ...]) -> Box:
    """Return the box described by {"row", "col", "height", "width"}.

    Raises
    ------
    ValueError
        Anything but four whole numbers, sides below :data:`LEAST_SIDE`, or a box that leaves the image.
    """
    names = ("row", "col", "height", "width")
    if not isinstance(value, Mapping) or set(value) != set(names):
        raise ValueError("The box needs a row, a column, a height and a width.")
    numbers: dict[str, Any] = {name: value[name] for name in names}
    for name, number in numbers.items():
        whole = isinstance(number, int) or (isinstance(number, float) and number.is_integer())
        if isinstance(number, bool) or not whole:
            raise ValueError(f"The {name} of the box must be a whole number of pixels.")
    box = Box(**{name: int(number) for name, number in numbers.items()})
    rows, cols = image_shape[:2]
    if min(box.height, box.width) < LEAST_SIDE:
        raise ValueError(
            f"The box is {_short(box.width)} × {_short(box.height)} pixels; it needs at least {LEAST_SIDE} × "
            f"{LEAST_SIDE}."
        )
    if box.row < 0 or box.col < 0 or box.row + box.height > rows or box.col + box.width > cols:
        raise ValueError(
            f"The box of {_short(box.width)} × {_short(box.height)} pixels at row {_short(box.row)}, column "
            f"{_short(box.col)} extends beyond the image of {cols} × {rows}."
        )
    return box


def _short(number: int) -> str:
    return str(number) if abs(number) < 10**9 else "a huge number of"


def packed_mask(mask: npt.NDArray[Any]) -> str:
    """Return a mask as base64 text: one bit per pixel, row by row, 1 for pixels that count."""
    return base64.b64encode(np.packbits(mask > 0).tobytes()).decode("ascii")


def read_packed_mask(value: object, shape: tuple[int, int]) -> npt.NDArray[np.uint8]:
    """Return the mask encoded by :func:`packed_mask`, 255 where the template counts and 0 elsewhere.

    Parameters
    ----------
    value
        The text. Its length is checked before it is decoded.
    shape
        (height, width) of the template.

    Raises
    ------
    ValueError
        Not such a text for that size, or a mask with fewer than two pixels that count.
    """
    height, width = shape
    size = -(-height * width // 8)
    wrong = f"The painted mask does not have {width} × {height} pixels."
    if not isinstance(value, str) or len(value) != 4 * -(-size // 3):
        raise ValueError(wrong)
    try:
        data = base64.b64decode(value, validate=True)
    except (binascii.Error, ValueError):
        raise ValueError(wrong) from None
    if len(data) != size:
        raise ValueError(wrong)
    bits = np.unpackbits(np.frombuffer(data, dtype=np.uint8), count=height * width)
    if int(bits.sum()) < 2:
        raise ValueError("Everything is painted over; at least 2 pixels must count.")
    return bits.reshape(height, width) * np.uint8(255)
