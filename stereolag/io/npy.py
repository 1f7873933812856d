"""Arrays saved by NumPy, from untrusted bytes: no pickles, and no more memory than the file has bytes."""

from __future__ import annotations

import math
import re
from typing import Any

import numpy as np
import numpy.typing as npt

MAGIC = b"\x93NUMPY"
MAX_HEADER = 2**16
MAX_DIMENSIONS = 32

_TYPE = re.compile(r"""['"]descr['"] {0,9}: {0,9}['"]([<>|=]?)([A-Za-z?])(\d{0,9})['"]""")
_ORDER = re.compile(r"""['"]fortran_order['"] {0,9}: {0,9}(True|False) {0,9}[,}]""")
_SHAPE = re.compile(r"""['"]shape['"] {0,9}: {0,9}\(([\d, L]{0,999})\)""")
_KINDS = {"b": "bool", "i": "int", "u": "uint", "f": "float", "c": "complex", "O": "object"}
_BYTES = {"b": (1,), "i": (1, 2, 4, 8), "u": (1, 2, 4, 8), "f": (2, 4, 8)}


def parse_npy(data: bytes, what: str) -> npt.NDArray[Any]:
    """Return the array of numbers in the bytes of an ``.npy`` file (a read-only view of them).

    ``np.load`` would evaluate the header as Python and allocate what it claims before it looks for the data; this
    does neither.

    Raises
    ------
    ValueError
        A broken header, objects or text in place of real numbers, or fewer bytes than the header claims.
    """
    header, offset = _header(data, what)
    found_type, found_order, found_shape = _TYPE.search(header), _ORDER.search(header), _SHAPE.search(header)
    if "'descr': [" in header:
        raise ValueError(f"The {what} (.npy) holds records of several fields; allowed are integers and floats.")
    if found_type is None or found_order is None or found_shape is None:
        raise _unreadable(what)
    dtype = _dtype(found_type[1], found_type[2], found_type[3], what)
    sides = [side.strip().rstrip("L") for side in found_shape[1].split(",")]
    if len(sides) > MAX_DIMENSIONS or not all(side.isdecimal() and len(side) < 20 for side in sides if side):
        raise _unreadable(what)
    shape = tuple(int(side) for side in sides if side)
    count = math.prod(shape)
    if count * dtype.itemsize > len(data) - offset:
        raise ValueError(f"The {what} (.npy) is cut short: its header announces {count:.15g} numbers of {dtype.name}.")
    array = np.frombuffer(data, dtype, count, offset) if count else np.zeros(0, dtype)
    return array.reshape(shape, order="F" if found_order[1] == "True" else "C")


def _header(data: bytes, what: str) -> tuple[str, int]:
    """Return the header, a Python dictionary in its printed form, and the offset of the numbers."""
    width = 2 if data[6:7] == b"\x01" else 4
    length = int.from_bytes(data[8 : 8 + width], "little")
    end = 8 + width + length
    if data[6:7] not in (b"\x01", b"\x02", b"\x03") or length > MAX_HEADER or end > len(data):
        raise _unreadable(what)
    return data[8 + width : end].decode("latin-1"), end


def _dtype(order: str, kind: str, size: str, what: str) -> np.dtype[Any]:
    if kind in _BYTES and size.isdecimal() and int(size) in _BYTES[kind]:
        return np.dtype(f"{order}{kind}{size}")
    bits = f"{int(size) * 8}" if size and kind != "O" else ""
    name = f"{_KINDS[kind]}{bits}" if kind in _KINDS else "text, times or the like"
    raise ValueError(f"The {what} (.npy) holds {name}; allowed are integers and floats.")


def _unreadable(what: str) -> ValueError:
    return ValueError(f"The {what} has the mark of an .npy file, but its header cannot be read.")
