"""Mending of small, rare damage to a text of numbers: stray NUL bytes and empty fields."""

from __future__ import annotations

import re

import numpy as np
import numpy.typing as npt

MOST_LINES = 5
LINES_PER_MENDED = 100
"""At most `MOST_LINES` lines are mended, and at most one in `LINES_PER_MENDED`."""

_MOST_NULS = 100

_STRAY_NULS = re.compile(rb"(?<=[0-9.])\0+(?=[ \t,;\r\n]|\Z)")
"""NUL bytes directly after a complete number."""


class Mending:
    """The mending of one text, with a count of its mended lines and a limit on it.

    Parameters
    ----------
    data
        The text as stored in the file.
    """

    def __init__(self, data: bytes) -> None:
        ends = max(data.count(b"\n"), data.count(b"\r"))
        self.allowed = min(MOST_LINES, (ends + 1) // LINES_PER_MENDED)
        self.lines = 0

    def without_nuls(self, data: bytes) -> bytes:
        """Return the text without NUL bytes directly after complete numbers; unchanged if they are not few."""
        if not self.allowed or not 0 < data.count(b"\0") <= _MOST_NULS:
            return data
        ends = {_end_of_line(data, found.end()) for found in _STRAY_NULS.finditer(data)}
        if not self._grants(len(ends)):
            return data
        return _STRAY_NULS.sub(b"", data)

    def filled(self, chunk: str, separator: str | None, columns: int) -> str:
        """Return whole lines with ``nan`` in their empty fields; unchanged if such lines are not few.

        The last field may be empty, too, if the separator before it is still there.
        """
        if separator is None or not self.allowed:
            return chunk
        lines = chunk.split("\n")
        damaged = {}
        for number, line in enumerate(lines):
            fields = [field.strip() for field in line.split(separator)]
            if len(fields) == columns and any(fields) and not all(fields):
                damaged[number] = separator.join(field or "nan" for field in fields)
                if len(damaged) > self.allowed:
                    return chunk
        if not damaged or not self._grants(len(damaged)):
            return chunk
        for number, line in damaged.items():
            lines[number] = line
        return "\n".join(lines)

    def _grants(self, lines: int) -> bool:
        if self.lines + lines > self.allowed:
            return False
        self.lines += lines
        return True


def interpolate(table: npt.NDArray[np.float64]) -> None:
    """Replace every NaN of the (columns, rows), in place, by linear interpolation between its neighbours."""
    for column in table:
        missing = np.flatnonzero(np.isnan(column))
        if missing.size:
            known = np.flatnonzero(~np.isnan(column))
            column[missing] = np.interp(missing, known, column[known])


def _end_of_line(data: bytes, position: int) -> int:
    ends = [found for mark in (b"\n", b"\r") if (found := data.find(mark, position, position + 2**13)) >= 0]
    return min(ends, default=len(data))
