"""The notations calibrations are written in, from untrusted bytes, as one table: name → array of numbers, or text.

Four are told apart: JSON; ``key=value`` with MATLAB matrices (Middlebury); bare rows of numbers; and ``key: value``,
which covers KITTI and as much of YAML as OpenCV's FileStorage and ROS write. It is read here because OpenCV's own
reader leaves the process in disorder on broken input, and a YAML library would be a dependency for numbers alone.
"""

from __future__ import annotations

import json
import re
from typing import Any

import numpy as np

from stereolag.reading.entries import Entries, Matrix
from stereolag.reading.sources import quoted

_KEY_VALUE = re.compile(r"^[ \t]*(\w+)[ \t]*=[ \t]*(.+)$")
_KEY = re.compile(r"^([ \t]*)\"?([A-Za-z_]\w*)\"?[ \t]*:(?:[ \t]+(.*))?$")
_CONTINUATION = re.compile(r"^(?:[ \t]|-[ \t]|\])")
_SEPARATORS = re.compile(r"[\s,;\[\]]+|(?<![^\s\[,])-(?=\s)")
_MATRIX_KEYS = ("rows", "cols", "data")


def parse_entries(data: bytes) -> Entries:
    """Return the entries of the file, by name.

    A matrix of OpenCV or ROS (rows, cols, data) and nested lists keep their shape; a number alone is an array of
    shape (1,). Bare rows are named ``row0``, ``row1``, …

    Raises
    ------
    ValueError
        Not a text, JSON that cannot be parsed, or a matrix whose size is not what it announces.
    """
    try:
        text = data.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        raise ValueError("The calibration is not a text file (UTF-8).") from error
    if "\0" in text:
        line = text.count("\n", 0, text.index("\0")) + 1
        raise ValueError(f"Line {line} of the calibration holds a NUL byte; allowed is plain text.")
    lines = [line for line in text.splitlines() if line.strip() and not line.lstrip().startswith(("#", "%", "---"))]
    if text.lstrip().startswith("{"):
        return _from_json(text)
    if any(_KEY_VALUE.match(line) for line in lines):
        return _from_assignments(lines)
    if lines and all(_numbers(line) is not None for line in lines):
        return {f"row{index}": _as_value(line) for index, line in enumerate(lines)}
    return _from_colons(lines)


def _from_json(text: str) -> Entries:
    try:
        content = json.loads(text)
    except (ValueError, RecursionError) as error:
        raise ValueError("The calibration begins like JSON, but cannot be parsed as such.") from error
    entries: Entries = {}
    for name, value in content.items():
        if isinstance(value, dict):
            if not all(key in value for key in _MATRIX_KEYS):
                continue
            entries[name] = _matrix(name, *(_array(name, value[key]) for key in _MATRIX_KEYS))
        elif isinstance(value, str):
            entries[name] = value
        elif isinstance(value, int | float | list) and not isinstance(value, bool):
            entries[name] = _array(name, value)
    return entries


def _from_assignments(lines: list[str]) -> Entries:
    matches = [match for line in lines if (match := _KEY_VALUE.match(line))]
    return {match[1]: _as_value(match[2]) for match in matches}


def _from_colons(lines: list[str]) -> Entries:
    """Read ``key: value``, the value reaching on over indented lines, and matrices whose parts are indented keys."""
    values: dict[tuple[str, str], list[str]] = {}
    owner, current = "", None
    for line in lines:
        if match := _KEY.match(line):
            indent, key, value = match[1], match[2], match[3] or ""
            if not indent:
                owner = key
            current = (owner, key if indent else "")
            values[current] = [value]
        elif current is not None and _CONTINUATION.match(line):
            values[current].append(line)
        else:
            current = None
    texts = {place: "\n".join(parts) for place, parts in values.items()}
    entries: Entries = {}
    for name in dict.fromkeys(owner for owner, _ in texts):
        if all((name, key) in texts for key in _MATRIX_KEYS):
            entries[name] = _matrix(name, *(_array(name, _numbers(texts[name, key])) for key in _MATRIX_KEYS))
        elif texts.get((name, "")):
            entries[name] = _as_value(texts[name, ""])
    return entries


def _as_value(text: str) -> Matrix | str:
    numbers = _numbers(text)
    return text.strip() if numbers is None else np.array(numbers)


def _numbers(text: str) -> list[float] | None:
    """Return the numbers of a list or matrix in any of the notations, None if there is anything else in it."""
    try:
        numbers = [float(token) for token in _SEPARATORS.split(text) if token]
    except ValueError:
        return None
    return numbers or None


def _array(name: str, value: Any) -> Matrix:
    try:
        array = np.array(value, dtype=np.float64)
    except (TypeError, ValueError, OverflowError):
        array = np.array(np.nan)
    if not np.isfinite(array).all():
        raise ValueError(f"{quoted(name)} in the calibration must hold finite numbers only.")
    return np.atleast_1d(array)


def _matrix(name: str, rows: Matrix, cols: Matrix, values: Matrix) -> Matrix:
    height, width = (float(side.flat[0]) if side.size else 0.0 for side in (rows, cols))
    if not (0 <= height <= values.size and 0 <= width <= values.size and int(height) * int(width) == values.size):
        raise ValueError(
            f"{quoted(name)} in the calibration announces {height:g} × {width:g} numbers and holds {values.size}."
        )
    return values.reshape(int(height), int(width))
