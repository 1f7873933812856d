"""Columns of numbers in a text, from untrusted bytes."""

from __future__ import annotations

import codecs
import io
import itertools
import math
import re
from collections.abc import Iterator

import numpy as np
import numpy.typing as npt

from stereolag.io.sources import quote

ALLOWED = "allowed are finite numbers, in columns separated by comma, semicolon, tab or space"
MAX_BYTES = 64 * 2**20
MAX_HEADER_LINES = 200

MOST_MENDED = 5
LINES_PER_MENDED = 100
"""At most `MOST_MENDED` damaged lines are mended, and at most one in `LINES_PER_MENDED`."""

_STRAY_NULS = re.compile(r"(?<=[0-9.])\0+(?=[ \t,;\n]|\Z)")
"""NUL characters directly after a complete number."""
_COMMENT = re.compile(r"(?:#|%|//)[^\n]*")
_BLOCK = 2**20


def parse_columns(data: bytes) -> tuple[npt.NDArray[np.float64], int]:
    """Return the columns of a text as (columns, rows), and the number of mended lines.

    A few lines (at most 5, and one in a hundred) may be damaged: NUL bytes after a complete number are removed, and an
    empty field is interpolated between the numbers above and below it.

    Parameters
    ----------
    data
        The text: UTF-8, UTF-16 with its byte order mark, or Latin-1; lines end in LF, CRLF or CR.

    Raises
    ------
    ValueError
        No number at all, too long a text, or a line with anything else, a NUL byte, or another count of numbers than
        the first; the error names the line.
    """
    text = _decoded(data)
    allowed = min(MOST_MENDED, (text.count("\n") + 1) // LINES_PER_MENDED)
    text, mended = _without_nuls(text, allowed)
    text = _COMMENT.sub("", text)
    first_line, separator, columns = _layout(text)
    parts = []
    for line, block in _blocks(text, first_line):
        part, filled = _numbers(block, line, separator, columns, allowed - mended)
        parts.append(part)
        mended += filled
    table = np.concatenate(parts, axis=1)
    if mended:
        _interpolate(table)
    return table, mended


def _decoded(data: bytes) -> str:
    if len(data) > MAX_BYTES:
        raise ValueError(
            f"The text has {len(data) / 1e6:.0f} MB; at most {MAX_BYTES / 1e6:.0f} MB are accepted: save it as WAV or "
            "NPY instead."
        )
    if data.startswith((codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE)):
        text = data.decode("utf-16", errors="replace")
    else:
        try:
            text = data.decode("utf-8-sig")
        except UnicodeDecodeError:
            text = data.decode("latin-1")
    return text.replace("\r\n", "\n").replace("\r", "\n")


def _without_nuls(text: str, allowed: int) -> tuple[str, int]:
    """Return the text without stray NUL characters, and the number of lines that had some."""
    if "\0" not in text:
        return text, 0
    mended = _STRAY_NULS.sub("", text)
    lines = {text.count("\n", 0, found.start()) for found in itertools.islice(_STRAY_NULS.finditer(text), allowed + 1)}
    if "\0" in mended or len(lines) > allowed:
        raise ValueError(f"Line {text.count(chr(10), 0, text.index(chr(0))) + 1} holds a NUL byte; {ALLOWED}.")
    return mended, len(lines)


def _layout(text: str) -> tuple[int, str | None, int]:
    """Return the number of the first line of numbers, its separator (None: spaces) and its count of columns."""
    for number, line in itertools.islice(_filled_lines(text, 1), MAX_HEADER_LINES):
        for separator in (";", "\t", ",", None):
            if (separator is None or separator in line) and _is_numeric(line, separator):
                return number, separator, len(line.split(separator))
    raise ValueError(f"No line of the text holds numbers alone; {ALLOWED}.")


def _is_numeric(line: str, separator: str | None) -> bool:
    fields = line.split(separator)
    return all(_number(field if separator == "," else field.replace(",", ".")) is not None for field in fields)


def _number(field: str) -> float | None:
    """Return the number in a field as NumPy reads it, None if there is none."""
    try:
        return None if "_" in field else float(field)
    except ValueError:
        return None


def _filled_lines(text: str, first_line: int) -> Iterator[tuple[int, str]]:
    for number, line in enumerate(io.StringIO(text), start=first_line):
        if content := line.strip():
            yield number, content


def _blocks(text: str, first_line: int) -> Iterator[tuple[int, str]]:
    """Yield blocks of whole lines from `first_line` on, not only blank ones, with the number of their first line."""
    lines = io.StringIO(text)
    for _ in range(first_line - 1):
        lines.readline()
    while block := lines.readlines(_BLOCK):
        joined = "".join(block)
        if not joined.isspace():
            yield first_line, joined
        first_line += len(block)


def _numbers(
    block: str, first_line: int, separator: str | None, columns: int, allowed: int
) -> tuple[npt.NDArray[np.float64], int]:
    """Return the (columns, rows) of a block, NaN in fields that were empty, and the number of lines with such."""
    if separator != ",":
        block = block.replace(",", ".")  # a decimal comma
    table = _loaded(block, separator, columns)
    if table is not None and np.isfinite(table).all():
        return table, 0
    filled, lines = _with_nan(block, separator, columns)
    if 0 < lines <= allowed and "nan" not in block.lower():
        table = _loaded(filled, separator, columns)
        if table is not None and not np.isinf(table).any():
            return table, lines
        block = filled.replace("nan", "0")  # the fields that could be filled are not the problem
    raise ValueError(_fault(block, first_line, separator, columns))


def _loaded(block: str, separator: str | None, columns: int) -> npt.NDArray[np.float64] | None:
    try:
        table = np.loadtxt(io.StringIO(block), delimiter=separator, comments=None, ndmin=2)
    except ValueError:
        return None
    return table.T if table.shape[1] == columns else None


def _with_nan(block: str, separator: str | None, columns: int) -> tuple[str, int]:
    """Return the lines with ``nan`` in their empty fields, and the number of lines that have both such and others."""
    lines, count = block.split("\n"), 0
    for number, line in enumerate(lines):
        fields = [field.strip() for field in line.split(separator)]
        if len(fields) == columns and any(fields) and not all(fields):
            lines[number] = (separator or " ").join(field or "nan" for field in fields)
            count += 1
    return "\n".join(lines), count


def _fault(block: str, first_line: int, separator: str | None, columns: int) -> str:
    """Return a sentence about the first line that is not a line of finite numbers."""
    for line_number, line in _filled_lines(block, first_line):
        fields = line.split(separator)
        for field in fields:
            number = _number(field)
            if number is None:
                wrong = f"holds {quote(field.strip())}" if field.strip() else "lacks a number"
                return f"Line {line_number} {wrong}; {ALLOWED}."
            if not math.isfinite(number):
                return f"Line {line_number} holds {number}; {ALLOWED}."
        if len(fields) != columns:
            return f"Line {line_number} holds {len(fields)} numbers and the lines before it {columns}; {ALLOWED}."
    return f"The text cannot be read as numbers; {ALLOWED}."


def _interpolate(table: npt.NDArray[np.float64]) -> None:
    """Replace every NaN of the (columns, rows), in place, by linear interpolation between its neighbours."""
    for column in table:
        missing = np.isnan(column)
        column[missing] = np.interp(np.flatnonzero(missing), np.flatnonzero(~missing), column[~missing])
