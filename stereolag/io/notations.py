"""Notations of calibrations, from untrusted bytes, read into one table of entries by name.

Libraries read the nested ones: JSON, YAML, XML and NPZ. Two are lines of text: ``name=value`` with MATLAB matrices
(Middlebury), and rows of numbers, with a name before each (KITTI) or without.
"""

from __future__ import annotations

import io
import json
import math
import re
from collections.abc import Iterable, Iterator
from typing import Any, NamedTuple, TypeAlias
from xml.etree.ElementTree import Element, ParseError

import numpy as np
import numpy.typing as npt
import yaml
from defusedxml import DefusedXmlException
from defusedxml.ElementTree import iterparse

from stereolag.io.numpy_files import ZIP_MAGIC, parse_npz
from stereolag.io.sources import quote

MAX_TEXT_BYTES = 2**20
MAX_ARCHIVE_BYTES = 2**24
MAX_NAMES = 2000
MAX_DEPTH = 16
MAX_NODES = 50_000
"""Scalars, lists and dictionaries of YAML, each counted as often as an alias repeats it."""
MAX_SIDE = 100_000
MAX_NUMBER = 1e12
"""No focal length, length or coefficient of a camera comes near it; results computed from such numbers stay finite."""

_ASSIGNMENT = re.compile(r"^[ \t]*(\w+)[ \t]*=[ \t]*(\S.*)$")
_NUMBER = r"(?:[-+]?[\d.][-+.\deE]*|nan|inf)"
_NAMED_ROW = re.compile(rf"^[ \t]*(\w+):?[ \t]+({_NUMBER}(?:[ \t]+{_NUMBER})+)[ \t]*$")
_OPENCV_DIRECTIVE = re.compile(r"\A\s*%YAML:[^\n]*")
"""OpenCV writes ``%YAML:1.0``, which is not a YAML directive."""

# Every scalar stays text and every tag is ignored: no tag makes an object, and no type of YAML 1.1 is resolved (its
# base-60 numbers alone can take minutes). The loader in C is ten times as fast; every wheel of PyYAML has it.
_LOADER: Any = yaml.CBaseLoader if yaml.__with_libyaml__ else yaml.BaseLoader

Matrix: TypeAlias = npt.NDArray[np.float64]
_NO_NUMBERS = np.array([np.nan])
"""Placeholder for a list that is not an array of numbers, refused only if it is used."""


class Entry(NamedTuple):
    """A named value of a calibration file: an array of numbers (a single one has shape (1,)), or text."""

    name: str
    value: Matrix | str

    def numbers(self, count: int | None = None) -> Matrix:
        """Return the numbers as a vector, of length `count` if given; ValueError if they are not such numbers."""
        name, values = quote(self.name), self.value
        if isinstance(values, str):
            raise ValueError(f"{name} in the calibration must hold numbers, not {quote(values)}.")
        if not np.isfinite(values).all():
            raise ValueError(f"{name} in the calibration must hold finite numbers only.")
        largest = max(values.flat, key=abs, default=0.0)
        if abs(largest) > MAX_NUMBER:
            raise ValueError(
                f"{name} in the calibration holds {largest:g}; allowed are numbers from -{MAX_NUMBER:g} to "
                f"{MAX_NUMBER:g}."
            )
        if count is not None and values.size != count:
            raise ValueError(f"{name} in the calibration must hold {count} numbers; it holds {values.size}.")
        return values.ravel()

    def matrix(self, rows: int, cols: int) -> Matrix:
        """Return the numbers as a matrix of this size."""
        return self.numbers(rows * cols).reshape(rows, cols)

    def counts(self, count: int) -> list[int]:
        """Return whole numbers from 1 to `MAX_SIDE`, rounded."""
        numbers = self.numbers(count).tolist()
        for number in numbers:
            if not 1 <= number <= MAX_SIDE:
                raise ValueError(f"The calibration has {number:g} for {quote(self.name)}; allowed are 1 to {MAX_SIDE}.")
        return [round(number) for number in numbers]


class Entries(dict[str, Entry]):
    """The entries of a calibration file by their names."""

    def number(self, *names: str) -> float | None:
        """Return the number under the first of `names` that exists, None if none does."""
        found = [self[name] for name in names if name in self]
        return float(found[0].numbers(1)[0]) if found else None

    def required_number(self, *names: str) -> float:
        """Return the number under the first of `names` that exists; one of them must."""
        number = self.number(*names)
        if number is None:
            raise ValueError(
                f"The calibration has no {names[0]}; it is needed to turn disparity into metres. It has "
                f"{names_found(self)}."
            )
        return number

    def count(self, *names: str) -> int | None:
        """Return the whole number from 1 under the first of `names` that exists, None if none does."""
        found = [self[name] for name in names if name in self]
        return Entry(names[0], found[0].numbers(1)).counts(1)[0] if found else None


def names_found(names: Iterable[str]) -> str:
    """Return the first names in words, harmless in an error shown as Markdown or HTML."""
    every = list(names)
    shown = [re.sub(r"[^\w.+-]", "?", name[:24]) for name in every[:6]]
    if not shown:
        return "no names with values"
    return ", ".join(shown) + (f" and {len(every) - len(shown):,} more" if len(every) > len(shown) else "")


def parse_entries(data: bytes) -> Entries:
    """Return the entries of the file, by name.

    A matrix of OpenCV or ROS (rows, cols, data) and nested lists keep their shape. Nested entries are named by their
    path, with dots: ``cam0.intrinsics``. Bare rows are named ``row0``, ``row1``, …

    Raises
    ------
    ValueError
        A file that is too large or cannot be parsed, or a matrix whose size differs from the announced one.
    """
    if data.startswith(ZIP_MAGIC):
        _check_size(data, MAX_ARCHIVE_BYTES)
        arrays = parse_npz(data, "calibration")
        values = dict(_leaves("", {name: "" if array is None else array.tolist() for name, array in arrays.items()}))
    else:
        _check_size(data, MAX_TEXT_BYTES)
        values = _values_of_text(_text(data))
    _check_names(len(values))
    return Entries({name: Entry(name, value) for name, value in values.items() if name})


def _values_of_text(text: str) -> dict[str, Matrix | str]:
    start = text.lstrip()
    if start.startswith("<"):
        return dict(_leaves("", _xml(start.encode())))
    if start.startswith("{"):
        return dict(_leaves("", _json(start)))
    lines = [line for line in text.splitlines() if line.strip() and not line.lstrip().startswith("#")]
    if assignments := [match for line in lines if (match := _ASSIGNMENT.match(line))]:
        _check_names(len(lines))
        return {match[1]: _value(re.sub(r"[\[\];]", " ", match[2])) for match in assignments}
    if lines and len(lines) <= MAX_NAMES and not any(isinstance(_value(line), str) for line in lines):
        return {f"row{number}": _value(line) for number, line in enumerate(lines)}
    rows = [match for line in lines if (match := _NAMED_ROW.match(line))]
    if any(match[1].startswith("P") for match in rows):
        _check_names(len(lines))
        return {match[1]: _value(match[2]) for match in rows}
    return dict(_leaves("", _yaml(text)))


def _check_size(data: bytes, most: int) -> None:
    if len(data) > most:
        raise ValueError(
            f"The calibration has {len(data):,} bytes; at most {most:,} are accepted: it describes cameras only, and "
            "contains no maps of pixels."
        )


def _check_names(count: int) -> None:
    if count > MAX_NAMES:
        raise ValueError(f"The calibration has {count:,} names or lines; at most {MAX_NAMES:,} are accepted.")


def _text(data: bytes) -> str:
    try:
        text = data.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        raise ValueError(
            "The calibration is not a text file (UTF-8) or an .npz of NumPy; save pickles and MATLAB’s files as one of "
            "these."
        ) from error
    if "\0" in text:
        line = text.count("\n", 0, text.index("\0")) + 1
        raise ValueError(f"Line {line} of the calibration holds a NUL byte; allowed is plain text.")
    return text


def _json(text: str) -> Any:
    """Return the content of a text in braces: JSON, or YAML in flow style."""
    try:
        return json.loads(text)
    except (ValueError, RecursionError) as error:
        try:
            return _yaml(text)
        except ValueError:
            raise ValueError("The calibration begins like JSON, but cannot be parsed as such.") from error


def _yaml(text: str) -> Any:
    """Return the first document of a YAML text, refused before it takes more memory than a calibration needs."""
    text = _OPENCV_DIRECTIVE.sub("", text, count=1)
    try:
        _check_yaml(text)
        loader = _LOADER(text)
        try:
            return loader.get_data()
        finally:
            loader.dispose()
    except yaml.MarkedYAMLError as error:
        line = "" if error.problem_mark is None else f" at line {error.problem_mark.line + 1}"
        raise ValueError(f"The calibration cannot be parsed as YAML: it is broken or cut short{line}.") from error
    except yaml.YAMLError as error:
        raise ValueError(
            "The calibration cannot be parsed as YAML: it holds characters that are not allowed."
        ) from error


def _check_yaml(text: str) -> None:
    """Refuse a text that is too large once its aliases are followed, before anything is built from it.

    The loader in C would overflow the stack of its process at a few 10,000 levels.
    """
    nodes = 0
    opened: list[tuple[str | None, int]] = []
    sizes: dict[str | None, int] = {}
    for event in yaml.parse(text, Loader=_LOADER):
        if isinstance(event, yaml.AliasEvent):
            if event.anchor not in sizes:
                raise ValueError(
                    "The calibration (YAML) has an alias of something that does not exist or contains itself."
                )
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
            raise ValueError(f"The calibration (YAML) is nested more than {MAX_DEPTH} levels deep.")
        if nodes > MAX_NODES:
            raise ValueError(f"The calibration (YAML) holds more than {MAX_NODES:,} values, its aliases followed.")


def _xml(data: bytes) -> Any:
    """Return the content of the root element of OpenCV's XML, without entities or type definitions."""
    try:
        opened: list[Element] = []
        for event, element in iterparse(io.BytesIO(data), events=("start", "end"), forbid_dtd=True):
            if event == "start":
                opened.append(element)
            elif len(opened) > 1:
                opened.pop()
            if len(opened) > MAX_DEPTH:
                raise ValueError(f"The calibration (XML) is nested more than {MAX_DEPTH} levels deep.")
        return _xml_tree(opened[0])
    except DefusedXmlException as error:
        raise ValueError(
            "The calibration (XML) defines types or entities, which are not accepted; save it as OpenCV does, without "
            "them."
        ) from error
    except ParseError as error:
        raise ValueError(
            f"The calibration cannot be parsed as XML: it is broken or cut short at line {error.position[0]}."
        ) from error
    except (LookupError, UnicodeError) as error:
        raise ValueError("The calibration (XML) is in an encoding that is not known; save it in UTF-8.") from error


def _xml_tree(element: Element) -> Any:
    if not len(element):
        return (element.text or "").strip().strip('"')
    if all(child.tag == "_" for child in element):  # OpenCV's name for the elements of a sequence
        return [_xml_tree(child) for child in element]
    return {child.tag: _xml_tree(child) for child in element}


def _leaves(name: str, tree: Any, depth: int = 0) -> Iterator[tuple[str, Matrix | str]]:
    """Yield the leaves of a tree of dictionaries and lists, with their paths: ``left.camera_matrix``."""
    if depth > MAX_DEPTH:
        raise ValueError(f"The calibration is nested more than {MAX_DEPTH} levels deep.")
    if isinstance(tree, dict):
        if "data" in tree and ({"rows", "cols"} <= set(tree) or "sizes" in tree):
            # OpenCV 5 writes the sizes of an array of one row.
            sizes = [tree["rows"], tree["cols"]] if {"rows", "cols"} <= set(tree) else tree["sizes"]
            yield name, _announced(name, tree["data"], sizes)
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


def _announced(name: str, data: Any, sizes: Any) -> Matrix:
    """Return an array in the shape announced by its file."""
    values, shape = _value(data), _value(sizes)
    if isinstance(values, str) or isinstance(shape, str):
        return _NO_NUMBERS
    if not (np.isfinite(shape).all() and np.isfinite(values).all()):
        return _NO_NUMBERS
    if not ((shape >= 0) & (shape <= values.size)).all() or math.prod(map(int, shape.flat)) != values.size:
        announced = " × ".join(f"{side:g}" for side in list(shape.flat)[:3])
        raise ValueError(f"{quote(name)} in the calibration announces {announced} numbers and holds {values.size}.")
    return values.reshape([int(side) for side in shape.flat])


def _value(leaf: Any) -> Matrix | str:
    """Return the numbers in a leaf; if it is a text that contains anything else, the text."""
    if isinstance(leaf, str):
        try:
            return np.array([_float(token) for token in re.split(r"[\s,]+", leaf.strip())])
        except ValueError:
            return leaf.strip()
    if isinstance(leaf, list) and leaf and all(isinstance(item, str) for item in leaf):
        # From YAML and XML; if a comma is missing at the end of a line, two numbers are one item.
        numbers = _value(" ".join(leaf))
        return _NO_NUMBERS if isinstance(numbers, str) else numbers
    try:
        return np.atleast_1d(np.array(leaf, dtype=np.float64))
    except (TypeError, ValueError, OverflowError, RecursionError):
        return _NO_NUMBERS


def _float(token: str) -> float:
    """Return the number in a text, including those that YAML writes differently from Python."""
    return float(token.replace(".", "", 1) if token.lower().lstrip("+-") in (".nan", ".inf") else token)
