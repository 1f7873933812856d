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

from stereolag.io.mending import Mending, interpolate
from stereolag.io.sources import quoted

ALLOWED = "allowed are finite numbers, in columns separated by comma, semicolon, tab or space"
INSTEAD = "save it as WAV or NPY instead"
MAX_BYTES = 64 * 2**20
MAX_LINES = 10_000_000
MAX_NUMBERS = 20_000_000
MAX_HEADER_LINES = 200
MAX_LINE_LENGTH = 4096

_COMMENT = re.compile(r"(?:#|%|//)[^\n]*")
_CHUNK = 2**20


def parse_columns(data: bytes, max_numbers: int) -> tuple[npt.NDArray[np.float64], int]:
    """Return the columns of a text as (columns, rows), and the number of mended lines.

    A few lines (at most 5, and one in a hundred) may be damaged: NUL bytes after a complete number are removed, and an
    empty field is interpolated between the numbers above and below it.

    Parameters
    ----------
    data
        The text: UTF-8, UTF-16 with its byte order mark, or Latin-1; lines end in LF, CRLF or CR.
    max_numbers
        Largest count of numbers accepted, if below this reader's own limit.

    Raises
    ------
    ValueError
        No number at all, too many, too long a text or line, or a line with anything else, a NUL byte, or another count
        of numbers than the first; the error names the line.
    """
    mending = Mending(data)
    text = _decoded(mending.without_nuls(data))
    lines = _line_count(text)
    header_lines, separator, columns = _layout(text)
    most, allowed = lines * columns, min(max_numbers, MAX_NUMBERS)
    if most > allowed:
        raise ValueError(f"The text holds {most:,} numbers; at most {allowed:,} are accepted: {INSTEAD}.")
    table = np.empty((columns, lines))
    rows = 0
    for first_line, chunk in _chunks(text, header_lines):
        part = _numbers_of(chunk, first_line, separator, columns, mending)
        table[:, rows : rows + part.shape[1]] = part
        rows += part.shape[1]
    table = table if rows == lines else table[:, :rows].copy()
    if mending.lines:
        interpolate(table)
    return table, mending.lines


def _decoded(data: bytes) -> bytes:
    """Return the text in UTF-8, with lines ending in LF."""
    if not data.startswith((codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE)) and b"\0" in data:
        raise _holds_nul(data)
    if len(data) > MAX_BYTES:
        raise ValueError(
            f"The text has {len(data) / 1e6:.0f} MB; at most {MAX_BYTES / 1e6:.0f} MB are accepted: {INSTEAD}."
        )
    if data.startswith((codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE)):
        data = data.decode("utf-16", errors="replace").encode("utf-8", errors="replace")
    elif not data.isascii():
        data = data.removeprefix(codecs.BOM_UTF8)
        try:
            data.decode("utf-8")
        except UnicodeDecodeError:
            data = data.decode("latin-1").encode("utf-8")
    if b"\0" in data:
        raise _holds_nul(data)
    return data.replace(b"\r\n", b"\n").replace(b"\r", b"\n")


def _holds_nul(data: bytes) -> ValueError:
    before = data[: data.index(b"\0")].replace(b"\r\n", b"\n").replace(b"\r", b"\n")
    line = before.count(b"\n") + 1
    return ValueError(f"Line {line} holds a NUL byte; {ALLOWED}.")


def _line_count(text: bytes) -> int:
    """Return the number of lines; refuse too many or too long ones before any is processed."""
    lines = text.count(b"\n") + (not text.endswith(b"\n"))
    if lines > MAX_LINES:
        raise ValueError(f"The text has {lines:,} lines; at most {MAX_LINES:,} are accepted: {INSTEAD}.")
    ends = np.flatnonzero(np.frombuffer(text, np.uint8) == ord("\n"))
    lengths = np.diff(ends, prepend=-1, append=len(text)) - 1
    longest = int(lengths.argmax())
    if lengths[longest] > MAX_LINE_LENGTH:
        raise ValueError(
            f"Line {longest + 1} is {lengths[longest]:,} characters long; allowed are {MAX_LINE_LENGTH:,}."
        )
    return lines


def _chunks(text: bytes, skipped_lines: int = 0) -> Iterator[tuple[int, str]]:
    """Yield chunks of whole lines, about a megabyte each and not only comments, with their first line's number.

    Comments are removed, and the first `skipped_lines` are emptied.
    """
    line, start = 1, 0
    while start < len(text):
        end = text.find(b"\n", start + _CHUNK) + 1 or len(text)
        chunk = text[start:end].decode("utf-8", errors="replace")
        lines = chunk.count("\n")
        empty = min(max(0, skipped_lines + 1 - line), lines)
        if empty:
            chunk = "\n" * empty + chunk.split("\n", empty)[empty]
        chunk = _COMMENT.sub("", chunk)
        if not chunk.isspace() and chunk:
            yield line, chunk
        line, start = line + lines, end


def _lines(text: bytes) -> Iterator[tuple[int, str]]:
    """Yield the lines that are neither blank nor a comment, with their numbers from 1."""
    for first_line, chunk in _chunks(text):
        yield from _filled_lines(chunk, first_line)


def _filled_lines(chunk: str, first_line: int) -> Iterator[tuple[int, str]]:
    for number, line in enumerate(io.StringIO(chunk), start=first_line):
        if content := line.strip():
            yield number, content


def _layout(text: bytes) -> tuple[int, str | None, int]:
    """Return the number of lines before the first one of numbers, its separator (None: spaces) and column count."""
    for number, line in itertools.islice(_lines(text), MAX_HEADER_LINES):
        for separator in (";", "\t", ",", None):
            if (separator is None or separator in line) and _is_numeric(line, separator):
                return number - 1, separator, len(line.split(separator))
    raise ValueError(f"No line of the text holds numbers alone; {ALLOWED}.")


def _is_numeric(line: str, separator: str | None) -> bool:
    fields = line.split(separator)
    return all(_number(field if separator == "," else field.replace(",", ".")) is not None for field in fields)


def _number(field: str) -> float | None:
    """Return the number in a field as NumPy reads it, None if there is none."""
    if "_" in field:
        return None
    try:
        return float(field)
    except ValueError:
        return None


def _numbers_of(
    chunk: str, first_line: int, separator: str | None, columns: int, mending: Mending
) -> npt.NDArray[np.float64]:
    """Return the (columns, rows) of a chunk of the text, NaN where a field was empty."""
    if separator != ",":
        chunk = chunk.replace(",", ".")  # a decimal comma
    try:
        table = _loaded(chunk, separator)
    except ValueError:
        filled = mending.filled(chunk, separator, columns)
        if filled == chunk or _holds_nan(chunk):
            raise ValueError(_what_is_wrong(chunk, first_line, separator, columns)) from None
        try:
            table = _loaded(filled, separator)
        except ValueError:
            # The fields that could be filled are not the problem.
            sound = filled.replace("nan", "0")
            raise ValueError(_what_is_wrong(sound, first_line, separator, columns)) from None
        if table.shape[1] == columns and not np.isinf(table).any():
            return table.T
    if table.shape[1] != columns or not np.isfinite(table).all():
        raise ValueError(_what_is_wrong(chunk, first_line, separator, columns))
    return table.T


def _loaded(chunk: str, separator: str | None) -> npt.NDArray[np.float64]:
    return np.loadtxt(io.StringIO(chunk), delimiter=separator, comments=None, ndmin=2)


def _holds_nan(chunk: str) -> bool:
    return "nan" in chunk.lower()


def _what_is_wrong(chunk: str, first_line: int, separator: str | None, columns: int) -> str:
    """Return a sentence about the first line that is not a line of finite numbers."""
    for line_number, line in _filled_lines(chunk, first_line):
        fields = line.split(separator)
        for field in fields:
            number = _number(field)
            if number is None:
                wrong = f"holds {quoted(field.strip())}" if field.strip() else "lacks a number"
                return f"Line {line_number} {wrong}; {ALLOWED}."
            if not math.isfinite(number):
                return f"Line {line_number} holds {number}; {ALLOWED}."
        if len(fields) != columns:
            return f"Line {line_number} holds {len(fields)} numbers and the lines before it {columns}; {ALLOWED}."
    return f"The text cannot be read as numbers; {ALLOWED}."
