"""The short program that reproduces a result."""

from __future__ import annotations

import math
import re
from collections.abc import Iterator
from typing import Any, Literal, get_args, get_origin

import stereolag
from stereolag.core.settings import Settings
from stereolag.stereo.matcher import StereoMatcher
from stereolag.version import VERSION

_PROGRAM = '''\
"""Measure the disparity of a stereo pair, px: positive in front of infinity, NaN where there is none.

Written by stereolag {version}, which it needs. The images lie beside this file, and so will the results.
"""

from pathlib import Path

{imports}

FOLDER = Path(__file__).resolve().parent

{images}

{matcher}
result = matcher.compute(left, right)

np.save(FOLDER / "disparity.npy", result.disparity)
sl.write_disparity(FOLDER / "disparity.pfm", result.disparity)
print(f"{{result.coverage:.1%}} of the pixels have a disparity; it took {{result.elapsed_s:.2f}} s")
'''


def script(
    matcher: StereoMatcher,
    left_name: str,
    right_name: str,
    *,
    crop: tuple[int, int] | None = None,
    scale: float = 1.0,
) -> str:
    """Return a Python program that measures the same disparities again, bit for bit.

    The program reads the two images beside it, and writes ``disparity.npy`` and ``disparity.pfm`` there.

    Parameters
    ----------
    matcher
        Every setting is written out, so that a later release with other defaults gives the same result.
    left_name, right_name
        The names of the two files, for example ``left.png``; folders in them are dropped.
    crop
        (rows, cols) kept of both images, from the top left; None: all.
    scale
        The factor by which the images were resized after that, by ``cv2.resize`` with ``INTER_AREA``.

    Raises
    ------
    ValueError
        A scale that is not above 0, or a crop that keeps nothing.
    """
    if not (scale > 0 and math.isfinite(scale)):
        raise ValueError(f"scale is {scale}; allowed are finite numbers above 0.")
    if crop is not None and min(crop) < 1:
        raise ValueError(f"crop is {crop}; allowed are whole numbers of rows and columns from 1.")
    return _PROGRAM.format(
        version=VERSION,
        imports="\n".join(_imports(matcher, resized=scale != 1)),
        images="\n".join(_images(left_name, right_name, crop, scale)),
        matcher=constructor(matcher, before="matcher = "),
    )


def _imports(matcher: StereoMatcher, *, resized: bool) -> list[str]:
    return [
        *(["import cv2"] if resized else []),
        "import numpy as np",
        "",
        "import stereolag as sl",
        *imports(matcher),
    ]


def _images(left_name: str, right_name: str, crop: tuple[int, int] | None, scale: float) -> list[str]:
    lines = [
        f"left = sl.read_image(FOLDER / {file_literal(left_name)})",
        f"right = sl.read_image(FOLDER / {file_literal(right_name)})",
    ]
    if crop is not None:
        kept = f"[:{crop[0]}, :{crop[1]}]"
        lines.append(f"left, right = left{kept}, right{kept}")
    if scale != 1:
        size = f"fx={scale!r}, fy={scale!r}, interpolation=cv2.INTER_AREA"
        lines += [f"left = cv2.resize(left, None, {size})", f"right = cv2.resize(right, None, {size})"]
    return lines


def file_literal(name: str) -> str:
    """Return a file's name without folders as a string literal, safe for any name."""
    return text_literal(re.split(r"[/\\]", name)[-1])


LINE_LENGTH = 88
INDENT = 4


def constructor(settings: Settings, *, before: str = "") -> str:
    """Return the call that makes equal settings: every number and choice, and every nested setting that was changed.

    Classes of the public API are written ``sl.Name``, others ``Name``: :func:`imports` returns their imports. A call
    too long for a line has one argument per line.

    Parameters
    ----------
    settings
        Their fields may be settings, numbers, texts, booleans, None, and lists and tuples of these.
    before
        Text before the call on its line, for example ``"matcher = "``; it is part of the result.
    """
    return _written(settings, before, 0)


def imports(settings: Settings) -> list[str]:
    """Return the import lines for the classes in the call of :func:`constructor` that are not public."""
    modules: dict[str, set[str]] = {}
    for kind in _classes(settings):
        if not _is_public(kind):
            modules.setdefault(kind.__module__, set()).add(kind.__name__)
    return [f"from {module} import {', '.join(sorted(names))}" for module, names in sorted(modules.items())]


def text_literal(text: str) -> str:
    """Return a text as a Python literal, in double quotes if these need no escapes."""
    literal = repr(text)
    return literal if '"' in literal else f'"{literal[1:-1]}"'


def _written(value: Any, before: str, column: int) -> str:
    """Return `before` and the value on one line, or on several if that is too long from `column` on."""
    line = before + _on_one_line(value)
    start, arguments, end = _parts(value)
    if column + len(line) < LINE_LENGTH or not arguments:
        return line
    inner = column + INDENT
    lines = [" " * inner + _written(item, name, inner) + ",\n" for name, item in arguments]
    return before + start + "\n" + "".join(lines) + " " * column + end


def _on_one_line(value: Any) -> str:
    if isinstance(value, str):
        return text_literal(value)
    start, arguments, end = _parts(value)
    if not start:
        return repr(value)
    comma = "," if isinstance(value, tuple) and len(value) == 1 else ""
    return start + ", ".join(name + _on_one_line(item) for name, item in arguments) + comma + end


def _parts(value: Any) -> tuple[str, list[tuple[str, Any]], str]:
    """Return the opening bracket, the items with their ``name=``, and the closing bracket; empty for a plain value."""
    if isinstance(value, Settings):
        kind = type(value)
        name = f"sl.{kind.__name__}" if _is_public(kind) else kind.__name__
        return f"{name}(", [(f"{field}=", item) for field, item in _fields(value)], ")"
    if isinstance(value, list):
        return "[", [("", item) for item in value], "]"
    if isinstance(value, tuple):
        return "(", [("", item) for item in value], ")"
    return "", [], ""


def _fields(settings: Settings) -> Iterator[tuple[str, Any]]:
    """Yield the fields worth writing.

    The tag of a kind in a union can have only one value; stages that are off, and nested settings at their defaults,
    would obscure the actual choices.
    """
    for name, field in type(settings).model_fields.items():
        value = getattr(settings, name)
        only_value = get_origin(field.annotation) is Literal and len(get_args(field.annotation)) == 1
        left_alone = value == field.default and (value is None or isinstance(value, Settings))
        if not only_value and not left_alone:
            yield name, value


def _classes(value: Any) -> Iterator[type[Settings]]:
    """Yield the class of every settings object in a value."""
    if isinstance(value, Settings):
        yield type(value)
    for _, item in _parts(value)[1]:
        yield from _classes(item)


def _is_public(kind: type[Settings]) -> bool:
    return getattr(stereolag, kind.__name__, None) is kind
