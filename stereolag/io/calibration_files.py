"""The syntaxes of calibration files: JSON, YAML, XML, INI, NPZ, MAT, ``name=value`` or rows of numbers.

All are parsed into entries by name. :mod:`stereolag.io.calibration_layouts` and :mod:`stereolag.io.calibration_parts`
interpret the names.
"""

from __future__ import annotations

import codecs
import io
import json
import math
import re
from collections.abc import Iterable, Iterator, Mapping
from typing import Any, NamedTuple, TypeAlias
from xml.etree.ElementTree import Element, ParseError

import numpy as np
import numpy.typing as npt
from defusedxml import DefusedXmlException, ElementTree

from stereolag.io.arrays import NPY_MAGIC, npz_arrays, parse_npy, reported_as_damage
from stereolag.io.sources import ZIP_MAGIC, quote, read_archive

MAX_TEXT_BYTES = 2**20
"""Maximum size of a text file."""

MAX_ARCHIVE_BYTES = 2**24
"""Maximum size of an NPZ or MAT file."""

MAX_ARRAY_BYTES = 2**16
"""Maximum size of an array in these, unpacked: more than any matrix of a camera, and less than a map of pixels."""

MAX_NAMES = 2000
"""Maximum number of named values, or of lines."""

MAX_DEPTH = 16
"""Maximum depth of nesting."""

MAX_VALUES = 100_000
"""Maximum number of scalars, lists and dictionaries, each counted as often as YAML's aliases repeat it."""

MAX_SIDE_PX = 100_000
"""Maximum width and height of images."""

MAX_NUMBER = 1e12
"""Maximum magnitude of a number: far beyond any focal length, length or coefficient of a camera, and small enough for
results computed from it to stay finite."""

MAT_MAGIC = (b"MATLAB 5.0 MAT-file", b"MATLAB 7.3 MAT-file")
"""The first bytes of MAT files: of version 5, and of version 7.3, which is HDF5."""

Matrix: TypeAlias = npt.NDArray[np.float64]
NO_NUMBERS = np.array([np.nan])
"""Placeholder for a list that is not an array of numbers: it is refused only if it is needed."""


class Entry(NamedTuple):
    """A named value of a calibration file: an array of numbers (shape (1,) for a single one), or text."""

    name: str
    value: Matrix | str

    def numbers(self, count: int | None = None) -> Matrix:
        """Return the numbers as a vector, of length `count` if given; ValueError for anything else."""
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

    def text(self) -> str:
        """Return the text, or the numbers as text."""
        return self.value if isinstance(self.value, str) else " ".join(f"{number:g}" for number in self.value.flat)

    def matrix(self, rows: int, cols: int) -> Matrix:
        """Return the numbers as a matrix of this size."""
        return self.numbers(rows * cols).reshape(rows, cols)

    def counts(self, count: int) -> list[int]:
        """Return whole numbers from 1 to `MAX_SIDE_PX`, rounded."""
        numbers = self.numbers(count).tolist()
        for number in numbers:
            if not 1 <= number <= MAX_SIDE_PX:
                raise ValueError(
                    f"The calibration has {number:g} for {quote(self.name)}; allowed are 1 to {MAX_SIDE_PX}."
                )
        return [round(number) for number in numbers]

    def projection(self) -> Matrix:
        """Return the numbers as a (3, 4) projection, whose focal length must be above 0."""
        projection = self.matrix(3, 4)
        if projection[0, 0] <= 0:
            raise ValueError(
                f"{quote(self.name)} in the calibration has the focal length {projection[0, 0]:g} px; it must be "
                "above 0."
            )
        return projection


class Entries(dict[str, Entry]):
    """The entries of a calibration by name; `used` holds the names that were looked up.

    A calibration may consist of several `files`, each with its own entries; of two with the same name, the last counts.
    """

    def __init__(self, *files: Mapping[str, Entry]) -> None:
        super().__init__({name: entry for file in files for name, entry in file.items()})
        self.files = [file for file in files if isinstance(file, Entries)]
        self.used: set[str] = self.files[0].used if self.files else set()
        for file in self.files:
            file.used = self.used

    def find(self, names: str) -> Entry | None:
        """Return the entry with the first of some names, separated by ``|``, in any case; None if there is none."""
        return next(filter(None, map(self.match, map(re.escape, names.split("|")))), None)

    def match(self, pattern: str) -> Entry | None:
        """Return the first entry whose whole name matches a pattern, in any case; None if there is none."""
        name = next(filter(re.compile(pattern, re.IGNORECASE).fullmatch, self), None)
        if name is None:
            return None
        self.used.add(name)
        return self[name]

    def number(self, names: str) -> float | None:
        """Return a single number; None if there is none."""
        found = self.find(names)
        return None if found is None else float(found.numbers(1)[0])

    def required(self, names: str) -> Entry:
        """Return an entry; ValueError if it is missing."""
        found = self.find(names)
        if found is None:
            raise ValueError(
                f"The calibration has no {names.split('|')[0]}; it is needed here. It has {names_found(self)}."
            )
        return found

    def select(self, names: Mapping[str, str]) -> dict[str, Entry]:
        """Return the existing ones of some entries under new names: `names` maps these to the names in the file."""
        return {new: entry for new, name in names.items() if (entry := self.find(name)) is not None}


def names_found(names: Iterable[str]) -> str:
    """Return a list of the first names for a message; they are made harmless in Markdown and HTML."""
    all_names = list(names)
    shown = [re.sub(r"[^\w.+-]", "?", name[:24]) for name in all_names[:6]]
    more = f" and {len(all_names) - len(shown):,} more" if len(all_names) > len(shown) else ""
    return ", ".join(shown) + more if shown else "no names with values"


_ASSIGNMENT = re.compile(r"^[ \t]*([\w.]+)[ \t]*=[ \t]*(\S.*)$")
_NUMBER = r"(?:[-+]?[\d.][-+.\deE]*|nan|inf)"
_NAMED_ROW = re.compile(rf"^[ \t]*(\w+):?[ \t]+({_NUMBER}(?:[ \t]+{_NUMBER})*)[ \t]*$")
_SECTION = re.compile(r"^[ \t]*\[[ \t]*([A-Za-z][\w /.-]*)\][ \t]*$")
_CONTROLS = re.compile(r"[\0-\x08\x0e-\x1f\x80-\x9f]")
"""Characters that no text in Latin-1 holds, but pickles and pictures do."""
_OPENCV_DIRECTIVE = re.compile(r"\A\s*%YAML:[^\n]*")
"""OpenCV writes ``%YAML:1.0``, which is not a YAML directive."""

_TOO_DEEP = f"The calibration is nested more than {MAX_DEPTH} levels deep."
_TOO_MANY = f"The calibration holds more than {MAX_VALUES:,} values, its aliases followed."


def parse_entries(data: bytes) -> Entries:
    """Return the entries of the file, by name.

    A matrix of OpenCV or ROS (rows, cols, data) and nested lists keep their shape. Nested entries are named by their
    path, with dots: ``cam0.intrinsics``. Rows without names are named ``row0``, ``row1``, …

    Raises
    ------
    ValueError
        A file that is too large or cannot be parsed, or a matrix whose size differs from the declared one.
    """
    is_binary = data.startswith((NPY_MAGIC, ZIP_MAGIC, *MAT_MAGIC))
    max_bytes = MAX_ARCHIVE_BYTES if is_binary else MAX_TEXT_BYTES
    if len(data) > max_bytes:
        raise ValueError(
            f"The calibration has {len(data):,} bytes; at most {max_bytes:,} are accepted: it describes cameras "
            "only, and contains no maps of pixels."
        )
    try:
        if not is_binary:
            values = _text_values(_decoded(data))
        elif data.startswith(MAT_MAGIC):
            values = _leaves(_mat_variables(data))
        else:
            arrays = (
                npz_arrays(read_archive(data, max_files=MAX_NAMES), "calibration")
                if data.startswith(ZIP_MAGIC)
                else {f"row{number}": row for number, row in enumerate(np.atleast_2d(parse_npy(data, "calibration")))}
            )
            # Large ones do not describe a camera.
            values = {name: _parsed_leaf(array) for name, array in arrays.items() if array.nbytes <= MAX_ARRAY_BYTES}
    except RecursionError as error:
        raise ValueError(_TOO_DEEP) from error
    _check_names(len(values))
    return Entries({name: Entry(name, value) for name, value in values.items() if name})


def _check_names(count: int) -> None:
    if count > MAX_NAMES:
        raise ValueError(f"The calibration has {count:,} names or lines; at most {MAX_NAMES:,} are accepted.")


def _mat_variables(data: bytes) -> Any:
    """Return the variables of a MAT file by name, with structs as dictionaries and arrays as lists."""
    import scipy  # commands on pairs rarely need it

    if data.startswith(MAT_MAGIC[1]):
        raise ValueError("The calibration is a MAT file of version 7.3, which is not read; save it with -v7.")
    stream: Any = io.BytesIO(data)
    with reported_as_damage("calibration"):
        variables = scipy.io.loadmat(stream, simplify_cells=True)
    if any(isinstance(value, scipy.io.matlab.MatlabOpaque) for value in variables.values()):
        raise ValueError(
            "The calibration is a MAT file with an object of MATLAB; save the struct that toStruct makes of it."
        )
    return _as_lists({name: value for name, value in variables.items() if not name.startswith("__")})


def _as_lists(tree: Any) -> Any:
    """Return a tree of dictionaries and arrays with lists in place of the arrays; None in place of large ones."""
    if isinstance(tree, dict):
        return {name: _as_lists(value) for name, value in tree.items()}
    if isinstance(tree, list):
        return [_as_lists(value) for value in tree]
    if isinstance(tree, np.ndarray | np.generic):
        return _as_lists(tree.tolist()) if tree.nbytes <= MAX_ARRAY_BYTES else None
    return tree


def _decoded(data: bytes) -> str:
    try:
        text = data.decode("utf-16" if data.startswith((codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE)) else "utf-8-sig")
    except UnicodeDecodeError as error:
        text = data.decode("latin-1")
        if _CONTROLS.search(text):
            raise ValueError(
                "The calibration is not a text file, an .npy or .npz of NumPy or a .mat; save pickles as one of these."
            ) from error
    if "\0" in text:
        line = text.count("\n", 0, text.index("\0")) + 1
        raise ValueError(f"Line {line} of the calibration holds a NUL byte; allowed is plain text.")
    return text


def _text_values(text: str) -> dict[str, Matrix | str]:
    start = text.lstrip()
    if start.startswith("<"):
        return _leaves(_xml(start.encode()))
    if start.startswith("{"):
        return _leaves(_json(start))
    lines = [line for line in text.splitlines() if line.strip() and not line.lstrip().startswith(("#", ";"))]
    if any(_SECTION.match(line) for line in lines):
        _check_names(len(lines))
        return _ini(lines)
    if assignments := [match for line in lines if (match := _ASSIGNMENT.match(line))]:
        _check_names(len(lines))
        return {match[1]: _parsed_leaf(_without_brackets(match[2])) for match in assignments}
    if lines and len(lines) <= MAX_NAMES and not any(isinstance(_parsed_leaf(line), str) for line in lines):
        return {f"row{number}": _parsed_leaf(line) for number, line in enumerate(lines)}
    rows = [match for line in lines if (match := _NAMED_ROW.match(line))]
    if any(match[1].startswith("P") for match in rows) or 0 < len(rows) == len(lines):
        _check_names(len(lines))
        return {match[1]: _parsed_leaf(match[2]) for match in rows}
    return _leaves(_yaml(text))


def _without_brackets(text: str) -> str:
    """Return an assigned value without a trailing comment and a matrix's brackets and semicolons."""
    return re.sub(r"//.*|[\[\];]", " ", text)


def _ini(lines: list[str]) -> dict[str, Matrix | str]:
    """Return the values in sections with headings in brackets.

    ROS writes rows of numbers below a name, others write ``name=value``.
    """
    section = name = ""
    rows: dict[str, str] = {}
    for line in lines:
        if heading := _SECTION.match(line):
            section, name = heading[1].strip(), ""
        elif assignment := _ASSIGNMENT.match(line):
            rows[f"{section}.{assignment[1]}"] = _without_brackets(assignment[2])
        elif isinstance(_parsed_leaf(line), str):
            name = f"{section}.{line.strip()}"
            rows[name] = ""
        elif name:
            rows[name] += f" {line}"
    return {name: _parsed_leaf(values) for name, values in rows.items() if values}


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
    """Return the first document of a YAML text."""
    import yaml  # commands on pairs rarely need it

    # Every scalar stays text and every tag is ignored: no tag creates an object, and no type of YAML 1.1 is resolved
    # (its base-60 numbers alone can take minutes). The C loader is ten times as fast; every wheel of PyYAML has it.
    loader: Any = yaml.CBaseLoader if yaml.__with_libyaml__ else yaml.BaseLoader
    text = _OPENCV_DIRECTIVE.sub("", text, count=1)
    depth = 0
    try:
        # The C loader would overflow the stack of its process at a few 10,000 levels.
        for number, event in enumerate(yaml.parse(text, Loader=loader)):
            depth += isinstance(event, yaml.CollectionStartEvent) - isinstance(event, yaml.CollectionEndEvent)
            if depth > MAX_DEPTH:
                raise ValueError(_TOO_DEEP)
            if number > 2 * MAX_VALUES:
                raise ValueError(_TOO_MANY)
            if isinstance(event, yaml.DocumentEndEvent):
                break
        return next(yaml.load_all(text, Loader=loader), None)
    except yaml.MarkedYAMLError as error:
        line = "" if error.problem_mark is None else f" at line {error.problem_mark.line + 1}"
        raise ValueError(f"The calibration cannot be parsed as YAML: it is broken or cut short{line}.") from error
    except yaml.YAMLError as error:
        raise ValueError(
            "The calibration cannot be parsed as YAML: it holds characters that are not allowed."
        ) from error


def _xml(data: bytes) -> Any:
    """Return the content of the root element of OpenCV's XML, without entities or type definitions."""
    try:
        return _xml_tree(ElementTree.fromstring(data, forbid_dtd=True))
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


def _leaves(tree: Any) -> dict[str, Matrix | str]:
    """Return the leaves of a tree of dictionaries and lists by path: ``left.camera_matrix``."""
    _count_values(tree)
    return dict(_walk("", tree))


def _count_values(tree: Any, depth: int = 0) -> int:
    """Return the number of values in a tree, aliases repeated; ValueError if there are too many, or nested too deep."""
    if depth > MAX_DEPTH:
        raise ValueError(_TOO_DEEP)
    count = 1
    for value in tree.values() if isinstance(tree, dict) else tree if isinstance(tree, list) else ():
        count += _count_values(value, depth + 1)
        if count > MAX_VALUES:
            raise ValueError(_TOO_MANY)
    return count


def _walk(name: str, tree: Any) -> Iterator[tuple[str, Matrix | str]]:
    if isinstance(tree, list) and _contains_names(tree):
        tree = dict(enumerate(tree))
    if not isinstance(tree, dict):
        if tree is not None and tree != "":
            yield name, _parsed_leaf(str(tree) if isinstance(tree, bool) else tree)
    elif "data" in tree and ({"rows", "cols"} <= set(tree) or "sizes" in tree):
        # OpenCV 5 writes the sizes of an array of one row.
        sizes = [tree["rows"], tree["cols"]] if {"rows", "cols"} <= set(tree) else tree["sizes"]
        yield name, _shaped(name, tree["data"], sizes)
    else:
        for key, value in tree.items():
            yield from _walk(f"{name}.{key}" if name else str(key), value)


def _contains_names(tree: Any) -> bool:
    return isinstance(tree, dict) or (isinstance(tree, list) and any(map(_contains_names, tree)))


def _shaped(name: str, data: Any, sizes: Any) -> Matrix:
    """Return an array in the shape that its file declares."""
    values, shape = _parsed_leaf(data), _parsed_leaf(sizes)
    if isinstance(values, str) or isinstance(shape, str) or not np.isfinite([*values.flat, *shape.flat]).all():
        return NO_NUMBERS
    if not ((shape >= 0) & (shape <= max(1, values.size))).all() or math.prod(map(int, shape.flat)) != values.size:
        declared = " × ".join(f"{side:g}" for side in list(shape.flat)[:3])
        raise ValueError(f"{quote(name)} in the calibration announces {declared} numbers and holds {values.size}.")
    return values.reshape([int(side) for side in shape.flat])


def _parsed_leaf(leaf: Any) -> Matrix | str:
    """Return the numbers in a leaf; the text if it is a text that contains anything else."""
    if isinstance(leaf, str):
        try:
            return np.array([_parsed_float(token) for token in re.split(r"[\s,]+", leaf.strip())])
        except ValueError:
            return leaf.strip()
    if isinstance(leaf, list) and leaf and all(isinstance(item, str) for item in leaf):
        # From YAML and XML; where a comma is missing at the end of a line, one item holds two numbers.
        numbers = _parsed_leaf(" ".join(leaf))
        return NO_NUMBERS if isinstance(numbers, str) else numbers
    try:
        return np.atleast_1d(np.array(leaf, dtype=np.float64))
    except (TypeError, ValueError, OverflowError):
        return NO_NUMBERS


def _parsed_float(token: str) -> float:
    """Return the number in a text, also YAML's ``.nan`` and ``.inf``."""
    return float(token.replace(".", "", 1) if token.lower().lstrip("+-") in (".nan", ".inf") else token)
