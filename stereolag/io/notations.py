"""Calibration notations, from untrusted bytes, read into one table: name → array of numbers, or text.

Libraries read the nested ones: JSON, YAML, XML and NPZ. Two are lines of text: ``name=value`` with MATLAB matrices
(Middlebury), and rows of numbers, with a name before each (KITTI) or without.
"""

from __future__ import annotations

import json
import re
from typing import Any

from stereolag.io.entries import Entries, flattened, value_of
from stereolag.io.npz import ZIP_MAGIC, parse_npz
from stereolag.io.xml_trees import parse_xml
from stereolag.io.yaml_trees import parse_yaml

MAX_TEXT_BYTES = 2**20
MAX_ARCHIVE_BYTES = 2**24
MAX_NAMES = 2000

_WHAT = "calibration"
_ASSIGNMENT = re.compile(r"^[ \t]*(\w+)[ \t]*=[ \t]*(\S.*)$")
_NUMBER = r"(?:[-+]?[\d.][-+.\deE]*|nan|inf)"
_NAMED_ROW = re.compile(rf"^[ \t]*(\w+):?[ \t]+({_NUMBER}(?:[ \t]+{_NUMBER})+)[ \t]*$")


def parse_entries(data: bytes) -> Entries:
    """Return the entries of the file, by name.

    A matrix of OpenCV or ROS (rows, cols, data) and nested lists keep their shape; a single number is an array of shape
    (1,). Nested entries are named by their path, with dots: ``cam0.intrinsics``. Bare rows are named ``row0``,
    ``row1``, …

    Raises
    ------
    ValueError
        A file that is too large or cannot be parsed, or a matrix whose size differs from the announced one.
    """
    if data.startswith(ZIP_MAGIC):
        _check_size(data, MAX_ARCHIVE_BYTES)
        arrays = parse_npz(data, _WHAT)
        entries = flattened({name: "" if array is None else array.tolist() for name, array in arrays.items()})
    else:
        _check_size(data, MAX_TEXT_BYTES)
        entries = _from_text(_text(data))
    _check_names(len(entries))
    return entries


def _from_text(text: str) -> Entries:
    start = text.lstrip()
    if start.startswith("<"):
        return flattened(parse_xml(start.encode(), _WHAT))
    if start.startswith("{"):
        return flattened(_json(start))
    lines = [line for line in text.splitlines() if line.strip() and not line.lstrip().startswith("#")]
    if any(_ASSIGNMENT.match(line) for line in lines):
        _check_names(len(lines))
        return _from_assignments(lines)
    if lines and len(lines) <= MAX_NAMES and not any(isinstance(value_of(line), str) for line in lines):
        return {f"row{number}": value_of(line) for number, line in enumerate(lines)}
    if any(line.lstrip().startswith("P") and _NAMED_ROW.match(line) for line in lines):
        _check_names(len(lines))
        return _from_named_rows(lines)
    return flattened(parse_yaml(text, _WHAT))


def _check_size(data: bytes, most: int) -> None:
    if len(data) > most:
        raise ValueError(
            f"The {_WHAT} has {len(data):,} bytes; at most {most:,} are accepted: it describes cameras only, and "
            "contains no maps of pixels."
        )


def _text(data: bytes) -> str:
    try:
        text = data.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        raise ValueError(
            f"The {_WHAT} is not a text file (UTF-8) or an .npz of NumPy; save pickles and MATLAB’s files as one of "
            "these."
        ) from error
    if "\0" in text:
        line = text.count("\n", 0, text.index("\0")) + 1
        raise ValueError(f"Line {line} of the {_WHAT} holds a NUL byte; allowed is plain text.")
    return text


def _json(text: str) -> Any:
    """Return the content of a text in braces: JSON, or YAML in flow style."""
    try:
        return json.loads(text)
    except (ValueError, RecursionError) as error:
        try:
            return parse_yaml(text, _WHAT)
        except ValueError:
            raise ValueError(f"The {_WHAT} begins like JSON, but cannot be parsed as such.") from error


def _from_assignments(lines: list[str]) -> Entries:
    matches = [match for line in lines if (match := _ASSIGNMENT.match(line))]
    return {match[1]: value_of(re.sub(r"[\[\];]", " ", match[2])) for match in matches}


def _from_named_rows(lines: list[str]) -> Entries:
    matches = [match for line in lines if (match := _NAMED_ROW.match(line))]
    return {match[1]: value_of(match[2]) for match in matches}


def _check_names(count: int) -> None:
    if count > MAX_NAMES:
        raise ValueError(f"The {_WHAT} has {count:,} names or lines; at most {MAX_NAMES:,} are accepted.")
