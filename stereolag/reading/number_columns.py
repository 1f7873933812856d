"""Columns of numbers in a text, from untrusted bytes."""

from __future__ import annotations

import codecs
import io
import itertools
import math
from collections.abc import Iterator

import numpy as np
import numpy.typing as npt

from stereolag.reading.sources import quoted

ALLOWED = "allowed are finite numbers, in columns separated by comma, semicolon, tab or space"
COMMENT_MARKS = ("#", "%", "//")
MAX_HEADER_LINES = 200
MAX_LINE_LENGTH = 4096


def parse_columns(data: bytes, max_numbers: int) -> npt.NDArray[np.float64]:
    """Return the columns of a text as (columns, rows).

    Parameters
    ----------
    data
        The text: UTF-8, UTF-16 with its mark, or Latin-1; lines end in LF, CRLF or CR.
    max_numbers
        The most numbers that are accepted.

    Raises
    ------
    ValueError
        No number at all, too many, or a line that holds something else, a NUL byte, or another count of numbers than
        the first; the error tells the line.
    """
    text = _decoded(data)
    header_lines, separator, columns = _layout(text)
    most = (text.count("\n") + 1) * columns
    if most > max_numbers:
        raise ValueError(f"The text holds {most:,} numbers; at most {max_numbers:,} are accepted.")
    if separator != ",":
        text = text.replace(",", ".")  # a decimal comma
    try:
        table = np.loadtxt(
            io.StringIO(text),
            delimiter=separator,
            comments=[mark for mark in COMMENT_MARKS if mark in text] or None,
            skiprows=header_lines,
            ndmin=2,
        )
    except ValueError:
        raise ValueError(_what_is_wrong(text, header_lines, separator)) from None
    if not np.isfinite(table).all():
        raise ValueError(_what_is_wrong(text, header_lines, separator))
    return np.ascontiguousarray(table.T)


def _decoded(data: bytes) -> str:
    if data.startswith((codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE)):
        text = data.decode("utf-16", errors="replace")
    else:
        try:
            text = data.decode("utf-8-sig")
        except UnicodeDecodeError:
            text = data.decode("latin-1")
    text = text.replace("\r\n", "\n").replace("\r", "\n")
    if "\0" in text:
        line = text.count("\n", 0, text.index("\0")) + 1
        raise ValueError(f"Line {line} holds a NUL byte; {ALLOWED}.")
    return text


def _lines(text: str) -> Iterator[tuple[int, str]]:
    """Yield the lines that are neither blank nor a comment, with their numbers from 1."""
    for number, line in enumerate(io.StringIO(text), start=1):
        content = line
        for mark in COMMENT_MARKS:
            content = content.partition(mark)[0]
        if content.strip():
            yield number, content.strip()


def _layout(text: str) -> tuple[int, str | None, int]:
    """Return the lines before the first line of numbers, what separates its columns (None: spaces), their count."""
    for number, line in itertools.islice(_lines(text), MAX_HEADER_LINES):
        if len(line) > MAX_LINE_LENGTH:
            raise ValueError(f"Line {number} is {len(line):,} characters long; allowed are {MAX_LINE_LENGTH:,}.")
        for separator in (";", "\t", ",", None):
            if (separator is None or separator in line) and _is_numeric(line, separator):
                return number - 1, separator, len(line.split(separator))
    raise ValueError(f"No line of the text holds numbers alone; {ALLOWED}.")


def _is_numeric(line: str, separator: str | None) -> bool:
    fields = line.split(separator)
    return all(_number(field if separator == "," else field.replace(",", ".")) is not None for field in fields)


def _number(field: str) -> float | None:
    """Return the number in a field, if it holds one such as NumPy reads."""
    if "_" in field:
        return None
    try:
        return float(field)
    except ValueError:
        return None


def _what_is_wrong(text: str, header_lines: int, separator: str | None) -> str:
    """Find the first line that is no line of finite numbers, and say so."""
    columns = None
    for line_number, line in itertools.dropwhile(lambda numbered: numbered[0] <= header_lines, _lines(text)):
        fields = line.split(separator)
        for field in fields:
            number = _number(field)
            if number is None:
                wrong = f"holds {quoted(field.strip())}" if field.strip() else "lacks a number"
                return f"Line {line_number} {wrong}; {ALLOWED}."
            if not math.isfinite(number):
                return f"Line {line_number} holds {number}; {ALLOWED}."
        columns = columns or len(fields)
        if len(fields) != columns:
            return f"Line {line_number} holds {len(fields)} numbers and the lines before it {columns}; {ALLOWED}."
    return f"The text cannot be read as numbers; {ALLOWED}."
