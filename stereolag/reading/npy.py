"""Arrays saved by NumPy, from untrusted bytes: no pickles, and no more memory than the file has bytes."""

from __future__ import annotations

import io
import math
from typing import Any

import numpy as np
import numpy.typing as npt

from stereolag.reading.sources import no_warnings

MAGIC = b"\x93NUMPY"


def parse_npy(data: bytes, what: str) -> npt.NDArray[Any]:
    """Return the array of numbers in the bytes of an ``.npy`` file (a read-only view of them where possible).

    ``np.load`` would allocate what the header claims before it looks for the data; this does not.

    Raises
    ------
    ValueError
        A broken header, objects or text in place of real numbers, or fewer bytes than the header claims.
    """
    stream = io.BytesIO(data)
    try:
        with no_warnings():
            version = np.lib.format.read_magic(stream)
            read_header = np.lib.format.read_array_header_1_0 if version == (1, 0) else _read_header_2_0
            shape, fortran_order, dtype = read_header(stream)
    except Exception as error:  # the header is a Python literal: parsing a broken one raises many kinds of error
        raise ValueError(f"The {what} has the mark of an .npy file, but its header cannot be read.") from error
    if dtype.kind not in "biuf":
        raise ValueError(f"The {what} (.npy) holds {dtype.name}; allowed are integers and floats.")
    count, offset = math.prod(shape), stream.tell()
    if count < 0 or count * dtype.itemsize > len(data) - offset:
        raise ValueError(f"The {what} (.npy) is cut short: its header announces {count} numbers of {dtype.name}.")
    return np.frombuffer(data, dtype, count, offset).reshape(shape, order="F" if fortran_order else "C")


def _read_header_2_0(stream: io.BytesIO) -> tuple[tuple[int, ...], bool, np.dtype[Any]]:
    return np.lib.format.read_array_header_2_0(stream)
