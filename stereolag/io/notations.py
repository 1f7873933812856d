"""Notations of calibrations, from untrusted bytes, read into one table: name → array of numbers, or text."""

from __future__ import annotations

import io
import json
import math
import re
from collections.abc import Iterator
from typing import Any, TypeAlias
from xml.etree.ElementTree import Element, ParseError

import numpy as np
import numpy.typing as npt
import yaml
from defusedxml import DefusedXmlException
from defusedxml.ElementTree import iterparse

from stereolag.io.npz import ZIP_MAGIC, parse_npz
from stereolag.io.sources import quoted

MAX_DEPTH = 16
MAX_NODES = 50_000
"""Scalars, lists and dictionaries, each counted as often as an alias repeats it."""

# The loader in C is ten times as fast; every wheel of PyYAML has it.
_LOADER: Any = yaml.CBaseLoader if yaml.__with_libyaml__ else yaml.BaseLoader

_OPENCV_DIRECTIVE = re.compile(r"\A\s*%YAML:[^\n]*")
"""OpenCV writes ``%YAML:1.0``, which is not a YAML directive."""


def parse_yaml(text: str, what: str) -> Any:
    """Return the first document of a YAML text.

    Raises
    ------
    ValueError
        Not YAML, more than 16 levels or 50,000 nodes, or an alias of a node that is missing or incomplete.
    """
    text = _OPENCV_DIRECTIVE.sub("", text, count=1)
    try:
        _check(text, what)
        loader = _LOADER(text)
        try:
            return loader.get_data()
        finally:
            loader.dispose()
    except yaml.MarkedYAMLError as error:
        line = "" if error.problem_mark is None else f" at line {error.problem_mark.line + 1}"
        raise ValueError(f"The {what} cannot be parsed as YAML: it is broken or cut short{line}.") from error
    except yaml.YAMLError as error:
        raise ValueError(f"The {what} cannot be parsed as YAML: it holds characters that are not allowed.") from error


def _check(text: str, what: str) -> None:
    """Refuse a text that is too large once its aliases are followed, before anything is built from it."""
    nodes = 0
    opened: list[tuple[str | None, int]] = []
    sizes: dict[str | None, int] = {}
    for event in yaml.parse(text, Loader=_LOADER):
        if isinstance(event, yaml.AliasEvent):
            if event.anchor not in sizes:
                raise ValueError(f"The {what} (YAML) has an alias of something that does not exist or contains itself.")
            nodes += sizes[event.anchor]
        elif isinstance(event, yaml.ScalarEvent):
            nodes += 1
            sizes[event.anchor] = 1
        elif isinstance(event, yaml.CollectionStartEvent):
            opened.append((event.anchor, nodes))
            nodes += 1
            sizes.pop(event.anchor, None)
        elif isinstance(event, yaml.CollectionEndEvent):
            anchor, before = opened.pop()
            sizes[anchor] = nodes - before
        elif isinstance(event, yaml.DocumentEndEvent):
            return
        if len(opened) > MAX_DEPTH:
            raise ValueError(f"The {what} (YAML) is nested more than {MAX_DEPTH} levels deep.")
        if nodes > MAX_NODES:
            raise ValueError(f"The {what} (YAML) holds more than {MAX_NODES:,} values, its aliases followed.")


MAX_ELEMENTS = 20_000

_ITEM = "_"
"""OpenCV's name for the elements of a sequence."""


def parse_xml(data: bytes, what: str) -> Any:
    """Return the content of the root element as text, lists and dictionaries.

    Raises
    ------
    ValueError
        Not XML, a type definition or an entity, or more than 16 levels or 20,000 elements.
    """
    try:
        return _tree(_root(data, what))
    except DefusedXmlException as error:
        raise ValueError(
            f"The {what} (XML) defines types or entities, which are not accepted; save it as OpenCV does, without them."
        ) from error
    except ParseError as error:
        line = error.position[0]
        raise ValueError(f"The {what} cannot be parsed as XML: it is broken or cut short at line {line}.") from error
    except (LookupError, UnicodeError) as error:
        raise ValueError(f"The {what} (XML) is in an encoding that is not known; save it in UTF-8.") from error


def _root(data: bytes, what: str) -> Element:
    """Return the root; too deep a nesting is refused before the text is read to its end."""
    depth = elements = 0
    root: Element | None = None
    for happened, element in iterparse(io.BytesIO(data), events=("start", "end"), forbid_dtd=True):
        if happened == "end":
            depth -= 1
            continue
        root = element if root is None else root
        depth, elements = depth + 1, elements + 1
        if depth > MAX_DEPTH:
            raise ValueError(f"The {what} (XML) is nested more than {MAX_DEPTH} levels deep.")
        if elements > MAX_ELEMENTS:
            raise ValueError(f"The {what} (XML) holds more than {MAX_ELEMENTS:,} elements.")
    assert root is not None
    return root


def _tree(element: Element) -> Any:
    children = list(element)
    if not children:
        return (element.text or "").strip().strip('"')
    if all(child.tag == _ITEM for child in children):
        return [_tree(child) for child in children]
    return {child.tag: _tree(child) for child in children}


Matrix: TypeAlias = npt.NDArray[np.float64]
Entries: TypeAlias = dict[str, Matrix | str]
"""Arrays of numbers (a single number has shape (1,)), or text."""

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
