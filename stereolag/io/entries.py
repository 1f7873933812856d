"""The entries of a calibration file, by name, and checked access to them."""

from __future__ import annotations

import math
import re
from collections.abc import Iterator
from typing import Any, TypeAlias

import numpy as np
import numpy.typing as npt

from stereolag.io.sources import quoted

Matrix: TypeAlias = npt.NDArray[np.float64]
Entries: TypeAlias = dict[str, Matrix | str]
"""Arrays of numbers (a single number has shape (1,)), or text."""

MAX_DEPTH = 16
MAX_SIDE = 100_000
MAX_NUMBER = 1e12
"""No focal length, length or coefficient of a camera comes near it; results computed from such numbers stay finite."""

_MATRIX_KEYS = {"rows", "cols", "data"}
_ARRAY_KEYS = {"sizes", "data"}
"""The keys that OpenCV 5 writes for an array of one row."""
_NO_NUMBERS = np.array([np.nan])
"""Placeholder for a list that is not an array of numbers, refused only if it is used."""


def flattened(tree: Any) -> Entries:
    """Return the leaves of a tree of dictionaries and lists by their paths: ``left.camera_matrix``.

    Raises
    ------
    ValueError
        More than 16 levels, or a matrix (rows, cols, data) with another number of values than it announces.
    """
    return {name: value for name, value in _leaves("", tree, 0) if name}


def value_of(text: str) -> Matrix | str:
    """Return the numbers in a text as a vector; the text itself if it contains anything else."""
    tokens = re.split(r"[\s,]+", text.strip())
    try:
        return np.array([_float(token) for token in tokens])
    except ValueError:
        return text.strip()


def names_found(entries: Entries) -> str:
    """Return the first names in words, harmless in an error shown as Markdown or HTML."""
    shown = [re.sub(r"[^\w.+-]", "?", name[:24]) for name in list(entries)[:6]]
    if not shown:
        return "no names with values"
    return ", ".join(shown) + (f" and {len(entries) - len(shown):,} more" if len(entries) > len(shown) else "")


def _leaves(name: str, tree: Any, depth: int) -> Iterator[tuple[str, Matrix | str]]:
    if depth > MAX_DEPTH:
        raise ValueError(f"The calibration is nested more than {MAX_DEPTH} levels deep.")
    if isinstance(tree, dict):
        if set(tree) >= _MATRIX_KEYS:
            yield name, _announced(name, tree["data"], [tree["rows"], tree["cols"]])
            return
        if set(tree) >= _ARRAY_KEYS:
            yield name, _announced(name, tree["data"], tree["sizes"])
            return
        inside = {str(key): value for key, value in tree.items()}
    elif isinstance(tree, list) and any(isinstance(item, dict) for item in tree):
        inside = {str(number): item for number, item in enumerate(tree)}
    else:
        if tree is not None and not isinstance(tree, bool) and tree != "":
            yield name, _value(tree)
        return
    for key, value in inside.items():
        yield from _leaves(f"{name}.{key}" if name else key, value, depth + 1)


def _array(value: Any) -> Matrix:
    if isinstance(value, list) and value and all(isinstance(item, str) for item in value):
        # From YAML and XML; if a comma is missing at the end of a line, two numbers are one item.
        numbers = value_of(" ".join(value))
        return _NO_NUMBERS if isinstance(numbers, str) else numbers
    try:
        return np.atleast_1d(np.array(value, dtype=np.float64))
    except (TypeError, ValueError, OverflowError, RecursionError):
        return _NO_NUMBERS


def _float(token: str) -> float:
    """Return the number in a text, including those that YAML writes differently from Python."""
    return float(token.replace(".", "", 1) if token.lower().lstrip("+-") in (".nan", ".inf") else token)


def _value(leaf: Any) -> Matrix | str:
    return value_of(leaf) if isinstance(leaf, str) else _array(leaf)


def _announced(name: str, data: Any, sizes: Any) -> Matrix:
    """Return an array in the shape announced by its file."""
    values, shape = _value(data), _value(sizes)
    if isinstance(values, str) or isinstance(shape, str):
        return _NO_NUMBERS
    if not (np.isfinite(shape).all() and np.isfinite(values).all()):
        return _NO_NUMBERS
    if not ((shape >= 0) & (shape <= values.size)).all() or math.prod(map(int, shape.flat)) != values.size:
        announced = " × ".join(f"{side:g}" for side in list(shape.flat)[:3])
        raise ValueError(f"{quoted(name)} in the calibration announces {announced} numbers and holds {values.size}.")
    return values.reshape([int(side) for side in shape.flat])


def optional_number(entries: Entries, *names: str) -> float | None:
    """Return the number under the first of `names` that exists, None if none does."""
    name = next((name for name in names if name in entries), None)
    return None if name is None else float(_numbers(entries, name, 1)[0])


def required_number(entries: Entries, *names: str) -> float:
    """Return the number under the first of `names` that exists; one of them must."""
    number = optional_number(entries, *names)
    if number is None:
        raise ValueError(
            f"The calibration has no {names[0]}; it is needed to turn disparity into metres. It has "
            f"{names_found(entries)}."
        )
    return number


def optional_count(entries: Entries, *names: str) -> int | None:
    """Return the whole number from 1 under the first of `names` that exists, None if none does."""
    number = optional_number(entries, *names)
    return None if number is None else counted(number, names[0])


def counted(number: float, name: str) -> int:
    """Return a number from 1 to `MAX_SIDE`, rounded to a whole one."""
    if not 1 <= number <= MAX_SIDE:
        raise ValueError(f"The calibration has {number:g} for {quoted(name)}; allowed are 1 to {MAX_SIDE}.")
    return round(number)


def matrix(entries: Entries, name: str, shape: tuple[int, int]) -> Matrix:
    """Return the numbers under `name` in `shape`."""
    return _numbers(entries, name, shape[0] * shape[1]).reshape(shape)


def vector(entries: Entries, name: str, count: int | None = None) -> Matrix:
    """Return the numbers under `name` as a vector, of length `count` if given."""
    return _numbers(entries, name, count).ravel()


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
