"""Small damage to a text of numbers, mended where it is rare: stray NUL bytes and empty fields."""

from __future__ import annotations

import re

import numpy as np
import numpy.typing as npt

MOST_LINES = 5
LINES_PER_MENDED = 100
"""No more than so many lines are mended, and no more than one of so many."""

_MOST_NULS = 100

_STRAY_NULS = re.compile(rb"(?<=[0-9.])\0+(?=[ \t,;\r\n]|\Z)")
"""NUL bytes behind a whole number."""


class Mending:
    """How many lines of a text were mended, and whether that is still few.

    Parameters
    ----------
    data
        The text as it is in the file.
    """

    def __init__(self, data: bytes) -> None:
        ends = max(data.count(b"\n"), data.count(b"\r"))
        self.allowed = min(MOST_LINES, (ends + 1) // LINES_PER_MENDED)
        self.lines = 0

    def without_nuls(self, data: bytes) -> bytes:
        """Return the text without the NUL bytes that follow whole numbers; as it is where they are not few."""
        if not self.allowed or not 0 < data.count(b"\0") <= _MOST_NULS:
            return data
        ends = {_end_of_line(data, found.end()) for found in _STRAY_NULS.finditer(data)}
        if not self._grants(len(ends)):
            return data
        return _STRAY_NULS.sub(b"", data)

    def filled(self, chunk: str, separator: str | None, columns: int) -> str:
        """Return whole lines with ``nan`` in the fields that are empty; as they are where they are not few.

        The last column may be missing with what separates it from others still there.
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
    """Put a straight line between its neighbours in place of every NaN of the (columns, rows), in place."""
    for column in table:
        missing = np.flatnonzero(np.isnan(column))
        if missing.size:
            known = np.flatnonzero(~np.isnan(column))
            column[missing] = np.interp(missing, known, column[known])


def _end_of_line(data: bytes, position: int) -> int:
    ends = [found for mark in (b"\n", b"\r") if (found := data.find(mark, position, position + 2**13)) >= 0]
    return min(ends, default=len(data))
