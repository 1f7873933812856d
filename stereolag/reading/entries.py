"""The entries of a calibration file, by name, and checked access to them."""

from __future__ import annotations

from typing import TypeAlias

import numpy as np
import numpy.typing as npt

from stereolag.reading.sources import quoted

Matrix: TypeAlias = npt.NDArray[np.float64]
Entries: TypeAlias = dict[str, Matrix | str]
"""Arrays of finite numbers (a number alone has shape (1,)), or text."""

MAX_SIDE = 100_000
MAX_NUMBER = 1e12
"""No focal length, length or coefficient of a camera comes near; what is computed from such numbers stays finite."""


def optional_number(entries: Entries, *names: str) -> float | None:
    """Return the number under the first of `names` that is there, None where none is."""
    name = next((name for name in names if name in entries), None)
    return None if name is None else float(_numbers(entries, name, 1)[0])


def required_number(entries: Entries, name: str) -> float:
    """Return the number under `name`, which must be there."""
    number = optional_number(entries, name)
    if number is None:
        raise ValueError(f"The calibration has no {name}; it is needed to turn disparity into metres.")
    return number


def optional_count(entries: Entries, *names: str) -> int | None:
    """Return the whole number from 1 under the first of `names` that is there, None where none is."""
    number = optional_number(entries, *names)
    if number is None:
        return None
    if not 1 <= number <= MAX_SIDE:
        raise ValueError(f"The calibration has {number:g} for {names[0]}; allowed are 1 to {MAX_SIDE}.")
    return round(number)


def matrix(entries: Entries, name: str, shape: tuple[int, int]) -> Matrix:
    """Return the numbers under `name` in `shape`."""
    return _numbers(entries, name, shape[0] * shape[1]).reshape(shape)


def vector(entries: Entries, name: str | None) -> Matrix:
    """Return all the numbers under `name` in a row, none at all where there is no such name."""
    return np.zeros(0) if name is None else _numbers(entries, name).ravel()


def image_size(entries: Entries) -> tuple[int | None, int | None]:
    """Return the width and the height of the images, px, under whichever of their usual names."""
    for name in ("image_size", "imageSize"):
        if name in entries:
            width, height = _numbers(entries, name, 2)
            entries = {"width": np.array([width]), "height": np.array([height])}
    return (
        optional_count(entries, "width", "image_width", "imageWidth"),
        optional_count(entries, "height", "image_height", "imageHeight"),
    )


def _numbers(entries: Entries, name: str, count: int | None = None) -> Matrix:
    numbers = entries[name]
    if isinstance(numbers, str):
        raise ValueError(f"{quoted(name)} in the calibration must hold numbers, not {quoted(numbers)}.")
    if not np.isfinite(numbers).all():
        raise ValueError(f"{quoted(name)} in the calibration must hold finite numbers only.")
    largest = max(numbers.flat, key=abs, default=0.0)
    if abs(largest) > MAX_NUMBER:
        raise ValueError(
            f"{quoted(name)} in the calibration holds {largest:g}; allowed are numbers from -{MAX_NUMBER:g} to "
            f"{MAX_NUMBER:g}."
        )
    if count is not None and numbers.size != count:
        raise ValueError(f"{quoted(name)} in the calibration must hold {count} numbers; it holds {numbers.size}.")
    return numbers.ravel()
